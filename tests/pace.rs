//! What proofs cost, and how fast lines go out, on the simulated machine's clock.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail by panicking")]

use std::collections::VecDeque;
use std::sync::Mutex;
use std::time::Duration;

use kagome::base::progress::{Progress, Silent};
use kagome::control::journal::{Header, Journal, MemoryStore};
use kagome::control::{
    Cuts, Glance, Job, JobRules, Operator, SendOptions, Streaming, Transport, send, send_recorded,
};
use kagome::machine;
use kagome::sim::{Controller, Settings, SimTransport, estimate};

fn checked(text: &str) -> Job {
    Job::check(text.as_bytes(), &JobRules::default()).unwrap()
}

/// Seconds that a job takes with at most so many unconfirmed cuts; without a limit if none.
fn time_s(job: &Job, settings: &Settings, ahead: Option<usize>) -> f64 {
    let mut link = SimTransport::new(Controller::homed_at_zero(settings.clone()));
    let options = SendOptions {
        buffer: Some(settings.receive_buffer),
        ..SendOptions::default()
    };
    let report = match ahead {
        None => send(&mut link, job, &options, &Silent).unwrap(),
        Some(ahead) => {
            let cuts = Cuts::of(job).unwrap();
            let header = Header::of(job, &cuts, "job.nc", "", ahead);
            let mut journal = Journal::new(header, MemoryStore::default());
            send_recorded(&mut link, job, &cuts, &options, &Silent, &mut journal).unwrap()
        }
    };
    assert_eq!(report.acknowledged, job.len());
    assert_eq!(link.controller().lost_bytes(), 0);
    report.time_s
}

/// Labels of small strokes, then slits of 3 mm at 2 mm from each other: what a fine sheet looks like.
fn sheet(labels: usize, slits: usize, feed: u32) -> String {
    let mut text = String::from("G21G90\nM8\nM4S0\n");
    for k in 0..labels {
        let (x, y) = ((k % 10) as f64 * 9.0 + 5.0, (k / 10) as f64 * 9.0 + 5.0);
        for stroke in 0..6 {
            let x = x + f64::from(stroke) * 0.6;
            text.push_str(&format!(
                "G0X{x:.3}Y{y:.3}\nG1Y{:.3}F6000S80\nX{:.3}\n",
                y + 0.9,
                x + 0.3
            ));
        }
    }
    for k in 0..slits {
        let (x, y) = ((k % 30) as f64 * 4.0 + 5.0, (k / 30) as f64 * 4.0 + 5.0);
        let angle = (k % 3) as f64 * std::f64::consts::FRAC_PI_3;
        text.push_str(&format!("G0X{x:.3}Y{y:.3}\n"));
        text.push_str(&format!(
            "G1X{:.3}Y{:.3}F{feed}S300\n",
            x + 3.0 * angle.cos(),
            y + 3.0 * angle.sin()
        ));
    }
    text + "M5\nG0X0Y0\nM2\n"
}

fn overhead(name: &str, job: &Job, settings: &Settings) -> [f64; 3] {
    let free = time_s(job, settings, None);
    [1, 2, 3].map(|ahead| {
        let percent = 100.0 * (time_s(job, settings, Some(ahead)) / free - 1.0);
        println!("{name}: {free:.1} s; at most {ahead} unconfirmed: {percent:+.2} %");
        percent
    })
}

#[test]
fn proofs_cost_less_than_three_per_cent() {
    for name in ["co2-600x400", "diode-400", "diode-400-fluidnc"] {
        let settings = Settings::of_machine(&machine::load(name).unwrap());
        for feed in [1500, 6000] {
            let job = checked(&sheet(20, 200, feed));
            let [one, _, three] = overhead(&format!("{name} F{feed}"), &job, &settings);
            assert!(three < 3.0, "{name}: {three} %");
            assert!(one < 25.0, "{name}: {one} %");
        }
    }
}

/// For a job of one's own: `KAGOME_JOB=job.nc KAGOME_MACHINE=co2-600x400`.
#[test]
#[ignore = "needs a job: KAGOME_JOB"]
fn proofs_on_a_job_from_outside() {
    let text = std::fs::read_to_string(std::env::var("KAGOME_JOB").unwrap()).unwrap();
    let name = std::env::var("KAGOME_MACHINE").unwrap_or("co2-600x400".into());
    let settings = Settings::of_machine(&machine::load(&name).unwrap());
    let job = checked(&text);
    println!(
        "{} lines, {} cuts",
        job.len(),
        Cuts::of(&job).unwrap().len()
    );
    let [_, _, three] = overhead(&name, &job, &settings);
    assert!(three < 3.0);
}

/// Short moves that ask for more lines than the firmware reads: the line goes as fast as it can.
#[test]
fn lines_go_out_as_fast_as_the_firmware_reads_them() {
    let mut text = String::from("G21G90\nM4S500\nG1F20000\n");
    for k in 0..4000u32 {
        let angle = f64::from(k) * 0.01;
        text.push_str(&format!(
            "X{:.3}Y{:.3}\n",
            60.0 + 20.0 * angle.cos(),
            60.0 + 20.0 * angle.sin()
        ));
    }
    text.push_str("M5\nM2\n");
    let job = checked(&text);
    let settings = Settings {
        max_rate_mm_min: [30_000.0; 3],
        acceleration_mm_s2: [5000.0; 3],
        ..Settings::default()
    };
    let bytes: usize = job.lines().map(|(line, _)| line.len() + 1).sum();
    let least = bytes as f64 * settings.byte_time_s;
    let best = estimate(&text, &settings).unwrap().time_s;
    let counted = time_s(&job, &settings, None);
    let recorded = time_s(&job, &settings, Some(3));
    let mut link = SimTransport::new(Controller::new(settings.clone()));
    let options = SendOptions {
        streaming: Streaming::Answered,
        ..SendOptions::default()
    };
    let answered = send(&mut link, &job, &options, &Silent).unwrap();
    assert_eq!(
        answered.max_in_flight,
        job.lines().map(|(l, _)| l.len() + 1).max().unwrap()
    );
    let rate = |s: f64| job.len() as f64 / s;
    println!(
        "lines a second: the firmware reads {:.0}, counted {:.0} (recorded {:.0}), one by one {:.0}; best time {best:.2} s",
        rate(least),
        rate(counted),
        rate(recorded),
        rate(answered.time_s)
    );
    assert!(
        counted <= least.max(best) / 0.98,
        "{counted} {least} {best}"
    );
    assert!(recorded <= least.max(best) / 0.98);
    assert!(answered.time_s > 1.2 * counted);
}

/// A controller whose reports are of no use while it moves.
#[derive(Clone, Copy, Debug)]
enum Coarse {
    /// They tell where it stood last.
    OldWhileMoving,
    /// They tell whole millimetres.
    WholeMillimetres,
    /// The same, with decimals that mean nothing.
    FalseDecimals,
}

struct CoarseLine<'a> {
    link: &'a Mutex<SimTransport>,
    coarse: Coarse,
    line: Vec<u8>,
    ready: VecDeque<u8>,
    last: String,
}

impl CoarseLine<'_> {
    fn spoil(&mut self) -> String {
        let line = String::from_utf8(std::mem::take(&mut self.line)).unwrap();
        let Some((before, rest)) = line.split_once("MPos:") else {
            return line;
        };
        let (place, after) = rest.split_once('|').unwrap();
        let told = match self.coarse {
            Coarse::OldWhileMoving if before.starts_with("<Run") => self.last.clone(),
            Coarse::OldWhileMoving => place.to_owned(),
            Coarse::WholeMillimetres | Coarse::FalseDecimals => {
                let decimals = 3 * usize::from(matches!(self.coarse, Coarse::FalseDecimals));
                let rounded = place.split(',').map(|v| v.parse::<f64>().unwrap().round());
                rounded
                    .map(|v| format!("{v:.decimals$}"))
                    .collect::<Vec<_>>()
                    .join(",")
            }
        };
        self.last.clone_from(&told);
        format!("{before}MPos:{told}|{after}")
    }
}

impl Transport for CoarseLine<'_> {
    fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.link.lock().unwrap().send(bytes)
    }
    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> std::io::Result<usize> {
        if self.ready.is_empty() {
            let mut heard = [0; 256];
            let n = self.link.lock().unwrap().receive(&mut heard, wait)?;
            for byte in &heard[..n] {
                self.line.push(*byte);
                if *byte == b'\n' {
                    let line = self.spoil();
                    self.ready.extend(line.bytes());
                }
            }
        }
        let n = buffer.len().min(self.ready.len());
        for (into, byte) in buffer.iter_mut().zip(self.ready.drain(..n)) {
            *into = byte;
        }
        Ok(n)
    }
    fn now(&self) -> Duration {
        self.link.lock().unwrap().now()
    }
    fn name(&self) -> &str {
        "a coarse controller"
    }
}

/// Sees that no cut counts before it is made.
struct Truth<'a>(&'a Mutex<SimTransport>);

impl Progress for Truth<'_> {}
impl Operator for Truth<'_> {
    fn glance(&self, glance: &Glance<'_>) {
        let link = self.0.lock().unwrap();
        let machine = link.controller();
        let made = machine.burns().len() - usize::from(machine.beam_on());
        assert!(glance.cuts <= made, "{} proven, {made} made", glance.cuts);
    }
}

/// Where reports are too coarse to prove cuts by the way, the machine is let come to rest, and that proves them: as exact as
/// a dwell (`G4 P0.01`) behind every so many cuts would be, and cheaper.
#[test]
fn coarse_reports_cost_time_and_no_proof() {
    for feed in [1500, 6000] {
        let text = sheet(0, 200, feed);
        let job = checked(&text);
        let cuts = Cuts::of(&job).unwrap();
        let settings = Settings::default();
        let free = time_s(&job, &settings, None);
        for ahead in [1usize, 3, 10] {
            let mut dwelling = String::new();
            let mut k = 0;
            for line in text.lines() {
                dwelling.push_str(line);
                dwelling.push('\n');
                if line.contains('S') && line.starts_with("G1") {
                    k += 1;
                    if k % ahead == 0 {
                        dwelling.push_str("G4P0.01\n");
                    }
                }
            }
            let dwells = time_s(&checked(&dwelling), &settings, None);
            for coarse in [
                Coarse::OldWhileMoving,
                Coarse::WholeMillimetres,
                Coarse::FalseDecimals,
            ] {
                let link = Mutex::new(SimTransport::new(Controller::new(settings.clone())));
                let mut line = CoarseLine {
                    link: &link,
                    coarse,
                    line: Vec::new(),
                    ready: VecDeque::new(),
                    last: "0.000,0.000,0.000".into(),
                };
                let header = Header::of(&job, &cuts, "job.nc", "", ahead);
                let mut journal = Journal::new(header, MemoryStore::default());
                let report = send_recorded(
                    &mut line,
                    &job,
                    &cuts,
                    &SendOptions::default(),
                    &Truth(&link),
                    &mut journal,
                )
                .unwrap();
                assert_eq!(report.cuts, cuts.len());
                // As few seconds as dwells would cost, and a tenth more.
                assert!(report.time_s < 1.1 * dwells, "{} {dwells}", report.time_s);
                println!(
                    "F{feed}, {coarse:?}, at most {ahead}: at rest {:+.1} %, dwells {:+.1} %",
                    100.0 * (report.time_s / free - 1.0),
                    100.0 * (dwells / free - 1.0)
                );
            }
        }
    }
}
