//! The `kagome` program: see [`kagome::cli`].

fn main() -> std::process::ExitCode {
    kagome::cli::run(std::env::args_os())
}
