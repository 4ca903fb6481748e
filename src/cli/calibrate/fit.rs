//! `kagome calibrate fit`: from readings to σ, kerf and setting in a profile.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::outcome::{Machined, Reference, Strips, machined, middle, strips};
use super::record::text_of;
use super::upgrade::{Base, base, measured};
use crate::base::atomic::write_file;
use crate::base::progress::Progress as _;
use crate::base::units::short;
use crate::calibrate::{CONFIDENCES, Geometry, Readings, not_counted_yet};
use crate::cli::profiles::{machine_named, own_folder};
use crate::cli::{Failure, Global, Terminal, print, print_json};
use crate::job::{FitPlot, with_fit};
use crate::machine;
use crate::material::Reading;
use crate::pattern::Tip;

/// Arguments of `kagome calibrate fit`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "The σ in the profile is stated for one sheet: with the profile's hinge width and thickness, the edge in the middle of
the strips, and 1000 hinges that are all open to σ. `kagome make` asks the strips anew for its own sheet."
)]
pub(super) struct FitArgs {
    /// readings.toml of one or more coupons of one material, or their folders
    #[arg(required = true, value_name = "READINGS")]
    readings: Vec<PathBuf>,
    /// The material's profile [default: the one that the coupon was made for]
    #[arg(long, value_name = "NAME|FILE")]
    material: Option<String>,
    /// Probability that no hinge of the sheet fails, 0.5 to 0.999
    #[arg(long, default_value_t = 0.9, value_name = "P")]
    confidence: f64,
    /// Hinges of the sheet for which σ is stated [default: the profile's]
    #[arg(long, value_name = "MM")]
    hinge_width: Option<f64>,
    /// Edge of its triangles [default: that in the middle of the strips]
    #[arg(long, value_name = "MM")]
    edge: Option<f64>,
    /// How many hinges it has
    #[arg(long, default_value_t = 1000, value_name = "N")]
    hinges: usize,
    /// Name of the profile to write [default: the same if it is one of your own, else NAME-measured]
    #[arg(long, value_name = "NEW")]
    name: Option<String>,
    /// Take the cleanest setting into the profile, although kerf and strips were cut with another
    #[arg(long)]
    take_setting: bool,
    /// Say what comes out, and write nothing
    #[arg(long)]
    dry_run: bool,
}

impl FitArgs {
    /// A fit of these readings into a profile of this name, with everything else left to the program.
    pub(super) fn of(readings: PathBuf, material: &str, name: String, confidence: f64) -> Self {
        Self {
            readings: vec![readings],
            material: Some(material.to_owned()),
            confidence,
            hinge_width: None,
            edge: None,
            hinges: 1000,
            name: Some(name),
            take_setting: false,
            dry_run: false,
        }
    }
}

/// What a fit found and did.
pub(super) struct Outcome {
    pub base: Base,
    pub found: Option<Strips>,
    pub machines: Vec<Machined>,
    fresh: usize,
    known: Vec<String>,
    notes: Vec<String>,
    /// The profile, if it was written.
    pub written: Option<PathBuf>,
    unchanged: bool,
}

impl Outcome {
    /// Why there is no σ.
    pub fn refused(&self) -> Option<&str> {
        self.found.as_ref()?.refused.as_deref()
    }
}

pub(super) fn run(args: &FitArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let outcome = carry_out(args, own_folder().as_deref(), terminal)?;
    if global.json {
        print_json(&json!({
            "material": outcome.base.material.name,
            "confidence": args.confidence,
            "strips": outcome.found,
            "fresh": outcome.fresh,
            "counted_already": outcome.known,
            "machines": outcome.machines,
            "notes": outcome.notes,
            "profile": outcome.base.name,
            "written": outcome.written,
        }))?;
    } else {
        let mut lines = lines(
            &outcome.base.material.name,
            outcome.found.as_ref(),
            &outcome.machines,
            args.confidence,
        );
        lines.extend(outcome.notes.iter().cloned());
        let name = &outcome.base.name;
        lines.push(match (&outcome.written, outcome.unchanged) {
            (Some(file), _) => {
                format!("Written to {}; --material {name} finds it", file.display())
            }
            (None, true) => format!("{name} has all of this already"),
            (None, false) if outcome.refused().is_some() => String::new(),
            (None, false) => format!("nothing is written; it would be {name}"),
        });
        lines.retain(|l| !l.is_empty());
        if !lines.is_empty() {
            print(&lines.join("\n"))?;
        }
    }
    match outcome.refused() {
        None => Ok(()),
        Some(why) => Err(Failure::No(format!("there is no σ: {why}"))),
    }
}

/// Whether it is a confidence that can be asked for.
///
/// # Errors
/// [`Failure::Bad`].
pub(super) fn check_confidence(confidence: f64) -> Result<(), Failure> {
    if CONFIDENCES.contains(&confidence) {
        return Ok(());
    }
    Err(Failure::Bad(format!(
        "a confidence of {confidence} is not between {} and {}",
        CONFIDENCES.start(),
        CONFIDENCES.end()
    )))
}

/// Fits, and writes the profile into the folder `own` of a person's profiles. Guides beside the readings get the picture.
///
/// # Errors
/// [`Failure`]: readings or profiles that cannot be used; readings from which nothing can be fitted.
pub(super) fn carry_out(
    args: &FitArgs,
    own: Option<&Path>,
    terminal: &Terminal,
) -> Result<Outcome, Failure> {
    check_confidence(args.confidence)?;
    let all = read(args)?;
    let base = base(&material(args, &all)?, args.name.as_deref(), own)?;
    let new: Vec<Reading> = all.iter().flat_map(|r| r.strips.clone()).collect();
    let (fresh, known) = not_counted_yet(&base.material.sigma.sample, &new);
    if !known.is_empty() {
        terminal.note(&format!(
            "in the profile already with the same day and values, and counted once: {}. If strips of another coupon are meant, give them other names in their readings",
            known.join(", ")
        ));
    }
    for readings in &all {
        for doubt in readings.doubts() {
            terminal.note(&format!("looks wrong: {doubt}"));
        }
    }
    let machines = machined(&all, args.confidence)?;
    let pulled: Vec<Reading> = base
        .material
        .sigma
        .sample
        .iter()
        .chain(&fresh)
        .cloned()
        .collect();
    let found = if new.is_empty() {
        None
    } else {
        let reference = reference(args, &base, &pulled, &machines)?;
        Some(strips(&pulled, reference, args.confidence)?)
    };
    let dates = all
        .iter()
        .flat_map(|r| std::iter::once(&r.date).chain(r.strips.iter().map(|s| &s.date)));
    let date = dates.max().cloned().unwrap_or_default();
    let (changes, notes) = measured(
        &base,
        found.as_ref(),
        &fresh,
        &machines,
        args.confidence,
        &date,
        args.take_setting,
    );
    let mut outcome = Outcome {
        base,
        found,
        machines,
        fresh: fresh.len(),
        known,
        notes,
        written: None,
        unchanged: false,
    };
    if outcome.refused().is_none() {
        match outcome.base.amended(&changes)? {
            None => outcome.unchanged = true,
            Some(_) if args.dry_run => {}
            Some(text) => outcome.written = Some(outcome.base.write(&text)?.to_path_buf()),
        }
    }
    if let Some(found) = outcome.found.as_ref().filter(|_| !args.dry_run) {
        draw(args, found, &pulled, terminal);
    }
    Ok(outcome)
}

/// Puts the picture into the guides beside the readings. What was fitted stands without it.
fn draw(args: &FitArgs, found: &Strips, pulled: &[Reading], terminal: &Terminal) {
    let plot = FitPlot {
        readings: pulled,
        calibration: &found.calibration,
        sheet: (found.reference.geometry, found.reference.hinges),
        bound: found.bound.as_ref(),
        confidence: args.confidence,
    };
    for path in &args.readings {
        let guide = file_of(path).with_file_name("guide.html");
        let Ok(text) = std::fs::read_to_string(&guide) else {
            continue;
        };
        let Some(with) = with_fit(&text, &plot) else {
            continue;
        };
        match write_file(&guide, with.as_bytes()) {
            Ok(()) => terminal.note(&format!(
                "{}: readings, fit and bound are drawn at its end",
                guide.display()
            )),
            Err(error) => terminal.note(&format!(
                "the guide stays without the picture of the fit: {error}"
            )),
        }
    }
}

/// readings.toml of a folder.
fn file_of(path: &Path) -> PathBuf {
    if path.is_dir() {
        path.join("readings.toml")
    } else {
        path.to_path_buf()
    }
}

fn lines(
    material: &str,
    found: Option<&Strips>,
    machines: &[Machined],
    confidence: f64,
) -> Vec<String> {
    let mut lines = found.map_or_else(Vec::new, |f| f.lines(material, confidence));
    for own in machines {
        if let Some(kerf) = &own.kerf {
            lines.push(format!(
                "kerf on {}: {} mm ({} to {} with confidence {})",
                own.machine,
                short(kerf.kerf_mm, 3),
                short(kerf.interval_mm[0], 3),
                short(kerf.interval_mm[1], 3),
                kerf.confidence
            ));
            if let Some(scale) = kerf.scale_error.filter(|s| s.abs() > 0.002) {
                lines.push(format!(
                    "  the machine draws {} % {}: mind its steps per millimetre",
                    short(100.0 * scale.abs(), 2),
                    if scale > 0.0 {
                        "too large"
                    } else {
                        "too small"
                    }
                ));
            }
        }
        if let Some(best) = &own.cleanest {
            lines.push(format!(
                "cleanest setting on {}: {}, {} % at {} mm/min, the least heat that cut through",
                own.machine,
                best.name,
                short(best.power_percent, 1),
                short(best.speed_mm_per_min, 1)
            ));
        }
    }
    lines
}

fn read(args: &FitArgs) -> Result<Vec<Readings>, Failure> {
    let one = |path: &PathBuf| {
        let file = file_of(path);
        Readings::parse(&file.display().to_string(), &text_of(&file)?).map_err(Failure::bad)
    };
    args.readings.iter().map(one).collect()
}

/// The material that is meant.
fn material(args: &FitArgs, all: &[Readings]) -> Result<String, Failure> {
    if let Some(name) = &args.material {
        return Ok(name.clone());
    }
    // There is one at the least.
    let first = all.first().map(|r| r.material.clone()).unwrap_or_default();
    match all.iter().find(|r| r.material != first) {
        None => Ok(first),
        Some(other) => Err(Failure::Bad(format!(
            "these are readings of {first} and of {}: fit them apart, or say with --material that they are one",
            other.material
        ))),
    }
}

/// The sheet for which σ is stated.
fn reference(
    args: &FitArgs,
    base: &Base,
    pulled: &[Reading],
    machines: &[Machined],
) -> Result<Reference, Failure> {
    let material = &base.material;
    let measured = machines.iter().find_map(|m| m.kerf.map(|k| k.kerf_mm));
    let set = || {
        machines.iter().find_map(|m| {
            let machine = machine::load(&machine_named(&m.machine).ok()?).ok()?;
            Some(material.cut_for(&machine).ok()?.kerf_mm)
        })
    };
    let kerf_mm = measured
        .or_else(set)
        .or_else(|| middle(pulled.iter().map(|r| r.kerf_mm)))
        .unwrap_or(0.2);
    let tip = material.tip.map_or(Tip::Plain, Tip::from);
    let edge_mm = args
        .edge
        .or_else(|| middle(pulled.iter().map(|r| r.edge_mm)))
        .unwrap_or(10.0);
    let geometry = Geometry {
        hinge_width_mm: args.hinge_width.unwrap_or(material.hinge_width_mm),
        kerf_mm,
        tip_radius_mm: tip.radius_mm(kerf_mm),
        thickness_mm: material.thickness_mm,
        edge_mm,
    };
    if !geometry.is_sound() || args.hinges == 0 {
        return Err(Failure::Bad(format!(
            "there is no sheet of {} hinges of {} mm on edges of {} mm: see --hinge-width, --edge and --hinges",
            args.hinges, geometry.hinge_width_mm, geometry.edge_mm
        )));
    }
    Ok(Reference {
        geometry,
        hinges: args.hinges,
    })
}
