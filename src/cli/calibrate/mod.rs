//! `kagome calibrate`: σ and kerf of a sheet, measured on a coupon.

mod coupon;
mod dialogue;
mod fit;
mod outcome;
mod record;
mod rehearse;
mod upgrade;

use std::time::{SystemTime, UNIX_EPOCH};

use clap::{Args, Subcommand};

use super::{Failure, Global, Terminal};

/// Options of `kagome calibrate`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome calibrate coupon --material leather-1.6 -o leather-coupon
  kagome calibrate record leather-coupon --readings leather-coupon/readings.csv
  kagome calibrate record leather-coupon
  kagome calibrate fit leather-coupon/readings.toml
  kagome make scan.obj --material leather-1.6-measured")]
pub struct CalibrateArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Clone, Debug)]
enum What {
    /// Jobs, drawings and a guide for a small sheet of strips, squares and a gauge card
    Coupon(coupon::CouponArgs),
    /// Write down what was read from a coupon, from a file or in a dialogue: readings.toml
    Record(record::RecordArgs),
    /// From readings to σ with a stated confidence, kerf and setting, in a profile of your own
    Fit(fit::FitArgs),
    /// The whole evening without a machine: a coupon cut, pulled, recorded and fitted in simulation, and a sheet made of it
    Rehearse(Box<rehearse::RehearseArgs>),
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`]: readings that cannot be are bad input; readings that give no bound are a no.
pub fn run(args: &CalibrateArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    match &args.what {
        What::Coupon(args) => coupon::run(args, global, terminal),
        What::Record(args) => record::run(args, global, terminal),
        What::Fit(args) => fit::run(args, global, terminal),
        What::Rehearse(args) => rehearse::run(args, global, terminal),
    }
}

/// Today's date, `YYYY-MM-DD`, in Greenwich.
fn today() -> String {
    let seconds = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |d| d.as_secs());
    day((seconds / 86_400) as i64)
}

/// The date so many days after 1970-01-01.
fn day(days: i64) -> String {
    // Years begin in March, so that the leap day is the last: 400 of them have 146 097 days.
    let since = days + 719_468;
    let era = since.div_euclid(146_097);
    let of_era = since.rem_euclid(146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let date = of_year - (153 * month + 2) / 5 + 1;
    let (month, more) = if month < 10 {
        (month + 3, 0)
    } else {
        (month - 9, 1)
    };
    format!("{:04}-{month:02}-{date:02}", year + 400 * era + more)
}

#[cfg(test)]
mod tests {
    use super::day;

    #[test]
    fn days_are_dates() {
        for (days, date) in [
            (0, "1970-01-01"),
            (58, "1970-02-28"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (11_017, "2000-03-01"),
            (11_322, "2000-12-31"),
            (20_604, "2026-05-31"),
            (47_540, "2100-02-28"),
            (47_541, "2100-03-01"),
        ] {
            assert_eq!(day(days), date);
        }
    }
}
