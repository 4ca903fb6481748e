//! Judges a `linkage.obj` against its surface, from the file format alone: one face a rigid triangle, `v` its corners
//! in space, `vt` its closed corners on the sheet. Nothing here comes from the program that wrote it.

use std::collections::HashMap;

type P3 = [f64; 3];
type P2 = [f64; 2];

/// What the judge found.
#[derive(Debug)]
pub struct Findings {
    pub triangles: usize,
    pub hinges: usize,
    pub edge_error: f64,
    /// Largest distance of a corner from the surface, in L.
    pub distance: f64,
    pub opening: f64,
    pub coverage: f64,
    pub seam_hinges: usize,
    pub irregular_seam_turns: usize,
    pub faults: Vec<String>,
}

struct Obj {
    v: Vec<P3>,
    vt: Vec<P2>,
    f: Vec<Vec<(usize, Option<usize>)>>,
}

fn read(text: &str) -> Obj {
    let mut obj = Obj {
        v: vec![],
        vt: vec![],
        f: vec![],
    };
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let c: Vec<f64> = words
                    .map(|w| w.parse().expect("a number after v"))
                    .collect();
                obj.v.push([c[0], c[1], c[2]]);
            }
            Some("vt") => {
                let c: Vec<f64> = words
                    .map(|w| w.parse().expect("a number after vt"))
                    .collect();
                obj.vt.push([c[0], c[1]]);
            }
            Some("f") => obj.f.push(
                words
                    .map(|w| {
                        let mut p = w.split('/');
                        let v: usize = p.next().expect("an index").parse().expect("a vertex index");
                        let vt = p
                            .next()
                            .filter(|t| !t.is_empty())
                            .map(|t| t.parse::<usize>().expect("a vt index") - 1);
                        (v - 1, vt)
                    })
                    .collect(),
            ),
            _ => {}
        }
    }
    obj
}

fn sub(a: P3, b: P3) -> P3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
fn add(a: P3, b: P3) -> P3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
fn times(a: P3, s: f64) -> P3 {
    [a[0] * s, a[1] * s, a[2] * s]
}
fn dot(a: P3, b: P3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: P3, b: P3) -> P3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
fn norm(a: P3) -> f64 {
    dot(a, a).sqrt()
}
fn unit(a: P3) -> P3 {
    times(a, 1.0 / norm(a))
}
fn gap(a: P2, b: P2) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Distance from p to triangle t: inside the prism over it the height, else the nearest side.
fn to_triangle(p: P3, t: &[P3; 3]) -> f64 {
    let n = cross(sub(t[1], t[0]), sub(t[2], t[0]));
    let inside = (0..3).all(|k| dot(cross(sub(t[(k + 1) % 3], t[k]), sub(p, t[k])), n) >= 0.0);
    if inside && norm(n) > 0.0 {
        return (dot(sub(p, t[0]), n) / norm(n)).abs();
    }
    (0..3)
        .map(|k| {
            let (a, e) = (t[k], sub(t[(k + 1) % 3], t[k]));
            let s = (dot(sub(p, a), e) / dot(e, e).max(1e-300)).clamp(0.0, 1.0);
            norm(sub(p, add(a, times(e, s))))
        })
        .fold(f64::INFINITY, f64::min)
}

/// Triangles with the centre and radius of a ball around them, for skipping most of them.
struct Soup(Vec<([P3; 3], P3, f64)>);

impl Soup {
    fn new(triangles: impl Iterator<Item = [P3; 3]>) -> Self {
        Self(
            triangles
                .map(|t| {
                    let c = times(add(add(t[0], t[1]), t[2]), 1.0 / 3.0);
                    let r = t.iter().map(|p| norm(sub(*p, c))).fold(0.0, f64::max);
                    (t, c, r)
                })
                .collect(),
        )
    }
    fn distance(&self, p: P3) -> f64 {
        let mut best = f64::INFINITY;
        for (t, c, r) in &self.0 {
            let d = sub(p, *c);
            let reach = best + r;
            if dot(d, d) < reach * reach {
                best = best.min(to_triangle(p, t));
            }
        }
        best
    }
}

/// True if two flat triangles overlap by more than `tolerance` in every separating direction.
fn overlap(a: &[P2; 3], b: &[P2; 3], tolerance: f64) -> bool {
    for t in [a, b] {
        for k in 0..3 {
            let e = [t[(k + 1) % 3][0] - t[k][0], t[(k + 1) % 3][1] - t[k][1]];
            let n = [-e[1] / e[0].hypot(e[1]), e[0] / e[0].hypot(e[1])];
            let range = |t: &[P2; 3]| {
                let x = t.map(|p| p[0] * n[0] + p[1] * n[1]);
                (
                    x.iter().copied().fold(f64::INFINITY, f64::min),
                    x.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                )
            };
            let ((a0, a1), (b0, b1)) = (range(a), range(b));
            if a1.min(b1) - a0.max(b0) <= tolerance {
                return false;
            }
        }
    }
    true
}

/// True if an edge of `a` passes through the inside of `b`.
fn pierces(a: &[P3; 3], b: &[P3; 3], tolerance: f64) -> bool {
    let n = unit(cross(sub(b[1], b[0]), sub(b[2], b[0])));
    (0..3).any(|k| {
        let (p, q) = (a[k], a[(k + 1) % 3]);
        let (dp, dq) = (dot(sub(p, b[0]), n), dot(sub(q, b[0]), n));
        if !(dp > tolerance && dq < -tolerance || dp < -tolerance && dq > tolerance) {
            return false;
        }
        let x = add(p, times(sub(q, p), dp / (dp - dq)));
        (0..3).all(|s| {
            let e = sub(b[(s + 1) % 3], b[s]);
            dot(cross(e, sub(x, b[s])), n) / norm(e) > tolerance
        })
    })
}

/// Pairs of points nearer than `reach`, by buckets.
fn near_pairs(points: &[P3], reach: f64) -> Vec<(usize, usize)> {
    let cell = |p: &P3| p.map(|x| (x / reach).floor() as i64);
    let mut buckets: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (i, p) in points.iter().enumerate() {
        buckets.entry(cell(p)).or_default().push(i);
    }
    let mut pairs = vec![];
    for (i, p) in points.iter().enumerate() {
        let c = cell(p);
        for n in 0..27i64 {
            let key = [c[0] + n % 3 - 1, c[1] + n / 3 % 3 - 1, c[2] + n / 9 - 1];
            for &j in buckets.get(&key).into_iter().flatten() {
                if i < j && norm(sub(*p, points[j])) < reach {
                    pairs.push((i, j));
                }
            }
        }
    }
    pairs
}

/// Judges; `sigma` is the largest scale factor allowed.
pub fn judge(linkage: &str, surface: &str, sigma: f64) -> Findings {
    let (link, target) = (read(linkage), read(surface));
    let mut faults = vec![];
    assert!(!link.f.is_empty() && !target.f.is_empty(), "no faces");
    let tri: Vec<[usize; 3]> = link
        .f
        .iter()
        .map(|f| {
            assert_eq!(f.len(), 3, "every face of a linkage is a triangle");
            [f[0].0, f[1].0, f[2].0]
        })
        .collect();
    let flat: Vec<[P2; 3]> = link
        .f
        .iter()
        .map(|f| [0, 1, 2].map(|k: usize| link.vt[f[k].1.expect("every corner has a vt")]))
        .collect();

    // Format: every vertex one or two faces.
    let mut users: Vec<Vec<(usize, usize)>> = vec![vec![]; link.v.len()];
    for (t, f) in tri.iter().enumerate() {
        (0..3).for_each(|k| users[f[k]].push((t, k)));
    }
    if let Some(v) = users.iter().position(|u| u.is_empty() || u.len() > 2) {
        faults.push(format!(
            "vertex {} is used by {} faces",
            v + 1,
            users[v].len()
        ));
    }

    // Flat: equilateral, one orientation, no overlap.
    let edge = gap(flat[0][0], flat[0][1]);
    let turning: Vec<f64> = flat
        .iter()
        .map(|t| {
            (t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[1][1] - t[0][1]) * (t[2][0] - t[0][0])
        })
        .collect();
    let mirrored = turning[0] < 0.0;
    if turning.iter().any(|a| (*a < 0.0) != mirrored) {
        faults.push("flat triangles of both orientations".into());
    }
    let skew = flat
        .iter()
        .flat_map(|t| (0..3).map(|k| (gap(t[k], t[(k + 1) % 3]) / edge - 1.0).abs()))
        .fold(0.0, f64::max);
    if skew > 1e-6 {
        faults.push(format!("flat triangles are not equilateral: {skew:e}"));
    }
    let centres2: Vec<P3> = flat
        .iter()
        .map(|t| {
            [
                (t[0][0] + t[1][0] + t[2][0]) / 3.0,
                (t[0][1] + t[1][1] + t[2][1]) / 3.0,
                0.0,
            ]
        })
        .collect();
    let on_one_another = near_pairs(&centres2, 1.155 * edge)
        .into_iter()
        .filter(|&(i, j)| overlap(&flat[i], &flat[j], 1e-3 * edge))
        .count();
    if on_one_another > 0 {
        faults.push(format!("{on_one_another} pairs overlap on the sheet"));
    }

    // Edges in space.
    let edge_error = tri
        .iter()
        .flat_map(|f| {
            (0..3).map(|k| (norm(sub(link.v[f[(k + 1) % 3]], link.v[f[k]])) / edge - 1.0).abs())
        })
        .fold(0.0, f64::max);

    // Hinges: the slit side of each triangle at its corner is known where both lie side by side on the sheet, and is
    // the same (previous or next) at all corners of a triangle.
    let mut sense = vec![0i32; tri.len()];
    let mut hinges = vec![];
    for (v, u) in users.iter().enumerate() {
        if let [(a, i), (b, j)] = u[..] {
            let prev_next = gap(flat[a][(i + 2) % 3], flat[b][(j + 1) % 3]) < 1e-3 * edge;
            let next_prev = gap(flat[a][(i + 1) % 3], flat[b][(j + 2) % 3]) < 1e-3 * edge;
            let side_by_side = gap(flat[a][i], flat[b][j]) < 1e-3 * edge && (prev_next ^ next_prev);
            if side_by_side {
                for (t, s) in [
                    (a, if prev_next { 1 } else { -1 }),
                    (b, if prev_next { -1 } else { 1 }),
                ] {
                    if sense[t] == -s {
                        faults.push(format!("face {} is not slit as a directed cycle", t + 1));
                    }
                    sense[t] = s;
                }
            }
            hinges.push((v, a, i, b, j, side_by_side));
        }
    }
    for _ in 0..tri.len() {
        let unknown: Vec<_> = hinges
            .iter()
            .filter(|h| (sense[h.1] == 0) != (sense[h.3] == 0))
            .collect();
        if unknown.is_empty() {
            break;
        }
        for h in unknown {
            if sense[h.1] == 0 {
                sense[h.1] = -sense[h.3]
            } else {
                sense[h.3] = -sense[h.1]
            }
        }
    }
    let (mut opening, mut seam_hinges, mut irregular) = (0.0f64, 0, 0);
    for &(v, a, i, b, j, side_by_side) in &hinges {
        if sense[a] == sense[b] {
            faults.push(format!("hinge {} joins two triangles of one colour", v + 1));
            continue;
        }
        // Order the pair so that seen from outside the arms follow each other counter-clockwise: b1, a1, a2, b2.
        let ((t, i), (s, j)) = if sense[a] > 0 {
            ((a, i), (b, j))
        } else {
            ((b, j), (a, i))
        };
        let arm = |t: usize, k: usize| sub(link.v[tri[t][k % 3]], link.v[v]);
        let (v1, v2, v3, v4) = (arm(t, i + 1), arm(t, i + 2), arm(s, j + 1), arm(s, j + 2));
        if !side_by_side {
            seam_hinges += 1;
            let side = |t: usize, i: usize, k: usize| {
                [
                    flat[t][k % 3][0] - flat[t][i][0],
                    flat[t][k % 3][1] - flat[t][i][1],
                ]
            };
            let (x, y) = (side(t, i, i + 2), side(s, j, j + 1));
            let turn = (x[0] * y[1] - x[1] * y[0])
                .atan2(x[0] * y[0] + x[1] * y[1])
                .to_degrees();
            let off = (turn / 120.0 - (turn / 120.0).round()).abs() * 120.0;
            irregular += usize::from(off > 1e-4);
        }
        let (n1, n2) = (unit(cross(v1, v2)), unit(cross(v3, v4)));
        let clear = dot(n1, cross(v2, v3)).min(dot(n2, cross(v2, v3))) / edge / edge;
        let inner = norm(cross(v2, v3)).atan2(dot(v2, v3)).to_degrees();
        let outer = norm(cross(v1, v4)).atan2(dot(v1, v4)).to_degrees();
        let past = inner > 120.05 && outer < 119.95;
        if clear < -1e-4 && !past {
            faults.push(format!(
                "the triangles at vertex {} penetrate by {:.2e} L",
                v + 1,
                -clear
            ));
        }
        let d = times(sub(add(v1, v2), add(v3, v4)), 1.0 / 3.0);
        let lambda = norm(d) * 3f64.sqrt() / edge;
        opening = opening.max(lambda);
        if lambda > sigma + 1e-4 || past {
            faults.push(format!(
                "the hinge at vertex {} is open to {lambda:.5}",
                v + 1
            ));
        }
    }
    if irregular > 0 {
        faults.push(format!(
            "{irregular} seam hinges do not turn by a multiple of 120°"
        ));
    }

    // One piece, nobody loose.
    let mut adjacent = vec![vec![]; tri.len()];
    for h in &hinges {
        adjacent[h.1].push(h.3);
        adjacent[h.3].push(h.1);
    }
    let loose = adjacent.iter().filter(|n| n.len() < 2).count();
    if loose > 0 {
        faults.push(format!("{loose} triangles hang by fewer than two hinges"));
    }
    let mut seen = vec![false; tri.len()];
    let mut stack = vec![0];
    while let Some(t) = stack.pop() {
        if !std::mem::replace(&mut seen[t], true) {
            stack.extend(&adjacent[t]);
        }
    }
    if seen.contains(&false) {
        faults.push("more than one piece".into());
    }

    // In space: no two triangles cross.
    let space: Vec<[P3; 3]> = tri.iter().map(|f| f.map(|v| link.v[v])).collect();
    let centres: Vec<P3> = space
        .iter()
        .map(|t| times(add(add(t[0], t[1]), t[2]), 1.0 / 3.0))
        .collect();
    let crossing = near_pairs(&centres, 1.155 * edge)
        .into_iter()
        .filter(|&(i, j)| !tri[i].iter().any(|v| tri[j].contains(v)))
        .filter(|&(i, j)| {
            pierces(&space[i], &space[j], 1e-4 * edge) || pierces(&space[j], &space[i], 1e-4 * edge)
        })
        .count();
    if crossing > 0 {
        faults.push(format!("{crossing} pairs of triangles cross in space"));
    }

    // Against the surface.
    let faces: Vec<[P3; 3]> = target
        .f
        .iter()
        .flat_map(|f| (1..f.len() - 1).map(|k| [f[0].0, f[k].0, f[k + 1].0].map(|v| target.v[v])))
        .collect();
    let soup = Soup::new(faces.iter().copied());
    let distance = link.v.iter().map(|p| soup.distance(*p)).fold(0.0, f64::max) / edge;
    let linkage_soup = Soup::new(space.iter().copied());
    let (mut near, mut total) = (0.0, 0.0);
    for t in &faces {
        let area = 0.5 * norm(cross(sub(t[1], t[0]), sub(t[2], t[0])));
        total += area;
        if linkage_soup.distance(times(add(add(t[0], t[1]), t[2]), 1.0 / 3.0)) <= edge {
            near += area;
        }
    }
    Findings {
        triangles: tri.len(),
        hinges: hinges.len(),
        edge_error,
        distance,
        opening,
        coverage: near / total,
        seam_hinges,
        irregular_seam_turns: irregular,
        faults,
    }
}

/// The strict thresholds: edges 1e-6, distance 0.1 L, coverage 0.9, and no fault.
pub fn strict(findings: &Findings) -> Result<(), String> {
    let mut reasons = findings.faults.clone();
    if findings.edge_error > 1e-6 {
        reasons.push(format!("edge error {:e}", findings.edge_error));
    }
    if findings.distance > 0.1 {
        reasons.push(format!("distance {} L", findings.distance));
    }
    if findings.coverage < 0.9 {
        reasons.push(format!("coverage {}", findings.coverage));
    }
    if reasons.is_empty() {
        Ok(())
    } else {
        Err(reasons.join("; "))
    }
}
