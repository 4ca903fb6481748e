//! Without laser mode (`$32=0`), as on a plasma table: when the output is on, and who switches it.

use super::*;

const JOB: &str = "G21G90\nM3S500\nG1F3000X60\n";

/// In the middle of [`JOB`]'s cut, counters of the report run in.
fn cutting(b: &mut Bench) {
    b.send(JOB, 0.7);
    for _ in 0..3 {
        b.report();
    }
    assert_eq!(b.machine.state(), State::Run);
    b.said.clear();
}

/// What a report tells of the output: `A:`, and the S of `FS:`.
fn told(report: &str) -> (Option<&str>, &str) {
    let field = |name: &str| {
        report
            .trim_end_matches(['>', '\r', '\n'])
            .split('|')
            .find_map(move |f| f.strip_prefix(name))
    };
    let rate_and_s = field("FS:").unwrap_or_default();
    (
        field("A:"),
        rate_and_s.split_once(',').map_or("", |(_, s)| s),
    )
}

#[test]
fn the_output_is_steady_through_rapids_dwells_and_holds() {
    let mut b = Bench::torch();
    b.send(
        "G21G90\nM3S500\nG4P0.3\nG1F3000X20\nG0X40\nG28X30\nG4P0.2\n",
        1.0,
    );
    b.raw(b'!', 2.0);
    assert_eq!(b.machine.state(), State::Hold { standing: true });
    assert!(b.machine.beam_on());
    assert_eq!(told(&b.report()).1, "500");
    b.raw(b'~', 5.0);
    assert_eq!(b.machine.state(), State::Idle);
    assert_eq!(b.machine.beam_changes().len(), 1, "on once, and never off");
    assert!(
        !String::from_utf8_lossy(&b.said).contains("MSG"),
        "nothing was restored"
    );
    assert!(
        b.machine
            .burns()
            .iter()
            .all(|burn| !burn.dynamic && burn.s == 500.0)
    );
}

#[test]
fn in_a_hold_0x9e_switches_the_output_off_and_on_again_and_each_next_report_tells() {
    let mut b = Bench::torch();
    cutting(&mut b);
    b.raw(b'!', 1.0);
    assert_eq!(
        told(&b.report()),
        (None, "500"),
        "a hold changes nothing, so nothing is told"
    );
    b.raw(0x9e, 0.05);
    assert!(!b.machine.beam_on());
    let off = b.report();
    assert!(
        off.contains("<Hold:0|") && off.contains("|Ov:100,100,100>"),
        "{off}"
    );
    assert_eq!(told(&off), (None, "0"));
    let said = b.raw(0x9e, 0.05);
    assert_eq!(said, "[MSG:Restoring spindle]\r\n");
    assert!(b.machine.beam_on());
    assert_eq!(told(&b.report()), (Some("S"), "500"));
    assert_eq!(told(&b.report()).0, None, "and only once");
    // On the way on the head moves at once: nothing was left to be restored.
    assert_eq!(b.raw(b'~', 0.01), "");
    assert_eq!(b.machine.state(), State::Run);
}

#[test]
fn resume_lights_an_output_that_was_stopped_and_moves_on_at_once() {
    let mut b = Bench::torch();
    cutting(&mut b);
    b.raw(b'!', 1.0);
    b.raw(0x9e, 0.5);
    let place = b.machine.position_mm();
    let said = b.raw(b'~', 0.01);
    assert_eq!(said, "[MSG:Restoring spindle]\r\n");
    assert!(b.machine.beam_on() && b.machine.state() == State::Run);
    assert!(b.machine.position_mm()[0] > place[0]);
    assert_eq!(told(&b.report()), (Some("S"), "500"));
    b.wait(5.0);
    assert_eq!(b.machine.position_mm()[0], 60.0);
}

#[test]
fn a_stop_while_braking_waits_until_it_stands_and_comes_in_a_hold_only() {
    let mut b = Bench::torch();
    cutting(&mut b);
    b.raw(0x9e, 0.05);
    assert!(b.machine.beam_on(), "not in a run");
    b.raw(b'!', 0.01);
    b.raw(0x9e, 0.001);
    // A second one changes nothing yet.
    b.raw(0x9e, 0.01);
    assert_eq!(b.machine.state(), State::Hold { standing: false });
    assert!(b.machine.beam_on(), "while braking");
    b.wait(0.5);
    assert!(!b.machine.beam_on());
    let head = b.machine.head_mm();
    let last = b.machine.burns().last().copied().unwrap();
    assert_eq!(
        last.to_mm,
        [head[0], head[1]],
        "off where it stands, not before"
    );
    // Idle: nobody listens.
    let mut b = Bench::torch();
    b.send("M3S500\n", 0.1);
    b.raw(0x9e, 0.1);
    assert!(b.machine.beam_on());
}

#[test]
fn the_door_switches_off_once_it_stands_and_gives_the_torch_four_seconds_to_come_back() {
    let mut b = Bench::torch();
    cutting(&mut b);
    assert_eq!(b.raw(0x84, 0.01), "[MSG:Check Door]\r\n");
    assert!(
        b.report().contains("<Door:2|") && b.machine.beam_on(),
        "braking"
    );
    b.wait(0.5);
    assert!(!b.machine.beam_on());
    let report = b.report();
    assert!(report.contains("<Door:0|"), "{report}");
    assert_eq!(told(&report), (None, "0"));
    assert!(report.contains("|Ov:"), "told after the change: {report}");
    // 0x9E means nothing here, and another door only its message.
    assert_eq!(b.raw(0x9e, 0.05), "");
    assert_eq!(b.raw(0x84, 0.05), "[MSG:Check Door]\r\n");
    assert!(!b.machine.beam_on());
    let place = b.machine.position_mm();
    assert_eq!(b.raw(b'~', 3.9), "");
    let report = b.report();
    assert!(report.contains("<Door:3|"), "{report}");
    assert_eq!(told(&report), (Some("S"), "500"));
    assert!(b.machine.beam_on());
    assert_eq!(b.machine.position_mm(), place);
    b.wait(0.2);
    assert!(b.machine.state() == State::Run && b.machine.position_mm()[0] > place[0]);
    b.wait(5.0);
    assert_eq!(b.machine.position_mm()[0], 60.0);
    let burns = b.machine.burns();
    let there = burns
        .iter()
        .filter(|burn| burn.standing() && burn.from_mm == [place[0], place[1]]);
    let lit_s: f64 = there.map(|burn| burn.end_s - burn.start_s).sum();
    assert!((lit_s - 4.0).abs() < 1e-6, "{lit_s}");
}

#[test]
fn a_door_that_opens_again_while_the_torch_comes_back_is_dark_again() {
    let mut b = Bench::torch();
    cutting(&mut b);
    b.raw(0x84, 1.0);
    b.raw(b'~', 2.0);
    assert!(b.machine.beam_on());
    assert_eq!(b.raw(0x84, 0.1), "[MSG:Check Door]\r\n");
    assert!(!b.machine.beam_on());
    b.wait(10.0);
    assert_eq!(b.machine.state(), State::Door { standing: true });
    b.raw(b'~', 10.0);
    assert_eq!(b.machine.position_mm()[0], 60.0);
}

#[test]
fn a_door_in_a_hold_takes_over_from_a_stop_and_resume_lights_the_torch_all_the_same() {
    for stopped in [false, true] {
        let mut b = Bench::torch();
        cutting(&mut b);
        b.raw(b'!', 1.0);
        if stopped {
            b.raw(0x9e, 0.1);
        }
        assert_eq!(b.machine.beam_on(), !stopped);
        assert_eq!(b.raw(0x84, 0.1), "[MSG:Check Door]\r\n");
        assert!(!b.machine.beam_on() && b.machine.state() == State::Door { standing: true });
        b.raw(b'~', 1.0);
        assert!(b.machine.beam_on() && b.machine.state() == State::Restoring);
        b.wait(8.0);
        assert_eq!(b.machine.position_mm()[0], 60.0);
        assert!(!String::from_utf8_lossy(&b.said).contains("Restoring"));
    }
    // A hold that the door overtakes before it stands.
    let mut b = Bench::torch();
    cutting(&mut b);
    b.machine.write(&[b'!', 0x9e, 0x84]);
    b.wait(1.0);
    assert!(!b.machine.beam_on() && b.machine.state() == State::Door { standing: true });
}

#[test]
fn the_door_also_switches_off_what_stands_idle_or_pierces() {
    for job in ["M3S500\n", "M3S500\nG4P3\n"] {
        let mut b = Bench::torch();
        b.send(job, 0.5);
        assert!(b.machine.beam_on());
        b.raw(0x84, 0.1);
        assert!(!b.machine.beam_on());
        b.raw(b'~', 3.9);
        assert!(b.machine.beam_on() && b.machine.state() == State::Restoring);
        b.wait(0.2);
        assert!(b.machine.beam_on() && b.machine.state() == State::Idle);
    }
}

#[test]
fn a_program_pause_leaves_the_output_on() {
    let mut b = Bench::torch();
    let said = b.send("G21G90\nG1F3000\nM3S500\nX10\nM0\nX20\n", 2.0);
    assert_eq!(said.matches("ok").count(), 4);
    assert_eq!(b.machine.state(), State::Hold { standing: true });
    assert!(b.machine.beam_on() && b.machine.position_mm()[0] == 10.0);
    b.raw(0x9e, 0.1);
    assert!(!b.machine.beam_on());
    // Nothing is planned: the output comes back, and the program goes on.
    let said = b.raw(b'~', 2.0);
    assert_eq!(said, "[MSG:Restoring spindle]\r\nok\r\nok\r\n");
    assert!(b.machine.beam_on() && b.machine.position_mm()[0] == 20.0);
    // With nothing to stop, 0x9E is forgotten.
    let mut b = Bench::torch();
    b.send("M0\n", 0.1);
    b.raw(0x9e, 0.1);
    assert_eq!(b.raw(b'~', 0.1), "ok\r\n");
}

#[test]
fn a_reset_keeps_the_position_where_it_stands_and_loses_it_in_motion() {
    let braking: &[u8] = b"!\x9e";
    let run: &[u8] = b"";
    for (bytes, wait_s, kept) in [
        (run, 0.0, false),
        (braking, 0.01, false),
        (b"\x84", 0.01, false),
        (b"!", 1.0, true),
        (b"!\x9e", 1.0, true),
        (b"\x84", 1.0, true),
        (b"!\x84", 1.0, true),
    ] {
        let mut b = Bench::torch();
        cutting(&mut b);
        b.machine.write(bytes);
        b.wait(wait_s);
        let lit = b.machine.beam_on();
        let place = b.machine.head_mm();
        let said = b.raw(0x18, 0.1);
        assert!(!b.machine.beam_on());
        assert_eq!(said.contains("ALARM:3"), !kept, "{bytes:?}: {said}");
        assert_eq!(
            b.machine.state(),
            if kept { State::Idle } else { State::Alarm }
        );
        assert_eq!(b.machine.head_mm() == place, kept, "{bytes:?}");
        assert_eq!(b.machine.head_mm() == b.machine.position_mm(), kept);
        assert!(kept || lit, "the output is on until it stands");
        // The next hold starts from nothing.
        b.send("$X\n", 0.1);
        b.send("M3S500\nG91G1F3000X30\n", 0.4);
        b.raw(b'!', 1.0);
        assert!(b.machine.beam_on());
    }
    // While the output comes back the head stands.
    let mut b = Bench::torch();
    cutting(&mut b);
    b.raw(0x84, 1.0);
    b.raw(b'~', 1.0);
    let said = b.raw(0x18, 10.0);
    assert!(!said.contains("ALARM") && !b.machine.beam_on());
    assert_eq!(b.machine.state(), State::Idle);
}

#[test]
fn nothing_is_lit_without_an_s_word_and_s_acts_at_once_where_it_stands() {
    let mut b = Bench::torch();
    b.send("G21G90\nM3\nG1F3000X5\n", 1.0);
    assert!(b.machine.burns().is_empty());
    for _ in 0..3 {
        assert_eq!(told(&b.report()), (None, "0"));
    }
    b.send("S300\n", 0.05);
    assert_eq!(told(&b.report()), (Some("S"), "300"));
    b.send("S0\n", 0.05);
    assert!(!b.machine.beam_on());
    assert_eq!(told(&b.report()), (None, "0"));
    // The door lights nothing then, and waits all the same.
    b.raw(0x84, 0.1);
    b.raw(b'~', 3.9);
    assert!(!b.machine.beam_on() && b.machine.state() == State::Restoring);
    b.wait(0.2);
    assert_eq!(b.machine.state(), State::Idle);
    // M5 does not forget S; a reset does.
    b.send("S700\nM5\nM3\n", 0.1);
    assert_eq!(told(&b.report()), (Some("S"), "700"));
    b.raw(0x18, 0.1);
    b.send("M3\n", 0.1);
    assert!(!b.machine.beam_on());
}

#[test]
fn an_s_word_while_it_moves_waits_for_the_end_of_what_is_planned() {
    let mut b = Bench::torch();
    b.send("G21G90\nM3S500\nG1F3000X20\nS200X30\n", 3.0);
    let burns = b.machine.burns();
    let change = burns.iter().find(|burn| burn.s == 200.0).unwrap();
    assert_eq!(change.from_mm, [20.0, 0.0]);
    assert!(
        burns
            .iter()
            .any(|burn| burn.s == 500.0 && burn.to_mm == [20.0, 0.0])
    );
}

#[test]
fn m4_is_the_other_way_round_and_as_steady_as_m3() {
    let mut b = Bench::torch();
    b.send("G21G90\nM4S500\nG4P0.2\nG1F3000X20\nG0X0\n", 3.0);
    for _ in 0..4 {
        b.report();
    }
    assert!(b.machine.beam_on());
    assert!(String::from_utf8_lossy(&b.said).contains("|A:C"));
    assert_eq!(b.machine.beam_changes().len(), 1);
    assert!(b.machine.burns().iter().all(|burn| !burn.dynamic));
    b.said.clear();
    b.send("M3\n", 0.1);
    assert_eq!(told(&b.report()), (Some("S"), "500"));
}

#[test]
fn the_spindle_override_acts_at_once_standing_or_held_and_not_on_what_is_stopped() {
    let mut b = Bench::torch();
    b.send("M3S500\n", 0.1);
    b.raw(0x9b, 0.01);
    assert_eq!(told(&b.report()), (None, "450"), "the offset is told first");
    assert_eq!(told(&b.report()), (Some("S"), "450"));
    b.raw(b'!', 0.1);
    b.raw(0x9b, 0.01);
    assert_eq!(told(&b.report()), (Some("S"), "400"));
    b.raw(0x9e, 0.01);
    b.raw(0x9b, 0.01);
    assert_eq!(told(&b.report()), (None, "0"));
    b.raw(b'~', 0.05);
    assert_eq!(told(&b.report()), (Some("S"), "350"));
}

#[test]
fn air_goes_with_the_door_and_comes_back_a_second_after_the_torch() {
    let mut b = Bench::torch();
    cutting(&mut b);
    b.raw(0xa0, 0.01);
    assert_eq!(told(&b.report()).0, Some("SF"));
    b.raw(0x84, 1.0);
    assert_eq!(told(&b.report()).0, None);
    b.raw(b'~', 3.9);
    assert_eq!(told(&b.report()).0, Some("S"));
    b.wait(0.2);
    assert_eq!(told(&b.report()).0, Some("SF"));
    assert_eq!(b.machine.state(), State::Restoring);
    b.wait(1.0);
    assert_eq!(b.machine.state(), State::Run);
    // In laser mode too, where the beam needs no time.
    let mut b = Bench::laser();
    b.send("M8\n", 0.1);
    b.raw(0x84, 0.1);
    b.raw(b'~', 0.9);
    assert_eq!(b.machine.state(), State::Restoring);
    b.wait(0.2);
    assert_eq!(b.machine.state(), State::Idle);
}

#[test]
fn lines_are_taken_while_it_brakes_and_none_once_it_stands() {
    let mut b = Bench::torch();
    cutting(&mut b);
    b.machine.write(b"!");
    assert_eq!(b.send("X70\nX80\n", 0.02), "ok\r\nok\r\n");
    assert_eq!(b.machine.state(), State::Hold { standing: false });
    let place = b.machine.position_mm()[0];
    b.wait(0.5);
    assert!(
        b.machine.position_mm()[0] - place < 2.5,
        "still the shortest way to a rest"
    );
    assert_eq!(b.send("X90\n", 0.5), "");
    assert_eq!(b.raw(b'~', 5.0), "ok\r\n");
    assert_eq!(b.machine.position_mm()[0], 90.0);
    // grblHAL reads nothing either way.
    let mut b = Bench::torch_of(Flavour::GrblHal);
    cutting(&mut b);
    b.machine.write(b"!");
    assert_eq!(b.send("X70\n", 0.5), "");
}

#[test]
fn in_laser_mode_every_hold_stops_the_beam_so_that_0x9e_lights_it_again() {
    // As the source has it: the firmware sends itself a 0x9E, and a second one restores M3 while the head stands.
    for (flavour, lit) in [
        (Flavour::Grbl, true),
        (Flavour::FluidNc, true),
        (Flavour::GrblHal, false),
    ] {
        let mut b = Bench::new(Settings::default().with_flavour(flavour));
        b.send(M3, 0.0);
        b.send("G1X60\n", 0.7);
        b.raw(b'!', 1.0);
        assert!(!b.machine.beam_on());
        b.raw(0x9e, 0.1);
        assert_eq!(b.machine.beam_on(), lit, "{flavour:?}");
        b.raw(b'~', 0.1);
        assert!(b.machine.beam_on(), "the motion lights it");
    }
    let mut b = Bench::laser();
    b.send(M4, 0.0);
    b.send("G1X60\n", 0.7);
    b.raw(b'!', 1.0);
    b.raw(0x9e, 0.1);
    assert!(!b.machine.beam_on(), "M4 is dark where nothing moves");
    // Where nothing moves after it, a beam of M3 stays off.
    let mut b = Bench::laser();
    b.send("G1F600\nM3S500\nG4P2\n", 0.5);
    assert!(b.machine.beam_on());
    b.raw(b'!', 0.1);
    assert!(b.raw(b'~', 0.1).contains("[MSG:Restoring spindle]"));
    assert!(!b.machine.beam_on() && b.machine.state() == State::Idle);
}

#[test]
fn grblhal_tells_what_is_on_whenever_it_changes_and_waits_before_it_moves_on() {
    let mut b = Bench::torch_of(Flavour::GrblHal);
    cutting(&mut b);
    b.raw(b'!', 1.0);
    b.raw(0x9e, 0.05);
    let off = b.report();
    assert!(off.contains("|A:>") && !off.contains("|Ov:"), "{off}");
    assert_eq!(told(&off).1, "0");
    assert_eq!(told(&b.report()).0, None);
    let place = b.machine.position_mm();
    assert_eq!(b.raw(b'~', 3.9), "[MSG:Restoring spindle]\r\n");
    assert_eq!(told(&b.report()).0, Some("S"));
    assert_eq!(
        (b.machine.state(), b.machine.position_mm()),
        (State::Hold { standing: true }, place)
    );
    b.wait(0.2);
    assert_eq!(b.machine.state(), State::Run);
}

#[test]
fn fluidnc_leaves_the_time_behind_the_door_to_the_spindle() {
    let mut b = Bench::torch_of(Flavour::FluidNc);
    cutting(&mut b);
    assert_eq!(b.raw(0x84, 1.0), "[MSG:INFO: Check Door]\r\n");
    assert!(!b.machine.beam_on());
    b.raw(b'~', 0.01);
    assert!(b.machine.beam_on() && b.machine.state() == State::Run);
}
