//! One linkage opened and closed: states in the library, and `kagome states` as a person runs it.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

use std::path::Path;
use std::process::{Command, Output};

use kagome::base::ids::Id as _;
use kagome::base::progress::Silent;
use kagome::conformal::{ConeRequest, FlattenOptions, Sizing, flatten};
use kagome::linkage::{
    Handedness, Linkage, LinkageOptions, TriangleId, build, read_obj, write_obj,
};
use kagome::mesh::{ClosestPoint, Sample};
use kagome::rationalize::{
    Solver, Soundness, StatePath, StatesError, check_same, hinge_scales, opening_path,
    path_between, rationalize,
};
use nalgebra::{Point3, Vector3};
use serde_json::Value;

type Placed = (Linkage, Vec<Point3<f64>>);

/// A hexagon of the lattice, closed.
fn patch(radius: i32, handedness: Handedness) -> Placed {
    let linkage = Linkage::patch(3.0, handedness, &Linkage::hexagon_cells(radius));
    let mut at = vec![Point3::origin(); linkage.point_count()];
    for t in linkage.triangles.iter() {
        for (p, flat) in t.points.iter().zip(&t.flat) {
            at[p.index()] = Point3::new(flat.x, flat.y, 0.0);
        }
    }
    (linkage, at)
}

/// A sample surface as an exact linkage.
fn linkage_of(name: &str, triangles: f64) -> Placed {
    let surface = Sample::parse(name).unwrap().generate().unwrap();
    let options = FlattenOptions {
        sigma: 2.0,
        sizing: Sizing::Triangles(triangles),
        cone_clearance: 1.1,
    };
    let flat = flatten(&surface, &ConeRequest::Auto, &options, &Silent).unwrap();
    let options = LinkageOptions {
        edge_mm: flat.edge_mm,
        orientation: 0.0,
        handedness: Handedness::Right,
        remove_at_cone: 4,
        sigma: 2.0,
    };
    let built = build(&surface, &flat.layout, &options, &Silent).unwrap();
    let closest = ClosestPoint::new(&surface);
    let start = &built.start;
    let (at, _) =
        rationalize(&built.linkage, start, &closest, 2.0, Solver::Exact, &Silent).unwrap();
    (built.linkage, at)
}

fn mean(linkage: &Linkage, at: &[Point3<f64>]) -> f64 {
    Soundness::measure(linkage, at, 2.0).opening[1]
}

/// Every state is exact and free of overlaps, has the mean that it was to have, and the means go one way.
fn assert_good(path: &StatePath, steps: usize, what: &str) {
    assert_eq!(path.states.len(), steps + 1, "{what}");
    for (n, state) in path.states.iter().enumerate() {
        let q = &state.soundness;
        assert!(state.sound(), "{what}, {n}: {q:?}");
        assert!(
            q.edge_error_max < 1e-12,
            "{what}, {n}: {}",
            q.edge_error_max
        );
        if let Some(asked) = state.asked
            && (n < steps || path.reached[1])
        {
            assert!(
                (state.mean() - asked).abs() <= 1.1e-4,
                "{what}, {n}: {asked} {}",
                state.mean()
            );
        }
    }
    let sign = (path.states[steps].mean() - path.states[0].mean()).signum();
    let mut pairs = path.states.windows(2);
    assert!(
        pairs.all(|p| sign * (p[1].mean() - p[0].mean()) > 0.0),
        "{what}"
    );
}

/// In the plane all hinges of a patch open alike, and the centroids move apart by the scale factor: the linkage's one
/// uniform motion.
#[test]
fn a_patch_opens_uniformly_in_its_plane() {
    for (radius, handedness) in [(2, Handedness::Right), (4, Handedness::Left)] {
        let (linkage, flat) = patch(radius, handedness);
        let path = opening_path(&linkage, &flat, [1.0, 1.7], 7, 2.0, &Silent).unwrap();
        assert_eq!(path.reached, [true, true]);
        assert_good(&path, 7, "patch");
        let centroid = |at: &[Point3<f64>], t: usize| -> Vector3<f64> {
            let t = &linkage.triangles[TriangleId::from_index(t)];
            t.points
                .iter()
                .map(|p| at[p.index()].coords)
                .sum::<Vector3<f64>>()
                / 3.0
        };
        for (n, state) in path.states.iter().enumerate() {
            let scale = 1.0 + 0.1 * n as f64;
            for s in hinge_scales(&linkage, &state.positions) {
                assert!((s - scale).abs() < 1.1e-4, "{n}: {s}");
            }
            assert!((state.open_share - (1.0 - 1.0 / (scale * scale))).abs() < 3e-4);
            for t in 1..linkage.triangles.len() {
                let apart = |at: &[Point3<f64>]| (centroid(at, t) - centroid(at, 0)).norm();
                assert!((apart(&state.positions) / apart(&flat) - scale).abs() < 1e-3);
            }
        }
        // And back, to where it was.
        let opened = &path.states[7].positions;
        let back = opening_path(&linkage, opened, [1.4, 1.0], 3, 2.0, &Silent).unwrap();
        assert_eq!(back.reached, [true, true]);
        assert_good(&back, 3, "patch, closing");
    }
}

/// A dome without cones closes to its flat sheet, and a flat sheet goes back to a dome.
#[test]
fn domes_close_to_their_sheet_and_open() {
    for name in ["cap", "saddle"] {
        let (linkage, dome) = linkage_of(name, 200.0);
        let current = mean(&linkage, &dome);
        let path = opening_path(&linkage, &dome, [current, 1.0], 4, 2.0, &Silent).unwrap();
        assert_eq!(path.reached, [true, true], "{name}");
        assert_good(&path, 4, name);
        assert_eq!(path.states[0].positions, dome);
        let closed = &path.states[4];
        assert!(closed.open_share < 1e-9);
        let sheet: Vec<Point3<f64>> = {
            let mut at = vec![Point3::origin(); linkage.point_count()];
            for t in linkage.triangles.iter() {
                for (p, flat) in t.points.iter().zip(&t.flat) {
                    at[p.index()] = Point3::new(flat.x, flat.y, 0.0);
                }
            }
            at
        };
        for k in 1..sheet.len() {
            let apart = |at: &[Point3<f64>]| (at[k] - at[0]).norm();
            assert!(
                (apart(&closed.positions) - apart(&sheet)).abs() < 1e-9 * linkage.edge_mm * 100.0
            );
        }
        let wider = opening_path(&linkage, &dome, [current, 1.5], 2, 1.8, &Silent).unwrap();
        assert_eq!(wider.reached, [true, true], "{name}");
        assert_good(&wider, 2, name);
        assert!(wider.states[2].soundness.opening[2] <= 1.8 + 1e-4);
        // Between the two ends of both paths.
        let ends = [closed.positions.as_slice(), &wider.states[2].positions];
        let between = path_between(&linkage, ends, 5, 2.0, &Silent).unwrap();
        assert_good(&between, 5, name);
        assert_eq!(between.states[0].positions, closed.positions);
        for k in 1..sheet.len() {
            let apart = |at: &[Point3<f64>]| (at[k] - at[0]).norm();
            assert!(
                (apart(&between.states[5].positions) - apart(ends[1])).abs()
                    < 1e-9 * linkage.edge_mm * 100.0
            );
        }
    }
}

/// Around a cone four triangles cannot be closed in the plane: the path says how far it goes.
#[test]
fn a_cone_does_not_close_and_the_path_says_so() {
    let (linkage, bump) = linkage_of("bump", 200.0);
    let current = mean(&linkage, &bump);
    let path = opening_path(&linkage, &bump, [current, 1.0], 3, 2.0, &Silent).unwrap();
    assert_eq!(path.reached, [true, false]);
    assert_good(&path, 3, "bump");
    assert!(path.states[3].mean() < 1.0 + 0.5 * (current - 1.0));
    let gaps: Vec<f64> = path
        .states
        .windows(2)
        .map(|p| p[0].mean() - p[1].mean())
        .collect();
    assert!(
        gaps.iter().all(|g| (g / gaps[0] - 1.0).abs() < 0.05),
        "even steps: {gaps:?}"
    );
}

#[test]
fn what_cannot_be_asked_for_is_refused() {
    let (linkage, flat) = patch(1, Handedness::Right);
    let path = |ends, steps, sigma| opening_path(&linkage, &flat, ends, steps, sigma, &Silent);
    for bad in [0.9, 2.1, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            path([1.0, bad], 3, 2.0),
            Err(StatesError::Opening { .. })
        ));
    }
    assert!(matches!(
        path([1.0, 1.5], 3, 1.4),
        Err(StatesError::Opening { .. })
    ));
    assert!(matches!(
        path([1.0, 1.5], 0, 2.0),
        Err(StatesError::Steps { .. })
    ));
    assert!(matches!(
        path([1.0, 1.5], 1000, 2.0),
        Err(StatesError::Steps { .. })
    ));
    for sigma in [0.5, 2.5, f64::NAN] {
        assert!(matches!(
            path([1.0, 1.0], 1, sigma),
            Err(StatesError::Sigma { .. })
        ));
    }
    let open = path([1.0, 1.5], 1, 2.0).unwrap();
    let narrow = opening_path(
        &linkage,
        &open.states[1].positions,
        [1.0, 1.2],
        1,
        1.3,
        &Silent,
    );
    assert!(matches!(narrow, Err(StatesError::TooWide { .. })));
    let (left, _) = patch(1, Handedness::Left);
    let (larger, _) = patch(2, Handedness::Right);
    assert!(check_same(&linkage, &linkage).is_ok());
    for other in [left, larger] {
        assert!(matches!(
            check_same(&linkage, &other),
            Err(StatesError::Different(_))
        ));
    }
}

fn kagome(args: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kagome"))
        .env("KAGOME_PROFILES", "")
        .args(args)
        .current_dir(folder)
        .output()
        .unwrap()
}

/// The positions of every state as a player of the glTF gets them at its key frame.
fn played(file: &[u8]) -> Vec<Vec<[f32; 3]>> {
    let number = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let json = 20..20 + number(12);
    let buffer = json.end + 8;
    let document: Value = serde_json::from_slice(&file[json]).unwrap();
    let vectors = |accessor: &Value| -> Vec<[f32; 3]> {
        let accessor = &document["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let at = buffer + view["byteOffset"].as_u64().unwrap() as usize;
        let float = |n: usize| f32::from_bits(number(at + 4 * n) as u32);
        (0..accessor["count"].as_u64().unwrap() as usize)
            .map(|i| [0, 1, 2].map(|k| float(3 * i + k)))
            .collect()
    };
    let primitive = &document["meshes"][0]["primitives"][0];
    let rest = vectors(&primitive["attributes"]["POSITION"]);
    let moved = primitive["targets"]
        .as_array()
        .unwrap()
        .iter()
        .map(|target| {
            let moves = vectors(&target["POSITION"]);
            let sum = |(a, b): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|k| a[k] + b[k]);
            rest.iter().zip(&moves).map(sum).collect()
        });
    std::iter::once(rest.clone())
        .chain(moved.collect::<Vec<_>>())
        .collect()
}

#[test]
fn the_command_writes_a_path_that_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (linkage, flat) = patch(3, Handedness::Right);
    std::fs::write(at.join("sheet.obj"), write_obj(&linkage, &flat)).unwrap();
    let args = [
        "states",
        "sheet.obj",
        "--to",
        "1.5",
        "--steps",
        "4",
        "-o",
        "out",
        "--json",
    ];
    let output = kagome(&args, at);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let read = |name: &str| std::fs::read(at.join("out").join(name)).unwrap();
    assert_eq!(
        serde_json::from_slice::<Value>(&read("states.json")).unwrap(),
        told
    );
    let frames = played(&read("states.glb"));
    assert_eq!(
        (frames.len(), told["states"].as_array().unwrap().len()),
        (5, 5)
    );
    for (n, frame) in frames.iter().enumerate() {
        let name = format!("state-{n:03}.obj");
        assert_eq!(told["states"][n]["file"], name.as_str());
        let (same, positions) = read_obj(&read(&name), &name).unwrap();
        assert!(check_same(&linkage, &same).is_ok());
        let q = Soundness::measure(&same, &positions, 2.0);
        assert!(q.edge_error_max < 1e-12);
        assert!((q.opening[1] - (1.0 + 0.125 * n as f64)).abs() < 1.1e-4);
        assert!((told["states"][n]["opening"][1].as_f64().unwrap() - q.opening[1]).abs() < 1e-9);
        for (p, x) in positions.iter().zip(frame) {
            for k in 0..3 {
                assert!((p[k] - f64::from(x[k])).abs() < 1e-5);
            }
        }
    }
    // The same bytes again; earlier results are replaced only when asked.
    assert_eq!(kagome(&args, at).status.code(), Some(2));
    let before = ["state-002.obj", "states.glb"].map(read);
    assert_eq!(
        kagome(&[&args[..], &["--force"]].concat(), at)
            .status
            .code(),
        Some(0)
    );
    assert!(before == ["state-002.obj", "states.glb"].map(read));

    // From one file to another, and back to where the first is in the words of a person.
    let two = [
        "states",
        "out/state-004.obj",
        "out/state-001.obj",
        "--steps",
        "3",
        "-o",
        "two",
    ];
    let output = kagome(&two, at);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(String::from_utf8_lossy(&output.stdout).contains("state-003.obj"));
    let percent = [
        "states",
        "out/state-004.obj",
        "--to",
        "50%",
        "--steps",
        "1",
        "--json",
    ];
    let output = kagome(&percent, at);
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((told["states"][1]["opening"][1].as_f64().unwrap() - 1.25).abs() < 1.1e-4);
    assert!(at.join("state-004-states/states.glb").is_file());

    std::fs::write(at.join("cube.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let (other, flat) = patch(2, Handedness::Right);
    std::fs::write(at.join("other.obj"), write_obj(&other, &flat)).unwrap();
    for (args, says) in [
        (&["sheet.obj", "--to", "3"][..], "mean opening of 3"),
        (&["sheet.obj", "--to", "NaN"], "is no opening"),
        (&["sheet.obj", "--to", "wide"], "is no opening"),
        (&["sheet.obj", "--to", "1.5", "--steps", "0"], "0 steps"),
        (&["sheet.obj", "--to", "1.5", "--sigma", "1.2"], "σ"),
        (&["sheet.obj", "--to", "1.5", "--sigma", "NaN"], "σ"),
        (&["sheet.obj"], "--to"),
        (
            &["sheet.obj", "other.obj", "--to", "1.2"],
            "cannot be used with",
        ),
        (&["sheet.obj", "other.obj"], "not the same linkage"),
        (&["cube.obj", "--to", "1.5"], "cube.obj"),
        (&["none.obj", "--to", "1.5"], "none.obj"),
    ] {
        let output = kagome(&[&["states"], args, &["-o", "bad"]].concat(), at);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
        assert!(said.contains(says), "{args:?}: {said}");
        assert!(!at.join("bad").exists());
    }

    // A number that is out of reach is a no, with everything written; as far as it goes is a yes.
    let pinched = [
        "states",
        "out/state-004.obj",
        "--to",
        "2",
        "--steps",
        "2",
        "-o",
        "far",
    ];
    let output = kagome(&pinched, at);
    assert!(matches!(output.status.code(), Some(0 | 1)));
    assert!(at.join("far/state-002.obj").is_file());
    let open = [
        "states",
        "out/state-004.obj",
        "--to",
        "open",
        "--steps",
        "2",
        "-o",
        "open",
    ];
    assert_eq!(kagome(&open, at).status.code(), Some(0));
}
