//! The picture in the README is what the program draws: the sample mask, flat and opened.
//!
//! Compared with a tolerance, because the solver's last digits differ between kinds of processors.
//! `KAGOME_BLESS=1 cargo test --test readme_picture` draws it anew.

#![allow(clippy::unwrap_used, reason = "a helper that fails, fails its test")]

use std::path::Path;

use kagome::base::progress::Silent;
use kagome::conformal::{ConeRequest, FlattenOptions, Sizing, flatten};
use kagome::job::picture::postcard;
use kagome::linkage::{Handedness, LinkageOptions, build};
use kagome::mesh::{ClosestPoint, Sample};
use kagome::rationalize::{Solver, rationalize};

/// Width, height and colours of a PNG.
fn decode(bytes: &[u8]) -> (u32, u32, Vec<u8>) {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    pixels.truncate(info.buffer_size());
    (info.width, info.height, pixels)
}

#[test]
fn the_mask_looks_as_in_the_readme() {
    let surface = Sample::parse("mask").unwrap().generate().unwrap();
    let sigma = 1.8;
    let options = FlattenOptions {
        sigma,
        sizing: Sizing::Triangles(1500.0),
        cone_clearance: 2.1,
    };
    let flat = flatten(&surface, &ConeRequest::Auto, &options, &Silent).unwrap();
    let lattice = LinkageOptions {
        edge_mm: flat.edge_mm,
        orientation: 0.0,
        handedness: Handedness::Right,
        remove_at_cone: 16,
        sigma,
    };
    let built = build(&surface, &flat.layout, &lattice, &Silent).unwrap();
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
    let drawn = postcard(&surface, &built.linkage, &positions, None).png();

    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/mask.png");
    if std::env::var_os("KAGOME_BLESS").is_some() {
        std::fs::write(&path, &drawn).unwrap();
    }
    let (golden, drawn) = (decode(&std::fs::read(&path).unwrap()), decode(&drawn));
    assert_eq!(
        (golden.0, golden.1, golden.2.len()),
        (drawn.0, drawn.1, drawn.2.len())
    );
    let difference: u64 = golden
        .2
        .iter()
        .zip(&drawn.2)
        .map(|(a, b)| u64::from(a.abs_diff(*b)))
        .sum();
    let mean = difference as f64 / golden.2.len() as f64;
    assert!(mean < 2.0, "mean difference {mean} of 255");
    let ink = drawn.2.chunks(4).filter(|p| p[3] > 128).count();
    assert!(
        ink * 5 > golden.2.len() / 4,
        "at least a fifth of the picture is drawn"
    );
}
