//! The table "case | beam" as measured on stock GRBL 1.1h.

use super::*;

#[test]
fn starved_or_unplugged_with_m3_the_buffered_lines_run_and_the_beam_stays_on() {
    let mut b = Bench::laser();
    b.send(M3, 0.0);
    b.send("G1X60\nG1Y50\n", 30.0);
    assert_eq!(b.machine.state(), State::Idle);
    assert_eq!(b.machine.position_mm(), [60.0, 50.0, 0.0]);
    assert!(b.machine.beam_on());
    assert!(b.standing_s() > 20.0, "{}", b.standing_s());
}

#[test]
fn starved_or_unplugged_with_m4_the_buffered_lines_run_and_the_beam_is_off() {
    let mut b = Bench::laser();
    b.send(M4, 0.0);
    b.send("G1X60\nG1Y50\n", 30.0);
    assert_eq!(b.machine.position_mm(), [60.0, 50.0, 0.0]);
    assert!(!b.machine.beam_on());
    assert_eq!(b.standing_s(), 0.0);
}

#[test]
fn a_hold_in_laser_mode_is_dark_once_standing_and_resume_restores_the_beam() {
    for start in [M3, M4] {
        let mut b = Bench::laser();
        b.send(start, 0.0);
        b.send("G1X60\n", 0.7);
        assert!(b.machine.beam_on());
        b.raw(b'!', 0.05);
        assert_eq!(b.machine.state(), State::Hold { standing: false });
        b.wait(0.5);
        assert_eq!(b.machine.state(), State::Hold { standing: true });
        assert!(!b.machine.beam_on());
        let place = b.machine.position_mm()[0];
        assert!(place > 12.0 && place < 59.0, "{place}");
        let report = b.raw(b'?', 0.1);
        assert!(
            report.contains("<Hold:0|") && report.contains("|FS:0,0"),
            "{report}"
        );
        b.raw(b'~', 0.1);
        assert!(b.machine.beam_on());
        b.wait(3.0);
        assert_eq!(b.machine.position_mm()[0], 60.0);
        assert_eq!(b.standing_s() > 0.0, start == M3);
    }
}

#[test]
fn a_reset_in_motion_is_dark_raises_alarm_3_and_locks() {
    for start in [M3, M4] {
        let mut b = Bench::laser();
        b.send(start, 0.0);
        b.send("G1X60\n", 0.7);
        assert!(b.machine.beam_on());
        let said = b.raw(0x18, 0.1);
        assert!(!b.machine.beam_on());
        assert!(said.contains("ALARM:3\r\n\r\nGrbl 1.1h"), "{said:?}");
        assert!(said.contains("[MSG:'$H'|'$X' to unlock]"), "{said:?}");
        assert!(b.send("G0X1\n", 0.1).contains("error:9"));
        assert!(b.raw(b'?', 0.1).contains("<Alarm|"));
        assert!(
            b.send("$X\n", 0.1)
                .contains("[MSG:Caution: Unlocked]\r\nok")
        );
        assert_eq!(b.machine.state(), State::Idle);
    }
}

#[test]
fn hold_then_reset_at_rest_is_dark_and_keeps_the_position() {
    for start in [M3, M4] {
        let mut b = Bench::laser();
        b.send(start, 0.0);
        b.send("G1X60\n", 0.7);
        b.raw(b'!', 0.5);
        let place = b.machine.position_mm();
        // With M3 the bare G1 of the preamble has burnt for a moment already.
        let before = b.standing_s();
        let said = b.raw(0x18, 0.1);
        assert!(!said.contains("ALARM"), "{said:?}");
        assert_eq!(b.machine.state(), State::Idle);
        assert_eq!(b.machine.position_mm(), place);
        b.wait(5.0);
        assert!(!b.machine.beam_on());
        assert_eq!(b.standing_s(), before);
    }
}

#[test]
fn m3_then_a_bare_g1_then_a_dwell_burns_while_standing() {
    let mut b = Bench::laser();
    b.send("G21G90\nG1F600\nG0X5\nM3S500\nG1\nG4P1\n", 0.6);
    assert_eq!(b.machine.position_mm()[0], 5.0);
    assert!(b.machine.beam_on());
    b.wait(1.0);
    assert!(b.standing_s() > 0.9);
}
