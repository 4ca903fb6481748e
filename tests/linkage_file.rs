//! `linkage.obj` read back: everything returns, and what is no linkage is refused with its place.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

use kagome::base::progress::Silent;
use kagome::conformal::{ConeRequest, FlattenOptions, Sizing, flatten};
use kagome::linkage::{
    Colour, Handedness, Linkage, LinkageOptions, LinkageProblem, build, fit, is_linkage, read_obj,
    write_obj,
};
use kagome::mesh::Sample;
use nalgebra::{Point2, Point3, Rotation2};
use proptest::prelude::*;

/// The closed linkage lying on the sheet: only for linkages without seams.
fn closed(linkage: &Linkage) -> Vec<Point3<f64>> {
    let mut at = vec![Point3::origin(); linkage.point_count()];
    for t in linkage.triangles.iter() {
        for k in 0..3 {
            at[t.points[k].0 as usize] = Point3::new(t.flat[k].x, t.flat[k].y, 0.0);
        }
    }
    at
}

fn assert_same(a: &Linkage, b: &Linkage) {
    assert!((a.edge_mm / b.edge_mm - 1.0).abs() < 1e-9);
    assert_eq!(a.handedness, b.handedness);
    assert_eq!(a.point_count(), b.point_count());
    assert_eq!(a.hinges, b.hinges);
    assert_eq!(a.triangles.len(), b.triangles.len());
    for (s, t) in a.triangles.iter().zip(b.triangles.iter()) {
        assert_eq!((s.points, s.colour), (t.points, t.colour));
        let gap = |k: usize| (s.flat[k] - t.flat[k]).norm();
        assert!((0..3).all(|k| gap(k) < 1e-11), "flat corners");
    }
}

fn round_trip(linkage: &Linkage, positions: &[Point3<f64>]) {
    let text = write_obj(linkage, positions);
    assert!(is_linkage(text.as_bytes()));
    let (read, at) = read_obj(text.as_bytes(), "linkage.obj").unwrap();
    assert_same(linkage, &read);
    assert!(
        positions
            .iter()
            .zip(&at)
            .all(|(p, q)| (p - q).norm() < 1e-11)
    );
    assert!(
        write_obj(&read, &at) == text,
        "the same bytes when written again"
    );
}

fn built(name: &str, handedness: Handedness) -> (Linkage, Vec<Point3<f64>>) {
    let surface = Sample::parse(name).unwrap().generate().unwrap();
    let options = FlattenOptions {
        sigma: 2.0,
        sizing: Sizing::Triangles(500.0),
        cone_clearance: 0.7,
    };
    let flat = flatten(&surface, &ConeRequest::Auto, &options, &Silent).unwrap();
    let fitted = fit(&surface, &flat.layout, flat.edge_mm, false, None, &Silent).unwrap();
    let options = LinkageOptions {
        edge_mm: fitted.edge_mm,
        orientation: fitted.orientation_deg.to_radians(),
        handedness,
        remove_at_cone: 4,
        sigma: 2.0,
    };
    let built = build(&surface, &fitted.layout, &options, &Silent).unwrap();
    let mut linkage = built.linkage;
    if (fitted.orientation_deg / 60.0).round() as i32 % 2 != 0 {
        // The file cannot tell it from the same slits in the lattice turned back by 60°.
        linkage.handedness = match handedness {
            Handedness::Right => Handedness::Left,
            Handedness::Left => Handedness::Right,
        };
        let swap = |t: &mut kagome::linkage::Triangle| t.colour = t.colour.other();
        linkage.triangles.iter_mut().for_each(swap);
    }
    (linkage, built.start)
}

/// Disks, cones, seams around tubes and a closed surface, both patterns.
#[test]
fn samples_return_whole() {
    for (name, seam) in [
        ("cap:faces=2000", false),
        ("bump:faces=2000", true),
        ("vase:faces=3000", true),
        ("torus:t=4,faces=3000", true),
        ("octasphere:faces=3000", true),
    ] {
        for handedness in [Handedness::Right, Handedness::Left] {
            let (linkage, start) = built(name, handedness);
            assert_eq!(linkage.hinges.iter().any(|h| h.seam), seam, "{name}");
            round_trip(&linkage, &start);
        }
    }
}

/// Without seams the sheet tells the slits. Where every hinge is a seam, space does.
#[test]
fn a_sheet_cut_into_single_triangles_is_told_by_its_state_in_space() {
    for handedness in [Handedness::Right, Handedness::Left] {
        let (mut linkage, start) = built("cap:faces=2000", handedness);
        for (n, t) in (0u32..).zip(linkage.triangles.iter_mut()) {
            let away = 3.0 * linkage.edge_mm * f64::from(n);
            t.flat = t.flat.map(|p| Point2::new(p.x + away, p.y));
        }
        linkage.hinges.iter_mut().for_each(|h| h.seam = true);
        round_trip(&linkage, &start);
    }
}

/// Turned by 60° the lattice is the same with its colours swapped: the slits stay where they are.
#[test]
fn a_lattice_turned_by_sixty_degrees_keeps_its_slits() {
    let mut linkage = Linkage::patch(4.0, Handedness::Right, &Linkage::hexagon_cells(2));
    let (whole, at) = (linkage.clone(), closed(&linkage));
    for degrees in [-29.0f64, 29.0, 31.0, 60.0, 90.0, 150.0, 180.0, 300.0] {
        let turn = Rotation2::new(degrees.to_radians());
        for (t, was) in linkage.triangles.iter_mut().zip(whole.triangles.iter()) {
            t.flat = was.flat.map(|p| turn * p);
        }
        let text = write_obj(&linkage, &at);
        let (read, _) = read_obj(text.as_bytes(), "turned").unwrap();
        assert_eq!(read.hinges, whole.hinges, "{degrees}°");
        let odd = (degrees / 60.0).round() as i32 % 2 != 0;
        let undecided = degrees % 60.0 == 30.0;
        assert!(undecided || (read.handedness == Handedness::Left) == odd);
    }
}

/// What other programs add is passed over, what they change in writing numbers is understood.
#[test]
fn a_file_that_went_through_another_program_still_reads() {
    let (linkage, start) = built("torus:t=4,faces=3000", Handedness::Left);
    let text = write_obj(&linkage, &start);
    let points = start.len() as i64;
    let corners = 3 * linkage.triangles.len() as i64;
    let mut other = String::from("# Blender 4\r\nmtllib linkage.mtl\r\no linkage\r\n");
    for line in text.lines().skip(1) {
        let mut words = line.split(' ');
        let kind = words.next().unwrap();
        other += kind;
        for word in words {
            other += " ";
            if kind == "f" {
                let (v, vt) = word.split_once('/').unwrap();
                let back = |text: &str, count: i64| text.parse::<i64>().unwrap() - count - 1;
                other += &format!("{}/{}/1", back(v, points), back(vt, corners));
            } else if kind == "vt" {
                // Single precision, as texture coordinates are kept elsewhere.
                other += &format!("{:e}", word.parse::<f32>().unwrap());
            } else {
                other += &format!("{:e}", word.parse::<f64>().unwrap());
            }
        }
        other += match kind {
            "v" => " 0.5 0.5 0.5 # grey\r\nvn 0 0 1\r\n",
            "vt" => " 0\r\n",
            _ => "\r\ns off\r\nusemtl none\r\ng part\r\n",
        };
    }
    assert!(is_linkage(other.as_bytes()));
    let (read, at) = read_obj(other.as_bytes(), "other.obj").unwrap();
    assert_eq!(read.hinges, linkage.hinges);
    assert_eq!(read.handedness, linkage.handedness);
    assert!((read.edge_mm / linkage.edge_mm - 1.0).abs() < 1e-6);
    assert!(start.iter().zip(&at).all(|(p, q)| (p - q).norm() < 1e-11));
    // A name in another encoding disturbs no number.
    let mut latin = b"o M\xfctze\n".to_vec();
    latin.extend(text.bytes());
    assert!(read_obj(&latin, "latin.obj").is_ok());
}

/// Two triangles at one hinge, closed.
const PAIR: &str = "v 0 0 0\nv 1 0 0\nv 0.5 0.866025403784 0\nv 1.5 0.866025403784 0\nv 0.5 0.866025403784 0\n\
vt 0 0\nvt 1 0\nvt 0.5 0.866025403784\nvt 1.5 0.866025403784\nf 1/1 2/2 3/3\nf 2/2 4/4 5/3\n";

#[test]
fn what_is_no_linkage_is_refused_with_its_place() {
    let (pair, _) = read_obj(PAIR.as_bytes(), "pair").unwrap();
    assert_eq!((pair.hinges.len(), pair.hinges[0].seam), (1, false));
    let swap = |from: &str, to: &str| {
        assert!(PAIR.contains(from));
        PAIR.replacen(from, to, 1)
    };
    for (text, says) in [
        (String::new(), "x: has no faces"),
        (PAIR.replace('v', "\0"), "x: is no plain text"),
        (swap("v 0 0 0", "v 0 nan 0"), "x:1: \"nan\" is not a finite"),
        (
            swap("v 0 0 0", "v 0 1e999 0"),
            "x:1: \"1e999\" is not a finite",
        ),
        (
            swap("v 0 0 0", "v 0 1e300 0"),
            "x:1: \"1e300\" is not a finite",
        ),
        (swap("vt 1 0", "vt 1 -inf"), "x:7: \"-inf\" is not a finite"),
        (
            swap("v 0 0 0", "v 0 0"),
            "x:1: v needs 3 coordinates; 2 found",
        ),
        (
            swap("vt 0 0", "vt 0"),
            "x:6: vt needs 2 coordinates; 1 found",
        ),
        (
            swap("f 1/1", "f 99999999999999999999/1"),
            "x:10: face 1 names v \"99999999999999999999\"",
        ),
        (
            swap("f 1/1", "f 1/7"),
            "x:10: face 1 names vt \"7\", but the file has 4",
        ),
        (
            swap("f 1/1", "f 6/1"),
            "x:10: face 1 names v \"6\", but the file has 5",
        ),
        (swap("f 1/1", "f 0/1"), "face 1 names v \"0\""),
        (swap("f 1/1", "f -6/1"), "face 1 names v \"-6\""),
        (swap("f 1/1", "f x/1"), "face 1 names v \"x\""),
        (swap("f 1/1", "f 1"), "x:10: face 1 has no vt"),
        (swap("f 1/1", "f 1//1"), "x:10: face 1 has no vt"),
        (swap("f 1/1", "f 1/1 4/4"), "x:10: face 1 has 4 corners"),
        (
            swap("f 1/1 2/2", "f 1/1 1/2"),
            "x:10: face 1 has vertex 1 twice",
        ),
        (
            swap("f 2/2 4/4 5/3", "f 2/2 4/4 3/3"),
            "x:11: faces 1 and 2 share vertices 2 and 3",
        ),
        (
            PAIR.to_owned() + "f 2/1 1/2 5/3\n",
            "x:12: vertex 2 belongs to faces 1, 2 and 3",
        ),
        (
            PAIR.to_owned() + "v 9 9 9\n",
            "x: vertex 6 belongs to no face",
        ),
        (
            swap("vt 1.5", "vt 1.50001"),
            "x:11: face 2 is no equilateral triangle of edge 1.000000 mm",
        ),
        (
            swap("f 2/2 4/4 5/3", "f 2/2 5/3 4/4").replacen("f 1/1 2/2 3/3", "f 1/1 3/3 2/2", 1),
            "x:10: face 1 is mirrored on the sheet: its vt run clockwise, its v counter-clockwise seen from outside (2 such faces)",
        ),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 2 2\nf 1/1 2/1 3/1".to_owned(),
            "too small to mean anything",
        ),
    ] {
        let error = read_obj(text.as_bytes(), "x").unwrap_err().to_string();
        assert!(error.contains(says), "{says}: {error}");
    }
}

#[test]
fn triangles_that_cannot_be_closed_together_are_named() {
    let linkage = Linkage::patch(5.0, Handedness::Right, &Linkage::hexagon_cells(1));
    let mut turned = linkage.clone();
    let flat = &mut turned.triangles[kagome::linkage::TriangleId(0)].flat;
    *flat = flat.map(|p| Rotation2::new(0.3) * p);
    let text = write_obj(&turned, &closed(&linkage));
    let error = read_obj(text.as_bytes(), "x").unwrap_err();
    assert!(
        matches!(error.problem, LinkageProblem::Unclosable { faces: [1, _], turn_deg, .. }
            if (turn_deg.abs() - 0.3f64.to_degrees()).abs() < 1e-6),
        "{error}"
    );
    // Three triangles in a ring: two of them would have to be slit the same way around.
    let ring = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\nvt 0 0\nvt 1 0\nvt 0.5 0.866025403784\n\
        f 1/1 2/2 4/3\nf 2/1 3/2 5/3\nf 3/1 1/2 6/3\n";
    let error = read_obj(ring.as_bytes(), "x").unwrap_err();
    assert!(
        matches!(error.problem, LinkageProblem::SameWayAround { .. }),
        "{error}"
    );
}

#[test]
fn surfaces_are_not_taken_for_linkages() {
    for other in [
        "",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        // One textured triangle; two that share an edge; a soup of two.
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 2/1 4/2 3/3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 4/1 5/2 6/3\n",
    ] {
        assert!(!is_linkage(other.as_bytes()), "{other}");
    }
    assert!(is_linkage(PAIR.as_bytes()));
    // Broken, but meant as one: reading says what is wrong.
    let mut merged = Linkage::patch(5.0, Handedness::Right, &Linkage::hexagon_cells(3));
    let at = closed(&merged);
    let (one, other) = (merged.hinges[3].point, merged.hinges[20].point);
    for t in merged.triangles.iter_mut() {
        t.points = t.points.map(|p| if p == one { other } else { p });
    }
    let text = write_obj(&merged, &at);
    let nameless = text.split_once('\n').unwrap().1;
    assert!(is_linkage(nameless.as_bytes()));
    assert!(read_obj(nameless.as_bytes(), "x").is_err());
}

/// Cells in no order and with gaps: several pieces, dangling triangles, loose ones.
fn cells() -> impl Strategy<Value = Vec<(i32, i32, Colour)>> {
    let cell = (-4..5i32, -4..5i32, any::<bool>());
    prop::collection::vec(cell, 1..90).prop_map(|cells| {
        let mut seen = std::collections::HashSet::new();
        cells
            .into_iter()
            .map(|(i, j, up)| (i, j, if up { Colour::Up } else { Colour::Down }))
            .filter(|c| seen.insert(*c))
            .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn patches_return_whole(cells in cells(), left: bool, edge in 0.05..300.0f64) {
        let handedness = if left { Handedness::Left } else { Handedness::Right };
        let linkage = Linkage::patch(edge, handedness, &cells);
        // Without any hinge nothing tells how it is slit, and nothing is.
        prop_assume!(!linkage.hinges.is_empty());
        round_trip(&linkage, &closed(&linkage));
    }

    #[test]
    fn mangled_text_never_panics(
        cells in cells(), at in prop::collection::vec((0.0..1.0f64, any::<u8>(), 0..4u8), 1..12),
    ) {
        let linkage = Linkage::patch(5.0, Handedness::Right, &cells);
        let mut bytes = write_obj(&linkage, &closed(&linkage)).into_bytes();
        let words: [&[u8]; 6] = [b" -1", b"/", b"\nf 1/1 2/2 3/3\n", b" 1e308 ", b"\nv 1 2 3\n", b" 18446744073709551616"];
        for (place, byte, how) in at {
            let place = (place * bytes.len() as f64) as usize;
            match how {
                0 => bytes[place] = byte,
                1 => { bytes.remove(place); }
                2 => bytes.truncate(place.max(200)),
                _ => { bytes.splice(place..place, words[byte as usize % 6].iter().copied()); }
            }
        }
        let named = is_linkage(&bytes);
        match read_obj(&bytes, "mangled") {
            Ok((linkage, positions)) => {
                // What is read is whole: it can be written and read again.
                let text = write_obj(&linkage, &positions);
                prop_assert_eq!(read_obj(text.as_bytes(), "again").unwrap().0.hinges, linkage.hinges);
            }
            Err(error) => prop_assert!(named || !error.to_string().is_empty()),
        }
    }
}
