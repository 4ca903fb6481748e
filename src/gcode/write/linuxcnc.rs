//! A plasma table with LinuxCNC and QtPlasmaC, which probes, pierces and follows the sheet by itself: the job holds no Z
//! and no wait.
//!
//! The material travels in the job, as a temporary one; its cut speed is the feed, so that the operator's changes reach
//! the cut. Corners are slowed by QtPlasmaC's velocity reduction and not by F words, which it would complain of.

use super::{GcodeError, Writer};
use crate::base::units::short;
use crate::material::{CutSetting, Material};
use crate::toolpath::{Role, Toolpath};

/// The feed of the material that is loaded.
const MATERIAL_FEED: &str = "#<_hal[plasmac.cut-feed-rate]>";

/// Full speed, at once.
const FULL_SPEED: &str = "M68 E3 Q0";

pub(super) fn write(
    mut w: Writer<'_>,
    toolpath: &Toolpath,
    material: &Material,
    setting: &CutSetting,
) -> Result<String, GcodeError> {
    w.modes(&["G21", "G90", "G17", "G40", "G49", "G80", "G94", "G91.1"]);
    w.line(FULL_SPEED);
    // Marks come first, so that the torch's offset is set once at the most.
    let mut scribing = false;
    if toolpath.cuts.iter().any(|c| c.role != Role::Mark) {
        w.line(inline_material(toolpath, material, setting));
    }
    for cut in &toolpath.cuts {
        let Some((start, strokes)) = w.path(cut)? else {
            continue;
        };
        w.role(cut.role);
        let mark = cut.role == Role::Mark;
        if mark != scribing {
            // The scribe sits beside the torch; its offset is in the tool table.
            w.line(if mark { "T1 M6" } else { "T0 M6" });
            w.line("G43 H0");
            scribing = mark;
            (w.at, w.motion) = (None, "");
        }
        // QtPlasmaC refuses a torch that is switched on before a line that begins with G0 X or G0 Y.
        w.motion = "";
        if w.at == Some(start) {
            w.at = None;
        }
        w.rapid(start);
        let tool = if mark { "$1" } else { "$0" };
        let feed = if mark {
            short(cut.feed_mm_per_min, 0)
        } else {
            MATERIAL_FEED.into()
        };
        if w.feed != feed {
            w.line(format!("F{feed}"));
            w.feed.clone_from(&feed);
        }
        w.line(format!("M3 {tool} S1"));
        let mut percent = 100.0;
        for stroke in &strokes {
            if stroke.speed_percent != percent {
                percent = stroke.speed_percent;
                // With the motion that follows; 0 is full speed.
                let q = if percent == 100.0 { 0.0 } else { percent };
                w.line(format!("M67 E3 Q{}", short(q, 1)));
            }
            w.stroke(stroke, &feed, None);
        }
        w.line(format!("M5 {tool}"));
        if percent != 100.0 {
            w.line(FULL_SPEED);
        }
    }
    w.line("M5");
    w.line(FULL_SPEED);
    w.motion = "";
    w.finish()
}

/// QtPlasmaC's words for a material that lasts as long as the job: pierce height and delay, cut height and speed, kerf,
/// height control on, amperes.
fn inline_material(toolpath: &Toolpath, material: &Material, setting: &CutSetting) -> String {
    let first = toolpath.cuts.iter().find(|c| c.role != Role::Mark);
    let feed = first.map_or(setting.speed_mm_per_min, |c| c.feed_mm_per_min);
    let number = |v: f64| short(v, 3);
    let mut text = format!("(o=0, na=kagome {}", material.name);
    if let Some(torch) = setting.torch {
        text.push_str(&format!(
            ", ph={}, pd={}, ch={}, fr={}, kw={}, th=1, ca={}",
            number(torch.pierce_height_mm),
            number(torch.pierce_delay_s),
            number(torch.cut_height_mm),
            short(feed, 0),
            number(setting.kerf_mm),
            number(torch.amps)
        ));
    }
    text.push(')');
    text
}
