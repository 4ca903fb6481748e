//! Lines in, bytes out.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use crate::control::Transport;
use crate::control::reply::Reply;

/// Lines in, bytes out.
pub(in crate::control) struct Link<'a> {
    pub transport: &'a mut dyn Transport,
    pub partial: Vec<u8>,
    pub lines: VecDeque<Reply>,
    /// What the controller's lengths are in, mm.
    pub unit_mm: f64,
}

impl<'a> Link<'a> {
    /// A line on which nothing was heard yet.
    pub fn new(transport: &'a mut dyn Transport) -> Self {
        Self {
            transport,
            partial: Vec::new(),
            lines: VecDeque::new(),
            unit_mm: 1.0,
        }
    }

    /// The next reply, waiting for it until `deadline`. It looks at the line once even if that has passed, and it
    /// comes back in time however much noise the line carries.
    pub fn reply(&mut self, deadline: Duration) -> io::Result<Option<Reply>> {
        loop {
            if let Some(reply) = self.lines.pop_front() {
                return Ok(Some(match reply {
                    Reply::Status(status) => Reply::Status(status.scaled(self.unit_mm)),
                    other => other,
                }));
            }
            let now = self.transport.now();
            let mut buffer = [0; 512];
            let count = self
                .transport
                .receive(&mut buffer, deadline.saturating_sub(now))?;
            for &byte in &buffer[..count] {
                if byte == b'\n' || byte == b'\r' {
                    let line = String::from_utf8_lossy(&self.partial);
                    self.lines.extend(Reply::parse(&line));
                    self.partial.clear();
                } else if self.partial.len() < 1024 {
                    // Longer lines come from no controller; what is dropped makes the line unknown.
                    self.partial.push(byte);
                }
            }
            if self.lines.is_empty() && self.transport.now() >= deadline {
                return Ok(None);
            }
        }
    }

    /// As [`Link::reply`], and nothing once `deadline` has passed: for loops that must end whatever the far side says.
    pub fn reply_before(&mut self, deadline: Duration) -> io::Result<Option<Reply>> {
        if self.transport.now() >= deadline {
            Ok(None)
        } else {
            self.reply(deadline)
        }
    }

    pub fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.transport.send(bytes)
    }
}
