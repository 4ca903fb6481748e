//! One line at a time.

use super::*;

fn run(lines: &[&str]) -> Result<(Modal, Vec<Action>), (usize, u8)> {
    let (mut modal, mut actions) = (Modal::new(), VecDeque::new());
    for (k, line) in lines.iter().enumerate() {
        interpret(
            line.as_bytes(),
            &mut modal,
            &Settings::default(),
            &mut actions,
        )
        .map_err(|e| (k, e))?;
    }
    Ok((modal, actions.into()))
}

#[test]
fn errors_have_grbls_numbers() {
    for (line, error) in [
        ("1X2", 1),
        ("G1X", 2),
        ("G1X1F-5", 4),
        ("G5", 20),
        ("G38X1F5", 20),
        ("G38.6X1F5", 20),
        ("G38.2X1", 22),
        ("G38.2F5", 26),
        ("G38.2X0F5", 33),
        ("G38.2G92X1F5", 24),
        ("G53G38.2X1F5", 30),
        ("G43Z1", 20),
        ("G43.1", 37),
        ("G43.1X1Z1", 37),
        ("G43.1G0Z1", 24),
        ("G93G1X1", 22),
        ("B3", 20),
        ("M6", 20),
        ("G0G1X1", 21),
        ("G20G21", 21),
        ("G1X1", 22),
        ("G1", 22),
        ("M3.5", 23),
        ("G92G0X1", 24),
        ("G0X1X2", 25),
        ("G92", 26),
        ("N20000000", 27),
        ("G4", 28),
        ("G10L2P9X0", 29),
        ("G53G2X1I1F100", 30),
        ("G80X1", 31),
        ("G80G92X1", 31),
        ("G2Z1I1F100", 32),
        ("G2X10I1F100", 33),
        ("G2X10R1F100", 34),
        ("G2X10F100", 35),
        ("G0X1P2", 36),
        ("T300", 38),
    ] {
        assert_eq!(run(&[line]).map(|_| ()), Err((0, error)), "{line}");
    }
}

#[test]
fn a_line_in_error_changes_nothing() {
    let (mut modal, mut actions) = (Modal::new(), VecDeque::new());
    let before = modal.clone();
    let result = interpret(
        b"G91G20S7X1G1",
        &mut modal,
        &Settings::default(),
        &mut actions,
    );
    assert_eq!(result, Err(22));
    assert_eq!((modal, actions.len()), (before, 0));
}

#[test]
fn offsets_units_and_increments_add_up() {
    let (modal, actions) = run(&["G92X10", "G0X11", "G20", "G91", "G0X1"]).unwrap();
    assert!(
        (modal.position[0] - 26.4).abs() < 1e-12,
        "{:?}",
        modal.position
    );
    assert_eq!(actions.len(), 2);
}

#[test]
fn an_arc_stays_within_its_tolerance_and_ends_exactly() {
    let (_, actions) = run(&["G0X10Y0", "G3X10Y0I-10J0F600"]).unwrap();
    let Action::Arc(mut arc) = actions[1].clone() else {
        panic!("{actions:?}");
    };
    let mut last = [10.0, 0.0, 0.0];
    let mut length = 0.0;
    while let Some(p) = arc.point() {
        let middle = [(p[0] + last[0]) / 2.0, (p[1] + last[1]) / 2.0];
        assert!(10.0 - middle[0].hypot(middle[1]) < 0.0021);
        length += (p[0] - last[0]).hypot(p[1] - last[1]);
        last = p;
        arc.next += 1;
    }
    assert_eq!(last, [10.0, 0.0, 0.0]);
    assert!((length - std::f64::consts::TAU * 10.0).abs() < 0.01);
}

#[test]
fn the_length_of_a_tool_moves_work_z_and_nothing_else() {
    let (modal, _) = run(&["G43.1Z3", "G0Z5"]).unwrap();
    assert_eq!((modal.position[2], modal.offset()), (8.0, [0.0, 0.0, 3.0]));
    // Offsets told by what the position reads hold it apart.
    for line in ["G92Z1", "G10L20P1Z1"] {
        let (modal, _) = run(&["G43.1Z3", "G0Z5", line]).unwrap();
        assert_eq!(modal.position[2] - modal.offset()[2], 1.0, "{line}");
        assert_eq!(modal.offset()[2] - modal.tool_length, 4.0);
    }
    let (modal, _) = run(&["G20", "G43.1Z1", "G49X7"]).unwrap();
    assert_eq!(modal.tool_length, 0.0);
    let (modal, _) = run(&["G20", "G43.1Z1"]).unwrap();
    assert_eq!(modal.tool_length, 25.4);
}

#[test]
fn in_inverse_time_a_line_takes_its_share_of_a_minute() {
    let rate = |lines: &[&str]| match run(lines).unwrap().1.pop() {
        Some(Action::Line { drive, .. }) => drive.rate_mm_min,
        Some(Action::Arc(arc)) => arc.drive.rate_mm_min,
        other => panic!("{other:?}"),
    };
    assert_eq!(rate(&["G93G1X3Y4F60"]), Some(300.0));
    assert_eq!(rate(&["G93G20G1X1F60"]), Some(60.0 * 25.4));
    let half = std::f64::consts::PI * 10.0;
    let arc = rate(&["G93G2X20I10F2"]).unwrap();
    assert!((arc - 2.0 * half).abs() < 0.01 * half, "{arc}");
    // A rate is forgotten with its line, also on the way back to G94.
    assert_eq!(run(&["G93G1X1F5", "X2"]).map(|_| ()), Err((1, 22)));
    assert_eq!(
        run(&["G1F100", "G93", "G94", "X2"]).map(|_| ()),
        Err((3, 22))
    );
    assert_eq!(run(&["G93", "G0X1", "M2", "G1X2F50"]).map(|_| ()), Ok(()));
}

#[test]
fn ways_of_probing_are_modal() {
    let (modal, actions) = run(&["G38.4Z-5F100", "Z-7"]).unwrap();
    assert_eq!((modal.motion, modal.position[2]), (384, -7.0));
    let probes: Vec<_> = actions
        .iter()
        .filter_map(|a| match a {
            Action::Probe(probe) => {
                Some((probe.target[2], probe.from[2], probe.away, probe.strict))
            }
            _ => None,
        })
        .collect();
    assert_eq!(probes, [(-5.0, 0.0, true, true), (-7.0, -5.0, true, true)]);
}
