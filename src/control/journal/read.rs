//! What a journal tells.

use std::path::PathBuf;

use super::record::{Begin, Chain, Header, Record};

/// Why a journal is of no use. Nothing has reached the machine.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// It cannot be read or written.
    #[error("the journal {path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// It ends within its first lines: the job was never begun.
    #[error(
        "the journal ends before the job was begun: nothing was cut, so send the job from its beginning"
    )]
    NotBegun,
    /// It is no journal.
    #[error("this is no journal of kagome: it begins with {found:?}")]
    NoJournal {
        /// The beginning.
        found: String,
    },
    /// A line is not as it was written.
    #[error(
        "line {line} of the journal is damaged, so nobody can say which cuts are made; the lines before it prove {proven} cuts. Look at the sheet; to go on after those, delete the journal's lines from {line} on"
    )]
    Damaged {
        /// Line number, from 1.
        line: usize,
        /// Cuts that the lines before prove.
        proven: usize,
    },
    /// The journal of another job.
    #[error("the journal is that of another job: {why}. It stays as it is")]
    OtherJob {
        /// What differs.
        why: String,
    },
    /// The journal of a job on another machine.
    #[error(
        "the job was begun on the machine {journal:?} and is now to go to {asked:?}: a half-cut sheet can only be finished where it was begun (see --machine)"
    )]
    OtherMachine {
        /// The one of the journal.
        journal: String,
        /// The one asked for.
        asked: String,
    },
    /// Nothing is left to do.
    #[error("nothing is left to cut: the journal proves all {cuts} cuts")]
    Finished {
        /// Cuts of the job.
        cuts: usize,
    },
}

/// What is known of a job that was begun.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    /// Its job and machine.
    pub header: Header,
    /// How the last sending began.
    pub begin: Begin,
    /// Cuts that are proven, of the first so many.
    pub proven: usize,
    /// How it was stopped, if that could still be written: machine coordinates where they were kept, mm.
    pub stopped: Option<Option<[f64; 3]>>,
    /// It came to its end.
    pub finished: bool,
    /// Bytes of the file that are good; a line that was being written when the computer went down is behind them.
    pub(super) length: usize,
    pub(super) chain: Chain,
}

impl History {
    /// Reads a journal. A last line without its end was being written when the computer went down: it never counted, and
    /// is passed over.
    ///
    /// # Errors
    /// [`JournalError`]: it is no journal, was not begun, or has a damaged line.
    pub fn read(bytes: &[u8]) -> Result<Self, JournalError> {
        let mut chain = Chain::default();
        let mut lines = Lines {
            rest: bytes,
            number: 0,
            length: 0,
        };
        let no_journal = || JournalError::NoJournal {
            found: String::from_utf8_lossy(&bytes[..bytes.len().min(40)]).into_owned(),
        };
        // What cannot be the beginning of one is none, however short.
        let title = Chain::default().seal(
            &Header {
                job: String::new(),
                lines: 0,
                cuts: 0,
                max_unconfirmed: 0,
                name: String::new(),
                machine: String::new(),
            }
            .lines()[0],
        );
        let known = bytes.len().min(title.len());
        if bytes[..known] != title.as_bytes()[..known] {
            return Err(no_journal());
        }
        let mut next = |proven: usize| -> Result<Option<String>, JournalError> {
            let Some(line) = lines.next() else {
                return Ok(None);
            };
            let damaged = JournalError::Damaged {
                line: lines.number,
                proven,
            };
            let text = std::str::from_utf8(line)
                .ok()
                .and_then(|line| chain.open(line));
            text.map(|t| Some(t.to_owned())).ok_or(damaged)
        };
        let (Some(title), Some(job), Some(machine)) = (next(0)?, next(0)?, next(0)?) else {
            return Err(JournalError::NotBegun);
        };
        let header = Header::parse(&job, &machine).filter(|_| Header::is_title(&title));
        let Some(header) = header else {
            return Err(no_journal());
        };
        let mut begin = None;
        let (mut proven, mut stopped, mut finished) = (0, None, false);
        let mut number = 3;
        while let Some(text) = next(proven)? {
            number += 1;
            let damaged = JournalError::Damaged {
                line: number,
                proven,
            };
            match Record::parse(&text) {
                Some(Record::Begin(b)) if b.cut <= proven => {
                    begin = Some(b);
                    stopped = None;
                }
                Some(Record::Cuts(n)) if n >= proven && n <= header.cuts && begin.is_some() => {
                    proven = n;
                }
                Some(Record::Stopped { kept_mm }) if begin.is_some() => stopped = Some(kept_mm),
                Some(Record::Finished) if begin.is_some() => finished = true,
                // A sum that is right over words that mean nothing: another version, or a bug.
                _ => return Err(damaged),
            }
        }
        let Some(begin) = begin else {
            return Err(JournalError::NotBegun);
        };
        Ok(Self {
            header,
            begin,
            proven,
            stopped,
            finished,
            length: lines.length,
            chain,
        })
    }

    /// Whether this job on this machine may go on.
    ///
    /// # Errors
    /// [`JournalError`]: another job, another machine, or nothing left to do.
    pub fn check(&self, now: &Header) -> Result<(), JournalError> {
        let then = &self.header;
        if then.job != now.job || then.lines != now.lines || then.cuts != now.cuts {
            let why = if then.name == now.name {
                format!(
                    "{} was changed after it was begun ({} lines and {} cuts then, {} and {} now)",
                    now.name, then.lines, then.cuts, now.lines, now.cuts
                )
            } else {
                format!("it was written for {}", then.name)
            };
            return Err(JournalError::OtherJob { why });
        }
        if then.machine != now.machine {
            return Err(JournalError::OtherMachine {
                journal: then.machine.clone(),
                asked: now.machine.clone(),
            });
        }
        if self.finished || self.proven >= then.cuts {
            return Err(JournalError::Finished { cuts: then.cuts });
        }
        Ok(())
    }
}

/// Complete lines.
struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
    length: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let end = self.rest.iter().position(|&b| b == b'\n')?;
        let line = &self.rest[..end];
        self.rest = &self.rest[end + 1..];
        self.number += 1;
        self.length += end + 1;
        Some(line)
    }
}
