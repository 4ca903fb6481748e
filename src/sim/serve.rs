//! The simulated machine at the end of a line to other programs: its clock follows the wall, or runs as fast as it is
//! fed.

use std::time::{Duration, Instant};

use super::controller::Controller;

/// How to serve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Serve {
    /// The machine's seconds per second of the wall; none for as fast as the other side feeds it.
    pub speed: Option<f64>,
    /// End when the other side has closed the port and the machine has come to rest.
    pub once: bool,
    /// Start anew whenever the port is opened, as boards do whose reset hangs on DTR.
    pub reset_on_open: bool,
}

impl Default for Serve {
    fn default() -> Self {
        Self {
            speed: Some(1.0),
            once: false,
            reset_on_open: true,
        }
    }
}

/// How long the wall waits for bytes at a time.
pub(super) const WAIT: Duration = Duration::from_millis(2);
/// How far the machine may run ahead between two looks at the line, s, when it goes as fast as it can.
const STRIDE_S: f64 = 0.05;

/// What was heard on a line.
pub(super) enum Heard {
    /// So many bytes from somebody who is there; zero if silent.
    Bytes(usize),
    /// Nobody is there.
    Nobody,
}

/// A line to one other program at a time.
pub(super) trait Port {
    /// Waits at most [`WAIT`] for bytes.
    fn hear(&mut self, buffer: &mut [u8]) -> Heard;
    /// False if nobody is there to read.
    fn say(&mut self, bytes: &[u8]) -> bool;
}

/// Runs the machine on this line until `stop` says so, or as [`Serve::once`] says.
pub(super) fn run(
    port: &mut impl Port,
    controller: &mut Controller,
    how: Serve,
    mut stop: impl FnMut(&Controller) -> bool,
) {
    let mut clock = Instant::now();
    let mut connected = false;
    let mut ever = false;
    let mut buffer = [0; 4096];
    let mut out = Vec::new();
    while !stop(controller) {
        let heard = match port.hear(&mut buffer) {
            Heard::Bytes(count) => {
                if !connected {
                    (connected, ever) = (true, true);
                    controller.port_opened(how.reset_on_open);
                }
                controller.write(&buffer[..count]);
                count > 0
            }
            Heard::Nobody => {
                connected = false;
                std::thread::sleep(WAIT);
                false
            }
        };
        if !connected && ever && how.once && controller.at_rest() {
            return;
        }
        match how.speed {
            Some(speed) => {
                let passed = clock.elapsed();
                clock += passed;
                let until = controller.now_s() + passed.as_secs_f64() * speed;
                controller.advance(until);
            }
            // Time goes by only while the machine has work, or the line has been silent for a while.
            None => hurry(controller, heard, connected),
        }
        out.clear();
        controller.read(&mut out);
        if connected && !out.is_empty() && !port.say(&out) {
            connected = false;
        }
    }
}

fn hurry(controller: &mut Controller, heard: bool, connected: bool) {
    let stride = controller.now_s() + STRIDE_S;
    if controller.hungry() && connected && heard {
        return;
    }
    // Up to the first moment at which the other side has something to read.
    while controller.now_s() < stride {
        let next = controller.next_event_s().unwrap_or(stride).min(stride);
        controller.advance(next);
        if controller.has_output() {
            return;
        }
    }
}
