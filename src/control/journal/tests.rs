use super::*;
use crate::control::JobRules;

fn job() -> (Job, Cuts) {
    let text = "G21G90\nM4S500\nG0X1Y1\nG1X9F3000\nG0X1Y2\nG1X9\nG0X1Y3\nG1X9\nM5\nM2\n";
    let job = Job::check(text.as_bytes(), &JobRules::default()).unwrap();
    let cuts = Cuts::of(&job).unwrap();
    (job, cuts)
}

fn header() -> Header {
    let (job, cuts) = job();
    Header::of(&job, &cuts, "job.nc", "diode-400", 3)
}

fn begin() -> Begin {
    Begin {
        cut: 0,
        system: "G54".into(),
        offset_mm: [1.5, -2.0, 0.0],
        homes: true,
        firmware: "Grbl 1.1h ['$' for help]".into(),
    }
}

/// A journal with all kinds of lines, and where each line ends with what is proven there.
fn full() -> (Vec<u8>, Vec<(usize, usize)>) {
    let store = MemoryStore::default();
    let mut journal = Journal::new(header(), store.clone());
    journal.begin(begin()).unwrap();
    let mut ends = vec![(store.bytes().len(), 0)];
    let stopped = Record::Stopped {
        kept_mm: Some([1.0, 2.0, 0.0]),
    };
    for (record, proven) in [
        (Record::Cuts(1), 1),
        (stopped, 1),
        (Record::Begin(Begin { cut: 1, ..begin() }), 1),
        (Record::Cuts(2), 2),
        (Record::Stopped { kept_mm: None }, 2),
    ] {
        journal.write(&record).unwrap();
        ends.push((store.bytes().len(), proven));
    }
    (store.bytes(), ends)
}

#[test]
fn every_truncation_is_read_as_far_as_it_was_certain() {
    let (bytes, ends) = full();
    for length in 0..=bytes.len() {
        let wanted = ends.iter().rev().find(|(end, _)| *end <= length);
        match (History::read(&bytes[..length]), wanted) {
            (Ok(history), Some(&(end, proven))) => {
                assert_eq!((history.proven, history.length), (proven, end));
                // And it can be gone on with, as if the torn line had never been.
                let store = MemoryStore::holding(&bytes[..length]);
                let mut journal =
                    Journal::continued(header(), &bytes[..length], store.clone()).unwrap();
                journal
                    .begin(Begin {
                        cut: proven,
                        ..begin()
                    })
                    .unwrap();
                journal.write(&Record::Cuts(proven)).unwrap();
                let again = History::read(&store.bytes()).unwrap();
                assert_eq!((again.proven, again.stopped), (proven, None));
            }
            (Err(JournalError::NotBegun), None) => {}
            other => panic!("{length}: {other:?}"),
        }
    }
}

#[test]
fn every_flipped_bit_is_noticed_or_changes_nothing() {
    let (bytes, ends) = full();
    for at in 0..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            match History::read(&damaged) {
                Err(JournalError::Damaged { line, proven }) => {
                    assert!(line >= 1 && proven <= 2);
                }
                Err(JournalError::NoJournal { .. }) => assert!(at < 40, "{at}"),
                // The last line lost its end: it reads as one that was being written.
                Ok(history) => {
                    assert_eq!(at, bytes.len() - 1);
                    assert_eq!(history.length, ends[ends.len() - 2].0);
                }
                Err(other) => panic!("{at}: {other}"),
            }
        }
    }
    // A line taken out or put in.
    let text = String::from_utf8(bytes).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    for k in 0..lines.len() {
        let without: String = (0..lines.len())
            .filter(|&j| j != k)
            .map(|j| format!("{}\n", lines[j]))
            .collect();
        let twice: String = (0..lines.len())
            .flat_map(|j| vec![lines[j]; if j == k { 2 } else { 1 }])
            .map(|l| format!("{l}\n"))
            .collect();
        for changed in [without, twice] {
            let read = History::read(changed.as_bytes());
            let last_gone = k == lines.len() - 1 && read.is_ok();
            assert!(read.is_err() || last_gone, "{k}: {changed}");
        }
    }
}

#[test]
fn the_journal_of_another_job_or_machine_is_refused_with_the_reason() {
    let (bytes, _) = full();
    let refused = |header: Header| {
        let store = MemoryStore::holding(&bytes);
        Journal::continued(header, &bytes, store)
            .err()
            .map(|e| e.to_string())
            .unwrap_or_default()
    };
    assert_eq!(refused(header()), "");
    let other = Header {
        job: "00".into(),
        ..header()
    };
    assert!(refused(other.clone()).contains("was changed after it was begun"));
    let renamed = Header {
        name: "hat.nc".into(),
        ..other
    };
    assert!(refused(renamed).contains("written for job.nc"));
    let machine = Header {
        machine: "fibre-300".into(),
        ..header()
    };
    assert!(refused(machine).contains("begun on the machine \"diode-400\""));

    for (text, words) in [
        (&b"G21\nG90\n"[..], "no journal of kagome"),
        (b"", "before the job was begun"),
        (b"\0\0\0", "no journal of kagome"),
    ] {
        let error = History::read(text).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn nothing_is_left_once_every_cut_is_proven() {
    let store = MemoryStore::default();
    let mut journal = Journal::new(header(), store.clone());
    journal.begin(begin()).unwrap();
    journal.write(&Record::Cuts(3)).unwrap();
    let again = Journal::continued(header(), &store.bytes(), store.clone());
    assert!(matches!(
        again.err(),
        Some(JournalError::Finished { cuts: 3 })
    ));
}

#[test]
fn a_file_is_put_aside_and_a_torn_line_is_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let path = path_for(&folder.path().join("job.nc"));
    assert!(path.ends_with("job.nc.journal"));
    for run in 0..2 {
        let mut journal = Journal::new(header(), FileStore::new(&path));
        journal.begin(begin()).unwrap();
        journal.write(&Record::Cuts(run)).unwrap();
    }
    let old = std::fs::read(FileStore::aside(&path)).unwrap();
    assert_eq!(History::read(&old).unwrap().proven, 0);
    let mut bytes = std::fs::read(&path).unwrap();
    let whole = bytes.len();
    bytes.extend_from_slice(b"a torn li");
    std::fs::write(&path, &bytes).unwrap();
    let mut journal = Journal::continued(header(), &bytes, FileStore::new(&path)).unwrap();
    assert_eq!(journal.history().unwrap().length, whole);
    journal.begin(Begin { cut: 1, ..begin() }).unwrap();
    journal.write(&Record::Finished).unwrap();
    assert!(
        History::read(&std::fs::read(&path).unwrap())
            .unwrap()
            .finished
    );
}

#[test]
fn a_name_cannot_forge_a_line() {
    let forged = Header {
        name: "x\nfinished".into(),
        machine: "a\r\nb".into(),
        ..header()
    };
    let store = MemoryStore::default();
    let mut journal = Journal::new(forged, store.clone());
    journal.begin(begin()).unwrap();
    assert!(!History::read(&store.bytes()).unwrap().finished);
}
