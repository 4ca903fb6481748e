//! Homing: where it goes, how long it takes, and how it fails.

use super::*;
use crate::sim::Switch;

fn bench(change: impl FnOnce(&mut Settings)) -> Bench {
    let mut settings = Settings {
        homing: true,
        ..Settings::default()
    };
    change(&mut settings);
    Bench::new(settings)
}

/// Homes, and says what it said and how long it took, s.
fn home(b: &mut Bench) -> (String, f64) {
    let start_s = b.machine.now_s();
    b.machine.write(b"$H\n");
    let mut said = String::new();
    while !said.contains("ok\r\n") {
        said += &b.wait(0.01);
        assert!(b.machine.now_s() - start_s < 1000.0, "{said}");
    }
    (said, b.machine.now_s() - start_s)
}

/// From one place to another at a rate, mm/min, with ramps of 500 mm/s² at both ends, or only at the first.
fn way_s(mm: f64, rate: f64, ramps: f64) -> f64 {
    let v = rate / 60.0;
    mm / v + ramps * v / (2.0 * 500.0)
}

#[test]
fn its_time_follows_from_where_the_head_stands() {
    // Off the switches (1 mm at 500 mm/min), to them at 25 mm/min, off again, and four rests of 250 ms: twice.
    let ends_s = 2.0 * (2.0 * way_s(1.0, 500.0, 2.0) + way_s(1.0, 25.0, 1.0) + 1.0);
    for [x, y, z] in [
        [0.0, 0.0, 0.0],
        [-40.0, -100.0, -5.0],
        [-100.0, -3.0, 0.0],
        [-400.0, -450.0, -190.0],
    ] {
        let mut b = bench(|_| {});
        b.machine.push_head([x, y, z]);
        let (said, took_s) = home(&mut b);
        assert_eq!(said, "ok\r\n");
        // Z first, then X and Y together, each at the rate of `$25`.
        let far = way_s(-z, 500.0, 1.0) * f64::from(z < 0.0)
            + way_s(f64::max(-x, -y), 500.0, 1.0) * f64::from(x < 0.0);
        // Steps come late by some per mille, and the line takes its time.
        assert!(
            (took_s - ends_s - far).abs() < 0.05 + 2e-3 * took_s,
            "{took_s} {ends_s} {far}"
        );
        assert_eq!(b.machine.position_mm(), [-1.0; 3]);
        assert_eq!(b.machine.head_mm(), [-1.0; 3]);
        assert_eq!(b.machine.state(), State::Idle);
    }
}

#[test]
fn z_goes_first_then_x_and_y_together_and_each_stops_at_its_switch() {
    let mut b = bench(|_| {});
    b.machine.push_head([-10.0, -60.0, -20.0]);
    b.machine.write(b"$H\n");
    let (mut highest, mut x_stood) = ([f64::NEG_INFINITY; 3], false);
    while b.machine.state() != State::Idle {
        b.wait(0.02);
        let head = b.machine.head_mm();
        for k in 0..3 {
            highest[k] = highest[k].max(head[k]);
        }
        if highest[2] < -1e-9 {
            assert_eq!([head[0], head[1]], [-10.0, -60.0], "not before Z is done");
        }
        // Both go on at their rate until X has found its switch; then Y alone.
        if head[1] > -59.0 && head[1] < -51.0 {
            assert!((head[0] + 10.0 - head[1] - 60.0).abs() < 1e-9, "{head:?}");
        }
        x_stood |= head[0] == 0.0 && head[1] < -20.0;
    }
    assert!(x_stood);
    assert!(
        highest.iter().all(|h| h.abs() < 1e-9),
        "none beyond its switch: {highest:?}"
    );
}

#[test]
fn the_direction_mask_names_the_corner() {
    for mask in 0..8u8 {
        let mut b = bench(|s| s.homing_direction_mask = f64::from(mask));
        b.machine.push_head([-30.0, -20.0, -10.0]);
        b.machine.write(b"$25=30000\n");
        b.wait(0.5);
        home(&mut b);
        let travel = b.machine.settings().travel_mm;
        let wanted: [f64; 3] = std::array::from_fn(|k| {
            if mask & (1 << k) == 0 {
                -1.0
            } else {
                1.0 - travel[k]
            }
        });
        assert_eq!(b.machine.position_mm(), wanted);
        let head = b.machine.head_mm();
        assert!(
            (0..3).all(|k| (head[k] - wanted[k]).abs() < 1e-9),
            "{head:?}"
        );
        b.send("G91G0X1\n", 2.0);
        assert!((b.machine.position_mm()[0] - wanted[0] - 1.0).abs() < 0.0126);
    }
}

#[test]
fn where_homing_sets_zero_that_is_where_the_head_stands_beside_its_switches() {
    let mut b = bench(|s| {
        s.homing_sets_zero = true;
        s.homing_direction_mask = 3.0;
        s.homing_seek_mm_min = 30_000.0;
    });
    b.machine.push_head([200.0, 30.0, -9.0]);
    home(&mut b);
    assert_eq!(
        (b.machine.position_mm(), b.machine.head_mm()),
        ([0.0; 3], [0.0; 3])
    );
    // Its frame ends at its switches, a little beyond.
    b.machine.push_head([-5.0, 900.0, 5.0]);
    assert_eq!(b.machine.head_mm(), [-1.0, 500.0, 1.0]);
    home(&mut b);
    assert_eq!(b.machine.head_mm(), [0.0; 3]);
}

#[test]
fn who_asks_meanwhile_is_told_at_the_end_that_it_homes() {
    let mut b = bench(|_| {});
    b.machine.push_head([-20.0, -20.0, 0.0]);
    b.send("$H\n", 1.0);
    for _ in 0..4 {
        assert_eq!(b.raw(b'?', 0.5), "");
    }
    assert_eq!(b.raw(b'!', 0.1), "", "a hold means nothing");
    let said = b.wait(30.0);
    assert!(
        said.starts_with("<Home|MPos:-1.000,-1.000,-1.000|"),
        "{said}"
    );
    assert_eq!(said.matches('<').count(), 1, "once for all");
    assert!(said.ends_with(">\r\nok\r\n"));
    // FluidNC answers at once.
    let mut b = bench(|s| *s = s.clone().with_flavour(Flavour::FluidNc));
    b.machine.push_head([-20.0, -20.0, 0.0]);
    b.send("$H\n", 1.0);
    assert!(b.raw(b'?', 0.5).contains("<Home|"));
}

#[test]
fn a_switch_that_is_missing_is_alarm_9_after_half_as_far_again_as_the_travel() {
    for axis in 0..3 {
        let mut b = bench(|s| s.switches[axis] = Switch::Missing);
        b.machine.push_head([-30.0; 3]);
        let (said, took_s) = home(&mut b);
        assert!(said.starts_with("ALARM:9\r\nok\r\n"), "{said}");
        let said = said + &b.wait(0.1);
        assert!(
            said.ends_with("ok\r\n\r\nGrbl 1.1h ['$' for help]\r\n[MSG:'$H'|'$X' to unlock]\r\n"),
            "{said}"
        );
        // Z: 1.5 times 200 mm. X, Y: Z was found before that, and then it is 1.5 times 500 mm.
        let least_s = if axis == 2 { 36.0 } else { 90.0 + 3.6 + 3.0 };
        assert!(took_s > least_s && took_s < least_s + 3.0, "{took_s}");
        assert_eq!(b.machine.state(), State::Alarm);
        assert!(
            b.machine.head_mm()[axis].abs() < 1e-9,
            "at the end of the frame"
        );
        assert!(b.send("G0X1\n", 0.1).contains("error:9"));
    }
}

#[test]
fn a_switch_that_is_stuck_is_alarm_8_and_told_by_its_letter() {
    for (axis, pin) in [(0, "|Pn:X|"), (1, "|Pn:Y|"), (2, "|Pn:Z|")] {
        let mut b = bench(|s| s.switches[axis] = Switch::Stuck);
        b.machine.push_head([-30.0; 3]);
        assert!(b.report().contains(pin));
        let (said, _) = home(&mut b);
        assert!(said.starts_with("ALARM:8\r\nok\r\n"), "{said}");
        let head = b.machine.head_mm();
        assert!(
            (head[axis] + 31.0).abs() < 1e-9,
            "off a switch that was none: {head:?}"
        );
    }
    // Without a distance off, the head stays on its switch.
    let mut b = bench(|s| s.homing_pull_off_mm = 0.0);
    assert!(home(&mut b).0.starts_with("ALARM:8\r\n"));
    // So it does where it has slid too far beyond: 10 mm to brake from a rapid into the end.
    let mut b = bench(|s| s.hard_limits = true);
    home(&mut b);
    b.send("G91G0X-50\n", 2.0);
    assert!(b.send("G0X90\n", 2.0).contains("ALARM:1"));
    b.raw(0x18, 0.1);
    assert!(b.report().contains("|Pn:X|"));
    assert!(home(&mut b).0.starts_with("ALARM:8\r\n"));
}

#[test]
fn a_reset_or_the_door_ends_homing_in_an_alarm_of_its_own() {
    for (byte, alarm) in [(0x18, "ALARM:6"), (0x84, "ALARM:7")] {
        let mut b = bench(|_| {});
        b.machine.push_head([-100.0, -100.0, 0.0]);
        b.send("$H\n", 8.0);
        let head = b.machine.head_mm();
        assert!(head[0] > -100.0 && head[0] < -20.0, "on its way: {head:?}");
        let said = b.raw(byte, 0.2);
        assert_eq!(
            said,
            format!(
                "{alarm}\r\nok\r\n\r\nGrbl 1.1h ['$' for help]\r\n[MSG:'$H'|'$X' to unlock]\r\n"
            )
        );
        b.wait(5.0);
        assert_eq!(b.machine.state(), State::Alarm);
        assert!(b.machine.head_mm()[0] - head[0] < 0.1, "it stands");
        // And can be homed again.
        home(&mut b);
        assert_eq!(
            (b.machine.state(), b.machine.head_mm()),
            (State::Idle, [-1.0; 3])
        );
    }
}

#[test]
fn an_output_is_off_while_it_homes_and_stays_off() {
    let mut b = bench(|s| s.laser_mode = false);
    b.send("$X\nM3S500\n", 0.2);
    assert!(b.machine.beam_on());
    b.send("$H\n", 0.1);
    assert!(!b.machine.beam_on());
    b.wait(20.0);
    assert!(!b.machine.beam_on() && b.machine.state() == State::Idle);
    // The program believes it on, and the next motion lights it.
    assert!(b.send("$G\n", 0.1).contains(" M3 "));
    b.send("G91G1X-5F600\n", 0.3);
    assert!(b.machine.beam_on());
}

#[test]
fn no_hand_moves_the_head_beyond_its_frame() {
    let mut b = bench(|_| {});
    b.machine.push_head([7.0, -5.0, -900.0]);
    assert_eq!(b.machine.head_mm(), [0.0, -5.0, -200.0]);
    b.machine.power_on([-3.0, 8.0, 1.0]);
    assert_eq!(b.machine.head_mm(), [-3.0, 0.0, -199.0]);
}

#[test]
fn power_lost_while_homing_leaves_the_head_where_it_is() {
    let mut b = bench(|_| {});
    b.machine.push_head([-100.0, -100.0, 0.0]);
    b.send("$H\n", 8.0);
    let head = b.machine.head_mm();
    b.machine.power_off();
    b.wait(1.0);
    b.machine.power_on([0.0; 3]);
    assert_eq!(
        (b.machine.head_mm(), b.machine.position_mm()),
        (head, [0.0; 3])
    );
    home(&mut b);
    assert_eq!(b.machine.head_mm(), [-1.0; 3]);
}
