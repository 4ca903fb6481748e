//! `kagome flatten` and `kagome inspect --propose` as a person runs them.

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

/// The maps that a run tells of, the best first.
fn maps(args: &[&str]) -> Vec<Value> {
    let mut all = args.to_vec();
    all.push("--json");
    let value: Value = serde_json::from_str(&told(&all, Path::new("."))).unwrap();
    value["maps"].as_array().unwrap().clone()
}

fn number(map: &Value, key: &str) -> f64 {
    map[key].as_f64().unwrap_or_else(|| panic!("{key}: {map}"))
}

fn arguments(map: &Value) -> Vec<&str> {
    let words = map["arguments"].as_array().unwrap();
    words.iter().map(|w| w.as_str().unwrap()).collect()
}

/// The stereographic map of a cap of half angle α has λ from cos²(α/2) to 1, up to a factor.
#[test]
fn caps_need_the_stretch_of_their_closed_form() {
    for (degrees, sigma) in [(60.0f64, "1.4"), (90.0, "2"), (120.0, "2")] {
        let sample = format!("sample:cap:half_angle_deg={degrees},faces=3000");
        let found = maps(&["flatten", &sample, "--sigma", sigma]);
        assert_eq!(found.len(), 1);
        let exact = (degrees.to_radians() / 2.0).cos().powi(-2);
        let ratio = number(&found[0], "lambda_ratio");
        assert!((ratio / exact - 1.0).abs() < 0.01, "{degrees}°: {ratio}");
        let (min, max) = (
            number(&found[0], "lambda_min"),
            number(&found[0], "lambda_max"),
        );
        assert!((ratio - max / min).abs() < 1e-12);
        let suffices = found[0]["suffices"].as_bool().unwrap();
        assert_eq!(suffices, max <= sigma.parse::<f64>().unwrap() * min);
        if degrees != 90.0 {
            // Away from the limit the mesh does not matter, and nothing lies outside where σ suffices.
            assert_eq!(suffices, exact < sigma.parse::<f64>().unwrap());
            assert_eq!(suffices, number(&found[0], "area_inside_sigma") > 0.9999);
            assert_eq!(suffices, number(&found[0], "misfit_in_l") == 0.0);
        }
        // λ is largest at the pole, and the map is the same scale for lengths and areas.
        let pole = &found[0]["lambda_max_at_mm"];
        assert!(pole[0].as_f64().unwrap().abs() < 5.0 && pole[1].as_f64().unwrap().abs() < 5.0);
        let edge = number(&found[0], "edge_mm");
        let triangles = number(&found[0], "layout_area_mm2") / (0.75f64.sqrt() / 2.0 * edge * edge);
        assert!((triangles - 1500.0).abs() < 1.0, "{triangles}");
    }
}

#[test]
fn the_answer_is_given_in_words() {
    let here = Path::new(".");
    let text = told(
        &["flatten", "sample:hemisphere:faces=2000", "--sigma", "1.6"],
        here,
    );
    assert!(text.contains("σ = 1.6 does not suffice"), "{text}");
    assert!(text.contains("try") && text.contains("--propose"), "{text}");
    let text = told(&["flatten", "sample:cap:faces=2000"], here);
    assert!(text.contains("σ = 1.8 suffices"), "{text}");
    assert!(text.contains("rims turn       360°"), "{text}");
}

/// What is proposed can be asked for: the same arguments give the same map, to the last bit.
#[test]
fn proposals_are_asked_for_by_their_arguments() {
    for (sample, cones) in [
        ("sample:bump:faces=2000", Some(1)),
        ("sample:vase:faces=2000", None),
    ] {
        let found = maps(&["inspect", sample, "--propose", "--sigma", "1.6"]);
        let plain = found
            .iter()
            .find(|m| m["cones"].as_array().unwrap().is_empty());
        assert!(plain.is_some(), "{sample}");
        if let Some(cones) = cones {
            assert_eq!(found[0]["cones"].as_array().unwrap().len(), cones);
            assert_eq!(found[0]["suffices"], true);
            assert_eq!(plain.unwrap()["suffices"], false);
        }
        for map in &found {
            let mut line = vec!["flatten", sample, "--sigma", "1.6"];
            line.extend(arguments(map));
            let again = maps(&line);
            assert_eq!(again.len(), 1);
            assert_eq!(&again[0], map, "{line:?}");
        }
        let text = told(
            &["inspect", sample, "--propose", "--sigma", "1.6"],
            Path::new("."),
        );
        assert!(text.contains(&arguments(&found[0]).join(" ")), "{text}");
    }
}

/// Places asked for come back as they were asked for, hems, darts and strengths too.
#[test]
fn arguments_name_places_as_they_were_given() {
    let line = [
        "--cone",
        "90,0,80:-1",
        "--cone",
        "-90,0,80",
        "--dart",
        "0,70,0;0,80,40",
        "--turning",
        "0",
        "--hem",
        "2",
        "--remove",
        "4",
    ];
    let mut all = vec!["flatten", "sample:vase:faces=2000"];
    all.extend(line);
    let found = maps(&all);
    assert_eq!(arguments(&found[0]), line);
    assert_eq!(found[0]["rim_turnings_deg"][1], 0);
    assert_eq!(found[0]["cones"][0]["vertex"], Value::Null);
    assert_eq!(found[0]["cones"][0]["units"], -1);
}

#[test]
fn maps_are_written_as_page_layout_and_design() {
    let folder = tempfile::tempdir().unwrap();
    let bump = "sample:bump:faces=2000";
    for file in ["map.html", "map.obj", "design.toml"] {
        told(
            &[
                "flatten",
                bump,
                "--propose",
                "--sigma",
                "2",
                "--triangles",
                "300",
                "-o",
                file,
            ],
            folder.path(),
        );
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let page = read("map.html");
    assert_eq!(page.matches("<figure>").count(), 4);
    assert!(page.contains("The stretch suffices") && page.ends_with("</html>\n"));
    let layout = read("map.obj");
    assert!(layout.lines().filter(|l| l.starts_with("vt ")).count() > 900);
    // The design has every decision, so that `make` takes it as it is.
    let design = kagome::job::Design::parse("design.toml", &read("design.toml")).unwrap();
    assert_eq!(design.cone.len(), 1);
    let output = kagome(&["make", "design.toml", "-q", "-o", "made"], folder.path());
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let made = read("made/design.toml");
    let made = kagome::job::Design::parse("made/design.toml", &made).unwrap();
    assert_eq!(made, design);
}

#[test]
fn closed_surfaces_get_the_cones_that_they_must_have() {
    let found = maps(&["flatten", "sample:octasphere:faces=1000"]);
    let units = |m: &Value| -> i64 {
        let cones = m["cones"].as_array().unwrap().iter();
        cones.map(|c| c["units"].as_i64().unwrap()).sum()
    };
    assert!(!found.is_empty());
    for map in &found {
        assert_eq!(units(map), 6);
        assert_eq!(map["rim_turnings_deg"], serde_json::json!([]));
    }
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (line, says) in [
        ("flatten sample:cone", "octasphere"),
        ("flatten no-such-file.obj", "no-such-file.obj"),
        ("flatten sample:cap --sigma 3", "σ = 3 is not possible"),
        ("flatten sample:cap --edge -1", "--edge"),
        (
            "flatten sample:cap --edge 5 --triangles 9",
            "cannot be used with",
        ),
        ("flatten sample:cap --cone v999999", "v999999"),
        ("flatten sample:cap --cone none --cone v4", "stand alone"),
        ("flatten sample:cap --cone v4 --propose", "leave out --cone"),
        ("flatten sample:vase --turning 100", "multiple of 120"),
        ("flatten sample:vase --hem 0", "counted from 1"),
        ("flatten sample:vase --hem 3", "no rim 3"),
        ("flatten sample:cap -o map.png", ".html"),
        ("inspect sample:cap --sigma 2", "--propose"),
        ("inspect sample:cap -o design.toml", "--propose"),
        ("inspect sample:cap --propose --sigma 0.5", "σ = 0.5"),
    ] {
        let words: Vec<&str> = line.split(' ').collect();
        let output = kagome(&words, folder.path());
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{line}: {errors}");
        assert!(errors.contains(says), "{line}: {errors}");
        assert!(output.stdout.is_empty(), "{line}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
