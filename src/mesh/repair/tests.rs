use super::*;
use crate::mesh::samples::Sample;
use crate::mesh::units::Unit;
use crate::mesh::write::surface_obj;

fn import(text: &str) -> Result<Import, ImportError> {
    import_bytes("x.obj", text.as_bytes(), &ImportOptions::default())
}

fn refused(text: &str) -> String {
    import(text).unwrap_err().to_string()
}

/// The two triangles of a 10 mm square, as vertices 1 to 4.
const SQUARE: &str = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nf 1 2 3\nf 1 3 4\n";

/// A tetrahedron, outward.
const TETRAHEDRON: &str =
    "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

#[test]
fn samples_survive_writing_and_reading() {
    for sample in Sample::all() {
        let small = Sample::parse(&format!("{}:faces=500", sample.name())).unwrap();
        let surface = small.generate().unwrap();
        let text = surface_obj("", &surface);
        let back = import(&text).unwrap();
        assert_eq!(back.report.repairs(), Vec::<String>::new(), "{sample}");
        assert_eq!(back.surface.faces(), surface.faces(), "{sample}");
        for (a, b) in back
            .surface
            .positions()
            .iter()
            .zip(surface.positions().iter())
        {
            assert!((a - b).norm() < 1e-8);
        }
        assert_eq!(
            surface_obj("", &back.surface),
            text,
            "{sample}: same bytes again"
        );
    }
}

#[test]
fn copies_degenerate_faces_and_strays_are_mended_and_counted() {
    let text = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nv 10 10 0\nv -0 0 0\nv 5 5 5\n\
        f 1 2 3\nf 6 5 4\nf 3 1 2\nf 1 6 2\n";
    let done = import(text).unwrap();
    assert_eq!(done.surface.faces().len(), 2);
    assert_eq!(done.surface.rims().len(), 1);
    let report = &done.report;
    assert_eq!(
        (
            report.welded,
            report.degenerate_faces,
            report.duplicate_faces,
            report.unused_vertices
        ),
        (2, 1, 1, 1)
    );
    assert_eq!(report.repairs().len(), 4);
}

#[test]
fn faces_are_turned_to_the_majority_and_closed_surfaces_outward() {
    let surface = Sample::parse("cap:faces=300").unwrap().generate().unwrap();
    let (positions, mut faces) = surface.to_arrays();
    for face in faces.iter_mut().step_by(7) {
        face.swap(0, 1);
    }
    let turned = faces.len().div_ceil(7);
    let soup = Soup {
        format: Format::Obj,
        source: (0..faces.len() as u32).collect(),
        file_faces: faces.len(),
        polygons: 0,
        positions,
        faces,
    };
    let done = mend(soup, &ImportOptions::default()).unwrap();
    assert_eq!(done.report.turned_faces, turned);
    for face in done.surface.faces().ids() {
        assert!(done.surface.face_normal_doubled(face).z > 0.0);
    }
    // Inside out, and one face against the others: all but that one are turned.
    let inward = TETRAHEDRON
        .replace("f 1 3 2", "f 1 2 3")
        .replace("f 1 2 4", "f 1 4 2")
        .replace("f 2 3 4", "f 2 4 3");
    let done = import(&inward).unwrap();
    assert_eq!(done.report.turned_faces, 3);
    assert!(done.surface.face_normal_doubled(crate::mesh::FaceId(0)).z < 0.0);
}

#[test]
fn what_cannot_be_mended_is_refused_with_the_numbers_of_the_file() {
    let fin = format!(
        "v 99 99 99\n{}v 0 0 5\nf 2 4 6\n",
        SQUARE
            .replace("f 1 2 3", "f 2 3 4")
            .replace("f 1 3 4", "f 2 4 5")
    );
    let text = refused(&fin);
    assert!(text.contains("vertices 2 and 4 has 3 faces"), "{text}");
    let bow = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv -1 0 0\nv -1 -1 0\nf 1 2 3\nf 1 4 5\n";
    assert!(refused(bow).contains("2 parts"));
    // Two fans around vertex 5 that are joined elsewhere: opposite corners of a ring of four squares pinched together.
    let pinched = "v 0 0 9\nv 0 9 0\nv 0 -9 0\nv 9 0 0\nv -9 0 0\nv 9 9 0\nv -9 9 0\nv 12 20 0\nv -12 20 1\n\
        f 2 6 4\nf 2 4 1\nf 6 8 4\nf 2 5 7\nf 7 5 9\nf 8 9 4\nf 9 5 4\n";
    let text = refused(pinched);
    assert!(text.contains("vertex 2, 2 groups"), "{text}");
    let flat = format!("{SQUARE}v 5 0 0\nf 1 2 5\n");
    let text = refused(&flat);
    assert!(
        text.contains("face 3 (vertices 1, 2, 5) has no area"),
        "{text}"
    );
    assert!(refused("v 0 0 0\nv 1 1 1\n").contains("has no faces"));
    assert!(refused("v 0 0 0\nv 1 1 1\nf 1 2 1\n").contains("has no faces"));
}

#[test]
fn a_moebius_band_has_no_outside() {
    let n = 12;
    let mut text = String::new();
    for i in 0..n {
        let angle = std::f64::consts::TAU * i as f64 / n as f64;
        for side in [-3.0, 3.0] {
            let r = 20.0 + side * (angle / 2.0).cos();
            let z = side * (angle / 2.0).sin();
            text += &format!("v {} {} {z}\n", r * angle.cos(), r * angle.sin());
        }
    }
    for i in 0..n {
        let (a, b) = (2 * i + 1, 2 * i + 2);
        let (c, d) = if i + 1 == n { (2, 1) } else { (a + 2, b + 2) };
        text += &format!("f {a} {c} {b}\nf {b} {c} {d}\n");
    }
    assert!(refused(&text).contains("no outside"));
}

#[test]
fn of_several_parts_the_largest_can_be_asked_for() {
    let two = format!("{TETRAHEDRON}v 50 0 0\nv 60 0 0\nv 60 10 0\nf 5 6 7\n");
    let text = refused(&two);
    assert!(
        text.contains("has 2 parts that are not joined, of 4, 1 faces")
            && text.contains("--part largest"),
        "{text}"
    );
    let largest = ImportOptions {
        parts: PartChoice::Largest,
        ..Default::default()
    };
    let done = import_bytes("x.obj", two.as_bytes(), &largest).unwrap();
    assert_eq!(done.surface.faces().len(), 4);
    assert_eq!((done.report.parts, done.report.other_part_faces), (2, 1));
    assert!(done.report.repairs()[0].contains("largest of 2 parts"));
    // A mess in the smaller part does not matter then.
    let messy = format!("{two}v 55 5 5\nv 55 5 -5\nf 5 6 8\nf 5 6 9\n");
    assert_eq!(
        import_bytes("x.obj", messy.as_bytes(), &largest)
            .unwrap()
            .surface
            .faces()
            .len(),
        4
    );
}

#[test]
fn units_are_applied_and_odd_sizes_refused() {
    let options = |unit, scale, size_mm| ImportOptions {
        units: Units {
            unit,
            scale,
            size_mm,
        },
        ..Default::default()
    };
    let longest = |o: &ImportOptions| {
        let done = import_bytes("x.obj", SQUARE.as_bytes(), o).unwrap();
        let (low, high) = done.surface.bounds();
        (high - low).max()
    };
    assert_eq!(longest(&options(Unit::Inch, 2.0, None)), 508.0);
    assert_eq!(longest(&options(Unit::Metre, 1.0, Some(150.0))), 150.0);
    let huge = import_bytes(
        "x.obj",
        SQUARE.as_bytes(),
        &options(Unit::Metre, 10.0, None),
    );
    assert!(huge.unwrap_err().to_string().contains("more than 20 m"));
    let tiny = SQUARE.replace("10", "0.01");
    let text = refused(&tiny);
    assert!(
        text.contains("is 0.01 mm long") && text.contains("--unit"),
        "{text}"
    );
}

#[test]
fn an_stl_is_welded_and_its_cracks_closed() {
    let surface = Sample::parse("octasphere:faces=200")
        .unwrap()
        .generate()
        .unwrap();
    let mut soup = Soup {
        format: Format::Stl,
        positions: Vec::new(),
        faces: Vec::new(),
        source: Vec::new(),
        file_faces: surface.faces().len(),
        polygons: 0,
    };
    for face in surface.faces().ids() {
        let first = soup.positions.len() as u32;
        soup.source.push(soup.faces.len() as u32);
        soup.faces.push([first, first + 1, first + 2]);
        soup.positions.extend(surface.corners(face));
    }
    let exact = mend(soup.clone(), &ImportOptions::default()).unwrap();
    assert_eq!(exact.surface.positions().len(), surface.positions().len());
    assert_eq!(exact.report.repairs(), Vec::<String>::new());
    // Rounding that differs from triangle to triangle.
    for (i, p) in soup.positions.iter_mut().enumerate() {
        p.x += 1e-5 * ((i * 7919 % 13) as f64 / 13.0 - 0.5);
    }
    let closed = mend(soup.clone(), &ImportOptions::default()).unwrap();
    assert_eq!(closed.surface.positions().len(), surface.positions().len());
    assert!(closed.surface.rims().is_empty() && closed.report.welded_cracks > 0);
    // A gap that is more than rounding stays one.
    let shift = 0.5;
    for p in soup.positions.iter_mut().take(3) {
        p.z += shift;
    }
    assert!(matches!(
        mend(soup, &ImportOptions::default()),
        Err(Problem::SeveralParts { count: 2, .. })
    ));
}
