//! The whole path at once: what an estimate uses, with unlimited look-ahead.

use super::{Block, Limits, Move, Profile};

/// A move or a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// A straight move.
    Move(Move),
    /// The machine comes to rest and stays for this long, s: a dwell, or zero where something must be waited for.
    Stop {
        /// How long, s.
        wait_s: f64,
    },
}

/// One profile for each motion, in O(n). The path starts and ends at rest; moves that go nowhere take no time and
/// make no corner.
pub fn plan(motions: &[Motion], limits: &Limits) -> Vec<Profile> {
    let mut profiles = vec![Profile::default(); motions.len()];
    let mut run: Vec<(usize, Block)> = Vec::new();
    let mut speeds: Vec<f64> = Vec::new();
    for (k, motion) in motions.iter().enumerate() {
        match motion {
            Motion::Move(wanted) => {
                run.extend(Block::new(wanted, limits).map(|block| (k, block)));
            }
            Motion::Stop { wait_s } => {
                plan_run(&run, &mut speeds, limits, &mut profiles);
                run.clear();
                profiles[k] = Profile::standing(wait_s.max(0.0));
            }
        }
    }
    plan_run(&run, &mut speeds, limits, &mut profiles);
    profiles
}

/// The time of all motions, s.
pub fn total_s(motions: &[Motion], limits: &Limits) -> f64 {
    plan(motions, limits).iter().map(Profile::duration_s).sum()
}

/// Blocks between two stops. `speeds` is scratch: squares of the speeds at the corners.
fn plan_run(
    run: &[(usize, Block)],
    speeds: &mut Vec<f64>,
    limits: &Limits,
    profiles: &mut [Profile],
) {
    let n = run.len();
    speeds.clear();
    speeds.resize(n + 1, 0.0);
    for k in (1..n).rev() {
        let block = &run[k].1;
        let reach = speeds[k + 1] + 2.0 * block.acceleration_mm_s2 * block.length_mm;
        speeds[k] = block.corner_sqr(&run[k - 1].1, limits).min(reach);
    }
    for (k, (motion, block)) in run.iter().enumerate() {
        let reach = speeds[k] + 2.0 * block.acceleration_mm_s2 * block.length_mm;
        speeds[k + 1] = speeds[k + 1].min(reach);
        profiles[*motion] = Profile::new(
            block.length_mm,
            speeds[k].sqrt(),
            block.nominal_mm_s,
            speeds[k + 1].sqrt(),
            block.acceleration_mm_s2,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::tests::{LIMITS, to};
    use super::*;

    #[test]
    fn two_straight_moves_take_as_long_as_one() {
        let one = total_s(&[Motion::Move(to(40.0, 0.0, 3000.0))], &LIMITS);
        let two = total_s(&[Motion::Move(to(20.0, 0.0, 3000.0)); 2], &LIMITS);
        assert!((one - two).abs() < 1e-12);
        // 50 mm/s at 500 mm/s²: two ramps of 0.1 s over 5 mm in all.
        assert!((one - (0.2 + 35.0 / 50.0)).abs() < 1e-12);
    }

    #[test]
    fn a_stop_costs_its_dwell_and_two_ramps() {
        let there = Motion::Move(to(20.0, 0.0, 3000.0));
        let with = total_s(&[there, Motion::Stop { wait_s: 0.3 }, there], &LIMITS);
        let without = total_s(&[there, there], &LIMITS);
        assert!((with - without - 0.3 - 2.0 * 0.1 + 5.0 / 50.0).abs() < 1e-12);
    }

    #[test]
    fn a_move_to_nowhere_makes_no_corner() {
        let (a, nowhere) = (Motion::Move(to(20.0, 0.0, 3000.0)), to(0.0, 0.0, 3000.0));
        let plain = total_s(&[a, a], &LIMITS);
        assert_eq!(total_s(&[a, Motion::Move(nowhere), a], &LIMITS), plain);
    }
}
