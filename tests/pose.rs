//! `kagome pose`: handles move a linkage, and what comes back is exact.

#![allow(clippy::unwrap_used, reason = "a helper that fails, fails its test")]

use std::path::Path;
use std::process::{Command, Output};

use kagome::base::progress::Silent;
use kagome::conformal::{ConeRequest, FlattenOptions, Sizing, flatten};
use kagome::linkage::{Handedness, LinkageOptions, build, read_obj, write_obj};
use kagome::mesh::{ClosestPoint, Sample};
use kagome::rationalize::{Solver, Soundness, rationalize};
use tempfile::TempDir;

/// A cap's linkage, opened well below its σ, as a file.
fn dome(folder: &Path) {
    let surface = Sample::parse("cap").unwrap().generate().unwrap();
    let sigma = 1.9;
    let options = FlattenOptions {
        sigma,
        sizing: Sizing::Triangles(300.0),
        cone_clearance: 0.7,
    };
    let flat = flatten(&surface, &ConeRequest::Auto, &options, &Silent).unwrap();
    let options = LinkageOptions {
        edge_mm: flat.edge_mm,
        orientation: 0.0,
        handedness: Handedness::Right,
        remove_at_cone: 0,
        sigma,
    };
    let built = build(&surface, &flat.layout, &options, &Silent).unwrap();
    let closest = ClosestPoint::new(&surface);
    let (positions, _) = rationalize(
        &built.linkage,
        &built.start,
        &closest,
        sigma,
        Solver::Exact,
        &Silent,
    )
    .unwrap();
    std::fs::write(
        folder.join("linkage.obj"),
        write_obj(&built.linkage, &positions),
    )
    .unwrap();
}

fn pose(folder: &Path, handles: &str) -> Output {
    std::fs::write(folder.join("handles.toml"), handles).unwrap();
    Command::new(env!("CARGO_BIN_EXE_kagome"))
        .env("KAGOME_PROFILES", "")
        .args(["pose", "linkage.obj", "--handles", "handles.toml", "-q"])
        .current_dir(folder)
        .output()
        .unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn the_crown_of_a_dome_goes_up_while_its_rim_stays() {
    let folder = TempDir::new().unwrap();
    dome(folder.path());
    let before = std::fs::read(folder.path().join("linkage.obj")).unwrap();
    let (linkage, start) = read_obj(&before, "before").unwrap();
    let (top, _) = start
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.z.total_cmp(&b.1.z))
        .unwrap();
    let handles = format!(
        "format = 1\nsigma = 1.9\n[[pin]]\ngroup = \"rim\"\n[[keyframe]]\n[[keyframe.handle]]\npoint = {}\nby_mm = [0, 0, 2]\n",
        top + 1
    );
    let output = pose(folder.path(), &handles);
    assert!(output.status.success(), "{}", said(&output));
    let after = std::fs::read(folder.path().join("posed.obj")).unwrap();
    let (same, posed) = read_obj(&after, "after").unwrap();
    assert_eq!(same.triangles.len(), linkage.triangles.len());
    let sound = Soundness::measure(&same, &posed, 1.9);
    assert!(sound.edge_error_max < 1e-10, "{:e}", sound.edge_error_max);
    assert_eq!(
        (sound.penetrations, sound.intersections, sound.over_sigma),
        (0, 0, 0)
    );
    let goal = start[top] + nalgebra::Vector3::new(0.0, 0.0, 2.0);
    assert!((posed[top] - goal).norm() < 1e-9);
    let mut uses = vec![0; start.len()];
    linkage
        .triangles
        .iter()
        .for_each(|t| t.points.iter().for_each(|p| uses[p.0 as usize] += 1));
    for (i, _) in uses.iter().enumerate().filter(|(_, n)| **n == 1) {
        assert!((posed[i] - start[i]).norm() < 1e-9, "rim point {}", i + 1);
    }
    // The same handles give the same bytes.
    assert!(pose(folder.path(), &handles).status.success());
    assert_eq!(
        std::fs::read(folder.path().join("posed.obj")).unwrap(),
        after
    );
}

#[test]
fn what_no_rigid_triangles_can_do_is_refused_in_words() {
    let folder = TempDir::new().unwrap();
    dome(folder.path());
    let posed = folder.path().join("posed.obj");
    for (handles, words) in [
        (
            "format = 1\n[[keyframe]]\n[[keyframe.handle]]\npoint = 99999\nby_mm = [0, 0, 1]\n",
            "99999",
        ),
        (
            "format = 1\n[[keyframe]]\n[[keyframe.handle]]\npoint = 1\nby_mm = [0, 0, nan]\n",
            "by_mm",
        ),
        ("format = 1\nsigma = 0.5\n[[keyframe]]\n", "sigma"),
        (
            "format = 1\n[[keyframe]]\n[[keyframe.handle]]\npoint = 1\nto_mm = [0, 0, 0]\n[[keyframe.handle]]\npoint = 1\nto_mm = [0, 0, 5]\n",
            "1",
        ),
        ("format = 1\ncolour = 3\n", "colour"),
        (
            "format = 1\nsigma = 1.1\n[[keyframe]]\n[[keyframe.handle]]\npoint = 1\nby_mm = [0, 0, 1]\n",
            "open to 1.",
        ),
    ] {
        let output = pose(folder.path(), handles);
        assert_eq!(output.status.code(), Some(2), "{handles}{}", said(&output));
        assert!(said(&output).contains(words), "{}", said(&output));
        assert!(!posed.exists(), "{handles}");
    }
    std::fs::write(folder.path().join("linkage.obj"), "v 0 0 0\n").unwrap();
    let output = pose(folder.path(), "format = 1\n[[keyframe]]\n");
    assert_eq!(output.status.code(), Some(2));
    assert!(!posed.exists());
}
