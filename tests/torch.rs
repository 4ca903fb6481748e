//! A torch on a controller without laser mode: held, it must go dark, and a stop must be proven by what is switched on.
//! Judged by the sheet of the simulated machine, and by how long it burnt where it stood.

#![expect(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests fail by panicking"
)]

use std::sync::Mutex;
use std::time::Duration;

use kagome::base::progress::{Progress, Silent};
use kagome::control::journal::{Header, Journal, MemoryStore};
use kagome::control::{
    Change, Cuts, Glance, Job, JobError, JobRules, Operator, Proof, Question, SendError,
    SendOptions, SendReport, StopReason, Transport, Wish, resume, send, send_recorded,
};
use kagome::material::Process;
use kagome::sim::{At, Controller, Faults, Flavour, Mishap, Settings, SimTransport};

const SLITS: usize = 6;
const LENGTH_MM: f64 = 30.0;
const PIERCE_S: f64 = 0.2;

fn text() -> String {
    let mut text = String::from("G21G90\nG54\n");
    for k in 0..SLITS {
        let y = 10.0 * k as f64 + 5.0;
        text.push_str(&format!(
            "G0X5Y{y}\nG0Z4\nM3S1000\nG4P{PIERCE_S}\nG1Z1.5F1000\nG1X{}F1500\nM5\nG0Z20\n",
            5.0 + LENGTH_MM
        ));
    }
    text + "M5\nG0X0Y0\n"
}

fn rules() -> JobRules {
    JobRules {
        allow_constant_power: true,
        process: Process::Plasma,
        ..JobRules::default()
    }
}

fn job() -> Job {
    Job::check(text().as_bytes(), &rules()).unwrap()
}

fn settings(flavour: Flavour) -> Settings {
    Settings {
        laser_mode: false,
        ..Settings::default()
    }
    .with_flavour(flavour)
}

/// A line that two look at, and that loses or doubles real-time bytes.
struct Line<'a> {
    link: &'a Mutex<SimTransport>,
    lost: &'a [u8],
    doubled: &'a [u8],
}

impl<'a> Line<'a> {
    /// One that carries everything.
    fn good(link: &'a Mutex<SimTransport>) -> Self {
        Self {
            link,
            lost: &[],
            doubled: &[],
        }
    }
}

impl Transport for Line<'_> {
    fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        let mut sent = Vec::new();
        for byte in bytes.iter().filter(|b| !self.lost.contains(b)) {
            sent.push(*byte);
            sent.extend(self.doubled.contains(byte).then_some(*byte));
        }
        self.link.lock().unwrap().send(&sent)
    }
    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> std::io::Result<usize> {
        self.link.lock().unwrap().receive(buffer, wait)
    }
    fn now(&self) -> Duration {
        self.link.lock().unwrap().now()
    }
    fn name(&self) -> &str {
        "the simulated machine"
    }
}

/// Who holds the machine.
#[derive(Clone, Copy, PartialEq)]
enum By {
    Wish,
    ButtonAtTheMachine,
}

/// Holds the machine once, in the middle of a cut, and lets it go on after so many reports that show it held.
struct Pauses<'a> {
    link: &'a Mutex<SimTransport>,
    by: By,
    after_mm: f64,
    seen: Mutex<Seen>,
}

#[derive(Default)]
struct Seen {
    /// Reports that showed it held.
    held: u32,
    wish: Option<Wish>,
    done: bool,
    /// Whether the arc was on after twenty of them, and before it was to go on.
    lit_while_held: bool,
    notes: Vec<String>,
}

impl Progress for Pauses<'_> {
    fn note(&self, text: &str) {
        self.seen.lock().unwrap().notes.push(text.to_owned());
    }
}

impl Operator for Pauses<'_> {
    fn wish(&self) -> Option<Wish> {
        self.seen.lock().unwrap().wish.take()
    }

    fn glance(&self, glance: &Glance<'_>) {
        let mut link = self.link.lock().unwrap();
        let mut seen = self.seen.lock().unwrap();
        let lit = link.controller().beam_on();
        let [x, ..] = link.controller().head_mm();
        if !seen.done && lit && x > 5.0 + self.after_mm {
            seen.done = true;
            match self.by {
                By::Wish => seen.wish = Some(Wish::Pause),
                By::ButtonAtTheMachine => link.controller_mut().write(b"!"),
            }
        }
        if glance.paused() {
            seen.held += 1;
            seen.lit_while_held |= (20..60).contains(&seen.held) && lit;
            if seen.held == 60 {
                seen.wish = Some(Wish::Resume);
            }
        }
    }
}

/// What was burnt: mm of each slit, and the longest time on one spot, s.
fn burnt(machine: &Controller) -> ([f64; SLITS], f64) {
    let mut lengths = [0.0; SLITS];
    let mut standing: f64 = 0.0;
    for burn in machine.burns() {
        assert!(!burn.rapid, "{burn:?}");
        if burn.standing() {
            standing = standing.max(burn.end_s - burn.start_s);
            continue;
        }
        let k = ((burn.from_mm[1] - 5.0) / 10.0).round() as usize;
        assert!((burn.from_mm[1] - 10.0 * k as f64 - 5.0).abs() < 0.02);
        lengths[k] += burn.length_mm();
    }
    (lengths, standing)
}

/// A pierce: the delay, the descent, and the stops of the firmware around them.
const PIERCE_AT_MOST_S: f64 = PIERCE_S + 0.15 + 0.25;

#[test]
fn a_torch_cuts_where_it_is_told_and_stands_only_to_pierce() {
    for flavour in [Flavour::Grbl, Flavour::GrblHal, Flavour::FluidNc] {
        let mut link = SimTransport::new(Controller::new(settings(flavour)));
        let options = SendOptions {
            buffer: Some(128),
            ..SendOptions::default()
        };
        let report = send(&mut link, &job(), &options, &Silent).unwrap();
        assert_eq!(report.cuts, SLITS);
        let (lengths, standing) = burnt(link.controller());
        assert!(
            lengths.iter().all(|l| (l - LENGTH_MM).abs() < 0.02),
            "{lengths:?}"
        );
        assert!(
            standing > PIERCE_S && standing < PIERCE_AT_MOST_S,
            "{standing}"
        );
        assert!(!link.controller().beam_on());
    }
}

#[test]
fn the_wrong_mode_is_refused_and_nothing_moves() {
    let laser = "G21G90\nM4S500\nG0X1Y1\nG1X9F900\nM5\n";
    let laser = Job::check(laser.as_bytes(), &JobRules::default()).unwrap();
    for (job, laser_mode, word) in [(job(), true, "$32=0"), (laser, false, "$32=1")] {
        let mut link = SimTransport::new(Controller::new(Settings {
            laser_mode,
            ..Settings::default()
        }));
        let error = send(&mut link, &job, &SendOptions::default(), &Silent).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
        assert_eq!(link.controller().first_motion_s(), None);
    }
    // An output that is on already.
    let mut machine = Controller::new(settings(Flavour::Grbl));
    machine.write(b"M3S1000\n");
    machine.advance(1.0);
    let mut link = SimTransport::new(machine);
    // The banner of switching on is still in the line, so the controller is not reset.
    let error = send(&mut link, &job(), &SendOptions::default(), &Silent).unwrap_err();
    assert!(
        error.to_string().contains("on already") || error.to_string().contains("armed"),
        "{error}"
    );
}

#[test]
fn without_the_word_for_it_no_torch_is_streamed() {
    let rules = JobRules {
        allow_constant_power: false,
        ..rules()
    };
    for m in ["M3", "M4"] {
        let text = text().replace("M3", m);
        let error = Job::check(text.as_bytes(), &rules).unwrap_err();
        assert_eq!(error, JobError::Arc { line: 5 });
        assert!(error.to_string().contains("accept_arc_on_after_lost_link"));
    }
    // Without S the controller would light nothing, and the head go its way dark.
    for dark in ["M3", "M3S0"] {
        let text = text().replace("M3S1000", dark);
        let error = Job::check(text.as_bytes(), &self::rules()).unwrap_err();
        assert_eq!(error, JobError::NoOutput { line: 5 });
    }
    let text = text().replace("F1500\n", "F1500\nS0\n");
    assert!(Job::check(text.as_bytes(), &self::rules()).is_err());
    // A laser still has no probe.
    let probe = b"G21G90\nG38.2Z-5F100\nM5\n";
    assert!(matches!(
        Job::check(probe, &JobRules::default()),
        Err(JobError::Word { .. })
    ));
}

fn paused(
    flavour: Flavour,
    by: By,
    after_mm: f64,
    lost: &[u8],
    doubled: &[u8],
) -> (Result<SendReport, SendError>, Controller, Vec<String>, bool) {
    let link = Mutex::new(SimTransport::new(Controller::new(settings(flavour))));
    let mut line = Line {
        link: &link,
        lost,
        doubled,
    };
    let pauses = Pauses {
        link: &link,
        by,
        after_mm,
        seen: Mutex::default(),
    };
    let options = SendOptions {
        buffer: Some(128),
        poll: Duration::from_millis(50),
        longest_pause: Some(Duration::from_secs(60)),
        ..SendOptions::default()
    };
    let result = send(&mut line, &job(), &options, &pauses);
    let seen = pauses.seen.into_inner().unwrap();
    assert!(seen.held > 3, "it was paused");
    let machine = link.into_inner().unwrap().into_controller();
    (result, machine, seen.notes, seen.lit_while_held)
}

/// How long the arc may stand in a hold before it is off: one report that shows it, the byte, and the delays of the
/// firmware.
const HELD_AT_MOST_S: f64 = 0.25;

#[test]
fn a_torch_that_is_held_goes_dark_and_on_where_it_was() {
    for flavour in [Flavour::Grbl, Flavour::GrblHal, Flavour::FluidNc] {
        for by in [By::Wish, By::ButtonAtTheMachine] {
            for after_mm in [2.0, 11.0, 24.0] {
                let (result, machine, notes, lit) = paused(flavour, by, after_mm, &[], &[]);
                let report = result.unwrap();
                assert_eq!(report.cuts, SLITS);
                assert!(!lit, "{notes:?}");
                assert!(
                    notes.iter().any(|n| n.contains("torch is off")),
                    "{notes:?}"
                );
                assert!(!notes.iter().any(|n| n.contains("door")), "{notes:?}");
                let (lengths, standing) = burnt(&machine);
                assert!(
                    lengths.iter().all(|l| (l - LENGTH_MM).abs() < 0.05),
                    "{lengths:?}"
                );
                // grblHAL gives the torch time before it goes on, as the sender's warning says.
                let run_up_s = if flavour == Flavour::GrblHal {
                    4.1
                } else {
                    0.0
                };
                assert!(
                    standing < PIERCE_AT_MOST_S.max(HELD_AT_MOST_S).max(run_up_s),
                    "{standing}"
                );
            }
        }
    }
}

#[test]
fn where_the_spindle_stop_fails_the_door_puts_it_out() {
    const STOP: u8 = 0x9e;
    for (lost, doubled) in [(&[STOP][..], &[][..]), (&[][..], &[STOP][..])] {
        let (result, machine, notes, lit) = paused(Flavour::Grbl, By::Wish, 11.0, lost, doubled);
        assert_eq!(result.unwrap().cuts, SLITS);
        assert!(!lit);
        assert!(notes.iter().any(|n| n.contains("safety door")), "{notes:?}");
        let (lengths, standing) = burnt(&machine);
        assert!(lengths.iter().all(|l| (l - LENGTH_MM).abs() < 0.05));
        // The 4 s that the note warns of.
        assert!(standing > 3.9 && standing < 4.6, "{standing}");
    }
}

#[test]
fn where_nothing_puts_it_out_the_job_is_stopped() {
    let (result, machine, _, _) = paused(Flavour::Grbl, By::Wish, 11.0, &[0x9e, 0x84], &[]);
    let Err(SendError::Stopped { reason, confirmed }) = result else {
        panic!("{result:?}");
    };
    assert_eq!(reason, StopReason::HeldOn);
    assert_eq!(
        confirmed.proof,
        Proof::BeamOff {
            position_kept: true
        }
    );
    assert!(!machine.beam_on());
    assert!(burnt(&machine).1 < 2.5);
}

/// Wishes for less power, once.
struct Dim(Mutex<(bool, Vec<String>)>);

impl Progress for Dim {
    fn note(&self, text: &str) {
        self.0.lock().unwrap().1.push(text.to_owned());
    }
}
impl Operator for Dim {
    fn wish(&self) -> Option<Wish> {
        let done = std::mem::replace(&mut self.0.lock().unwrap().0, true);
        (!done).then_some(Wish::Power(Change::Less))
    }
}

#[test]
fn a_torch_is_never_dimmed() {
    let mut link = SimTransport::new(Controller::new(Settings {
        surface_mm: Some(-30.0),
        ..settings(Flavour::Grbl)
    }));
    let dim = Dim(Mutex::default());
    let text = text().replace("G0Z4\n", "G38.2Z-50F500\nG92Z0\nG0Z4\n");
    let job = Job::check(text.as_bytes(), &rules()).unwrap();
    send(&mut link, &job, &SendOptions::default(), &dim).unwrap();
    assert!(link.controller().burns().iter().all(|b| b.s == 1000.0));
    let notes = dim.0.into_inner().unwrap().1;
    assert!(!notes.iter().any(|n| n.contains("PRB")), "{notes:?}");
    assert!(notes.iter().any(|n| n.contains("on or off")), "{notes:?}");
}

#[test]
fn where_no_sheet_is_felt_the_job_is_stopped_before_the_torch_burns() {
    // The sheet lies deeper than the probe looks for it.
    let mut link = SimTransport::new(Controller::new(Settings {
        surface_mm: Some(-70.0),
        ..settings(Flavour::Grbl)
    }));
    let text = text().replace("G0Z4\n", "G38.2Z-50F500\nG92Z0\nG0Z4\n");
    let job = Job::check(text.as_bytes(), &rules()).unwrap();
    let error = send(&mut link, &job, &SendOptions::default(), &Silent).unwrap_err();
    let SendError::Stopped { reason, confirmed } = &error else {
        panic!("{error:?}");
    };
    assert_eq!(reason, &StopReason::Alarm(5));
    assert!(matches!(confirmed.proof, Proof::BeamOff { .. }), "{error}");
    assert!(error.to_string().contains("sheet"), "{error}");
    assert!(link.controller().burns().is_empty());
}

/// Interrupts at a time.
struct StopAt<'a>(&'a Mutex<SimTransport>, f64);

impl Progress for StopAt<'_> {
    fn interrupted(&self) -> bool {
        self.0.lock().unwrap().controller().now_s() > self.1
    }
}
impl Operator for StopAt<'_> {}

#[test]
fn a_stop_at_any_moment_is_dark_and_keeps_the_position() {
    let mut stopped = 0;
    for k in 0..60 {
        let link = Mutex::new(SimTransport::new(Controller::new(settings(Flavour::Grbl))));
        let mut line = Line::good(&link);
        let at = 1.0 + 0.217 * f64::from(k);
        let result = send(
            &mut line,
            &job(),
            &SendOptions::default(),
            &StopAt(&link, at),
        );
        let machine = link.into_inner().unwrap().into_controller();
        assert!(!machine.beam_on(), "{at}");
        let Err(SendError::Stopped { reason, confirmed }) = result else {
            assert!(result.is_ok() || at < 2.5, "{result:?}");
            continue;
        };
        stopped += 1;
        assert_eq!(reason, StopReason::Interrupted);
        assert_eq!(
            confirmed.proof,
            Proof::BeamOff {
                position_kept: true
            },
            "{at}"
        );
        let standing = burnt(&machine).1;
        assert!(standing < PIERCE_AT_MOST_S, "{at}: {standing}");
    }
    assert!(stopped > 30, "{stopped}");
}

/// Sees how high the torch is whenever the head moves dark over the sheet.
struct Heights<'a> {
    link: &'a Mutex<SimTransport>,
    /// Where it was at the last look and whether it burnt, and the least height so far, mm.
    seen: Mutex<([f64; 2], bool, f64)>,
}

impl Progress for Heights<'_> {}
impl Operator for Heights<'_> {
    fn glance(&self, _: &Glance<'_>) {
        let link = self.link.lock().unwrap();
        let [x, y, z] = link.controller().head_mm();
        let mut seen = self.seen.lock().unwrap();
        let moved = (x - seen.0[0]).hypot(y - seen.0[1]) > 0.01;
        let lit = link.controller().beam_on();
        if moved && !lit && !seen.1 {
            seen.2 = seen.2.min(z);
        }
        (seen.0, seen.1) = ([x, y], lit);
    }
}

/// In the middle of the third cut.
struct StopInCut<'a>(&'a Mutex<SimTransport>);
impl Progress for StopInCut<'_> {
    fn interrupted(&self) -> bool {
        let link = self.0.lock().unwrap();
        let [x, y, _] = link.controller().head_mm();
        x > 20.0 && y > 24.0 && link.controller().beam_on()
    }
}
impl Operator for StopInCut<'_> {}

const SURFACE_MM: f64 = -30.0;

/// Stops a job in the kerf and resumes it; gives how low the torch was while it travelled, over the sheet.
fn stopped_in_the_kerf(flavour: Flavour, zero_by_g92: bool) -> f64 {
    let text = text().replace("G0Z4\n", "G38.2Z-80F500\nG92Z0\nG0Z4\n");
    let job = Job::check(text.as_bytes(), &rules()).unwrap();
    let cuts = Cuts::of(&job).unwrap();
    assert_eq!(cuts.len(), SLITS);
    let store = MemoryStore::default();
    let header = Header::of(&job, &cuts, "job.nc", "table", 3);
    let options = SendOptions {
        poll: Duration::from_millis(10),
        buffer: Some(128),
        ..SendOptions::default()
    };
    let mut machine = Controller::new(Settings {
        surface_mm: Some(SURFACE_MM),
        ..settings(flavour)
    });
    if zero_by_g92 {
        machine.write(b"G92X0Y0Z3\n");
        machine.advance(1.0);
    }
    let link = Mutex::new(SimTransport::new(machine));
    let mut journal = Journal::new(header.clone(), store.clone());
    let error = send_recorded(
        &mut Line::good(&link),
        &job,
        &cuts,
        &options,
        &StopInCut(&link),
        &mut journal,
    )
    .unwrap_err();
    assert_eq!(error.confirmed().unwrap().proven, 2, "{error}");
    let head = link.lock().unwrap().controller().head_mm();
    assert!(head[2] < SURFACE_MM + 2.0);

    let heights = Heights {
        link: &link,
        seen: Mutex::new(([head[0], head[1]], false, f64::INFINITY)),
    };
    let bytes = store.bytes();
    let mut journal = Journal::continued(header, &bytes, store).unwrap();
    // The position is kept; a zero by G92 that a reset has taken away is put back, and shown.
    let mut ask = |question: &Question| match question {
        Question::AtReference { .. } => zero_by_g92,
        other => panic!("{other:?}"),
    };
    let report = resume(
        &mut Line::good(&link),
        &job,
        &cuts,
        &options,
        &heights,
        &mut journal,
        &mut ask,
    )
    .unwrap();
    assert_eq!(report.cuts, SLITS);
    let (lengths, _) = burnt(link.lock().unwrap().controller());
    for (k, length) in lengths.iter().enumerate() {
        let twice = length - LENGTH_MM;
        assert!(twice > -0.02 && (k == 2 || twice < 0.02), "{lengths:?}");
    }
    heights.seen.into_inner().unwrap().2 - SURFACE_MM
}

#[test]
fn after_a_stop_in_the_kerf_the_torch_is_raised_before_it_travels() {
    for flavour in [Flavour::Grbl, Flavour::GrblHal, Flavour::FluidNc] {
        for zero_by_g92 in [false, true] {
            let lowest_mm = stopped_in_the_kerf(flavour, zero_by_g92);
            assert!(lowest_mm > 9.0, "{flavour:?}: {lowest_mm}");
        }
    }
}

/// A table that homes, was only unlocked, and counts its torch close under the upper end: it cannot be raised as it should.
#[test]
fn a_torch_that_cannot_be_raised_travels_only_if_the_person_sees_it_clear() {
    let job = job();
    let cuts = Cuts::of(&job).unwrap();
    let header = Header::of(&job, &cuts, "job.nc", "table", 3);
    for clear in [false, true] {
        let store = MemoryStore::default();
        let mut machine = Controller::new(Settings {
            homing: true,
            ..settings(Flavour::Grbl)
        });
        machine.write(b"$X\nG92Z3\n");
        machine.advance(1.0);
        let link = Mutex::new(SimTransport::new(machine));
        let options = SendOptions {
            poll: Duration::from_millis(10),
            ..SendOptions::default()
        };
        let mut journal = Journal::new(header.clone(), store.clone());
        send_recorded(
            &mut Line::good(&link),
            &job,
            &cuts,
            &options,
            &StopInCut(&link),
            &mut journal,
        )
        .unwrap_err();
        let stood = link.lock().unwrap().controller().head_mm();
        let bytes = store.bytes();
        let mut journal = Journal::continued(header.clone(), &bytes, store).unwrap();
        let mut asked = Vec::new();
        let result = resume(
            &mut Line::good(&link),
            &job,
            &cuts,
            &options,
            &Silent,
            &mut journal,
            &mut |question| {
                asked.push(*question);
                match question {
                    Question::TorchClear { .. } => clear,
                    _ => true,
                }
            },
        );
        let head = link.lock().unwrap().controller().head_mm();
        if clear {
            assert_eq!(result.unwrap().cuts, SLITS);
        } else {
            let error = result.unwrap_err().to_string();
            assert!(error.contains("raise it by hand"), "{error}");
            // But for the step to which it is rounded.
            assert!((head[0] - stood[0]).hypot(head[1] - stood[1]) < 0.02);
        }
        let short =
            |q: &Question| matches!(q, Question::TorchClear { raised_mm } if *raised_mm < 9.0);
        assert!(asked.iter().any(short), "{asked:?}, {stood:?}");
    }
}

#[test]
fn a_pulled_cable_is_told_as_what_it_is() {
    let faults = Faults::one(At::Sent(300), Mishap::Unplug);
    let machine = Controller::new(settings(Flavour::Grbl));
    let mut link = SimTransport::with_faults(machine, faults);
    let error = send(&mut link, &job(), &SendOptions::default(), &Silent).unwrap_err();
    assert!(
        error.to_string().contains("THE BEAM MAY STAY ON"),
        "{error}"
    );
}
