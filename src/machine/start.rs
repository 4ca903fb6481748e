//! A starting profile for one's own machine.

use std::collections::BTreeMap;

use super::shipped::{CATALOG, parse};
use crate::base::starting::{StartError, annotated, renamed, set};
use crate::base::units::short;
use crate::material::check_name;

/// What a GRBL controller says of itself: the answer to `$$`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ControllerSettings(BTreeMap<u16, f64>);

impl ControllerSettings {
    /// Reads `$number=value` lines, with or without words behind them; other lines are passed over.
    ///
    /// # Errors
    /// [`StartError::NoSettings`] for text without any setting that a profile can use.
    pub fn parse(text: &str) -> Result<Self, StartError> {
        let settings: BTreeMap<u16, f64> = text
            .lines()
            .filter_map(|line| {
                let (number, value) = line.trim().strip_prefix('$')?.split_once('=')?;
                let value = value.split([' ', '(', '\t']).next()?;
                Some((
                    number.parse().ok()?,
                    value.parse().ok().filter(|v: &f64| v.is_finite())?,
                ))
            })
            .collect();
        if [11, 30, 110, 111, 120, 121, 130, 131]
            .iter()
            .all(|n| !settings.contains_key(n))
        {
            return Err(StartError::NoSettings);
        }
        Ok(Self(settings))
    }

    fn get(&self, number: u16) -> Option<f64> {
        self.0.get(&number).copied()
    }

    /// What a person must know of these settings before a laser is run with them.
    pub fn warnings(&self) -> Vec<&'static str> {
        let mut warnings = Vec::new();
        if self.get(32) == Some(0.0) {
            warnings.push(
                "laser mode is off ($32=0): M4 would not follow speed, and the beam would stay on between cuts. Send $32=1 before the first job",
            );
        }
        if self.get(31).is_some_and(|s| s > 0.0) {
            warnings.push("the least power is not zero ($31): the beam would glow where it should be off. Send $31=0");
        }
        warnings
    }
}

/// What a key means, as a comment over it.
fn explain(table: &str, key: &str) -> Option<&'static str> {
    Some(match (table, key) {
        ("", "name") => "how --machine FILE and the job's header call it",
        ("", "title") => "what it is, for people",
        ("", "controller") => "grbl, grblhal, fluidnc, linuxcnc or generic",
        ("controller_limits", "") => "what the controller takes; may be left out",
        ("controller_limits", "line_limit") => "longest line, characters",
        ("controller_limits", "arcs") => "whether it takes G2 and G3",
        ("controller_limits", "lines_per_s") => "short lines that it takes in a second",
        ("laser", "kind") => "co2, diode or fibre",
        ("laser", "watts") => "optical power at 100 %",
        ("laser", "s_max") => "the S word of 100 %; $30 of the controller",
        ("laser", "power_mode") => {
            "dynamic (M4). constant (M3) keeps the beam on if the cable is pulled"
        }
        ("laser", "air_on") => {
            "the lines that start and stop the air; leave both out if there is none"
        }
        ("plasma", "height_control") => {
            "qtplasmac (it probes, pierces and follows the sheet), or plain (the template does)"
        }
        ("plasma", "max_amps") => "largest current of the power source",
        ("plasma", "safe_height_mm") => "height of the torch between cuts",
        ("plasma", "scribe") => "whether QtPlasmaC's scribe ($1) is fitted",
        ("plasma", "corner") => {
            "slower round corners: per cent of the speed, so far before and after, from this angle on"
        }
        ("plasma", "small_hole") => {
            "QtPlasmaC: holes smaller across than below_mm at this per cent of the speed, and past their end with the torch off"
        }
        ("plasma", "material_numbers") => {
            "numbers in QtPlasmaC's own list of materials, by the names of profiles here"
        }
        ("plasma.template", "") => {
            "the lines round every cut; in braces: pierce_height_mm, pierce_delay_s, cut_height_mm, safe_height_mm, feed_mm_per_min, amps"
        }
        ("plasma.template", "begin_cut") => {
            "at the pierce, until the torch is at its cutting height"
        }
        ("plasma.template", "end_cut") => "at the end of a cut",
        ("bed", "width_mm") => "along X, as far as the head reaches; $130",
        ("bed", "height_mm") => "along Y; $131",
        ("bed", "origin") => {
            "the corner where X and Y are zero, seen from the front: front-left, front-right, rear-left, rear-right"
        }
        ("bed", "margin_mm") => "kept free on every side",
        ("motion", "rate_mm_per_min") => "largest rate of each axis; $110 and $111",
        ("motion", "acceleration_mm_per_s2") => "acceleration of each axis; $120 and $121",
        ("motion", "junction_deviation_mm") => {
            "how far corners may be rounded, which decides their speed; $11"
        }
        ("connection", "baud") => "rate of the serial line",
        ("connection", "receive_buffer_bytes") => {
            "what the controller holds unread; the second number of OPT in its answer to $I"
        }
        ("connection", "planner_blocks") => "moves that it plans ahead; the first number there",
        ("connection", "reset_on_open") => "whether opening the port resets the board",
        ("connection", "max_unconfirmed_cuts") => {
            "cuts that may be sent beyond the last one proven, and cut twice after a fault; 3 unless given"
        }
        ("connection", "streaming") => {
            "counted (as much as the buffer holds), or answered (line by line, for odd firmware)"
        }
        ("homing", "enabled") => "whether it has switches and $H works; $22",
        ("job", "park") => "where the head goes at the end",
        ("job", "preamble") => "lines after units and modes, before the first motion",
        ("job", "postamble") => "lines after the head is parked",
        _ => return None,
    })
}

/// A commented profile called `name`, with everything else as in the shipped `from`, and with a controller's own
/// settings in place of those of the shipped one where they are given.
///
/// # Errors
/// [`StartError`].
pub fn start(
    name: &str,
    from: &str,
    settings: Option<&ControllerSettings>,
) -> Result<String, StartError> {
    check_name(name).map_err(|c| StartError::Name(c.problem))?;
    let mut text = renamed(&CATALOG, name, from)?;
    if let Some(settings) = settings {
        text = with_settings(&text, settings);
    }
    let text = format!(
        "# A machine for kagome, made from the shipped {from}. Lengths in millimetres.\n# Change what differs, then: kagome machines check FILE\n{}",
        annotated(&text, explain)
    );
    parse(name, &text)?;
    Ok(text)
}

fn with_settings(text: &str, settings: &ControllerSettings) -> String {
    let mut text = text.to_owned();
    let number = |n: u16| settings.get(n).map(|v| short(v, 3));
    let pair = |a: u16, b: u16| Some(format!("{{ x = {}, y = {} }}", number(a)?, number(b)?));
    for (table, key, value) in [
        ("laser", "s_max", number(30)),
        ("bed", "width_mm", number(130)),
        ("bed", "height_mm", number(131)),
        ("motion", "rate_mm_per_min", pair(110, 111)),
        ("motion", "acceleration_mm_per_s2", pair(120, 121)),
        ("motion", "junction_deviation_mm", number(11)),
        (
            "homing",
            "enabled",
            settings.get(22).map(|v| (v != 0.0).to_string()),
        ),
    ] {
        if let Some(value) = value {
            text = set(&text, table, key, &value);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::shipped;
    use super::*;

    #[test]
    fn every_shipped_machine_is_a_valid_start_with_a_comment_for_every_key() {
        for (from, text) in shipped() {
            let made = start("mine", from, None).unwrap();
            let mut machine = parse("mine.toml", &made).unwrap();
            assert_eq!(machine.name, "mine");
            machine.name = from.into();
            assert_eq!(machine, parse(from, text).unwrap(), "only the name differs");
            let mut last = "";
            for line in made.lines() {
                let names_a_key = line.contains(" = ") && !line.starts_with([' ', '#']);
                let silent = line.starts_with("format") || line.starts_with("air_off");
                assert!(!names_a_key || silent || last.starts_with("# "), "{line}");
                last = line;
            }
        }
    }

    #[test]
    fn a_controllers_own_settings_go_into_the_profile() {
        let dump = "Grbl 1.1h ['$' for help]\n$11=0.020\n$22=0\n$30=255 (max)\n$31=0\n$32=0\n$110=4000.000\n$111=3000.000\n\
                    $112=500\n$120=300.000\n$121=200.000\n$130=310.000\n$131=210.000\n$132=1\nok\n";
        let settings = ControllerSettings::parse(dump).unwrap();
        assert_eq!(settings.warnings().len(), 1);
        let m = parse("m", &start("mine", "diode-400", Some(&settings)).unwrap()).unwrap();
        assert_eq!(m.laser().unwrap().s_max, 255.0);
        assert_eq!((m.bed.width_mm, m.bed.height_mm), (310.0, 210.0));
        assert_eq!(
            (m.motion.rate_mm_per_min.x, m.motion.rate_mm_per_min.y),
            (4000.0, 3000.0)
        );
        let a = m.motion.acceleration_mm_per_s2;
        assert_eq!(
            (a.x, a.y, m.motion.junction_deviation_mm),
            (300.0, 200.0, 0.02)
        );
        assert!(!m.homing.enabled);
        assert!(matches!(
            ControllerSettings::parse("ok\n$1=25\n"),
            Err(StartError::NoSettings)
        ));
        let absurd = ControllerSettings::parse("$130=1\n").unwrap();
        assert!(matches!(
            start("mine", "diode-400", Some(&absurd)),
            Err(StartError::Invalid(_))
        ));
    }

    #[test]
    fn names_that_would_not_be_found_are_refused() {
        assert!(matches!(
            start("Mein Laser", "diode-400", None),
            Err(StartError::Name(_))
        ));
        assert!(matches!(
            start("diode-400", "diode-400", None),
            Err(StartError::Taken { .. })
        ));
        let text = start("mine", "nothing", None).unwrap_err().to_string();
        assert!(
            text.contains("nothing") && text.contains("plasma-generic"),
            "{text}"
        );
    }
}
