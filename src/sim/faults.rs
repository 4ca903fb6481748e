//! What can go wrong between a sender and its machine, on command.

#[cfg(doc)]
use super::controller::Controller;

/// When something goes wrong. Bytes are counted from when the line was opened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum At {
    /// As soon as this many bytes have arrived at the machine.
    Sent(u64),
    /// As soon as the machine has said this many bytes.
    Received(u64),
    /// At this time on the machine's clock, s.
    Time(f64),
}

/// What happens to the machine, or to the whole line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mishap {
    /// The cable is pulled: the machine goes on with what it has.
    Unplug,
    /// [`Controller::power_off`]. The line stays open, as where the adapter is fed by the host; together with
    /// [`Self::Unplug`] it does not.
    PowerLoss,
    /// [`Controller::power_on`], with how far the head was moved meanwhile, mm.
    PowerReturns([f64; 3]),
    /// [`Controller::reboot`].
    Reboot,
    /// [`Controller::hang`].
    Hang,
    /// [`Controller::limit_switch`].
    LimitSwitch,
}

/// What goes wrong with the line, on command. Counts are of bytes since the line was opened.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// What happens, and when; several at one moment happen in this order.
    pub mishaps: Vec<(At, Mishap)>,
    /// Bytes to the machine, by number from 0, that never arrive.
    pub drop_sent: Vec<u64>,
    /// Bytes from the machine, by number from 0, that never arrive.
    pub drop_received: Vec<u64>,
    /// Bytes to the machine, by number from 0, that arrive twice.
    pub duplicate_sent: Vec<u64>,
    /// Bytes from the machine, by number from 0, that arrive twice.
    pub duplicate_received: Vec<u64>,
    /// Bytes to the machine, by number, and the bits that arrive flipped.
    pub corrupt_sent: Vec<(u64, u8)>,
    /// Bytes from the machine, by number, and the bits that arrive flipped.
    pub corrupt_received: Vec<(u64, u8)>,
    /// Replies come late, by a random time up to this, s, and in random pieces.
    pub late_s: f64,
    /// Each piece written to the machine sets out late, by a random time up to this, s.
    pub late_sent_s: f64,
    /// Replies come only at whole multiples of this time, s, all since the last at once, as from adapters that gather
    /// what they hear; zero for none.
    pub gather_s: f64,
    /// Seed of that randomness.
    pub seed: u64,
}

impl Faults {
    /// One mishap, on an otherwise perfect line.
    pub fn one(at: At, mishap: Mishap) -> Self {
        Self {
            mishaps: vec![(at, mishap)],
            ..Self::default()
        }
    }
}

/// The bits that are flipped in this byte.
pub(crate) fn flips(list: &[(u64, u8)], number: u64) -> u8 {
    list.iter()
        .filter(|(n, _)| *n == number)
        .fold(0, |a, (_, bits)| a ^ bits)
}
