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
        ("G38.2X1F5", 20),
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
