//! A plasma table whose torch the job moves, by the template in the machine's profile: its lines stand round every cut,
//! with the material's figures in them.

use super::{GcodeError, Writer, feed_word};
use crate::base::units::short;
use crate::machine::{Controller, PlasmaTool, filled};
use crate::material::CutSetting;
use crate::toolpath::{Cut, Toolpath};

pub(super) fn write(
    mut w: Writer<'_>,
    toolpath: &Toolpath,
    torch: &PlasmaTool,
    setting: &CutSetting,
) -> Result<String, GcodeError> {
    let modes: &[&str] = match w.machine.controller {
        Controller::LinuxCnc => &["G21", "G90", "G17", "G40", "G49", "G80", "G94", "G91.1"],
        _ => &["G21", "G90", "G17", "G40", "G94"],
    };
    let template = torch.template.as_ref().ok_or(GcodeError::Template {
        missing: "[plasma.template]".into(),
    })?;
    w.modes(modes);
    for cut in &toolpath.cuts {
        let Some((start, strokes)) = w.path(cut)? else {
            continue;
        };
        w.role(cut.role);
        // The template's lines may have left any motion word and feed in force.
        (w.motion, w.feed) = ("", String::new());
        w.rapid(start);
        lines(&mut w, &template.begin_cut, cut, torch, setting)?;
        w.motion = "";
        for stroke in &strokes {
            w.stroke(stroke, &feed_word(cut, stroke.speed_percent), None);
        }
        lines(&mut w, &template.end_cut, cut, torch, setting)?;
    }
    w.motion = "";
    w.line("M5");
    w.finish()
}

fn lines(
    w: &mut Writer<'_>,
    template: &[String],
    cut: &Cut,
    torch: &PlasmaTool,
    setting: &CutSetting,
) -> Result<(), GcodeError> {
    let figure = |name: &str| {
        let of = setting.torch;
        let value = match name {
            "pierce_height_mm" => of?.pierce_height_mm,
            "pierce_delay_s" => of?.pierce_delay_s,
            "cut_height_mm" => of?.cut_height_mm,
            "amps" => of?.amps,
            "safe_height_mm" => torch.safe_height_mm?,
            "feed_mm_per_min" => cut.feed_mm_per_min,
            _ => return None,
        };
        Some(short(value, 3))
    };
    for line in template {
        let line = filled(line, figure).map_err(|name| GcodeError::Template {
            missing: format!("{{{name}}}"),
        })?;
        w.line(line);
    }
    Ok(())
}
