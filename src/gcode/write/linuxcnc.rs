//! A plasma table with LinuxCNC and QtPlasmaC, which probes, pierces and follows the sheet by itself: the job holds no Z
//! and no wait.
//!
//! The material is one of the table's own list where the machine's profile gives its number there, and else travels in
//! the job, as a temporary one; its cut speed is the feed, so that the operator's changes reach the cut. Corners and small
//! holes are slowed by QtPlasmaC's velocity reduction and not by F words, which it would complain of; the arc's voltage
//! rises where it is slow, so height control pauses there: it would dive. Past the end of a small hole the torch is held
//! off while the head goes on.
//!
//! What goes with a motion (M62, M63, M67) takes effect when the next one begins; M65 and M68 act at once, between cuts.

use super::{GcodeError, Writer};
use crate::base::units::short;
use crate::machine::PlasmaTool;
use crate::material::{CutSetting, Material};
use crate::toolpath::{Role, Toolpath};

/// The feed of the material that is loaded.
const MATERIAL_FEED: &str = "#<_hal[plasmac.cut-feed-rate]>";

/// Full speed, height control on, the torch free to burn: at once.
const FULL_SPEED: &str = "M68 E3 Q0";
const HEIGHT_ON: &str = "M65 P2";
const TORCH_FREE: &str = "M65 P3";
const RESET: [&str; 3] = [FULL_SPEED, HEIGHT_ON, TORCH_FREE];

pub(super) fn write(
    mut w: Writer<'_>,
    toolpath: &Toolpath,
    torch: &PlasmaTool,
    material: &Material,
    setting: &CutSetting,
) -> Result<String, GcodeError> {
    w.modes(&["G21", "G90", "G17", "G40", "G49", "G80", "G94", "G91.1"]);
    RESET.iter().for_each(|line| w.line(*line));
    // Marks come first, so that the torch's offset is set once at the most.
    let mut scribing = false;
    if toolpath.cuts.iter().any(|c| c.role != Role::Mark) {
        match torch.material_numbers.get(&material.name) {
            Some(number) => {
                w.line(format!("M190 P{number}"));
                // Until the table has changed to it.
                w.line("M66 P3 L3 Q1");
            }
            None => w.line(inline_material(toolpath, material, setting)),
        }
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
        let (mut percent, mut off) = (100.0, false);
        for stroke in &strokes {
            if stroke.speed_percent != percent {
                let (before, now) = (percent < 100.0, stroke.speed_percent < 100.0);
                percent = stroke.speed_percent;
                // 0 is full speed.
                let q = if now { percent } else { 0.0 };
                w.line(format!("M67 E3 Q{}", short(q, 1)));
                if now != before {
                    w.line(if now { "M62 P2" } else { "M63 P2" });
                }
            }
            if stroke.off && !off {
                off = true;
                w.line("M62 P3");
            }
            w.stroke(stroke, &feed, None);
        }
        w.line(format!("M5 {tool}"));
        if percent != 100.0 {
            w.line(FULL_SPEED);
            w.line(HEIGHT_ON);
        }
        if off {
            w.line(TORCH_FREE);
        }
    }
    w.line("M5");
    RESET.iter().for_each(|line| w.line(*line));
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
