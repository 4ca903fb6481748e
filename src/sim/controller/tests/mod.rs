//! What real controllers do, as measured, one test a fact.

mod flavours;
mod hands;
mod homing;
mod manners;
mod memory;
mod pace;
mod probe;
mod table;
mod torch;

use super::*;
use crate::sim::Flavour;

/// A machine and what it has said.
struct Bench {
    machine: Controller,
    said: Vec<u8>,
}

impl Bench {
    fn new(settings: Settings) -> Self {
        let mut bench = Self {
            machine: Controller::new(settings),
            said: Vec::new(),
        };
        bench.wait(0.1);
        bench.said.clear();
        bench
    }

    fn laser() -> Self {
        Self::new(Settings::default())
    }

    /// A torch: an output that is on or off, without laser mode.
    fn torch() -> Self {
        Self::torch_of(Flavour::Grbl)
    }

    fn torch_of(flavour: Flavour) -> Self {
        let settings = Settings {
            laser_mode: false,
            ..Settings::default()
        };
        Self::new(settings.with_flavour(flavour))
    }

    /// The next report.
    fn report(&mut self) -> String {
        self.raw(b'?', 0.01)
    }

    fn wait(&mut self, seconds: f64) -> String {
        let until = self.machine.now_s() + seconds;
        self.machine.advance(until);
        let mut new = Vec::new();
        self.machine.read(&mut new);
        self.said.extend_from_slice(&new);
        String::from_utf8(new).unwrap()
    }

    fn send(&mut self, text: &str, seconds: f64) -> String {
        self.machine.write(text.as_bytes());
        self.wait(seconds)
    }

    fn raw(&mut self, byte: u8, seconds: f64) -> String {
        self.machine.write(&[byte]);
        self.wait(seconds)
    }

    fn standing_s(&self) -> f64 {
        let burns = self.machine.burns();
        let standing = burns.iter().filter(|b| b.standing());
        standing.map(|b| b.end_s - b.start_s).sum()
    }
}

const M3: &str = "G21G90\nM3S500\nG1F3000\nG0X10\n";
const M4: &str = "G21G90\nM4S500\nG1F3000\nG0X10\n";
