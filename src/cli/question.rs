//! Questions to the person at the terminal.

use std::io::{self, BufRead, Cursor, Read, Write as _};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use super::Terminal;
use crate::base::progress::Progress as _;

/// How soon a wish to stop is heard while a question waits.
const LOOK: Duration = Duration::from_millis(50);

/// Asks the person at the terminal; anything but yes is no, also a wish to stop and a terminal that was closed.
pub(super) fn agrees(question: &str, terminal: &Terminal) -> bool {
    let mut err = io::stderr();
    let _ = write!(err, "{question}? [y/N] ").and_then(|()| err.flush());
    let mut line = String::new();
    let read = TypedLines::new(terminal).read_line(&mut line);
    read.is_ok()
        && !terminal.interrupted()
        && matches!(line.trim().to_ascii_lowercase().as_str(), "y" | "yes")
}

/// What a person types, line by line. A wish to stop (Ctrl-C, SIGTERM, a closed terminal) is its end at once, where standard
/// input itself would go on waiting for Enter.
pub(super) struct TypedLines<'a> {
    terminal: &'a Terminal,
    line: Cursor<Vec<u8>>,
}

impl<'a> TypedLines<'a> {
    pub fn new(terminal: &'a Terminal) -> Self {
        Self {
            terminal,
            line: Cursor::default(),
        }
    }

    /// The next line; empty at the end.
    fn wait(&self) -> io::Result<Vec<u8>> {
        // A thread a line, so that nothing reads on once the last question is answered. One that is left waiting ends with
        // the program, which a wish to stop brings about.
        let (answer, answered) = mpsc::channel();
        thread::Builder::new().spawn(move || {
            let mut line = Vec::new();
            let read = io::stdin().lock().read_until(b'\n', &mut line);
            let _ = answer.send(read.map(|_| line));
        })?;
        let line = loop {
            if self.terminal.interrupted() {
                break Vec::new();
            }
            match answered.recv_timeout(LOOK) {
                Ok(line) => break line?,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break Vec::new(),
            }
        };
        if !line.ends_with(b"\n") {
            // What follows begins on a line of its own.
            let _ = io::stderr().write_all(b"\n");
        }
        Ok(line)
    }
}

impl Read for TypedLines<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for TypedLines<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.line.fill_buf()?.is_empty() {
            self.line = Cursor::new(self.wait()?);
        }
        self.line.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        self.line.consume(count);
    }
}
