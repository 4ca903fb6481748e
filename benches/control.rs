//! What rehearsing and planning cost.

use kagome::base::progress::Silent;
use kagome::control::JobRules;
use kagome::planner::{Limits, Motion, Move, Queue, plan};
use kagome::sim::{Settings, rehearse};

fn main() {
    divan::main();
}

/// Slits of 7 mm in rows, as a job.
fn job(slits: usize) -> String {
    let mut text = String::from("G21G90\nM4S500\nG1F3000\n");
    for k in 0..slits {
        let (x, y) = ((k % 45) * 9 + 5, (k / 45) * 8 + 5);
        text.push_str(&format!("G0X{x}.125Y{y}.25\nG1X{}.5Y{}.75\n", x + 4, y + 5));
    }
    text.push_str("M5\nM2\n");
    text
}

#[divan::bench(args = [200, 2000, 20_000])]
fn rehearsal_of_slits(bencher: divan::Bencher<'_, '_>, slits: usize) {
    let text = job(slits);
    let settings = Settings::default();
    bencher.bench(|| rehearse(text.as_bytes(), &settings, &JobRules::default(), &Silent));
}

fn limits() -> Limits {
    Settings::default().limits()
}

fn moves(n: usize) -> Vec<Move> {
    (0..n)
        .map(|k| {
            let angle = k as f64 * 0.7;
            Move {
                delta_mm: [0.5 * angle.cos(), 0.5 * angle.sin(), 0.0],
                rate_mm_min: Some(3000.0),
            }
        })
        .collect()
}

#[divan::bench]
fn planner_look_ahead_of_100_000_blocks(bencher: divan::Bencher<'_, '_>) {
    let motions: Vec<Motion> = moves(100_000).into_iter().map(Motion::Move).collect();
    bencher.bench(|| plan(&motions, &limits()));
}

#[divan::bench]
fn planner_queue_of_15_over_100_000_blocks(bencher: divan::Bencher<'_, '_>) {
    let moves = moves(100_000);
    bencher.bench(|| {
        let mut queue = Queue::new(limits(), 15);
        let mut total = 0.0;
        for wanted in &moves {
            if queue.is_full() {
                total += queue.front_profile().map_or(0.0, |p| p.duration_s());
                queue.pop();
            }
            let _ = queue.push(wanted, ());
        }
        total
    });
}
