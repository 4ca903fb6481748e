//! `kagome calibrate coupon`: the jobs, drawings and guide of a coupon.

use std::path::PathBuf;

use clap::Args;

use crate::base::atomic::{check_directory, write_directory};
use crate::base::units::short;
use crate::calibrate::CouponWish;
use crate::cli::profiles::{machine_named, material_named};
use crate::cli::sheet_args::size;
use crate::cli::{Failure, Global, Terminal, print, print_json};
use crate::job::{COUPON_FILES, MakeError, make_coupon};

/// Arguments of `kagome calibrate coupon`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome calibrate coupon --material leather-1.6 --machine co2-600x400 --stock 200x250
  kagome calibrate coupon --hinge-width 0.8,1,1.3 --edge 9 -o strips-of-9

The folder holds settings.nc, kerf.nc and strips.nc, to be cut in this order on one piece, and guide.html, to be printed.")]
pub(super) struct CouponArgs {
    /// Machine profile, by name (see `kagome machines list`) or file
    #[arg(long, value_name = "NAME|FILE", default_value = crate::machine::DEFAULT)]
    pub(super) machine: String,
    /// Material profile, by name (see `kagome materials list`) or file
    #[arg(long, value_name = "NAME|FILE", default_value = crate::material::DEFAULT)]
    pub(super) material: String,
    /// Size of the piece in the bed's corner, millimetres [default: the material's, else the bed]
    #[arg(long, value_name = "WxH", value_parser = size)]
    stock: Option<[f64; 2]>,
    /// Widths of the hinges, millimetres [default: 0.7, 1 and 1.4 of the material's own]
    #[arg(long, value_name = "MM,MM", value_delimiter = ',')]
    hinge_width: Vec<f64>,
    /// Edges of the triangles, millimetres [default: two that suit the hinges]
    #[arg(long, value_name = "MM,MM", value_delimiter = ',')]
    edge: Vec<f64>,
    /// The folder to write [default: MATERIAL-coupon]
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: Option<PathBuf>,
    /// Replace a coupon that is there already
    #[arg(long)]
    pub(super) force: bool,
}

impl CouponArgs {
    pub(super) fn wish(&self) -> CouponWish {
        CouponWish {
            hinge_widths_mm: self.hinge_width.clone(),
            edges_mm: self.edge.clone(),
            stock_mm: self.stock,
        }
    }
}

/// Runs the verb.
///
/// # Errors
/// [`Failure::No`] if a job is not good, [`Failure::Bad`] for profiles or sizes that cannot be used; nothing is written then.
pub(super) fn run(args: &CouponArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let machine = machine_named(&args.machine).map_err(Failure::bad)?;
    let material = material_named(&args.material).map_err(Failure::bad)?;
    let folder = match &args.output {
        Some(folder) => folder.clone(),
        None => {
            let loaded = crate::material::load(&material).map_err(Failure::bad)?;
            PathBuf::from(format!("{}-coupon", loaded.name))
        }
    };
    check_directory(&folder, &COUPON_FILES, args.force).map_err(Failure::bad)?;
    // Readings are evidence: replacing the coupon must not take them along.
    let readings = folder.join("readings.toml");
    if readings.exists() {
        return Err(Failure::Bad(format!(
            "{} has readings of the coupon that is there: choose another place with -o",
            folder.display()
        )));
    }
    let made = make_coupon(&args.wish(), &machine, &material, terminal)
        .map_err(|e: MakeError| Failure::bad(e))?;
    terminal.clear();
    if !made.objections.is_empty() {
        return Err(Failure::No(format!(
            "the coupon cannot be cut as it is; nothing was written\n  - {}",
            made.objections.join("\n  - ")
        )));
    }
    write_directory(&folder, &made.files, &COUPON_FILES, args.force).map_err(Failure::bad)?;
    let plan = &made.plan;
    if !global.quiet && !plan.left_out.is_empty() {
        let names: Vec<&str> = plan.left_out.iter().map(|s| s.name.as_str()).collect();
        eprintln!(
            "warning: no room on the stock for {}; more strips make a tighter σ (--stock)",
            names.join(", ")
        );
    }
    if global.json {
        return print_json(&serde_json::json!({
            "written": folder,
            "coupon": plan.coupon,
            "used_mm": [plan.used.width(), plan.used.height()],
            "jobs": made.figures,
        }));
    }
    if global.quiet {
        return Ok(());
    }
    print(&format!(
        "{0}: {1} strips on {2} x {3} mm, {4} min on the machine; every job verified{5}\n  print {0}/guide.html, then cut {6}",
        folder.display(),
        plan.coupon.strip.len(),
        short(plan.used.width().ceil(), 0),
        short(plan.used.height().ceil(), 0),
        short((made.machine_s / 60.0).ceil(), 0),
        if made.figures["strips"]["rehearsal"].is_null() {
            ""
        } else {
            " and rehearsed"
        },
        plan.jobs
            .iter()
            .map(|job| format!("{}.nc", job.name))
            .collect::<Vec<_>>()
            .join(", "),
    ))
}
