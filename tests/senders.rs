//! Senders of other people run a job of ours on the simulated machine, over its pseudo-terminal: the sheet must be the
//! one that our own sender burns. Needs `pygrbl-streamer` and `grbl-streamer` from PyPI, in the Python that
//! `KAGOME_SENDERS_PYTHON` names.

#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "helpers of tests fail by panicking")]

use std::path::PathBuf;
use std::process::Command;

use kagome::base::progress::Silent;
use kagome::control::JobRules;
use kagome::sim::pty::{PtyServer, Serve};
use kagome::sim::{Controller, RehearsalSummary, Settings, Stroke, rehearse, strokes};

/// A step of the motors at 80 steps/mm.
const STEP_MM: f64 = 0.0125;

fn path(parts: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(parts)
}

/// Runs a script with the machine's port and the job, ten times as fast as the clock.
fn burns_the_same_sheet(script: &str) {
    let job = path("tests/golden/ring_with_flaps/job.nc");
    let settings = Settings::default();
    let text = std::fs::read(&job).unwrap();
    let ours = rehearse(&text, &settings, &JobRules::default(), &Silent).unwrap();
    assert!(ours.strokes.len() > 10, "{}", ours.strokes.len());

    let mut server = PtyServer::open().unwrap();
    let port = server.path().to_owned();
    let machine = std::thread::spawn(move || {
        let mut controller = Controller::new(settings);
        let how = Serve {
            speed: Some(10.0),
            once: true,
            ..Serve::default()
        };
        server.run(&mut controller, how, |c| c.now_s() > 10_000.0);
        controller
    });
    let python = std::env::var("KAGOME_SENDERS_PYTHON").unwrap_or_else(|_| "python3".into());
    let output = Command::new(python)
        .arg(path("tests/senders").join(script))
        .args([port.as_str(), job.to_str().unwrap()])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{script}: {said}");

    let machine = machine.join().unwrap();
    let summary = RehearsalSummary::of(&machine);
    assert_eq!((summary.lost_bytes, summary.beam_on_at_end), (0, false));
    assert_eq!((summary.standing_burn_s, summary.rapid_burn_mm), (0.0, 0.0));
    let theirs = strokes(&machine.burns(), STEP_MM);
    for (a, b) in [(&theirs, &ours.strokes), (&ours.strokes, &theirs)] {
        let off = farthest(a, b);
        assert!(off <= STEP_MM, "{script}: {off} mm apart");
    }
    let (a, b) = (summary.burnt_mm, ours.summary.burnt_mm);
    assert!((a - b).abs() < 1e-3 * b, "{script}: {a} mm burnt, not {b}");
}

/// The farthest that any place on some strokes is from other strokes, mm.
fn farthest(strokes: &[Stroke], others: &[Stroke]) -> f64 {
    let distance = |p: [f64; 2], a: [f64; 2], b: [f64; 2]| {
        let d = [b[0] - a[0], b[1] - a[1]];
        let along = (p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1];
        let t = (along / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
        (a[0] + t * d[0] - p[0]).hypot(a[1] + t * d[1] - p[1])
    };
    let mut farthest = 0.0f64;
    for pair in strokes.iter().flat_map(|s| s.windows(2)) {
        let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        let pieces = (length / 0.1).ceil().max(1.0) as usize;
        for k in 0..=pieces {
            let t = k as f64 / pieces as f64;
            let p: [f64; 2] = std::array::from_fn(|i| pair[0][i] + t * (pair[1][i] - pair[0][i]));
            let near = others
                .iter()
                .flat_map(|s| s.windows(2))
                .map(|other| distance(p, other[0], other[1]))
                .fold(f64::INFINITY, f64::min);
            farthest = farthest.max(near);
        }
    }
    farthest
}

#[test]
#[ignore = "needs pygrbl-streamer from PyPI"]
fn pygrbl_streamer_burns_the_sheet_that_we_burn() {
    burns_the_same_sheet("pygrbl_streamer_job.py");
}

#[test]
#[ignore = "needs grbl-streamer from PyPI"]
fn grbl_streamer_burns_the_sheet_that_we_burn() {
    burns_the_same_sheet("grbl_streamer_job.py");
}
