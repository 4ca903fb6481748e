//! Look-ahead over the moves that a controller holds.

use std::collections::VecDeque;

use super::{Block, Limits, Move, Profile, StepTimer};

/// A ring of blocks, replanned with every one that is added so that the last can always stop.
///
/// The first block is the one that runs: its entry speed and length are what is left of it
/// ([`Queue::set_front`]), and everything behind it is as fast as its limits allow. `T` rides along with each block.
#[derive(Clone, Debug)]
pub struct Queue<T> {
    limits: Limits,
    capacity: usize,
    entries: VecDeque<Entry<T>>,
    /// Entries up to this index cannot become faster by what comes later.
    planned: usize,
    /// What makes the steps, and their number per mm of each axis.
    timer: Option<(StepTimer, [f64; 3])>,
}

#[derive(Clone, Debug)]
struct Entry<T> {
    block: Block,
    /// Square of the speed at its start, (mm/s)².
    entry_sqr: f64,
    /// The corner before it allows no more.
    corner_sqr: f64,
    payload: T,
}

/// The queue holds as many blocks as it can.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the planner's queue is full: wait until its first block has ended")]
pub struct QueueFull;

impl<T> Queue<T> {
    /// An empty queue for at most `capacity` blocks (at least one).
    pub fn new(limits: Limits, capacity: usize) -> Self {
        let capacity = capacity.max(1);
        Self {
            limits,
            capacity,
            entries: VecDeque::with_capacity(capacity.min(1024)),
            planned: 0,
            timer: None,
        }
    }

    /// The same with motions as this timer makes them, at this number of steps per mm of each axis.
    pub fn timed(self, timer: Option<StepTimer>, steps_per_mm: [f64; 3]) -> Self {
        Self {
            timer: timer.map(|timer| (timer, steps_per_mm)),
            ..self
        }
    }

    /// Blocks held, the running one included.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True if nothing is held.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// True if no block can be added.
    pub fn is_full(&self) -> bool {
        self.entries.len() >= self.capacity
    }

    /// Blocks that can still be added.
    pub fn free(&self) -> usize {
        self.capacity - self.entries.len()
    }

    /// Other limits, for the blocks to come.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }

    /// Forgets every block.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.planned = 0;
    }

    /// Adds a move; false if it goes nowhere and was dropped.
    ///
    /// # Errors
    /// [`QueueFull`]; nothing is added.
    pub fn push(&mut self, wanted: &Move, payload: T) -> Result<bool, QueueFull> {
        let Some(block) = Block::new(wanted, &self.limits) else {
            return Ok(false);
        };
        if self.is_full() {
            return Err(QueueFull);
        }
        let corner_sqr = match self.entries.back() {
            Some(previous) => block.corner_sqr(&previous.block, &self.limits),
            None => 0.0,
        };
        self.entries.push_back(Entry {
            block,
            entry_sqr: 0.0,
            corner_sqr,
            payload,
        });
        self.replan();
        Ok(true)
    }

    /// The block that runs or will run next, and what rides with it.
    pub fn front(&self) -> Option<(&Block, &T)> {
        self.entries.front().map(|e| (&e.block, &e.payload))
    }

    /// What rides with the last block.
    pub fn back(&self) -> Option<&T> {
        self.entries.back().map(|e| &e.payload)
    }

    /// The fastest way along the rest of the first block, from its present speed to its planned exit.
    pub fn front_profile(&self) -> Option<Profile> {
        let front = self.entries.front()?;
        let profile = Profile::new(
            front.block.length_mm,
            front.entry_sqr.max(0.0).sqrt(),
            front.block.nominal_mm_s,
            self.exit_sqr().max(0.0).sqrt(),
            front.block.acceleration_mm_s2,
        );
        Some(match &self.timer {
            Some((timer, steps_per_mm)) => {
                let steps = (0..3).map(|k| front.block.direction[k].abs() * steps_per_mm[k]);
                profile.timed(timer, steps.fold(0.0, f64::max))
            }
            None => profile,
        })
    }

    /// Square of the planned speed at the end of the first block, (mm/s)².
    pub fn exit_sqr(&self) -> f64 {
        self.entries.get(1).map_or(0.0, |e| e.entry_sqr)
    }

    /// Says where the running block is: what is left of it and its speed now. Does not plan: [`Queue::replan_all`]
    /// and [`Queue::push`] do.
    pub fn set_front(&mut self, left_mm: f64, speed_mm_s: f64) {
        if let Some(front) = self.entries.front_mut() {
            front.block.length_mm = left_mm.max(0.0);
            front.entry_sqr = speed_mm_s * speed_mm_s;
        }
    }

    /// Other speeds for the blocks held, mm/s (an override): corners are judged again and everything is planned anew.
    pub fn set_nominal(&mut self, wanted: impl Fn(&Block, &T) -> f64) {
        for entry in &mut self.entries {
            entry.block.nominal_mm_s = wanted(&entry.block, &entry.payload);
        }
        for k in 1..self.entries.len() {
            let corner_sqr = self.entries[k]
                .block
                .corner_sqr(&self.entries[k - 1].block, &self.limits);
            self.entries[k].corner_sqr = corner_sqr;
        }
        self.replan_all();
    }

    /// Plans anew from what is known of the first block, all of it: after a hold changed the speed.
    pub fn replan_all(&mut self) {
        self.planned = 0;
        self.replan();
    }

    /// The first block has ended.
    pub fn pop(&mut self) -> Option<T> {
        let entry = self.entries.pop_front()?;
        self.planned = self.planned.saturating_sub(1);
        Some(entry.payload)
    }

    /// Backwards from a stop at the end, then forwards from the speed that the first block has.
    fn replan(&mut self) {
        let n = self.entries.len();
        let mut next_sqr = 0.0;
        for k in (self.planned + 1..n).rev() {
            let entry = &mut self.entries[k];
            let reach = next_sqr + 2.0 * entry.block.acceleration_mm_s2 * entry.block.length_mm;
            entry.entry_sqr = entry.corner_sqr.min(reach);
            next_sqr = entry.entry_sqr;
        }
        for k in self.planned + 1..n {
            let before = &self.entries[k - 1];
            let reach =
                before.entry_sqr + 2.0 * before.block.acceleration_mm_s2 * before.block.length_mm;
            let entry = &mut self.entries[k];
            if reach < entry.entry_sqr {
                // Accelerating all the way to here: nothing that follows can make this corner faster.
                entry.entry_sqr = reach;
                self.planned = k;
            } else if entry.entry_sqr >= entry.corner_sqr {
                self.planned = k;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::tests::{LIMITS, to};
    use super::*;
    use crate::planner::{Motion, plan};
    use proptest::prelude::*;

    fn drain(moves: &[Move], window: usize) -> f64 {
        let mut queue = Queue::new(LIMITS, window);
        let mut left = moves.iter();
        let mut total = 0.0;
        loop {
            while !queue.is_full() {
                match left.next() {
                    Some(m) => {
                        queue.push(m, ()).unwrap();
                    }
                    None => break,
                }
            }
            let Some(profile) = queue.front_profile() else {
                return total;
            };
            total += profile.duration_s();
            let exit = profile.exit_mm_s();
            queue.pop();
            if let Some((block, ())) = queue.front() {
                let length = block.length_mm;
                queue.set_front(length, exit);
            }
        }
    }

    fn path() -> impl Strategy<Value = Vec<Move>> {
        proptest::collection::vec(
            (-5.0f64..5.0, -5.0f64..5.0, 300.0f64..6000.0).prop_map(|(x, y, rate)| to(x, y, rate)),
            1..60,
        )
    }

    proptest! {
        #[test]
        fn a_wide_window_is_the_unlimited_plan_and_a_narrow_one_is_no_faster(moves in path()) {
            let motions: Vec<Motion> = moves.iter().map(|&m| Motion::Move(m)).collect();
            let unlimited: f64 = plan(&motions, &LIMITS).iter().map(Profile::duration_s).sum();
            let wide = drain(&moves, 100);
            prop_assert!((wide - unlimited).abs() < 1e-9 * unlimited.max(1.0), "{wide} {unlimited}");
            let narrow = drain(&moves, 3);
            prop_assert!(narrow >= unlimited * (1.0 - 1e-12));
            prop_assert!(drain(&moves, 15) <= narrow * (1.0 + 1e-12));
        }
    }

    #[test]
    fn a_full_queue_says_so() {
        let mut queue = Queue::new(LIMITS, 2);
        assert_eq!(queue.push(&to(0.0, 0.0, 100.0), ()), Ok(false));
        assert_eq!(queue.push(&to(1.0, 0.0, 100.0), ()), Ok(true));
        assert_eq!(queue.push(&to(1.0, 0.0, 100.0), ()), Ok(true));
        assert_eq!(queue.push(&to(1.0, 0.0, 100.0), ()), Err(QueueFull));
        assert_eq!(queue.free(), 0);
    }
}
