//! Stage 1: importing, closest points, samples.
//!
//! With `KAGOME_MODELS` naming a folder, every OBJ file in it is imported too.

use divan::{Bencher, black_box};
use kagome::mesh::{
    ClosestPoint, ImportOptions, Sample, Surface, Units, import_bytes, write::surface_obj,
};
use nalgebra::Point3;

fn main() {
    divan::main();
}

#[expect(clippy::expect_used, reason = "every text below names a sample")]
fn sample(text: &str) -> Surface {
    Sample::parse(text)
        .and_then(|s| s.generate())
        .expect("the benches name good samples")
}

/// Points 0 to 2 mm off the surface, spread over it in a fixed order.
fn queries(surface: &Surface, count: usize) -> Vec<Point3<f64>> {
    let (positions, normals) = (
        surface.positions().to_vec(),
        surface.vertex_normals().into_vec(),
    );
    (0..count)
        .map(|i| {
            let at = i * 7919 % positions.len();
            positions[at] + normals[at] * (i % 5) as f64 * 0.5
        })
        .collect()
}

#[divan::bench]
fn closest_build_50k(bencher: Bencher<'_, '_>) {
    let surface = sample("mask:faces=50000");
    bencher.bench_local(|| ClosestPoint::new(black_box(&surface)));
}

#[divan::bench]
fn closest_15000_on_50k(bencher: Bencher<'_, '_>) {
    let surface = sample("mask:faces=50000");
    let points = queries(&surface, 15_000);
    let tree = ClosestPoint::new(&surface);
    bencher.bench_local(|| points.iter().map(|p| tree.query(*p).distance).sum::<f64>());
}

#[divan::bench]
fn closest_15000_on_50k_with_hints(bencher: Bencher<'_, '_>) {
    let surface = sample("mask:faces=50000");
    let points = queries(&surface, 15_000);
    let tree = ClosestPoint::new(&surface);
    let hinted: Vec<_> = points.iter().map(|p| (*p, tree.query(*p).face)).collect();
    bencher.bench_local(|| {
        hinted
            .iter()
            .map(|(p, hint)| tree.query_from(*p, *hint).distance)
            .sum::<f64>()
    });
}

#[divan::bench]
fn generate_mask(bencher: Bencher<'_, '_>) {
    bencher.bench_local(|| sample(black_box("mask")));
}

#[divan::bench]
fn import_mask_obj(bencher: Bencher<'_, '_>) {
    let text = surface_obj("", &sample("mask:faces=20000"));
    let options = ImportOptions::default();
    bencher.bench_local(|| import_bytes("mask.obj", text.as_bytes(), &options));
}

/// OBJ files of the folder named by `KAGOME_MODELS`; none if it is not set.
fn models() -> Vec<String> {
    let Some(folder) = std::env::var_os("KAGOME_MODELS") else {
        return Vec::new();
    };
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "obj"))
        .map(|path| path.display().to_string())
        .collect();
    names.sort();
    names
}

#[divan::bench(args = models())]
fn import_model(bencher: Bencher<'_, '_>, path: &str) {
    let bytes = std::fs::read(path).unwrap_or_default();
    let options = ImportOptions {
        units: Units {
            size_mm: Some(200.0),
            ..Units::default()
        },
        ..ImportOptions::default()
    };
    bencher.bench_local(|| import_bytes(path, &bytes, &options));
}
