//! The second half of the line: from a sheet in its place on the bed to G-code that was proved and rehearsed.
//!
//! Three pairs of eyes, none of which knows another: the verifier reads the text back and compares it with the sheet;
//! the simulated machine runs it through the sender that drives real ones; and what it burnt is compared with the
//! sheet again. An objection of any of them means no job.

use kurbo::{Point, Vec2};
use serde_json::{Value, json};

use super::MakeError;
use crate::base::progress::Progress;
use crate::base::units::short;
use crate::control::JobRules;
use crate::gcode::{self, Slack, compare_burnt};
use crate::machine::{Machine, PowerMode};
use crate::material::{CutSetting, Material};
use crate::pattern::{self, Sheet};
use crate::planner::{self, Motion, total_s};
use crate::sim::{RehearsalSummary, Settings, rehearse};
use crate::toolpath::{CutOptions, Heat, Role, Toolpath, plan, spacing};

/// A job and what was found about it.
#[derive(Debug)]
pub(crate) struct CutResult {
    /// The program.
    pub gcode: String,
    /// The cuts in their order.
    pub toolpath: Toolpath,
    /// Length cut, millimetres.
    pub cut_length_mm: f64,
    /// Length moved with the beam off, millimetres.
    pub travel_mm: f64,
    /// Time on the simulated machine, or by the planner where there is none, seconds.
    pub machine_s: f64,
    /// What the simulated machine did; none for a torch.
    pub rehearsal: Option<RehearsalSummary>,
    /// Why the job must not run; empty if it may.
    pub objections: Vec<String>,
}

/// Objections shown; the rest are counted.
const MOST_OBJECTIONS: usize = 5;

/// A controller with dynamic power switches the beam off during the last steps before it stands: up to 10 ms of
/// braking, measured as 0.05 mm on stock GRBL 1.1h at 500 mm/s². The uncut rest at a slit's tip is half a kerf's worth
/// of char; it grows with the acceleration as a·t²/2.
fn stop_gap_mm(machine: &Machine) -> f64 {
    const DARK_S: f64 = 0.01;
    let fastest = machine
        .motion
        .acceleration_mm_per_s2
        .x
        .hypot(machine.motion.acceleration_mm_per_s2.y);
    0.5 * fastest * DARK_S * DARK_S + gcode::TOLERANCE_MM
}

/// A real machine stands on steps of its motors: half of one in each axis comes on top of the verifier's tolerance.
fn slack(machine: &Machine) -> Slack {
    let [x, y, _] = Settings::of_machine(machine).steps_per_mm;
    Slack {
        sideways_mm: gcode::TOLERANCE_MM + (0.5 / x).hypot(0.5 / y),
        gap_mm: stop_gap_mm(machine),
    }
}

/// Plans, writes, verifies and rehearses the cut of `sheet`, which lies in its place on the bed, in an order at this
/// price of heat.
pub(crate) fn cut(
    sheet: &Sheet,
    machine: &Machine,
    material: &Material,
    setting: &CutSetting,
    heat: Heat,
    progress: &dyn Progress,
) -> Result<CutResult, MakeError> {
    progress.start("toolpath", None);
    let marks = material.mark_for(machine);
    let options = CutOptions {
        heat,
        ..CutOptions::of(setting, machine, marks.as_ref())
    };
    let toolpath = plan(sheet, &options, machine.park_mm()).map_err(MakeError::Toolpath)?;
    prove(toolpath, sheet, machine, material, setting, progress)
}

/// Writes, verifies and rehearses a toolpath that is to cut `sheet`.
pub(crate) fn prove(
    toolpath: Toolpath,
    sheet: &Sheet,
    machine: &Machine,
    material: &Material,
    setting: &CutSetting,
    progress: &dyn Progress,
) -> Result<CutResult, MakeError> {
    progress.check()?;
    let gcode = gcode::write(&toolpath, machine, material).map_err(MakeError::Gcode)?;

    progress.start("verifying", None);
    let proof = gcode::verify(&gcode, machine, Some(sheet), Some(setting.passes))
        .map_err(MakeError::Toolpath)?;
    let mut objections = listed(
        "the verifier refuses the job",
        proof.findings.iter().map(ToString::to_string),
    );
    progress.check()?;

    let (machine_s, rehearsal) = if machine.controller.is_streamed() {
        let (time_s, summary) =
            rehearsed(&gcode, sheet, machine, setting, &mut objections, progress)?;
        (time_s, Some(summary))
    } else {
        // The simulated machine is one to which a job is streamed.
        (estimated_s(&gcode, machine, setting), None)
    };
    let figures = toolpath.figures();
    Ok(CutResult {
        gcode,
        cut_length_mm: figures.cut_length_mm,
        travel_mm: figures.travel_mm,
        machine_s,
        rehearsal,
        toolpath,
        objections,
    })
}

/// A torch stands longer than its pierce delay by the way down to the cutting height and the stops of the firmware, s.
const PIERCE_SLACK_S: f64 = 1.0;

/// Runs the job on the simulated machine, and compares what that has burnt with the sheet: its time, s, and its figures.
fn rehearsed(
    gcode: &str,
    sheet: &Sheet,
    machine: &Machine,
    setting: &CutSetting,
    objections: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<(f64, RehearsalSummary), MakeError> {
    progress.start("rehearsing on the simulated machine", None);
    let mut rules = JobRules::of(machine);
    rules.allow_constant_power |= machine
        .laser()
        .is_some_and(|l| l.power_mode == PowerMode::Constant);
    let rehearsal = rehearse(
        gcode.as_bytes(),
        &Settings::of_machine(machine),
        &rules,
        progress,
    )
    .map_err(MakeError::Rehearsal)?;
    let burnt: Vec<[Point; 2]> = rehearsal
        .burns
        .iter()
        .filter(|b| !b.standing())
        .map(|b| [b.from_mm, b.to_mm].map(|p| Point::new(p[0], p[1])))
        .collect();
    let differences = compare_burnt(
        sheet,
        &burnt,
        setting.passes,
        &gcode::Declared::of(gcode),
        slack(machine),
    )
    .map_err(MakeError::Toolpath)?;
    objections.extend(listed(
        "the simulated machine did not burn the sheet",
        differences.iter().map(ToString::to_string),
    ));
    let s = &rehearsal.summary;
    let longest_stand_s = rehearsal
        .burns
        .iter()
        .filter(|b| b.standing())
        .map(|b| b.end_s - b.start_s)
        .fold(0.0, f64::max);
    for (wrong, what) in [
        (s.rapid_burn_mm > 0.0, "the beam was on during rapid moves"),
        (s.beam_on_at_end, "the beam was on at the end"),
        (s.lost_bytes > 0, "the controller's buffer overflowed"),
        (
            s.standing_burn_s > 0.0 && machine.laser().is_some(),
            "the beam was on while the head stood still",
        ),
        (
            longest_stand_s > setting.torch.map_or(0.0, |t| t.pierce_delay_s) + PIERCE_SLACK_S,
            "the torch stood on one spot for longer than a pierce takes",
        ),
    ] {
        if wrong {
            objections.push(format!("rehearsal: {what}"));
        }
    }
    Ok((rehearsal.time_s, rehearsal.summary))
}

/// How long a torch to which nothing is streamed takes, s: the planner's time for its motion, a stop and the pierce delay for every cut. What height
/// control takes for its probing is not in it.
fn estimated_s(gcode: &str, machine: &Machine, setting: &CutSetting) -> f64 {
    let program = gcode::read_with(
        gcode,
        gcode::Dialect::of(machine),
        Some(setting.speed_mm_per_min),
    );
    let wait_s = setting.torch.map_or(0.0, |t| t.pierce_delay_s);
    let mut motions = Vec::with_capacity(program.moves.len() + 2 * program.pierces.len());
    let mut cutting = false;
    for m in &program.moves {
        // A torch that is held off in a cut does not stop for it.
        if m.rapid == cutting {
            cutting = !m.rapid;
            let wait_s = if cutting { wait_s } else { 0.0 };
            motions.push(Motion::Stop { wait_s });
        }
        let way = m.from.map_or(Vec2::ZERO, |from| m.to - from);
        motions.push(Motion::Move(planner::Move {
            delta_mm: [way.x, way.y, 0.0],
            rate_mm_min: (!m.rapid).then_some(m.feed_mm_per_min),
        }));
    }
    total_s(&motions, &Settings::of_machine(machine).limits())
}

/// A job made from a drawing.
#[derive(Debug)]
pub struct CutDrawing {
    /// The program.
    pub gcode: String,
    /// The drawing that it cuts: where it was moved to, if it was.
    pub drawing: String,
    /// What was noticed and does not forbid the cut.
    pub warnings: Vec<String>,
    /// Why the job must not run; empty if it may.
    pub objections: Vec<String>,
    /// Figures of the job.
    pub figures: Value,
}

/// A job from the text of a drawing, as [`pattern::svg()`] wrote it or edited since: checked for hinges that became too
/// narrow, planned, written, verified against the drawing and rehearsed. With `place` the drawing is moved into the corner
/// of the bed, else it is cut where it lies.
///
/// # Errors
/// [`MakeError`] for a drawing that cannot be cut on this machine, for profiles that do not go together, or an interruption.
pub fn cut_drawing(
    text: &str,
    machine: &str,
    material: &str,
    place: bool,
    progress: &dyn Progress,
) -> Result<CutDrawing, MakeError> {
    let material = crate::material::load(material).map_err(MakeError::Material)?;
    let machine = crate::machine::load(machine).map_err(MakeError::Machine)?;
    let setting = material.cut_for(&machine).map_err(MakeError::Cut)?;
    progress.start("reading the drawing", None);
    let read = pattern::read_drawing(text).map_err(MakeError::Drawing)?;
    let (mut sheet, mut warnings) = (read.sheet, read.warnings);
    sheet.check_ligaments().map_err(MakeError::Pattern)?;
    if place {
        let (placed, motion) =
            pattern::placed(&sheet, &machine, false).map_err(MakeError::Pattern)?;
        let [cos, sin] = motion.turn;
        let turned_deg = sin.atan2(cos).to_degrees();
        if turned_deg != 0.0 {
            warnings.push(format!(
                "the drawing was turned by {}°, to fit the bed",
                short(turned_deg, 0)
            ));
        }
        sheet = placed;
    }
    pattern::on_bed(&sheet, &machine).map_err(MakeError::Pattern)?;
    let drawn = sheet.metadata.kerf_mm;
    if (drawn - setting.kerf_mm).abs() > 1e-9 {
        warnings.push(format!(
            "the drawing is made for a cut {} mm wide, and {} is cut {} mm wide on {}: hinges will be wider or narrower by the difference",
            short(drawn, 3),
            material.name,
            short(setting.kerf_mm, 3),
            machine.name
        ));
    }
    let made = cut(&sheet, &machine, &material, &setting, Heat::NONE, progress)?;
    Ok(CutDrawing {
        figures: made.figures(),
        drawing: pattern::svg(&sheet),
        gcode: made.gcode,
        warnings,
        objections: made.objections,
    })
}

/// The first few findings under a heading.
fn listed(heading: &str, findings: impl ExactSizeIterator<Item = String>) -> Vec<String> {
    let more = findings.len().saturating_sub(MOST_OBJECTIONS);
    let mut lines: Vec<String> = findings
        .take(MOST_OBJECTIONS)
        .map(|f| format!("{heading}: {f}"))
        .collect();
    if more > 0 {
        lines.push(format!("{heading}: and {more} more findings"));
    }
    lines
}

impl CutResult {
    /// The figures for the report.
    pub fn figures(&self) -> Value {
        // Slits alone: a rim has no choice of where it lies, and its ends are one point.
        let slits = self.toolpath.cuts.iter().filter(|c| c.role == Role::Slit);
        let ends: Vec<[Point; 2]> = slits.filter_map(|c| Some([c.start()?, c.end()?])).collect();
        let spacing = spacing(&ends);
        json!({
            "strokes": self.toolpath.cuts.len(),
            "cut_length_mm": self.cut_length_mm,
            "travel_mm": self.travel_mm,
            "machine_s": self.machine_s,
            "spacing_mean_mm": spacing.map(|s| s.mean_mm),
            "spacing_low_mm": spacing.map(|s| s.low_mm),
            "gcode_lines": self.gcode.lines().count(),
            "verified": true,
            "rehearsal": self.rehearsal,
        })
    }
}
