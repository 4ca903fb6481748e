//! A job from one of its cuts on: what must be set before, and the way there with the beam off.

use crate::base::units::short;
use crate::control::follow::Cuts;
use crate::control::{Job, NotFollowed};

/// The rest of a job, ready to be sent.
pub(super) struct Restart {
    /// The lines that set the controller up, then the original ones from the cut on.
    pub job: Job,
    /// Its cuts: those of the original from that one on.
    pub cuts: Cuts,
}

/// What a controller has in force at some line. The interpreter follows no job with other words that stay in force.
#[derive(Clone, Debug)]
struct InForce {
    motion: &'static str,
    inches: bool,
    relative: bool,
    mist: bool,
    flood: bool,
    beam: &'static str,
    power: f64,
    feed_mm_min: Option<f64>,
}

/// Letter and number of each word of a checked line.
fn words(text: &str) -> impl Iterator<Item = (char, f64)> {
    let starts = text.match_indices(|c: char| c.is_ascii_uppercase());
    starts.map(move |(at, letter)| {
        let number = &text[at + 1..];
        let end = number
            .find(|c: char| c.is_ascii_uppercase())
            .unwrap_or(number.len());
        let letter = letter.chars().next().unwrap_or(' ');
        (letter, number[..end].parse().unwrap_or(0.0))
    })
}

fn motion_word(letter: char, number: f64) -> Option<&'static str> {
    if letter != 'G' {
        return None;
    }
    ["G0", "G1", "G2", "G3"]
        .into_iter()
        .zip([0.0, 1.0, 2.0, 3.0])
        .find_map(|(word, n)| (number == n).then_some(word))
}

impl InForce {
    /// After the first `lines` lines of a job, on a controller that has just started.
    fn after(job: &Job, lines: usize) -> Self {
        let mut now = Self {
            motion: "G0",
            inches: false,
            relative: false,
            mist: false,
            flood: false,
            beam: "M5",
            power: 0.0,
            feed_mm_min: None,
        };
        for (text, _) in job.lines().take(lines) {
            now.obey(text);
        }
        now
    }

    fn obey(&mut self, text: &str) {
        // The unit of a line holds for its feed, wherever it stands.
        for (letter, number) in words(text) {
            match (letter, number) {
                ('G', 20.0) => self.inches = true,
                ('G', 21.0) => self.inches = false,
                _ => {}
            }
        }
        for (letter, number) in words(text) {
            if let Some(motion) = motion_word(letter, number) {
                self.motion = motion;
            }
            match (letter, number) {
                ('G', 90.0) => self.relative = false,
                ('G', 91.0) => self.relative = true,
                ('M', 3.0) => self.beam = "M3",
                ('M', 4.0) => self.beam = "M4",
                ('M', 5.0) => self.beam = "M5",
                ('M', 7.0) => self.mist = true,
                ('M', 8.0) => self.flood = true,
                ('M', 9.0) => (self.mist, self.flood) = (false, false),
                ('S', s) => self.power = s,
                ('F', f) => self.feed_mm_min = Some(if self.inches { f * 25.4 } else { f }),
                _ => {}
            }
        }
    }
}

impl Restart {
    /// The job from cut `cut` on, in this coordinate system (`G54` to `G59`).
    ///
    /// # Errors
    /// [`NotFollowed`] where there is no such cut, or a line would become too long.
    pub fn new(job: &Job, cuts: &Cuts, cut: usize, system: &str) -> Result<Self, NotFollowed> {
        let refused = |line: usize, why: &str| NotFollowed {
            line,
            why: why.to_owned(),
        };
        let first = cuts
            .get(cut)
            .ok_or_else(|| refused(0, "there is no such cut"))?;
        let now = InForce::after(job, first.first_line);
        // Dark first, then the way there, and the beam's mode last of all.
        let mut lead = vec!["M5".to_owned(), format!("G21G90G17G94{system}")];
        let travel = lead.len();
        let [x, y] = first.start_mm;
        lead.push(format!("G0X{}Y{}", short(x, 4), short(y, 4)));
        if now.mist {
            lead.push("M7".into());
        }
        if now.flood {
            lead.push("M8".into());
        }
        if let Some(feed) = now.feed_mm_min {
            lead.push(format!("F{}", short(feed, 3)));
        }
        if now.inches {
            lead.push("G20".into());
        }
        if now.relative {
            lead.push("G91".into());
        }
        lead.push(format!("{}S{}", now.beam, short(now.power, 3)));
        // The way of moving stays G0, with which no beam is on at rest, up to the line that moves: if that leaves its
        // word out, it gets it.
        let moving = cuts.line_of_first_move(cut).unwrap_or(first.first_line);
        let named = job
            .lines()
            .take(moving + 1)
            .skip(first.first_line)
            .any(|(text, _)| words(text).any(|(l, n)| motion_word(l, n).is_some()));
        let before = (!named).then_some((moving, now.motion));
        let count = lead.len();
        let rest = job
            .starting_at_line(first.first_line, &lead, before)
            .map_err(|line| {
                let number = job.line(line).map_or(0, |(_, number)| number);
                refused(
                    number,
                    "with its G word the line is too long for the controller",
                )
            })?;
        let cuts = cuts
            .starting_at_cut(cut, count, travel)
            .ok_or_else(|| refused(0, "there is no such cut"))?;
        Ok(Self { job: rest, cuts })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::JobRules;

    fn checked(text: &str) -> Job {
        let rules = JobRules {
            allow_constant_power: true,
            ..JobRules::default()
        };
        Job::check(text.as_bytes(), &rules).unwrap()
    }

    fn lines(job: &Job) -> Vec<String> {
        job.lines().map(|(text, _)| text.to_owned()).collect()
    }

    const JOBS: [&str; 4] = [
        "G21G90\nM8\nM4S0\nG0X1Y1\nG1X9F3000S500\nG0Y2\nG1X1\nG2X5Y6I2J2\nM9\nG0X3Y3\nG3X5R2F100\nX9R4\nG0X0\nG1Y9S300\nM5\nM2\n",
        "G20G90\nM4S100\nG0X1Y1\nG1X2F60\nG0X1Y2\nX2S50G1\nM5\n",
        "G21G90\nG0X5Y5\nM4\nG91\nG1X4F1500S200\nX3S0\nY2S200\nX-4S0\nG90\nG1X0Y0S9\nM5\n",
        "G21G90\nM3S100\nG0X1Y1\nG1X5F900\nG0X9\nG1F500\nG4P0.1\nX12\nM5\n",
    ];

    #[test]
    fn the_rest_of_a_job_cuts_what_was_left() {
        for text in JOBS {
            let job = checked(text);
            let cuts = Cuts::of(&job).unwrap();
            assert!(cuts.len() >= 2);
            for cut in 0..cuts.len() {
                let rest = Restart::new(&job, &cuts, cut, "G54").unwrap();
                // Read again by the interpreter, without knowing where it comes from.
                let read = Cuts::of(&rest.job).unwrap();
                assert_eq!(read.len(), rest.cuts.len());
                for (k, (a, b)) in read.iter().zip(rest.cuts.iter()).enumerate() {
                    let close = |p: [f64; 2], q: [f64; 2]| {
                        (p[0] - q[0]).abs() < 1e-3 && (p[1] - q[1]).abs() < 1e-3
                    };
                    assert!(close(a.start_mm, b.start_mm), "{text} {cut} {k}");
                    assert!((a.length_mm - b.length_mm).abs() < 1e-3);
                    assert_eq!(a.last_line, b.last_line);
                    let original = cuts.get(cut + k).unwrap();
                    assert_eq!(original.length_mm, b.length_mm);
                    // Lines that set something before the first move now belong to the way there.
                    assert!(k == 0 || a.first_line == b.first_line);
                }
                for (a, b) in read.burns().zip(cuts.burns_from(cut)) {
                    assert!((a - b).abs() < 1e-6, "{text} {cut}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn the_way_there_is_dark_and_everything_is_as_it_was() {
        let job = checked(JOBS[0]);
        let cuts = Cuts::of(&job).unwrap();
        let rest = Restart::new(&job, &cuts, 1, "G55").unwrap();
        assert_eq!(
            lines(&rest.job)[..6],
            [
                "M5",
                "G21G90G17G94G55",
                "G0X3Y3",
                "F3000",
                "M4S500",
                "G3X5R2F100"
            ]
        );
        let job = checked(JOBS[1]);
        let cuts = Cuts::of(&job).unwrap();
        let rest = Restart::new(&job, &cuts, 0, "G54").unwrap();
        assert_eq!(
            lines(&rest.job)[2..],
            [
                "G0X25.4Y25.4",
                "G20",
                "M4S100",
                "G1X2F60",
                "G0X1Y2",
                "X2S50G1",
                "M5"
            ]
        );
        // A word that was left out is put in.
        let job = checked("G21G90\nM4S9\nG1F600\nG0X1Y1\nM8\nG1X2\nX3S0\nX4S9\nM5\n");
        let cuts = Cuts::of(&job).unwrap();
        let rest = Restart::new(&job, &cuts, 1, "G54").unwrap();
        assert_eq!(
            lines(&rest.job)[2..],
            ["G0X3Y1", "M8", "F600", "M4S0", "G1X4S9", "M5"]
        );
        assert_eq!(rest.job.line(6), Some(("G1X4S9", 8)));
    }
}
