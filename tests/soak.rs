//! A job of 100 000 lines, with a person who pauses and changes speed and power all the time, over a line whose answers come
//! late and in heaps: the ledger stays exact, and the sender's memory flat.

#![allow(clippy::unwrap_used, reason = "a helper that fails, fails its test")]

use std::io::BufRead as _;
use std::process::{Command, Stdio};
use std::sync::Mutex;

use kagome::base::progress::Progress;
use kagome::base::random::Random;
use kagome::control::journal::{Header, Journal, MemoryStore};
use kagome::control::{
    Change, Cuts, Glance, Job, JobRules, Operator, SendOptions, Wish, send_recorded,
};
use kagome::sim::{Controller, Faults, RehearsalSummary, Settings, SimTransport};

/// Slits of 3 mm in rows; two lines each.
const SLITS: usize = 50_000;
const SLIT_MM: f64 = 3.0;

fn job(slits: usize, slit_mm: f64) -> String {
    let mut text = String::from("G21 G90\nM5\nM4 S300\nF3000\n");
    for k in 0..slits {
        let (x, y) = ((k % 100) as f64 * 1.3 * slit_mm, (k / 100) as f64 * 0.2);
        text.push_str(&format!("G0 X{x:.3} Y{y:.3}\nG1 X{:.3}\n", x + slit_mm));
    }
    text + "M5\nG0 X0 Y0\nM2\n"
}

/// Wishes at random, and each pause is ended.
struct Restless(Mutex<(Random, bool, usize, usize)>);

impl Progress for Restless {}

impl Operator for Restless {
    fn wish(&self) -> Option<Wish> {
        let mut guard = self.0.lock().unwrap();
        let (random, paused, waited, wishes) = &mut *guard;
        if *paused {
            if *waited < 8 {
                return None;
            }
            *paused = false;
            return Some(Wish::Resume);
        }
        let change = [
            Change::Reset,
            Change::More,
            Change::Less,
            Change::SlightlyMore,
            Change::SlightlyLess,
        ][(random.bits() % 5) as usize];
        // The loop asks often.
        match random.bits() % 4000 {
            0 => {
                (*paused, *waited) = (true, 0);
                *wishes += 1;
                Some(Wish::Pause)
            }
            1..=3 => {
                *wishes += 1;
                Some(Wish::Feed(change))
            }
            4..=6 => Some(Wish::Power(change)),
            7 => Some(Wish::Rapid(change)),
            _ => None,
        }
    }

    fn glance(&self, glance: &Glance<'_>) {
        let mut guard = self.0.lock().unwrap();
        guard.2 += usize::from(glance.paused());
    }
}

#[test]
#[ignore = "slow: run by .ci/run in release"]
fn a_hundred_thousand_lines_with_pauses_overrides_and_late_answers_are_all_owned() {
    let text = job(SLITS, SLIT_MM);
    let job = Job::check(text.as_bytes(), &JobRules::default()).unwrap();
    assert!(job.len() > 100_000);
    let cuts = Cuts::of(&job).unwrap();
    let faults = Faults {
        late_s: 0.02,
        late_sent_s: 0.002,
        gather_s: 0.004,
        seed: 11,
        ..Faults::default()
    };
    let mut link = SimTransport::with_faults(Controller::new(Settings::default()), faults);
    let store = MemoryStore::default();
    let mut journal = Journal::new(Header::of(&job, &cuts, "job.nc", "", 3), store);
    let person = Restless(Mutex::new((Random::new(5), false, 0, 0)));
    let options = SendOptions::default();
    let report = send_recorded(&mut link, &job, &cuts, &options, &person, &mut journal).unwrap();
    let wishes = person.0.lock().unwrap().3;
    println!(
        "{} lines, {} cuts, {wishes} wishes, {:.0} s on the machine, {} bytes at the most in flight",
        report.acknowledged, report.cuts, report.time_s, report.max_in_flight
    );
    assert!(wishes > 100);
    assert_eq!((report.acknowledged, report.cuts), (job.len(), SLITS));
    assert!(report.max_in_flight <= 128);
    let summary = RehearsalSummary::of(link.controller());
    assert_eq!(summary.lost_bytes, 0);
    assert!(!summary.beam_on_at_end && summary.standing_burn_s == 0.0);
    let wanted = SLIT_MM * SLITS as f64;
    assert!(
        (summary.burnt_mm / wanted - 1.0).abs() < 1e-3,
        "{}",
        summary.burnt_mm
    );
}

/// Resident memory of a process, kB.
fn resident(process: u32) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = text.lines().find(|l| l.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

#[cfg(target_os = "linux")]
#[test]
#[ignore = "slow: run by .ci/run in release"]
fn the_senders_memory_is_flat() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("laser");
    std::fs::write(folder.path().join("job.nc"), job(SLITS, 0.2)).unwrap();
    let kagome = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kagome"));
        command
            .env("KAGOME_PROFILES", "")
            .current_dir(folder.path());
        command
    };
    let mut machine = kagome()
        .args(["sim", "--speed", "max", "--once", "--link"])
        .arg(&link)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    while !link.exists() {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let mut sender = kagome()
        .args([
            "--json",
            "send",
            "job.nc",
            "--no-journal",
            "--s-max",
            "1000",
            "--port",
        ])
        .arg(&link)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    // The machine hurries, the wall does not: with a journal each proof would wait for the wall's clock.
    let mut early = 0;
    let mut late = 0;
    let events = std::io::BufReader::new(sender.stdout.take().unwrap());
    for event in events.lines() {
        let event: serde_json::Value = serde_json::from_str(&event.unwrap()).unwrap();
        if event["event"] != "status" {
            continue;
        }
        let share = event["acknowledged"].as_f64().unwrap() / event["lines"].as_f64().unwrap();
        let now = resident(sender.id()).unwrap_or(0);
        if share > 0.1 && early == 0 {
            early = now;
        }
        late = late.max(now);
    }
    assert!(sender.wait().unwrap().success());
    machine.wait().unwrap();
    println!("resident after a tenth {early} kB, at the most {late} kB");
    assert!(early > 0 && late < early + 2048, "{early} {late}");
}
