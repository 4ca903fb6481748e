//! From surface to exact linkage, stage by stage, and the whole line in one call.
//!
//! Samples always; with `KAGOME_MODELS` naming a folder, also `mp_mask_20k.obj` there (a scan of 19 309 faces), and for
//! the metric against a factorisation `mph_50k.obj` and `mph_400k.obj`.

#![expect(
    clippy::expect_used,
    reason = "a bench whose fixture is broken has nothing to measure"
)]

use std::path::PathBuf;
use std::time::Instant;

use divan::{Bencher, black_box};
use kagome::base::progress::Silent;
use kagome::base::sparse::{Cholesky, Pattern};
use kagome::conformal::{
    Cone, ConeRequest, FlattenOptions, Flattened, MetricSolver, Singularities, Sizing, flatten,
};
use kagome::job::{Request, Source, make};
use kagome::linkage::{Built, Handedness, LinkageOptions, build};
use kagome::mesh::{ClosestPoint, ImportOptions, Sample, Surface, import_file};
use kagome::rationalize::{Quality, Solver, rationalize};

fn main() {
    // Only where no name is asked for, or its own.
    let wanted = |name: &String| name.starts_with('-') || METRIC_RATIO.contains(name.as_str());
    if std::env::args().skip(1).all(|name| wanted(&name)) {
        metric_against_factorization();
    }
    divan::main();
}

const METRIC_RATIO: &str = "metric_against_factorization";

/// The whole metric solve, from surface to u, as a multiple of what its Newton steps would cost as plain faer
/// factorisations of the surface's cotangent Laplacian: symbolic + steps × numeric, measured in turns.
fn metric_against_factorization() {
    let scans = ["mph_50k.obj", "mph_400k.obj"];
    let mut names: Vec<&str> = scans.into_iter().filter(|n| scan(n).is_some()).collect();
    if names.is_empty() {
        names.push("sample:hemisphere:faces=50000");
    }
    println!("{METRIC_RATIO} (medians of {ROUNDS}, ms)");
    for name in names {
        let surface = named(name);
        let laplacian = cotangent_laplacian(&surface);
        for cones in [0, 5] {
            let wanted = Singularities::cones(&surface, spread_cones(&surface, cones));
            let mut times: [Vec<f64>; 3] = Default::default();
            let mut steps = 0;
            for _ in 0..ROUNDS {
                let clock = Instant::now();
                let mut solver = Cholesky::new(laplacian.0.clone()).expect("memory for the factor");
                times[0].push(clock.elapsed().as_secs_f64() * 1e3);
                // The first one also pays for fresh memory.
                solver.factor(&laplacian.1).expect("a definite matrix");
                let clock = Instant::now();
                solver.factor(&laplacian.1).expect("a definite matrix");
                times[1].push(clock.elapsed().as_secs_f64() * 1e3);
                drop(solver);
                let clock = Instant::now();
                let metric = MetricSolver::new(&surface)
                    .and_then(|mut s| s.solve(&wanted, &Silent))
                    .expect("a metric");
                times[2].push(clock.elapsed().as_secs_f64() * 1e3);
                steps = metric.steps;
            }
            let [symbolic, numeric, whole] = times.map(|mut t| {
                t.sort_by(f64::total_cmp);
                t[t.len() / 2]
            });
            println!(
                "  {name}, {cones} cones: metric {whole:.1}, {steps} steps, symbolic {symbolic:.1}, numeric {numeric:.1}: {:.2} × (symbolic + steps × numeric)",
                whole / (symbolic + steps as f64 * numeric)
            );
        }
    }
}

const ROUNDS: usize = 5;

/// Pattern and values of the cotangent Laplacian, the first vertex held.
fn cotangent_laplacian(surface: &Surface) -> (Pattern, Vec<f64>) {
    let edges = surface
        .edges()
        .map(|h| (surface.tail(h).0, surface.head(h).0));
    let pattern = Pattern::new(surface.positions().len(), edges);
    let mut values = vec![0.0; pattern.entries()];
    let slot = |i: u32, j: u32| pattern.slot(i as usize, j as usize).expect("an entry");
    for (face, v) in surface.faces().iter_ids() {
        let p = surface.corners(face);
        for k in 0..3 {
            let (i, j, o) = (k, (k + 1) % 3, (k + 2) % 3);
            let (a, b) = (p[i] - p[o], p[j] - p[o]);
            let half = 0.5 * a.dot(&b) / a.cross(&b).norm();
            values[slot(v[i].0, v[j].0)] -= half;
            values[slot(v[i].0, v[i].0)] += half;
            values[slot(v[j].0, v[j].0)] += half;
        }
    }
    values[0] += 1.0;
    (pattern, values)
}

/// Cones of alternating signs at vertices spread by number.
fn spread_cones(surface: &Surface, count: usize) -> Vec<Cone> {
    let inner: Vec<_> = surface
        .positions()
        .ids()
        .filter(|v| !surface.on_rim(*v))
        .collect();
    (0..count)
        .map(|i| Cone {
            vertex: inner[(2 * i + 1) * inner.len() / (2 * count)],
            units: if i % 2 == 0 { 1 } else { -1 },
        })
        .collect()
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
    named(CASES[case].0)
}

fn named(name: &str) -> Surface {
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
