//! The simulated machine at the end of a line that can fail.

use std::io;
use std::time::Duration;

use super::controller::Controller;
use crate::base::random::Random;
use crate::control::Transport;

/// What goes wrong with the line, on command. Counts are of bytes since the line was opened.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// The cable is pulled after this many bytes went to the machine: those arrive, later ones do not.
    pub cut_after_sent: Option<u64>,
    /// The cable is pulled after this many bytes came from the machine.
    pub cut_after_received: Option<u64>,
    /// The cable is pulled at this time on the machine's clock, s.
    pub cut_at_s: Option<f64>,
    /// Bytes to the machine, by number from 0, that never arrive.
    pub drop_sent: Vec<u64>,
    /// Bytes from the machine, by number from 0, that never arrive.
    pub drop_received: Vec<u64>,
    /// Bytes to the machine, by number, and the bits that arrive flipped.
    pub corrupt_sent: Vec<(u64, u8)>,
    /// Bytes from the machine, by number, and the bits that arrive flipped.
    pub corrupt_received: Vec<(u64, u8)>,
    /// Replies come late, by a random time up to this, s, and in random pieces.
    pub late_s: f64,
    /// Seed of that randomness.
    pub seed: u64,
}

/// A [`Transport`] to a [`Controller`] in the same process, on the controller's virtual clock.
#[derive(Clone, Debug)]
pub struct SimTransport {
    controller: Controller,
    faults: Faults,
    random: Random,
    sent: u64,
    received: u64,
    cut: bool,
    scratch: Vec<u8>,
    /// Bytes at the host, not yet read by it.
    inbox: Vec<u8>,
    taken: usize,
    /// Until then replies linger on the line.
    late_until_s: f64,
}

impl SimTransport {
    /// A faultless line to this controller.
    pub fn new(controller: Controller) -> Self {
        Self::with_faults(controller, Faults::default())
    }

    /// A line with faults.
    pub fn with_faults(controller: Controller, faults: Faults) -> Self {
        Self {
            controller,
            random: Random::new(faults.seed),
            faults,
            sent: 0,
            received: 0,
            cut: false,
            scratch: Vec::new(),
            inbox: Vec::new(),
            taken: 0,
            late_until_s: 0.0,
        }
    }

    /// The machine at the other end.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// The machine at the other end, to be advanced or told by hand.
    pub fn controller_mut(&mut self) -> &mut Controller {
        &mut self.controller
    }

    /// The machine at the other end, once the line is done with.
    pub fn into_controller(self) -> Controller {
        self.controller
    }

    /// Bytes sent and received so far.
    pub fn traffic(&self) -> (u64, u64) {
        (self.sent, self.received)
    }

    /// True once the cable has been pulled.
    pub fn is_cut(&self) -> bool {
        self.cut
    }

    fn lost(&self) -> io::Error {
        io::Error::new(io::ErrorKind::BrokenPipe, "the cable was pulled")
    }

    fn check_time(&mut self) {
        if self
            .faults
            .cut_at_s
            .is_some_and(|at| self.controller.now_s() >= at)
        {
            self.cut = true;
        }
    }

    /// Moves what the machine has said to the host's side, faults applied.
    fn collect(&mut self) {
        self.scratch.clear();
        self.controller.read(&mut self.scratch);
        for &byte in &self.scratch {
            let number = self.received;
            if self.faults.cut_after_received.is_some_and(|n| number >= n) {
                self.cut = true;
                return;
            }
            self.received += 1;
            if self.faults.drop_received.contains(&number) {
                continue;
            }
            let flip = flips(&self.faults.corrupt_received, number);
            self.inbox.push(byte ^ flip);
        }
        if !self.scratch.is_empty() && self.faults.late_s > 0.0 {
            let late = self.random.unit() * self.faults.late_s;
            self.late_until_s = self.late_until_s.max(self.controller.now_s() + late);
        }
    }

    fn waiting(&self) -> usize {
        self.inbox.len() - self.taken
    }
}

fn flips(list: &[(u64, u8)], number: u64) -> u8 {
    list.iter()
        .filter(|(n, _)| *n == number)
        .fold(0, |a, (_, bits)| a ^ bits)
}

impl Transport for SimTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.check_time();
        if self.cut {
            return Err(self.lost());
        }
        for &byte in bytes {
            let number = self.sent;
            if self.faults.cut_after_sent.is_some_and(|n| number >= n) {
                // As with a real port: the write succeeds, and only the next call tells.
                self.cut = true;
                return Ok(());
            }
            self.sent += 1;
            if !self.faults.drop_sent.contains(&number) {
                let flip = flips(&self.faults.corrupt_sent, number);
                self.controller.write(&[byte ^ flip]);
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        let deadline = self.controller.now_s() + wait.as_secs_f64();
        loop {
            self.check_time();
            if self.cut {
                return Err(self.lost());
            }
            self.collect();
            let now = self.controller.now_s();
            if self.waiting() > 0 && now >= self.late_until_s {
                let mut count = self.waiting().min(buffer.len());
                if self.faults.late_s > 0.0 && count > 1 {
                    #[expect(clippy::cast_possible_truncation, reason = "a remainder below count")]
                    let piece = 1 + (self.random.bits() % count as u64) as usize;
                    count = piece;
                }
                buffer[..count].copy_from_slice(&self.inbox[self.taken..self.taken + count]);
                self.taken += count;
                if self.waiting() == 0 {
                    self.inbox.clear();
                    self.taken = 0;
                }
                return Ok(count);
            }
            if now >= deadline {
                return Ok(0);
            }
            let mut next = deadline;
            if self.waiting() > 0 {
                next = next.min(self.late_until_s);
            } else if let Some(event) = self.controller.next_event_s() {
                next = next.min(event);
            }
            if let Some(cut) = self.faults.cut_at_s.filter(|&cut| cut > now) {
                next = next.min(cut);
            }
            self.controller.advance(next);
        }
    }

    fn now(&self) -> Duration {
        Duration::try_from_secs_f64(self.controller.now_s()).unwrap_or_default()
    }

    fn name(&self) -> &str {
        "the simulated machine"
    }
}
