//! What a GRBL-class laser makes of a text.

use super::*;

const HEAD: &str = "G21 G90\nG0 X0 Y0\nM4 S100\n";

fn rules(text: &str) -> Vec<(usize, Rule)> {
    read(text)
        .findings
        .iter()
        .map(|f| (f.line.unwrap_or(0), f.rule))
        .collect()
}

#[test]
fn modal_words_hold_until_they_change() {
    let program = read(
        "G21G90\nG0X1Y2\nM4S50\ng1 x3 f600\nY4\nG91 X-1\nG20\nX1 (one inch) S0\nM5\nG0X0\nM2\n",
    );
    assert_eq!(program.findings, []);
    let ends: Vec<_> = program
        .moves
        .iter()
        .map(|m| (m.to.x, m.to.y, m.burns()))
        .collect();
    assert_eq!(
        ends,
        [
            (1.0, 2.0, false),
            (3.0, 2.0, true),
            (3.0, 4.0, true),
            (2.0, 4.0, true),
            (27.4, 4.0, false),
            (27.4, 4.0, false),
        ]
    );
    assert_eq!(program.moves[3].feed_mm_per_min, 600.0);
}

#[test]
fn arcs_stay_on_their_circle_and_go_the_right_way() {
    for (word, turn) in [
        ("G3 X0 Y10 I-10 J0", 0.25),
        ("G2 X0 Y10 I-10", 0.75),
        ("G3 X0 Y10 R10", 0.25),
        ("G2 X0 Y10 R-10", 0.75),
        ("G3 X10 Y0 I-10", 1.0),
    ] {
        let text = format!("G21G90\nG0 X10 Y0\nM4 S1\nG1 X10 F100\n{word}\nM5\n");
        let program = read(&text);
        assert_eq!(program.findings, [], "{word}");
        let arc: Vec<_> = program.moves.iter().filter(|m| m.line == 5).collect();
        let length: f64 = arc.iter().map(|m| m.from.unwrap().distance(m.to)).sum();
        let exact = std::f64::consts::TAU * 10.0 * turn;
        assert!(
            (length - exact).abs() < 1e-2,
            "{word}: {length} for {exact}"
        );
        for m in arc {
            let middle = m.from.unwrap().midpoint(m.to).to_vec2().hypot();
            assert!((10.0 - middle) < 0.0021 && (m.to.to_vec2().hypot() - 10.0).abs() < 1e-9);
        }
    }
}

#[test]
fn what_a_controller_refuses_is_found_with_its_line() {
    for (line, rule) in [
        ("G1 G0 X1", Rule::Syntax),
        ("G1 X1 X2", Rule::Syntax),
        ("G1 X", Rule::Syntax),
        ("G5 X1", Rule::Syntax),
        ("M99", Rule::Syntax),
        ("G1 X1 (open", Rule::Syntax),
        ("$32=0", Rule::Syntax),
        ("G1 X1 F-1", Rule::Syntax),
        ("G28 X0", Rule::Syntax),
        ("G53 G0 X0 Y0", Rule::Syntax),
        ("G2 X5 Y5", Rule::Syntax),
        ("G2 X5 Y5 I9 J9", Rule::Syntax),
        ("G4", Rule::Syntax),
        ("G1 X99999999999999999999", Rule::Syntax),
        ("G1 Xé", Rule::Syntax),
        ("G0 X1 S5", Rule::BurnOnRapid),
        ("G1 X9 F600\rX20", Rule::Syntax),
        ("G4 P0.1 X60", Rule::Syntax),
        ("G4 P0 G1", Rule::Syntax),
        ("G3 X0 Y0.000001 I-10 F600", Rule::Syntax),
    ] {
        assert_eq!(rules(&format!("{HEAD}{line}\nM5\n")), [(4, rule)], "{line}");
    }
    assert_eq!(rules("G90\nG0 X1 Y1\n"), [(2, Rule::Modes)]);
    assert_eq!(rules("G21\nG0 X1 Y1\n"), [(2, Rule::Modes)]);
    assert_eq!(rules("G21 G90\nG0 X1\n"), [(2, Rule::Modes)]);
    assert_eq!(rules("G21 G90\nX1 Y1\n"), [(2, Rule::Modes)]);
    assert_eq!(rules(HEAD), [(3, Rule::BeamAtEnd)]);
    assert_eq!(rules(&format!("{HEAD}M2\n")), [(4, Rule::BeamAtEnd)]);
    assert_eq!(
        rules(&format!("{HEAD}M3\nG4 P1\nM5\n")),
        [(5, Rule::StandingBeam)]
    );
    assert_eq!(
        rules(&format!("{HEAD}M3\nG1\nM5\n")),
        [(5, Rule::StandingBeam)]
    );
}

#[test]
fn a_wait_and_a_move_in_one_line_are_both_read() {
    let program = read(&format!("{HEAD}G1 X5 F600\nG4 P0.1 X60\nM5\n"));
    assert_eq!(program.moves[2].to, Point::new(60.0, 0.0));
    assert!(program.moves[2].burns());
    // The mode of such a line holds for the lines after it.
    let program = read(&format!("{HEAD}F600\nG4 P0 G1\nX60\nM5\n"));
    assert!(program.moves[1].burns());
}

#[test]
fn a_return_ends_a_line_as_for_the_controller() {
    let program = read(&format!("{HEAD}G1 X9 F600 ; right\rY20\nM5\r\n"));
    assert_eq!(program.findings.len(), 1, "{:?}", program.findings);
    assert_eq!(program.moves[2].to, Point::new(9.0, 20.0));
}

#[test]
fn with_m3_any_line_without_a_target_burns_at_rest_while_a_cutting_mode_is_in_force() {
    let standing = |line: &str| rules(&format!("G21 G90\nG0 X1 Y1\nG1 X2 F600\n{line}\nM5\n"));
    for (lines, at) in [
        ("M3 S500", 4),
        ("M3 S0\nS500", 5),
        ("M3 S0\nX3 S9\nM8", 6),
        ("M3 S0\nX3 S9\nX3", 6),
        ("M3 S0\nX3 S9\nF100", 6),
    ] {
        assert_eq!(standing(lines), [(at, Rule::StandingBeam)], "{lines}");
    }
    for lines in ["M3 S0", "M4 S500\nM8", "G0\nM3 S500\nM8", "M3 S0\nX3 S9"] {
        assert_eq!(standing(lines), [], "{lines}");
    }
}

#[test]
fn arcs_without_end_do_not_fill_the_memory() {
    let mut text = String::from(HEAD);
    text.push_str("F600\n");
    for _ in 0..150 {
        text.push_str("G2 X0 Y0 I1000000\n");
    }
    text.push_str("M5\n");
    let program = read(&text);
    assert_eq!(program.moves.len(), 1 + ALL_CHORDS);
    assert_eq!(
        program
            .findings
            .iter()
            .map(|f| (f.line, f.rule))
            .collect::<Vec<_>>(),
        [(Some(105), Rule::Syntax)]
    );
}
