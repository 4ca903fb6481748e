//! When each part of a job is done, by the planner.

use crate::control::Job;
use crate::sim::{Settings, estimate};

/// Lines of a job, and when they are done.
#[derive(Default)]
pub(super) struct Timetable {
    /// Lines of the job, and the time at which they are done, s; ascending.
    at: Vec<(usize, f64)>,
}

impl Timetable {
    /// Of a job on a machine; empty if the controller would not take it.
    pub fn of(job: &Job, settings: &Settings) -> Self {
        let lines: Vec<&str> = job.lines().map(|(text, _)| text).collect();
        // A long job has few points: each is an estimate of its own.
        let points = (400_000 / lines.len().max(1)).clamp(4, 32);
        let done = |point: usize| {
            let count = lines.len() * point / points;
            let time = estimate(&lines[..count].join("\n"), settings).ok()?.time_s;
            Some((count, time))
        };
        let at: Option<Vec<_>> = (0..=points).map(done).collect();
        Self {
            at: at.unwrap_or_default(),
        }
    }

    /// The time of the whole job, s.
    pub fn whole_s(&self) -> f64 {
        self.at.last().map_or(0.0, |p| p.1)
    }

    /// When so many lines are done, s.
    pub fn done_s(&self, lines: usize) -> f64 {
        let next = self.at.partition_point(|p| p.0 < lines);
        match (
            next.checked_sub(1).and_then(|k| self.at.get(k)),
            self.at.get(next),
        ) {
            (Some(a), Some(b)) => {
                a.1 + (b.1 - a.1) * (lines - a.0) as f64 / (b.0 - a.0).max(1) as f64
            }
            (None, Some(first)) => first.1,
            (_, None) => self.whole_s(),
        }
    }

    /// How long the rest takes, s, when `lines` are done after `elapsed_s` with the machine at work: at the pace so far once
    /// there is one.
    pub fn left_s(&self, lines: usize, elapsed_s: f64) -> f64 {
        // Feed overrides change the pace; the first seconds say nothing.
        const SETTLED_S: f64 = 20.0;
        let done = self.done_s(lines);
        let pace = if done > SETTLED_S {
            (elapsed_s / done).clamp(0.3, 10.0)
        } else {
            1.0
        };
        pace * (self.whole_s() - done).max(0.0)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::control::JobRules;

    /// A hundred cuts.
    pub(in crate::cli) fn job() -> Job {
        let mut text = String::from("G21 G90\nM4 S500\nF1200\n");
        for n in 0..100 {
            text.push_str(&format!("G0 X{n} Y0\nG1 Y20\n"));
        }
        text.push_str("M5\n");
        Job::check(text.as_bytes(), &JobRules::default()).unwrap()
    }

    #[test]
    fn the_timetable_is_the_planners() {
        let (job, settings) = (job(), Settings::default());
        let times = Timetable::of(&job, &settings);
        let lines: Vec<&str> = job.lines().map(|l| l.0).collect();
        let whole = estimate(&lines.join("\n"), &settings).unwrap().time_s;
        assert_eq!(times.whole_s(), whole);
        for count in [0, 3, 60, 101, lines.len()] {
            let true_s = estimate(&lines[..count].join("\n"), &settings)
                .unwrap()
                .time_s;
            let found = times.done_s(count);
            assert!(
                (found - true_s).abs() < 0.03 * whole,
                "{count}: {found} {true_s}"
            );
        }
        // Half as fast as planned: twice as long to go.
        let half = lines.len() / 2;
        let left = times.left_s(half, 2.0 * times.done_s(half));
        assert!((left - 2.0 * (whole - times.done_s(half))).abs() < 1e-9);
        assert_eq!(times.left_s(lines.len(), whole), 0.0);
    }
}
