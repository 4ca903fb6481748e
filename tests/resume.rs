//! Journals, resumes and refusals: what the sender does when something does not fit.

#![expect(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests fail by panicking"
)]

mod stop_after;

use std::sync::Mutex;

use kagome::base::progress::{Progress, Silent};
use kagome::control::journal::{Header, History, Journal, MemoryStore};
use kagome::control::{
    Confirmed, Cuts, Job, JobRules, Operator, Proof, Question, SendError, SendOptions, SendReport,
    StopReason, Streaming, resume, send_recorded,
};
use kagome::sim::{At, Controller, Faults, Mishap, Settings, SimTransport};
use stop_after::StopAfter;

fn text(n: usize) -> String {
    let mut text = String::from("G21G90\nM4S500\nG1F3000\n");
    for k in 0..n {
        let (x, y) = ((k % 10) as f64 * 9.0 + 5.0, (k / 10) as f64 * 8.0 + 5.0);
        text.push_str(&format!("G0X{x}Y{y}\nG1X{}Y{}\n", x + 4.0, y + 5.0));
    }
    text + "M5\nG0X0Y0\nM2\n"
}

struct Bench {
    job: Job,
    cuts: Cuts,
    store: MemoryStore,
    options: SendOptions,
}

impl Bench {
    fn new(n: usize) -> Self {
        let job = Job::check(text(n).as_bytes(), &JobRules::default()).unwrap();
        let cuts = Cuts::of(&job).unwrap();
        Self {
            job,
            cuts,
            store: MemoryStore::default(),
            options: SendOptions {
                // A damaged line may be an M0, and nobody is here to go on.
                longest_pause: Some(std::time::Duration::from_secs(60)),
                ..SendOptions::default()
            },
        }
    }

    fn header(&self) -> Header {
        Header::of(&self.job, &self.cuts, "job.nc", "bench", 3)
    }

    fn send(
        &self,
        link: &mut SimTransport,
        progress: &dyn Operator,
    ) -> Result<SendReport, SendError> {
        let mut journal = Journal::new(self.header(), self.store.clone());
        send_recorded(
            link,
            &self.job,
            &self.cuts,
            &self.options,
            progress,
            &mut journal,
        )
    }

    fn resume(
        &self,
        link: &mut SimTransport,
        answer: &mut dyn FnMut(&Question) -> bool,
    ) -> Result<SendReport, SendError> {
        let bytes = self.store.bytes();
        let mut journal = Journal::continued(self.header(), &bytes, self.store.clone()).unwrap();
        resume(
            link,
            &self.job,
            &self.cuts,
            &self.options,
            &Silent,
            &mut journal,
            answer,
        )
    }

    fn history(&self) -> History {
        History::read(&self.store.bytes()).unwrap()
    }
}

fn machine(settings: Settings) -> SimTransport {
    SimTransport::new(Controller::new(settings))
}

fn stopped(result: Result<SendReport, SendError>) -> (StopReason, Confirmed) {
    match result {
        Err(SendError::Stopped { reason, confirmed }) => (reason, *confirmed),
        other => panic!("{other:?}"),
    }
}

#[test]
fn after_ctrl_c_the_job_goes_on_where_it_stood_and_nobody_is_asked() {
    let bench = Bench::new(30);
    let mut link = machine(Settings::default());
    let (reason, confirmed) = stopped(bench.send(&mut link, &StopAfter::new(30)));
    assert_eq!(reason, StopReason::Interrupted);
    assert!(confirmed.proven > 2 && confirmed.cuts == 30, "{confirmed}");
    assert!(matches!(bench.history().stopped, Some(Some(_))));
    let burnt = link.controller().burns().len();
    let mut link = SimTransport::new(link.into_controller());
    let report = bench
        .resume(&mut link, &mut |question| panic!("{question}"))
        .unwrap();
    assert_eq!(report.cuts, 30);
    assert!(bench.history().finished);
    // Of the cuts that were begun, the one that was stopped in and at most two more are made again.
    let again = link.controller().burns().len() - burnt;
    assert!(again + confirmed.proven <= 31, "{again}");
}

#[test]
fn nothing_is_cut_while_it_is_not_known_where_the_head_stands() {
    let lost = || {
        let bench = Bench::new(30);
        let faults = Faults::one(At::Sent(700), Mishap::Unplug);
        let mut link = SimTransport::with_faults(Controller::new(Settings::default()), faults);
        bench.send(&mut link, &Silent).unwrap_err();
        let mut machine = link.into_controller();
        machine.run_out(100.0);
        (bench, machine)
    };
    // The board starts anew when the port is opened; the person says no to the first question, or to the second.
    for yes in [0, 1] {
        let (bench, mut machine) = lost();
        machine.power_on([0.0; 3]);
        let burns = machine.burns();
        let mut link = SimTransport::new(machine);
        let mut asked = Vec::new();
        let error = bench
            .resume(&mut link, &mut |question| {
                asked.push(*question);
                asked.len() <= yes
            })
            .unwrap_err();
        assert!(matches!(error, SendError::NotReady { .. }), "{error}");
        assert_eq!(asked[0], Question::ZeroHere { torch: false });
        assert_eq!(asked.len(), yes + 1);
        if yes == 1 {
            let Question::AtReference { cut, is_cut, at_mm } = asked[1] else {
                panic!("{asked:?}");
            };
            assert!(is_cut && bench.cuts.get(cut).unwrap().start_mm == at_mm);
        }
        assert_eq!(link.controller().burns(), burns, "dark all the way");
    }
    // The head was pushed while the motors were off, and the controller kept running: it stands where nothing left it.
    let (bench, mut machine) = lost();
    let place = machine.position_mm();
    // Behind the piece of a line that was on its way.
    machine.write(format!("\nG0X{}\n", place[0] + 3.0).as_bytes());
    machine.run_out(100.0);
    machine.read(&mut Vec::new());
    let mut link = SimTransport::new(machine);
    let mut asked = 0;
    let result = bench.resume(&mut link, &mut |_| {
        asked += 1;
        false
    });
    assert!(result.is_err() && asked == 1);
}

#[test]
fn a_full_disk_stops_the_job_with_proof() {
    for room in [0, 300, 460, 500, 560] {
        let bench = Bench {
            store: MemoryStore::with_room(room),
            ..Bench::new(30)
        };
        let mut link = machine(Settings::default());
        match bench.send(&mut link, &Silent) {
            Err(SendError::NotReady { why }) => {
                assert!(why.contains("journal"), "{why}");
                assert!(link.controller().burns().is_empty());
            }
            other => {
                let (reason, confirmed) = stopped(other);
                assert!(matches!(reason, StopReason::Journal(_)), "{reason}");
                let dark = Proof::BeamOff {
                    position_kept: true,
                };
                assert_eq!(confirmed.proof, dark);
                assert_eq!(confirmed.proven, bench.history().proven);
            }
        }
        assert!(!link.controller().beam_on());
    }
}

#[test]
fn a_panic_is_stopped_with_proof_and_can_be_resumed() {
    struct Panics(StopAfter, Mutex<Vec<String>>);
    impl Progress for Panics {
        fn advance(&self, n: u64) {
            self.0.advance(n);
            assert!(!self.0.interrupted(), "a bug, half way");
        }
        fn note(&self, text: &str) {
            self.1.lock().unwrap().push(text.to_owned());
        }
    }

    impl Operator for Panics {}
    let bench = Bench::new(30);
    let mut link = machine(Settings::default());
    let progress = Panics(StopAfter::new(30), Mutex::default());
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        bench.send(&mut link, &progress)
    }));
    assert!(result.is_err());
    let said = progress.1.lock().unwrap().join("\n");
    assert!(
        said.contains("the beam is off and its position is kept"),
        "{said}"
    );
    assert!(!link.controller().beam_on());
    let mut link = SimTransport::new(link.into_controller());
    bench.resume(&mut link, &mut |q| panic!("{q}")).unwrap();
}

#[test]
fn reports_of_every_form_prove_cuts() {
    for (mask, inches) in [(1.0, 0.0), (0.0, 0.0), (3.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        let bench = Bench::new(20);
        let settings = Settings {
            status_mask: mask,
            report_inches: inches > 0.0,
            ..Settings::default()
        };
        let mut controller = Controller::new(settings);
        controller.write(b"G10L2P1X-30Y12.5\nG92X1Y2\nG92.1\n");
        controller.advance(2.0);
        controller.read(&mut Vec::new());
        let mut link = SimTransport::new(controller);
        let (_, confirmed) = stopped(bench.send(&mut link, &StopAfter::new(30)));
        assert!(
            confirmed.proven >= 8,
            "$10={mask} $13={inches}: {confirmed}"
        );
        let mut link = SimTransport::new(link.into_controller());
        bench.resume(&mut link, &mut |q| panic!("{q}")).unwrap();
        assert!(bench.history().finished);
    }
}

#[test]
fn a_head_that_strays_from_its_job_is_stopped() {
    // A figure damaged on the way to the machine: Y33 becomes Y93, or the like.
    let mut strayed = 0;
    for at in (300..800).step_by(3) {
        let bench = Bench::new(40);
        let faults = Faults {
            corrupt_sent: vec![(at, 0x0a)],
            ..Faults::default()
        };
        let mut link = SimTransport::with_faults(Controller::new(Settings::default()), faults);
        if let Err(SendError::Stopped { reason, confirmed }) = bench.send(&mut link, &Silent)
            && let StopReason::Astray { by_mm } = reason
        {
            strayed += 1;
            assert!(by_mm > 1.0 && matches!(confirmed.proof, Proof::BeamOff { .. }));
        }
        assert!(!link.controller().beam_on());
    }
    assert!(strayed > 3, "{strayed}");
}

#[test]
fn never_more_cuts_are_sent_than_the_limit_beyond_the_journal() {
    for streaming in [Streaming::Counted, Streaming::Answered] {
        for ahead in [1, 2, 3, 7] {
            let mut bench = Bench::new(25);
            bench.options.streaming = streaming;
            let header = Header {
                max_unconfirmed: ahead,
                ..bench.header()
            };
            let mut journal = Journal::new(header, bench.store.clone());
            let mut link = machine(Settings::default());
            let mut watched = Watched {
                link: &mut link,
                store: bench.store.clone(),
                cuts: 0,
                most: 0,
            };
            let report = send_recorded(
                &mut watched,
                &bench.job,
                &bench.cuts,
                &bench.options,
                &Silent,
                &mut journal,
            )
            .unwrap();
            let most = watched.most;
            assert_eq!(most, ahead);
            assert_eq!(report.cuts, 25);
            if streaming == Streaming::Answered {
                assert!(report.max_in_flight < 20);
            }
        }
    }
}

/// A line that counts the cuts which go over it, and compares with what is on the disk at that moment.
struct Watched<'a> {
    link: &'a mut SimTransport,
    store: MemoryStore,
    cuts: usize,
    most: usize,
}

impl kagome::control::Transport for Watched<'_> {
    fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        let text = String::from_utf8_lossy(bytes);
        self.cuts += text.lines().filter(|l| l.starts_with("G1X")).count();
        if self.cuts > 0 {
            let proven = History::read(&self.store.bytes()).map_or(0, |h| h.proven);
            self.most = self.most.max(self.cuts - proven);
        }
        self.link.send(bytes)
    }
    fn receive(&mut self, buffer: &mut [u8], wait: std::time::Duration) -> std::io::Result<usize> {
        self.link.receive(buffer, wait)
    }
    fn now(&self) -> std::time::Duration {
        self.link.now()
    }
    fn name(&self) -> &str {
        "a watched line"
    }
}

/// Proofs hold lines back in front of a cut, and under M3 the head must be dark where it then stands.
#[test]
fn a_machine_that_waits_for_a_proof_is_dark_with_constant_power_too() {
    let text = "G21G90\nM3S500\nG0X5Y5\nG1F3000\nG4P0.01\nX9\nG0Y7\nG1F3000\nX5\nG0Y9\nG1\nG1X9\nG0Y11\nX5\nG1X9\nM5\n";
    let rules = JobRules {
        allow_constant_power: true,
        ..JobRules::default()
    };
    let without = text.replace("G4P0.01\n", "");
    let job = Job::check(without.as_bytes(), &rules).unwrap();
    let cuts = Cuts::of(&job).unwrap();
    assert_eq!(cuts.len(), 4);
    let header = Header::of(&job, &cuts, "job.nc", "", 1);
    let mut journal = Journal::new(header, MemoryStore::default());
    let mut link = machine(Settings::default());
    send_recorded(
        &mut link,
        &job,
        &cuts,
        &SendOptions::default(),
        &Silent,
        &mut journal,
    )
    .unwrap();
    let standing: f64 = link
        .controller()
        .burns()
        .iter()
        .filter(|b| b.standing())
        .map(|b| b.end_s - b.start_s)
        .sum();
    // What the firmware itself does at a bare G1, and nothing longer.
    assert!(standing < 0.1, "{standing} s");
}
