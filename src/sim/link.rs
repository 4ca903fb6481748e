//! The simulated machine at the end of a line that can fail.

use std::io;
use std::time::Duration;

use super::controller::Controller;
use super::faults::{At, Faults, Mishap, flips};
use crate::base::random::Random;
use crate::control::Transport;

/// A [`Transport`] to a [`Controller`] in the same process, on the controller's virtual clock.
///
/// The machine outlives the line: [`SimTransport::into_controller`] gives it back with everything that was burnt, and
/// [`Controller::port_opened`] prepares it for the next line.
#[derive(Clone, Debug)]
pub struct SimTransport {
    controller: Controller,
    faults: Faults,
    random: Random,
    sent: u64,
    received: u64,
    cut: bool,
    /// Mishaps whose time is known, in their order.
    due: Vec<(f64, Mishap)>,
    struck: Vec<(f64, Mishap)>,
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
        let now_s = controller.now_s();
        let due = faults.mishaps.iter().filter_map(|&(at, mishap)| match at {
            At::Time(at_s) => Some((at_s, mishap)),
            At::Sent(0) | At::Received(0) => Some((now_s, mishap)),
            _ => None,
        });
        Self {
            controller,
            random: Random::new(faults.seed),
            due: due.collect(),
            faults,
            sent: 0,
            received: 0,
            cut: false,
            struck: Vec::new(),
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

    /// What has happened so far, and when, s.
    pub fn struck(&self) -> &[(f64, Mishap)] {
        &self.struck
    }

    /// Mishaps whose time has come.
    fn strike_due(&mut self) {
        let now_s = self.controller.now_s();
        while let Some(k) = self.due.iter().position(|(at_s, _)| *at_s <= now_s) {
            let (_, mishap) = self.due.remove(k);
            self.strike(mishap);
        }
    }

    fn strike(&mut self, mishap: Mishap) {
        self.struck.push((self.controller.now_s(), mishap));
        self.cut |= mishap == Mishap::Unplug;
        self.controller.suffer(mishap);
    }

    /// Those whose moment is this one.
    fn mishaps_at(&self, is: impl Fn(At) -> bool) -> Vec<Mishap> {
        let list = self.faults.mishaps.iter();
        list.filter(|(at, _)| is(*at)).map(|(_, m)| *m).collect()
    }

    /// Moves what the machine has said to the host's side, faults applied.
    fn collect(&mut self) {
        self.scratch.clear();
        self.controller.read(&mut self.scratch);
        if self.scratch.is_empty() {
            return;
        }
        let now_s = self.controller.now_s();
        if self.faults.gather_s > 0.0 {
            let next_s = (now_s / self.faults.gather_s).ceil() * self.faults.gather_s;
            self.late_until_s = self.late_until_s.max(next_s);
        }
        if self.faults.late_s > 0.0 {
            let late = self.random.unit() * self.faults.late_s;
            self.late_until_s = self.late_until_s.max(now_s + late);
        }
        let said = std::mem::take(&mut self.scratch);
        for &byte in &said {
            let number = self.received;
            self.received += 1;
            let flipped = byte ^ flips(&self.faults.corrupt_received, number);
            if !self.faults.drop_received.contains(&number) {
                self.inbox.push(flipped);
            }
            if self.faults.duplicate_received.contains(&number) {
                self.inbox.push(flipped);
            }
            let count = self.received;
            let mishaps = self.mishaps_at(|at| at == At::Received(count));
            for &mishap in &mishaps {
                self.strike(mishap);
            }
            // The rest is never said, or goes nowhere.
            if mishaps.iter().any(|m| *m != Mishap::LimitSwitch) {
                break;
            }
        }
        self.scratch = said;
    }

    fn waiting(&self) -> usize {
        self.inbox.len() - self.taken
    }
}

impl Transport for SimTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.strike_due();
        if self.cut {
            return Err(self.lost());
        }
        let mut late_s = if self.faults.late_sent_s > 0.0 {
            self.random.unit() * self.faults.late_sent_s
        } else {
            0.0
        };
        let mut arrival_s = self.controller.now_s();
        for &byte in bytes {
            let number = self.sent;
            self.sent += 1;
            let copies = [byte ^ flips(&self.faults.corrupt_sent, number); 2];
            let many = usize::from(!self.faults.drop_sent.contains(&number))
                + usize::from(self.faults.duplicate_sent.contains(&number));
            if many > 0 {
                arrival_s = self.controller.write_late(&copies[..many], late_s);
                late_s = 0.0;
            }
            let count = self.sent;
            for mishap in self.mishaps_at(|at| at == At::Sent(count)) {
                if mishap == Mishap::Unplug {
                    self.strike(mishap);
                } else {
                    self.due.push((arrival_s, mishap));
                }
            }
            if self.cut {
                // As with a real port: the write succeeds, and only the next call tells.
                return Ok(());
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        let deadline = self.controller.now_s() + wait.as_secs_f64();
        loop {
            self.strike_due();
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
            for (at_s, _) in &self.due {
                next = next.min(at_s.max(now));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{Burn, Life, Settings, State};

    fn machine() -> Controller {
        let mut machine = Controller::new(Settings::default());
        machine.advance(0.1);
        machine.port_opened(false);
        machine
    }

    fn text(link: &mut SimTransport, seconds: f64) -> String {
        let until = link.now() + Duration::from_secs_f64(seconds);
        let mut said = Vec::new();
        let mut buffer = [0; 64];
        while link.now() < until {
            match link.receive(&mut buffer, until.saturating_sub(link.now())) {
                Ok(count) => said.extend_from_slice(&buffer[..count]),
                Err(_) => break,
            }
        }
        String::from_utf8_lossy(&said).into_owned()
    }

    const JOB: &[u8] = b"G21G90\nM4S500\nG1F3000\nG0X10\nG1X60\nG1Y50\n";

    fn ends(burns: &[Burn]) -> [f64; 2] {
        burns.last().map_or([f64::NAN; 2], |b| b.to_mm)
    }

    #[test]
    fn a_machine_survives_its_cable_and_is_reached_through_another() {
        let faults = Faults::one(At::Sent(JOB.len() as u64), Mishap::Unplug);
        let mut link = SimTransport::with_faults(machine(), faults);
        link.send(JOB).unwrap();
        assert!(link.send(b"?").is_err() && link.receive(&mut [0; 9], Duration::ZERO).is_err());
        let mut machine = link.into_controller();
        assert!(machine.run_out(60.0));
        assert_eq!(ends(&machine.burns()), [60.0, 50.0]);
        // Without a reset on opening, it still knows where it is, and nothing that it said to nobody comes.
        machine.port_opened(false);
        let mut link = SimTransport::new(machine);
        assert_eq!(text(&mut link, 1.0), "");
        link.send(b"?").unwrap();
        assert!(text(&mut link, 0.2).contains("<Idle|MPos:60.000,50.000,0.000"));
        let mut machine = link.into_controller();
        machine.port_opened(true);
        let mut link = SimTransport::new(machine);
        link.send(b"?").unwrap();
        let said = text(&mut link, 0.2);
        assert!(said.starts_with("\r\nGrbl 1.1h"), "{said}");
        assert!(said.contains("MPos:0.000,0.000,0.000"), "{said}");
        assert_eq!(link.controller().head_mm(), [60.0, 50.0, 0.0]);
    }

    #[test]
    fn power_loss_is_silence_and_what_was_burnt_and_set_remains() {
        let before = b"$30=900\n";
        let settings = b"G0X5\nG4P0\nG10L20P1X0Y0\n";
        let mut link = SimTransport::new(machine());
        link.send(before).unwrap();
        text(&mut link, 1.0);
        link.send(settings).unwrap();
        text(&mut link, 2.0);
        let mut link = SimTransport::with_faults(
            link.into_controller(),
            Faults {
                mishaps: vec![
                    (At::Time(4.0), Mishap::PowerLoss),
                    (At::Time(9.0), Mishap::PowerReturns([-3.0, 2.0, 0.0])),
                ],
                ..Faults::default()
            },
        );
        link.send(JOB).unwrap();
        text(&mut link, 1.0);
        assert_eq!(link.struck(), [(4.0, Mishap::PowerLoss)]);
        assert_eq!(link.controller().life(), Life::Off);
        assert!(!link.controller().beam_on());
        let burnt = link.controller().burns();
        assert!(ends(&burnt)[0] < 64.0, "in the middle of a cut");
        link.send(b"?").unwrap();
        assert_eq!(text(&mut link, 2.0), "");
        let head = link.controller().head_mm();
        let said = text(&mut link, 5.0);
        assert!(said.starts_with("\r\nGrbl 1.1h"), "{said}");
        let machine = link.controller();
        assert_eq!(machine.burns(), burnt);
        assert_eq!(machine.position_mm(), [0.0; 3]);
        assert_eq!(machine.head_mm(), [head[0] - 3.0, head[1] + 2.0, head[2]]);
        assert_eq!(machine.settings().s_max, 900.0);
        link.send(b"$#\n").unwrap();
        assert!(text(&mut link, 0.5).contains("[G54:5.000,0.000,0.000]"));
    }

    #[test]
    fn a_mishap_comes_when_its_byte_has_arrived_and_not_before() {
        for (mishap, banner) in [
            (Mishap::Reboot, true),
            (Mishap::PowerLoss, false),
            (Mishap::Hang, false),
        ] {
            for at in 1..=JOB.len() as u64 {
                let mut link =
                    SimTransport::with_faults(machine(), Faults::one(At::Sent(at), mishap));
                link.send(JOB).unwrap();
                let said = text(&mut link, 10.0);
                let wanted_s = 0.1 + at as f64 * 10.0 / 115_200.0;
                assert!((link.struck()[0].0 - wanted_s).abs() < 1e-9);
                assert_eq!(said.contains("Grbl"), banner, "{at}: {said}");
                assert!(!said.contains("ALARM") && !link.controller().beam_on());
            }
        }
        let mut link =
            SimTransport::with_faults(machine(), Faults::one(At::Received(6), Mishap::Hang));
        link.send(JOB).unwrap();
        assert_eq!(text(&mut link, 10.0), "ok\r\nok");
    }

    #[test]
    fn a_hang_in_a_cut_leaves_the_beam_on_until_the_controller_is_reset_by_its_line() {
        let mut link =
            SimTransport::with_faults(machine(), Faults::one(At::Time(1.0), Mishap::Hang));
        link.send(JOB).unwrap();
        text(&mut link, 2.0);
        assert_eq!(link.controller().life(), Life::Hung);
        assert!(link.controller().beam_on());
        link.send(&[0x18, b'?', 0x84]).unwrap();
        assert_eq!(text(&mut link, 2.0), "");
        assert!(link.controller().burns().last().unwrap().standing());
        let mut machine = link.into_controller();
        machine.port_opened(true);
        assert!(!machine.beam_on());
        assert_eq!(
            (machine.life(), machine.state()),
            (Life::Running, State::Idle)
        );
    }

    #[test]
    fn a_limit_switch_stops_dark_and_deafens_until_a_reset() {
        let fault = Faults::one(At::Time(1.0), Mishap::LimitSwitch);
        let mut link = SimTransport::with_faults(machine(), fault);
        link.send(JOB).unwrap();
        let said = text(&mut link, 1.0);
        assert!(
            said.ends_with("ALARM:1\r\n[MSG:Reset to continue]\r\n"),
            "{said}"
        );
        assert!(!link.controller().beam_on());
        link.send(b"?").unwrap();
        assert_eq!(text(&mut link, 1.0), "");
        link.send(&[0x18]).unwrap();
        assert!(text(&mut link, 0.3).contains("to unlock"));
    }

    #[test]
    fn a_stop_in_motion_costs_the_position_and_homing_gives_it_back() {
        let mut machine = Controller::new(Settings {
            homing: true,
            homing_seek_mm_min: 60_000.0,
            ..Settings::default()
        });
        machine.write(b"$H\n");
        machine.advance(10.0);
        machine.write(b"G21G91\nG0X-100\n");
        machine.advance(10.8);
        machine.write(&[0x18]);
        machine.advance(11.0);
        // 100 mm/s at 500 mm/s²: 10 mm to brake.
        let lost = machine.head_mm()[0] - machine.position_mm()[0];
        assert!((lost + 10.0).abs() < 1e-6, "{lost}");
        machine.write(b"$H\n");
        machine.advance(22.0);
        assert_eq!(machine.head_mm(), machine.position_mm());
    }

    #[test]
    fn bytes_come_twice_late_and_gathered_when_told_to() {
        let faults = Faults {
            duplicate_sent: vec![2],
            duplicate_received: vec![0, 1],
            ..Faults::default()
        };
        let mut link = SimTransport::with_faults(machine(), faults);
        link.send(b"G0X1\n").unwrap();
        assert_eq!(text(&mut link, 1.0), "eerrror:2\r\n");

        let faults = Faults {
            gather_s: 0.5,
            ..Faults::default()
        };
        let mut link = SimTransport::with_faults(machine(), faults);
        link.send(b"G21\nG90\n\n").unwrap();
        let mut buffer = [0; 64];
        assert_eq!(
            link.receive(&mut buffer, Duration::from_millis(399))
                .unwrap(),
            0
        );
        assert_eq!(
            link.receive(&mut buffer, Duration::from_millis(399))
                .unwrap(),
            12
        );
        assert_eq!(link.now(), Duration::from_millis(500));

        let faults = Faults {
            late_sent_s: 0.4,
            seed: 3,
            ..Faults::default()
        };
        let mut link = SimTransport::with_faults(machine(), faults);
        link.send(b"G21\n").unwrap();
        assert_eq!(text(&mut link, 0.01), "");
        assert_eq!(text(&mut link, 0.5), "ok\r\n");
    }
}
