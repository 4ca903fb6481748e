//! Probing: what is found, what it costs, and what is said of it.

use super::*;

const SURFACE_MM: f64 = -20.0;

fn over_a_sheet(flavour: Flavour) -> Bench {
    let settings = Settings {
        laser_mode: false,
        surface_mm: Some(SURFACE_MM),
        ..Settings::default()
    };
    Bench::new(settings.with_flavour(flavour))
}

fn bench() -> Bench {
    over_a_sheet(Flavour::Grbl)
}

fn z(b: &Bench) -> f64 {
    b.machine.position_mm()[2]
}

/// What `$#` tells of the last probing.
fn last(b: &mut Bench) -> String {
    let said = b.send("$#\n", 0.3);
    said.lines()
        .find(|l| l.starts_with("[PRB:"))
        .unwrap()
        .to_owned()
}

#[test]
fn the_surface_is_found_told_and_pressed_into_by_the_braking_distance() {
    for (feed, deep_mm) in [(600.0, 0.1), (150.0, 0.00625), (3000.0, 2.5)] {
        let mut b = bench();
        let said = b.send(&format!("G21G91\nG0X3\nG38.2Z-40F{feed}\n"), 20.0);
        assert_eq!(said, "ok\r\nok\r\n[PRB:3.000,0.000,-20.000:1]\r\nok\r\n");
        // Speed squared over twice the acceleration, to a step.
        let pressed = SURFACE_MM - z(&b);
        assert!((pressed - deep_mm).abs() < 0.0126, "F{feed}: {pressed}");
        assert_eq!(b.machine.state(), State::Idle);
        // The position is known: what follows starts where the head stands.
        let before = z(&b);
        b.send("G1Z5F600\n", 2.0);
        assert!((z(&b) - before - 5.0).abs() < 0.0126);
        assert_eq!(last(&mut b), "[PRB:3.000,0.000,-20.000:1]");
        b.raw(0x18, 0.2);
        assert_eq!(
            last(&mut b),
            "[PRB:0.000,0.000,0.000:0]",
            "a reset forgets it"
        );
    }
}

#[test]
fn a_torch_is_referenced_as_tables_do_it() {
    let mut b = bench();
    // Down quickly, up a little, down slowly; the surface is zero, and the torch pierces 4 mm above it.
    let job = "G21G90\nG92Z0\nG38.2Z-50F1500\nG91G0Z2\nG38.2Z-5F60\nG92Z0\nG90G0Z4\nM3S1000\nG4P0.5\nM5\n";
    let said = b.send(job, 30.0);
    assert_eq!(said.matches("ok\r\n").count(), 10, "{said}");
    assert_eq!(said.matches("[PRB:0.000,0.000,-20.000:1]").count(), 2);
    // The zero lies a step at most below the surface: F60 brakes within it.
    assert!((z(&b) - (SURFACE_MM + 4.0)).abs() < 0.026, "{}", z(&b));
}

#[test]
fn nothing_found_is_alarm_5_or_not() {
    let mut b = bench();
    let said = b.send("G21G91\nG38.2Z-10F600\nG0X5\n", 5.0);
    assert_eq!(
        said,
        "ok\r\nALARM:5\r\n[PRB:0.000,0.000,0.000:0]\r\nok\r\nerror:9\r\n"
    );
    assert!(b.report().contains("<Alarm|"));
    assert_eq!(z(&b), -10.0, "it went all the way");
    // Locked, not deaf.
    assert!(b.send("$X\n", 0.1).contains("ok"));
    let said = b.send("G91G38.3Z-5F600\n", 5.0);
    assert_eq!(said, "[PRB:0.000,0.000,-15.000:0]\r\nok\r\n");
    assert_eq!(b.machine.state(), State::Idle);
    let said = b.send("G38.3Z-15\n", 5.0);
    assert_eq!(said, "[PRB:0.000,0.000,-20.000:1]\r\nok\r\n");
    // Where there is no sheet at all.
    let mut b = Bench::torch();
    assert!(b.send("G38.2Z-100F3000\n", 10.0).starts_with("ALARM:5\r\n"));
}

#[test]
fn touching_already_is_alarm_4_and_nothing_moves() {
    for way in ["G38.2", "G38.3"] {
        let mut b = bench();
        b.send("G21G91\nG38.2Z-30F600\n", 5.0);
        let place = b.machine.position_mm();
        let said = b.send(&format!("{way}Z-5\n"), 3.0);
        assert_eq!(said, "ALARM:4\r\nok\r\n");
        assert_eq!(b.machine.position_mm(), place);
        assert_eq!(last(&mut b), "[PRB:0.000,0.000,-20.000:0]");
        // Unlocked, relative motion starts from here.
        b.send("$X\nG91G0Z3\n", 2.0);
        assert!((z(&b) - place[2] - 3.0).abs() < 0.0126);
    }
    // Away from a contact that is not closed.
    let mut b = bench();
    assert_eq!(b.send("G91G38.4Z5F600\n", 2.0), "ALARM:4\r\nok\r\n");
}

#[test]
fn away_from_the_sheet_the_first_step_off_it_is_told() {
    let mut b = bench();
    b.send("G21G91\nG38.2Z-30F3000\n", 5.0);
    assert!(
        b.report().contains("|Pn:P|"),
        "the pin is told while it touches"
    );
    let said = b.send("G38.4Z10F60\n", 10.0);
    // A step of 1/80 mm above the surface.
    assert_eq!(said, "[PRB:0.000,0.000,-19.988:1]\r\nok\r\n");
    assert!(!b.report().contains("Pn:"));
    b.send("G38.3Z-3\n", 10.0);
    let deep = z(&b);
    let said = b.send("G38.5Z-1\n", 5.0);
    assert!(said.contains(":0]\r\nok"), "the wrong way: {said}");
    assert!(b.machine.state() == State::Idle && z(&b) < deep);
    assert!(b.send("G38.4Z-1\n", 5.0).starts_with("ALARM:5\r\n"));
}

#[test]
fn the_surface_lies_on_the_bed_wherever_the_controller_counts_from() {
    let mut b = bench();
    b.send("G21G91\nG0Z-5\n", 3.0);
    b.machine.reboot();
    b.wait(0.2);
    let said = b.send("G91G38.2Z-40F60\n", 60.0);
    assert_eq!(said, "[PRB:0.000,0.000,-15.000:1]\r\nok\r\n");
    assert!((b.machine.head_mm()[2] - SURFACE_MM).abs() < 0.0126);
}

#[test]
fn a_slanted_way_tells_where_it_touched() {
    let mut b = bench();
    let said = b.send("G21G91\nG38.2X20Z-40F600\n", 10.0);
    assert_eq!(said, "ok\r\n[PRB:10.000,0.000,-20.000:1]\r\nok\r\n");
}

#[test]
fn the_feed_override_does_not_touch_probing() {
    let mut b = bench();
    for _ in 0..10 {
        b.raw(0x91, 0.01);
    }
    b.send("G91G38.2Z-40F600\n", 1.0);
    assert!(b.report().contains("|FS:600,"));
}

#[test]
fn a_hold_in_probing_goes_on_with_it_and_one_that_touches_waits_for_resume() {
    let mut b = bench();
    b.send("G91G38.2Z-40F600\n", 1.0);
    b.raw(b'!', 0.5);
    assert_eq!(b.machine.state(), State::Hold { standing: true });
    assert!(b.report().contains("<Hold:0|"));
    assert_eq!(b.raw(b'~', 5.0), "[PRB:0.000,0.000,-20.000:1]\r\nok\r\n");
    // At 50 mm/s it takes 2.5 mm to a rest: held 1 mm above the sheet it touches while it brakes.
    let mut b = bench();
    b.machine.write(b"G91G38.2Z-40F3000\n");
    while z(&b) > SURFACE_MM + 1.0 {
        b.wait(0.001);
    }
    assert_eq!(b.raw(b'!', 2.0), "");
    assert_eq!(b.machine.state(), State::Hold { standing: true });
    let stands = z(&b);
    assert!(stands < SURFACE_MM && stands > SURFACE_MM - 2.5);
    assert_eq!(b.raw(b'~', 1.0), "[PRB:0.000,0.000,-20.000:1]\r\nok\r\n");
    assert_eq!(z(&b), stands, "the rest is forgotten");
    // The same where the hold comes after the touch.
    let mut b = bench();
    b.machine.write(b"G91G38.2Z-40F3000\n");
    while z(&b) > SURFACE_MM - 0.5 {
        b.wait(0.001);
    }
    assert_eq!(b.raw(b'!', 2.0), "");
    assert!((SURFACE_MM - z(&b) - 2.5).abs() < 0.02);
    assert_eq!(b.raw(b'~', 1.0), "[PRB:0.000,0.000,-20.000:1]\r\nok\r\n");
}

#[test]
fn a_reset_in_probing_is_alarm_3_and_probes_nothing() {
    let mut b = bench();
    b.send("G91G38.2Z-40F600\n", 1.0);
    let said = b.raw(0x18, 0.5);
    assert!(said.contains("ALARM:3") && !said.contains("PRB"), "{said}");
    assert_eq!(b.machine.state(), State::Alarm);
    b.send("$X\n", 0.1);
    assert_eq!(last(&mut b), "[PRB:0.000,0.000,0.000:0]");
    // The next one starts from nothing.
    let said = b.send("G91G38.2Z-40F600\n", 5.0);
    assert!(said.contains(":1]\r\nok"), "{said}");
}

#[test]
fn probing_waits_for_what_is_planned_and_leaves_the_output_alone() {
    let mut b = bench();
    b.send("G21G90\nM3S500\nG1X30F3000\nG38.2Z-10F600\n", 0.3);
    assert_eq!(z(&b), 0.0);
    let said = b.wait(5.0);
    assert!(said.contains("ALARM:5") && said.contains("[PRB:"), "{said}");
    assert_eq!(b.machine.position_mm(), [30.0, 0.0, -10.0]);
    assert!(b.machine.beam_on(), "ALARM:5 switches nothing off");
}

#[test]
fn in_check_mode_nothing_is_probed() {
    let mut b = bench();
    b.send("$C\n", 0.1);
    assert_eq!(
        b.send("G38.2Z-40F600\nG38.2F600\n", 1.0),
        "ok\r\nerror:26\r\n"
    );
    assert_eq!(z(&b), 0.0);
}

#[test]
fn modes_are_told_and_the_tool_s_length_with_them() {
    let mut b = bench();
    b.send("G21G91\nG38.3Z-1F600\n", 3.0);
    let modes = b.send("G93\n$G\n", 0.2);
    assert!(
        modes.contains("[GC:G38.3 G54 G17 G21 G91 G93 M5"),
        "{modes}"
    );
    for _ in 0..3 {
        b.report();
    }
    b.send("G43.1Z2.5\n", 0.1);
    assert!(b.report().contains("|WCO:0.000,0.000,2.500"));
    assert!(b.send("$#\n", 0.3).contains("[TLO:2.500]\r\n"));
    b.send("G49\n", 0.1);
    assert!(b.report().contains("|WCO:0.000,0.000,0.000"));
}

#[test]
fn the_successors_probe_alike() {
    for flavour in [Flavour::GrblHal, Flavour::FluidNc] {
        let mut b = over_a_sheet(flavour);
        let said = b.send("G91G38.2Z-40F600\n", 10.0);
        assert_eq!(said, "[PRB:0.000,0.000,-20.000:1]\r\nok\r\n");
        let said = b.send("G38.2Z-1F600\n", 1.0);
        assert!(said.contains("ALARM:4\r\n"), "{said}");
    }
}

#[test]
fn an_estimate_ends_probing_on_the_sheet() {
    let settings = bench().machine.settings().clone();
    let time = |job: &str| crate::sim::estimate(job, &settings).unwrap().time_s;
    let (probed, rest) = (
        time("G90\nG38.2Z-90F600\nG91G0Z5\n"),
        time("G90\nG1Z-20F600\nG4P0\nG91G0Z5\n"),
    );
    assert!((probed - rest).abs() < 1e-2, "{probed} {rest}");
}
