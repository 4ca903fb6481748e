//! From surface to exact linkage, stage by stage, and the whole line in one call.
//!
//! Samples always; with `KAGOME_MODELS` naming a folder, also `mp_mask_20k.obj` there (a scan of 19 309 faces).

#![expect(
    clippy::expect_used,
    reason = "a bench whose fixture is broken has nothing to measure"
)]

use std::path::PathBuf;

use divan::{Bencher, black_box};
use kagome::base::progress::Silent;
use kagome::base::sparse::{Cholesky, Pattern};
use kagome::conformal::{
    ConeRequest, FlattenOptions, Flattened, MetricSolver, Singularities, Sizing, flatten,
};
use kagome::job::{Request, Source, make};
use kagome::linkage::{Built, Handedness, LinkageOptions, build};
use kagome::mesh::{ClosestPoint, ImportOptions, Sample, Surface, import_file};
use kagome::rationalize::{Quality, Solver, rationalize};

fn main() {
    divan::main();
}

const SIGMA: f64 = 2.0;

/// Name and number of triangles to remove at a cone.
const CASES: [(&str, usize); 3] = [
    ("sample:hemisphere", 0),
    ("sample:bump", 4),
    ("mp_mask_20k.obj", 4),
];

fn scan(name: &str) -> Option<PathBuf> {
    Some(PathBuf::from(std::env::var_os("KAGOME_MODELS")?).join(name)).filter(|p| p.is_file())
}

fn cases() -> Vec<usize> {
    (0..CASES.len())
        .filter(|&i| CASES[i].0.starts_with("sample:") || scan(CASES[i].0).is_some())
        .collect()
}

fn surface(case: usize) -> Surface {
    let name = CASES[case].0;
    match scan(name) {
        Some(path) => {
            import_file(&path, &ImportOptions::default())
                .expect("a scan")
                .surface
        }
        None => Sample::parse(name)
            .and_then(|s| s.generate())
            .expect("a sample"),
    }
}

fn options(case: usize, triangles: f64) -> FlattenOptions {
    FlattenOptions {
        sigma: SIGMA,
        sizing: Sizing::Triangles(triangles),
        cone_clearance: if CASES[case].1 > 0 { 1.1 } else { 0.7 },
    }
}

fn lattice(case: usize, flat: &Flattened) -> LinkageOptions {
    LinkageOptions {
        edge_mm: flat.edge_mm,
        orientation: 0.0,
        handedness: Handedness::Right,
        remove_at_cone: CASES[case].1,
        sigma: SIGMA,
    }
}

struct Laid {
    surface: Surface,
    flat: Flattened,
    built: Built,
    closest: ClosestPoint,
}

fn laid(case: usize, triangles: f64) -> Laid {
    let surface = surface(case);
    let flat = flatten(
        &surface,
        &ConeRequest::Auto,
        &options(case, triangles),
        &Silent,
    )
    .expect("a map");
    let built = build(&surface, &flat.layout, &lattice(case, &flat), &Silent).expect("a linkage");
    let closest = ClosestPoint::new(&surface);
    Laid {
        surface,
        flat,
        built,
        closest,
    }
}

/// One factorisation of the cotangent pattern: the unit in which the conformal map is to be measured.
#[divan::bench(args = cases(), sample_count = 10)]
fn one_factorization(bencher: Bencher<'_, '_>, case: usize) {
    let surface = surface(case);
    let edges = surface
        .edges()
        .map(|h| (surface.tail(h).0, surface.head(h).0));
    let mut solver =
        Cholesky::new(Pattern::new(surface.positions().len(), edges)).expect("a pattern");
    let mut values = vec![-1.0; solver.pattern().entries()];
    for i in 0..solver.pattern().size() {
        values[solver.pattern().slot(i, i).expect("a diagonal")] = 30.0;
    }
    bencher.bench_local(|| solver.factor(black_box(&values)));
}

#[divan::bench(args = cases(), sample_count = 10)]
fn conformal_metric_without_cone(bencher: Bencher<'_, '_>, case: usize) {
    let surface = surface(case);
    bencher.bench_local(|| {
        MetricSolver::new(&surface)
            .and_then(|mut s| s.solve(&Singularities::none(&surface), &Silent))
            .map(|m| m.steps)
    });
}

#[divan::bench(args = cases(), sample_count = 10)]
fn flatten_with_automatic_cone(bencher: Bencher<'_, '_>, case: usize) {
    let surface = surface(case);
    let options = options(case, 1500.0);
    bencher.bench_local(|| {
        flatten(&surface, &ConeRequest::Auto, &options, &Silent).map(|f| f.edge_mm)
    });
}

#[divan::bench(args = cases(), sample_count = 10)]
fn linkage_of_1500(bencher: Bencher<'_, '_>, case: usize) {
    let laid = laid(case, 1500.0);
    bencher.bench_local(|| {
        build(
            &laid.surface,
            &laid.flat.layout,
            &lattice(case, &laid.flat),
            &Silent,
        )
        .map(|b| b.lost)
    });
}

fn solve(bencher: Bencher<'_, '_>, case: usize, solver: Solver) {
    let laid = laid(case, 1500.0);
    bencher.bench_local(|| {
        rationalize(
            &laid.built.linkage,
            &laid.built.start,
            &laid.closest,
            SIGMA,
            solver,
            &Silent,
        )
        .map(|(_, e)| e)
    });
}

#[divan::bench(args = cases(), sample_count = 5)]
fn exact_solve_of_1500(bencher: Bencher<'_, '_>, case: usize) {
    solve(bencher, case, Solver::Exact);
}

#[divan::bench(args = cases(), sample_count = 5)]
fn alternating_projection_of_1500(bencher: Bencher<'_, '_>, case: usize) {
    solve(bencher, case, Solver::Projection);
}

#[divan::bench(args = cases(), sample_count = 10)]
fn quality_of_1500(bencher: Bencher<'_, '_>, case: usize) {
    let laid = laid(case, 1500.0);
    let (linkage, start) = (&laid.built.linkage, &laid.built.start);
    bencher.bench_local(|| {
        Quality::measure(linkage, start, &laid.surface, &laid.closest, SIGMA).penetrations
    });
}

/// The whole line, mesh file to rehearsed job and report, in memory.
#[divan::bench(args = cases(), sample_count = 5)]
fn make_1500(bencher: Bencher<'_, '_>, case: usize) {
    let name = CASES[case].0;
    let source = match scan(name) {
        Some(path) => Source::File { path, sha256: None },
        None => Source::Sample(name.to_owned()),
    };
    let request = Request {
        sigma: Some(SIGMA),
        remove_at_cone: Some(CASES[case].1),
        ..Request::new(source)
    };
    bencher.bench_local(|| make(&request, &std::env::temp_dir(), &Silent).map(|m| m.files.len()));
}
