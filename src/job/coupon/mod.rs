//! A coupon with everything that goes with it: jobs that were proved, drawings, the table to fill in, and a guide.

mod guide;
mod plot;

use serde_json::{Value, json};

pub use plot::{FitPlot, with_fit};

use super::MakeError;
use super::cut::{CutResult, prove};
use crate::base::progress::Progress;
use crate::calibrate::{CouponJob, CouponPlan, CouponWish, coupon, template};
use crate::gcode;
use crate::machine::Machine;
use crate::material::{CutSetting, Material};
use crate::pattern::{Sheet, svg};

/// What a coupon's folder may hold; `readings.toml` is written into it later.
pub const COUPON_FILES: [&str; 11] = [
    "coupon.toml",
    "coupon.svg",
    "guide.html",
    "readings.csv",
    "readings.toml",
    "settings.nc",
    "settings.svg",
    "kerf.nc",
    "kerf.svg",
    "strips.nc",
    "strips.svg",
];

/// A coupon, written out.
#[derive(Debug)]
pub struct CouponFiles {
    /// What was planned.
    pub plan: CouponPlan,
    /// Names of files and what is in them; none if there are objections.
    pub files: Vec<(&'static str, Vec<u8>)>,
    /// Why the jobs must not run; empty if they may.
    pub objections: Vec<String>,
    /// Figures of every job, by its name.
    pub figures: Value,
    /// Time of all jobs on the machine, seconds.
    pub machine_s: f64,
}

/// Plans a coupon for these profiles (names or files), proves every job, and writes all that goes with it.
///
/// Each part is verified alone with its own hinge width, then each job as a whole and on the simulated machine.
///
/// # Errors
/// [`MakeError`] for profiles that do not go together, stock that is too small, or an interruption.
pub fn make_coupon(
    wish: &CouponWish,
    machine: &str,
    material: &str,
    progress: &dyn Progress,
) -> Result<CouponFiles, MakeError> {
    let material = crate::material::load(material).map_err(MakeError::Material)?;
    let machine = crate::machine::load(machine).map_err(MakeError::Machine)?;
    let setting = material.cut_for(&machine).map_err(MakeError::Cut)?;
    progress.start("coupon", None);
    let plan = coupon(&machine, &material, wish)?;
    let mut objections = Vec::new();
    let mut files = Vec::with_capacity(COUPON_FILES.len());
    let mut figures = serde_json::Map::new();
    let mut machine_s = 0.0;
    for job in &plan.jobs {
        let proved = proved(job, &machine, &material, &setting, progress)?;
        let named = |text: &String| format!("{}.nc: {text}", job.name);
        objections.extend(proved.objections.iter().map(named));
        machine_s += proved.machine_s;
        figures.insert(job.name.to_owned(), proved.figures());
        let [program, drawing] = match job.name {
            "settings" => ["settings.nc", "settings.svg"],
            "kerf" => ["kerf.nc", "kerf.svg"],
            _ => ["strips.nc", "strips.svg"],
        };
        files.push((program, proved.gcode.into_bytes()));
        files.push((drawing, svg(&job.sheet).into_bytes()));
    }
    let whole = svg(&Sheet::together(
        plan.jobs.iter().map(|job| job.sheet.clone()),
    ));
    let document = toml::to_string(&plan.coupon).unwrap_or_default();
    let page = guide::html(&plan, &whole, &material, &machine, machine_s);
    files.push(("coupon.toml", document.into_bytes()));
    files.push(("coupon.svg", whole.into_bytes()));
    files.push(("readings.csv", template(&plan.coupon).into_bytes()));
    files.push(("guide.html", page.into_bytes()));
    if !objections.is_empty() {
        files.clear();
    }
    Ok(CouponFiles {
        plan,
        files,
        objections,
        figures: json!(figures),
        machine_s,
    })
}

/// A job that was proved as a whole; what is wrong with its parts alone is among its objections.
fn proved(
    job: &CouponJob,
    machine: &Machine,
    material: &Material,
    setting: &CutSetting,
    progress: &dyn Progress,
) -> Result<CutResult, MakeError> {
    let mut whole = prove(
        job.toolpath.clone(),
        &job.sheet,
        machine,
        material,
        setting,
        progress,
    )?;
    for (part, alone) in &job.parts {
        progress.check()?;
        let text = gcode::write(alone, machine, material).map_err(MakeError::Gcode)?;
        let proof = gcode::verify(&text, machine, Some(part), Some(setting.passes))
            .map_err(MakeError::Toolpath)?;
        let findings = proof.findings.iter().map(ToString::to_string);
        whole.objections.extend(findings);
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::progress::Silent;
    use crate::calibrate::Coupon;

    #[test]
    fn a_coupon_is_proved_on_every_machine_that_cuts_something() {
        let mut made = 0;
        for (machine, _) in crate::machine::shipped() {
            let found = crate::machine::load(machine).unwrap();
            let fits = crate::material::shipped().find(|(name, _)| {
                let material = crate::material::load(name).unwrap();
                material.cut_for(&found).is_ok()
            });
            let (material, _) = fits.unwrap();
            let coupon = make_coupon(&CouponWish::default(), machine, material, &Silent).unwrap();
            assert_eq!(
                coupon.objections,
                Vec::<String>::new(),
                "{machine}, {material}"
            );
            let text = |name: &str| {
                let file = coupon.files.iter().find(|f| f.0 == name).unwrap();
                String::from_utf8(file.1.clone()).unwrap()
            };
            let again: Coupon = toml::from_str(&text("coupon.toml")).unwrap();
            assert_eq!(again, coupon.plan.coupon);
            for strip in &again.strip {
                assert!(text("readings.csv").contains(&strip.name));
                assert!(text("guide.html").contains(&strip.name));
            }
            // Every setting of the grid is in its job.
            let has_grid = !again.setting.is_empty();
            assert_eq!(has_grid, machine != "plasma-qtplasmac");
            let settings = if has_grid {
                text("settings.nc")
            } else {
                String::new()
            };
            for square in &again.setting {
                let feed = format!("F{}", square.speed_mm_per_min);
                assert!(settings.contains(&feed), "{machine}: {feed}");
            }
            made += 1;
        }
        assert!(made >= 6);
    }

    #[test]
    fn stock_without_room_says_so_and_a_little_leaves_strips_out() {
        let on = |stock_mm| {
            let wish = CouponWish {
                stock_mm: Some(stock_mm),
                ..CouponWish::default()
            };
            make_coupon(&wish, "co2-600x400", "leather-1.6", &Silent)
        };
        let error = on([80.0, 60.0]).unwrap_err().to_string();
        assert!(error.contains("--stock"), "{error}");
        let all = on([400.0, 300.0]).unwrap();
        assert!(all.plan.left_out.is_empty());
        assert_eq!(all.plan.coupon.strip.len(), 6);
    }
}
