//! A scripted controller: what is expected, and what it answers. For tests of the protocol without a machine.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use super::Transport;

/// One exchange.
#[derive(Clone, Debug, PartialEq)]
pub enum Exchange {
    /// These bytes must be sent next (status requests aside), and this is answered.
    Expect(Vec<u8>, Vec<u8>),
    /// The link breaks.
    Break,
}

/// A transport that follows a script on a clock of its own. Status requests are answered with [`Script::status`] at
/// any time and are not part of the script.
#[derive(Clone, Debug)]
pub struct Script {
    exchanges: VecDeque<Exchange>,
    /// The answer to `?`; empty for silence.
    pub status: Vec<u8>,
    waiting: VecDeque<u8>,
    inbox: VecDeque<u8>,
    now: Duration,
    /// Everything that was sent, status requests aside.
    pub sent: Vec<u8>,
    broken: bool,
}

impl Script {
    /// A controller that first says `greeting`, and is idle.
    pub fn new(greeting: &str, exchanges: impl IntoIterator<Item = Exchange>) -> Self {
        Self {
            exchanges: exchanges.into_iter().collect(),
            status: b"<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n".to_vec(),
            waiting: VecDeque::new(),
            inbox: greeting.bytes().collect(),
            now: Duration::ZERO,
            sent: Vec::new(),
            broken: false,
        }
    }

    /// What the script still waits for.
    pub fn left(&self) -> usize {
        self.exchanges.len()
    }

    fn follow(&mut self) {
        loop {
            match self.exchanges.front() {
                Some(Exchange::Break) => {
                    self.broken = true;
                    return;
                }
                Some(Exchange::Expect(bytes, _)) if self.waiting.len() >= bytes.len() => {
                    let Some(Exchange::Expect(bytes, answer)) = self.exchanges.pop_front() else {
                        return;
                    };
                    let got: Vec<u8> = self.waiting.drain(..bytes.len()).collect();
                    if got == bytes {
                        self.inbox.extend(answer);
                    } else {
                        // Off the script: the sender sees a dead link, the test sees what is left.
                        self.exchanges.push_front(Exchange::Expect(bytes, answer));
                        self.broken = true;
                        return;
                    }
                }
                _ => return,
            }
        }
    }
}

impl Transport for Script {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        for &byte in bytes {
            if byte == b'?' {
                self.inbox.extend(&self.status);
            } else {
                self.sent.push(byte);
                self.waiting.push_back(byte);
            }
        }
        self.follow();
        if self.broken {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        if self.inbox.is_empty() {
            if self.broken {
                return Err(io::ErrorKind::BrokenPipe.into());
            }
            self.now += wait;
            return Ok(0);
        }
        let count = buffer.len().min(self.inbox.len());
        for (slot, byte) in buffer.iter_mut().zip(self.inbox.drain(..count)) {
            *slot = byte;
        }
        Ok(count)
    }

    fn now(&self) -> Duration {
        self.now
    }

    fn name(&self) -> &str {
        "the script"
    }
}
