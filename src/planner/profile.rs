//! Speed over time along one straight move.

/// The timer that makes the steps, of GRBL on an AVR: it counts whole cycles of the clock and runs one longer than it
/// is set to, so every step comes late by a cycle or a few.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepTimer {
    /// The clock, Hz.
    pub clock_hz: f64,
}

impl StepTimer {
    /// Ranges of speed, mm/s, and by how many cycles a step is late there. Slow steps are made of 2, 4 or 8 ticks, so
    /// that all axes are smooth; each tick is one cycle late, a step's cycles are rounded up (half a cycle on
    /// average) and a tick's down.
    fn bands(&self, steps_per_mm: f64) -> impl Iterator<Item = (f64, f64, f64)> {
        [
            (0.0, 2000.0, 5.0),
            (2000.0, 4000.0, 3.0),
            (4000.0, 8000.0, 2.0),
            (8000.0, f64::INFINITY, 1.5),
        ]
        .into_iter()
        .map(move |(least, most, cycles)| (least / steps_per_mm, most / steps_per_mm, cycles))
    }
}

/// A trapezoid of speed: up to a peak, along it, down to the exit; each part may be empty. Starts at time 0, place 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Profile {
    entry_mm_s: f64,
    peak_mm_s: f64,
    exit_mm_s: f64,
    /// Durations of the three parts, s.
    parts_s: [f64; 3],
    length_mm: f64,
    acceleration_mm_s2: f64,
    /// By how much it lasts longer than planned, as a share.
    late: f64,
}

impl Profile {
    /// The fastest way over `length_mm` from speed `entry` to at most `exit`, at no more than `nominal` (all mm/s) and
    /// with this acceleration both ways. An exit that cannot be reached is replaced by the nearest that can; an entry
    /// above the nominal speed is slowed down from at once.
    pub fn new(length_mm: f64, entry: f64, nominal: f64, exit: f64, acceleration: f64) -> Self {
        let (up, down) = (entry * entry, exit * exit);
        let reach = 2.0 * acceleration * length_mm;
        // The exit within what the length allows, from above and from below.
        let exit = if down > up + reach {
            (up + reach).sqrt()
        } else if down < up - reach {
            (up - reach).sqrt()
        } else {
            exit
        };
        let meeting = ((reach + up + exit * exit) * 0.5).max(0.0).sqrt();
        if entry > nominal && meeting > nominal && exit <= nominal {
            // Slow down to the nominal speed, go along it, slow down to the exit.
            let first = (entry - nominal) / acceleration;
            let last = (nominal - exit) / acceleration;
            let rest = length_mm
                - (up - nominal * nominal) / (2.0 * acceleration)
                - (nominal * nominal - exit * exit) / (2.0 * acceleration);
            return Self {
                entry_mm_s: entry,
                peak_mm_s: nominal,
                exit_mm_s: exit,
                parts_s: [first, (rest / nominal).max(0.0), last],
                length_mm,
                acceleration_mm_s2: acceleration,
                late: 0.0,
            };
        }
        let peak = meeting.min(nominal.max(entry).max(exit));
        let (up, down) = (
            ((peak - entry) / acceleration).max(0.0),
            ((peak - exit) / acceleration).max(0.0),
        );
        let ramps = 0.5 * (entry + peak) * up + 0.5 * (peak + exit) * down;
        let cruise = if peak > 0.0 {
            ((length_mm - ramps) / peak).max(0.0)
        } else {
            0.0
        };
        Self {
            entry_mm_s: entry,
            peak_mm_s: peak,
            exit_mm_s: exit,
            parts_s: [up, cruise, down],
            length_mm,
            acceleration_mm_s2: acceleration,
            late: 0.0,
        }
    }

    /// Slowing down from `entry` (mm/s) as soon as possible, over at most `length_mm`: what a feed hold does. The exit
    /// speed is zero if the length suffices, and the profile is then shorter than `length_mm`.
    pub fn braking(length_mm: f64, entry: f64, acceleration: f64) -> Self {
        let needed = entry * entry / (2.0 * acceleration);
        let length = needed.min(length_mm);
        let exit = if needed <= length_mm {
            0.0
        } else {
            (entry * entry - 2.0 * acceleration * length)
                .max(0.0)
                .sqrt()
        };
        Self {
            entry_mm_s: entry,
            peak_mm_s: entry,
            exit_mm_s: exit,
            parts_s: [0.0, 0.0, (entry - exit) / acceleration],
            length_mm: length,
            acceleration_mm_s2: acceleration,
            late: 0.0,
        }
    }

    /// Standing still for this long.
    pub fn standing(duration_s: f64) -> Self {
        Self {
            parts_s: [0.0, duration_s, 0.0],
            ..Self::default()
        }
    }

    /// How long it takes, s.
    #[inline]
    pub fn duration_s(&self) -> f64 {
        self.planned_s() * (1.0 + self.late)
    }

    /// How many times longer it lasts than planned.
    pub(super) fn stretch(&self) -> f64 {
        1.0 + self.late
    }

    /// The same as planned.
    pub(super) fn planned(&self) -> Self {
        Self { late: 0.0, ..*self }
    }

    fn planned_s(&self) -> f64 {
        self.parts_s[0] + self.parts_s[1] + self.parts_s[2]
    }

    /// The same motion made by this timer, which is a little late with each step: `steps_per_mm` are those of the
    /// motor that makes most of them.
    pub fn timed(mut self, timer: &StepTimer, steps_per_mm: f64) -> Self {
        let planned_s = self.planned_s();
        if planned_s > 0.0 && self.length_mm > 0.0 {
            self.late = self.late_cycles(steps_per_mm, timer) / timer.clock_hz / planned_s;
        }
        self
    }

    /// Clock cycles by which all its steps together are late.
    fn late_cycles(&self, steps_per_mm: f64, timer: &StepTimer) -> f64 {
        let ramp = |from: f64, to: f64| -> f64 {
            let (low, high) = if from < to { (from, to) } else { (to, from) };
            timer
                .bands(steps_per_mm)
                .map(|(least, most, cycles)| {
                    let (a, b) = (low.max(least), high.min(most));
                    if b > a {
                        cycles * (b * b - a * a) / (2.0 * self.acceleration_mm_s2)
                    } else {
                        0.0
                    }
                })
                .sum()
        };
        let cruise_mm = self.parts_s[1] * self.peak_mm_s;
        let cruise: f64 = timer
            .bands(steps_per_mm)
            .filter(|(least, most, _)| (*least..*most).contains(&self.peak_mm_s))
            .map(|(_, _, cycles)| cycles * cruise_mm)
            .sum();
        let ramps = ramp(self.entry_mm_s, self.peak_mm_s) + ramp(self.peak_mm_s, self.exit_mm_s);
        (ramps + cruise) * steps_per_mm
    }

    /// How far it goes, mm.
    #[inline]
    pub fn length_mm(&self) -> f64 {
        self.length_mm
    }

    /// The speed at its end, mm/s.
    #[inline]
    pub fn exit_mm_s(&self) -> f64 {
        self.exit_mm_s
    }

    /// The largest speed in it, mm/s.
    #[inline]
    pub fn peak_mm_s(&self) -> f64 {
        self.peak_mm_s.max(self.entry_mm_s)
    }

    /// The place (mm from the start) and speed (mm/s) at a time from the start, clamped to the two ends.
    pub fn at(&self, time_s: f64) -> (f64, f64) {
        let [up, cruise, down] = self.parts_s;
        if time_s >= self.duration_s() {
            return (self.length_mm, self.exit_mm_s);
        }
        let t = time_s.max(0.0) / (1.0 + self.late);
        let slope = if self.peak_mm_s >= self.entry_mm_s {
            self.acceleration_mm_s2
        } else {
            -self.acceleration_mm_s2
        };
        if t < up {
            let speed = self.entry_mm_s + slope * t;
            return (0.5 * (self.entry_mm_s + speed) * t, speed);
        }
        if t < up + cruise {
            let ramp = 0.5 * (self.entry_mm_s + self.peak_mm_s) * up;
            return (ramp + self.peak_mm_s * (t - up), self.peak_mm_s);
        }
        // From the end, so that the last place is exact.
        let left = up + cruise + down - t;
        let speed = self.exit_mm_s + self.acceleration_mm_s2 * left;
        (
            self.length_mm - 0.5 * (self.exit_mm_s + speed) * left,
            speed,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_long_move_is_a_trapezoid() {
        // 50 mm/s at 500 mm/s²: 0.1 s and 2.5 mm each way, 95 mm along.
        let p = Profile::new(100.0, 0.0, 50.0, 0.0, 500.0);
        assert!((p.duration_s() - (0.2 + 95.0 / 50.0)).abs() < 1e-12);
        assert_eq!(p.at(0.1), (2.5, 50.0));
        let (place, speed) = p.at(2.05);
        assert!((place - (100.0 - 0.625)).abs() < 1e-9 && (speed - 25.0).abs() < 1e-9);
    }

    #[test]
    fn a_short_move_is_a_triangle() {
        // Never reaches 100 mm/s: t = 2 √(L/a), peak √(L a).
        let p = Profile::new(2.0, 0.0, 100.0, 0.0, 500.0);
        assert!((p.duration_s() - 2.0 * (2.0f64 / 500.0).sqrt()).abs() < 1e-12);
        assert!((p.peak_mm_s() - 1000f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn braking_stops_where_kinematics_says_or_leaves_the_move_still_moving() {
        let p = Profile::braking(10.0, 50.0, 500.0);
        assert!((p.length_mm() - 2.5).abs() < 1e-12 && p.exit_mm_s() == 0.0);
        assert!((p.duration_s() - 0.1).abs() < 1e-12);
        let p = Profile::braking(0.9, 50.0, 500.0);
        assert!((p.exit_mm_s() - 40.0).abs() < 1e-12 && p.length_mm() == 0.9);
    }

    #[test]
    fn standing_still_takes_time_and_goes_nowhere() {
        let p = Profile::standing(0.05);
        assert_eq!(p.duration_s(), 0.05);
        assert_eq!(p.at(0.02), (0.0, 0.0));
    }

    proptest! {
        #[test]
        fn speed_is_the_derivative_of_place_and_never_jumps(
            length in 0.01f64..200.0, entry in 0.0f64..150.0, nominal in 1.0f64..150.0,
            exit in 0.0f64..150.0, a in 50.0f64..3000.0,
        ) {
            let p = Profile::new(length, entry, nominal, exit, a);
            let total = p.duration_s();
            prop_assert!(total.is_finite() && total > 0.0);
            prop_assert!((p.at(total).0 - length).abs() < 1e-9);
            let n = 400;
            let dt = total / f64::from(n);
            let mut last = p.at(0.0);
            prop_assert!((last.1 - entry).abs() < 1e-6 * (1.0 + entry));
            for k in 1..=n {
                let now = p.at(dt * f64::from(k));
                prop_assert!((now.1 - last.1).abs() <= a * dt * 1.000_001 + 1e-6, "{last:?} {now:?}");
                let mean = 0.5 * (now.1 + last.1) * dt;
                prop_assert!((now.0 - last.0 - mean).abs() <= a * dt * dt + 1e-6);
                last = now;
            }
        }
    }
}
