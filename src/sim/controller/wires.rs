//! The two directions of the line: bytes take time, and what finds the receive buffer full is lost.

use super::{Controller, Life, State};

impl Controller {
    /// Puts bytes on the wire, behind those already there.
    pub fn write(&mut self, bytes: &[u8]) {
        self.write_late(bytes, 0.0);
    }

    /// The same for bytes that linger on the way for this long, s; those behind them wait. Gives the time at which
    /// the last of them arrives.
    pub(in crate::sim) fn write_late(&mut self, bytes: &[u8], late_s: f64) -> f64 {
        let byte_s = self.byte_s();
        self.incoming_free_s = self.incoming_free_s.max(self.now_s + late_s);
        for &byte in bytes {
            self.incoming_free_s += byte_s;
            // Nobody is there to hear it.
            if self.life == Life::Running {
                self.incoming.push_back((self.incoming_free_s, byte));
            }
        }
        self.incoming_free_s
    }

    /// Takes what has arrived at the host by now; `into` is appended to.
    pub fn read(&mut self, into: &mut Vec<u8>) {
        while let Some((arrival_s, _)) = self.outgoing.front()
            && *arrival_s <= self.now_s
        {
            if let Some((_, bytes)) = self.outgoing.pop_front() {
                into.extend_from_slice(&bytes);
            }
        }
    }

    /// True if something has arrived at the host by now and was not read.
    pub fn has_output(&self) -> bool {
        self.outgoing
            .front()
            .is_some_and(|(at, _)| *at <= self.now_s)
    }

    pub(super) fn byte_s(&self) -> f64 {
        self.settings.baud.map_or(0.0, |baud| 10.0 / baud.max(1.0))
    }

    pub(super) fn say(&mut self, text: &str) {
        let mut bytes = Vec::with_capacity(text.len() + 2);
        bytes.extend_from_slice(text.as_bytes());
        bytes.extend_from_slice(b"\r\n");
        #[expect(clippy::cast_precision_loss, reason = "a line of text")]
        let wire_s = bytes.len() as f64 * self.byte_s();
        self.outgoing_free_s = self.outgoing_free_s.max(self.now_s) + wire_s;
        self.outgoing.push_back((self.outgoing_free_s, bytes));
    }

    /// A message for a person.
    pub(super) fn message(&mut self, text: &str) {
        let text = self.settings.flavour.message(text);
        self.say(&text);
    }

    /// The receive interrupt: realtime bytes act at once, the others wait in the buffer, or are lost.
    pub(super) fn arrive(&mut self, byte: u8) {
        if self.now_s < self.deaf_until_s {
            self.lost_bytes += 1;
            return;
        }
        if self.state == State::Sleep && !matches!(byte, 0x18 | b'?' | 0x84) {
            return;
        }
        match byte {
            0x18 => self.soft_reset(),
            b'?' => self.report_wanted = true,
            b'!' => self.hold(false),
            b'~' => self.resume(),
            0x84 => self.hold(true),
            0x85 => self.cancel_jog(),
            0x90..=0x9d => self.override_byte(byte),
            0x9e => self.spindle_stop(),
            0xa0 => self.toggle_flood(),
            // Whatever else is not text: taken out of the stream, as the firmware does.
            0x80..=0xff => {}
            _ if self.receive_free() == 0 => self.lost_bytes += 1,
            _ => self.receive.push_back(byte),
        }
    }

    /// Bytes for which the receive buffer has room.
    pub(super) fn receive_free(&self) -> usize {
        let usable = self.settings.flavour.usable(self.settings.receive_buffer);
        usable.saturating_sub(self.receive.len())
    }
}
