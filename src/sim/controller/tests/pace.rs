//! How fast lines are taken, what happens to those that come faster, and what an `ok` means.

use super::*;

/// Sixty lines, 900 bytes, of long moves.
fn burst() -> String {
    let mut burst = String::from("G21G90 (start)\nM4S500  (beam)\nG1F600  (rate)\n");
    for k in 0..57 {
        burst.push_str(&format!("G1X{:05.1}Y{k:05.1}\n", 10 + k % 2 * 40));
    }
    assert_eq!((burst.len(), burst.lines().count()), (900, 60));
    burst
}

#[test]
fn a_burst_without_counting_loses_more_than_half_its_lines_in_silence() {
    let mut b = Bench::laser();
    let said = b.send(&burst(), 400.0);
    let (ok, errors) = (
        said.matches("ok\r\n").count(),
        said.matches("error:").count(),
    );
    // Measured: 23 ok, 3 errors, 34 lines without a word; how the damaged lines are split hangs on the bytes.
    let vanished = 60 - ok - errors;
    assert!(
        (32..=36).contains(&vanished),
        "{ok} ok, {errors} errors: {said}"
    );
    assert!(b.machine.lost_bytes() > 400, "{}", b.machine.lost_bytes());
}

/// Lines per second that a host reaches which keeps at most `window` bytes unanswered (none: one line at a time) and
/// reacts after a millisecond.
fn rate(settings: Settings, window: Option<usize>) -> f64 {
    // While a long move goes on: making its steps takes its share. The lines themselves wait for nothing.
    let mut b = Bench::new(settings);
    b.send("G21G90\nG1F100\nX400\n", 1.0);
    let line = "G21G90G94G17F60\n";
    assert_eq!(line.len(), 16);
    let total = 2000;
    let (mut sent, mut answered, mut buffer) = (0, 0, Vec::new());
    let start_s = b.machine.now_s();
    while answered < total {
        let room = match window {
            Some(bytes) => (bytes / line.len()).saturating_sub(sent - answered),
            None => usize::from(sent == answered),
        };
        for _ in 0..room.min(total - sent) {
            b.machine.write(line.as_bytes());
            sent += 1;
        }
        let next = b.machine.next_event_s().unwrap();
        b.machine.advance(next);
        if b.machine.has_output() {
            b.machine.advance(next + 0.001);
            buffer.clear();
            b.machine.read(&mut buffer);
            answered += String::from_utf8_lossy(&buffer).matches("ok").count();
        }
    }
    assert_eq!(b.machine.lost_bytes(), 0);
    f64::from(u32::try_from(total).unwrap()) / (b.machine.now_s() - start_s)
}

#[test]
fn counting_reaches_330_lines_a_second_and_waiting_half_of_it() {
    let counting = rate(Settings::default(), Some(128));
    assert!((325.0..=345.0).contains(&counting), "{counting}");
    let waiting = rate(Settings::default(), None);
    assert!((166.0..=186.0).contains(&waiting), "{waiting}");
}

#[test]
fn boards_with_32_bits_take_a_thousand_lines_a_second() {
    // Their usb does not wait for 10 bits a byte.
    let settings = Settings {
        baud: None,
        ..Settings::default().with_flavour(Flavour::GrblHal)
    };
    let counting = rate(settings, Some(1023));
    assert!((1000.0..=1200.0).contains(&counting), "{counting}");
}

#[test]
fn short_segments_starve_the_planner_and_long_enough_ones_do_not() {
    // At 100 mm/s a segment should be 0.3 mm at least.
    let time = |segment_mm: f64| {
        let n = (60.0 / segment_mm).round() as usize;
        let mut text = String::from("G21G91\nM4S500\nG1F6000\n");
        for _ in 0..n {
            text.push_str(&format!("G1X{segment_mm:.3}Y0.001\n"));
        }
        text.push_str("M5\nM2\n");
        let settings = Settings {
            acceleration_mm_s2: [3000.0; 3],
            ..Settings::default()
        };
        crate::sim::estimate(&text, &settings).unwrap().time_s
    };
    let whole = time(60.0);
    assert!(time(0.4) < 1.1 * whole, "{} {whole}", time(0.4));
    assert!(time(0.15) > 1.5 * whole, "{} {whole}", time(0.15));
}

#[test]
fn an_ok_means_planned_and_some_fifteen_blocks_lie_between_it_and_the_beam() {
    let mut b = Bench::laser();
    b.send("G21G90\nM4S500\nG1F600\n", 0.5);
    // Moves of 1 mm, ten a second; bytes counted.
    let (mut sent, mut answered, mut most) = (0usize, 0, 0);
    while answered < 100 {
        while sent < 100 && sent - answered < 10 {
            b.machine
                .write(format!("G1X{:03}.0Y0\n", sent + 1).as_bytes());
            sent += 1;
        }
        answered += b.wait(0.05).matches("ok").count();
        let done = b.machine.position_mm()[0].floor() as usize;
        most = most.max(answered.saturating_sub(done));
    }
    assert!((14..=17).contains(&most), "{most}");
    b.wait(5.0);
    assert_eq!(b.machine.position_mm()[0], 100.0);
}

#[test]
fn g4_runs_in_whole_steps_of_50_ms() {
    for (asked, steps) in [
        ("0.01", 1),
        ("0.02", 1),
        ("0.05", 1),
        ("0.06", 2),
        ("0.1", 2),
        ("0.12", 3),
    ] {
        let mut b = Bench::laser();
        b.machine.write(format!("G4P{asked}\n").as_bytes());
        let start_s = b.machine.now_s();
        while !b.machine.has_output() {
            let next = b.machine.next_event_s().unwrap();
            b.machine.advance(next);
        }
        let took = b.machine.now_s() - start_s;
        let wanted = f64::from(steps) * 0.05;
        assert!(took > wanted && took < wanted + 0.005, "P{asked}: {took}");
    }
}

#[test]
fn with_m4_the_beam_is_dark_up_to_10_ms_before_a_stop_and_at_a_reversal() {
    for length in [5.0, 5.03, 7.11, 9.4] {
        let mut b = Bench::laser();
        b.send(&format!("{M4}G1X{}\nG1X10\nM5\nM2\n", 10.0 + length), 10.0);
        let burnt: f64 = b.machine.burns().iter().map(|b| b.end_s - b.start_s).sum();
        let time = b.machine.beam_time();
        let dark = burnt - time.on_s;
        assert_eq!(time.periods, 2);
        assert!(dark > 0.002 && dark < 0.024, "two ends: {dark}");
    }
}
