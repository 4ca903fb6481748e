//! A laser on GRBL, grblHAL or FluidNC.
//!
//! The beam: `M4` follows speed and is off on every `G0` and at rest, as long as the controller is in laser mode
//! (`$32=1`). Power stays set between cuts: an S word on a rapid would stop GRBL's planner each time.

use super::{GcodeError, Writer, feed_word};
use crate::base::units::short;
use crate::machine::{LaserTool, PowerMode};
use crate::toolpath::Toolpath;

pub(super) fn write(
    mut w: Writer<'_>,
    toolpath: &Toolpath,
    laser: &LaserTool,
) -> Result<String, GcodeError> {
    w.remark("needs laser mode: $32=1");
    if laser.power_mode == PowerMode::Constant {
        w.remark("warning: M3, the beam stays on if the link is lost");
        w.remark("stay beside the machine, a hand on its switch");
    }
    w.modes(&["G21", "G90", "G17", "G94"]);
    w.lines.extend(laser.air_on.iter().cloned());
    w.line(match laser.power_mode {
        PowerMode::Dynamic => "M4 S0",
        PowerMode::Constant => "M3 S0",
    });
    w.power = "0".into();
    for cut in &toolpath.cuts {
        let Some((start, strokes)) = w.path(cut)? else {
            continue;
        };
        w.role(cut.role);
        w.rapid(start);
        // Hundredths of a per cent and better, whatever the scale of S.
        let power = short(laser.s_max * cut.power_percent / 100.0, 1);
        for stroke in &strokes {
            w.stroke(stroke, &feed_word(cut, stroke.speed_percent), Some(&power));
        }
    }
    w.line("M5");
    if laser.air_on.is_some() {
        w.lines.extend(laser.air_off.iter().cloned());
    }
    w.finish()
}
