//! The proof by position against the simulated machine, which knows what is burnt.

#![expect(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests fail by panicking"
)]

use kagome::control::{Cuts, Follower, Job, JobRules, MachineState, Reply, Sighting};
use kagome::sim::{Controller, Settings};
use proptest::prelude::*;

fn checked(text: &str) -> Job {
    Job::check(text.as_bytes(), &JobRules::default()).unwrap()
}

/// Rounding, one step of the motors and half of another, and something.
const TOLERANCE_MM: f64 = 0.04;

/// What one report showed, and what was true then.
#[derive(Debug)]
struct Look {
    proven: usize,
    /// Cuts that may be burnt to their end.
    made: usize,
    /// Cuts that are, with something of the next.
    surely: usize,
}

/// Runs a job on the simulated machine, at most `ahead` lines unanswered, a report every `every_s`.
fn watch(
    job: &Job,
    cuts: &Cuts,
    every_s: f64,
    ahead: usize,
    damage: &dyn Fn(usize, &mut [f64; 2]),
) -> Vec<Look> {
    let mut machine = Controller::new(Settings::default());
    let mut lengths = vec![0.0];
    for cut in cuts.iter() {
        lengths.push(lengths.last().unwrap() + cut.length_mm);
    }
    let mut follower = Follower::new(cuts, Some([0.0, 0.0]), TOLERANCE_MM);
    let (mut sent, mut answered) = (0, 0);
    let mut looks = Vec::new();
    let mut partial = Vec::new();
    let mut in_flight = std::collections::VecDeque::new();
    for tick in 0.. {
        while let Some((text, _)) = job.line(sent)
            && in_flight.len() < ahead
            && in_flight.iter().sum::<usize>() + text.len() < 128
        {
            machine.write(text.as_bytes());
            machine.write(b"\n");
            in_flight.push_back(text.len() + 1);
            sent += 1;
        }
        // The answers come within a step much shorter than the reports.
        machine.write(b"?");
        let now = machine.now_s();
        machine.advance(now + every_s);
        machine.read(&mut partial);
        let text = String::from_utf8(std::mem::take(&mut partial)).unwrap();
        let mut idle = false;
        for line in text.lines() {
            match Reply::parse(line) {
                Some(Reply::Ok) => {
                    answered += 1;
                    in_flight.pop_front().unwrap();
                }
                Some(Reply::Status(status)) => {
                    let [x, y, _] = status.position_mm.unwrap();
                    let mut at = [x, y];
                    damage(tick, &mut at);
                    let seen = follower.sighted(at, sent);
                    if let (Sighting::Astray { by_mm }, true) = (seen, at == [x, y]) {
                        panic!("astray by {by_mm} at {at:?}");
                    }
                    idle = status.state == MachineState::Idle;
                }
                Some(Reply::Banner(_) | Reply::Message(_)) | None => {}
                other => panic!("{other:?}"),
            }
        }
        let burnt: f64 = machine.burns().iter().map(|b| b.length_mm()).sum();
        // Places on whole steps: each end of a cut by half of one.
        let count = |slack: f64| {
            let within = |&k: &usize| lengths[k] <= burnt + slack * k as f64;
            (0..=cuts.len()).rev().find(within).unwrap()
        };
        looks.push(Look {
            proven: follower.proven(),
            made: count(0.02),
            surely: count(-0.02),
        });
        if answered == job.len() && idle {
            break;
        }
        assert!(tick < 20_000, "the job does not end");
    }
    looks
}

fn slits(n: usize) -> String {
    let mut text = String::from("G21G90\nM4S500\nG1F3000\n");
    for k in 0..n {
        let (x, y) = ((k % 8) as f64 * 9.0 + 5.0, (k / 8) as f64 * 8.0 + 5.0);
        let angle = (k % 3) as f64 * std::f64::consts::FRAC_PI_3;
        text.push_str(&format!("G0X{x:.3}Y{y:.3}\n"));
        text.push_str(&format!(
            "G1X{:.3}Y{:.3}\n",
            x + 7.0 * angle.cos(),
            y + 7.0 * angle.sin()
        ));
    }
    text + "M5\nG0X0Y0\nM2\n"
}

#[test]
fn slits_are_proved_two_reports_after_they_are_made() {
    let job = checked(&slits(40));
    let cuts = Cuts::of(&job).unwrap();
    assert_eq!(cuts.len(), 40);
    for every_s in [0.02, 0.05, 0.1] {
        let looks = watch(&job, &cuts, every_s, 1000, &|_, _| {});
        // Two reports, and the time to come to rest at the end and leave it by more than the tolerance.
        let lag = 3 + (0.08 / every_s).ceil() as usize;
        for span in looks.windows(lag) {
            let proven = span[lag - 1].proven;
            assert!(proven <= span[lag - 1].made, "{span:?}");
            assert!(proven >= span[0].surely, "every {every_s} s: {span:?}");
        }
        assert!(looks.last().unwrap().proven >= 39);
    }
}

/// Cuts on a small grid, so that they cross, repeat and go back on themselves; some in several pieces, some as arcs.
fn tangle() -> impl Strategy<Value = String> {
    let step = (0u8..6, 0i32..5, 0i32..5);
    proptest::collection::vec(step, 4..60).prop_map(|steps| {
        let mut text = String::from("G21G90\nM4S500\nG1F2000\nG0X1Y1\n");
        let mut at = (1, 1);
        for (kind, x, y) in steps {
            let to = (x + 1, y + 1);
            let line = match kind {
                0 | 1 => format!("G0X{}Y{}\n", to.0, to.1),
                5 if to != at => format!("G2X{}Y{}R9\n", to.0, to.1),
                _ => format!("G1X{}Y{}\n", to.0, to.1),
            };
            text.push_str(&line);
            at = to;
        }
        text + "M5\nG0X0Y0\nM2\n"
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn a_proof_is_never_ahead_of_the_truth(text in tangle(), every in 1u32..20, ahead in 1usize..30) {
        let job = checked(&text);
        let cuts = Cuts::of(&job).unwrap();
        for look in watch(&job, &cuts, f64::from(every) * 0.01, ahead, &|_, _| {}) {
            prop_assert!(look.proven <= look.made, "{look:?}");
        }
    }

    #[test]
    fn one_damaged_figure_proves_nothing(text in tangle(), at in 0usize..200, place in (0i32..6, 0i32..6)) {
        let job = checked(&text);
        let cuts = Cuts::of(&job).unwrap();
        let damage = |tick: usize, mm: &mut [f64; 2]| {
            if tick % 200 == at || tick % 7 == at % 7 {
                *mm = [f64::from(place.0), f64::from(place.1)];
            }
        };
        for look in watch(&job, &cuts, 0.03, 30, &damage) {
            prop_assert!(look.proven <= look.made, "{look:?}");
        }
    }
}

#[test]
fn cuts_are_stretches_of_beam_and_small_engraving_is_taken_together() {
    let text = "G21G90\nM8\nM4S0\n\
        G0X1Y1\nG1X1.4F6000S80\nG0X1.8\nG1X2.4\nX2.8Y2\n\
        G0X20\nG1X20.5\nG0X21\nG1X21.4\n\
        G0X30Y0\nG4P0.1\nG1X34F1000S300\nX38\nG2X40Y2R2\nG0X30Y1\nG1X33\nG0Y2\nG1X36\n\
        M5\nG0X0Y0\nM2\n";
    let job = checked(text);
    let cuts = Cuts::of(&job).unwrap();
    let list: Vec<_> = cuts
        .iter()
        .map(|c| (c.first_line, c.last_line, c.strokes))
        .collect();
    assert_eq!(
        list,
        [(4, 7, 2), (9, 11, 2), (13, 16, 1), (18, 18, 1), (20, 20, 1)]
    );
    assert_eq!(cuts.get(2).unwrap().start_mm, [30.0, 0.0]);
    assert!((cuts.get(2).unwrap().length_mm - 8.0 - std::f64::consts::PI).abs() < 1e-2);
}

#[test]
fn g_code_of_other_programs_is_followed_or_refused_with_its_line() {
    for (text, count) in [
        // Power 0 in place of G0, relative, inches, modal words left out.
        (
            "G90\nM4\nG0X5Y5S0\nG91\nG1X4F1500S200\nX3S0\nY2S200\nX-4\nG90\nX0Y0S0\nM5S0\n",
            2,
        ),
        ("G20\nG0X1Y1\nM4S100\nG1X2F60\nG0X1Y2\nG1X2\nM5\n", 2),
        ("G0X1Y1\nM5\nM2\n", 0),
    ] {
        let cuts = Cuts::of(&checked(text)).unwrap();
        assert_eq!(cuts.len(), count, "{text}");
    }
    for (text, line) in [
        ("G21\nG28\nM5\n", 2),
        ("G21\nG0X1\nG1Y2F1\nM5\n", 2),
        ("G21\n\nG92X0Y0\nG0X1Y1\n", 3),
        ("G0X1Y1\nG53G0X0Y0\n", 2),
    ] {
        let error = Cuts::of(&checked(text)).unwrap_err();
        assert_eq!(error.line, line, "{text}: {error}");
    }
}

/// Waiting for a proof, a slow host or the person, the head stands at the end of what it was sent, for as many reports as
/// it takes; and somewhere else it is astray.
#[test]
fn a_head_that_waits_at_the_end_of_its_lines_is_not_astray() {
    let job = checked("G21G90\nM4S500\nG0X5Y5\nG1X9F900\nG0X20\nG1X29\nM5\nG0X0Y0\n");
    let cuts = Cuts::of(&job).unwrap();
    for (sent, at) in [(4, [9.0, 5.0]), (8, [0.0, 0.0])] {
        let mut follower = Follower::new(&cuts, Some([0.0; 2]), 0.02);
        follower.rested(sent);
        for _ in 0..5 {
            assert_eq!(follower.sighted(at, sent), Sighting::OnTheWay);
        }
        assert_eq!(
            follower.proven(),
            cuts.iter().filter(|c| c.last_line < sent).count()
        );
        let away = follower.sighted([at[0] + 3.0, at[1]], sent);
        assert!(matches!(away, Sighting::Astray { by_mm } if (by_mm - 3.0).abs() < 1e-9));
    }
}
