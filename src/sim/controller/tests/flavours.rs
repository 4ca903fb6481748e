//! Where grblHAL and FluidNC differ from GRBL.

use super::*;

fn bench(flavour: Flavour) -> Bench {
    Bench::new(Settings::default().with_flavour(flavour))
}

#[test]
fn grblhal_repeats_an_error_until_a_dollar_command_or_a_reset() {
    let mut b = bench(Flavour::GrblHal);
    let said = b.send("G21G90\nG1F600\nG0X5Q3\nG1X7\nM5\n", 3.0);
    assert_eq!(said, "ok\r\nok\r\nerror:20\r\nerror:20\r\nerror:20\r\n");
    assert_eq!(b.machine.position_mm()[0], 0.0);
    b.send("$G\n", 0.1);
    assert_eq!(b.send("G1X7\n", 3.0), "ok\r\n");
    b.send("G5\n", 0.1);
    b.raw(0x18, 0.5);
    assert_eq!(b.send("G0X3\n", 3.0), "ok\r\n");
}

#[test]
fn grblhal_tells_its_free_buffers_and_keeps_one_byte() {
    let mut b = bench(Flavour::GrblHal);
    assert!(b.raw(b'?', 0.1).contains("|Bf:100,1023|"));
    b.raw(b'!', 0.1);
    b.machine.write(&[b' '; 1023]);
    b.wait(0.5);
    assert_eq!(b.machine.lost_bytes(), 0);
    b.machine.write(b" ");
    b.wait(0.5);
    assert_eq!(b.machine.lost_bytes(), 1);
    let mut b = Bench::laser();
    assert!(
        !b.raw(b'?', 0.1).contains("Bf:"),
        "GRBL as shipped does not"
    );
    b.send("$10=3\n", 0.2);
    assert!(b.raw(b'?', 0.1).contains("|Bf:15,128|"));
}

#[test]
fn each_says_who_it_is() {
    for (flavour, banner, info) in [
        (Flavour::Grbl, "Grbl 1.1h [", "[OPT:V,15,128]"),
        (
            Flavour::GrblHal,
            "GrblHAL 1.1f [",
            "[OPT:VNMSL,100,1024,3,0]\r\n[AXS:3:XYZ]",
        ),
        (
            Flavour::FluidNc,
            "Grbl 3.7 [FluidNC v",
            "[VER:3.7 FluidNC v",
        ),
    ] {
        let mut b = bench(flavour);
        let said = b.raw(0x18, 0.2);
        assert!(said.starts_with(&format!("\r\n{banner}")), "{said}");
        let said = b.send("$I\n", 0.2);
        assert!(said.contains(info) && said.ends_with("ok\r\n"), "{said}");
        assert_eq!(
            said.contains("[FIRMWARE:grblHAL]"),
            flavour == Flavour::GrblHal
        );
    }
}

#[test]
fn the_successors_hear_while_they_write_and_dwell_as_long_as_asked() {
    for flavour in [Flavour::GrblHal, Flavour::FluidNc] {
        let mut b = bench(flavour);
        b.send("G10L2P1X0\n", 0.01);
        b.send("G1X9F600\n", 2.0);
        assert_eq!(b.machine.lost_bytes(), 0);
        assert_eq!(b.machine.position_mm()[0], 9.0);
        b.said.clear();
        b.send("G4P0.01\n", 0.02);
        assert_eq!(b.said, b"ok\r\n");
        // Two ends of a line in a pair are one.
        assert_eq!(b.send("G21\r\nG90\r\n\n", 0.2), "ok\r\nok\r\nok\r\n");
        let line = |n: usize| format!("G0X{}\n", "0".repeat(n - 3));
        assert_eq!(b.send(&line(255), 1.0), "ok\r\n");
        assert_eq!(b.send(&line(256), 1.0), "error:11\r\n");
        assert_eq!(b.send("$\nM7\nM9\n", 0.2).matches("ok").count(), 3);
    }
    assert_eq!(Bench::laser().send("M7\n", 0.2), "error:20\r\n");
}

#[test]
fn the_successors_answer_in_a_locked_state() {
    for (flavour, state) in [
        (Flavour::GrblHal, "<Alarm:1|"),
        (Flavour::FluidNc, "<Alarm|"),
    ] {
        let mut b = bench(flavour);
        b.machine.limit_switch();
        assert!(b.wait(0.1).contains("ALARM:1\r\n"));
        assert!(b.raw(b'?', 0.1).contains(state));
        assert_eq!(b.send("$X\n", 0.1), "", "deaf to lines all the same");
        assert!(b.raw(0x18, 0.2).contains("to unlock"));
    }
}

#[test]
fn fluidnc_shows_few_settings_and_takes_one_by_its_number() {
    let mut b = bench(Flavour::FluidNc);
    let said = b.send("$$\n", 0.5);
    assert!(said.contains("$32=1\r\n") && said.contains("$30=1000\r\n") && !said.contains("$11="));
    assert!(b.send("$S\n", 0.5).contains("$Grbl/MaxRate/Y=6000.000\r\n"));
    assert_eq!(b.send("$30=255\n", 0.2), "error:3\r\n");
    assert!(!b.raw(b'?', 0.1).contains("Bf:"));
    assert_eq!(b.send("$Report/Status=3\n", 0.2), "ok\r\n");
    assert!(b.raw(b'?', 0.1).contains("|Bf:16,256|"));
    b.machine.limit_switch();
    let said = b.wait(0.2);
    assert_eq!(
        said,
        "[MSG:INFO: ALARM: Hard Limit]\r\nALARM:1\r\n[MSG:INFO: Reset to continue]\r\n"
    );
}

#[test]
fn a_profile_chooses_its_firmware() {
    for (name, flavour, buffer) in [
        ("diode-400", Flavour::Grbl, 128),
        ("co2-900x600-grblhal", Flavour::GrblHal, 1024),
        ("diode-400-fluidnc", Flavour::FluidNc, 256),
    ] {
        let machine = crate::machine::load(name).unwrap();
        let settings = Settings::of_machine(&machine);
        assert_eq!(
            (settings.flavour, settings.receive_buffer),
            (flavour, buffer)
        );
    }
}
