//! Answers, locks, limits and ends.

use super::*;

#[test]
fn after_an_error_the_following_lines_still_run() {
    let mut b = Bench::laser();
    let said = b.send("G21G90\nG1F600\nG0X5Q3\nG1X7\n", 3.0);
    assert_eq!(said, "ok\r\nok\r\nerror:20\r\nok\r\n");
    assert_eq!(b.machine.position_mm()[0], 7.0);
}

#[test]
fn a_line_of_79_characters_is_read_and_one_of_80_is_error_11() {
    let mut b = Bench::laser();
    let line = |n: usize| format!("G0X{}\n", "0".repeat(n - 3));
    assert_eq!(b.send(&line(79), 1.0), "ok\r\n");
    assert_eq!(b.send(&line(80), 1.0), "error:11\r\n");
}

#[test]
fn questions_are_answered() {
    let mut b = Bench::laser();
    assert!(b.send("$I\n", 0.1).contains("[OPT:V,15,128]"));
    let settings = b.send("$$\n", 0.3);
    assert!(settings.contains("$32=1\r\n") && settings.contains("$11=0.010\r\n"));
    assert!(settings.contains("$110=6000.000\r\n") && settings.ends_with("ok\r\n"));
    assert!(
        b.send("$G\n", 0.1)
            .contains("[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]")
    );
    assert!(b.send("$#\n", 0.3).contains("[G54:0.000,0.000,0.000]"));
    assert!(b.send("$N\n", 0.1).contains("$N0="));
    assert_eq!(b.send("$H\n", 0.1), "error:5\r\n");
    assert_eq!(b.send("$Q\n", 0.1), "error:2\r\n");
    assert_eq!(b.send("$20=1\n", 0.1), "error:10\r\n");
    assert_eq!(b.send("$30=255\n", 0.2), "ok\r\n");
    assert_eq!(b.machine.settings().s_max, 255.0);
    b.send("G1X50F600\n", 0.2);
    assert_eq!(b.send("$$\n", 0.1), "error:8\r\n");
    assert!(b.raw(b'?', 0.1).contains("<Run|MPos:"));
}

#[test]
fn a_report_tells_the_free_buffers_when_asked_to() {
    let mut b = Bench::laser();
    b.send("$10=3\n", 0.2);
    assert!(b.raw(b'?', 0.1).contains("|Bf:15,128|"), "{:?}", b.said);
}

#[test]
fn writing_a_setting_makes_the_controller_deaf() {
    let mut b = Bench::laser();
    b.send("$11=0.02\n", 0.01);
    b.send("G1X9F600\n", 1.0);
    assert!(b.machine.lost_bytes() > 0);
}

#[test]
fn check_mode_checks_without_moving_and_leaving_it_resets() {
    let mut b = Bench::laser();
    assert_eq!(b.send("$C\n", 0.1), "[MSG:Enabled]\r\nok\r\n");
    assert_eq!(b.send("G1X50F600\nG1X9Q1\n", 1.0), "ok\r\nerror:20\r\n");
    assert!(b.raw(b'?', 0.1).contains("<Check|"));
    let said = b.send("$C\n", 0.2);
    assert!(
        said.contains("[MSG:Disabled]\r\nok\r\n\r\nGrbl 1.1h"),
        "{said:?}"
    );
    assert_eq!(
        (b.machine.state(), b.machine.position_mm()),
        (State::Idle, [0.0; 3])
    );
}

#[test]
fn soft_limits_stop_the_machine_deafen_it_and_keep_the_beam_off() {
    let mut b = Bench::new(Settings {
        homing: true,
        soft_limits: true,
        homing_seek_mm_min: 60_000.0,
        ..Settings::default()
    });
    assert!(
        b.send("G0X-5\n", 0.1).contains("error:9"),
        "locked until homed"
    );
    b.send("$H\n", 10.0);
    assert_eq!(b.machine.position_mm(), [-1.0; 3]);
    let said = b.send("M4S500\nG1X-100F3000\nG1X10\n", 5.0);
    assert!(
        said.contains("ALARM:2\r\n[MSG:Reset to continue]"),
        "{said:?}"
    );
    assert!(!b.machine.beam_on());
    assert_eq!(b.raw(b'?', 5.0), "", "silence is not a disconnect");
    let said = b.raw(0x18, 0.2);
    assert!(
        said.contains("Grbl 1.1h") && said.contains("to unlock"),
        "{said:?}"
    );
    assert!(b.raw(b'?', 0.1).contains("<Alarm|"));
}

#[test]
fn the_door_stops_dark_and_lets_go_on() {
    let mut b = Bench::laser();
    b.send(M4, 0.0);
    b.send("G1X60\n", 0.7);
    b.raw(0x84, 1.0);
    assert_eq!(b.machine.state(), State::Door { standing: true });
    assert!(!b.machine.beam_on());
    b.raw(b'~', 5.0);
    assert_eq!(b.machine.position_mm()[0], 60.0);
}

#[test]
fn dwells_run_in_steps_of_50_ms_and_wait_while_held() {
    let mut b = Bench::laser();
    b.send("G4P0.06\n", 0.095);
    assert_eq!(b.said, b"");
    b.wait(0.05);
    assert_eq!(b.said, b"ok\r\n");
    b.said.clear();
    b.send("G4P1\n", 0.5);
    b.raw(b'!', 3.0);
    assert_eq!(b.said, b"");
    b.raw(b'~', 0.3);
    assert_eq!(b.said, b"");
    b.wait(0.4);
    assert_eq!(b.said, b"ok\r\n");
}

#[test]
fn a_rapid_to_the_present_place_is_dropped_and_the_beam_goes_round_the_corner() {
    let mut b = Bench::laser();
    b.send(M4, 0.0);
    b.send("G1X20\nG0X20\nG1Y10\nM5\nM2\n", 3.0);
    let burns = b.machine.burns();
    assert_eq!(burns.len(), 2);
    assert_eq!(burns[0].end_s, burns[1].start_s);
    assert_eq!(crate::sim::strokes(&burns, 0.0125).len(), 1);
}

#[test]
fn the_end_of_a_program_switches_everything_off() {
    let mut b = Bench::laser();
    let said = b.send("M3S500\nG1X5F600\nM2\n", 3.0);
    assert!(said.ends_with("[MSG:Pgm End]\r\nok\r\n"), "{said:?}");
    assert!(!b.machine.beam_on());
    assert_eq!(b.send("M0\n", 0.1), "");
    assert_eq!(b.machine.state(), State::Hold { standing: true });
    assert_eq!(b.raw(b'~', 0.1), "ok\r\n");
}

#[test]
fn the_same_bytes_give_the_same_burns_however_the_clock_is_advanced() {
    let job = format!("{M4}G1X60Y3\nG2X10Y3R40\nG0X0\nG1Y30\nM5\n");
    let run = |step: f64| {
        let mut b = Bench::laser();
        b.machine.write(job.as_bytes());
        while b.machine.now_s() < 12.0 {
            b.wait(step);
        }
        b.machine.burns()
    };
    let whole = run(12.0);
    assert!(whole.len() > 50, "{}", whole.len());
    assert_eq!(whole, run(0.013));
}

#[test]
fn a_dwell_that_ends_while_a_short_hold_still_blocks_the_program_is_over() {
    let mut b = Bench::laser();
    b.send("G4P0.05\n", 0.04);
    b.raw(b'!', 0.0025);
    b.raw(b'~', 1.0);
    assert_eq!(b.said, b"ok\r\n");
}

#[test]
fn a_restarted_controller_calls_the_place_of_the_head_zero_and_burns_where_the_head_is() {
    let mut b = Bench::laser();
    b.send("G21G90\nG0X30Y20\n", 5.0);
    b.machine.reboot();
    b.wait(0.1);
    assert_eq!(b.machine.position_mm(), [0.0; 3]);
    assert_eq!(b.machine.head_mm(), [30.0, 20.0, 0.0]);
    let report = b.raw(b'?', 0.1);
    assert!(report.contains("MPos:0.000,0.000,0.000"), "{report}");
    b.send("M4S500\nG1X10F600\nM5\n", 5.0);
    assert_eq!(b.machine.position_mm(), [10.0, 0.0, 0.0]);
    let burns = b.machine.burns();
    let (first, last) = (burns[0].from_mm, burns[burns.len() - 1].to_mm);
    assert_eq!((first[0], first[1]), (30.0, 20.0));
    assert_eq!((last[0], last[1]), (40.0, 20.0));
}

#[test]
fn homing_finds_the_true_place_again() {
    let mut b = Bench::new(Settings {
        homing: true,
        homing_seek_mm_min: 60_000.0,
        ..Settings::default()
    });
    b.send("$H\n", 10.0);
    b.send("G21G91\nG0X-20\n", 5.0);
    b.machine.reboot();
    assert_eq!(b.machine.position_mm(), [0.0; 3]);
    assert_eq!(b.machine.head_mm(), [-21.0, -1.0, -1.0]);
    b.send("$H\n", 10.0);
    assert_eq!(b.machine.position_mm(), [-1.0; 3]);
    assert_eq!(b.machine.head_mm(), [-1.0; 3]);
}

#[test]
fn a_return_ends_a_line_and_a_return_with_a_newline_answers_twice() {
    let mut b = Bench::laser();
    assert_eq!(b.send("G0X1\r\n", 1.0), "ok\r\nok\r\n");
    assert_eq!(b.send("G0X2\rY3\r", 1.0), "ok\r\nok\r\n");
    assert_eq!(b.machine.position_mm(), [2.0, 3.0, 0.0]);
}

#[test]
fn a_command_number_is_taken_apart_as_the_firmware_does() {
    for word in ["M3.004", "M2.996", "M259"] {
        let mut b = Bench::laser();
        let said = b.send(&format!("G1F600\n{word}S500\n"), 1.0);
        let fine = said == "ok\r\nok\r\n";
        assert_eq!(fine, word != "M2.996", "{word}: {said:?}");
        assert_eq!(b.machine.beam_on(), fine, "{word}");
    }
    let mut b = Bench::laser();
    assert_eq!(
        b.send("M3.01\nG1.5X1\nG28.2\n", 1.0),
        "error:23\r\nerror:23\r\nerror:20\r\n"
    );
    assert_eq!(b.send("G91.1\nG92X0\nG92.1\n", 1.0), "ok\r\nok\r\nok\r\n");
}

#[test]
fn a_line_that_waited_when_the_reset_came_is_answered_before_the_banner() {
    let mut b = Bench::laser();
    b.send("G4P5\n", 1.0);
    assert!(b.raw(0x18, 0.1).starts_with("ok\r\n\r\nGrbl 1.1h"));
    b.send("M4S5\nG1X50F600\nM5\n", 1.0);
    assert!(
        b.raw(0x18, 0.1)
            .starts_with("ALARM:3\r\nok\r\n\r\nGrbl 1.1h")
    );
    // One that was answered already is not answered again.
    b.send("$X\nM4S5\nG1X50F600\n", 1.0);
    assert!(b.raw(0x18, 0.1).starts_with("ALARM:3\r\n\r\nGrbl 1.1h"));
}
