//! From what a maker wrote down beside a coupon to a sheet that is made with it: `calibrate record`, `calibrate fit`, `make`.

#![allow(clippy::unwrap_used, reason = "a helper that fails, fails its test")]

use std::path::Path;
use std::process::{Command, Output};

const COUPON: &str = r#"format = 1
material = "leather-1.6"
machine = "co2-600x400"
thickness_mm = 1.6
kerf_mm = 0.2
gauge_step = 0.05
strip = [
    { name = "A1", hinge_width_mm = 0.8, edge_mm = 12.0, hinges = 44, gauge_mm = 48.0 },
    { name = "A2", hinge_width_mm = 1.0, edge_mm = 12.0, hinges = 44, gauge_mm = 48.0 },
    { name = "A3", hinge_width_mm = 1.2, edge_mm = 12.0, hinges = 44, gauge_mm = 48.0 },
    { name = "A4", hinge_width_mm = 1.0, edge_mm = 14.0, hinges = 44, gauge_mm = 56.0 },
]
kerf = [
    { name = "K1-HOLE", side = "hole", nominal_mm = 19.8 },
    { name = "K1-PIECE", side = "piece", nominal_mm = 19.8 },
    { name = "K2-HOLE", side = "hole", nominal_mm = 13.8 },
    { name = "K2-PIECE", side = "piece", nominal_mm = 13.8 },
]
setting = [
    { name = "P1", power_percent = 20.0, speed_mm_per_min = 900.0 },
    { name = "P2", power_percent = 25.0, speed_mm_per_min = 900.0 },
]
"#;

const READINGS: &str = "name;held;tore;failure;measured_mm;cut_through
A1;1,55;1,6;torn;;
A2;1,5;1,55;torn;;
A3;1,45;1,5;torn;;
A4;1,55;1,6;torn;;
K1-HOLE;;;;20,03;
K1-PIECE;;;;19,57;
K2-HOLE;;;;14,03;
K2-PIECE;;;;13,57;
P1;;;;;no
P2;;;;;yes
";

/// A folder with a coupon in `coupon`, and a place for profiles of one's own.
struct Bench(tempfile::TempDir);

impl Bench {
    fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        std::fs::create_dir(bench.path("coupon")).unwrap();
        bench.write("coupon/coupon.toml", COUPON);
        bench.write("coupon/readings.csv", READINGS);
        bench
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    fn run(&self, line: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_kagome"))
            .env("KAGOME_PROFILES", self.path("own"))
            .args(line.split(' '))
            .stdin(std::process::Stdio::null())
            .current_dir(self.0.path())
            .output()
            .unwrap()
    }

    /// Runs it and sees that it ends with a code; what it said on both ways.
    fn says(&self, code: i32, line: &str) -> String {
        let output = self.run(line);
        let said = format!(
            "{}{}",
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        );
        assert_eq!(output.status.code(), Some(code), "{line}\n{said}");
        said
    }

    fn record(&self) {
        self.says(
            0,
            "calibrate record coupon --readings coupon/readings.csv --date 2026-05-31 --force",
        );
    }
}

const PROFILE: &str = "own/profiles/leather-1.6-measured.toml";

fn load(path: &Path) -> kagome::material::Material {
    kagome::material::load(&path.display().to_string()).unwrap()
}

#[test]
fn what_was_written_down_becomes_a_profile_that_keeps_what_it_was() {
    let bench = Bench::new();
    let said = bench.says(2, "calibrate record coupon");
    assert!(said.contains("--readings"), "{said}");
    assert!(!bench.path("coupon/readings.toml").exists());
    bench.record();
    // Earlier readings are not lost by mistake.
    let said = bench.says(2, "calibrate record coupon --readings coupon/readings.csv");
    assert!(said.contains("--force"), "{said}");

    let said = bench.says(0, "calibrate fit coupon --dry-run");
    assert!(!bench.path("own").exists(), "{said}");
    let said = bench.says(0, "calibrate fit coupon/readings.toml");
    for words in [
        "1000 hinges",
        "kerf on co2-600x400: 0.23 mm",
        "next: a strip",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    // Strips and kerf hold for the setting that they were cut with; another is only told of.
    assert!(said.contains("--take-setting"), "{said}");
    let shipped = kagome::material::load("leather-1.6").unwrap();
    let own = load(&bench.path(PROFILE));
    assert_eq!(own.sigma.sample.len(), 4);
    assert_eq!(own.sigma.source, kagome::material::Source::Measured);
    assert!(own.sigma.max > 1.2 && own.sigma.max < 1.5);
    assert!(own.sigma.note.contains(&shipped.sigma.note));
    assert!(own.sigma.note.contains("before: 1.8"));
    assert!((own.cut[0].kerf_mm - 0.23).abs() < 1e-9);
    assert_eq!(own.cut[0].speed_mm_per_min, shipped.cut[0].speed_mm_per_min);
    assert!(own.cut[0].note.contains(&shipped.cut[0].note));
    assert_eq!(own.cut[1..], shipped.cut[1..]);
    // A hinge that was drawn 1 mm wide for 0.2 mm is 0.97 mm wide.
    assert!((own.sigma.sample[1].hinge_width_mm - 0.97).abs() < 1e-9);

    // The same once more, under either name: nothing is counted twice, and not a byte changes.
    let before = bench.text(PROFILE);
    for line in [
        "calibrate fit coupon",
        "calibrate fit coupon coupon --material leather-1.6-measured",
    ] {
        let said = bench.says(0, line);
        assert!(said.contains("counted once"), "{said}");
        assert!(said.contains("has all of this already"), "{said}");
        assert_eq!(bench.text(PROFILE), before);
    }

    // Of one's own: the same profile, its comments kept, new strips beside the old ones.
    bench.write(PROFILE, &before.replace("[sigma]", "# mine alone\n[sigma]"));
    let more = READINGS.replace("A3;1,45;1,5;torn", "A3;1,4;1,45;torn");
    bench.write("coupon/readings.csv", &more);
    bench.record();
    let said = bench.says(
        0,
        "calibrate fit coupon --material leather-1.6-measured --take-setting",
    );
    assert!(said.contains("A1, A2, A4"), "{said}");
    let after = load(&bench.path(PROFILE));
    assert_eq!(after.sigma.sample.len(), 5);
    assert!(after.sigma.note.contains(&own.sigma.note));
    assert!(bench.text(PROFILE).contains("# mine alone"));
    // 25 % of 60 W is 37.5 % of 40 W.
    assert_eq!(after.cut[0].power_percent, Some(37.5));
    let json = bench.says(0, "--json --quiet calibrate fit coupon --name other");
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["profile"], "other");
    assert!(value["strips"]["bound"]["sigma"].as_f64().unwrap() > 1.2);
    assert!(bench.path("own/profiles/other.toml").exists());
}

#[test]
fn what_cannot_be_is_refused_and_no_profile_is_touched() {
    let bench = Bench::new();
    bench.record();
    bench.says(0, "calibrate fit coupon");
    let (profile, readings) = (bench.text(PROFILE), bench.text("coupon/readings.toml"));
    for (from, to, place) in [
        ("A2;1,5;1,55", "A2;1,55;1,5", "bad.csv:3:"),
        ("A2;1,5;1,55", "A2;150;155", "bad.csv:3:"),
        ("A2;", "Z9;", "bad.csv:3:"),
        ("K1-HOLE;;;;20,03", "K1-HOLE;;;;2,003", "bad.csv:6:"),
        ("name;held;tore", "name;held", "bad.csv:1:"),
    ] {
        assert!(READINGS.contains(from));
        bench.write("bad.csv", &READINGS.replacen(from, to, 1));
        let said = bench.says(2, "calibrate record coupon --readings bad.csv --force");
        assert!(said.contains(place), "{said}");
        assert_eq!(bench.text("coupon/readings.toml"), readings);
    }
    std::fs::write(bench.path("bad.csv"), [0xff, 0xfe, b'a', 0]).unwrap();
    let said = bench.says(2, "calibrate record coupon --readings bad.csv --force");
    assert!(said.contains("UTF-8"), "{said}");
    // Readings that give no σ: the answer is no, with the reason.
    for (rows, words) in [
        ("A1;1,5;1,55;torn;;\n", "at least two"),
        ("A1;1,5;;;;\nA2;1,55;;;;\n", "no strip failed"),
        ("A1;1;1,05;torn;;\nA2;1;1,05;torn;;\n", "first mark"),
    ] {
        let head = READINGS.lines().next().unwrap();
        bench.write("few.csv", &format!("{head}\n{rows}"));
        bench.says(
            0,
            "calibrate record coupon --readings few.csv -o few.toml --force",
        );
        // Under a name of their own, so that the good strips do not help.
        let said = bench.says(1, "calibrate fit few.toml --name few");
        assert!(said.contains(words), "{said}");
        assert!(!bench.path("own/profiles/few.toml").exists());
    }
    // A sheet far from the strips: no, and which strips would tell.
    let said = bench.says(1, "calibrate fit coupon --edge 40");
    assert!(said.contains("Pull two or more strips of 40 mm"), "{said}");
    // A little outside it is answered with care.
    let said = bench.says(0, "calibrate fit coupon --edge 20 --name far");
    assert!(said.contains("caution: an edge of 20 mm"), "{said}");
    for (line, words) in [
        ("calibrate fit coupon --confidence 2", "between 0.5"),
        ("calibrate fit coupon --material felt", "--material"),
        ("calibrate fit coupon --name felt-3", "shipped"),
        ("calibrate fit coupon/coupon.toml", "coupon.toml:"),
        ("calibrate fit nothing", "cannot read"),
        ("calibrate record coupon --date today --force", "YYYY-MM-DD"),
    ] {
        let said = bench.says(2, line);
        assert!(said.contains(words), "{line}: {said}");
    }
    assert_eq!(bench.text(PROFILE), profile);
}

const SHEET: &str = "sample:cap:half_angle_deg=45,faces=1000 --size 150 --triangles 180";

#[test]
fn make_asks_the_strips_for_its_own_sheet_and_proves_it() {
    let bench = Bench::new();
    bench.record();
    bench.says(0, "calibrate fit coupon");
    let of = |folder: &str| -> serde_json::Value {
        serde_json::from_str(&bench.text(&format!("{folder}/report.json"))).unwrap()
    };
    let said = bench.says(
        0,
        &format!("make {SHEET} --material leather-1.6-measured -o a"),
    );
    assert!(
        said.contains("from 4 strips (σ for a confidence of 0.9)"),
        "{said}"
    );
    let report = of("a");
    let strength = &report["strength"];
    // Fewer hinges than the reference sheet's.
    let max = load(&bench.path(PROFILE)).sigma.max;
    let sigma = strength["sigma"].as_f64().unwrap();
    assert!(sigma > max, "{sigma} {max}");
    assert_eq!(strength["from"], "strips");
    let proved = &strength["on"][0];
    assert!(proved["survival"].as_f64().unwrap() > 0.9);
    let widest = report["quality"]["opening"][2].as_f64().unwrap();
    let margin = proved["bound"].as_f64().unwrap() / widest;
    assert!((proved["margin_min"].as_f64().unwrap() - margin).abs() < 1e-6);
    assert!(bench.text("a/report.html").contains("<h2>Margins</h2>"));
    let design = bench.text("a/design.toml");
    assert!(design.contains("confidence = 0.9"), "{design}");

    // Made again from its design: the same bytes.
    bench.says(0, "make a/design.toml -o b");
    for entry in std::fs::read_dir(bench.path("a")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let of = |folder: &str| std::fs::read(bench.path(folder).join(&name)).unwrap();
        assert!(of("a") == of("b"), "{name}");
    }

    // More confidence, less σ; by hand it is the maker's word, and said so.
    let made = |more: &str, folder: &str| {
        bench.says(
            0,
            &format!("make {SHEET} --material leather-1.6-measured {more} -o {folder}"),
        )
    };
    made("--confidence 0.99", "c");
    assert!(of("c")["strength"]["sigma"].as_f64().unwrap() < sigma);
    let said = made("--sigma 1.6", "d");
    assert!(said.contains("given by hand"), "{said}");
    assert_eq!(of("d")["strength"]["from"], "hand");
    assert!(!bench.text("d/design.toml").contains("confidence"));
    // A design without the confidence is one by hand, too.
    bench.says(0, "make d/design.toml -o e");
    assert_eq!(of("e"), of("d"));
}

#[test]
fn a_sheet_that_the_strips_do_not_vouch_for_is_refused() {
    let bench = Bench::new();
    bench.record();
    bench.says(0, "calibrate fit coupon");
    // A cap that opens to 1.6 with a σ that was asked for, and a confidence that it does not have.
    let deep = "sample:cap:half_angle_deg=72,faces=1500 --size 180 --triangles 300 --cone none --material leather-1.6-measured --sigma 1.62 --confidence 0.9";
    let said = bench.says(1, &format!("make {deep} -o no"));
    assert!(said.contains("4 strips allow"), "{said}");
    assert!(said.contains("--sigma 1."), "{said}");
    assert!(!bench.path("no/job.nc").exists());
    let report: serde_json::Value = serde_json::from_str(&bench.text("no/report.json")).unwrap();
    assert_eq!(report["strength"]["on"][0]["holds"], false);
    assert!(report["strength"]["on"][0]["survival"].as_f64().unwrap() < 0.9);
    // Before any work: no strips, or none for such edges.
    for (line, words) in [
        (
            format!("make {SHEET} --material leather-1.6 --confidence 0.9 -o x"),
            "has none",
        ),
        (
            "make sample:cap:half_angle_deg=45,faces=1000 --size 600 --edge 60 --material leather-1.6-measured -o x".into(),
            "an edge of 60 mm",
        ),
        (
            format!("make {SHEET} --material leather-1.6-measured --confidence 1 -o x"),
            "--confidence is 1",
        ),
    ] {
        let said = bench.says(2, &line);
        assert!(said.contains(words), "{said}");
        assert!(!bench.path("x").exists());
    }
}

#[test]
fn the_whole_evening_is_rehearsed_on_a_material_that_nobody_told() {
    let bench = Bench::new();
    let json = |folder: &str, more: &str| -> serde_json::Value {
        let line = format!("--json -q calibrate rehearse -o {folder} {more}");
        let output = bench.run(&line);
        assert_eq!(output.status.code(), Some(0), "{line}\n{output:?}");
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let value = json("a", "--more-kerf 0.03");
    let number = |path: &str| {
        value
            .pointer(path)
            .and_then(serde_json::Value::as_f64)
            .unwrap()
    };
    assert_eq!(value["readings"]["strip"].as_array().unwrap().len(), 6);
    // Calipers found the kerf that was hidden, and the fit a bound that holds.
    let kerf = number("/machines/0/kerf/kerf_mm");
    assert!((kerf - number("/hidden/kerf_mm")).abs() < 0.02, "{kerf}");
    let (bound, best) = (number("/strips/bound/sigma"), number("/hidden/bound"));
    assert!(bound < best && bound > 0.8 * best, "{bound} {best}");
    assert!(number("/hidden/survival") > 0.9);
    assert!(number("/sheet/survival") > 0.9 && number("/sheet/widest") > 1.1);
    assert!(number("/sheet/survived") > 0.9 * number("/sheet/sheets"));
    // Nothing was put among the profiles of the person who rehearsed.
    assert!(!bench.path("own").exists());
    let profile = load(&bench.path("a/profiles/leather-1.6-measured.toml"));
    assert_eq!(profile.sigma.sample.len(), 6);
    let guide = bench.text("a/coupon/guide.html");
    let shown = format!("σ = {}", (bound * 1000.0).round() / 1000.0);
    assert!(
        guide.contains(&shown) && guide.contains("<figure class=\"fit\">"),
        "{shown}"
    );
    for file in ["coupon/strips.nc", "coupon/readings.toml", "sheet/job.nc"] {
        assert!(bench.path("a").join(file).exists(), "{file}");
    }
    // The sheet is one that anybody can make from what lies there.
    bench.says(0, "make a/sheet/design.toml -o again");
    let bytes = |name: &str| std::fs::read(bench.path(name)).unwrap();
    assert!(bytes("again/job.nc") == bytes("a/sheet/job.nc"));

    // The same seed, the same evening; an earlier one is not overwritten by mistake.
    let said = bench.says(2, "calibrate rehearse -o a");
    assert!(said.contains("--force"), "{said}");
    let mut other = json("b", "--more-kerf 0.03");
    other["written"] = value["written"].clone();
    assert_eq!(other, value);
    json("a", "--seed 5 --force");
    assert!(bench.text("a/coupon/readings.csv") != bench.text("b/coupon/readings.csv"));
    // Without the strips of the evening before.
    let profile = load(&bench.path("a/profiles/leather-1.6-measured.toml"));
    assert_eq!(profile.sigma.sample.len(), 6);

    // A material that bears nothing: no, with the reason, and no profile.
    let said = bench.says(1, "calibrate rehearse -o none --hidden-sigma 1.03");
    assert!(said.contains("first mark"), "{said}");
    assert!(!bench.path("none/profiles").exists());
    for (line, words) in [
        ("calibrate rehearse -o x --spread 90", "--spread"),
        ("calibrate rehearse -o x --confidence 0.2", "between 0.5"),
        (
            "calibrate rehearse -o x --machine plasma-generic",
            "plasma-generic",
        ),
    ] {
        let said = bench.says(2, line);
        assert!(said.contains(words), "{line}: {said}");
        assert!(!bench.path("x").exists());
    }
}

#[test]
fn a_coupon_that_cannot_be_is_refused_and_nothing_is_written() {
    let bench = Bench::new();
    for (line, words) in [
        ("--stock 60x40", "--stock"),
        ("--hinge-width 0", "hinge width"),
        ("--hinge-width 9 --edge 10", "A1"),
        ("--edge 0.1", "edge"),
        (
            "--hinge-width 1,1.1,1.2,1.3,1.4,1.5,1.6,1.7 --edge 7,8,9,10,11,12",
            "strips",
        ),
        ("--material steel-1.5", "steel-1.5"),
        ("--material nothing", "nothing"),
        ("--machine nothing", "nothing"),
    ] {
        let said = bench.says(2, &format!("calibrate coupon {line} -o x"));
        assert!(said.contains(words), "{line}: {said}");
        assert!(!bench.path("x").exists());
    }
    // What finds no room is told of, and the rest is made.
    let said = bench.says(0, "calibrate coupon --stock 230x160 -o small");
    assert!(said.contains("warning: no room"), "{said}");
    let text = bench.text("small/coupon.toml");
    let coupon = kagome::calibrate::Coupon::parse("coupon.toml", &text).unwrap();
    assert!((3..6).contains(&coupon.strip.len()));
    // A coupon whose readings are there is evidence.
    bench.write("small/readings.toml", "");
    let said = bench.says(2, "calibrate coupon --force -o small");
    assert!(said.contains("readings"), "{said}");
    assert_eq!(bench.text("small/coupon.toml"), text);
}
