//! The sender against the simulated machine: in process on a virtual clock, with every kind of bad line, and over a
//! real pseudo-terminal.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail by panicking")]

mod stop_after;

use std::sync::atomic::Ordering;
use std::time::Duration;

use kagome::base::progress::{Progress, Silent};
use kagome::control::script::{Exchange, Script};
use kagome::control::{
    Change, Glance, Job, JobRules, Operator, Proof, SendError, SendOptions, SendReport, StopReason,
    Wish, send,
};
use kagome::sim::{
    At, Burn, Controller, Faults, Mishap, Settings, SimTransport, State, rehearse, strokes,
};
use proptest::prelude::*;
use stop_after::StopAfter;

/// Slits as a job, with M4.
fn job_of(cuts: &[[[f64; 2]; 2]]) -> String {
    let mut text = String::from("G21G90\nM4S500\nG1F3000\n");
    for [a, b] in cuts {
        text.push_str(&format!("G0X{:.3}Y{:.3}\n", a[0], a[1]));
        text.push_str(&format!("G1X{:.3}Y{:.3}\n", b[0], b[1]));
    }
    text.push_str("M5\nG0X0Y0\nM2\n");
    text
}

fn slits(n: usize) -> Vec<[[f64; 2]; 2]> {
    (0..n)
        .map(|k| {
            let (x, y) = ((k % 20) as f64 * 9.0 + 5.0, (k / 20) as f64 * 8.0 + 5.0);
            let angle = (k % 3) as f64 * std::f64::consts::FRAC_PI_3;
            [[x, y], [x + 7.0 * angle.cos(), y + 7.0 * angle.sin()]]
        })
        .collect()
}

fn checked(text: &str) -> Job {
    Job::check(text.as_bytes(), &JobRules::default()).unwrap()
}

fn run(link: &mut SimTransport, text: &str) -> Result<SendReport, SendError> {
    let options = SendOptions {
        longest_pause: Some(Duration::from_secs(60)),
        ..SendOptions::default()
    };
    send(link, &checked(text), &options, &Silent)
}

fn machine() -> Controller {
    Controller::new(Settings::default())
}

fn distance(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let t = ((p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]);
    let t = t.clamp(0.0, 1.0);
    (a[0] + t * d[0] - p[0]).hypot(a[1] + t * d[1] - p[1])
}

/// Every burn lies on one of the cuts, none on a rapid, none while standing.
fn only_on(cuts: &[[[f64; 2]; 2]], burns: &[Burn]) {
    for burn in burns {
        assert!(!burn.standing() && !burn.rapid, "{burn:?}");
        let on = |cut: &[[f64; 2]; 2]| {
            distance(burn.from_mm, *cut) < 0.02 && distance(burn.to_mm, *cut) < 0.02
        };
        assert!(cuts.iter().any(on), "{burn:?} is on no cut");
    }
}

/// The cuts, in order, to a step of the motors.
fn equal(cuts: &[[[f64; 2]; 2]], burns: &[Burn]) {
    let strokes = strokes(burns, 0.0125);
    assert_eq!(strokes.len(), cuts.len());
    for (stroke, cut) in strokes.iter().zip(cuts) {
        assert_eq!(stroke.len(), 2);
        for (p, q) in stroke.iter().zip(cut) {
            assert!(
                (p[0] - q[0]).hypot(p[1] - q[1]) < 0.01,
                "{stroke:?} {cut:?}"
            );
        }
    }
}

/// The machine goes on by itself until nothing is left, as one whose cable was pulled.
fn drain(link: SimTransport) -> Controller {
    let mut machine = link.into_controller();
    machine.run_out(1e6);
    assert!(
        !machine.beam_on(),
        "the beam is on after the buffered lines"
    );
    machine
}

#[test]
fn after_a_job_the_burnt_sheet_equals_the_intended_one() {
    let cuts = slits(200);
    let rehearsal = rehearse(
        job_of(&cuts).as_bytes(),
        &Settings::default(),
        &JobRules::default(),
        &Silent,
    )
    .unwrap();
    equal(&cuts, &rehearsal.burns);
    only_on(&cuts, &rehearsal.burns);
    let s = rehearsal.summary;
    assert_eq!(
        (s.lost_bytes, s.standing_burn_s, s.beam_on_at_end),
        (0, 0.0, false)
    );
    assert_eq!(rehearsal.report.acknowledged, 406);
    assert!(rehearsal.report.max_in_flight <= 128 && rehearsal.report.max_in_flight > 100);
}

#[test]
fn an_unplugged_job_ends_dark_and_within_its_path_wherever_the_cable_is_cut() {
    let cuts = slits(12);
    let text = job_of(&cuts);
    let mut whole = SimTransport::new(machine());
    run(&mut whole, &text).unwrap();
    let (sent, received) = whole.traffic();
    let mut lost_midway = 0;
    for sending in [true, false] {
        let total = if sending { sent } else { received };
        for at in (0..total).step_by(7) {
            let at_byte = if sending {
                At::Sent(at)
            } else {
                At::Received(at)
            };
            let faults = Faults::one(at_byte, Mishap::Unplug);
            let mut link = SimTransport::with_faults(machine(), faults);
            let error = match run(&mut link, &text) {
                Err(error) => error,
                // The answer to a question that nobody needed any more.
                Ok(_) => {
                    assert!(!sending && at + 80 > total, "cut at {at} of {total}");
                    equal(&cuts, &drain(link).burns());
                    continue;
                }
            };
            match error {
                SendError::Connect { .. } => {}
                SendError::LinkLost { confirmed, .. } => {
                    lost_midway += 1;
                    assert_eq!(
                        confirmed.proof,
                        Proof::LinkLost {
                            constant_power: false
                        }
                    );
                    assert!(confirmed.acknowledged <= confirmed.sent);
                }
                other => panic!("cut at {at}: {other}"),
            }
            only_on(&cuts, &drain(link).burns());
        }
    }
    assert!(lost_midway > 100, "{lost_midway}");
}

/// Wishes at given reports of the machine, and what was seen.
struct Hands {
    at: Vec<(usize, Wish)>,
    seen: std::sync::Mutex<(usize, usize, Vec<bool>)>,
}

impl Progress for Hands {}

impl Operator for Hands {
    fn wish(&self) -> Option<Wish> {
        let mut seen = self.seen.lock().unwrap();
        let (_, wish) = self.at.get(seen.1).filter(|(at, _)| *at <= seen.0)?;
        seen.1 += 1;
        Some(*wish)
    }

    fn glance(&self, glance: &Glance<'_>) {
        let mut seen = self.seen.lock().unwrap();
        seen.0 += 1;
        seen.2.push(glance.paused());
        assert!(glance.cuts <= glance.of_cuts && glance.done_lines <= glance.lines);
    }
}

#[test]
fn pauses_and_overrides_change_the_time_and_nothing_else() {
    let cuts = slits(60);
    let text = job_of(&cuts);
    let whole = rehearse(
        text.as_bytes(),
        &Settings::default(),
        &JobRules::default(),
        &Silent,
    );
    let plain_mm = whole.unwrap().summary.burnt_mm;
    let run = |at: &[(usize, Wish)]| {
        let hands = Hands {
            at: at.to_vec(),
            seen: std::sync::Mutex::default(),
        };
        let mut link = SimTransport::new(machine());
        let report = send(&mut link, &checked(&text), &SendOptions::default(), &hands).unwrap();
        assert_eq!(report.cuts, cuts.len());
        let controller = drain(link);
        // A cut that was held in its middle is two strokes, end to end.
        let length = |sum: f64, b: &kagome::sim::Burn| sum + b.length_mm();
        let burnt = controller.burns().iter().fold(0.0, length);
        assert!((burnt - plain_mm).abs() < 0.05, "{burnt} {plain_mm}");
        only_on(&cuts, &controller.burns());
        assert!(!controller.beam_on());
        let paused = hands.seen.into_inner().unwrap().2;
        (report.time_s, paused.iter().filter(|p| **p).count())
    };
    let (plain, never) = run(&[]);
    assert_eq!(never, 0);
    let (held, reports) = run(&[(10, Wish::Pause), (40, Wish::Resume)]);
    assert!(
        reports > 20 && held > plain + 2.0,
        "{held} {plain} {reports}"
    );
    let twice = [
        (10, Wish::Feed(Change::Less)),
        (11, Wish::Feed(Change::Less)),
    ];
    let (slow, _) = run(&twice);
    // 80 % on cuts of 7 mm: 0.255 s each instead of 0.240; rapids are as fast as before.
    assert!(slow > 1.02 * plain, "{slow} {plain}");
    let (back, _) = run(&[twice[0], twice[1], (12, Wish::Feed(Change::Reset))]);
    assert!(back < slow, "{back} {slow}");
}

#[test]
fn ctrl_c_stops_the_machine_with_proof_and_keeps_its_position() {
    let cuts = slits(40);
    let text = job_of(&cuts);
    for after in [1, 3, 4, 17, 40, 80] {
        let mut link = SimTransport::new(machine());
        let result = send(
            &mut link,
            &checked(&text),
            &SendOptions::default(),
            &StopAfter::new(after),
        );
        let Err(SendError::Stopped { reason, confirmed }) = result else {
            panic!("{result:?}");
        };
        assert_eq!(reason, StopReason::Interrupted);
        assert_eq!(
            confirmed.proof,
            Proof::BeamOff {
                position_kept: true
            }
        );
        assert!(confirmed.acknowledged >= after && confirmed.acknowledged < text.lines().count());
        assert_eq!(link.controller().state(), State::Idle);
        let burnt = link.controller().burns();
        let machine = drain(link);
        assert_eq!(machine.burns(), burnt, "nothing burns after the stop");
        only_on(&cuts, &burnt);
    }
}

#[test]
fn an_error_and_an_alarm_stop_the_job_with_proof() {
    let text = "G21G90\nM4S500\nG1F3000\nG1X50\nG2X10F500\nG1X20\nM5\n";
    let mut link = SimTransport::new(machine());
    let Err(SendError::Stopped { reason, confirmed }) = run(&mut link, text) else {
        panic!("an arc without a centre");
    };
    let StopReason::Refused {
        error: 35,
        line: 5,
        text,
    } = &reason
    else {
        panic!("{reason:?}");
    };
    assert_eq!(text, "G2X10F500");
    assert!(matches!(confirmed.proof, Proof::BeamOff { .. }));
    drain(link);

    let mut homed = Controller::new(Settings {
        homing: true,
        soft_limits: true,
        homing_seek_mm_min: 60_000.0,
        ..Settings::default()
    });
    homed.write(b"$H\n");
    homed.advance(10.0);
    let mut link = SimTransport::new(homed);
    let text = "G21G90\nM4S500\nG1F3000\nG1X-50\nG1X50\nG1X-20\nM5\n";
    let Err(SendError::Stopped { reason, confirmed }) = run(&mut link, text) else {
        panic!("beyond the travel");
    };
    assert_eq!(reason, StopReason::Alarm(2));
    assert_eq!(
        confirmed.proof,
        Proof::BeamOff {
            position_kept: false
        }
    );
    drain(link);
}

#[test]
fn a_machine_that_is_not_ready_gets_nothing() {
    let text = job_of(&slits(2));
    let refused = |settings: Settings, options: SendOptions, words: &str| {
        let mut link = SimTransport::new(Controller::new(settings));
        let error = send(&mut link, &checked(&text), &options, &Silent).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
        assert!(matches!(error, SendError::NotReady { .. }));
        assert!(drain(link).burns().is_empty());
    };
    let plain = SendOptions::default();
    let with = |f: fn(&mut Settings)| {
        let mut s = Settings::default();
        f(&mut s);
        s
    };
    refused(with(|s| s.laser_mode = false), plain.clone(), "$32=1");
    refused(with(|s| s.s_max = 255.0), plain.clone(), "S500");
    refused(with(|s| s.homing = true), plain.clone(), "$H");
    let other = SendOptions {
        s_max: Some(255.0),
        ..plain
    };
    refused(Settings::default(), other, "0.26 times");
}

#[test]
fn a_lost_newline_or_answer_is_noticed() {
    let text = job_of(&slits(6));
    let mut whole = SimTransport::new(machine());
    run(&mut whole, &text).unwrap();
    // Every single byte from the machine, flipped or lost: the job either ends as it should or is stopped dark.
    let (_, received) = whole.traffic();
    let (mut good, mut stopped) = (0, 0);
    for at in (0..received).step_by(3) {
        for flip in [0x00, 0x01, 0x40] {
            let faults = if flip == 0 {
                Faults {
                    drop_received: vec![at],
                    ..Faults::default()
                }
            } else {
                Faults {
                    corrupt_received: vec![(at, flip)],
                    ..Faults::default()
                }
            };
            let mut link = SimTransport::with_faults(machine(), faults);
            match run(&mut link, &text) {
                Ok(report) => {
                    good += 1;
                    assert_eq!(report.acknowledged, report.lines);
                }
                Err(SendError::LinkLost { .. }) => panic!("nobody pulled the cable"),
                Err(_) => stopped += 1,
            }
            drain(link);
        }
    }
    assert!(good > 0 && stopped > 20, "{good} {stopped}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn late_and_broken_up_answers_change_nothing_but_time(seed: u64, late in 0.0f64..0.4, n in 1usize..25) {
        let cuts = slits(n);
        let faults = Faults { late_s: late, seed, ..Faults::default() };
        let mut link = SimTransport::with_faults(machine(), faults);
        let report = run(&mut link, &job_of(&cuts)).unwrap();
        prop_assert!(report.max_in_flight <= 128);
        let machine = drain(link);
        prop_assert_eq!(machine.lost_bytes(), 0);
        equal(&cuts, &machine.burns());
    }

    #[test]
    fn damage_on_the_way_to_the_machine_never_leaves_the_beam_on(at in 90u64..600, flip in 1u8..=255) {
        let text = job_of(&slits(15));
        let faults = Faults { corrupt_sent: vec![(at, flip)], ..Faults::default() };
        let mut link = SimTransport::with_faults(machine(), faults);
        let _ = run(&mut link, &text);
        drain(link);
    }

    #[test]
    fn any_bytes_are_answered_without_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let mut machine = machine();
        machine.write(&bytes);
        machine.advance(100.0);
        machine.write(b"\x18$X\n$C\n");
        machine.write(&bytes);
        machine.advance(200.0);
        let _ = Job::check(&bytes, &JobRules::default());
    }
}

#[test]
fn a_pause_that_nobody_ends_is_stopped_in_a_rehearsal() {
    let mut link = SimTransport::new(machine());
    let error = run(&mut link, "M4S9\nG1X9F600\nM0\nG1X20\nM5\n").unwrap_err();
    let SendError::Stopped { reason, confirmed } = error else {
        panic!("{error}");
    };
    assert!(matches!(reason, StopReason::Paused { seconds } if seconds > 60.0));
    assert_eq!(
        confirmed.proof,
        Proof::BeamOff {
            position_kept: true
        }
    );
    only_on(&[[[0.0, 0.0], [9.0, 0.0]]], &drain(link).burns());
}

#[test]
fn a_panic_while_sending_puts_the_beam_out() {
    struct Panics(StopAfter);
    impl Progress for Panics {
        fn advance(&self, n: u64) {
            self.0.advance(n);
            assert!(!self.0.interrupted(), "a bug, half way");
        }
    }

    impl kagome::control::Operator for Panics {}
    let mut link = SimTransport::new(machine());
    let text = job_of(&slits(30));
    let job = checked(&text);
    let progress = Panics(StopAfter::new(25));
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        send(&mut link, &job, &SendOptions::default(), &progress)
    }));
    assert!(result.is_err());
    let mut machine = link.into_controller();
    let now = machine.now_s();
    machine.advance(now + 0.001);
    assert!(!machine.beam_on());
    // Held before it was reset: it still knows where it is.
    assert_eq!(machine.state(), State::Idle);
}

#[test]
fn the_protocol_follows_its_script() {
    let expect = |bytes: &str, answer: &str| {
        Exchange::Expect(bytes.as_bytes().to_vec(), answer.as_bytes().to_vec())
    };
    let start = [
        expect("$I\n", "[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\nok\r\n"),
        expect("$$\n", "$30=1000\r\n$32=1\r\nok\r\n"),
        expect(
            "$G\n",
            "[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]\r\nok\r\n",
        ),
        expect("$N\n", "$N0=\r\n$N1=\r\nok\r\n"),
    ];
    let job = checked("G21\nM4S1\nM5\n");
    let greeting = "\r\nGrbl 1.1h ['$' for help]\r\n";

    let mut good = start.to_vec();
    good.push(expect("G21\nM4S1\nM5\n", "ok\r\nok\r\nok\r\n"));
    let mut script = Script::new(greeting, good);
    assert!(send(&mut script, &job, &SendOptions::default(), &Silent).is_ok());
    assert_eq!(script.left(), 0);

    // One answer too many: the stop is a hold, then a reset.
    let mut extra = start.to_vec();
    extra.push(expect("G21\nM4S1\nM5\n", "ok\r\nok\r\nok\r\nok\r\n"));
    extra.push(expect("!", ""));
    extra.push(expect("\u{18}", greeting));
    let mut script = Script::new(greeting, extra);
    let error = send(&mut script, &job, &SendOptions::default(), &Silent).unwrap_err();
    assert!(
        error.to_string().contains("a line that was not sent"),
        "{error}"
    );
    assert_eq!(script.left(), 0);

    // A machine that stays silent after the hold: it is not known to be dark, and that is said.
    let mut mute = start.to_vec();
    mute.push(expect("G21\nM4S1\nM5\n", "error:20\r\n"));
    mute.push(expect("!\u{18}\u{18}\u{18}", ""));
    let mut script = Script::new(greeting, mute);
    let error = send(&mut script, &job, &SendOptions::default(), &Silent).unwrap_err();
    assert!(
        error.to_string().contains("COULD NOT BE CONFIRMED"),
        "{error}"
    );

    // Another firmware, and nobody at all.
    for (says, words) in [
        ("start\r\necho: Marlin 2.1\r\n", "Marlin"),
        ("", "nothing was heard"),
    ] {
        let mut script = Script::new(says, [expect("\u{18}", "")]);
        let error = send(&mut script, &job, &SendOptions::default(), &Silent).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    }

    let mut broken = start.to_vec();
    broken.push(expect("G21\nM4S1\nM5\n", "ok\r\n"));
    broken.push(Exchange::Break);
    let mut script = Script::new(greeting, broken);
    let error = send(&mut script, &job, &SendOptions::default(), &Silent).unwrap_err();
    assert!(matches!(error, SendError::LinkLost { .. }), "{error}");
}

#[cfg(unix)]
mod pty {
    use super::*;
    use kagome::control::{PortError, SerialTransport};
    use kagome::sim::pty::{PtyServer, Serve};

    /// Serves a machine in another thread until `stop` says so; gives the machine back.
    fn serve(
        speed: Option<f64>,
        stop: impl Fn(&Controller) -> bool + Send + 'static,
    ) -> (String, std::thread::JoinHandle<Controller>) {
        let mut server = PtyServer::open().unwrap();
        let path = server.path().to_owned();
        let how = Serve {
            speed,
            once: true,
            ..Serve::default()
        };
        let thread = std::thread::spawn(move || {
            let mut controller = machine();
            server.run(&mut controller, how, |c| stop(c));
            controller
        });
        (path, thread)
    }

    #[test]
    fn a_job_over_a_real_pseudo_terminal_burns_what_it_says() {
        let cuts = slits(30);
        let (path, thread) = serve(None, |_| false);
        let mut port = SerialTransport::open(&path, 115_200).unwrap();
        let report = send(
            &mut port,
            &checked(&job_of(&cuts)),
            &SendOptions::default(),
            &Silent,
        )
        .unwrap();
        drop(port);
        let machine = thread.join().unwrap();
        assert_eq!(report.acknowledged, report.lines);
        assert_eq!(machine.lost_bytes(), 0);
        equal(&cuts, &machine.burns());
    }

    #[test]
    fn the_far_side_closing_is_a_lost_link_and_the_beam_ends_dark() {
        let cuts = slits(200);
        let (path, thread) = serve(Some(20.0), |c| c.now_s() > 20.0);
        let mut port = SerialTransport::open(&path, 115_200).unwrap();
        let error = send(
            &mut port,
            &checked(&job_of(&cuts)),
            &SendOptions::default(),
            &Silent,
        )
        .unwrap_err();
        assert!(matches!(error, SendError::LinkLost { .. }), "{error}");
        let confirmed = error.confirmed().unwrap();
        assert!(confirmed.acknowledged > 0 && confirmed.acknowledged < confirmed.lines);
        let mut machine = thread.join().unwrap();
        let now = machine.now_s();
        machine.advance(now + 60.0);
        assert!(!machine.beam_on());
        only_on(&cuts, &machine.burns());
    }

    #[test]
    fn the_near_side_closing_leaves_a_dark_machine() {
        let cuts = slits(100);
        let (path, thread) = serve(None, |_| false);
        let mut port = SerialTransport::open(&path, 115_200).unwrap();
        let result = send(
            &mut port,
            &checked(&job_of(&cuts)),
            &SendOptions {
                poll: Duration::from_millis(20),
                ..SendOptions::default()
            },
            &StopAfter::new(60),
        );
        let Err(SendError::Stopped { confirmed, .. }) = result else {
            panic!("{result:?}");
        };
        assert_eq!(
            confirmed.proof,
            Proof::BeamOff {
                position_kept: true
            }
        );
        drop(port);
        let machine = thread.join().unwrap();
        assert!(!machine.beam_on());
        only_on(&cuts, &machine.burns());
    }

    /// The program itself: an impatient person presses Ctrl-C twice, the terminal is closed, the system shuts down.
    #[test]
    fn signals_never_end_the_program_before_the_machine_is_known_to_be_dark() {
        use std::process::{Command, Stdio};
        use std::sync::Arc;
        use std::sync::atomic::AtomicBool;

        let cuts = slits(100);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("job.nc");
        std::fs::write(&file, job_of(&cuts)).unwrap();
        for signals in [["-INT", "-INT"], ["-TERM", "-HUP"]] {
            let burning = Arc::new(AtomicBool::new(false));
            let flag = burning.clone();
            let (path, thread) = serve(Some(1.0), move |c| {
                flag.fetch_or(c.beam_on(), Ordering::SeqCst);
                false
            });
            let child = Command::new(env!("CARGO_BIN_EXE_kagome"))
                .env("KAGOME_PROFILES", "")
                .args(["send", "--port", &path])
                .arg(&file)
                .stderr(Stdio::piped())
                .spawn()
                .unwrap();
            while !burning.load(Ordering::SeqCst) {
                std::thread::sleep(Duration::from_millis(5));
            }
            for signal in signals {
                let id = child.id().to_string();
                assert!(
                    Command::new("kill")
                        .args([signal, &id])
                        .status()
                        .unwrap()
                        .success()
                );
                std::thread::sleep(Duration::from_millis(30));
            }
            let output = child.wait_with_output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(1), "{said}");
            assert!(
                said.contains("the beam is off and its position is kept"),
                "{said}"
            );
            let machine = thread.join().unwrap();
            assert!(!machine.beam_on());
            only_on(&cuts, &machine.burns());
        }
    }

    #[test]
    fn a_port_that_is_not_there_is_said_to_be_missing() {
        let Err(error) = SerialTransport::open("/dev/ttyKAGOME7", 115_200) else {
            panic!("it is there");
        };
        assert!(matches!(error, PortError::Missing { .. }), "{error:?}");
        let text = error.to_string();
        assert!(
            text.contains("/dev/ttyKAGOME7") && text.contains("sim"),
            "{text}"
        );
    }
}

/// A link that gives one error and then works again must not keep the machine from being stopped.
#[test]
fn a_hurt_link_still_stops_the_machine() {
    struct Hurt<'a> {
        link: &'a mut SimTransport,
        writes: usize,
        fail_at: usize,
    }
    impl kagome::control::Transport for Hurt<'_> {
        fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
            self.writes += 1;
            if self.writes == self.fail_at {
                return Err(std::io::ErrorKind::TimedOut.into());
            }
            self.link.send(bytes)
        }
        fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> std::io::Result<usize> {
            self.link.receive(buffer, wait)
        }
        fn now(&self) -> Duration {
            self.link.now()
        }
        fn name(&self) -> &str {
            "a hurt link"
        }
    }
    let text = job_of(&slits(40));
    let job = checked(&text);
    for fail_at in [12, 15, 20, 30] {
        let mut link = SimTransport::new(machine());
        let mut hurt = Hurt {
            link: &mut link,
            writes: 0,
            fail_at,
        };
        let error = send(&mut hurt, &job, &SendOptions::default(), &Silent).unwrap_err();
        let Some(confirmed) = error.confirmed() else {
            panic!("{error}")
        };
        assert!(matches!(confirmed.proof, Proof::BeamOff { .. }), "{error}");
        // It stands already: nothing more is burnt however long one waits.
        let mut machine = link.into_controller();
        let burnt = machine.burns().len();
        let now = machine.now_s();
        machine.advance(now + 60.0);
        assert!(!machine.beam_on());
        assert_eq!(machine.burns().len(), burnt);
    }
}

/// A far side that talks without end (noise, a boot loop) must not hold the sender for ever.
#[test]
fn endless_talk_is_not_waited_out() {
    struct Babble {
        now: Duration,
        text: &'static [u8],
        greeting: bool,
    }
    impl kagome::control::Transport for Babble {
        fn send(&mut self, _: &[u8]) -> std::io::Result<()> {
            Ok(())
        }
        fn receive(&mut self, buffer: &mut [u8], _: Duration) -> std::io::Result<usize> {
            self.now += Duration::from_millis(10);
            let said = if self.greeting {
                self.text
            } else {
                b"\r\nGrbl 1.1h ['$' for help]\r\n"
            };
            self.greeting = true;
            let count = said.len().min(buffer.len());
            buffer[..count].copy_from_slice(&said[..count]);
            Ok(count)
        }
        fn now(&self) -> Duration {
            self.now
        }
        fn name(&self) -> &str {
            "a babbling line"
        }
    }
    let job = checked("G21\nM4S1\nM5\n");
    for text in [
        &b"xxxxxxxx"[..],
        b"\r\n\r\n",
        b"[MSG:'$H'|'$X' to unlock]\r\n",
        b"ok\r\n",
    ] {
        let mut line = Babble {
            now: Duration::ZERO,
            text,
            greeting: false,
        };
        let error = send(&mut line, &job, &SendOptions::default(), &Silent).unwrap_err();
        assert!(line.now < Duration::from_secs(120), "{error}");
    }
}
