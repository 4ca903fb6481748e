//! A question that waits at a terminal: a wish to stop counts at once, and nothing has happened then.

#![cfg(unix)]
#![expect(clippy::unwrap_used, reason = "helpers of tests fail by panicking")]

use std::fs::{File, OpenOptions};
use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use kagome::control::journal::{Begin, FileStore, Header, Journal, path_for};
use kagome::control::{Cuts, Job, JobRules};
use kagome::sim::pty::{PtyServer, Serve};
use kagome::sim::{Controller, Settings};
use serialport::{SerialPort as _, TTYPort};

const JOB: &str =
    "G21G90\nG54\nM4S500\nG1F3000\nG0X5Y5\nG1X25\nG0X5Y10\nG1X25Y14\nM5\nG0X0Y0\nM2\n";

/// What the wait for a question or for the program's end may take.
const LONG: Duration = Duration::from_secs(10);

/// The program with a terminal of its own.
struct Seat {
    near: TTYPort,
    far: File,
    child: Child,
    said: String,
    /// How the terminal was set before.
    set: String,
}

impl Seat {
    fn new(folder: &Path, arguments: &[&str]) -> Self {
        let (mut near, far) = TTYPort::pair().unwrap();
        near.set_timeout(Duration::from_millis(20)).unwrap();
        let path = far.name().unwrap();
        let open = || OpenOptions::new().read(true).write(true).open(&path);
        let child = Command::new(env!("CARGO_BIN_EXE_kagome"))
            .env("KAGOME_PROFILES", "")
            .args(arguments)
            .current_dir(folder)
            .stdin(open().unwrap())
            .stderr(open().unwrap())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let far = open().unwrap();
        let set = modes(&far);
        Self {
            near,
            far,
            child,
            said: String::new(),
            set,
        }
    }

    fn hear(&mut self) {
        let mut buffer = [0; 256];
        if let Ok(count) = self.near.read(&mut buffer) {
            self.said += &String::from_utf8_lossy(&buffer[..count]);
        }
    }

    /// Waits until these words are shown.
    fn until(&mut self, words: &str) {
        let give_up = Instant::now() + LONG;
        while !self.said.contains(words) {
            assert!(Instant::now() < give_up, "{words}: {}", self.said);
            assert!(self.child.try_wait().unwrap().is_none(), "{}", self.said);
            self.hear();
        }
    }

    /// Waits for the end and gives the exit code.
    fn end(&mut self) -> Option<i32> {
        let give_up = Instant::now() + LONG;
        let status = loop {
            self.hear();
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            assert!(Instant::now() < give_up, "it still waits: {}", self.said);
        };
        self.hear();
        status.code()
    }

    /// Sends a signal and gives the exit code, and what was said since.
    fn leave(mut self, signal: &str) -> (Option<i32>, String) {
        let before = self.said.len();
        let id = self.child.id().to_string();
        let sent = Command::new("kill").args([signal, &id]).status();
        assert!(sent.unwrap().success());
        let code = self.end();
        assert_eq!(modes(&self.far), self.set);
        (code, self.said.split_off(before))
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// How a terminal is set.
fn modes(terminal: &File) -> String {
    let asked = Command::new("stty")
        .arg("-g")
        .stdin(terminal.try_clone().unwrap())
        .output()
        .unwrap();
    assert!(asked.status.success());
    String::from_utf8(asked.stdout).unwrap()
}

/// A machine that is given back once its user has left.
fn served(settings: Settings) -> (String, JoinHandle<Controller>) {
    let mut server = PtyServer::open().unwrap();
    let path = server.path().to_owned();
    let machine = std::thread::spawn(move || {
        let mut controller = Controller::new(settings);
        let how = Serve {
            speed: Some(20.0),
            once: true,
            reset_on_open: false,
        };
        server.run(&mut controller, how, |_| false);
        controller
    });
    (path, machine)
}

#[test]
fn a_job_is_not_begun() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("job.nc"), JOB).unwrap();
    for signal in ["-INT", "-TERM", "-HUP"] {
        let nobody = TcpListener::bind("127.0.0.1:0").unwrap();
        nobody.set_nonblocking(true).unwrap();
        let port = format!("tcp://{}", nobody.local_addr().unwrap());
        let mut seat = Seat::new(folder.path(), &["send", "job.nc", "--port", &port]);
        seat.until("[y/N] ");
        let (code, said) = seat.leave(signal);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("\nno: nothing was sent"), "{said}");
        assert!(nobody.accept().is_err(), "the port was opened");
    }
}

#[test]
fn an_answer_counts_when_its_line_is_ended() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("job.nc"), JOB).unwrap();
    for (typed, goes_on) in [("no\n", false), ("\n", false), ("y\n", true)] {
        let machine = TcpListener::bind("127.0.0.1:0").unwrap();
        machine.set_nonblocking(true).unwrap();
        let port = format!("tcp://{}", machine.local_addr().unwrap());
        let mut seat = Seat::new(folder.path(), &["send", "job.nc", "--port", &port]);
        seat.until("[y/N] ");
        seat.near.write_all(typed.as_bytes()).unwrap();
        let code = seat.end();
        assert_eq!(machine.accept().is_ok(), goes_on, "{}", seat.said);
        assert_eq!(code, Some(if goes_on { 2 } else { 1 }), "{}", seat.said);
    }
}

#[test]
fn settings_stay_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine.txt"), "$110=1234\n").unwrap();
    let (path, machine) = served(Settings::default());
    let restore = ["settings", "restore", "mine.txt", "--port", &path];
    let mut seat = Seat::new(folder.path(), &restore);
    seat.until("[y/N] ");
    let (code, said) = seat.leave("-TERM");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("\nno: nothing was written"), "{said}");
    let machine = machine.join().unwrap();
    assert_eq!(machine.settings(), &Settings::default());
}

#[test]
fn a_job_is_not_resumed_and_nothing_moves() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("job.nc");
    std::fs::write(&file, JOB).unwrap();
    let job = Job::check(JOB.as_bytes(), &JobRules::default()).unwrap();
    let header = Header::of(&job, &Cuts::of(&job).unwrap(), "job.nc", "", 3);
    let mut journal = Journal::new(header, FileStore::new(&path_for(&file)));
    let begun = Begin {
        cut: 0,
        system: "G54".into(),
        offset_mm: [0.0; 3],
        homes: true,
        firmware: "Grbl".into(),
    };
    journal.begin(begun).unwrap();
    drop(journal);
    let (path, machine) = served(Settings {
        homing: true,
        ..Settings::default()
    });
    let mut seat = Seat::new(folder.path(), &["resume", "job.nc", "--port", &path]);
    seat.until("May it be homed now? [y/N] ");
    let (code, said) = seat.leave("-INT");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("Nothing was moved"), "{said}");
    let machine = machine.join().unwrap();
    assert_eq!(machine.position_mm(), [0.0; 3]);
    assert!(machine.first_motion_s().is_none() && machine.burns().is_empty());
}
