use super::*;
use crate::calibrate::{KerfPiece, SettingSquare, Strip};

fn coupon() -> Coupon {
    let strip = |name: &str, hinge_width_mm: f64| Strip {
        name: name.into(),
        hinge_width_mm,
        edge_mm: 12.0,
        hinges: 36,
        gauge_mm: 48.0,
    };
    let piece = |name: &str, side: Side| KerfPiece {
        name: name.into(),
        side,
        nominal_mm: 19.8,
    };
    let square = |name: &str, power_percent: f64, speed_mm_per_min: f64| SettingSquare {
        name: name.into(),
        power_percent,
        speed_mm_per_min,
    };
    Coupon {
        format: 1,
        material: "leather-1.6".into(),
        machine: "co2-600x400".into(),
        thickness_mm: 1.6,
        kerf_mm: 0.2,
        tip_radius_mm: None,
        gauge_step: 0.05,
        strip: vec![
            strip("A1", 0.8),
            strip("A2", 1.0),
            strip("A3", 1.2),
            strip("A4", 1.0),
        ],
        kerf: vec![
            piece("K1-HOLE", Side::Hole),
            piece("K1-PIECE", Side::Piece),
            piece("K2-HOLE", Side::Hole),
            piece("K2-PIECE", Side::Piece),
        ],
        setting: vec![
            square("P1", 30.0, 900.0),
            square("P2", 45.0, 900.0),
            square("P3", 30.0, 1800.0),
            square("P4", 60.0, 1800.0),
        ],
    }
}

const DAY: &str = "2026-05-31";

fn read(text: &str) -> Result<Readings, DocumentError> {
    Readings::read("r.csv", text, &coupon(), DAY)
}

const GOOD: &str = "name,held,tore,failure,measured_mm,cut_through\n\
A1,1.4,1.45,torn,,\n\
A2,1.35,1.4,torn,,\n\
A3,1.3,1.35,plastic,,\n\
A4,1.4,,,,\n\
K1-HOLE,,,,20.1,\n\
K1-PIECE,,,,19.5,\n\
K2-HOLE,,,,20.1,\n\
P1,,,,,no\n\
P2,,,,,yes\n";

#[test]
fn the_template_filled_in_is_read_and_empty_it_says_nothing() {
    let coupon = coupon();
    let empty = template(&coupon);
    let error = read(&empty).unwrap_err();
    assert!(error.problem.contains("nothing was read"), "{error}");
    for item in items(&coupon) {
        assert!(empty.contains(&format!("\n{},,,,,\n", item.name())));
    }
    let filled = empty.replace("\nA2,,,", "\nA2,1.3,1.35,torn");
    let readings = read(&filled).unwrap();
    assert_eq!(readings.strips.len(), 1);
    assert_eq!(readings.strips[0].tore, Some(1.35));
    assert_eq!(readings.strips[0].date, DAY);
    assert_eq!(readings.strips[0].hinge_width_mm, 1.0);
}

#[test]
fn a_measured_kerf_makes_hinges_as_wide_as_they_are() {
    let readings = read(GOOD).unwrap();
    let kerf = readings.measured_kerf(0.9).unwrap().unwrap();
    assert!((kerf.kerf_mm - 0.3).abs() < 1e-9);
    for (strip, drawn) in readings.strips.iter().zip([0.8, 1.0, 1.2, 1.0]) {
        assert!((strip.kerf_mm - 0.3).abs() < 1e-9);
        assert!((strip.hinge_width_mm - (drawn - 0.1)).abs() < 1e-9);
        assert_eq!(strip.tip_radius_mm, None);
        // The neck that was drawn is the neck that is there.
        let neck =
            |r: &Reading| crate::material::neck_mm(r.hinge_width_mm, r.kerf_mm, 0.5 * r.kerf_mm);
        let before = crate::material::neck_mm(drawn, 0.2, 0.1);
        assert!((neck(strip) - before).abs() < 1e-9);
    }
    let wide = Coupon {
        tip_radius_mm: Some(0.5),
        ..coupon()
    };
    let readings = Readings::read("r.csv", GOOD, &wide, DAY).unwrap();
    assert_eq!(readings.strips[0].tip_radius_mm, Some(0.55));
}

#[test]
fn every_way_to_write_the_same_reads_the_same() {
    let first = read(GOOD).unwrap();
    let semicolons = GOOD.replace(',', ";").replace('.', ",");
    let tabs = GOOD.replace(',', "\t");
    let crlf = format!(
        "\u{feff}# a comment, with a comma\r\n\r\n{}",
        GOOD.replace('\n', "\r\n")
    );
    let quoted = GOOD
        .replace("A1,1.4,1.45,torn", "\"a1\", \"1,4\" ,1.45,\"Torn\"")
        .replace("name,held", "\"name\",held");
    let quoted = format!("\"# kagome, a comment\",,,,,\n,,,,,\n{quoted}");
    for text in [&semicolons, &tabs, &crlf, &quoted] {
        assert_eq!(read(text).unwrap(), first, "{text}");
    }
    let mut turned = String::new();
    for line in GOOD.lines() {
        let cells: Vec<&str> = line.split(',').rev().collect();
        turned += &format!("{}\n", cells.join(","));
    }
    assert_eq!(read(&turned).unwrap(), first);
    let toml = "material = \"leather-1.6\"\n\
        strip = [{ name = \"A1\", held = 1.4, tore = 1.45, failure = \"torn\" }, { name = \"A2\", held = 1.35, tore = 1.4, failure = \"torn\" }, \
        { name = \"A3\", held = 1.3, tore = 1.35, failure = \"plastic\" }, { name = \"A4\", held = 1.4 }]\n\
        [[kerf]]\nname = \"K1-HOLE\"\nmeasured_mm = 20.1\n[[kerf]]\nname = \"K1-PIECE\"\nmeasured_mm = 19.5\n\
        [[kerf]]\nname = \"K2-HOLE\"\nmeasured_mm = 20.1\n\
        [[setting]]\nname = \"P1\"\ncut_through = false\n[[setting]]\nname = \"P2\"\ncut_through = true\n";
    assert_eq!(
        Readings::read("r.toml", toml, &coupon(), DAY).unwrap(),
        first
    );
    // Days of their own.
    let dated = GOOD
        .replace("cut_through\n", "cut_through,date\n")
        .replace("A2,1.35,1.4,torn,,", "A2,1.35,1.4,torn,,,2026-06-01");
    let days: Vec<String> = read(&dated)
        .unwrap()
        .strips
        .into_iter()
        .map(|s| s.date)
        .collect();
    assert_eq!(days, [DAY, "2026-06-01", DAY, DAY]);
}

#[test]
fn what_is_written_is_read_again() {
    let readings = read(GOOD).unwrap();
    let text = readings.to_text();
    assert_eq!(Readings::parse("readings.toml", &text).unwrap(), readings);
    for (from, to, key) in [
        ("format = 1", "format = 2", "format"),
        ("held = 1.4\n", "held = 140\n", "strip[0].held"),
        (
            "measured_mm = 20.1",
            "measured_mm = 2.01",
            "kerf[0].measured_mm",
        ),
        (DAY, "31.5.2026", "date"),
    ] {
        assert!(text.contains(from), "{from}: {text}");
        let error = Readings::parse("readings.toml", &text.replacen(from, to, 1)).unwrap_err();
        assert_eq!(error.key.as_deref(), Some(key), "{error}");
        assert!(error.line.is_some());
    }
}

#[test]
fn each_mistake_is_found_at_its_line() {
    for (from, to, line, key, word) in [
        ("A1,1.4,1.45", "A1,1.45,1.4", 2, "tore", "mixed up"),
        ("A1,1.4,", "A1,-0.4,", 2, "held", "negative"),
        ("A1,1.4,", "A1,0.4,", 2, "held", "write 1.4"),
        ("A1,1.4,1.45", "A1,140,145", 2, "held", "write 1.4"),
        ("A1,1.4,1.45", "A1,40,45", 2, "held", "write 1.4"),
        ("A1,1.4,1.45", "A1,72,75", 2, "held", "write 1.5"),
        ("A1,1.4,1.45", "A1,1.4,145 %", 2, "tore", "per cent"),
        ("A1,1.4,1.45", "A1,1.4,2.1", 2, "tore", "Units mixed up?"),
        ("A1,1.4,1.45", "A1,1.4,nan", 2, "tore", "no number"),
        ("A1,1.4,1.45", "A1,,1.45", 2, "held", "1 if it failed"),
        ("A1,1.4,1.45", "A1,1.4,", 2, "failure", "tore is not"),
        ("1.45,torn", "1.45,", 2, "failure", "is empty"),
        ("1.45,torn", "1.45,kaputt", 2, "failure", "kaputt"),
        ("A4,1.4,", "A4,1,", 5, "held", "not pulled"),
        ("A2,1.35", "B2,1.35", 3, "name", "not on this coupon"),
        ("A2,1.35", "A1,1.35", 3, "name", "twice"),
        ("A2,1.35", ",1.35", 3, "name", "no name"),
        (
            "K1-HOLE,,,,20.1",
            "K1-HOLE,,,,2.01",
            6,
            "measured_mm",
            "centimetres",
        ),
        (
            "K1-HOLE,,,,20.1",
            "K1-HOLE,,,,0.791",
            6,
            "measured_mm",
            "inches",
        ),
        (
            "K1-HOLE,,,,20.1",
            "K1-HOLE,20.1,,,",
            6,
            "held",
            "measured_mm only",
        ),
        ("P2,,,,,yes", "P2,,,,,maybe", 10, "cut_through", "maybe"),
        ("name,held", "held,held", 1, "held", "twice"),
        ("name,held", "nom,held", 1, "nom", "not known"),
        ("name,held", "date,held", 1, "name", "missing"),
        ("failure,", "date,", 1, "failure", "missing"),
        ("A1,1.4,1.45,torn", "A1,\"1.4,1.45,torn", 2, "", "quotation"),
        ("A1,1.4,1.45,torn", "A1,1,4,1,45,torn", 2, "", "semicolons"),
    ] {
        assert!(GOOD.contains(from), "{from}");
        let error = read(&GOOD.replacen(from, to, 1)).unwrap_err();
        assert_eq!(error.line, Some(line), "{to}: {error}");
        assert_eq!(error.key.as_deref().unwrap_or(""), key, "{to}: {error}");
        let shown = error.to_string();
        assert!(shown.contains(word), "{to}: {shown}");
        assert!(shown.contains(&format!("r.csv:{line}:")), "{shown}");
    }
    let of_other = template(&Coupon {
        material: "felt-3".into(),
        ..coupon()
    });
    let error = read(&of_other).unwrap_err();
    assert_eq!(error.line, Some(4), "{error}");
    assert!(error.problem.contains("felt-3"), "{error}");
    assert!(read("").unwrap_err().problem.contains("header"));
    // The kerf as a whole.
    let mixed = GOOD.replace("20.1", "19.4").replace("19.5", "20.1");
    assert!(read(&mixed).unwrap_err().problem.contains("mixed up"));
    for (text, line) in [
        (
            "[[strip]]\nname = \"A1\"\nheld = 1.4\ntore = 1.3\nfailure = \"torn\"\n",
            4,
        ),
        ("[[strip]]\nname = \"A1\"\nheld = 30\n", 3),
        ("[[strip]]\nheld = 1.3\n", 1),
        ("[[strip]]\nname = \"A1\"\nheld = 1.3\nripped = 1.4\n", 4),
        ("[[kerf]]\nname = \"K1-HOLE\"\nmeasured_mm = 2\n", 3),
        ("material = \"felt-3\"\n", 1),
        (
            "date = \"today\"\n[[strip]]\nname = \"A1\"\nheld = 1.3\n",
            1,
        ),
    ] {
        let error = Readings::read("r.toml", text, &coupon(), DAY).unwrap_err();
        assert_eq!(error.line, Some(line), "{text}{error}");
    }
}

fn doubts(text: &str) -> String {
    let all: Vec<String> = read(text)
        .unwrap()
        .doubts()
        .iter()
        .map(ToString::to_string)
        .collect();
    all.join("\n")
}

#[test]
fn what_only_looks_wrong_is_told_and_kept() {
    let head = "name,held,tore,failure,measured_mm,cut_through\n";
    let fine = "A1,1.4,1.45,torn,,\nA2,1.4,1.45,torn,,\nA4,1.35,1.4,torn,,\n";
    assert_eq!(doubts(&format!("{head}{fine}")), "");
    for (rows, word) in [
        (
            "A3,1.1,1.3,torn,,\n",
            "A3: held at 1.1 and failed at 1.3, 4 steps",
        ),
        ("A3,1.3,,,,\n", "A3: did not fail at 1.3"),
        ("A3,1.85,,,,\n", "A3: never failed"),
        ("A3,1.9,1.95,torn,,\n", "A3: is said to have held at 1.9"),
        ("A3,1.05,1.1,torn,,\n", "A3: failed earlier"),
        ("A3,1.75,1.8,torn,,\n", "A3: failed later"),
        ("P1,,,,,yes\nP2,,,,,no\n", "P2: was not cut through"),
        ("P1,,,,,no\n", "no square"),
        ("K1-HOLE,,,,20.3,\n", "the kerf stays at 0.2 mm"),
        (
            "K1-HOLE,,,,20.3,\nK1-PIECE,,,,19.3,\nK2-HOLE,,,,20.3,\n",
            "its hinges are 0.3 mm narrower",
        ),
    ] {
        let text = doubts(&format!("{head}{fine}{rows}"));
        assert!(text.contains(word), "{rows}: {text}");
    }
}

#[test]
fn the_cleanest_setting_is_the_least_heat_that_surely_cut() {
    let of = |rows: &str| {
        let head = "name,cut_through\n";
        let readings = read(&format!("{head}{rows}")).unwrap();
        readings.cleanest().map(|s| s.name.clone())
    };
    // P3 has the least heat; P1, P4, P2 follow.
    assert_eq!(
        of("P1,yes\nP2,yes\nP3,yes\nP4,yes\n").as_deref(),
        Some("P3")
    );
    // As much heat in P1 as in P4: the faster one.
    assert_eq!(of("P1,yes\nP2,yes\nP3,no\nP4,yes\n").as_deref(), Some("P4"));
    // P1 cut and P2, with more power, did not: neither P1 nor P3 is sure.
    assert_eq!(of("P1,yes\nP2,no\nP3,yes\nP4,yes\n").as_deref(), Some("P4"));
    assert_eq!(of("P1,no\nP2,no\n"), None);
}
