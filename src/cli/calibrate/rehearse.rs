//! `kagome calibrate rehearse`: the whole evening on a simulated bench, from coupon to sheet.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;

use super::coupon::CouponArgs;
use super::fit::{FitArgs, carry_out, check_confidence};
use crate::base::atomic::{check_directory, write_directory};
use crate::base::units::{fixed, short};
use crate::calibrate::{
    Coupon, Demand, Geometry, Law, Readings, SimulatedBench, SimulatedMaterial,
};
use crate::cli::profiles::{machine_named, material_named};
use crate::cli::surface_args::source;
use crate::cli::{Failure, Global, Terminal, print, print_json};
use crate::conformal::Sizing;
use crate::job::{COUPON_FILES, FILES, Made, MakeError, Request, make, make_coupon};
use crate::material::{self, Material};
use crate::mesh::{ImportOptions, Units};
use crate::pattern::Tip;

/// The day that simulated readings are of: what comes out is the same on every day.
const DATE: &str = "2000-01-01";

/// Sheets that are opened at the end.
const SHEETS: u32 = 1000;

/// How a hinge's limit scatters.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum LawArg {
    Normal,
    Weibull,
}

/// Arguments of `kagome calibrate rehearse`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "The simulated sheet has limits that only this verb knows: half of its hinges have failed at --hidden-sigma, and the others
around it with --spread. FOLDER/coupon is what `calibrate coupon` writes, with the readings and the guide; FOLDER/profiles
has the profile; FOLDER/sheet is what `make` makes with it."
)]
pub(super) struct RehearseArgs {
    #[command(flatten)]
    coupon: CouponArgs,
    /// Stretch at which half of the hidden material's hinges have failed [default: the profile's σ]
    #[arg(long, value_name = "SIGMA")]
    hidden_sigma: Option<f64>,
    /// Spread of its hinges, per cent of that stretch
    #[arg(long, default_value_t = 4.0, value_name = "PERCENT")]
    spread: f64,
    /// Law of that spread
    #[arg(long, value_enum, default_value_t = LawArg::Normal)]
    law: LawArg,
    /// Noise of a reading of the gauge, per cent
    #[arg(long, default_value_t = 1.0, value_name = "PERCENT")]
    noise: f64,
    /// What the beam takes away more than the profile says, millimetres
    #[arg(
        long,
        default_value_t = 0.02,
        value_name = "MM",
        allow_negative_numbers = true
    )]
    more_kerf: f64,
    /// Another material, and another evening, for each seed
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Probability that no hinge of the sheet fails, 0.5 to 0.999
    #[arg(long, default_value_t = 0.9, value_name = "P")]
    confidence: f64,
    /// The surface to make with what was found
    #[arg(long, default_value = "sample:cap:half_angle_deg=45,faces=2000")]
    surface: String,
    /// Its size, millimetres [default: twelve triangles as large as the coupon's largest]
    #[arg(long, value_name = "MM")]
    size: Option<f64>,
}

pub(super) fn run(
    args: &RehearseArgs,
    global: &Global,
    terminal: &Terminal,
) -> Result<(), Failure> {
    check(args)?;
    let machine = machine_named(&args.coupon.machine).map_err(Failure::bad)?;
    let name = material_named(&args.coupon.material).map_err(Failure::bad)?;
    let profile = material::load(&name).map_err(Failure::bad)?;
    let folder = match &args.coupon.output {
        Some(folder) => folder.clone(),
        None => PathBuf::from(format!("{}-rehearsal", profile.name)),
    };
    let [cut, sheet] = ["coupon", "sheet"].map(|part| folder.join(part));
    let force = args.coupon.force;
    if folder.is_dir() {
        check_directory(&cut, &COUPON_FILES, force).map_err(Failure::bad)?;
        check_directory(&sheet, &FILES, force).map_err(Failure::bad)?;
    }
    let measured = format!("{}-measured", profile.name);
    // Readings of an earlier rehearsal are not of this material.
    let earlier = material::own_file(&folder, &measured).filter(|file| file.is_file());
    if let Some(file) = earlier.as_ref().filter(|_| !force) {
        return Err(Failure::Bad(format!(
            "{} is of an earlier rehearsal: add --force to replace it, or choose another folder with -o",
            file.display()
        )));
    }

    // The coupon, its jobs proved and rehearsed as any other.
    let mut made = make_coupon(&args.coupon.wish(), &machine, &name, terminal)
        .map_err(|e: MakeError| Failure::bad(e))?;
    if !made.objections.is_empty() {
        return Err(Failure::No(format!(
            "the coupon cannot be cut as it is\n  - {}",
            made.objections.join("\n  - ")
        )));
    }
    let coupon = &made.plan.coupon;
    let drawn = middle_of(coupon, &profile)?;
    let mut bench = bench(args, &profile, coupon, drawn);
    let table = bench.write_down(coupon, DATE);
    let file = cut.join("readings.csv").display().to_string();
    let readings = Readings::read(&file, &table, coupon, DATE).map_err(Failure::bad)?;
    for (name, bytes) in &mut made.files {
        if *name == "readings.csv" {
            *bytes = table.clone().into_bytes();
        }
    }
    made.files
        .push(("readings.toml", readings.to_text().into_bytes()));
    std::fs::create_dir_all(&folder)
        .map_err(|e| Failure::Bad(format!("{} cannot be made: {e}", folder.display())))?;
    write_directory(&cut, &made.files, &COUPON_FILES, force).map_err(Failure::bad)?;

    // The fit, into profiles of this folder alone.
    if let Some(file) = &earlier {
        std::fs::remove_file(file)
            .map_err(|e| Failure::Bad(format!("{} cannot be replaced: {e}", file.display())))?;
    }
    let fit = FitArgs::of(cut.clone(), &name, measured, args.confidence);
    let fitted = carry_out(&fit, Some(&folder), terminal)?;
    let hidden = hidden(&bench, &drawn);
    let Some(file) = &fitted.written else {
        return Err(Failure::No(format!(
            "there is no σ: {}\nThe readings are in {}; the hidden material: {hidden}",
            fitted.refused().unwrap_or("nothing was measured"),
            cut.display()
        )));
    };
    let (Some(strips), Some(bound)) = (
        &fitted.found,
        fitted.found.as_ref().and_then(|f| f.bound.as_ref()),
    ) else {
        return Err(Failure::No("there is no σ".into()));
    };
    let reference = &strips.reference;
    let cut_so = bench.as_cut(&reference.geometry);
    let demand = Demand::all(reference.hinges);
    let best = bench.material.true_bound(&cut_so, &demand, args.confidence);
    let bears = bench.material.survival(&cut_so, &demand, bound.sigma);

    // The sheet, made with it, of triangles that the strips answer for.
    let edges = coupon.strip.iter().map(|s| s.edge_mm);
    let edge_mm = edges.fold(reference.geometry.edge_mm, f64::max);
    let size_mm = args.size.unwrap_or(12.0 * edge_mm);
    let request = Request {
        material: file.display().to_string(),
        machine,
        confidence: Some(args.confidence),
        sizing: Sizing::EdgeMm(edge_mm),
        import: ImportOptions {
            units: Units {
                size_mm: Some(size_mm),
                ..Units::default()
            },
            ..ImportOptions::default()
        },
        ..Request::new(source(&args.surface))
    };
    let result = make(&request, &sheet, terminal).map_err(Failure::bad)?;
    result.write(&sheet, force).map_err(Failure::bad)?;
    terminal.clear();
    let opened = open(&mut bench, &result, &profile);
    let sigma = result.design.sheet.sigma;
    if global.json {
        print_json(&json!({
            "written": folder,
            "hidden": {
                "sigma": bench.material.sigma,
                "spread": bench.material.spread,
                "kerf_mm": bench.kerf_mm,
                "bound": best,
                "survival": bears,
            },
            "readings": readings,
            "strips": fitted.found,
            "machines": fitted.machines,
            "sheet": {
                "pass": result.verdict.pass,
                "sigma": sigma,
                "hinges": opened.hinges,
                "widest": opened.widest,
                "survival": opened.survival,
                "sheets": SHEETS,
                "survived": opened.survived,
            },
        }))?;
    } else if !global.quiet {
        let mut lines = vec![
            format!(
                "coupon   {} strips, {} min on the simulated machine; every job verified{}",
                coupon.strip.len(),
                short((made.machine_s / 60.0).ceil(), 0),
                if made.figures["strips"]["rehearsal"].is_null() {
                    ""
                } else {
                    " and rehearsed"
                }
            ),
            format!("hidden   {hidden}"),
        ];
        lines.extend(readings.strips.iter().map(|r| {
            let end = match r.tore {
                Some(tore) => format!("failed at {}", short(tore, 3)),
                None => "never failed".into(),
            };
            format!(
                "pulled   {}: held {}, {end}",
                r.strip.as_deref().unwrap_or("a strip"),
                short(r.held, 3)
            )
        }));
        lines.push(format!(
            "fit      σ = {} at a confidence of {}; {} hinges open to it hold with probability {}; who knew the material would say {}",
            fixed(bound.sigma, 3),
            args.confidence,
            reference.hinges,
            fixed(bears, 3),
            fixed(best, 3),
        ));
        if let Some(kerf) = fitted.machines.iter().find_map(|m| m.kerf) {
            lines.push(format!(
                "kerf     {} mm measured, {} mm real",
                fixed(kerf.kerf_mm, 3),
                fixed(bench.kerf_mm, 3)
            ));
        }
        lines.push(format!(
            "sheet    {} hinges made for σ = {}, open to {} at the most: {} of {SHEETS} such sheets stay whole (computed: {})",
            opened.hinges,
            short(sigma, 4),
            fixed(opened.widest, 3),
            opened.survived,
            fixed(opened.survival, 3)
        ));
        lines.push(format!("Written to {}", folder.display()));
        print(&(lines.join("\n") + "\n"))?;
    }
    if result.verdict.pass {
        Ok(())
    } else {
        let reasons = result.verdict.reasons.iter().map(|r| r.text.as_str());
        Err(Failure::No(format!(
            "with this σ the surface cannot be made; see {}\n  - {}",
            sheet.join("report.html").display(),
            reasons.collect::<Vec<_>>().join("\n  - ")
        )))
    }
}

fn check(args: &RehearseArgs) -> Result<(), Failure> {
    check_confidence(args.confidence)?;
    let within = [
        (
            "--hidden-sigma",
            args.hidden_sigma.unwrap_or(1.5),
            1.01,
            1.99,
        ),
        ("--spread", args.spread, 0.1, 30.0),
        ("--noise", args.noise, 0.0, 20.0),
        ("--size", args.size.unwrap_or(100.0), 1.0, 100_000.0),
    ];
    for (name, value, low, high) in within {
        if !(low..=high).contains(&value) {
            return Err(Failure::Bad(format!(
                "{name} is {value}; it must lie between {low} and {high}"
            )));
        }
    }
    Ok(())
}

/// Hinges as the profile wants them, on triangles as the first strip has them: what the hidden σ is stated for.
fn middle_of(coupon: &Coupon, profile: &Material) -> Result<Geometry, Failure> {
    let tip = profile.tip.map_or(Tip::Plain, Tip::from);
    let geometry = Geometry {
        hinge_width_mm: profile.hinge_width_mm,
        kerf_mm: coupon.kerf_mm,
        tip_radius_mm: tip.radius_mm(coupon.kerf_mm),
        thickness_mm: coupon.thickness_mm,
        edge_mm: coupon.strip.first().map_or(10.0, |s| s.edge_mm),
    };
    if geometry.is_sound() {
        Ok(geometry)
    } else {
        Err(Failure::Bad(format!(
            "hinges of {} mm do not fit on triangles of {} mm: see --edge",
            geometry.hinge_width_mm, geometry.edge_mm
        )))
    }
}

fn bench(
    args: &RehearseArgs,
    profile: &Material,
    coupon: &Coupon,
    drawn: Geometry,
) -> SimulatedBench {
    let law = match args.law {
        LawArg::Normal => Law::Normal,
        LawArg::Weibull => Law::Weibull,
    };
    // The profile's σ may be fully open or more.
    let most = 0.98 * drawn.most_opening();
    let sigma = args.hidden_sigma.unwrap_or(profile.sigma.max.min(most));
    let mut material = SimulatedMaterial::new(drawn, sigma, 0.01 * args.spread, law, args.seed);
    material.noise = 0.01 * args.noise;
    let kerf_mm = (coupon.kerf_mm + args.more_kerf).max(0.1 * coupon.kerf_mm);
    let mut bench = SimulatedBench::new(material, kerf_mm, args.seed);
    // A caliper shows hundredths.
    bench.calipers_mm = 0.01;
    // The profile's own setting has a fifth to spare.
    let heat = |s: &crate::calibrate::SettingSquare| s.power_percent / s.speed_mm_per_min;
    let mut heats: Vec<f64> = coupon.setting.iter().map(heat).collect();
    heats.sort_by(f64::total_cmp);
    bench.least_heat = heats.get(heats.len() / 2).map_or(0.0, |h| 0.8 * h);
    bench
}

fn hidden(bench: &SimulatedBench, drawn: &Geometry) -> String {
    format!(
        "half of the hinges of {} mm on {} mm fail by σ = {}, spread {} %, noise {} %",
        short(drawn.hinge_width_mm, 3),
        short(drawn.edge_mm, 2),
        short(bench.material.sigma, 3),
        short(100.0 * bench.material.spread, 2),
        short(100.0 * bench.material.noise, 2),
    )
}

/// Sheets of the hidden material, opened.
struct Opened {
    hinges: usize,
    widest: f64,
    /// Probability that one stays whole.
    survival: f64,
    /// How many did.
    survived: u32,
}

fn open(bench: &mut SimulatedBench, made: &Made, profile: &Material) -> Opened {
    let choice = &made.design.sheet;
    let tip = profile.tip.map_or(Tip::Plain, Tip::from);
    let cut = bench.as_cut(&Geometry {
        hinge_width_mm: choice.hinge_width_mm,
        kerf_mm: choice.kerf_mm,
        tip_radius_mm: tip.radius_mm(choice.kerf_mm),
        thickness_mm: profile.thickness_mm,
        edge_mm: made.design.linkage.edge_mm,
    });
    let openings: &[f64] = made.openings.first().map_or(&[], Vec::as_slice);
    let widest = openings.iter().copied().fold(1.0, f64::max);
    let demand = Demand::of_openings(openings);
    Opened {
        hinges: openings.len(),
        widest,
        survival: bench.material.survival(&cut, &demand, widest),
        survived: (0..SHEETS)
            .filter(|_| bench.material.sheet_survives(&cut, openings))
            .count() as u32,
    }
}
