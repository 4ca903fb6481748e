//! The banner, and what the controller must be and how it must be set before a job.

use std::collections::BTreeMap;
use std::io;
use std::time::Duration;

use super::reason::error_words;
use super::{ANSWER, RESET, SendError, Sender};
use crate::base::units::short;
use crate::control::offsets::Offsets;
use crate::control::reply::{MachineState, Reply, Status};
use crate::control::stranger;
use crate::control::survey::{JobReach, Survey};
use crate::machine::{self, Machine};

/// The largest receive buffer believed, bytes: what grblHAL and FluidNC boards tell at the most.
const LARGEST_BUFFER: usize = 1024;

/// The coarsest reports by which a job can be followed, mm: less than makes a head astray.
const COARSEST_MM: f64 = 2.0 * super::prove::ASTRAY_MM;

/// What was heard before anything was.
pub(super) const NOTHING: &str = "nothing was heard";

/// What the controller is, found out before the job.
pub(super) struct Facts {
    /// Its receive buffer, bytes.
    pub buffer: usize,
    /// What it calls itself.
    pub firmware: String,
    /// What it reports lengths in, mm.
    pub unit_mm: f64,
    /// It homes.
    pub homes: bool,
    /// The coordinate system that the job runs in.
    pub system: String,
    /// How far a report may be from the job's way.
    pub tolerance_mm: f64,
    /// Machine coordinates of the job's zero point, mm; 0 if the job cuts nothing.
    pub offset_mm: [f64; 3],
    /// The report of where it stands, if the job cuts anything.
    pub position_mm: Option<Status>,
    /// Letters of its build options (`$I`).
    letters: String,
    /// Its settings, by number.
    settings: BTreeMap<u32, f64>,
}

impl Facts {
    /// How high the head stands, machine coordinates, mm.
    pub(super) fn height_mm(&self) -> Option<f64> {
        let status = self.position_mm.as_ref()?;
        let z = status.position_mm?[2];
        Some(if status.is_work {
            z + self.offset_mm[2]
        } else {
            z
        })
    }

    /// grblHAL: how long a spindle gets to run up after a hold, s (`$392`).
    pub(super) fn run_up_s(&self) -> Option<f64> {
        self.settings.get(&392).copied()
    }

    /// How far it leaves its limit switches when it homes, mm.
    pub(super) fn pull_off_mm(&self) -> f64 {
        let way = self.settings.get(&27).copied().unwrap_or(1.0);
        way.clamp(0.0, 10.0)
    }

    fn setting(&self) -> impl Fn(u32) -> Option<f64> + '_ {
        |number| self.settings.get(&number).copied()
    }
}

/// How far a report may be from where the job says the head is, but for the rounding of the report: an end rounded to
/// steps and the head a step off the straight line, and the chords of arcs, the controller's and ours.
fn tolerance_mm(setting: &dyn Fn(u32) -> Option<f64>) -> f64 {
    // Boards that do not tell their steps are taken for coarse ones.
    const COARSE: f64 = 20.0;
    const CHORDS_MM: f64 = 0.004;
    const SLACK_MM: f64 = 0.01;
    let step = |number| 1.0 / setting(number).filter(|v| *v > 0.0).unwrap_or(COARSE);
    let arc = setting(12).unwrap_or(0.002).clamp(0.0, 1.0);
    1.5 * step(100).hypot(step(101)) + arc + CHORDS_MM + SLACK_MM
}

impl Sender<'_> {
    pub(super) fn connect_error(&self, source: io::Error) -> SendError {
        SendError::Connect {
            port: self.port(),
            source,
        }
    }

    /// Waits for the banner, resets the controller if there is none, and gives the banner.
    fn connect(&mut self) -> Result<String, SendError> {
        let mut heard = NOTHING.to_owned();
        if let Some(banner) = self.await_banner(self.options.banner_wait, &mut heard)? {
            return Ok(banner);
        }
        self.reset_and_connect(heard)
    }

    /// Resets the controller and gives its banner. `heard`: what was heard so far in place of one.
    pub(super) fn reset_and_connect(&mut self, mut heard: String) -> Result<String, SendError> {
        self.link
            .send(RESET)
            .map_err(|source| self.connect_error(source))?;
        self.await_banner(ANSWER, &mut heard)?
            .ok_or(SendError::NoController {
                port: self.port(),
                heard,
            })
    }

    /// The banner, if it comes in this time.
    fn await_banner(
        &mut self,
        wait: Duration,
        heard: &mut String,
    ) -> Result<Option<String>, SendError> {
        let deadline = self.now() + wait;
        while let Some(reply) = self
            .link
            .reply_before(deadline)
            .map_err(|source| self.connect_error(source))?
        {
            self.check_interrupted()?;
            match reply {
                Reply::Banner(text) => {
                    self.hear_out()?;
                    return Ok(Some(text));
                }
                Reply::Unknown(text) => *heard = stranger::words(&text),
                _ => {}
            }
        }
        Ok(None)
    }

    /// What follows the banner at once (the lock's message) belongs to it.
    pub(super) fn hear_out(&mut self) -> Result<(), SendError> {
        let settle = self.now() + Duration::from_millis(100);
        while self
            .link
            .reply_before(settle)
            .map_err(|source| self.connect_error(source))?
            .is_some()
        {}
        Ok(())
    }

    /// The person may change their mind before anything is sent.
    pub(super) fn check_interrupted(&self) -> Result<(), SendError> {
        if self.progress.interrupted() {
            return Err(SendError::NotReady {
                why: "interrupted before the job began".into(),
            });
        }
        Ok(())
    }

    /// Sends a question and collects what is said until `ok`.
    pub(super) fn ask(&mut self, question: &str) -> Result<Vec<Reply>, SendError> {
        self.try_ask(question)?
            .map_err(|number| SendError::NotReady {
                why: format!(
                    "the controller answers {question} with error {number}: {}",
                    error_words(number)
                ),
            })
    }

    /// The same; the inner error is the number of the controller's.
    fn try_ask(&mut self, question: &str) -> Result<Result<Vec<Reply>, u32>, SendError> {
        let lost = |port: String, source| SendError::Connect { port, source };
        let text = format!("{question}\n");
        self.link
            .send(text.as_bytes())
            .map_err(|source| lost(self.port(), source))?;
        let deadline = self.now() + ANSWER;
        let mut answer = Vec::new();
        loop {
            self.check_interrupted()?;
            match self
                .link
                .reply_before(deadline)
                .map_err(|source| lost(self.port(), source))?
            {
                Some(Reply::Ok) => return Ok(Ok(answer)),
                Some(Reply::Error(number)) => return Ok(Err(number)),
                Some(reply) => answer.push(reply),
                None => {
                    return Err(SendError::NoController {
                        port: self.port(),
                        heard: format!("{question} was not answered"),
                    });
                }
            }
        }
    }

    /// Banner, then pre-flight.
    pub(super) fn connect_and_check(&mut self) -> Result<Facts, SendError> {
        let firmware = self.connect()?;
        self.check_idle()?;
        let facts = self.preflight(firmware)?;
        self.survey_travel(&facts)?;
        Ok(facts)
    }

    /// The machine must be ready.
    pub(super) fn check_idle(&mut self) -> Result<(), SendError> {
        let why = match self.ask_status()?.state {
            MachineState::Idle => return Ok(()),
            MachineState::Alarm => {
                "the machine is locked: home it ($H), or unlock it ($X) if you know where it stands"
                    .into()
            }
            other => {
                format!("the machine is not idle ({other:?}): bring it to rest first")
            }
        };
        Err(SendError::NotReady { why })
    }

    /// Is this the controller, set as the job needs it?
    pub(super) fn preflight(&mut self, firmware: String) -> Result<Facts, SendError> {
        let not_ready = |why: String| Err(SendError::NotReady { why });
        let (buffer, letters) = self.ask_buffer()?;
        let mut settings = BTreeMap::new();
        for reply in self.ask("$$")? {
            if let Reply::Setting(number, value) = reply {
                settings.insert(number, value);
            }
        }
        let setting = |number: u32| settings.get(&number).copied();
        if self.job.is_torch() && setting(32) != Some(0.0) {
            return not_ready(
                "the controller is in laser mode, or does not tell ($32): it would put the torch out on every rapid, also between the pierce and the cut. Set $32=0, then send again"
                    .into(),
            );
        }
        if !self.job.is_torch() && setting(32) != Some(1.0) {
            return not_ready(
                "the controller is not in laser mode ($32=1): its beam would stay on between cuts and in a pause. Set $32=1, then send again"
                    .into(),
            );
        }
        // grblHAL: how long a spindle gets to run up after a hold or the door.
        if let Some(run_up_s) = setting(392).filter(|s| self.job.is_torch() && *s > 0.0) {
            self.progress.note(&format!(
                "warning: after a pause this controller lights the torch and stands for {} s before it moves ($392): set $392=0",
                short(run_up_s, 1)
            ));
        }
        let Some(s_max) = setting(30) else {
            return not_ready("the controller does not tell its full power ($30)".into());
        };
        if let Some(wanted) = self.options.s_max
            && wanted != s_max
        {
            return not_ready(format!(
                "the job is written for full power at S{wanted}, the controller is set to S{s_max} ($30): every power would be wrong by {:.2} times. Set $30={wanted}, or make the job for this machine",
                wanted / s_max
            ));
        }
        if self.job.largest_s() > s_max {
            return not_ready(format!(
                "the job asks for S{}, the controller's full power is S{s_max} ($30): make the job for this machine, or set $30",
                self.job.largest_s()
            ));
        }
        let system = self.check_modal_state()?;
        let mut facts = Facts {
            buffer,
            firmware,
            unit_mm: if setting(13).is_some_and(|v| v != 0.0) {
                25.4
            } else {
                1.0
            },
            homes: setting(22).is_some_and(|v| v != 0.0),
            system: if self.job.names_first_system() {
                "G54".into()
            } else {
                system
            },
            tolerance_mm: tolerance_mm(&setting),
            offset_mm: [0.0; 3],
            position_mm: None,
            letters,
            settings: settings.clone(),
        };
        self.link.unit_mm = facts.unit_mm;
        if self.job.is_torch() {
            self.tells_output()?;
        }
        let reaches = |made_for: &(Machine, Option<JobReach>)| made_for.1.is_some();
        if self.cuts.is_some_and(|cuts| !cuts.is_empty())
            || self.options.made_for.as_deref().is_some_and(reaches)
        {
            self.locate(&mut facts)?;
        }
        self.survey_settings(&facts)?;
        Ok(facts)
    }

    /// Without laser mode a stop is only proven by reports that tell what is switched on: the controller must give them.
    fn tells_output(&mut self) -> Result<(), SendError> {
        // GRBL tells in every tenth report at rest.
        const REPORTS: u32 = 25;
        for _ in 0..REPORTS {
            match self.ask_status()?.lit() {
                Some(false) => return Ok(()),
                Some(true) => {
                    return Err(SendError::NotReady {
                        why: "the machine reports that its output is on already: switch it off (M5), then try again".into(),
                    });
                }
                None => {}
            }
        }
        Err(SendError::NotReady {
            why: "the controller's reports do not tell what is switched on (A: beside Ov:), so it could not be proven that a stop puts the torch out: switch these reports on ($10 on grblHAL), or use a firmware that has them".into(),
        })
    }

    /// Tells what is set otherwise than the machine's profile says.
    fn survey_settings(&self, facts: &Facts) -> Result<(), SendError> {
        match self.options.made_for.as_deref() {
            Some((machine, _)) => self.judge(&Survey::settings(&facts.setting(), machine)),
            None => Ok(()),
        }
    }

    /// Refuses a job that would leave the travel from where its zero point lies.
    pub(super) fn survey_travel(&mut self, facts: &Facts) -> Result<(), SendError> {
        let options = self.options;
        let Some((machine, Some(reach))) = options.made_for.as_deref() else {
            return Ok(());
        };
        if facts.position_mm.is_none() {
            return Ok(());
        }
        let mut survey = Survey::default();
        if machine.controller == machine::Controller::FluidNc {
            let mut told = Vec::new();
            for key in Survey::TRAVEL_OF_FILE {
                // A version that does not know a key refuses it.
                told.extend(self.try_ask(key)?.unwrap_or_default());
            }
            survey.travel_of_file(&told, reach, facts.offset_mm);
        } else {
            survey.travel(&facts.setting(), &facts.letters, reach, facts.offset_mm);
        }
        self.judge(&survey)
    }

    fn judge(&self, survey: &Survey) -> Result<(), SendError> {
        for warning in &survey.warned {
            self.progress.note(&format!("warning: {warning}"));
        }
        match survey.refused.first() {
            None => Ok(()),
            Some(why) => Err(SendError::NotReady { why: why.clone() }),
        }
    }

    /// Where the job's zero point lies, and where the head stands.
    pub(super) fn locate(&mut self, facts: &mut Facts) -> Result<(), SendError> {
        let told = Offsets::of(&self.ask("$#")?);
        let Some(zero) = told.zero(&facts.system) else {
            return Err(SendError::NotReady {
                why: format!(
                    "the controller does not tell where the job's zero point lies ({} in $#): try again",
                    facts.system
                ),
            });
        };
        facts.offset_mm = zero.map(|v| v * facts.unit_mm);
        let status = self.ask_status()?;
        // Both axes together; and the offset, which is told with as many decimals, where the position is the machine's.
        let rounding_mm = 2.0 * std::f64::consts::SQRT_2 * status.rounding_mm;
        if rounding_mm > COARSEST_MM {
            return Err(SendError::NotReady {
                why: format!(
                    "the controller tells its position in steps of {} mm, so nobody can say which cuts are made: let it report millimetres ($13=0)",
                    short(2.0 * status.rounding_mm, 2)
                ),
            });
        }
        let exact_mm = tolerance_mm(&facts.setting());
        facts.tolerance_mm = exact_mm + rounding_mm;
        facts.position_mm = Some(status);
        Ok(())
    }

    /// The size of the controller's receive buffer, as far as it is believed, and the letters of its build options.
    fn ask_buffer(&mut self) -> Result<(usize, String), SendError> {
        let mut buffer = None;
        let mut letters = String::new();
        for reply in self.ask("$I")? {
            if let Reply::Message(text) = reply
                && let Some(options) = text.strip_prefix("[OPT:")
            {
                let mut fields = options.trim_end_matches(']').split(',');
                fields.next().unwrap_or("").clone_into(&mut letters);
                buffer = fields.nth(1).and_then(|f| f.parse::<usize>().ok());
            }
        }
        // FluidNC does not tell: then the profile must.
        let told = buffer.filter(|&b| b >= 82).or(self.options.buffer);
        let Some(told) = told.filter(|&b| b >= 82) else {
            return Err(SendError::NotReady {
                why: "the controller does not tell the size of its receive buffer ($I), and neither does the machine's profile (receive_buffer_bytes): it is not known how much can be sent at once"
                    .into(),
            });
        };
        // One byte less than told: grblHAL tells the size of a ring that holds one less. And never more than the
        // profile says, nor more than any of these boards has: a damaged number must not overrun the real buffer.
        let believed = told
            .min(self.options.buffer.unwrap_or(LARGEST_BUFFER))
            .min(LARGEST_BUFFER);
        Ok((believed - 1, letters))
    }

    /// The beam must be off before the job, and no startup block may light it after a reset: blocks run after every
    /// one of them, also after the one that ends a stop. Gives the coordinate system in force.
    fn check_modal_state(&mut self) -> Result<String, SendError> {
        let mut system = "G54".to_owned();
        for reply in self.ask("$G")? {
            if let Reply::Message(text) = &reply
                && let Some(found) = text
                    .split([' ', ':', ']'])
                    .find(|w| ["G54", "G55", "G56", "G57", "G58", "G59"].contains(w))
            {
                found.clone_into(&mut system);
            }
            if let Reply::Message(text) = reply
                && text.starts_with("[GC:")
                && text
                    .trim_end_matches(']')
                    .split([' ', ':'])
                    .any(|word| word == "M3" || word == "M4")
            {
                return Err(SendError::NotReady {
                    why: format!(
                        "the controller's beam is armed already ({text}): send M5 to it, then try again"
                    ),
                });
            }
        }
        for reply in self.ask("$N")? {
            if let Reply::Unknown(text) = reply
                && let Some((name, block)) = text.split_once('=')
                && name.starts_with("$N")
                && !block.trim().is_empty()
            {
                return Err(SendError::NotReady {
                    why: format!(
                        "the controller runs a startup block after every reset ({text}), also after an emergency stop: clear it with {name}= and send again"
                    ),
                });
            }
        }
        Ok(system)
    }

    /// Asks for a status and waits for it.
    pub(super) fn ask_status(&mut self) -> Result<Status, SendError> {
        let deadline = self.now() + ANSWER;
        self.link
            .send(b"?")
            .map_err(|source| self.connect_error(source))?;
        loop {
            self.check_interrupted()?;
            match self
                .link
                .reply_before(deadline)
                .map_err(|source| self.connect_error(source))?
            {
                Some(Reply::Status(status)) => return Ok(status),
                Some(_) => {}
                None => {
                    return Err(SendError::NoController {
                        port: self.port(),
                        heard: "a status request was not answered".into(),
                    });
                }
            }
        }
    }
}
