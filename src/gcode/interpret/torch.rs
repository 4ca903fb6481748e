//! What only a torch does: it burns at rest too, stands still until it is through, and moves up and down.

use kurbo::Point;

use super::block::{Block, Motion, Output};
use super::words::material_feed;
use super::{Beam, Dialect, Program, State};
use crate::base::units::short;
use crate::gcode::finding::{Finding, Rule};

/// Longer than any pierce, seconds.
const LONGEST_PIERCE_S: f64 = 60.0;

/// QtPlasmaC's digital output that keeps the torch off, and its analog output that slows it.
const TORCH_OFF: f64 = 3.0;
const VELOCITY: f64 = 3.0;
/// QtPlasmaC's digital output that stops height control.
const HEIGHT: f64 = 2.0;

/// The part of the state that lasers have no use for.
pub(super) struct Torch {
    /// Line where it was switched on, as long as it has not moved since.
    pierced: Option<usize>,
    /// Not held off by M62 or M64.
    pub enabled: bool,
    /// What M62 or M63 do to that with the next motion.
    then_enabled: Option<bool>,
    /// It was held off during a cut: after that there is no arc until it is switched on anew.
    gone_out: bool,
    /// Height control runs, as above.
    follows: bool,
    then_follows: Option<bool>,
    /// Part of the feed that M67 or M68 leave.
    part: f64,
    /// What M67 makes of it with the next motion.
    then_part: Option<f64>,
    /// Feed of the material that is loaded: 0 before there is one, none where only the table knows it.
    pub material_feed: Option<f64>,
    /// That feed, where the reader knows it.
    table_feed: Option<f64>,
    /// The table was told to change to another material, and not waited for.
    pub changing: bool,
    /// Height over the sheet, mm, as far as it is known.
    z: Option<f64>,
    /// A probe has found the sheet since Z was last named: Z words are not heights over it.
    probed: bool,
    /// The height at which it last cut.
    cut_z: Option<f64>,
    /// Whether a line began with a move since the torch was last switched off: QtPlasmaC insists.
    moved: bool,
}

impl Torch {
    /// Before a job; `table_feed` as for [`super::read_with`].
    pub fn new(table_feed: Option<f64>) -> Self {
        Self {
            pierced: None,
            enabled: true,
            then_enabled: None,
            gone_out: false,
            follows: true,
            then_follows: None,
            part: 1.0,
            then_part: None,
            material_feed: Some(0.0),
            table_feed,
            changing: false,
            z: None,
            probed: false,
            cut_z: None,
            moved: false,
        }
    }

    /// The feed that velocity reduction leaves.
    pub fn slowed(&self, feed: f64) -> f64 {
        feed * self.part
    }

    /// QtPlasmaC looks at how a line begins, and not at what it does.
    pub fn starts_a_move(&mut self, raw: &str) {
        let start: String = raw
            .chars()
            .filter(|c| !c.is_whitespace())
            .take(4)
            .map(|c| c.to_ascii_lowercase())
            .collect();
        // A leading zero is taken away: G00 is G0.
        let start = start.replacen("g00", "g0", 1).replacen("g01", "g1", 1);
        if ["g0x", "g0y", "g1x", "g1y"]
            .iter()
            .any(|s| start.starts_with(s))
        {
            self.moved = true;
        }
    }
}

impl State {
    /// A material that the job brings: `(o=0, …)`.
    pub(super) fn material(&mut self, line: usize, inside: &str, program: &mut Program) {
        match material_feed(inside) {
            Ok(feed) => (self.torch.material_feed, self.torch.changing) = (Some(feed), false),
            Err(problem) => program
                .findings
                .push(Finding::at(line, Rule::Syntax, problem)),
        }
    }

    pub(super) fn torch_block(
        &mut self,
        line: usize,
        block: &Block,
        unit: f64,
        program: &mut Program,
    ) {
        if block.material {
            match block.p {
                Some(p) if p >= 0.0 && p.fract() == 0.0 && p <= f64::from(u32::MAX) => {
                    // Which feed that is only the table knows.
                    self.torch.material_feed = self.torch.table_feed;
                    self.torch.changing = true;
                    program.materials.push((line, p as u32));
                }
                Some(p) => program.findings.push(Finding::at(
                    line,
                    Rule::Syntax,
                    format!(
                        "M190 P{}: QtPlasmaC numbers its materials 0, 1, 2, …",
                        short(p, 3)
                    ),
                )),
                None => program.findings.push(Finding::at(
                    line,
                    Rule::Syntax,
                    "M190 without P: which material?".into(),
                )),
            }
        }
        // Input 3, until it is on, for at most Q seconds.
        if block.waits && (block.p, block.l) == (Some(3.0), Some(3.0)) && block.q > Some(0.0) {
            self.torch.changing = false;
        }
        if let Some(output) = block.output {
            self.output(line, output, block, program);
        }
        if let Some(beam) = block.beam {
            self.switch(line, beam, block, program);
        }
        if block.dwell {
            self.pierce_delay(line, block, program);
        }
        self.dwell(line, block, program);
        if block.names_place {
            return self.name_place(line, block, unit, program);
        }
        if block.forgets_place {
            self.torch.z = None;
            return;
        }
        if let Some(motion) = block.motion {
            self.motion = Some(motion);
        }
        let sideways = block.x.is_some() || block.y.is_some();
        if sideways && self.motion == Some(Motion::Probe) {
            program.findings.push(Finding::at(
                line,
                Rule::Syntax,
                "a probe that moves over the sheet: where it stops cannot be checked".into(),
            ));
        }
        let rises = block.z.is_some() && self.dialect != Dialect::QtPlasmaC;
        if rises && sideways && self.beam == Beam::Torch {
            program.findings.push(Finding::at(
                line,
                Rule::Height,
                "the torch moves up or down while it cuts: its height belongs before the cut"
                    .into(),
            ));
        }
        if rises {
            self.rise(block, unit);
        }
        if sideways {
            self.sideways(line, block, unit, program);
        }
    }

    /// A motion over the sheet.
    fn sideways(&mut self, line: usize, block: &Block, unit: f64, program: &mut Program) {
        if let Some(enabled) = self.torch.then_enabled.take() {
            self.torch.enabled = enabled;
        }
        if let Some(part) = self.torch.then_part.take() {
            self.torch.part = part;
        }
        if let Some(follows) = self.torch.then_follows.take() {
            self.torch.follows = follows;
        }
        let on = self.beam == Beam::Torch && self.torch.enabled;
        let rapid = self.motion == Some(Motion::Rapid);
        let mut say = |rule, text: String| program.findings.push(Finding::at(line, rule, text));
        if rapid && self.beam != Beam::Off {
            say(
                Rule::BurnOnRapid,
                match self.beam {
                    Beam::Scribe => "a rapid with the scribe on the sheet".into(),
                    _ => "a rapid with the torch on".into(),
                },
            );
        }
        if self.beam == Beam::Torch {
            if on && self.torch.gone_out {
                say(
                    Rule::StandingBeam,
                    "the torch, held off during this cut, may burn again: there is no arc, or one that pierces in motion; switch it off and on (M5, M3)"
                        .into(),
                );
            }
            // Once is enough.
            self.torch.gone_out = !on;
        }
        // Without QtPlasmaC nobody but the job knows the height.
        if self.dialect != Dialect::QtPlasmaC {
            if on && self.torch.pierced.is_some() {
                if self.torch.z.is_none() {
                    say(
                        Rule::Height,
                        "the torch cuts at a height that nobody set: probe, set Z (G92 Z0), and go to the cutting height first"
                            .into(),
                    );
                } else if self.torch.z.is_some_and(|z| z <= 0.0) {
                    say(
                        Rule::Height,
                        "the torch cuts at or below the surface that it probed".into(),
                    );
                }
                self.torch.cut_z = self.torch.z;
            }
            if !on
                && rapid
                && let (Some(z), Some(cut_z)) = (self.torch.z, self.torch.cut_z)
                && z <= cut_z
            {
                say(
                    Rule::Height,
                    format!(
                        "the torch travels {} mm over the sheet, no higher than it cuts: lift it first",
                        short(z, 3)
                    ),
                );
            }
        }
        if on
            && let Some(at) = self.torch.pierced.take()
            && let [Some(x), Some(y)] = self.at
        {
            program.pierces.push((at, Point::new(x, y)));
        }
        self.travel(line, block, unit, program);
    }

    /// M3, M4, M5.
    fn switch(&mut self, line: usize, beam: Beam, block: &Block, program: &mut Program) {
        let mut say = |rule, text: String| program.findings.push(Finding::at(line, rule, text));
        let tool = block.tool.filter(|_| self.dialect.is_linuxcnc());
        if beam == Beam::Off {
            // A pierce without a cut is a hole.
            if let Some(at) = self.torch.pierced.take()
                && let [Some(x), Some(y)] = self.at
            {
                let place = Point::new(x, y);
                program.pierces.push((at, place));
                program.moves.push(super::Move {
                    line: at,
                    from: Some(place),
                    to: place,
                    rapid: false,
                    feed_mm_per_min: self.feed,
                    power: 1.0,
                    beam: Beam::Torch,
                });
            }
            self.beam = Beam::Off;
            (self.torch.moved, self.torch.gone_out) = (false, false);
            return;
        }
        if self.beam != Beam::Off {
            say(
                Rule::StandingBeam,
                "the torch is switched on while it is on: it pierces again where it stands".into(),
            );
        }
        let scribe = match tool {
            None => false,
            Some(0.0) => false,
            Some(1.0) if self.dialect == Dialect::QtPlasmaC => true,
            Some(other) => {
                return say(
                    Rule::Syntax,
                    format!(
                        "${} is no tool that is known here: $0 is the torch, and QtPlasmaC's $1 the scribe",
                        short(other, 3)
                    ),
                );
            }
        };
        if self.dialect == Dialect::QtPlasmaC {
            if self.power <= 0.0 {
                say(
                    Rule::Syntax,
                    "the torch is switched on without S: QtPlasmaC starts it for S1 and more"
                        .into(),
                );
            }
            if !self.torch.moved {
                say(
                    Rule::Syntax,
                    "QtPlasmaC refuses a torch that is switched on before a line that begins with G0 X or G0 Y".into(),
                );
            }
        }
        if self.at.contains(&None) {
            say(
                Rule::Modes,
                "the torch is switched on where nobody said the head is".into(),
            );
        }
        if scribe {
            self.beam = Beam::Scribe;
        } else {
            self.beam = Beam::Torch;
            self.torch.pierced = Some(line);
        }
    }

    /// G4: at rest the torch may only be on until it is through.
    fn pierce_delay(&self, line: usize, block: &Block, program: &mut Program) {
        let mut say = |text: String| {
            program
                .findings
                .push(Finding::at(line, Rule::StandingBeam, text));
        };
        if self.beam != Beam::Torch || !self.torch.enabled {
            return;
        }
        if self.dialect == Dialect::QtPlasmaC {
            say("the torch waits (G4) while it is on: QtPlasmaC has its own pierce delay".into());
        } else if self.torch.pierced.is_none() {
            say("the torch waits (G4) in the middle of a cut".into());
        } else if block.p.is_some_and(|p| p > LONGEST_PIERCE_S) {
            say(format!(
                "the torch stands for {} s: no pierce takes so long",
                short(block.p.unwrap_or(0.0), 3)
            ));
        }
    }

    /// M62 to M68.
    fn output(&mut self, line: usize, output: Output, block: &Block, program: &mut Program) {
        let mut say = |rule, text: String| program.findings.push(Finding::at(line, rule, text));
        match output {
            Output::Digital { on, with_motion } => match block.p {
                Some(TORCH_OFF) if with_motion => self.torch.then_enabled = Some(!on),
                Some(TORCH_OFF) => self.torch.enabled = !on,
                Some(HEIGHT) if with_motion => self.torch.then_follows = Some(!on),
                Some(HEIGHT) => self.torch.follows = !on,
                _ => say(
                    Rule::Syntax,
                    "an output of which it is not known here what it does: P2 is height control, P3 the torch".into(),
                ),
            },
            Output::Analog { with_motion } => {
                let (Some(VELOCITY), Some(q)) = (block.e, block.q) else {
                    return say(
                        Rule::Syntax,
                        "an output of which it is not known here what it does: E3 with Q is the speed".into(),
                    );
                };
                if !(0.0..=100.0).contains(&q) {
                    return say(
                        Rule::Feed,
                        format!("{} % of the speed: 1 to 100, or 0 for full speed", short(q, 3)),
                    );
                }
                let part = if q == 0.0 { 1.0 } else { q / 100.0 };
                if with_motion {
                    self.torch.then_part = Some(part);
                } else {
                    self.torch.part = part;
                }
            }
        }
    }

    /// Outputs outlive the program that set them.
    pub(super) fn left_behind(&self, line: usize, program: &mut Program) {
        let torch = &self.torch;
        for (wrong, text) in [
            (
                !torch.enabled,
                "the program ends with the torch held off: the next job would not cut; M65 P3 belongs before the end",
            ),
            (
                !torch.follows,
                "the program ends with height control off: the next job would cut without; M65 P2 belongs before the end",
            ),
            (
                torch.part != 1.0,
                "the program ends with the speed lowered: the next job would be as slow; M68 E3 Q0 belongs before the end",
            ),
            (
                [torch.then_enabled, torch.then_follows] != [None; 2] || torch.then_part.is_some(),
                "the program ends with an output that waits for a motion (M62, M63, M67): it would change in the next job",
            ),
        ] {
            if wrong {
                program
                    .findings
                    .push(Finding::at(line, Rule::Modes, text.into()));
            }
        }
    }

    /// G92: only the height may be named anew.
    fn name_place(&mut self, line: usize, block: &Block, unit: f64, program: &mut Program) {
        if block.x.is_some() || block.y.is_some() {
            program.findings.push(Finding::at(
                line,
                Rule::Modes,
                "G92 with X or Y: the sheet would lie elsewhere from here on".into(),
            ));
        }
        if let Some(z) = block.z {
            (self.torch.z, self.torch.probed) = (Some(z * unit), false);
        }
    }

    /// A Z word.
    fn rise(&mut self, block: &Block, unit: f64) {
        let Some(z) = block.z else { return };
        let torch = &mut self.torch;
        torch.z = match (self.motion, self.absolute) {
            (Some(Motion::Probe), _) => {
                torch.probed = true;
                None
            }
            // A probe ends at the sheet.
            (_, Some(false)) => {
                let now = torch.z.or(torch.probed.then_some(0.0));
                now.map(|now| now + z * unit)
            }
            _ => (!torch.probed).then_some(z * unit),
        };
    }
}
