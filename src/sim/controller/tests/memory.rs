//! Settings, offsets and startup lines: what is kept, and what keeping it costs.

use super::*;

#[test]
fn every_setting_that_is_told_can_be_set_and_outlives_the_power() {
    let mut b = Bench::laser();
    b.send("$22=1\n", 0.5);
    let read = |b: &mut Bench| {
        let said = b.send("$$\n", 0.5);
        let lines = said.lines().filter(|l| l.starts_with('$'));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    let before = read(&mut b);
    assert_eq!(before.len(), 34);
    let mut wanted = Vec::new();
    for line in &before {
        let (name, value) = line.split_once('=').unwrap();
        let flag = matches!(name, "$13" | "$20" | "$21" | "$22" | "$32");
        let new: f64 = if flag {
            1.0
        } else {
            value.parse::<f64>().unwrap() + 3.0
        };
        let decimals = value.split_once('.').map_or(0, |(_, d)| d.len());
        assert_eq!(b.send(&format!("{name}={new}\n"), 0.5), "ok\r\n", "{line}");
        wanted.push(format!("{name}={new:.decimals$}"));
    }
    assert_eq!(read(&mut b), wanted);
    b.machine.power_on([0.0; 3]);
    b.wait(0.5);
    assert_eq!(read(&mut b), wanted);
    // As shipped again, with a reset.
    let said = b.send("$RST=$\n", 0.5);
    assert!(
        said.starts_with("[MSG:Restoring defaults]\r\nok\r\n\r\nGrbl 1.1h"),
        "{said}"
    );
    assert!(read(&mut b).contains(&"$22=0".to_owned()));
    assert_eq!(b.send("$RST=7\n", 0.2), "error:3\r\n");
}

#[test]
fn settings_are_refused_with_grbls_numbers() {
    let mut b = Bench::laser();
    for (line, error) in [
        ("$11=-1", 4),
        ("$0=2", 6),
        ("$20=1", 10),
        ("$99=1", 3),
        ("$103=1", 3),
        ("$300=1", 3),
        ("$11", 3),
        ("$11=x", 2),
        ("$11=1x", 3),
    ] {
        assert_eq!(
            b.send(&format!("{line}\n"), 0.2),
            format!("error:{error}\r\n"),
            "{line}"
        );
    }
}

#[test]
fn each_write_to_the_memory_loses_what_comes_meanwhile() {
    for line in [
        "$11=0.02",
        "G10L2P1X5",
        "G10L20P1X0",
        "G28.1",
        "G30.1",
        "$N0=G21",
    ] {
        let mut b = Bench::laser();
        b.send(&format!("{line}\n"), 0.012);
        b.send("G1X9F600\n", 1.0);
        assert!(b.machine.lost_bytes() > 0, "{line}");
        // One that waits for the answer and a moment longer loses nothing.
        let mut b = Bench::laser();
        assert_eq!(b.send(&format!("{line}\n"), 0.1), "ok\r\n");
        b.send("G1X9F600\n", 1.0);
        assert_eq!(b.machine.lost_bytes(), 0, "{line}");
    }
}

#[test]
fn offsets_outlive_a_reset_and_the_power_but_g92_does_not() {
    let mut b = Bench::laser();
    b.send("G0X5Y6\n", 2.0);
    b.send("G10L2P2X1Y2Z3\n", 0.2);
    b.send("G28.1\n", 0.2);
    b.send("G0X7\n", 2.0);
    b.send("G30.1\n", 0.2);
    b.send("G92X0\n", 0.2);
    let said = b.send("$#\n", 0.3);
    let wanted = "[G54:0.000,0.000,0.000]\r\n[G55:1.000,2.000,3.000]\r\n[G56:0.000,0.000,0.000]\r\n\
        [G57:0.000,0.000,0.000]\r\n[G58:0.000,0.000,0.000]\r\n[G59:0.000,0.000,0.000]\r\n\
        [G28:5.000,6.000,0.000]\r\n[G30:7.000,6.000,0.000]\r\n[G92:7.000,0.000,0.000]\r\n[TLO:0.000]\r\n\
        [PRB:0.000,0.000,0.000:0]\r\nok\r\n";
    assert_eq!(said, wanted);
    b.raw(0x18, 0.2);
    assert_eq!(b.send("$#\n", 0.3), wanted.replace("[G92:7", "[G92:0"));
    b.machine.power_on([0.0; 3]);
    b.wait(0.5);
    assert_eq!(b.send("$#\n", 0.3), wanted.replace("[G92:7", "[G92:0"));
    assert_eq!(b.send("$RST=#\n", 0.3).matches("ok").count(), 1);
    assert!(b.send("$#\n", 0.3).contains("[G55:0.000,0.000,0.000]"));
}

#[test]
fn g28_goes_to_the_place_that_was_remembered() {
    let mut b = Bench::laser();
    b.send("G0X5Y6\n", 2.0);
    b.send("G28.1\n", 0.2);
    b.send("G0X20Y20\nG28\n", 4.0);
    assert_eq!(b.machine.position_mm(), [5.0, 6.0, 0.0]);
    b.send("G0X20Y20\nG91G28X0\n", 4.0);
    assert_eq!(b.machine.position_mm(), [5.0, 20.0, 0.0]);
}

#[test]
fn startup_lines_are_kept_run_and_told() {
    let mut b = Bench::laser();
    assert_eq!(b.send("$N0=G91\n", 0.2), "ok\r\n");
    assert_eq!(
        b.send("$N1=G4\n", 0.2),
        "error:28\r\n",
        "tried before it is kept"
    );
    assert_eq!(b.send("$N2=G90\n", 0.2), "error:3\r\n");
    assert_eq!(b.send("$N\n", 0.2), "$N0=G91\r\n$N1=\r\nok\r\n");
    let said = b.raw(0x18, 0.2);
    assert!(said.ends_with("for help]\r\n>G91:ok\r\n"), "{said:?}");
    assert!(b.send("$G\n", 0.2).contains(" G91 "));
    assert_eq!(b.send("$N0=\n", 0.2), "ok\r\n");
    assert!(!b.raw(0x18, 0.2).contains('>'));
}

#[test]
fn the_owners_text_is_told_with_the_version() {
    let mut b = Bench::laser();
    assert_eq!(
        b.send("$I\n", 0.2),
        "[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\nok\r\n"
    );
    b.send("$I=Shed\n", 0.2);
    assert!(b.send("$I\n", 0.2).contains("[VER:1.1h.20190830:SHED]"));
}

#[test]
fn inches_are_reported_when_13_is_set() {
    let mut b = Bench::laser();
    b.send("G0X25.4\n", 2.0);
    b.send("$13=1\n", 0.2);
    b.send("G1F2540\n", 0.2);
    assert!(
        b.raw(b'?', 0.1)
            .contains("MPos:1.0000,0.0000,0.0000|FS:0.0,0")
    );
    assert!(b.send("$G\n", 0.1).contains(" F100.0 "));
}

#[test]
fn a_machine_that_is_not_idle_answers_8_to_what_takes_long() {
    let mut b = Bench::laser();
    b.send("G1X50F600\n", 0.2);
    for line in [
        "$$", "$#", "$I", "$N", "$H", "$11=0.1", "$RST=$", "$SLP", "$C", "$J=X1F5",
    ] {
        let said = b.send(&format!("{line}\n"), 0.05);
        assert_eq!(said, "error:8\r\n", "{line}");
    }
    assert!(b.send("$G\n", 0.05).contains("ok"));
    assert!(b.send("$\n", 0.05).contains("[HLP:"));
}

#[test]
fn soft_limits_hold_in_check_mode_too() {
    let mut b = Bench::new(Settings {
        homing: true,
        soft_limits: true,
        homing_seek_mm_min: 60_000.0,
        ..Settings::default()
    });
    b.send("$H\n", 10.0);
    b.send("$C\n", 0.1);
    let said = b.send("G90G1X-100F3000\nG1X10\n", 1.0);
    assert!(said.contains("ok\r\nALARM:2"), "{said}");
}

#[test]
fn the_report_tells_offsets_and_overrides_as_often_as_the_firmware_does() {
    let mut b = Bench::laser();
    let fields: Vec<String> = (0..24).map(|_| b.raw(b'?', 0.05)).collect();
    let at = |what: &str| -> Vec<usize> { (0..24).filter(|&k| fields[k].contains(what)).collect() };
    assert_eq!(at("|WCO:"), [0, 10, 20]);
    assert_eq!(at("|Ov:"), [1, 11, 21]);
}
