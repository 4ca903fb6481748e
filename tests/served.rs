//! The simulated machine on TCP, in process and as `kagome sim --tcp`.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail by panicking")]

use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use kagome::base::progress::Silent;
use kagome::control::{Job, JobRules, SendOptions, Transport, send};
use kagome::sim::pty::Serve;
use kagome::sim::tcp::TcpServer;
use kagome::sim::{Controller, Flavour, Settings, rehearse, strokes};

/// Our sender's end of a socket.
struct Line {
    stream: TcpStream,
    opened: Instant,
}

impl Line {
    fn open(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_nodelay(true).unwrap();
        Self {
            stream,
            opened: Instant::now(),
        }
    }

    /// What is said up to this, within ten seconds.
    fn until(&mut self, end: &str) -> String {
        let give_up = Instant::now() + Duration::from_secs(10);
        let mut said = String::new();
        while !said.contains(end) && Instant::now() < give_up {
            said += &self.hear(0.02);
        }
        said
    }

    /// What is said within a time.
    fn hear(&mut self, seconds: f64) -> String {
        let until = Instant::now() + Duration::from_secs_f64(seconds);
        let (mut said, mut buffer) = (Vec::new(), [0; 256]);
        while Instant::now() < until {
            match self.receive(&mut buffer, Duration::from_millis(20)) {
                Ok(count) => said.extend_from_slice(&buffer[..count]),
                Err(_) => break,
            }
        }
        String::from_utf8(said).unwrap()
    }
}

impl Transport for Line {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.stream
            .set_read_timeout(Some(wait.max(Duration::from_millis(1))))?;
        match self.stream.read(buffer) {
            Ok(0) => Err(io::ErrorKind::BrokenPipe.into()),
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
                ) =>
            {
                Ok(0)
            }
            other => other,
        }
    }

    fn now(&self) -> Duration {
        self.opened.elapsed()
    }

    fn name(&self) -> &str {
        "a socket"
    }
}

const JOB: &str = "G21G90\nM4S500\nG1F3000\nG0X5Y5\nG1X25\nG0X5Y10\nG1X25Y14\nM5\nG0X0Y0\nM2\n";

#[test]
fn a_job_over_tcp_burns_what_it_says_for_each_firmware() {
    for flavour in [Flavour::Grbl, Flavour::GrblHal, Flavour::FluidNc] {
        let settings = Settings {
            baud: None,
            ..Settings::default().with_flavour(flavour)
        };
        let ours = rehearse(JOB.as_bytes(), &settings, &JobRules::default(), &Silent).unwrap();
        let mut server = TcpServer::open("127.0.0.1:0").unwrap();
        let address = server.address();
        let buffer = settings.receive_buffer;
        let machine = std::thread::spawn(move || {
            let mut controller = Controller::new(settings);
            let how = Serve {
                speed: Some(10.0),
                once: true,
                reset_on_open: false,
            };
            server.run(&mut controller, how, |_| false);
            controller
        });
        let mut line = Line::open(address);
        let job = Job::check(JOB.as_bytes(), &JobRules::default()).unwrap();
        let options = SendOptions {
            banner_wait: Duration::from_millis(100),
            buffer: Some(buffer),
            ..SendOptions::default()
        };
        send(&mut line, &job, &options, &Silent).unwrap();
        drop(line);
        let machine = machine.join().unwrap();
        assert_eq!(machine.lost_bytes(), 0);
        assert_eq!(strokes(&machine.burns(), 0.0125), ours.strokes);
    }
}

#[test]
fn one_client_at_a_time_and_the_machine_outlives_each_of_them() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_kagome"))
        .env("KAGOME_PROFILES", "")
        .args(["sim", "--tcp", "127.0.0.1:0", "--speed", "5"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let address: SocketAddr = lines.next().unwrap().unwrap().parse().unwrap();
    let mut first = Line::open(address);
    first.send(b"?").unwrap();
    assert!(first.hear(0.3).contains("<Idle|MPos:0.000"));

    let mut second = Line::open(address);
    assert!(second.hear(0.3).contains("in use by another program"));
    assert!(
        second
            .receive(&mut [0; 9], Duration::from_millis(50))
            .is_err()
    );

    // The first one leaves in the middle of a motion: it ends all the same, and nothing starts anew.
    first.send(b"G1X50F3000\n").unwrap();
    assert!(first.hear(0.2).contains("ok"));
    drop(first);
    std::thread::sleep(Duration::from_millis(500));
    let mut third = Line::open(address);
    std::thread::sleep(Duration::from_millis(50));
    third.send(b"?").unwrap();
    let said = third.hear(0.3);
    assert!(said.contains("<Idle|MPos:50.000,0.000,0.000"), "{said}");
    assert!(!said.contains("Grbl"), "{said}");
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_locked_machine_is_homed_and_what_happens_to_it_is_seen_by_the_client() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_kagome"))
        .env("KAGOME_PROFILES", "")
        .args(["sim", "--tcp", "127.0.0.1:0", "--speed", "200"])
        .args([
            "--machine",
            "co2-600x400",
            "--locked",
            "--mishap",
            "limit-switch@600",
        ])
        .args([
            "--mishap",
            "power-loss@640",
            "--mishap",
            "power-returns@700",
        ])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let address: SocketAddr = lines.next().unwrap().unwrap().parse().unwrap();
    let mut line = Line::open(address);
    line.send(b"?").unwrap();
    assert!(line.hear(0.2).contains("<Alarm|MPos:0.000"));
    line.send(b"$H\n").unwrap();
    let said = line.until("ok\r\n");
    assert!(said.contains("ok"), "{said}");
    line.send(b"?").unwrap();
    let said = line.until(">");
    assert!(said.contains("<Idle|MPos:0.000,0.000,0.000"), "{said}");
    let said = line.until("to unlock");
    let (alarm, banner) = (said.find("ALARM:1"), said.find("Grbl 1.1h"));
    assert!(alarm.is_some() && alarm < banner, "{said}");
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn an_address_that_cannot_be_listened_on_is_said() {
    let taken = TcpServer::open("127.0.0.1:0").unwrap();
    let error = TcpServer::open(&taken.address().to_string()).unwrap_err();
    assert!(
        error.to_string().contains("choose a port that is free"),
        "{error}"
    );
    assert!(TcpServer::open("nonsense").is_err());
}
