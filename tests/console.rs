//! At the machine without a job, on the simulated one: nothing here ever lights the beam but a frame that was asked to.

#![allow(clippy::unwrap_used, reason = "a helper that fails, fails its test")]

use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

use kagome::base::progress::{Progress, Silent};
use kagome::control::{
    Console, ConsoleError, ControllerSettings, Job, JobReach, JobRules, JogTo, MachineState, Move,
    SendOptions, Survey, Transport as _, send, work_mm,
};
use kagome::gcode::Dialect;
use kagome::machine::Origin;
use kagome::sim::{Controller, Flavour, Settings, SimTransport};

/// Interrupts when it has been asked so often.
struct After(AtomicU32);

impl Progress for After {
    fn interrupted(&self) -> bool {
        let left = self.0.load(Ordering::Relaxed);
        if left > 0 {
            self.0.store(left - 1, Ordering::Relaxed);
        }
        left == 0
    }
}

fn by(x: f64, y: f64) -> Move {
    Move {
        to: JogTo::By,
        axes_mm: [Some(x), Some(y), None],
        feed_mm_per_min: 1200.0,
    }
}

fn machine(settings: Settings) -> SimTransport {
    SimTransport::new(Controller::new(settings))
}

fn dark(line: &SimTransport) {
    assert!(line.controller().burns().is_empty());
    assert_eq!(line.controller().beam_time().on_s, 0.0);
}

#[test]
fn the_head_is_moved_and_told_where_it_is() {
    let mut line = machine(Settings::default());
    let mut console = Console::open(&mut line, &Silent).unwrap();
    assert_eq!(console.first.state, MachineState::Idle);
    let status = console.jog(&by(30.0, 20.0)).unwrap();
    assert_eq!(work_mm(&status), Some([30.0, 20.0, 0.0]));
    let status = console.set_zero([Some(5.0), Some(0.0), None]).unwrap();
    assert_eq!(work_mm(&status), Some([5.0, 0.0, 0.0]));
    let told = console.told().unwrap();
    assert_eq!(told.offsets.get("G54"), Some(&[25.0, 20.0, 0.0][..]));
    let to = |to: JogTo, x: f64| Move {
        to,
        axes_mm: [Some(x), None, None],
        feed_mm_per_min: 3000.0,
    };
    let status = console.jog(&to(JogTo::Work, 0.0)).unwrap();
    assert_eq!(status.position_mm, Some([25.0, 20.0, 0.0]));
    let status = console.jog(&to(JogTo::Machine, 1.0)).unwrap();
    assert_eq!(status.position_mm, Some([1.0, 20.0, 0.0]));
    assert!(console.set_zero([None; 3]).is_err());
    assert!(console.set_zero([Some(f64::NAN), None, None]).is_err());
    assert!(console.jog(&by(f64::INFINITY, 0.0)).is_err());
    dark(&line);
}

#[test]
fn a_jog_is_stopped_in_its_way_and_the_position_is_kept() {
    let mut on_the_way = 0;
    for polls in 0..80 {
        let mut line = machine(Settings::default());
        // Whenever the wish comes: before the move, in it, or too late.
        let stop = After(AtomicU32::new(polls));
        let done = match Console::open(&mut line, &stop) {
            Ok(mut console) => console.jog(&by(100.0, 0.0)).map(|_| ()),
            Err(error) => Err(error),
        };
        if let Err(error) = &done {
            assert!(matches!(error, ConsoleError::Interrupted(_)), "{error}");
        }
        let mut console = Console::open(&mut line, &Silent).unwrap();
        let status = console.status().unwrap();
        assert_eq!(status.state, MachineState::Idle);
        let x = status.position_mm.unwrap()[0];
        assert_eq!(done.is_ok(), x == 100.0);
        if x > 0.0 && x < 100.0 {
            on_the_way += 1;
        }
        dark(&line);
    }
    assert!(on_the_way > 10, "{on_the_way}");
}

#[test]
fn a_locked_machine_is_homed_or_unlocked_before_it_moves() {
    let homing = || {
        machine(Settings {
            homing: true,
            ..Settings::default()
        })
    };
    let mut line = homing();
    let mut console = Console::open(&mut line, &Silent).unwrap();
    assert_eq!(console.first.state, MachineState::Alarm);
    let error = console.jog(&by(1.0, 0.0)).unwrap_err().to_string();
    assert!(error.contains("kagome home"), "{error}");
    assert!(console.set_zero([Some(0.0), None, None]).is_err());
    assert_eq!(console.home().unwrap().state, MachineState::Idle);
    dark(&line);
    let mut line = homing();
    let mut console = Console::open(&mut line, &Silent).unwrap();
    assert_eq!(console.unlock().unwrap().state, MachineState::Idle);
    // Without switches.
    let mut line = machine(Settings::default());
    let error = Console::open(&mut line, &Silent)
        .unwrap()
        .home()
        .unwrap_err()
        .to_string();
    assert!(error.contains("$22=0"), "{error}");
}

#[test]
fn an_armed_output_is_switched_off_before_anything_moves() {
    let mut line = machine(Settings::default());
    line.send(b"M3 S500\n").unwrap();
    let mut console = Console::open(&mut line, &Silent).unwrap();
    let status = console.jog(&by(20.0, 0.0)).unwrap();
    assert!(status.dark_and_still());
    assert!(console.told().unwrap().modes.contains("M5"));
    let moved = line
        .controller()
        .burns()
        .iter()
        .any(|b| b.length_mm() > 0.0);
    assert!(!moved);
}

#[test]
fn settings_are_saved_changed_and_put_back() {
    let mut line = machine(Settings::default());
    let mut console = Console::open(&mut line, &Silent).unwrap();
    let saved = console.settings().unwrap();
    let text = saved.to_text("mine");
    let file = ControllerSettings::parse("mine.txt", &text).unwrap();
    assert_eq!(file.differences(&saved), []);
    for line in ["$110=1234", "$11=0.02", "$30=255"] {
        console.ask(line).unwrap();
    }
    let differences = console.settings().unwrap().differences(&file);
    let numbers: Vec<u32> = differences.iter().map(|d| d.number).collect();
    assert_eq!(numbers, [11, 30, 110]);
    let restored = console.restore(&differences).unwrap();
    assert_eq!(restored.written, [11, 30, 110]);
    assert!(restored.refused.is_empty() && restored.different.is_empty());
    assert_eq!(console.settings().unwrap(), saved);
}

#[test]
fn a_job_is_read_by_the_controller_without_motion() {
    let good = "G21 G90 G54\nM5\nG0 X10 Y10\nM4 S500\nG1 X60 F1200\nM5\nM2\n";
    // The sender's own check does not know how far an arc's ends may differ; the controller does.
    let bad = good.replace("G1 X60 F1200", "G1 X60 F1200\nG2 X70 Y10 I50 J3");
    for flavour in [Flavour::Grbl, Flavour::GrblHal] {
        let mut line = machine(Settings {
            flavour,
            ..Settings::default()
        });
        let job = |text: &str| Job::check(text.as_bytes(), &JobRules::default()).unwrap();
        let mut console = Console::open(&mut line, &Silent).unwrap();
        console.dry_run(&job(good)).unwrap();
        let error = console.dry_run(&job(&bad)).unwrap_err().to_string();
        assert!(error.contains("line 6 (G2"), "{error}");
        // It is itself again, and has not moved.
        let status = console.status().unwrap();
        assert_eq!(status.state, MachineState::Idle);
        assert_eq!(status.position_mm, Some([0.0; 3]));
        dark(&line);
    }
}

#[test]
fn a_job_that_would_leave_the_travel_is_not_begun() {
    let text = "G21 G90 G54\nM5\nG0 X10 Y10\nM4 S500\nG1 X60 F1200\nM5\nM2\n";
    let job = Job::check(text.as_bytes(), &JobRules::default()).unwrap();
    // FluidNC has its travel in a file of its own, and tells it too.
    for (profile, flavour) in [
        ("co2-600x400", Flavour::Grbl),
        ("diode-400-fluidnc", Flavour::FluidNc),
    ] {
        let mut profile = kagome::machine::load(profile).unwrap();
        profile.motion.rate_mm_per_min.x = 1234.0;
        let options = SendOptions {
            made_for: Some(Box::new((profile, JobReach::of(text, Dialect::Laser)))),
            buffer: Some(128),
            ..SendOptions::default()
        };
        let homed = || {
            let settings = Settings {
                homing: true,
                ..Settings::default()
            };
            let mut line = machine(settings.with_flavour(flavour));
            Console::open(&mut line, &Silent).unwrap().home().unwrap();
            line
        };
        let mut line = homed();
        let error = send(&mut line, &job, &options, &Silent)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("kagome zero") && error.contains("Nothing was sent"),
            "{error}"
        );
        dark(&line);
        // A way round the job without a beam no more than the job.
        let way = text.replace("M4 S500", "M5");
        let way = Job::check(way.as_bytes(), &JobRules::default()).unwrap();
        let error = send(&mut homed(), &way, &options, &Silent).unwrap_err();
        assert!(error.to_string().contains("kagome zero"), "{error}");
        // With the zero where the sheet lies it is.
        let mut line = homed();
        let mut console = Console::open(&mut line, &Silent).unwrap();
        let away = Move {
            to: JogTo::Machine,
            axes_mm: [Some(-400.0), Some(-400.0), None],
            feed_mm_per_min: 6000.0,
        };
        console.jog(&away).unwrap();
        console.set_zero([Some(0.0), Some(0.0), None]).unwrap();
        let told = Notes::default();
        send(&mut line, &job, &options, &told).unwrap();
        let told = told.0.into_inner().unwrap();
        assert!(told.iter().any(|t| t.contains("rate of X")), "{told:?}");
    }
}

/// Keeps what it is told.
#[derive(Default)]
struct Notes(std::sync::Mutex<Vec<String>>);

impl Progress for Notes {
    fn note(&self, text: &str) {
        self.0.lock().unwrap().push(text.to_owned());
    }
}

impl kagome::control::Operator for Notes {}

#[test]
fn silence_and_strangers_are_told_by_name() {
    use kagome::control::script::Script;
    for (greeting, part) in [
        ("", "nothing was heard"),
        ("start\r\necho:Marlin 2.1\r\n", "Marlin"),
    ] {
        let mut script = Script::new(greeting, []);
        script.status = Vec::new();
        let Err(error) = Console::open(&mut script, &Silent) else {
            panic!("somebody answered");
        };
        assert!(error.to_string().contains(part), "{error}");
        // Nothing but questions was sent.
        assert!(script.sent.iter().all(|b| *b == b'?'));
    }
}

#[test]
fn the_machine_that_is_built_in_is_set_as_its_profile_says() {
    let mut seen = 0;
    for (name, _) in kagome::machine::shipped() {
        let profile = kagome::machine::load(name).unwrap();
        if !profile.controller.is_streamed() {
            continue;
        }
        let output = Command::new(env!("CARGO_BIN_EXE_kagome"))
            .env("KAGOME_PROFILES", "")
            .args(["status", "--port", "sim", "--json", "--machine", name])
            .output()
            .unwrap();
        let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(told["differs"], serde_json::json!([]), "{name}");
        assert_eq!(told["state"], "Idle", "{name}");
        assert_eq!(told["work_mm"], serde_json::json!([0.0, 0.0, 0.0]));
        seen += 1;
    }
    assert!(seen > 4, "{seen}");
}

#[test]
fn a_homed_machine_counts_as_its_profile_does_and_keeps_to_its_travel() {
    for (name, _) in kagome::machine::shipped() {
        let mut profile = kagome::machine::load(name).unwrap();
        if !(profile.controller.is_streamed() && profile.homing.enabled) {
            continue;
        }
        for origin in [
            Origin::FrontLeft,
            Origin::FrontRight,
            Origin::RearLeft,
            Origin::RearRight,
        ] {
            profile.bed.origin = origin;
            let reach = profile.reach();
            let mut line = machine(Settings::of_machine(&profile));
            let mut console = Console::open(&mut line, &Silent).unwrap();
            assert_eq!(console.first.state, MachineState::Alarm);
            let status = console.home().unwrap();
            assert_eq!(work_mm(&status), Some([0.0; 3]));
            let mut to = |x: f64, y: f64| {
                console.jog(&Move {
                    to: JogTo::Work,
                    axes_mm: [Some(x), Some(y), None],
                    feed_mm_per_min: 6000.0,
                })
            };
            for (x, y) in [reach.min, reach.max].map(<(f64, f64)>::from) {
                let status = to(x, y).unwrap();
                assert_eq!(work_mm(&status), Some([x, y, 0.0]), "{name} {origin:?}");
            }
            for (x, y) in [(reach.min[0] - 0.1, 0.0), (0.0, reach.max[1] + 0.1)] {
                assert!(to(x, y).is_err(), "{name} {origin:?}");
            }
            dark(&line);
        }
    }
}

#[test]
fn the_travel_of_fluidnc_is_known_from_its_file() {
    let profile = kagome::machine::load("diode-400-fluidnc").unwrap();
    let mut line = machine(Settings::of_machine(&profile));
    let mut console = Console::open(&mut line, &Silent).unwrap();
    console.home().unwrap();
    let mut replies = Vec::new();
    for question in Survey::TRAVEL_OF_FILE {
        replies.extend(console.ask(question).unwrap());
    }
    let job = "G21 G90\nM4 S500\nG0 X10 Y10\nG1 X390 Y390 F1200\nM5\n";
    let reach = JobReach::of(job, Dialect::Laser).unwrap();
    let refused = |x_mm: f64| {
        let mut survey = Survey::default();
        survey.travel_of_file(&replies, &reach, [x_mm, 0.0, 0.0]);
        survey.refused.len()
    };
    assert_eq!(
        [-11.0, -10.0, 0.0, 10.0, 11.0].map(refused),
        [1, 0, 0, 0, 1]
    );
}

#[test]
fn the_verbs_say_what_they_did() {
    let folder = tempfile::tempdir().unwrap();
    let run = |line: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_kagome"))
            .env("KAGOME_PROFILES", "")
            .args(line.split(' '))
            .stdin(std::process::Stdio::null())
            .current_dir(folder.path())
            .output()
            .unwrap();
        let said = [output.stdout, output.stderr].concat();
        (
            output.status.code(),
            String::from_utf8_lossy(&said).into_owned(),
        )
    };
    let job =
        "; kagome\nG21 G90 G54\nM5\nG0 X10 Y20\nM4 S500\nG1 X60 Y20 F1200\nG1 X60 Y50\nM5\nM2\n";
    std::fs::write(folder.path().join("job.nc"), job).unwrap();
    let far = job.replace("X60", "X650");
    std::fs::write(folder.path().join("far.nc"), far).unwrap();
    std::fs::write(folder.path().join("empty.nc"), "G21\nM2\n").unwrap();
    for (code, line, words) in [
        (0, "status --port sim", "the beam is off"),
        (0, "jog --port sim --x 12.5 --y 3", "X12.500 Y3.000"),
        (1, "jog --port sim --x 12.5 --y -3", "$131"),
        (0, "zero --port sim", "zero is set"),
        (0, "frame job.nc --port sim", "X10 Y20 to X60 Y50, dark"),
        (
            0,
            "frame job.nc --port sim --machine co2-600x400 --power 2",
            "faint beam",
        ),
        (2, "frame job.nc --port sim --power 2", "--machine"),
        (
            2,
            "frame job.nc --port sim --machine co2-600x400 --power 6",
            "would mark",
        ),
        (2, "frame empty.nc --port sim", "nothing to frame"),
        (
            1,
            "frame far.nc --port sim --machine co2-600x400 --power 2",
            "from X10 to X650 in machine coordinates, and the machine has 0 to 600",
        ),
        (0, "home --port sim", "homed"),
        (1, "home --port sim --machine diode-400", "$22=0"),
        (2, "jog --port sim", "name an axis"),
        (2, "status", "--port"),
        (
            2,
            "status --port sim --machine plasma-linuxcnc",
            "nothing to speak to",
        ),
        (2, "status --port usb:0000:0000", "no board"),
        (0, "settings save a.txt --port sim", "settings in a.txt"),
        (2, "settings save a.txt --port sim", "--force"),
        (0, "settings compare a.txt --port sim", "no setting differs"),
        (
            1,
            "settings compare a.txt --port sim --machine diode-400",
            "$110: the controller has 10000, the file 30000",
        ),
        (2, "settings restore a.txt --port sim", "--yes"),
        (
            0,
            "settings restore a.txt --port sim --machine diode-400 --yes",
            "7 setting(s) written",
        ),
        (2, "settings restore job.nc --port sim --yes", "job.nc:2"),
    ] {
        let (found, said) = run(line);
        assert_eq!(found, Some(code), "{line}\n{said}");
        assert!(said.contains(words), "{line}\n{said}");
    }
}
