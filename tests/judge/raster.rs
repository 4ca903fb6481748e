//! Judges what a job leaves of a sheet by pixels, from `pattern.svg` and `job.nc` alone: every piece that is burnt blackens
//! the pixels within half a kerf of it, and what is left white is the part. Nothing here knows stars, arms or offsets.
//!
//! Two questions: how wide is the material on either side of every slit's tip, in a window of fine pixels; and does the
//! whole sheet stay in one piece while it is cut, in coarser ones, for which the strokes are taken back one by one.

use super::sheet::{Burnt, Drawing, distance, inside, loop_area};

type P = [f64; 2];

/// Where pixels lie: the centre of the one in column 0 of row 0, and their size, millimetres.
#[derive(Clone, Copy)]
struct Frame {
    origin: P,
    pixel: f64,
}

impl Frame {
    fn row(&self, y: f64) -> f64 {
        (y - self.origin[1]) / self.pixel
    }
    fn column(&self, x: f64) -> f64 {
        (x - self.origin[0]) / self.pixel
    }
    fn y(&self, row: i32) -> f64 {
        self.origin[1] + f64::from(row) * self.pixel
    }

    /// The pixels with their centres within `radius` of a segment: `f(row, first column, last column)`.
    fn capsule(&self, s: &[P; 2], radius: f64, rows: (i32, i32), mut f: impl FnMut(i32, i32, i32)) {
        let low = self
            .row(s[0][1].min(s[1][1]) - radius)
            .ceil()
            .max(f64::from(rows.0)) as i32;
        let high = self
            .row(s[0][1].max(s[1][1]) + radius)
            .floor()
            .min(f64::from(rows.1)) as i32;
        let d = [s[1][0] - s[0][0], s[1][1] - s[0][1]];
        let length = d[0].hypot(d[1]);
        for row in low..=high {
            let y = self.y(row);
            let mut span = (f64::INFINITY, f64::NEG_INFINITY);
            let mut add = |from: f64, to: f64| {
                if from <= to {
                    span = (span.0.min(from), span.1.max(to));
                }
            };
            for end in s {
                let half = radius * radius - (y - end[1]) * (y - end[1]);
                if half >= 0.0 {
                    add(end[0] - half.sqrt(), end[0] + half.sqrt());
                }
            }
            if length > 0.0 {
                // Along and across the segment, each between two bounds.
                let (u, dy) = ([d[0] / length, d[1] / length], y - s[0][1]);
                let mut band = (f64::NEG_INFINITY, f64::INFINITY);
                for (slope, offset, least, most) in [
                    (u[0], dy * u[1], 0.0, length),
                    (-u[1], dy * u[0], -radius, radius),
                ] {
                    if slope.abs() > 1e-12 {
                        let [a, b] = [least, most].map(|v| s[0][0] + (v - offset) / slope);
                        band = (band.0.max(a.min(b)), band.1.min(a.max(b)));
                    } else if offset < least || offset > most {
                        band = (1.0, 0.0);
                    }
                }
                add(band.0, band.1);
            }
            let (first, last) = (self.column(span.0).ceil(), self.column(span.1).floor());
            if first <= last {
                f(row, first as i32, last as i32);
            }
        }
    }
}

/// Sets that grow together.
struct Sets(Vec<u32>);

impl Sets {
    fn of(&mut self, mut a: u32) -> u32 {
        while self.0[a as usize] != a {
            let up = self.0[self.0[a as usize] as usize];
            self.0[a as usize] = up;
            a = up;
        }
        a
    }
}

/// The two ligaments at a slit's tip, millimetres; infinite where nothing is burnt within the window.
#[derive(Clone, Copy, Debug)]
pub struct Tip {
    pub at: P,
    /// To the left and to the right of the slit's direction.
    pub widths: [f64; 2],
    /// The slit runs towards the rim or a hole.
    pub rim: bool,
}

/// Measures both ligaments of every slit, in windows of pixels of this size, millimetres.
pub fn tips(drawing: &Drawing, burnt: &[[P; 2]], pixel: f64) -> Vec<Tip> {
    let end = drawing.tip.unwrap_or(0.0).max(0.5 * drawing.kerf);
    let reach = end + drawing.hinge + drawing.kerf + 0.2;
    // Pieces by the squares that they pass.
    let side = 2.0 * reach;
    let mut squares: std::collections::HashMap<[i64; 2], Vec<usize>> = Default::default();
    let square = |p: P| p.map(|v| (v / side).floor() as i64);
    for (n, s) in burnt.iter().enumerate() {
        let steps = ((s[1][0] - s[0][0]).hypot(s[1][1] - s[0][1]) / (0.25 * side)).ceil() as usize;
        for k in 0..=steps.max(1) {
            let t = k as f64 / steps.max(1) as f64;
            let list = squares
                .entry(square([0, 1].map(|c| s[0][c] + t * (s[1][c] - s[0][c]))))
                .or_default();
            if list.last() != Some(&n) {
                list.push(n);
            }
        }
    }
    let rims: Vec<[P; 2]> = drawing
        .contours
        .iter()
        .flat_map(|l| (0..l.len()).map(|i| [l[i], l[(i + 1) % l.len()]]))
        .collect();
    let one = |slit: &[P; 2]| {
        let tip = slit[1];
        let [i, j] = square(tip);
        let mut near: Vec<usize> = (i - 1..=i + 1)
            .flat_map(|i| (j - 1..=j + 1).map(move |j| [i, j]))
            .filter_map(|c| squares.get(&c))
            .flatten()
            .copied()
            .filter(|&n| distance(tip, &burnt[n]) < reach + 0.5 * drawing.kerf)
            .collect();
        near.sort_unstable();
        near.dedup();
        let length = (tip[0] - slit[0][0]).hypot(tip[1] - slit[0][1]);
        let d = [0, 1].map(|c| (tip[c] - slit[0][c]) / length);
        // At a smooth rim a slit may begin on its way: the vertex is told from its tip.
        let neck = (drawing.hinge + 0.5 * drawing.kerf + end) / 0.75f64.sqrt();
        let vertex = [0, 1].map(|c| tip[c] + neck * d[c]);
        let at_rim = drawing.corner_radius + 0.01 * drawing.edge;
        let near: Vec<&[P; 2]> = near.iter().map(|&n| &burnt[n]).collect();
        Tip {
            at: tip,
            widths: window(tip, d, &near, 0.5 * drawing.kerf, reach, pixel),
            rim: rims.iter().any(|s| distance(vertex, s) < at_rim),
        }
    };
    // A slit that ends on the rim has no ligament.
    let runs_out = |slit: &[P; 2]| {
        rims.iter()
            .any(|s| distance(slit[1], s) < 0.5 * drawing.kerf)
    };
    let slits: Vec<[P; 2]> = drawing
        .slits
        .iter()
        .filter(|s| !runs_out(s))
        .copied()
        .collect();
    // Two halves at once: the slow check has thousands of windows.
    let (a, b) = slits.split_at(slits.len() / 2);
    std::thread::scope(|scope| {
        let other = scope.spawn(|| b.iter().map(one).collect::<Vec<_>>());
        let mut all: Vec<Tip> = a.iter().map(one).collect();
        all.extend(other.join().expect("no panic"));
        all
    })
}

/// The least distance from the burnt region at the window's middle to any other one, on the left of `d` and on the right.
fn window(middle: P, d: P, pieces: &[&[P; 2]], radius: f64, reach: f64, pixel: f64) -> [f64; 2] {
    let frame = Frame {
        origin: middle,
        pixel,
    };
    let most = (reach / pixel) as i32;
    let mut rows: Vec<Vec<(i32, i32)>> = vec![vec![]; 2 * most as usize + 1];
    for s in pieces {
        frame.capsule(s, radius, (-most, most), |row, first, last| {
            let half = (f64::from(most).powi(2) - f64::from(row).powi(2)).sqrt() as i32;
            if first.max(-half) <= last.min(half) {
                rows[(row + most) as usize].push((first.max(-half), last.min(half)));
            }
        });
    }
    // Runs, and which of them hang together.
    let mut runs: Vec<(i32, i32, i32)> = vec![];
    let mut starts = vec![];
    for (row, spans) in rows.iter_mut().enumerate() {
        starts.push(runs.len());
        spans.sort_unstable();
        for &(first, last) in spans.iter() {
            match runs[*starts.last().expect("one")..].last_mut() {
                Some(before) if first <= before.2 + 1 => before.2 = before.2.max(last),
                _ => runs.push((row as i32 - most, first, last)),
            }
        }
    }
    starts.push(runs.len());
    let mut sets = Sets((0..runs.len() as u32).collect());
    for row in 1..rows.len() {
        for a in starts[row]..starts[row + 1] {
            for b in starts[row - 1]..starts[row] {
                if runs[a].1 <= runs[b].2 + 1 && runs[b].1 <= runs[a].2 + 1 {
                    let (x, y) = (sets.of(a as u32), sets.of(b as u32));
                    sets.0[x.max(y) as usize] = x.min(y);
                }
            }
        }
    }
    // The slit's own region is the one nearest to its tip: a widened end leaves the middle white.
    let to_middle = |&(row, first, last): &(i32, i32, i32)| {
        let x = if first > 0 { first } else { (-last).max(0) };
        i64::from(row).pow(2) + i64::from(x).pow(2)
    };
    let Some(own) = (0..runs.len()).min_by_key(|&n| to_middle(&runs[n])) else {
        return [f64::INFINITY; 2];
    };
    let own = sets.of(own as u32);
    let mut mine: Vec<(i32, i32, i32)> = vec![];
    // The others by rows, on either side.
    let mut others: [Vec<Vec<(i32, i32)>>; 2] =
        [vec![vec![]; rows.len()], vec![vec![]; rows.len()]];
    for n in 0..runs.len() {
        let (row, first, last) = runs[n];
        if sets.of(n as u32) == own {
            mine.push(runs[n]);
            continue;
        }
        let at = (row + most) as usize;
        // Left of the axis: d × p > 0, that is column < row · dx / dy for dy > 0.
        let cut = f64::from(row) * d[0] / d[1];
        let (below, above) = if d[1].abs() < 1e-9 {
            let left = f64::from(row) * d[0] > 0.0;
            let all = Some((first, last));
            if left { (all, None) } else { (None, all) }
        } else {
            let edge = cut.clamp(-1e6, 1e6).floor() as i32;
            let low = (first <= edge).then_some((first, last.min(edge)));
            let high = (last > edge).then_some((first.max(edge + 1), last));
            if d[1] > 0.0 { (low, high) } else { (high, low) }
        };
        others[0][at].extend(below);
        others[1][at].extend(above);
    }
    others.map(|others| {
        let mut best = i64::MAX;
        for &(row, first, last) in &mine {
            for apart in 0..=2 * most {
                if i64::from(apart).pow(2) >= best {
                    break;
                }
                for there in [row + apart, row - apart] {
                    if there.abs() > most {
                        continue;
                    }
                    for &(from, to) in &others[(there + most) as usize] {
                        let gap = i64::from((from - last).max(first - to).max(0));
                        best = best.min(gap.pow(2) + i64::from(apart).pow(2));
                    }
                }
            }
        }
        if best == i64::MAX {
            f64::INFINITY
        } else {
            (best as f64).sqrt() * pixel
        }
    })
}

/// What is wrong with ligaments: each must be as wide as asked, to the tolerance; towards the rim one may be wider.
pub fn wrong_widths(drawing: &Drawing, tips: &[Tip], tolerance: f64) -> Vec<String> {
    let off = |w: f64| (w - drawing.hinge).abs() > tolerance;
    tips.iter()
        .filter(|t| {
            let [a, b] = t.widths;
            let least = a.min(b);
            if t.rim {
                least < drawing.hinge - tolerance
            } else {
                off(a) || off(b)
            }
        })
        .map(|t| {
            format!(
                "at {:.3?}: {:.3} and {:.3} mm, {} asked for{}",
                t.at,
                t.widths[0],
                t.widths[1],
                drawing.hinge,
                if t.rim { ", at the rim" } else { "" }
            )
        })
        .collect()
}

/// The sheet while it is cut.
pub struct Whole {
    /// Pieces of material when all is done, the stock around the sheet included; what falls out of holes is not counted.
    pub pieces: usize,
    /// Strokes before the first rim.
    pub before_rim: usize,
    pub faults: Vec<String>,
}

/// Cuts the sheet stroke by stroke in pixels of this size, millimetres; up to the first rim the material must hang
/// together. Pieces no larger than what falls out of widened tips and rounded corners are no pieces.
pub fn whole(drawing: &Drawing, burnt: &Burnt, pixel: f64) -> Whole {
    let (k, mut faults) = (drawing.kerf, vec![]);
    let clockwise = |l: &&Vec<P>| loop_area(l) < 0.0;
    let (holes, rims): (Vec<&Vec<P>>, Vec<&Vec<P>>) = drawing.contours.iter().partition(clockwise);
    let strokes = burnt.strokes.last().map_or(0, |n| n + 1);

    // Rim strokes run outside a rim, half a kerf away from it, for most of their length.
    let sides: Vec<[P; 2]> = rims
        .iter()
        .flat_map(|l| (0..l.len()).map(|i| [l[i], l[(i + 1) % l.len()]]))
        .collect();
    let all: Vec<Vec<P>> = rims.iter().map(|l| (*l).clone()).collect();
    let mut shares = vec![(0.0, 0.0); strokes];
    for (s, &stroke) in burnt.pieces.iter().zip(&burnt.strokes) {
        let length = (s[1][0] - s[0][0]).hypot(s[1][1] - s[0][1]);
        let middle = [0, 1].map(|c| 0.5 * (s[0][c] + s[1][c]));
        let near = sides.iter().map(|r| distance(middle, r));
        let away = near.fold(f64::INFINITY, f64::min) - 0.5 * k;
        shares[stroke].0 += length;
        if away.abs() < 0.02 && !inside(middle, &all) {
            shares[stroke].1 += length;
        }
    }
    let rim = |n: usize| shares[n].1 > 0.5 * shares[n].0;
    let before_rim = (0..strokes).find(|&n| rim(n)).unwrap_or(strokes);
    if let Some(late) = (before_rim..strokes).find(|&n| !rim(n)) {
        faults.push(format!("stroke {late} comes after the rim's {before_rim}"));
    }

    // Pixels, with some stock around the sheet.
    let margin = 2.0 + 4.0 * k;
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in drawing.contours.iter().flatten() {
        for c in 0..2 {
            (low[c], high[c]) = (low[c].min(p[c] - margin), high[c].max(p[c] + margin));
        }
    }
    let frame = Frame { origin: low, pixel };
    let [width, height] = [0, 1].map(|c| ((high[c] - low[c]) / pixel) as usize + 1);
    let mut count = vec![0u16; width * height];
    for hole in holes {
        for row in 0..height {
            let y = frame.y(row as i32);
            let mut crossings: Vec<f64> = (0..hole.len())
                .map(|i| (hole[i], hole[(i + 1) % hole.len()]))
                .filter(|(a, b)| (a[1] > y) != (b[1] > y))
                .map(|(a, b)| a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
                .collect();
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let [from, to] = [pair[0], pair[1]].map(|x| frame.column(x));
                for column in from.ceil() as usize..=to.floor() as usize {
                    count[row * width + column] = u16::MAX / 2;
                }
            }
        }
    }
    let rows = (0, height as i32 - 1);
    let each = |s: &[P; 2], f: &mut dyn FnMut(usize)| {
        frame.capsule(s, 0.5 * k, rows, |row, first, last| {
            for column in first.max(0)..=last.min(width as i32 - 1) {
                f(row as usize * width + column as usize);
            }
        });
    };
    for s in &burnt.pieces {
        each(s, &mut |n| count[n] += 1);
    }

    let slug = k * k + 4.0 * drawing.tip.unwrap_or(0.0).powi(2) + drawing.corner_radius.powi(2);
    assert!(
        slug < 0.1 * drawing.edge * drawing.edge,
        "slugs like triangles"
    );
    let mut material = Material {
        sets: Sets((0..(width * height) as u32).collect()),
        size: vec![1; width * height],
        least: (slug / (pixel * pixel)) as u32,
        pieces: 0,
    };
    for n in 0..width * height {
        if count[n] == 0 {
            if n % width > 0 && count[n - 1] == 0 {
                material.join(n, n - 1);
            }
            if n >= width && count[n - width] == 0 {
                material.join(n, n - width);
            }
        }
    }
    let pieces = material.pieces;
    // Strokes taken back: what they burnt alone is material again.
    let mut end = burnt.pieces.len();
    for stroke in (0..=strokes).rev() {
        if stroke <= before_rim && material.pieces != 1 && faults.len() < 5 {
            faults.push(format!(
                "in {} pieces after {stroke} of {strokes} strokes, {before_rim} of them before the rim",
                material.pieces
            ));
        }
        while end > 0 && burnt.strokes[end - 1] + 1 == stroke {
            end -= 1;
            each(&burnt.pieces[end], &mut |n| {
                count[n] -= 1;
                if count[n] > 0 {
                    return;
                }
                let (column, row) = (n % width, n / width);
                for (there, m) in [
                    (column > 0, n.wrapping_sub(1)),
                    (column + 1 < width, n + 1),
                    (row > 0, n.wrapping_sub(width)),
                    (row + 1 < height, n + width),
                ] {
                    if there && count[m] == 0 {
                        material.join(n, m);
                    }
                }
            });
        }
    }
    Whole {
        pieces,
        before_rim,
        faults,
    }
}

/// White pixels that hang together side by side.
struct Material {
    sets: Sets,
    size: Vec<u32>,
    /// Pixels from which on a piece counts.
    least: u32,
    pieces: usize,
}

impl Material {
    fn join(&mut self, a: usize, b: usize) {
        let (mut a, mut b) = (self.sets.of(a as u32), self.sets.of(b as u32));
        if a == b {
            return;
        }
        if self.size[a as usize] < self.size[b as usize] {
            (a, b) = (b, a);
        }
        let counts = |n: u32| usize::from(n > self.least);
        let (x, y) = (self.size[a as usize], self.size[b as usize]);
        self.pieces = self.pieces + counts(x + y) - counts(x) - counts(y);
        self.size[a as usize] = x + y;
        self.sets.0[b as usize] = a;
    }
}
