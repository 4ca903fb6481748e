//! What a person does at the machine: jog, overrides, door, sleep.

use super::*;

fn homed(change: impl FnOnce(&mut Settings)) -> Bench {
    let mut settings = Settings {
        homing: true,
        homing_seek_mm_min: 60_000.0,
        ..Settings::default()
    };
    change(&mut settings);
    let mut b = Bench::new(settings);
    b.send("$H\n", 10.0);
    b.said.clear();
    b
}

#[test]
fn a_jog_moves_at_once_and_changes_no_modal_state() {
    let mut b = Bench::laser();
    assert_eq!(b.send("$J=G91G20X1F100\n", 0.1), "ok\r\n");
    assert!(b.raw(b'?', 0.01).contains("<Jog|"));
    assert_eq!(b.send("G0X0\n", 0.1), "error:9\r\n", "no G-code in a jog");
    b.wait(5.0);
    assert_eq!(b.machine.state(), State::Idle);
    assert!((b.machine.position_mm()[0] - 25.4).abs() < 0.01);
    let modes = b.send("$G\n", 0.1);
    assert!(
        modes.contains("[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]"),
        "{modes}"
    );
    // Jogs follow each other, in work coordinates or the machine's.
    b.send("G92X0\n", 0.1);
    b.send("$J=G90X-5F600\n$J=G53X30Y1F600\n", 8.0);
    assert_eq!(b.machine.position_mm(), [30.0, 1.0, 0.0]);
}

#[test]
fn a_jog_is_refused_with_grbls_numbers() {
    let mut b = homed(|s| s.soft_limits = true);
    for (line, error) in [
        ("$J=X-5", 22),
        ("$J=F100", 26),
        ("$J=G1X-5F100", 16),
        ("$J=M3X-5F100", 16),
        ("$J=S5X-5F100", 16),
        ("$JX-5F100", 3),
        ("$J=G53X5F100", 15),
    ] {
        assert_eq!(
            b.send(&format!("{line}\n"), 0.1),
            format!("error:{error}\r\n"),
            "{line}"
        );
    }
    b.send("G0X-100\n", 0.1);
    assert_eq!(b.send("$J=X-5F100\n", 0.1), "error:8\r\n");
}

#[test]
fn a_cancelled_jog_forgets_the_rest_and_keeps_the_position() {
    for byte in [0x85, b'!'] {
        let mut b = Bench::laser();
        b.send("$J=G91X50F3000\n$J=G91X50F3000\n", 0.5);
        b.raw(byte, 1.0);
        assert_eq!(b.machine.state(), State::Idle);
        let place = b.machine.position_mm();
        assert!(place[0] > 5.0 && place[0] < 49.0, "{place:?}");
        assert_eq!(b.machine.head_mm(), place);
        // Relative motion starts from where it stopped.
        b.send("G91G0X1\n", 1.0);
        assert!((b.machine.position_mm()[0] - place[0] - 1.0).abs() < 0.0126);
    }
    let mut b = Bench::laser();
    b.send("$J=G91X50F3000\n", 0.5);
    b.raw(0x84, 1.0);
    assert_eq!(b.machine.state(), State::Door { standing: true });
    b.raw(b'~', 0.1);
    assert_eq!(b.machine.state(), State::Idle);
    assert!(b.send("$J=G91X50F3000\n", 0.5).contains("ok"));
    let said = b.raw(0x18, 0.1);
    assert!(said.contains("ALARM:3"), "{said}");
}

#[test]
fn zeroing_as_the_person_does_sets_the_work_offset() {
    let mut b = Bench::laser();
    b.send("$J=G91X20Y5F6000\n", 3.0);
    assert_eq!(b.send("G10L20P1X0Y0\n", 0.5), "ok\r\n");
    assert!(b.raw(b'?', 0.1).contains("|WCO:20.000,5.000,0.000"));
    b.send("G90G0X3\n", 2.0);
    assert_eq!(b.machine.position_mm()[0], 23.0);
}

/// Time of a long cut of 100 mm at 3000 mm/min, with bytes sent half a second after it began.
fn cut_time(bytes: &[u8]) -> f64 {
    let mut b = Bench::laser();
    b.send("G21G90\nM4S500\nG1F3000\nG1X100\n", 0.5);
    for byte in bytes {
        b.machine.write(&[*byte]);
    }
    while b.machine.state() != State::Idle {
        b.wait(0.001);
    }
    assert_eq!(b.machine.position_mm()[0], 100.0);
    b.machine.motion_s()
}

#[test]
fn the_feed_override_acts_at_once_and_on_the_time() {
    let plain = cut_time(&[]);
    let (half, double) = (cut_time(&[0x92; 5]), cut_time(&[0x91; 12]));
    // 50 mm/s: about 0.48 s have passed when the bytes arrive; ramps aside the rest takes twice or half as long.
    let left = plain - 0.5;
    assert!((half - (0.5 + 2.0 * left)).abs() < 0.15, "{plain} {half}");
    assert!(
        (double - (0.5 + 0.5 * left)).abs() < 0.15,
        "{plain} {double}"
    );
    let (up, down) = (cut_time(&[0x91, 0x90]), cut_time(&[0x93, 0x94, 0x90]));
    assert!((up - plain).abs() < 1e-3 && (down - plain).abs() < 1e-3);
    let mut b = Bench::laser();
    for (byte, reads) in [(0x91, 110), (0x93, 111), (0x92, 101), (0x94, 100)] {
        b.raw(byte, 0.05);
        b.raw(b'?', 0.05);
        let said = b.raw(b'?', 0.05);
        let said = String::from_utf8_lossy(&b.said).into_owned() + &said;
        assert!(said.contains(&format!("|Ov:{reads},100,100")), "{said}");
        b.said.clear();
    }
}

#[test]
fn the_rapid_override_slows_rapids_and_nothing_else() {
    let time = |byte: Option<u8>, line: &str| {
        let mut b = Bench::laser();
        b.send("G21G90\nG1F3000\n", 0.1);
        if let Some(byte) = byte {
            b.raw(byte, 0.01);
        }
        b.send(line, 60.0);
        b.machine.motion_s()
    };
    // 200 mm at 100 mm/s, ramps of 0.2 s.
    assert!((time(None, "G0X200\n") - 2.2).abs() < 0.01);
    assert!((time(Some(0x96), "G0X200\n") - 4.1).abs() < 0.01);
    assert!((time(Some(0x97), "G0X200\n") - 8.05).abs() < 0.01);
    assert_eq!(time(Some(0x97), "G1X200\n"), time(None, "G1X200\n"));
}

#[test]
fn the_spindle_override_acts_on_the_beam_within_full_power() {
    let mut b = Bench::laser();
    b.send("G21G90\nM3S500\nG1F600\nG1X100\n", 1.0);
    for _ in 0..3 {
        b.raw(0x9b, 0.5);
    }
    assert!(b.raw(b'?', 0.05).contains("|FS:600,350"));
    for _ in 0..13 {
        b.raw(0x9a, 0.01);
    }
    assert!(b.raw(b'?', 0.05).contains("|FS:600,1000"));
    let words: Vec<f64> = b.machine.burns().iter().map(|b| b.s).collect();
    assert!(
        words.contains(&350.0) && words.last() == Some(&1000.0),
        "{words:?}"
    );
    assert!(words.iter().all(|s| *s <= 1000.0));
    // The end of a program takes the overrides back.
    b.send("M2\n", 20.0);
    b.raw(b'?', 0.05);
    assert!(b.raw(b'?', 0.05).contains("|Ov:100,100,100"));
}

#[test]
fn with_m4_the_power_follows_an_overridden_feed() {
    let mut b = Bench::laser();
    b.send("G21G90\nM4S400\nG1F600\nG1X100\n", 1.0);
    for _ in 0..5 {
        b.raw(0x92, 0.2);
    }
    assert!(b.raw(b'?', 0.05).contains("|FS:300,200"));
}

#[test]
fn asleep_it_is_dark_and_wakes_only_by_a_reset_and_locked() {
    let mut b = Bench::laser();
    b.send("M3S5\nG1F100\n", 0.2);
    assert!(b.machine.beam_on());
    assert_eq!(b.send("$SLP\n", 0.2), "ok\r\n[MSG:Sleeping]\r\n");
    assert!(!b.machine.beam_on());
    assert!(b.raw(b'?', 0.1).contains("<Sleep|"));
    assert_eq!(b.send("G0X1\n$X\n~", 1.0), "");
    let said = b.raw(0x18, 0.2);
    assert!(
        said.contains("Grbl 1.1h") && said.contains("to unlock"),
        "{said}"
    );
    assert!(!said.contains("ALARM"));
    assert!(b.send("$X\n", 0.1).contains("ok"));
}

#[test]
fn air_is_toggled_by_hand_and_told_in_the_report() {
    let mut b = Bench::laser();
    b.raw(0xa0, 0.1);
    b.raw(b'?', 0.1);
    assert!(b.raw(b'?', 0.1).contains("|A:F"));
    assert!(b.send("$G\n", 0.1).contains(" M8 "));
    b.raw(0xa0, 0.1);
    assert!(b.send("$G\n", 0.1).contains(" M9 "));
}

#[test]
fn a_switch_at_the_end_of_the_travel_stops_the_machine() {
    let mut b = homed(|s| s.hard_limits = true);
    let said = b.send("G21G91\nM4S500\nG1X-100F3000\nG1X200\n", 20.0);
    assert!(
        said.ends_with("ALARM:1\r\n[MSG:Reset to continue]\r\n"),
        "{said}"
    );
    assert!(!b.machine.beam_on());
    assert!(
        b.machine.position_mm()[0].abs() < 1e-6,
        "{:?}",
        b.machine.position_mm()
    );
    assert!(b.machine.head_mm()[0] > 1.0, "it slid on");
    assert_eq!(b.raw(b'?', 1.0), "");
    assert!(b.raw(0x18, 0.2).contains("to unlock"));
    // Unlocked, it can be moved back.
    assert!(b.send("$X\nG91G0X-5\n", 2.0).ends_with("ok\r\n"));
    assert_eq!(b.machine.state(), State::Idle);
}

#[test]
fn a_lost_position_makes_a_job_burn_elsewhere_until_the_zero_is_set_again() {
    let cut = "G21G90\nG0X10Y10\nM4S500\nG1X20F3000\nM5\n";
    let mut b = Bench::laser();
    b.send("$J=G91X100Y50F6000\n", 5.0);
    b.send("G10L20P1X0Y0\n", 0.5);
    b.send(cut, 5.0);
    b.machine.power_off();
    b.wait(3.0);
    b.machine.power_on([-7.0, 3.0, 0.0]);
    b.wait(0.5);
    // G54 has survived, and means another place now.
    b.send(cut, 5.0);
    let burns = b.machine.burns();
    assert_eq!((burns.len(), burns[0].from_mm), (2, [110.0, 60.0]));
    assert!((burns[1].from_mm[0] - 223.0).abs() < 0.02, "{:?}", burns[1]);
    // The person jogs the head over the old zero, and says so.
    let head = b.machine.head_mm();
    let jog = format!("$J=G91X{:.3}Y{:.3}F6000\n", 100.0 - head[0], 50.0 - head[1]);
    b.send(&jog, 5.0);
    b.send("G10L20P1X0Y0\n", 0.5);
    b.send(cut, 5.0);
    let last = b.machine.burns()[2];
    assert!((last.from_mm[0] - 110.0).abs() < 0.02 && (last.to_mm[0] - 120.0).abs() < 0.02);
}
