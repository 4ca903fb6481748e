//! `kagome calibrate record`: what was read from a coupon becomes `readings.toml`.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use clap::Args;

use super::dialogue::ask;
use super::today;
use crate::base::atomic::write_file;
use crate::base::progress::Progress as _;
use crate::calibrate::{Coupon, Readings};
use crate::cli::question::TypedLines;
use crate::cli::{Failure, Global, Terminal, print_json};

/// Arguments of `kagome calibrate record`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "READINGS is the coupon's readings.csv with its lines filled in, or TOML:
  [[strip]]  name = \"A1\", held = 1.35, tore = 1.4, failure = \"torn\"
  [[kerf]]   name = \"K1-HOLE\", measured_mm = 19.94
  [[setting]]  name = \"P3\", cut_through = true
What was not measured stays empty. Without --readings a dialogue asks for one after the other."
)]
pub(super) struct RecordArgs {
    /// The coupon: its folder, or its coupon.toml
    coupon: PathBuf,
    /// What was written down, CSV or TOML [default: a dialogue]
    #[arg(long, value_name = "FILE")]
    readings: Option<PathBuf>,
    /// The file to write [default: readings.toml beside coupon.toml]
    #[arg(short, long, value_name = "FILE.toml")]
    output: Option<PathBuf>,
    /// The day of the readings, YYYY-MM-DD [default: today]
    #[arg(long)]
    date: Option<String>,
    /// Replace earlier readings
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &RecordArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let (file, coupon) = coupon(&args.coupon)?;
    let output = args
        .output
        .clone()
        .unwrap_or_else(|| file.with_file_name("readings.toml"));
    // Before a dialogue: nobody wants to answer twice.
    if output.exists() && !args.force {
        return Err(Failure::Bad(format!(
            "{} exists already; add --force to replace these readings, or choose another file with -o",
            output.display()
        )));
    }
    let date = args.date.clone().unwrap_or_else(today);
    crate::material::check_date("--date", &date).map_err(Failure::bad)?;
    let readings = match &args.readings {
        Some(path) => {
            let text = text_of(path)?;
            Readings::read(&path.display().to_string(), &text, &coupon, &date)
                .map_err(Failure::bad)?
        }
        None => {
            if !std::io::stdin().is_terminal() {
                let beside = file.with_file_name("readings.csv");
                return Err(Failure::Bad(format!(
                    "there is no terminal to ask on: fill in {} and give it with --readings",
                    beside.display()
                )));
            }
            ask(
                &coupon,
                &date,
                &mut TypedLines::new(terminal),
                &mut std::io::stderr().lock(),
            )?
        }
    };
    write_file(&output, readings.to_text().as_bytes()).map_err(Failure::bad)?;
    let doubts = readings.doubts();
    for doubt in &doubts {
        terminal.note(&format!("looks wrong: {doubt}"));
    }
    if global.json {
        return print_json(&serde_json::json!({
            "file": output, "readings": readings, "doubts": doubts,
        }));
    }
    terminal.note(&format!(
        "{}: {} strip(s), {} kerf piece(s), {} setting(s); then: kagome calibrate fit {}",
        output.display(),
        readings.strips.len(),
        readings.kerf.len(),
        readings.setting.len(),
        output.display()
    ));
    Ok(())
}

/// The coupon of a folder or a file, with the file.
fn coupon(path: &Path) -> Result<(PathBuf, Coupon), Failure> {
    let file = if path.is_dir() {
        path.join("coupon.toml")
    } else {
        path.to_path_buf()
    };
    let text = text_of(&file)?;
    let coupon = Coupon::parse(&file.display().to_string(), &text).map_err(Failure::bad)?;
    Ok((file, coupon))
}

pub(super) fn text_of(path: &Path) -> Result<String, Failure> {
    let bytes = std::fs::read(path)
        .map_err(|e| Failure::Bad(format!("cannot read {}: {e}", path.display())))?;
    String::from_utf8(bytes).map_err(|_| {
        Failure::Bad(format!(
            "{} is not text in UTF-8: in the spreadsheet, save it as \"CSV UTF-8\"",
            path.display()
        ))
    })
}
