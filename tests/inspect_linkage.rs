//! `kagome inspect linkage.obj` as a person runs it.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn kagome(args: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kagome"))
        .env("KAGOME_PROFILES", "")
        .args(args)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Standard output of a run that must succeed.
fn told(args: &[&str], folder: &Path) -> String {
    let output = kagome(args, folder);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{args:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// What a run that must be refused says.
fn refused(args: &[&str], folder: &Path) -> String {
    let output = kagome(args, folder);
    assert_eq!(output.status.code(), Some(2), "{args:?}");
    String::from_utf8(output.stderr).unwrap()
}

fn json(args: &[&str], folder: &Path) -> Value {
    serde_json::from_str(&told(args, folder)).unwrap()
}

/// The figures of a linkage are those that `make` reported of it; the layout beside it, with texture coordinates too,
/// is a surface.
#[test]
fn what_make_wrote_is_inspected_as_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let make = [
        "make",
        "sample:bump:faces=2000",
        "--triangles",
        "300",
        "--sigma",
        "2",
        "-q",
        "-o",
        "out",
    ];
    assert_eq!(kagome(&make, at).status.code(), Some(0));
    let found = json(&["inspect", "out/linkage.obj", "--json"], at);
    let figures = &found["figures"];
    let report: Value =
        serde_json::from_slice(&std::fs::read(at.join("out/report.json")).unwrap()).unwrap();
    let quality = &report["quality"];
    assert!(quality.is_object(), "{report}");
    for key in ["triangles", "hinges"] {
        assert_eq!(figures[key], quality[key], "{key}");
    }
    let number = |v: &Value| v.as_f64().unwrap();
    for k in 0..3 {
        let gap = number(&figures["soundness"]["opening"][k]) - number(&quality["opening"][k]);
        assert!(gap.abs() < 1e-9);
    }
    for key in ["penetrations", "intersections", "over_sigma"] {
        assert_eq!(figures["soundness"][key], quality[key], "{key}");
    }
    // Four triangles removed at the cone: no lattice vertex with other than six is left whole.
    assert_eq!(figures["rounds"].as_object().unwrap().len(), 1);
    let freedom = &figures["freedom"];
    let b2 = number(&freedom["sheet_b2"]);
    assert_eq!(number(&freedom["sheet"]["motions"]), b2 - 3.0);
    assert_eq!(
        b2,
        number(&figures["free_corners"]) + 2.0 * number(&figures["seam_hinges"])
    );
    let text = told(&["inspect", "out/linkage.obj"], at);
    assert!(
        text.contains(&format!("B₂ − 3 = {} counted", b2 - 3.0)),
        "{text}"
    );
    // Hinges that open farther than asked for are counted.
    let widest = number(&figures["soundness"]["opening"][2]);
    let narrow = format!("{}", 0.5 * (1.0 + widest));
    let found = json(
        &["inspect", "out/linkage.obj", "--json", "--sigma", &narrow],
        at,
    );
    assert!(number(&found["figures"]["soundness"]["over_sigma"]) > 0.0);
    let layout = json(&["inspect", "out/layout.obj", "--json"], at);
    assert_eq!(layout["import"]["format"], "OBJ");
    for (option, value) in [("--unit", "in"), ("--size", "200"), ("--triangles", "10")] {
        let said = refused(&["inspect", "out/linkage.obj", option, value], at);
        assert!(
            said.contains("is a linkage") && said.contains(option),
            "{said}"
        );
    }
    assert!(refused(&["inspect", "out/linkage.obj", "--sigma", "9"], at).contains("--sigma 9"));
    // Motions, in words and as objects that a viewer shows.
    let args = [
        "inspect",
        "out/linkage.obj",
        "--motions",
        "3",
        "-o",
        "motions.obj",
    ];
    assert!(told(&args, at).contains("The softest motions"));
    let moved = std::fs::read_to_string(at.join("motions.obj")).unwrap();
    assert_eq!(moved.matches("\no ").count(), 4);
    let points = number(&figures["points"]) as usize;
    assert_eq!(moved.matches("\nv ").count(), 4 * points);
    let found = json(
        &["inspect", "out/linkage.obj", "--motions", "3", "--json"],
        at,
    );
    let motions = found["motions"].as_array().unwrap();
    let turn = |m: &Value| number(&m["turn_rms_deg_per_mm"]);
    assert_eq!(motions.len(), 3);
    assert!(
        motions
            .iter()
            .all(|m| turn(m) > 0.0 && turn(m) < number(&m["turn_max_deg_per_mm"]))
    );
    for (args, says) in [
        (&["out/linkage.obj", "--motions", "0"][..], "--motions 0"),
        (&["out/linkage.obj", "-o", "x.obj"], "--motions N"),
        (
            &["out/linkage.obj", "--motions", "1", "-o", "x.toml"],
            ".obj",
        ),
        (&["out/layout.obj", "--motions", "1"], "is a surface"),
        (&["out/layout.obj", "-o", "x.obj"], "--propose"),
    ] {
        let said = refused(&[&["inspect"], args].concat(), at);
        assert!(said.contains(says), "{args:?}: {said}");
    }
    // A broken one is told from a surface, and where it is broken.
    let whole = std::fs::read_to_string(at.join("out/linkage.obj")).unwrap();
    let line = whole.lines().position(|l| l.starts_with("f ")).unwrap() + 1;
    let broken = whole.replacen("\nf 1/", "\nf 5/", 1);
    std::fs::write(at.join("broken.obj"), broken).unwrap();
    let said = refused(&["inspect", "broken.obj"], at);
    assert!(
        said.contains("broken.obj:") && said.contains("vertex 5"),
        "{line}: {said}"
    );
}

/// A cone whose triangles stay has four triangles around it.
#[test]
fn a_cone_is_told_by_its_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let make = [
        "make",
        "sample:bump:faces=2000",
        "--triangles",
        "300",
        "--sigma",
        "2",
        "--remove",
        "0",
        "-q",
        "-o",
        "out",
    ];
    // Whether it may be cut or not, the linkage is written.
    kagome(&make, at);
    let found = json(&["inspect", "out/linkage.obj", "--json"], at);
    assert_eq!(found["figures"]["rounds"]["4"], 1, "{found}");
    assert!(told(&["inspect", "out/linkage.obj"], at).contains("1 of 4 triangles (+120°)"));
}

/// One hinge between two triangles: in space it turns about three axes, and on a form, flat as it lies, about one.
#[test]
fn a_single_hinge_has_the_motions_of_a_ball_joint() {
    let folder = tempfile::tempdir().unwrap();
    let pair = "v 0 0 0\nv 1 0 0\nv 0.5 0.866025403784 0\nv 1.5 0.866025403784 0\nv 0.5 0.866025403784 0\n\
        vt 0 0\nvt 1 0\nvt 0.5 0.866025403784\nvt 1.5 0.866025403784\nf 1/1 2/2 3/3\nf 2/2 4/4 5/3\n";
    std::fs::write(folder.path().join("pair.obj"), pair).unwrap();
    let found = json(&["inspect", "pair.obj", "--json"], folder.path());
    let freedom = &found["figures"]["freedom"];
    assert_eq!(freedom["space"]["motions"], 3);
    assert_eq!(freedom["sheet"]["motions"], 1);
    // Sliding and turning as a whole in the plane, and the hinge.
    assert_eq!(freedom["surface"]["motions"], 4);
    let q = &found["figures"]["soundness"];
    assert!((q["opening"][0].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(q["penetrations"], 0);
}
