//! What cuts: a laser or a plasma torch.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::controller::Controller;
use super::lines::{self, Where};
use crate::base::document::{Complaint, ranged};
use crate::material::{Laser, Process, check_name};

/// How the beam follows the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PowerMode {
    /// M4: power follows speed, and the beam is off whenever the machine stands still, also when the link is lost.
    Dynamic,
    /// M3: the beam stays on where the machine stops. If the cable is pulled, no program can switch it off.
    Constant,
}

/// The laser: `[laser]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LaserTool {
    /// Its kind.
    pub kind: Laser,
    /// Optical power at 100 %, watts.
    pub watts: f64,
    /// The S word of 100 % (`$30`).
    pub s_max: f64,
    /// M4 or M3.
    pub power_mode: PowerMode,
    /// `power_mode = "constant"` needs this to be true: with M3 the beam stays on if the link is lost in mid-job.
    #[serde(default)]
    pub accept_beam_on_after_lost_link: bool,
    /// The line that starts the air, if there is any.
    #[serde(default)]
    pub air_on: Option<String>,
    /// The line that stops the air.
    #[serde(default)]
    pub air_off: Option<String>,
}

/// Who moves the torch up and down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HeightControl {
    /// QtPlasmaC: it probes, pierces and follows the sheet by itself. The job holds no Z.
    QtPlasmaC,
    /// The job itself, by the lines of `[plasma.template]`.
    Plain,
}

/// Slower round sharp corners, where the arc lags behind the torch: `corner` in `[plasma]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Corner {
    /// Speed there, per cent of the cut's.
    pub percent: f64,
    /// So far before and after the corner, millimetres.
    pub distance_mm: f64,
    /// From this change of direction on, degrees.
    pub angle_deg: f64,
}

/// Small holes, which a torch cuts slowly and leaves in an arc without a mark: `small_hole` in `[plasma]`. QtPlasmaC's
/// outputs do it: M67 E3 lowers the speed, M62 P3 holds the torch off while the head goes on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SmallHole {
    /// Holes that nowhere measure more than this across, millimetres.
    pub below_mm: f64,
    /// Speed there, per cent of the cut's.
    pub percent: f64,
    /// How far the head goes on past the hole's beginning with the torch held off, millimetres.
    pub overcut_mm: f64,
}

/// The lines round every cut of a torch that the job moves: `[plasma.template]`. In braces stand the figures of the
/// material and the machine: see [`PLACEHOLDERS`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Template {
    /// At the pierce, before the cut's first motion: probe, pierce height, torch on, pierce delay, cut height.
    pub begin_cut: Vec<String>,
    /// At the cut's end: torch off, safe height.
    pub end_cut: Vec<String>,
}

/// What may stand in braces in a line of a [`Template`].
pub const PLACEHOLDERS: [&str; 6] = [
    "pierce_height_mm",
    "pierce_delay_s",
    "cut_height_mm",
    "safe_height_mm",
    "feed_mm_per_min",
    "amps",
];

/// The plasma torch: `[plasma]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlasmaTool {
    /// Who moves the torch up and down.
    pub height_control: HeightControl,
    /// Largest current of the power source, amperes.
    pub max_amps: f64,
    /// Height of the torch between cuts, millimetres over the sheet; needed with a template.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safe_height_mm: Option<f64>,
    /// A table to which the job is streamed needs this to be true: if the link is lost in mid-cut the torch stays on.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub accept_arc_on_after_lost_link: bool,
    /// Whether a scribe makes marks (QtPlasmaC's tool `$1`).
    #[serde(default)]
    pub scribe: bool,
    /// Slower round corners; as fast as elsewhere if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corner: Option<Corner>,
    /// How small holes are cut, with `height_control = "qtplasmac"`; like large ones if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub small_hole: Option<SmallHole>,
    /// Numbers in QtPlasmaC's own list of materials, by the names of our material profiles: a job for one of these
    /// selects it there (M190) and takes its feed, heights and currents. A job for any other brings its own figures.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub material_numbers: BTreeMap<String, u32>,
    /// The lines round every cut, with `height_control = "plain"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub template: Option<Template>,
}

/// A machine's tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tool<'a> {
    /// A laser.
    Laser(&'a LaserTool),
    /// A plasma torch.
    Plasma(&'a PlasmaTool),
}

impl Tool<'_> {
    /// How it removes material.
    pub fn process(self) -> Process {
        match self {
            Self::Laser(_) => Process::Laser,
            Self::Plasma(_) => Process::Plasma,
        }
    }
}

impl LaserTool {
    pub(super) fn check(&self, controller: Controller, limit: usize) -> Result<(), Complaint> {
        if !controller.is_streamed() {
            return Err(Complaint::new(
                "laser",
                format!(
                    "cannot be on {controller}: laser jobs are written for \"grbl\", \"grblhal\" and \"fluidnc\""
                ),
            ));
        }
        ranged("laser.watts", self.watts, 0.1, 50_000.0)?;
        ranged("laser.s_max", self.s_max, 1.0, 100_000.0)?;
        if self.power_mode == PowerMode::Constant && !self.accept_beam_on_after_lost_link {
            return Err(Complaint::new(
                "laser.power_mode",
                "is \"constant\" (M3): if the cable is pulled in mid-job the beam stays on, and no program can switch it off. Use \"dynamic\" (M4), or write accept_beam_on_after_lost_link = true below it",
            ));
        }
        for (key, line) in [
            ("laser.air_on", &self.air_on),
            ("laser.air_off", &self.air_off),
        ] {
            if let Some(line) = line {
                lines::check(key, line, controller, limit, Where::Frame)?;
            }
        }
        Ok(())
    }
}

impl PlasmaTool {
    pub(super) fn check(&self, controller: Controller, limit: usize) -> Result<(), Complaint> {
        ranged("plasma.max_amps", self.max_amps, 5.0, 1000.0)?;
        if let Some(height) = self.safe_height_mm {
            ranged("plasma.safe_height_mm", height, 1.0, 500.0)?;
        }
        if let Some(corner) = self.corner {
            ranged("plasma.corner.percent", corner.percent, 10.0, 100.0)?;
            ranged("plasma.corner.distance_mm", corner.distance_mm, 0.1, 100.0)?;
            ranged("plasma.corner.angle_deg", corner.angle_deg, 1.0, 180.0)?;
        }
        if let Some(hole) = self.small_hole {
            ranged("plasma.small_hole.below_mm", hole.below_mm, 0.1, 1000.0)?;
            ranged("plasma.small_hole.percent", hole.percent, 10.0, 100.0)?;
            // Without a way to go on, the torch would not be held off at all.
            ranged("plasma.small_hole.overcut_mm", hole.overcut_mm, 0.5, 50.0)?;
        }
        match self.height_control {
            HeightControl::QtPlasmaC => self.check_qtplasmac(controller),
            HeightControl::Plain => self.check_plain(controller, limit),
        }
    }

    fn check_qtplasmac(&self, controller: Controller) -> Result<(), Complaint> {
        if controller != Controller::LinuxCnc {
            return Err(Complaint::new(
                "plasma.height_control",
                format!(
                    "is \"qtplasmac\", which is a part of LinuxCNC; the controller is {controller}"
                ),
            ));
        }
        if self.template.is_some() {
            return Err(Complaint::new(
                "plasma.template",
                "stands beside height_control = \"qtplasmac\", which probes and pierces by itself: a line with Z would fight it. Remove the template, or write height_control = \"plain\"",
            ));
        }
        for (material, number) in &self.material_numbers {
            let key = format!("plasma.material_numbers.{material}");
            if let Err(wrong) = check_name(material) {
                return Err(Complaint::new(
                    key,
                    format!("is for a material whose name {}", wrong.problem),
                ));
            }
            // From a million on QtPlasmaC numbers those that jobs bring.
            ranged(&key, f64::from(*number), 0.0, 999_999.0)?;
        }
        Ok(())
    }

    fn check_plain(&self, controller: Controller, limit: usize) -> Result<(), Complaint> {
        if self.scribe {
            return Err(Complaint::new(
                "plasma.scribe",
                "is true, and only QtPlasmaC has a word for the scribe",
            ));
        }
        if self.small_hole.is_some() || !self.material_numbers.is_empty() {
            let key = if self.small_hole.is_some() {
                "plasma.small_hole"
            } else {
                "plasma.material_numbers"
            };
            return Err(Complaint::new(
                key,
                "stands beside height_control = \"plain\", and only QtPlasmaC has words for it: remove it",
            ));
        }
        let Some(template) = &self.template else {
            return Err(Complaint::new(
                "plasma.height_control",
                "is \"plain\", so the job moves the torch: add [plasma.template] with begin_cut and end_cut",
            ));
        };
        if self.safe_height_mm.is_none() {
            return Err(Complaint::new(
                "plasma.safe_height_mm",
                "is needed with a template: the height of the torch between cuts",
            ));
        }
        if controller.is_streamed() && !self.accept_arc_on_after_lost_link {
            return Err(Complaint::new(
                "plasma.accept_arc_on_after_lost_link",
                format!(
                    "is not there: a job is streamed to {controller}, and if the cable is pulled in mid-cut the torch stays on, and no program can switch it off. Let the job be read from a file at the table, or write accept_arc_on_after_lost_link = true, and stay beside it"
                ),
            ));
        }
        template.check(controller, limit)
    }
}

impl Template {
    fn check(&self, controller: Controller, limit: usize) -> Result<(), Complaint> {
        let mut on = 0;
        // What stays in force from line to line, and from the end of one cut to the next.
        let mut s = 0.0;
        for (i, line) in self.begin_cut.iter().enumerate() {
            let key = format!("plasma.template.begin_cut[{i}]");
            let effect = self.check_line(&key, line, controller, limit, Where::BeginCut)?;
            s = effect.s.unwrap_or(s);
            on += usize::from(effect.tool_on);
            if effect.tool_on && controller.is_streamed() && s <= 0.0 {
                return Err(Complaint::new(
                    key,
                    format!(
                        "switches the torch on without power: {controller} switches its output only for an S above 0. Write M3 S1000, or what $30 is on the table"
                    ),
                ));
            }
        }
        if on != 1 {
            return Err(Complaint::new(
                "plasma.template.begin_cut",
                format!("switches the torch on {on} times; exactly one M3 is needed"),
            ));
        }
        let mut off = false;
        for (i, line) in self.end_cut.iter().enumerate() {
            let key = format!("plasma.template.end_cut[{i}]");
            off |= self
                .check_line(&key, line, controller, limit, Where::EndCut)?
                .tool_off;
        }
        if !off {
            return Err(Complaint::new(
                "plasma.template.end_cut",
                "does not switch the torch off: it needs an M5",
            ));
        }
        for (key, lines) in [
            ("plasma.template.begin_cut", &self.begin_cut),
            ("plasma.template.end_cut", &self.end_cut),
        ] {
            let relative = lines
                .iter()
                .filter_map(|l| lines::distance_mode(&filled(l, |_| Some("1".into())).ok()?))
                .next_back();
            if relative == Some(lines::Distance::Relative) {
                return Err(Complaint::new(
                    key,
                    "ends with relative distances (G91) in force: the cuts are written with G90; add a line G90",
                ));
            }
        }
        Ok(())
    }

    fn check_line(
        &self,
        key: &str,
        line: &str,
        controller: Controller,
        limit: usize,
        place: Where,
    ) -> Result<lines::Effect, Complaint> {
        // As long as a figure can be: five digits, a point and three more.
        let known = |name: &str| PLACEHOLDERS.contains(&name).then(|| "10000.001".to_owned());
        let line = filled(line, known).map_err(|name| {
            Complaint::new(
                key,
                format!(
                    "has {{{name}}}, which stands for nothing. Known: {}",
                    PLACEHOLDERS.map(|p| format!("{{{p}}}")).join(", ")
                ),
            )
        })?;
        lines::check(key, &line, controller, limit, place)
    }
}

/// A line of a template with what `value` gives for each name in braces.
///
/// # Errors
/// The name that `value` does not know; everything after a brace that is not closed.
pub fn filled(line: &str, value: impl Fn(&str) -> Option<String>) -> Result<String, String> {
    let mut text = String::with_capacity(line.len());
    let mut rest = line;
    while let Some(open) = rest.find('{') {
        text.push_str(&rest[..open]);
        let after = &rest[open + 1..];
        let close = after.find('}').ok_or_else(|| after.to_owned())?;
        let name = &after[..close];
        text.push_str(&value(name).ok_or_else(|| name.to_owned())?);
        rest = &after[close + 1..];
    }
    text.push_str(rest);
    Ok(text)
}
