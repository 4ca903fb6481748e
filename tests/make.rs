//! `kagome make` as a person runs it, judged from the files that it leaves.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

mod judge;

use std::path::{Path, PathBuf};

use judge::run::{kagome, stderr};
use judge::{linkage, sheet};

const ALL: [&str; 9] = [
    "design.toml",
    "layout.obj",
    "linkage.obj",
    "linkage.glb",
    "pattern.svg",
    "pattern.dxf",
    "job.nc",
    "report.json",
    "report.html",
];

fn read(path: PathBuf) -> String {
    // Of a binary file the bytes are compared as well as they can be: what is not text becomes a mark.
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Makes, and lets both judges look at the result.
fn make_and_judge(args: &[&str]) -> (sheet::Drawing, linkage::Findings) {
    let folder = tempfile::tempdir().unwrap();
    let mut all = vec!["make", "--quiet", "-o", "out"];
    all.extend(args);
    let output = kagome(&all, folder.path());
    assert_eq!(
        output.status.code(),
        Some(0),
        "{args:?}: {}",
        stderr(&output)
    );
    judge(&folder.path().join("out"), &format!("{args:?}"))
}

/// Lets both judges look at what was made.
fn judge(out: &Path, name: &str) -> (sheet::Drawing, linkage::Findings) {
    for file in ALL {
        assert!(out.join(file).is_file(), "{name}: {file}");
    }
    let sigma = 2.0;
    let found = linkage::judge(
        &read(out.join("linkage.obj")),
        &read(out.join("layout.obj")),
        sigma,
    );
    linkage::strict(&found).unwrap_or_else(|e| panic!("{name}: {e}"));
    let drawing = sheet::read_drawing(&read(out.join("pattern.svg")));
    let burnt = sheet::burn(&read(out.join("job.nc")));
    assert_eq!(burnt.faults, Vec::<String>::new());
    assert_eq!(
        sheet::compare(&drawing, &burnt.pieces, 0.011, 0.0),
        Vec::<String>::new()
    );
    // What the simulated machine burnt through the sender. It moves in whole steps of 1/80 mm, and with dynamic power
    // the beam goes out a few hundredths before each stop.
    let machine = kagome::machine::load(kagome::machine::DEFAULT).unwrap();
    let rehearsal = kagome::sim::rehearse(
        read(out.join("job.nc")).as_bytes(),
        &kagome::sim::Settings::of_machine(&machine),
        &kagome::control::JobRules::default(),
        &kagome::base::progress::Silent,
    )
    .unwrap();
    let really: Vec<[[f64; 2]; 2]> = rehearsal
        .burns
        .iter()
        // Marks are burnt with less.
        .filter(|b| b.s == burnt.power)
        .map(|b| [b.from_mm, b.to_mm])
        .collect();
    let length = |pieces: &[[[f64; 2]; 2]]| -> f64 {
        let far = |[a, b]: &[[f64; 2]; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        pieces.iter().map(far).sum()
    };
    assert!(length(&really) > 0.97 * length(&burnt.pieces));
    assert_eq!(
        sheet::compare(&drawing, &really, 0.02, 0.15),
        Vec::<String>::new()
    );
    // The drawing against the linkage: one slit a hinge that is not on a seam, one area a triangle, and the same again
    // for the flaps, which the linkage does not know.
    let own = drawing.slits.len() - drawing.flap_slits;
    assert_eq!(own, found.hinges - found.seam_hinges);
    assert_eq!(drawing.triangles.len(), found.triangles);
    let (to_sheet, between, faults) = sheet::judge_flaps(&drawing);
    assert_eq!(faults, Vec::<String>::new());
    assert_eq!(drawing.flap_slits, to_sheet + between);
    let report: serde_json::Value = serde_json::from_str(&read(out.join("report.json"))).unwrap();
    let told = |pointer: &str| report.pointer(pointer).unwrap().as_u64().unwrap() as usize;
    assert_eq!(told("/sheet/flap_triangles"), drawing.flaps.len());
    let bare = told("/linkage/seam_edges_without_flaps");
    assert_eq!(to_sheet, found.seam_hinges - bare);
    let triangle = 0.75f64.sqrt() / 2.0 * drawing.edge * drawing.edge;
    let all = found.triangles + drawing.flaps.len();
    let relative = sheet::area(&drawing) / (all as f64 * triangle) - 1.0;
    assert!(relative.abs() < 1e-4, "area off by {relative:e}");
    assert!((sheet::narrowest_ligament(&drawing) - drawing.hinge).abs() < 1e-3);
    (drawing, found)
}

#[test]
fn surfaces_within_reach_become_jobs() {
    for args in [
        vec!["sample:hemisphere"],
        vec!["sample:cap", "--pattern", "left"],
        vec!["sample:saddle", "--orientation", "17"],
        vec!["sample:bump", "--cone", "auto", "--remove", "4"],
        vec!["sample:vase"],
        vec!["sample:vase", "--hem", "1", "--hem", "2"],
        vec!["sample:funnel"],
        vec!["sample:torus:t=4"],
    ] {
        let mut args = args;
        args.extend(["--sigma", "2", "--triangles", "400"]);
        let (_, found) = make_and_judge(&args);
        assert!(
            (360..=440).contains(&found.triangles),
            "{} triangles for 400 wanted",
            found.triangles
        );
        let disk = ["sample:hemisphere", "sample:cap", "sample:saddle"].contains(&args[0]);
        assert_eq!(found.seam_hinges == 0, disk, "{args:?}");
    }
}

/// At the size that a maker uses; minutes without optimisation, so only where the release build is at hand.
#[test]
#[ignore = "slow: .ci/run runs it on the release build"]
fn surfaces_within_reach_become_jobs_at_full_size() {
    for args in [
        vec!["sample:hemisphere"],
        vec!["sample:cap"],
        vec!["sample:saddle"],
        vec!["sample:bump", "--cone", "auto", "--remove", "4"],
        vec!["sample:mask", "--pattern", "left"],
        vec!["sample:vase"],
        vec!["sample:funnel"],
        vec!["sample:catenoid", "--pattern", "left"],
        // √13 and √(28/3): the torus' own ratio is that of a lattice; 4: it is not.
        vec!["sample:torus:t=3.605551275463989"],
        vec!["sample:torus:t=3.0550504633038935"],
        vec!["sample:torus:t=4"],
        vec!["sample:octasphere"],
        vec!["sample:double_torus"],
    ] {
        let mut args = args;
        // Where several seams must fit at once the lattice has few sizes to choose from: 1368 and 1373 triangles.
        let several = ["sample:octasphere", "sample:double_torus"].contains(&args[0]);
        let range = if several { 1350..=1650 } else { 1400..=1600 };
        args.extend(["--sigma", "2", "--triangles", "1500"]);
        let (_, found) = make_and_judge(&args);
        assert!(
            range.contains(&found.triangles),
            "{} triangles for 1500 wanted",
            found.triangles
        );
    }
}

/// Scans, where a folder of them is named.
#[test]
#[ignore = "slow: .ci/run runs it on the release build"]
fn scans_become_jobs() {
    let Some(folder) = std::env::var_os("KAGOME_MODELS") else {
        return;
    };
    for name in [
        "mp_mask_20k",
        "cat_head",
        "mph_50k",
        "boot_upper_annulus",
        "torso_4loops",
        "foot",
        "bff_spothead",
        "spot",
        "nefertiti_mask",
        "ict_face_A",
        "ict_face_B",
        "igl_3holes",
    ] {
        let scan = Path::new(&folder).join(format!("{name}.obj"));
        if !scan.is_file() {
            continue;
        }
        let path = scan.to_string_lossy();
        let args = [
            &*path,
            "--size",
            "250",
            "--sigma",
            "2",
            "--triangles",
            "2500",
        ];
        make_and_judge(&args);
    }
}

/// A sheet larger than the stock becomes several, each with its own job, and all together they are the same linkage.
#[test]
#[ignore = "slow: .ci/run runs it on the release build"]
fn a_sheet_larger_than_the_stock_is_divided() {
    let folder = tempfile::tempdir().unwrap();
    let whole = kagome(&["make", "sample:mask", "-q", "-o", "whole"], folder.path());
    assert_eq!(whole.status.code(), Some(0), "{}", stderr(&whole));
    let count = |name: &str, key: &str| {
        let report: serde_json::Value =
            serde_json::from_str(&read(folder.path().join(name).join("report.json"))).unwrap();
        report.pointer(key).unwrap().as_u64().unwrap()
    };
    for (stock, least) in [("160x140", 2), ("90x80", 4)] {
        let args = ["make", "sample:mask", "--stock", stock, "-q", "-o", stock];
        let output = kagome(&args, folder.path());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let out = folder.path().join(stock);
        let mut found = linkage::judge(
            &read(out.join("linkage.obj")),
            &read(out.join("layout.obj")),
            2.0,
        );
        // Pieces on stock are turned by any angle against each other.
        found
            .faults
            .retain(|f| !f.contains("do not turn by a multiple of 120"));
        linkage::strict(&found).unwrap();
        let (width, height) = stock.split_once('x').unwrap();
        let (width, height): (f64, f64) = (width.parse().unwrap(), height.parse().unwrap());
        let (mut sheets, mut triangles, mut slits, mut flap_slits) = (0, 0, 0, 0);
        loop {
            let number = if sheets == 0 {
                String::new()
            } else {
                format!("-{}", sheets + 1)
            };
            let job = out.join(format!("job{number}.nc"));
            if !job.is_file() {
                break;
            }
            sheets += 1;
            let drawing = sheet::read_drawing(&read(out.join(format!("pattern{number}.svg"))));
            let burnt = sheet::burn(&read(job.clone()));
            assert_eq!(burnt.faults, Vec::<String>::new());
            assert_eq!(
                sheet::compare(&drawing, &burnt.pieces, 0.011, 0.0),
                Vec::<String>::new()
            );
            for p in burnt.pieces.iter().flatten() {
                assert!(p[0] >= 5.0 && p[1] >= 5.0 && p[0] <= width - 5.0 && p[1] <= height - 5.0);
            }
            triangles += drawing.triangles.len();
            slits += drawing.slits.len();
            flap_slits += drawing.flap_slits;
            // By itself, with the drawing that goes with it.
            let verified = kagome(&["verify", &job.to_string_lossy()], folder.path());
            assert_eq!(verified.status.code(), Some(0), "{}", stderr(&verified));
        }
        assert!(sheets >= least, "{sheets} sheets of {stock}");
        assert_eq!(triangles as u64, count("whole", "/linkage/triangles"));
        assert_eq!(slits - flap_slits, found.hinges - found.seam_hinges);
        assert!(found.seam_hinges as u64 > count("whole", "/linkage/seam_edges"));
        // The design brings the same sheets again.
        let design = out.join("design.toml").to_string_lossy().into_owned();
        let again = kagome(
            &["make", &design, "-q", "-o", "again", "--force"],
            folder.path(),
        );
        assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
        let name = format!("job-{sheets}.nc");
        assert_eq!(
            read(out.join(&name)),
            read(folder.path().join("again").join(&name))
        );
    }
    let refused = kagome(
        &[
            "make",
            "sample:mask",
            "--stock",
            "90x80",
            "--undivided",
            "-q",
            "-o",
            "none",
        ],
        folder.path(),
    );
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        stderr(&refused).contains("there is room for 80.0 x 70.0 mm"),
        "{}",
        stderr(&refused)
    );
    assert!(!folder.path().join("none").exists());
}

#[test]
fn cut_from_the_back_is_the_mirror_image() {
    let plain = make_and_judge(&["sample:cap", "--triangles", "150"]).0;
    let mirrored = make_and_judge(&["sample:cap", "--triangles", "150", "--mirror"]).0;
    let width = |d: &sheet::Drawing| {
        let x = d.contours.iter().flatten().map(|p| p[0]);
        x.clone().fold(f64::NEG_INFINITY, f64::max) - x.fold(f64::INFINITY, f64::min)
    };
    assert!((width(&plain) - width(&mirrored)).abs() < 1e-3);
    // Mirrored in X about the middle of the sheet.
    let middle = |d: &sheet::Drawing| {
        d.contours
            .iter()
            .flatten()
            .map(|p| p[0])
            .fold(f64::INFINITY, f64::min)
            + 0.5 * width(d)
    };
    let (a, b) = (middle(&plain), middle(&mirrored));
    for s in &plain.slits {
        let image = s.map(|p| [b - (p[0] - a), p[1]]);
        let near = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]) < 1e-3;
        assert!(
            mirrored
                .slits
                .iter()
                .any(|t| near(t[0], image[0]) && near(t[1], image[1])),
            "{s:?}"
        );
    }
}

#[test]
fn the_design_file_makes_the_same_bytes_again() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let output = kagome(args, folder.path());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    };
    run(&["samples", "write", "bump", "-o", "bump.obj"]);
    run(&[
        "make",
        "bump.obj",
        "-q",
        "-o",
        "a",
        "--triangles",
        "300",
        "--orientation",
        "12.5",
        "--remove",
        "4",
    ]);
    run(&[
        "make",
        "bump.obj",
        "-q",
        "-o",
        "b",
        "--triangles",
        "300",
        "--orientation",
        "12.5",
        "--remove",
        "4",
    ]);
    run(&["make", "a/design.toml", "-q", "-o", "c"]);
    for name in ALL {
        let [a, b, c] = ["a", "b", "c"].map(|d| read(folder.path().join(d).join(name)));
        assert!(a == b, "{name} differs between two runs");
        assert!(a == c, "{name} differs when made from the design");
    }
    // Made again in place, when asked.
    let again = kagome(&["make", "a/design.toml", "-q"], folder.path());
    assert_eq!(
        again.status.code(),
        Some(2),
        "an earlier result is not replaced unasked"
    );
    run(&["make", "a/design.toml", "-q", "--force"]);
    // A mesh that has changed since is noticed.
    let mesh = read(folder.path().join("bump.obj")).replacen("v ", "v  ", 1);
    std::fs::write(folder.path().join("bump.obj"), mesh).unwrap();
    let changed = kagome(&["make", "a/design.toml", "-q", "-o", "d"], folder.path());
    assert_eq!(changed.status.code(), Some(2));
    assert!(stderr(&changed).contains("SHA-256"), "{}", stderr(&changed));
}

/// A dart opens the surface for the map only: what is written is the surface as it was. What a design decides about
/// darts and left-out triangles makes the same sheet again.
#[test]
fn a_design_with_a_dart_and_left_out_triangles_makes_the_same_bytes_again() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let output = kagome(args, folder.path());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    };
    let file = |out: &str, name: &str| read(folder.path().join(out).join(name));
    let same = |a: &str, b: &str| {
        for name in ALL {
            assert!(file(a, name) == file(b, name), "{name} of {a} and {b}");
        }
    };
    let vertices = |text: &str| text.lines().filter(|l| l.starts_with("v ")).count();
    run(&["samples", "write", "cap:faces=2000", "-o", "cap.obj"]);
    let cap = file("", "cap.obj");
    let height = |place: &&[f64; 3]| place[2];
    let places: Vec<[f64; 3]> = cap
        .lines()
        .filter_map(|l| l.strip_prefix("v "))
        .map(|l| {
            let numbers: Vec<f64> = l.split(' ').map(|n| n.parse().unwrap()).collect();
            [numbers[0], numbers[1], numbers[2]]
        })
        .collect();
    let by_height = |a: &&[f64; 3], b: &&[f64; 3]| height(a).total_cmp(&height(b));
    let [top, rim] = [
        places.iter().max_by(by_height).unwrap(),
        places.iter().min_by(by_height).unwrap(),
    ];
    let dart = [top, rim].map(|[x, y, z]| format!("{x},{y},{z}")).join(";");
    let sized = ["--triangles", "200", "--sigma", "2", "--dart", &dart];
    run(&[&["make", "cap.obj", "-q", "-o", "darted"], &sized[..]].concat());
    run(&["make", "darted/design.toml", "-q", "-o", "darted-again"]);
    same("darted", "darted-again");
    let design = file("darted", "design.toml");
    assert_eq!(design.matches("[[dart]]").count(), 1, "{design}");
    assert_eq!(vertices(&file("darted", "layout.obj")), vertices(&cap));
    let (_, whole) = judge(&folder.path().join("darted"), "with a dart");
    assert_eq!(
        whole.seam_hinges, 0,
        "the pattern does not go on across a dart"
    );

    // Two triangles fewer, by hand.
    let fewer = design.replacen("[linkage]", "[linkage]\nleft_out = [60, 101]", 1);
    std::fs::write(folder.path().join("darted/fewer.toml"), fewer).unwrap();
    run(&["make", "darted/fewer.toml", "-q", "-o", "fewer"]);
    run(&["make", "fewer/design.toml", "-q", "-o", "fewer-again"]);
    same("fewer", "fewer-again");
    let design = file("fewer", "design.toml");
    assert!(design.contains("left_out = [60, 101]"), "{design}");
    assert_eq!(design.matches("[[dart]]").count(), 1, "{design}");
    let (_, found) = judge(&folder.path().join("fewer"), "with triangles left out");
    assert_eq!(found.triangles, whole.triangles - 2);

    // A design decides: a dart beside it is refused.
    let beside = [
        "make",
        "darted/design.toml",
        "-q",
        "-o",
        "no",
        "--dart",
        &dart,
    ];
    let output = kagome(&beside, folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("--dart"), "{}", stderr(&output));
}

#[test]
fn a_bump_without_its_cone_gets_a_report_but_no_job() {
    let folder = tempfile::tempdir().unwrap();
    let output = kagome(
        &[
            "make",
            "sample:bump",
            "-q",
            "-o",
            "out",
            "--cone",
            "none",
            "--sigma",
            "2",
            "--triangles",
            "500",
        ],
        folder.path(),
    );
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let words = stderr(&output);
    assert!(
        words.contains("misses the surface")
            && words.contains("mm) at (")
            && words.contains("--cone")
            && words.contains("open to σ = 2")
            && words.contains("would miss by"),
        "{words}"
    );
    let out = folder.path().join("out");
    for name in [
        "design.toml",
        "layout.obj",
        "linkage.obj",
        "report.json",
        "report.html",
    ] {
        assert!(out.join(name).is_file(), "{name}");
    }
    for name in ["pattern.svg", "pattern.dxf", "job.nc"] {
        assert!(!out.join(name).exists(), "{name}");
    }
    // The edges are exact all the same, which the judge confirms.
    let found = linkage::judge(
        &read(out.join("linkage.obj")),
        &read(out.join("layout.obj")),
        2.0,
    );
    assert!(found.edge_error < 1e-12 && found.distance > 0.3);
    // The σ that it says would do, does; a little less does not.
    let shallow = |sigma: &str, out: &str| {
        kagome(
            &[
                "make",
                "sample:cap",
                "-q",
                "-o",
                out,
                "--cone",
                "none",
                "--edge",
                "9",
                "--sigma",
                sigma,
            ],
            folder.path(),
        )
    };
    let words = stderr(&shallow("1.2", "narrow"));
    let (_, after) = words
        .split_once("material of σ = ")
        .unwrap_or_else(|| panic!("{words}"));
    let least: f64 = after.split_whitespace().next().unwrap().parse().unwrap();
    assert!(
        least > 1.2 && least < 1.4,
        "a cap of 60° asks for 4/3: {words}"
    );
    // With --accept-distance the one threshold of taste is relaxed, the others are not.
    let output = kagome(
        &[
            "make",
            "out/design.toml",
            "-q",
            "-o",
            "accepted",
            "--accept-distance",
            "5",
        ],
        folder.path(),
    );
    assert!(!stderr(&output).contains("misses the surface"));
}

/// Flaps make the sheet larger, never the linkage: left out if asked for.
#[test]
fn flaps_are_of_the_sheet_only_and_can_be_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let output = kagome(args, folder.path());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    };
    let vase = [
        "make",
        "sample:vase",
        "-q",
        "--sigma",
        "2",
        "--triangles",
        "200",
    ];
    let with = |more: &[&str]| run(&[&vase[..], more].concat());
    let file = |folder_name: &str, name: &str| read(folder.path().join(folder_name).join(name));
    let report = |name: &str| -> serde_json::Value {
        serde_json::from_str(&file(name, "report.json")).unwrap()
    };
    let number = |name: &str, pointer: &str| {
        let value = report(name).pointer(pointer).unwrap().as_f64();
        value.unwrap_or_else(|| panic!("{pointer}"))
    };
    with(&["-o", "auto"]);
    with(&["-o", "none", "--flaps", "none"]);
    run(&["make", "none/design.toml", "-q", "-o", "again"]);
    let in_space = |name: &str| -> Vec<String> {
        let text = file(name, "linkage.obj");
        let kept = text.lines().filter(|l| !l.starts_with("vt"));
        kept.map(str::to_owned).collect()
    };
    assert_eq!(in_space("auto"), in_space("none"));
    let edges = number("auto", "/linkage/seam_edges");
    let row = number("auto", "/sheet/flap_triangles");
    assert_eq!(row, 2.0 * edges - 1.0, "the seam of a vase is straight");
    assert_eq!(number("auto", "/linkage/seam_edges_without_flaps"), 0.0);
    assert_eq!(number("none", "/sheet/flap_triangles"), 0.0);
    assert_eq!(number("none", "/linkage/seam_edges_without_flaps"), edges);
    assert!(file("none", "design.toml").contains("flaps = \"none\""));
    for name in ALL {
        assert!(file("none", name) == file("again", name), "{name}");
    }
    let words = |name: &str| report(name)["warnings"].to_string();
    assert!(words("auto").contains("glue each on its double"));
    assert!(words("none").contains("edge to edge"));

    let size = |name: &str| ["width_mm", "height_mm"].map(|k| number(name, &format!("/sheet/{k}")));
    let [width, height] = size("auto");
    // Stock that is far too small divides the sheet: more seams, more flaps.
    let half = format!("{0}x{0}", 0.7 * width.max(height));
    with(&["-o", "small", "--stock", &half]);
    assert!(number("small", "/sheet/flap_triangles") > row);
    assert!(words("small").contains("divided"), "{}", words("small"));
    assert_eq!(
        number("small", "/linkage/triangles"),
        number("auto", "/linkage/triangles")
    );
}

/// By points or by vertices, a cut stands in the design and leads the seam to the same place again.
#[test]
fn a_cut_is_kept_in_the_design() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let output = kagome(args, folder.path());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    };
    let make = |cut: &str, out: &str| {
        let vase = ["make", "sample:vase:faces=2000", "-q", "--sigma", "2"];
        let rest = ["--triangles", "400", "--cut", cut, "-o", out];
        run(&[&vase[..], &rest[..]].concat());
    };
    let file = |out: &str, name: &str| read(folder.path().join(out).join(name));
    make("0,-58,0;0,-62,200", "points");
    let design = file("points", "design.toml");
    let lines = "[[cut]]\npoints_mm = [[0.0, -58.0, 0.0], [0.0, -62.0, 200.0]]";
    assert!(design.contains(lines), "{design}");
    make("0,58,0;0,62,200", "behind");
    make("v3;v900;v20", "vertices");
    let design = file("vertices", "design.toml");
    assert!(
        design.contains("[[cut]]\nvertices = [3, 900, 20]"),
        "{design}"
    );
    for out in ["points", "vertices"] {
        let again = format!("{out}-again");
        run(&["make", &format!("{out}/design.toml"), "-q", "-o", &again]);
        for name in ALL {
            assert!(
                file(out, name) == file(&again, name),
                "{out}/{name} differs"
            );
        }
        assert!(file(out, "linkage.obj") != file("behind", "linkage.obj"));
    }
    // A cut is a decision of the design.
    let both = ["make", "points/design.toml", "--cut", "v1;v2", "-o", "both"];
    let output = kagome(&both, folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("--cut"), "{}", stderr(&output));
    let short = design.replace("[3, 900, 20]", "[3]");
    std::fs::write(folder.path().join("short.toml"), short).unwrap();
    let output = kagome(&["make", "short.toml", "-q", "-o", "both"], folder.path());
    assert_eq!(output.status.code(), Some(2));
    for word in ["cut[0]", "at least two"] {
        assert!(stderr(&output).contains(word), "{}", stderr(&output));
    }
}

/// Bad input: exit code 2, words that help, and nothing left behind.
#[test]
fn bad_input_costs_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("prose.obj", "It was a dark and stormy night.\n");
    write("empty.obj", "");
    write("nan.obj", "v 0 0 0\nv 100 0 0\nv 0 nan 0\nf 1 2 3\n");
    write(
        "parts.obj",
        "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 50\nv 100 0 50\nv 0 100 50\nf 1 2 3\nf 4 5 6\n",
    );
    write(
        "fan.obj",
        "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\nv 0 -100 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n",
    );
    write(
        "glue.toml",
        &read(Path::new(env!("CARGO_MANIFEST_DIR")).join("profiles/leather-1.6.toml"))
            .replace("thickness_mm", "thicknes_mm"),
    );
    write("file", "");
    let cases: &[(&[&str], &[&str])] = &[
        (&["nosuch.obj"], &["nosuch.obj"]),
        (&["prose.obj"], &["prose.obj"]),
        (&["empty.obj"], &["empty.obj"]),
        (&["nan.obj"], &["nan.obj:3"]),
        (&["parts.obj"], &["--part largest", "2 parts"]),
        (&["fan.obj"], &["manifold"]),
        (
            &["sample:octasphere", "--cone", "none"],
            &["closed", "exactly 6"],
        ),
        (&["sample:vase", "--turning", "100"], &["multiple of 120"]),
        (
            &["sample:vase", "--turning", "0", "--turning", "0"],
            &["2 rim turnings", "needs 1"],
        ),
        (&["sample:vase", "--hem", "0"], &["--hem 0", "from 1"]),
        (&["sample:vase", "--hem", "3"], &["no rim 3", "has 2"]),
        (&["sample:cap", "--hem", "1"], &["rim 1", "360°", "tube"]),
        (&["sample:teapot"], &["teapot", "hemisphere"]),
        (&["sample:cap", "--edge", "900"], &["--edge", "900"]),
        (&["sample:cap", "--edge", "0"], &["--edge"]),
        (&["sample:cap", "--edge", "0.01"], &["--edge"]),
        (&["sample:cap", "--sigma", "1"], &["σ = 1 "]),
        (&["sample:cap", "--sigma", "2.1"], &["σ = 2.1", "at most 2"]),
        (&["sample:cap", "--sigma", "NaN"], &["σ"]),
        (
            &["sample:cap", "--material", "cheese"],
            &["cheese", "leather-1.6"],
        ),
        (
            &["sample:cap", "--material", "./glue.toml"],
            &["glue.toml", "thicknes_mm", "unknown"],
        ),
        (
            &["sample:cap", "--machine", "press"],
            &["press", "co2-600x400"],
        ),
        (
            &["sample:cap", "--size", "2000"],
            &["pieces of stock", "--stock"],
        ),
        (
            &["sample:cap", "--size", "2000", "--undivided"],
            &["there is room for"],
        ),
        (&["sample:cap", "--hinge", "20"], &["hinge"]),
        (&["sample:cap", "--hinge", "1e-300"], &["--hinge", "0.01"]),
        (&["sample:cap", "--kerf", "-1"], &["--kerf"]),
        (
            &["sample:cap", "--accept-distance", "nan"],
            &["--accept-distance"],
        ),
        (
            &["sample:cap", "--accept-distance", "inf"],
            &["--accept-distance"],
        ),
        (&["sample:bump", "--cone", "v99999999"], &["v99999999"]),
        (&["sample:bump", "--cone", "5000,0,0"], &["mm away"]),
        (&["sample:bump", "--cut", "v1"], &["--cut", "v12;v905"]),
        (&["sample:bump", "--cut", "auto"], &["--cut", "two or more"]),
        (
            &["sample:bump", "--cut", "v1;v99999999"],
            &["--cut v99999999"],
        ),
        (
            &["sample:vase", "--cut", "62,0,200;5000,0,0"],
            &["--cut 5000,0,0", "mm away"],
        ),
        (
            &["sample:vase", "--cut", "62,0,200;62,0,200.1"],
            &["--cut", "farther apart"],
        ),
        (
            &["sample:bump", "--cone", "none", "--cone", "v1"],
            &["--cone"],
        ),
        (
            &["sample:bump", "--cone", "v1", "--cone", "v1"],
            &["two cones", "vertex 1"],
        ),
        (&["sample:bump", "--cone", "v1:3"], &["3 units"]),
        (
            &["sample:cap", "--dart", "1,2,3"],
            &["1,2,3", "two or more"],
        ),
        (
            &["sample:cap", "--dart", "v1;v9:1"],
            &["v9:1", "two or more"],
        ),
        (
            &["sample:cap", "--dart", "v1;v1"],
            &["two different points"],
        ),
        (&["sample:cap", "--dart", "v1;v99999999"], &["v99999999"]),
        (
            &["sample:cap", "--dart", "0,0,115;5000,0,0"],
            &["--dart 5000,0,0", "mm away"],
        ),
        (
            &["sample:cap", "--dart", "100,0,57;0,0,115;-100,0,57"],
            &["2 parts", "dart"],
        ),
        (
            &["sample:cap", "--dart", "none", "--dart", "v1;v2"],
            &["--dart none", "alone"],
        ),
        (&["sample:cap", "-o", "no/such/place"], &["no/such/place"]),
        (&["sample:cap", "-o", "file"], &["file"]),
        (&["sample:cap", "-o", "file/out"], &["file/out"]),
    ];
    let before = std::fs::read_dir(folder.path()).unwrap().count();
    for (args, words) in cases {
        let mut all = vec!["make", "-q"];
        all.extend(*args);
        let output = kagome(&all, folder.path());
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {text}");
        for word in *words {
            assert!(text.contains(word), "{args:?} should say {word:?}: {text}");
        }
        assert!(!text.contains("panicked"), "{args:?}: {text}");
        assert_eq!(
            std::fs::read_dir(folder.path()).unwrap().count(),
            before,
            "{args:?} left something behind"
        );
    }
}

#[test]
fn a_port_that_does_not_exist_is_answered_with_those_that_do() {
    let folder = tempfile::tempdir().unwrap();
    let job = "G21\nG90\nM4 S0\nG0 X10 Y10\nG1 X20 F600 S300\nM5\nM2\n";
    std::fs::write(folder.path().join("job.nc"), job).unwrap();
    let output = kagome(&["send", "job.nc", "--port", "/dev/ttyNOPE"], folder.path());
    assert_eq!(output.status.code(), Some(2));
    let text = stderr(&output);
    assert!(
        text.contains("/dev/ttyNOPE") && text.contains("sim"),
        "{text}"
    );
    assert!(
        !cfg!(target_os = "linux") || text.contains("dialout"),
        "{text}"
    );
}
