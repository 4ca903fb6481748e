//! What LinuxCNC, QtPlasmaC and other plasma tables make of a text.

use kurbo::Point;

use super::*;

const HEAD: &str = "G21 G90\nG0 X0 Y0\n";

fn rules(text: &str, dialect: Dialect) -> Vec<(usize, Rule)> {
    read_as(text, dialect)
        .findings
        .iter()
        .map(|f| (f.line.unwrap_or(0), f.rule))
        .collect()
}

/// Ends of the moves that burn, with their feeds.
fn burnt(text: &str, dialect: Dialect) -> Vec<(f64, f64)> {
    let program = read_as(text, dialect);
    assert_eq!(program.findings, [], "{text}");
    let burns = program.moves.iter().filter(|m| m.burns());
    burns.map(|m| (m.to.x, m.feed_mm_per_min)).collect()
}

#[test]
fn qtplasmac_takes_feed_from_its_material_and_slows_with_the_motion() {
    let text = format!(
        "{HEAD}(o=0, na=plate, ph=3, pd=0.1, ch=1, fr=2000, kw=1)\nF#<_hal[plasmac.cut-feed-rate]>\nM3 $0 S1\nG1 X1\n\
         M67 E3 Q60\nX2\nM67 E3 Q0\nX3\nM68 E3 Q50\nX4\nM5 $0\nM68 E3 Q0\nM2\n"
    );
    let found = burnt(&text, Dialect::QtPlasmaC);
    assert_eq!(
        found,
        [(1.0, 2000.0), (2.0, 1200.0), (3.0, 2000.0), (4.0, 1000.0)]
    );
    // A material of the table's own: nobody here knows its feed.
    let text = format!(
        "{HEAD}M190 P3\nM66 P3 L3 Q1\nF#<_hal[plasmac.cut-feed-rate]>\nM3 $0 S1\nG1 X1\nM5 $0\nM2\n"
    );
    assert!(burnt(&text, Dialect::QtPlasmaC)[0].1.is_nan());
}

#[test]
fn a_torch_that_an_output_holds_off_burns_nothing() {
    let text = format!(
        "{HEAD}F900\nM3 $0 S1\nG1 X1\nM62 P3\nX2\nM5 $0\nM63 P3\nG0 X2.5\nM3 $0 S1\nG1 X3\nM64 P3\nM65 P3\nM62 P2\nX4\nM5\nM65 P2\nM2\n"
    );
    let ends: Vec<f64> = burnt(&text, Dialect::QtPlasmaC)
        .iter()
        .map(|b| b.0)
        .collect();
    assert_eq!(ends, [1.0, 3.0, 4.0]);
}

#[test]
fn what_goes_with_a_motion_waits_for_it_and_outlives_the_program_if_nobody_takes_it_back() {
    let cut = "F900\nM3 $0 S1\nG1 X1";
    for (body, rule) in [
        // Let go again in the same cut: no arc is there to go on with.
        (
            format!("{cut}\nM62 P3\nX2\nM63 P3\nX3\nM5"),
            Some((9, Rule::StandingBeam)),
        ),
        (
            format!("{cut}\nM62 P3\nX2\nM65 P3\nX3\nM5"),
            Some((9, Rule::StandingBeam)),
        ),
        (format!("{cut}\nM62 P3\nX2\nM5\nM63 P3\nG0 X3"), None),
        (format!("{cut}\nM62 P3\nX2\nM5\nM65 P3\nG0 X3"), None),
        // No motion follows.
        (
            format!("{cut}\nM62 P3\nX2\nM5\nM63 P3"),
            Some((10, Rule::Modes)),
        ),
        (format!("{cut}\nM67 E3 Q50\nM5"), Some((8, Rule::Modes))),
        (format!("{cut}\nM67 E3 Q50\nX2\nM5"), Some((9, Rule::Modes))),
        (format!("{cut}\nM62 P2\nX2\nM5"), Some((9, Rule::Modes))),
        (format!("{cut}\nM64 P2\nX2\nM63 P2\nX3\nM5"), None),
        (format!("{cut}\nM64 P3\nM5"), Some((8, Rule::Modes))),
        // At once does not undo what waits.
        (
            format!("{cut}\nM67 E3 Q50\nM68 E3 Q0\nX2\nM5"),
            Some((10, Rule::Modes)),
        ),
    ] {
        let mut found = rules(&format!("{HEAD}{body}\nM2\n"), Dialect::QtPlasmaC);
        // One that waits is one that is not yet done: both are told.
        found.dedup();
        assert_eq!(found, rule.into_iter().collect::<Vec<_>>(), "{body}");
    }
    let text = format!("%\n{HEAD}{cut}\nM62 P2\nX2\nM5\n%\n");
    assert_eq!(rules(&text, Dialect::QtPlasmaC), [(10, Rule::Modes)]);
}

#[test]
fn a_pierce_is_where_the_torch_is_switched_on_and_one_without_a_cut_is_a_hole() {
    let program = read_as(
        "G21 G90\nG0 X5 Y6\nM3\nG4 P0.5\nM5\nG0 X8\nM3\nG1 Z1 F500\nG1 X9\nM5\nM2\n",
        Dialect::Table,
    );
    assert_eq!(program.findings, []);
    assert_eq!(
        program.pierces,
        [(3, Point::new(5.0, 6.0)), (7, Point::new(8.0, 6.0))]
    );
    let burns: Vec<_> = program.moves.iter().filter(|m| m.burns()).collect();
    assert_eq!(burns.len(), 2);
    assert_eq!((burns[0].line, burns[0].from), (3, Some(burns[0].to)));
}

#[test]
fn what_a_torch_must_not_do_is_found_with_its_line() {
    let cut = "F900\nM3 $0 S1\nG1 X1";
    for (dialect, body, rule) in [
        (
            Dialect::QtPlasmaC,
            "F900\nM3 $0\nG1 X1\nM5",
            (4, Rule::Syntax),
        ),
        (Dialect::QtPlasmaC, "F900\nM3 $2 S1", (4, Rule::Syntax)),
        (
            Dialect::QtPlasmaC,
            "F#<_hal[plasmac.cut-feed-rate]>",
            (3, Rule::Feed),
        ),
        (Dialect::QtPlasmaC, "F#<feed>", (3, Rule::Syntax)),
        (Dialect::QtPlasmaC, "#<holes>=1", (3, Rule::Syntax)),
        (Dialect::QtPlasmaC, "M62 P7", (3, Rule::Syntax)),
        (Dialect::QtPlasmaC, "M67 E3 Q-5", (3, Rule::Feed)),
        (Dialect::QtPlasmaC, "M190", (3, Rule::Syntax)),
        (
            Dialect::QtPlasmaC,
            "(o=2, nu=1, na=a, ph=1, pd=1, ch=1, fr=1)",
            (3, Rule::Syntax),
        ),
        (
            Dialect::QtPlasmaC,
            "(o=0, ph=1, pd=x, ch=1, fr=1)",
            (3, Rule::Syntax),
        ),
        (Dialect::QtPlasmaC, "G41 D1", (3, Rule::Syntax)),
        (
            Dialect::QtPlasmaC,
            &format!("{cut}\nM5\nX3\nM3 $0 S1\nX4\nM5"),
            (8, Rule::Syntax),
        ),
        (
            Dialect::LinuxCnc,
            &format!("G1 Z1 F900\n{cut}\nZ2 X3\nM5"),
            (7, Rule::Height),
        ),
        (
            Dialect::LinuxCnc,
            "G1 Z2 F900\nM3\nX1\nM5\nG0 X3",
            (7, Rule::Height),
        ),
        (Dialect::LinuxCnc, "M3\nG1 X1 F900\nM5", (4, Rule::Height)),
        (Dialect::LinuxCnc, "M190 P1", (3, Rule::Syntax)),
        (Dialect::LinuxCnc, "G38.2 X5 F100", (3, Rule::Syntax)),
        (Dialect::Table, "M67 E3 Q60", (3, Rule::Syntax)),
        (Dialect::Table, "M3 $0", (3, Rule::Syntax)),
        (Dialect::Table, "G92 X0", (3, Rule::Modes)),
        (
            Dialect::Table,
            "G1 Z1 F900\nM3\nX1\nG4 P1\nM5",
            (6, Rule::StandingBeam),
        ),
        (
            Dialect::Table,
            "G1 Z1 F900\nM3\nG0 X1\nM5",
            (5, Rule::BurnOnRapid),
        ),
    ] {
        let found = rules(&format!("{HEAD}{body}\nM2\n"), dialect);
        assert!(found.contains(&rule), "{dialect:?}, {body}: {found:?}");
    }
    assert_eq!(
        rules("G21 G90\nG0 X1 Y1\n", Dialect::LinuxCnc),
        [(2, Rule::Syntax)]
    );
    assert_eq!(rules("%\nG21 G90\nG0 X1 Y1\n%\n", Dialect::LinuxCnc), []);
    assert_eq!(
        rules("G21 G90\nG0 X1 Y1\nM3\nM2\n", Dialect::Table),
        [(4, Rule::BeamAtEnd)]
    );
}

#[test]
fn heights_are_known_from_a_probe_by_name_or_by_steps() {
    for body in [
        "G38.2 Z-50 F300\nG92 Z0\nG0 Z3\nM3\nG4 P1\nG1 Z1 F500",
        "G38.2 Z-50 F300\nG91\nG0 Z1.5\nG90\nM3\nG4 P1",
    ] {
        let text = format!("{HEAD}{body}\nG1 X5 F900\nM5\nM2\n");
        assert_eq!(rules(&text, Dialect::LinuxCnc), [], "{body}");
    }
    let text = format!("{HEAD}G38.2 Z-50 F300\nG0 Z3\nM3\nG1 X5 F900\nM5\nM2\n");
    assert_eq!(rules(&text, Dialect::LinuxCnc), [(6, Rule::Height)]);
}
