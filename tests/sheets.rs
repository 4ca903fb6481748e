//! Sheets as they are burnt: what pixels say of every ligament and of the sheet while it is cut, every machine with every
//! material, and what becomes of input that no sheet can be made of.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

mod judge;

use std::path::{Path, PathBuf};

use judge::run::{kagome, stderr};
use judge::{raster, sheet};
use kagome::material::Fit;
use kagome::{machine, material};

fn read(path: PathBuf) -> String {
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn shipped(kind: &str, name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    read(root.join(kind).join(format!("{name}.toml")))
}

/// Pixels of the windows around ligaments, millimetres.
const FINE_MM: f64 = 0.005;

/// What a ligament may differ by from what is asked for, millimetres.
const WIDTH_MM: f64 = 0.02;

/// Makes with these words, and judges the job by pixels. Gives back how many tips there are.
fn make_and_measure(words: &str) -> usize {
    let folder = tempfile::tempdir().unwrap();
    let mut args = vec!["make", "--quiet", "-o", "out"];
    args.extend(words.split(' '));
    let output = kagome(&args, folder.path());
    assert_eq!(
        output.status.code(),
        Some(0),
        "{words}: {}",
        stderr(&output)
    );
    measure(&folder.path().join("out"), words)
}

fn measure(out: &Path, words: &str) -> usize {
    let drawing = sheet::read_drawing(&read(out.join("pattern.svg")));
    let burnt = sheet::burn(&read(out.join("job.nc")));
    assert_eq!(burnt.faults, Vec::<String>::new(), "{words}");
    let tips = raster::tips(&drawing, &burnt.pieces, FINE_MM);
    let wrong = raster::wrong_widths(&drawing, &tips, WIDTH_MM);
    assert!(
        wrong.is_empty(),
        "{words}: {} of {} tips are wrong: {:#?}",
        wrong.len(),
        tips.len(),
        &wrong[..wrong.len().min(5)]
    );
    assert!(tips.iter().any(|t| !t.rim), "{words}: hinges inside");
    let whole = raster::whole(&drawing, &burnt, 0.25 * drawing.kerf);
    assert_eq!(whole.faults, Vec::<String>::new(), "{words}");
    assert!(whole.before_rim > 0, "{words}");
    let parts = drawing
        .contours
        .iter()
        .filter(|l| sheet::loop_area(l) > 0.0)
        .count();
    let wanted = if drawing.tabs > 0 { 1 } else { parts + 1 };
    assert_eq!(whole.pieces, wanted, "{words}: pieces when all is cut");
    if std::env::var_os("KAGOME_TELL").is_some() {
        let widths = tips.iter().flat_map(|t| t.widths.map(|w| (w, t.rim)));
        let inside = widths.clone().filter(|w| !w.1).map(|w| w.0 - drawing.hinge);
        println!(
            "{words}: {} tips, {} at the rim; inside {:+.4} to {:+.4} mm of {}, narrowest at the rim {:.4}; {} strokes before the rim",
            tips.len(),
            tips.iter().filter(|t| t.rim).count(),
            inside.clone().fold(f64::INFINITY, f64::min),
            inside.fold(f64::NEG_INFINITY, f64::max),
            drawing.hinge,
            widths
                .filter(|w| w.1)
                .map(|w| w.0)
                .fold(f64::INFINITY, f64::min),
            whole.before_rim,
        );
    }
    tips.len()
}

#[test]
fn ligaments_are_as_wide_as_asked_and_the_sheet_stays_in_one_piece_to_the_rim() {
    for words in [
        "sample:cap --triangles 60",
        "sample:cap --triangles 60 --tip round:0.6 --tabs 3",
        "sample:cap --triangles 60 --tip teardrop:0.6",
        "sample:cap --triangles 60 --corner-radius 0.8 --pattern left",
        "sample:cap --triangles 60 --tip teardrop:0.5 --corner-radius 0.8 --kerf 0.4 --hinge 0.7",
        "sample:vase --sigma 2 --triangles 100 --alignment-holes 3 --tabs 4:1",
        "sample:cap --triangles 60 --rim smooth --hinge 0.6",
        "sample:bump --cone auto --remove 4 --sigma 2 --triangles 150 --cool 20",
    ] {
        assert!(make_and_measure(words) > 50, "{words}");
    }
}

#[test]
fn a_smooth_rim_trims_triangles_and_its_design_gives_the_same_bytes_again() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let output = kagome(args, folder.path());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    };
    let smooth = ["--rim", "smooth", "--hinge", "0.6", "--triangles", "200"];
    let mut args = vec!["make", "sample:cap", "--quiet", "-o", "smooth"];
    args.extend(smooth);
    run(&args);
    run(&["make", "smooth/design.toml", "--quiet", "-o", "again"]);
    let at = |dir: &str, file: &str| std::fs::read(folder.path().join(dir).join(file)).unwrap();
    for file in [
        "design.toml",
        "layout.obj",
        "linkage.obj",
        "pattern.svg",
        "job.nc",
    ] {
        assert!(at("smooth", file) == at("again", file), "{file}");
    }
    let figures: serde_json::Value = serde_json::from_slice(&at("smooth", "report.json")).unwrap();
    let trimmed = figures["linkage"]["trimmed_at_rim"].as_u64().unwrap();
    assert!(trimmed > 0);
    // In space every triangle is whole, near the surface that was continued under it.
    let found = judge::linkage::judge(
        &read(folder.path().join("smooth/linkage.obj")),
        &read(folder.path().join("smooth/layout.obj")),
        1.8,
    );
    judge::linkage::strict(&found).unwrap();
    // The part is no larger than its triangles, and smaller by what is cut off.
    let drawing = sheet::read_drawing(&read(folder.path().join("smooth/pattern.svg")));
    let area: f64 = drawing.contours.iter().map(|l| sheet::loop_area(l)).sum();
    let triangles: f64 = drawing
        .triangles
        .iter()
        .map(|t| sheet::loop_area(t).abs())
        .sum();
    let each = triangles / drawing.triangles.len() as f64;
    let lost = (triangles - area) / each;
    assert!(lost > 0.0 && lost < trimmed as f64, "{lost} of {trimmed}");
}

/// Every hinge of a sheet as makers cut it.
#[test]
#[ignore = "slow: .ci/run runs it on the release build"]
fn every_ligament_of_the_mask_is_as_wide_as_asked() {
    for words in [
        "sample:mask",
        "sample:mask --tip round:0.4 --tabs 6",
        "sample:mask --tip teardrop:0.4 --corner-radius 0.3",
    ] {
        assert!(make_and_measure(words) > 2000, "{words}");
    }
}

/// A measure that finds nothing wrong must find something wrong where there is.
#[test]
fn pixels_see_a_slit_that_is_too_long_and_a_piece_that_falls_out() {
    let folder = tempfile::tempdir().unwrap();
    let made = kagome(
        &["make", "-q", "-o", "out", "sample:cap", "--triangles", "60"],
        folder.path(),
    );
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
    let out = folder.path().join("out");
    let mut drawing = sheet::read_drawing(&read(out.join("pattern.svg")));
    let mut burnt = sheet::burn(&read(out.join("job.nc")));
    let good = raster::tips(&drawing, &burnt.pieces, FINE_MM);
    // 0.05 mm longer than drawn at one tip that lies inside.
    let tip = good.iter().find(|t| !t.rim).unwrap().at;
    let n = drawing.slits.iter().position(|s| s[1] == tip).unwrap();
    let [tail, _] = drawing.slits[n];
    let length = (tip[0] - tail[0]).hypot(tip[1] - tail[1]);
    let on = [0, 1].map(|c| tip[c] + 0.05 / length * (tip[c] - tail[c]));
    let stroke = burnt.strokes[burnt.strokes.len() / 2];
    let at = burnt.strokes.iter().position(|s| *s == stroke).unwrap();
    burnt.pieces.insert(at, [tip, on]);
    burnt.strokes.insert(at, stroke);
    let tips = raster::tips(&drawing, &burnt.pieces, FINE_MM);
    assert_eq!(raster::wrong_widths(&drawing, &tips, WIDTH_MM).len(), 1);
    let narrower = tips[n].widths[0].min(tips[n].widths[1]);
    let cosine = (std::f64::consts::FRAC_PI_3).sin();
    assert!((drawing.hinge - 0.05 * cosine - narrower).abs() < 0.01);
    // A hinge a little wider than asked for is within the tolerance, one much wider is not.
    drawing.hinge -= 0.008;
    assert_eq!(raster::wrong_widths(&drawing, &good, WIDTH_MM).len(), 0);
    drawing.hinge -= 0.02;
    let wrong = raster::wrong_widths(&drawing, &good, WIDTH_MM).len();
    assert_eq!(wrong, good.iter().filter(|t| !t.rim).count());
    // A ring around a triangle's middle: it hangs on nothing.
    let t = drawing.triangles[drawing.triangles.len() / 2].clone();
    let middle = [0, 1].map(|c| (t[0][c] + t[1][c] + t[2][c]) / 3.0);
    let corner = |k: usize| [0, 1].map(|c| middle[c] + 0.6 * (t[k % 3][c] - middle[c]));
    for k in 0..3 {
        burnt.pieces.insert(at, [corner(k), corner(k + 1)]);
        burnt.strokes.insert(at, stroke);
    }
    let whole = raster::whole(&drawing, &burnt, 0.05);
    assert!(!whole.faults.is_empty());
    assert!(
        whole.faults[0].contains("in 2 pieces"),
        "{:?}",
        whole.faults
    );
}

#[test]
fn the_price_of_heat_moves_cuts_apart_and_is_kept_in_the_design() {
    let folder = tempfile::tempdir().unwrap();
    let run = |words: &str| {
        let args: Vec<&str> = words.split(' ').collect();
        let output = kagome(&args, folder.path());
        assert_eq!(
            output.status.code(),
            Some(0),
            "{words}: {}",
            stderr(&output)
        );
    };
    run("make -q -o plain sample:cap --triangles 80");
    run("make -q -o cool sample:cap --triangles 80 --cool 60:40");
    run("make -q -o again cool/design.toml");
    let file = |out: &str, name: &str| read(folder.path().join(out).join(name));
    let figure = |out: &str, name: &str| -> f64 {
        let report: serde_json::Value = serde_json::from_str(&file(out, "report.json")).unwrap();
        let found = report.pointer(&format!("/job/{name}"));
        found
            .and_then(|v| v.as_f64())
            .unwrap_or_else(|| panic!("{name}"))
    };
    let [plain, cool] = ["plain", "cool"].map(|out| figure(out, "spacing_mean_mm"));
    assert!(cool > plain + 5.0, "{plain} {cool}");
    assert!(figure("cool", "travel_mm") > figure("plain", "travel_mm"));
    let design = file("cool", "design.toml");
    assert!(design.contains("cool_price_mm = 60.0"), "{design}");
    assert!(design.contains("cool_reach_mm = 40.0"), "{design}");
    assert!(!file("plain", "design.toml").contains("cool"));
    assert_eq!(file("cool", "job.nc"), file("again", "job.nc"));
}

/// A shallow cap of about 80 triangles, of a size that goes with the cut of a pair.
fn small_sample(material: &material::Material, setting: &material::CutSetting) -> Vec<String> {
    // Twice what the hinge and the cut ask for, and room for the pierce.
    let neck_mm = (material.hinge_width_mm + setting.kerf_mm) / 0.75f64.sqrt();
    let edge_mm = 4.0 * neck_mm + 3.0 * setting.pierce_diameter_mm;
    let across_mm = 10.0 * edge_mm;
    // A cap of 15° needs a ratio of scales of (1 + tan² 7.5°) = 1.017.
    let words = format!(
        "sample:cap:half_angle_deg=15 --size {across_mm} --edge {edge_mm} --cone none --material {}",
        material.name
    );
    words.split(' ').map(str::to_owned).collect()
}

/// Makes, verifies and rehearses a sample of a pair, or meets its refusal.
fn judge_pair(machine: &str, material: &str) -> Fit {
    let (m, s) = (
        machine::load(machine).unwrap(),
        material::load(material).unwrap(),
    );
    let fit = material::classify(&m, &s);
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| kagome(args, folder.path());
    let name = format!("{machine} and {material}");
    let Ok(setting) = s.cut_for(&m) else {
        assert_ne!(fit, Fit::Compatible);
        let why = s.cut_for(&m).unwrap_err().to_string();
        let made = run(&[
            "make",
            "-q",
            "-o",
            "out",
            "sample:cap",
            "--machine",
            machine,
            "--material",
            material,
        ]);
        assert_eq!(made.status.code(), Some(2), "{name}");
        assert!(stderr(&made).contains(&why), "{name}: {}", stderr(&made));
        assert!(!folder.path().join("out").exists(), "{name}");
        return fit;
    };
    assert_eq!(fit, Fit::Compatible, "{name}");
    let sample = small_sample(&s, &setting);
    let mut args = vec!["make", "-q", "-o", "out", "--machine", machine];
    args.extend(sample.iter().map(String::as_str));
    let made = run(&args);
    assert_eq!(made.status.code(), Some(0), "{name}: {}", stderr(&made));
    let report: serde_json::Value =
        serde_json::from_str(&read(folder.path().join("out/report.json"))).unwrap();
    let triangles = report
        .pointer("/linkage/triangles")
        .unwrap()
        .as_u64()
        .unwrap();
    assert!((50..=150).contains(&triangles), "{name}: {triangles}");
    assert_eq!(report.pointer("/job/verified").unwrap(), true, "{name}");
    // The job by itself: machine and passes are in its header.
    let verified = run(&["verify", "out/job.nc"]);
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{name}: {}",
        stderr(&verified)
    );
    // The judge of pixels reads the words of lasers, and sees no difference between passes and strokes.
    if m.laser().is_some() && setting.passes == 1 {
        measure(&folder.path().join("out"), &name);
    }
    fit
}

/// Beyond what a material stretches there is no job.
fn judge_sigma(machine: &str, material: &str) {
    let folder = tempfile::tempdir().unwrap();
    let s = material::load(material).unwrap();
    // A cap needs 1 + tan²(φ/2) without a cone: this one asks for half as much again as there is, and is fine enough
    // that nothing else is in the way.
    let half = (1.5 * s.sigma.max - 1.0).sqrt().atan();
    let across_mm = 60.0 * (s.hinge_width_mm + 0.5);
    let sample = format!("sample:cap:half_angle_deg={}", (2.0 * half).to_degrees());
    let words = format!(
        "make -q -o out {sample} --size {across_mm} --triangles 600 --cone none --dart none --machine {machine} --material {material}"
    );
    let made = kagome(&words.split(' ').collect::<Vec<_>>(), folder.path());
    let text = stderr(&made);
    assert_eq!(made.status.code(), Some(1), "{words}: {text}");
    assert!(text.contains("σ"), "{words}: {text}");
    assert!(!folder.path().join("out/job.nc").exists(), "{words}");
}

#[test]
fn pairs_of_machine_and_material_make_a_sample_or_say_why_not() {
    for (machine, material, fit) in [
        ("co2-600x400", "acrylic-3", Fit::Compatible),
        ("fibre-300", "copper-0.2", Fit::Compatible),
        ("diode-400", "felt-3", Fit::Compatible),
        ("plasma-linuxcnc", "steel-1.5", Fit::Compatible),
        ("fibre-300", "felt-3", Fit::OtherLaser),
        ("co2-600x400", "steel-1.5", Fit::OtherProcess),
        ("plasma-linuxcnc", "leather-1.6", Fit::OtherProcess),
    ] {
        assert_eq!(judge_pair(machine, material), fit, "{machine} {material}");
    }
    judge_sigma("co2-600x400", "plywood-3");
}

#[test]
#[ignore = "slow: .ci/run runs it on the release build"]
fn every_machine_and_every_material_make_a_sample_or_say_why_not() {
    let (mut made, mut refused) = (0, 0);
    for (material, _) in material::shipped() {
        let mut first = None;
        for (machine, _) in machine::shipped() {
            let loaded = (
                machine::load(machine).unwrap(),
                material::load(material).unwrap(),
            );
            let fits = material::classify(&loaded.0, &loaded.1) == Fit::Compatible;
            judge_pair(machine, material);
            if fits {
                first = first.or(Some(machine));
            }
            *(if fits { &mut made } else { &mut refused }) += 1;
        }
        if let Some(machine) = first {
            judge_sigma(machine, material);
        }
    }
    assert!(
        made >= 20 && refused >= 20,
        "{made} made, {refused} refused"
    );
}

/// Sheets that cannot be: the words that help, and nothing left behind.
#[test]
fn sheets_that_cannot_be_cut_cost_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    let slow =
        shipped("machines", "co2-600x400").replace("x = 30000, y = 20000", "x = 800, y = 800");
    assert!(slow.contains("x = 800"));
    write("slow.toml", slow);
    let strong =
        shipped("profiles", "leather-1.6").replace("power_percent = 45", "power_percent = 120");
    write("strong.toml", strong);
    let cases: &[(&str, &[&str])] = &[
        // The slits of triangles of 24 mm are 21 mm apart.
        ("--kerf 12", &["kerf of 12 mm", "edges of", "too wide"]),
        (
            "--hinge 12",
            &["hinge 12 mm", "edges of 28.175", "at most 10.26"],
        ),
        ("--tip round:30", &["tips of radius 30 mm", "edges of"]),
        ("--corner-radius 9", &["rounded to 9 mm", "1.100 mm"]),
        ("--stock 8x8", &["leaves 0 x 0 mm", "--stock"]),
        ("--stock 30x30", &["there is room for 20.0 x 20.0 mm"]),
        ("--stock 100x100 --undivided", &["room for 90.0 x 90.0 mm"]),
        ("--stock 0x5", &["0x5", "300x200"]),
        ("--stock 300", &["width and height"]),
        ("--tip round:0", &["round:0", "R above 0"]),
        ("--tip square:1", &["plain, round:R"]),
        ("--tip plain --tip round:1", &["--tip", "multiple times"]),
        ("--tabs 3:0", &["3:0", "4:0.8"]),
        ("--tabs 2:500", &["tab of 500 mm", "at the most", "--tabs"]),
        ("--cool 0", &["--cool", "20:15"]),
        ("--cool 5:-1", &["--cool", "20:15"]),
        ("--machine ./slow.toml", &["800 mm/min", "900 mm/min"]),
        (
            "--material ./strong.toml",
            &["strong.toml", "power_percent", "120"],
        ),
        ("--material steel-1.5", &["cuts with laser", "plasma 20 A"]),
        ("--machine plasma-generic", &["plasma", "leather-1.6"]),
    ];
    let before = std::fs::read_dir(folder.path()).unwrap().count();
    for (words, wanted) in cases {
        let all = format!("make -q -o out sample:cap --triangles 80 {words}");
        let output = kagome(&all.split(' ').collect::<Vec<_>>(), folder.path());
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{words}: {text}");
        for word in *wanted {
            assert!(text.contains(word), "{words} should say {word:?}: {text}");
        }
        assert!(!text.contains("panicked"), "{words}: {text}");
        let now = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(now, before, "{words} left something behind");
    }
    // As wide as it can be, a cut is no reason to refuse.
    let words = "make -q -o wide sample:cap --triangles 80 --kerf 9";
    let made = kagome(&words.split(' ').collect::<Vec<_>>(), folder.path());
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
    // A design decides about its sheet.
    let made = kagome(
        &[
            "make",
            "-q",
            "-o",
            "a",
            "sample:cap",
            "--triangles",
            "60",
            "--tabs",
            "200",
        ],
        folder.path(),
    );
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
    let report = read(folder.path().join("a/report.json"));
    assert!(report.contains("tabs of 200 fit"), "fewer tabs are told");
    for option in ["--cool 5", "--tabs 2", "--tip round:1"] {
        let all = format!("make a/design.toml -q -o b {option}");
        let output = kagome(&all.split(' ').collect::<Vec<_>>(), folder.path());
        assert_eq!(output.status.code(), Some(2), "{option}");
        assert!(
            stderr(&output).contains(&option[..6]),
            "{}",
            stderr(&output)
        );
        assert!(!folder.path().join("b").exists());
    }
    let design = read(folder.path().join("a/design.toml"));
    for (line, word) in [
        ("cool_price_mm = 5.0", "goes with"),
        ("cool_price_mm = -5.0", "cool_price_mm"),
        ("tip = \"round\"", "goes with"),
    ] {
        write(
            "c.toml",
            design.replacen("[sheet]", &format!("[sheet]\n{line}"), 1),
        );
        let output = kagome(&["make", "c.toml", "-q", "-o", "b"], folder.path());
        assert_eq!(output.status.code(), Some(2), "{line}");
        assert!(
            stderr(&output).contains(word),
            "{line}: {}",
            stderr(&output)
        );
        assert!(!folder.path().join("b").exists());
    }
}

/// Drawings and jobs that others made or edited.
#[test]
fn foreign_drawings_and_jobs_are_answered_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/hexagon");
    let drawing = read(golden.join("pattern.svg"));
    let job = read(golden.join("job.nc"));
    let with = |more: &str| drawing.replacen("</svg>", &format!("{more}</svg>"), 1);
    let text = "<text x=\"10\" y=\"-10\">mine</text>";
    let image = "<image x=\"0\" y=\"0\" width=\"9\" height=\"9\" href=\"cat.png\"/>";
    write("text.svg", &with(text));
    write("image.svg", &with(image));
    write(
        "only.svg",
        &format!("<svg xmlns=\"http://www.w3.org/2000/svg\">{text}{image}</svg>"),
    );
    write("prose.svg", "It was a dark and stormy night.");
    for (name, words) in [
        ("text", &["text.svg", "line ", "turn it into a path"][..]),
        ("image", &["image.svg", "line ", "image"]),
        ("only", &["only.svg"]),
        ("prose", &["prose.svg"]),
    ] {
        let file = format!("{name}.svg");
        let output = kagome(&["cut", &file, "-o", "no.nc"], folder.path());
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{name}: {said}");
        for word in words {
            assert!(said.contains(word), "{name} should say {word:?}: {said}");
        }
        assert!(!folder.path().join("no.nc").exists());
    }
    for (name, from, to, words) in [
        ("letter", "G21", "G21 Q5", &["line 6", "Q"][..]),
        ("code", "G17", "G17 G81", &["G81", "line 8"]),
        ("prose", "G94", "hello there", &["line 9"]),
        ("feed", "F900", "F90000", &["90000", "30000"]),
        ("power", "S300", "S1200", &["1200", "1000"]),
        ("inches", "G21", "G20", &["off the bed"]),
        ("constant", "M4 S0", "M3 S0", &["M3", "M4 only"]),
    ] {
        write("job.nc", &job.replacen(from, to, 1));
        let verified = kagome(&["verify", "job.nc"], folder.path());
        let said = stderr(&verified);
        assert_eq!(verified.status.code(), Some(1), "{name}: {said}");
        for word in words {
            assert!(said.contains(word), "{name} should say {word:?}: {said}");
        }
        assert!(!said.contains("panicked"), "{said}");
    }
}
