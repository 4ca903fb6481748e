use super::*;
use crate::base::ids::Id as _;
use crate::mesh::HalfedgeId;

/// The smallest interior angle in degrees.
fn least_angle_deg(surface: &Surface) -> f64 {
    let mut least = 180.0f64;
    for face in surface.faces().ids() {
        let p = surface.corners(face);
        for k in 0..3 {
            let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            least = least.min(u.angle(&v).to_degrees());
        }
    }
    least
}

/// Sum over all faces of the solid angle's sixfold volume: positive where outside is out.
fn volume(surface: &Surface) -> f64 {
    surface
        .faces()
        .ids()
        .map(|f| {
            let [a, b, c] = surface.corners(f);
            a.coords.dot(&b.coords.cross(&c.coords)) / 6.0
        })
        .sum()
}

#[test]
fn every_default_is_a_good_mesh_of_the_size_and_topology_promised() {
    for sample in Sample::all() {
        let surface = sample.generate().unwrap();
        let name = sample.name();
        let faces = surface.faces().len();
        assert!((8_000..=20_000).contains(&faces), "{name}: {faces}");
        let (rims, genus) = match name {
            "catenoid" | "vase" | "funnel" => (2, 0),
            "torus" => (0, 1),
            "double_torus" => (0, 2),
            "octasphere" => (0, 0),
            _ => (1, 0),
        };
        assert_eq!(
            (surface.rims().len(), surface.genus()),
            (rims, genus),
            "{name}"
        );
        assert_eq!(surface.parts().len(), 1, "{name}");
        let (low, high) = surface.bounds();
        let across = (high - low).amax();
        assert!((190.0..=215.0).contains(&across), "{name}: {across}");
        let angle = least_angle_deg(&surface);
        assert!(angle > 20.0, "{name}: least angle {angle}");
    }
}

#[test]
fn the_outside_is_out() {
    for name in ["torus", "octasphere"] {
        let surface = Sample::parse(name).unwrap().generate().unwrap();
        let expected = match name {
            "torus" => 2.0 * std::f64::consts::PI.powi(2) * 80.0 * 20.0 * 20.0,
            _ => 4.0 / 3.0 * std::f64::consts::PI * 1e6,
        };
        assert!(
            (volume(&surface) / expected - 1.0).abs() < 0.01,
            "{name}: {}",
            volume(&surface)
        );
    }
    for name in ["cap", "hemisphere", "bump", "saddle", "mask"] {
        let surface = Sample::parse(name).unwrap().generate().unwrap();
        for face in surface.faces().ids() {
            assert!(surface.face_normal_doubled(face).z > 0.0, "{name}");
        }
    }
    for name in ["catenoid", "vase", "funnel"] {
        let surface = Sample::parse(name).unwrap().generate().unwrap();
        for face in surface.faces().ids() {
            let [a, b, c] = surface.corners(face);
            let middle = (a.coords + b.coords + c.coords).xy();
            assert!(
                surface.face_normal_doubled(face).xy().dot(&middle) > 0.0,
                "{name}"
            );
        }
    }
}

#[test]
fn a_cap_is_exactly_conformal_to_its_stereographic_image() {
    for half_angle_deg in [5.0, 30.0, 60.0, 75.0, 90.0, 120.0, 170.0] {
        let cap = Cap {
            half_angle_deg,
            faces: 3000.0,
            ..Cap::default()
        };
        let surface = Sample::Cap(cap).generate().unwrap();
        let cos_rim = half_angle_deg.to_radians().cos();
        let u: Vec<f64> = surface
            .positions()
            .iter()
            .map(|p| ((1.0 + cos_rim) / (1.0 + p.z / cap.radius_mm)).ln())
            .collect();
        for v in &surface.rims()[0] {
            assert!(u[v.index()].abs() < 1e-12);
        }
        // Scaled by e^{(u+u)/2} the chords are those of the planar disk, up to one factor for all.
        let plane = |v: crate::mesh::VertexId| {
            let p = surface.position(v) / cap.radius_mm;
            p.xy() / (1.0 + p.z)
        };
        let factor = cap.radius_mm * (1.0 + cos_rim);
        for h in surface.edges() {
            let (a, b) = (surface.tail(h), surface.head(h));
            let flat = factor * (plane(a) - plane(b)).norm();
            let scaled = surface.length(h) * (0.5 * (u[a.index()] + u[b.index()])).exp();
            assert!((scaled / flat - 1.0).abs() < 1e-11);
        }
        // The planar mesh has no inverted triangle, so the flat disk really is the solution.
        for face in surface.faces().ids() {
            let [a, b, c] = surface.faces()[face].map(plane);
            assert!((b - a).perp(&(c - a)) > 0.0, "{half_angle_deg}");
        }
        assert!(least_angle_deg(&surface) > 20.0, "{half_angle_deg}");
    }
}

#[test]
fn tips_are_vertices() {
    for name in ["cap", "hemisphere", "bump"] {
        let surface = Sample::parse(name).unwrap().generate().unwrap();
        let (_, high) = surface.bounds();
        let tip = surface.positions()[crate::mesh::VertexId(0)];
        assert_eq!((tip.x, tip.y, tip.z), (0.0, 0.0, high.z), "{name}");
    }
}

#[test]
fn the_mask_is_symmetric_and_nowhere_steep() {
    let mask = Sample::parse("mask").unwrap().generate().unwrap();
    let mut mirrored: Vec<_> = mask.positions().iter().map(|p| (p.y, -p.x, p.z)).collect();
    let mut own: Vec<_> = mask.positions().iter().map(|p| (p.y, p.x, p.z)).collect();
    let order = |a: &(f64, f64, f64), b: &(f64, f64, f64)| {
        let key = |p: &(f64, f64, f64)| ((p.0 * 1e6).round() as i64, (p.1 * 1e6).round() as i64);
        key(a).cmp(&key(b))
    };
    own.sort_by(order);
    mirrored.sort_by(order);
    for (a, b) in own.iter().zip(&mirrored) {
        assert!((a.2 - b.2).abs() < 1e-9);
    }
    for face in mask.faces().ids() {
        let normal = mask.face_normal_doubled(face).normalize();
        assert!(
            normal.z > 65f64.to_radians().cos(),
            "slope {}",
            normal.z.acos().to_degrees()
        );
    }
}

#[test]
fn names_and_keys_are_read_and_written() {
    let sample = Sample::parse("sample:cap:half_angle_deg=75, faces=500").unwrap();
    assert_eq!(
        sample,
        Sample::Cap(Cap {
            half_angle_deg: 75.0,
            faces: 500.0,
            ..Cap::default()
        })
    );
    for sample in Sample::all().into_iter().chain([sample]) {
        assert_eq!(Sample::parse(&sample.to_string()).unwrap(), sample);
    }
    let error = |text: &str| Sample::parse(text).unwrap_err().to_string();
    assert!(error("sample:sphere").contains("octasphere"));
    assert!(error("cap:angle=3").contains("half_angle_deg"));
    assert!(error("cap:half_angle_deg").contains("half_angle_deg=60"));
    assert!(error("cap:half_angle_deg=wide").contains("wide"));
    assert!(error("cap:half_angle_deg=175").contains("170"));
    assert!(error("cap:half_angle_deg=nan").contains("NaN"));
    assert!(error("cap:faces=200,faces=300").contains("twice"));
    let contradiction = Sample::parse("catenoid:waist_mm=1").unwrap().generate();
    assert!(matches!(
        contradiction,
        Err(SampleError::Contradiction { .. })
    ));
}

#[test]
fn every_extreme_parameter_gives_a_surface_or_a_reason() {
    for sample in Sample::all() {
        for parameter in sample.parameters().iter().filter(|p| p.key != "faces") {
            for value in [parameter.least, parameter.most] {
                let mut extreme = sample;
                extreme.set("faces", 400.0);
                extreme.set(parameter.key, value);
                match extreme.generate() {
                    Ok(surface) => {
                        assert!(surface.area() > 0.0, "{extreme}");
                        assert!(surface.faces().len() < 40_000, "{extreme}");
                    }
                    Err(error) => assert!(
                        matches!(error, SampleError::Contradiction { .. }),
                        "{extreme}: {error}"
                    ),
                }
            }
        }
    }
}

#[test]
fn a_rim_runs_with_the_surface_on_its_left() {
    let cap = Sample::parse("cap").unwrap().generate().unwrap();
    let rim = &cap.rims()[0];
    let (a, b) = (cap.position(rim[0]), cap.position(rim[1]));
    assert!(a.xy().coords.perp(&b.xy().coords) > 0.0);
    assert!(cap.halfedges().filter(|h| cap.twin(*h).is_none()).count() == rim.len());
    assert!(
        cap.halfedges()
            .all(|h| HalfedgeId::side(h.face(), h.corner()) == h)
    );
}

/// The double torus: symmetric in three planes, even, as smooth as its tube is round, the outside out, at any size.
#[test]
fn the_double_torus_is_symmetric_even_and_smooth() {
    for (t, faces) in [
        (2.0, 400.0),
        (3.0, 3000.0),
        (2.0, 12000.0),
        (3.0, 12000.0),
        (3.5, 12000.0),
    ] {
        let shape = DoubleTorus {
            t,
            faces,
            ..DoubleTorus::default()
        };
        let surface = Sample::DoubleTorus(shape).generate().unwrap();
        assert_eq!((surface.genus(), surface.rims().len()), (2, 0), "t = {t}");
        let (low, high) = surface.bounds();
        assert!((high.x - 100.0).abs() < 1e-9 && (low.x + 100.0).abs() < 1e-9);
        let made = surface.faces().len() as f64;
        assert!((0.75..1.35).contains(&(made / faces)), "{made} for {faces}");
        // Two rings of known volume overlap in the middle.
        let tube = 100.0 / (2.0 * t + 1.0);
        let rings = 4.0 * std::f64::consts::PI.powi(2) * t * tube.powi(3);
        assert!((0.7..1.15).contains(&(volume(&surface) / rings)), "t = {t}");
        let mut places: Vec<[i64; 3]> = Vec::new();
        for p in surface.positions().iter() {
            places.push([p.x, p.y, p.z].map(|x| (x * 1e6).round() as i64));
        }
        places.sort_unstable();
        for k in 0..3 {
            let mut images = places.clone();
            images.iter_mut().for_each(|p| p[k] = -p[k]);
            images.sort_unstable();
            assert_eq!(places, images, "mirror {k}");
        }
        if faces > 2000.0 {
            let spacing = (surface.area() / made / 0.433).sqrt();
            let most = surface
                .edges()
                .map(|h| surface.length(h))
                .fold(0.0, f64::max);
            assert!(most < 3.0 * spacing, "t = {t}: {most} against {spacing}");
            let angle = least_angle_deg(&surface);
            assert!(angle > 14.0, "t = {t}: least angle {angle}");
            for h in surface.edges() {
                let twin = surface.twin(h).unwrap();
                let bend = surface
                    .face_normal_doubled(h.face())
                    .angle(&surface.face_normal_doubled(twin.face()));
                // In the fork the surface is curved twice as much as on the tube.
                let room = 3.0 * surface.length(h).max(spacing) / tube;
                assert!(
                    bend < room.min(0.9),
                    "t = {t}: {bend} at {}",
                    surface.position(surface.tail(h))
                );
            }
        }
    }
}
