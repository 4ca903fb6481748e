//! The lines of a journal: words for people, with a checksum that ties each to the one before it.

use sha2::{Digest as _, Sha256};

/// The first words of every journal.
const TITLE: &str = "kagome-journal 1";

/// What job a journal belongs to, and on which machine it runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// SHA-256 of the job's lines as they are sent, in hexadecimal.
    pub job: String,
    /// Its lines.
    pub lines: usize,
    /// Its cuts.
    pub cuts: usize,
    /// How far ahead of the last proof the sender may run.
    pub max_unconfirmed: usize,
    /// The job's file name, for people.
    pub name: String,
    /// The name of the machine's profile; empty if none was given.
    pub machine: String,
}

/// What a controller was when sending began.
#[derive(Clone, Debug, PartialEq)]
pub struct Begin {
    /// The first cut that is sent.
    pub cut: usize,
    /// The coordinate system in force, `G54` to `G59`.
    pub system: String,
    /// Work offset: machine coordinates of the job's zero point, mm.
    pub offset_mm: [f64; 3],
    /// The controller homes (`$22=1`), so that its coordinates mean the same after a restart.
    pub homes: bool,
    /// What it calls itself.
    pub firmware: String,
}

/// One line after the header.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// Sending begins, at first or anew.
    Begin(Begin),
    /// So many cuts of the job, from its first, are proven.
    Cuts(usize),
    /// Stopped, and the machine told that it stands with its beam off.
    Stopped {
        /// Machine coordinates where it came to rest, mm, if it has kept them.
        kept_mm: Option<[f64; 3]>,
    },
    /// The job is done.
    Finished,
}

/// The SHA-256 of a job as a journal names it.
pub(super) fn digest(lines: impl Iterator<Item = impl AsRef<str>>) -> String {
    let mut hash = Sha256::new();
    for line in lines {
        hash.update(line.as_ref());
        hash.update("\n");
    }
    hex(&hash.finalize())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// Ties lines together: each checksum is over the one before it and the line, so that none can be changed, taken out or
/// put in.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Chain(String);

impl Chain {
    /// Digits of a checksum: of a SHA-256 the first 64 bits, enough against accident.
    pub const DIGITS: usize = 16;

    fn sum(&self, text: &str) -> String {
        let mut hash = Sha256::new();
        hash.update(&self.0);
        hash.update(" ");
        hash.update(text);
        let mut sum = hex(&hash.finalize());
        sum.truncate(Self::DIGITS);
        sum
    }

    /// A line with its checksum, ready to be written.
    pub fn seal(&mut self, text: &str) -> String {
        let sum = self.sum(text);
        let line = format!("{sum} {text}\n");
        self.0 = sum;
        line
    }

    /// The text of a line (without its end), if its checksum is right.
    pub fn open<'a>(&mut self, line: &'a str) -> Option<&'a str> {
        let (sum, text) = line.split_once(' ')?;
        let right = self.sum(text);
        if sum != right {
            return None;
        }
        self.0 = right;
        Some(text)
    }
}

fn triple([x, y, z]: [f64; 3]) -> String {
    format!("{x:.4},{y:.4},{z:.4}")
}

fn parse_triple(text: &str) -> Option<[f64; 3]> {
    let mut numbers = text.split(',').map(str::parse::<f64>);
    let mut place = [0.0; 3];
    for p in &mut place {
        *p = numbers.next()?.ok().filter(|v| v.is_finite())?;
    }
    numbers.next().is_none().then_some(place)
}

/// Names come from outside; a line end or a control character in one must not become a line.
fn one_line(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect()
}

/// `key=value` words, the last of which takes the rest of the line.
fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let from = text.find(&format!("{key}="))? + key.len() + 1;
    Some(&text[from..])
}

fn word<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    value(text, key)?.split(' ').next()
}

impl Header {
    pub(super) fn lines(&self) -> [String; 3] {
        [
            TITLE.to_owned(),
            format!(
                "job {} lines={} cuts={} ahead={} name={}",
                self.job,
                self.lines,
                self.cuts,
                self.max_unconfirmed,
                one_line(&self.name)
            ),
            format!("machine name={}", one_line(&self.machine)),
        ]
    }

    pub(super) fn is_title(text: &str) -> bool {
        text == TITLE
    }

    pub(super) fn parse(job: &str, machine: &str) -> Option<Self> {
        let rest = job.strip_prefix("job ")?;
        Some(Self {
            job: rest.split(' ').next()?.to_owned(),
            lines: word(rest, "lines")?.parse().ok()?,
            cuts: word(rest, "cuts")?.parse().ok()?,
            max_unconfirmed: word(rest, "ahead")?.parse().ok()?,
            name: value(rest, "name")?.to_owned(),
            machine: value(machine.strip_prefix("machine ")?, "name")?.to_owned(),
        })
    }
}

impl Record {
    pub(super) fn text(&self) -> String {
        match self {
            Self::Begin(b) => format!(
                "begin cut={} system={} offset={} homes={} firmware={}",
                b.cut,
                b.system,
                triple(b.offset_mm),
                b.homes,
                one_line(&b.firmware)
            ),
            Self::Cuts(n) => format!("cuts {n}"),
            Self::Stopped { kept_mm: None } => "stopped position=lost".into(),
            Self::Stopped { kept_mm: Some(at) } => format!("stopped position={}", triple(*at)),
            Self::Finished => "finished".into(),
        }
    }

    pub(super) fn parse(text: &str) -> Option<Self> {
        if text == "finished" {
            return Some(Self::Finished);
        }
        let (kind, rest) = text.split_once(' ')?;
        Some(match kind {
            "begin" => Self::Begin(Begin {
                cut: word(rest, "cut")?.parse().ok()?,
                system: word(rest, "system")?.to_owned(),
                offset_mm: parse_triple(word(rest, "offset")?)?,
                homes: word(rest, "homes")?.parse().ok()?,
                firmware: value(rest, "firmware")?.to_owned(),
            }),
            "cuts" => Self::Cuts(rest.parse().ok()?),
            "stopped" => match value(rest, "position")? {
                "lost" => Self::Stopped { kept_mm: None },
                at => Self::Stopped {
                    kept_mm: Some(parse_triple(at)?),
                },
            },
            _ => return None,
        })
    }
}
