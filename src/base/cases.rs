//! How many random cases a property is tried with, in tests.

use proptest::test_runner::Config;

/// This many; where the environment says otherwise (`PROPTEST_CASES`), as many as it says: thousands find what is rare.
pub fn cases(usual: u32) -> Config {
    let config = Config::default();
    if std::env::var_os("PROPTEST_CASES").is_some() {
        return config;
    }
    Config {
        cases: usual,
        ..config
    }
}
