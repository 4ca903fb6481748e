//! A whole job on a controller that reads it line by line: look-ahead over few blocks, reading that can be too slow,
//! dwells, and the beam.
//!
//! Two clocks: one reads lines and waits where the firmware waits, the other moves. Lines are taken to be sent as fast
//! as they are read.

use super::{Limits, Motion, Profile, Queue, StepTimer, dark_before_stop_s};

/// Share of the time of reading a line that it takes while nothing moves: making steps takes the rest. From recordings
/// of GRBL on an AVR with dwells in a streamed job.
pub const READING_AT_REST: f64 = 0.54;

/// What a firmware is besides its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Firmware {
    /// Blocks that it looks ahead.
    pub planner_blocks: usize,
    /// How long it takes to read and plan a line while moving, s per byte.
    pub byte_time_s: f64,
    /// How long it waits after each stop, s (GRBL `$1`; zero where motors stay on).
    pub stop_delay_s: f64,
    /// Dwells are made of pieces of this length, s, rounded up; zero if they are as long as asked.
    pub dwell_piece_s: f64,
    /// Steps per mm of X, Y, Z.
    pub steps_per_mm: [f64; 3],
    /// What makes the steps, if that is known.
    pub step_timer: Option<StepTimer>,
}

/// A motion, and what it is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// A move or a stop.
    pub motion: Motion,
    /// Bytes read for it, its line's end and lines before it that only set modes included; zero for the later chords of
    /// an arc.
    pub bytes: u32,
    /// Whether the beam is on along it; its power follows the speed (M4).
    pub lit: bool,
}

/// What a job takes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// From the first motion to the last, s.
    pub time_s: f64,
    /// Time with the output above zero, s.
    pub beam_on_s: f64,
    /// How often it is switched on.
    pub beam_periods: usize,
}

/// A block in the queue.
#[derive(Clone, Copy)]
struct Held {
    length_mm: f64,
    /// Of the fastest motor along it.
    steps_per_mm: f64,
    lit: bool,
}

struct Run {
    queue: Queue<Held>,
    /// The first block's profile, when it began, when the block began, and its length behind it then.
    running: Option<(Profile, f64, f64, f64)>,
    first_s: Option<f64>,
    last_s: f64,
    glows_since: Option<f64>,
    beam_on_s: f64,
    beam_periods: usize,
}

impl Run {
    /// Begins the first block, if there is one, at this time.
    fn begin(&mut self, at_s: f64) {
        if let (None, Some(profile)) = (&self.running, self.queue.front_profile()) {
            self.first_s.get_or_insert(at_s);
            self.running = Some((profile, at_s, at_s, 0.0));
            let lit = self.queue.front().is_some_and(|(_, held)| held.lit);
            match (lit, self.glows_since) {
                (true, None) => {
                    self.glows_since = Some(at_s);
                    self.beam_periods += 1;
                }
                (false, Some(_)) => self.dark(at_s),
                _ => {}
            }
        }
    }

    fn dark(&mut self, at_s: f64) {
        if let Some(since) = self.glows_since.take() {
            self.beam_on_s += (at_s - since).max(0.0);
        }
    }

    /// The first block ends: when that is. Nothing if nothing moves.
    fn finish_block(&mut self) -> Option<f64> {
        let (profile, start_s, block_start_s, _) = self.running.take()?;
        let end_s = start_s + profile.duration_s();
        let exit = profile.exit_mm_s();
        if let Some(held) = self.queue.pop()
            && exit == 0.0
        {
            let dark = dark_before_stop_s(&profile, start_s - block_start_s, held.steps_per_mm);
            self.dark(end_s - dark);
        }
        self.last_s = end_s;
        if let Some((block, _)) = self.queue.front() {
            let length = block.length_mm;
            self.queue.set_front(length, exit);
            self.begin(end_s);
        }
        Some(end_s)
    }

    /// Moves until this time.
    fn advance(&mut self, until_s: f64) {
        while let Some((profile, start_s, ..)) = &self.running
            && start_s + profile.duration_s() <= until_s
        {
            self.finish_block();
        }
    }

    /// Everything that is queued moves; the time at which it stands.
    fn drain(&mut self, at_s: f64) -> f64 {
        self.begin(at_s);
        let mut end_s = at_s;
        while let Some(end) = self.finish_block() {
            end_s = end_s.max(end);
        }
        end_s
    }

    /// Adds a move at this time, for which there is room.
    fn push(&mut self, now_s: f64, wanted: &super::Move, held: Held) {
        let exit = self.queue.exit_sqr();
        let mut behind = 0.0;
        if let (Some((profile, start_s, _, before)), Some((_, front))) =
            (&self.running, self.queue.front())
        {
            let (along, speed) = profile.at(now_s - start_s);
            behind = before + along;
            let left = front.length_mm - behind;
            self.queue.set_front(left, speed);
        }
        // Full it is not, and a move to nowhere is dropped.
        let added = matches!(self.queue.push(wanted, held), Ok(true));
        if added
            && self.queue.exit_sqr() != exit
            && let Some((_, _, block_start_s, _)) = self.running
        {
            self.running = self
                .queue
                .front_profile()
                .map(|profile| (profile, now_s, block_start_s, behind));
        }
    }
}

/// What a job takes on a controller with these limits, from rest to rest. O(n) for n steps.
pub fn estimate(steps: &[Step], limits: &Limits, firmware: &Firmware) -> Estimate {
    let mut run = Run {
        queue: Queue::new(*limits, firmware.planner_blocks)
            .timed(firmware.step_timer, firmware.steps_per_mm),
        running: None,
        first_s: None,
        last_s: 0.0,
        glows_since: None,
        beam_on_s: 0.0,
        beam_periods: 0,
    };
    let mut now_s = 0.0;
    for step in steps {
        run.advance(now_s);
        let share = if run.running.is_some() {
            1.0
        } else {
            READING_AT_REST
        };
        now_s += f64::from(step.bytes) * firmware.byte_time_s * share;
        run.advance(now_s);
        match &step.motion {
            Motion::Move(wanted) => {
                if run.queue.is_full() {
                    run.begin(now_s);
                    now_s = run.finish_block().map_or(now_s, |end| end.max(now_s));
                }
                let length_mm = wanted.delta_mm.iter().map(|d| d * d).sum::<f64>().sqrt();
                let steps_per_mm = (0..3)
                    .map(|k| wanted.delta_mm[k].abs() / length_mm * firmware.steps_per_mm[k])
                    .fold(0.0, f64::max);
                run.push(
                    now_s,
                    wanted,
                    Held {
                        length_mm,
                        steps_per_mm,
                        lit: step.lit,
                    },
                );
            }
            Motion::Stop { wait_s } => {
                let moves = !run.queue.is_empty();
                now_s = run.drain(now_s);
                if moves {
                    now_s += firmware.stop_delay_s;
                }
                let wait_s = wait_s.max(0.0);
                now_s += if firmware.dwell_piece_s > 0.0 {
                    // 0.15 is three pieces, whatever its rounding.
                    (wait_s / firmware.dwell_piece_s - 1e-9).ceil().max(0.0)
                        * firmware.dwell_piece_s
                } else {
                    wait_s
                };
            }
        }
    }
    run.drain(now_s);
    let last_s = run.last_s;
    run.dark(last_s);
    Estimate {
        time_s: run.first_s.map_or(0.0, |first| last_s - first),
        beam_on_s: run.beam_on_s,
        beam_periods: run.beam_periods,
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::tests::{LIMITS, to};
    use super::*;
    use crate::planner::total_s;

    const QUICK: Firmware = Firmware {
        planner_blocks: 1000,
        byte_time_s: 0.0,
        stop_delay_s: 0.0,
        dwell_piece_s: 0.0,
        steps_per_mm: [80.0; 3],
        step_timer: None,
    };

    fn moves(n: usize, length: f64, bytes: u32) -> Vec<Step> {
        (0..n)
            .map(|k| {
                let angle = 0.1 * k as f64;
                Step {
                    motion: Motion::Move(to(length * angle.cos(), length * angle.sin(), 3000.0)),
                    bytes,
                    lit: true,
                }
            })
            .collect()
    }

    #[test]
    fn a_controller_that_reads_at_once_and_looks_far_ahead_takes_as_long_as_the_plain_plan() {
        let steps = moves(200, 1.3, 20);
        let motions: Vec<Motion> = steps.iter().map(|s| s.motion).collect();
        let e = estimate(&steps, &LIMITS, &QUICK);
        assert!((e.time_s - total_s(&motions, &LIMITS)).abs() < 1e-9);
        assert_eq!(e.beam_periods, 1);
        assert!(e.time_s - e.beam_on_s > 0.0 && e.time_s - e.beam_on_s < 0.02);
    }

    #[test]
    fn lines_that_come_too_slowly_set_the_pace() {
        // 0.2 mm at 50 mm/s are 4 ms; a line of 20 bytes takes 20.
        let slow = Firmware {
            byte_time_s: 1e-3,
            planner_blocks: 15,
            ..QUICK
        };
        let e = estimate(&moves(500, 0.2, 20), &LIMITS, &slow);
        let read_s = 500.0 * 20.0 * 1e-3;
        assert!(
            e.time_s > 0.9 * read_s && e.time_s < 1.1 * read_s,
            "{}",
            e.time_s
        );
    }

    #[test]
    fn a_dwell_is_rounded_up_to_pieces_and_costs_the_delay_of_a_stop() {
        let there = moves(1, 20.0, 0)[0];
        let stop = Step {
            motion: Motion::Stop { wait_s: 0.06 },
            bytes: 0,
            lit: false,
        };
        let grbl = Firmware {
            stop_delay_s: 0.025,
            dwell_piece_s: 0.05,
            ..QUICK
        };
        let e = estimate(&[there, stop, there], &LIMITS, &grbl);
        let one = estimate(&[there], &LIMITS, &grbl);
        assert!((e.time_s - 2.0 * one.time_s - 0.1 - 0.025).abs() < 1e-9);
        assert_eq!(e.beam_periods, 2);
        assert!((e.beam_on_s - 2.0 * one.beam_on_s).abs() < 1e-9);
    }

    #[test]
    fn nothing_takes_no_time() {
        assert_eq!(estimate(&[], &LIMITS, &QUICK), Estimate::default());
    }
}
