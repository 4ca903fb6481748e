//! Judges a job against its drawing, from the two file formats alone: `pattern.svg` says what is wanted (slits as
//! centre lines, contours as the edge that remains, the kerf as an attribute), `job.nc` or a machine's record says
//! what is burnt. By sampling, so that nothing is shared with the program's interval arithmetic.

use std::collections::HashMap;

type P = [f64; 2];

/// What is wanted.
pub struct Drawing {
    /// All of them, those of the flaps last.
    pub slits: Vec<[P; 2]>,
    pub flap_slits: usize,
    pub contours: Vec<Vec<P>>,
    pub triangles: Vec<Vec<P>>,
    pub flaps: Vec<Vec<P>>,
    pub kerf: f64,
    pub hinge: f64,
    pub edge: f64,
    /// Finished radius of the slits' ends where they are widened, else none.
    pub tip: Option<f64>,
    pub corner_radius: f64,
    pub tabs: usize,
}

/// How far a chord may lie from its arc.
const CHORD: f64 = 0.0005;

/// Points of an arc behind its first one: from `a` to `b` around `centre` by `sweep` radians.
fn along_arc(a: P, b: P, centre: P, sweep: f64) -> Vec<P> {
    let (x, y) = (a[0] - centre[0], a[1] - centre[1]);
    let step = 2.0 * (1.0 - CHORD / x.hypot(y).max(CHORD)).acos();
    let count = (sweep.abs() / step.max(1e-3)).ceil().max(1.0);
    let turned = |k: usize| {
        let (sin, cos) = (sweep * k as f64 / count).sin_cos();
        [centre[0] + x * cos - y * sin, centre[1] + x * sin + y * cos]
    };
    (1..count as usize).map(turned).chain([b]).collect()
}

fn attribute(text: &str, name: &str) -> Option<String> {
    let at = text.find(&format!("{name}=\""))? + name.len() + 2;
    Some(text[at..].split('"').next()?.to_owned())
}

/// Points of a path of M, L, A (circles, less than a half turn) and Z with absolute coordinates; Y up.
fn points(d: &str) -> Vec<P> {
    let pair = |w: &str| -> P {
        let (x, y) = w.split_once(',').expect("x,y");
        [x.parse().expect("x"), -y.parse::<f64>().expect("y")]
    };
    let mut found: Vec<P> = vec![];
    let mut words = d.split_whitespace();
    while let Some(word) = words.next() {
        if let Some(radii) = word.strip_prefix('A') {
            let radius: f64 = radii.split(',').next().expect("rx").parse().expect("rx");
            let flags: Vec<&str> = words.by_ref().take(3).collect();
            assert_eq!(flags[..2], ["0", "0"], "a small arc of a circle");
            let b = pair(words.next().expect("an end"));
            let a = *found.last().expect("a start");
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let chord = dx.hypot(dy);
            // Y points down in the file: 1 is clockwise there, and here.
            let left = if flags[2] == "0" { 1.0 } else { -1.0 };
            let away = (radius * radius - 0.25 * chord * chord).max(0.0).sqrt() * left;
            let centre = [
                0.5 * (a[0] + b[0]) - away * dy / chord,
                0.5 * (a[1] + b[1]) + away * dx / chord,
            ];
            let half = (0.5 * chord / radius).min(1.0).asin();
            found.extend(along_arc(a, b, centre, left * 2.0 * half));
        } else if word != "Z" {
            found.push(pair(word.trim_start_matches(['M', 'L'])));
        }
    }
    found
}

pub fn read_drawing(svg: &str) -> Drawing {
    let number = |name: &str| {
        attribute(svg, name)
            .expect(name)
            .parse::<f64>()
            .expect(name)
    };
    let elements = |id: &str| -> Vec<(Option<String>, Vec<P>)> {
        let Some(start) = svg.find(&format!("id=\"{id}\"")) else {
            // Only a sheet with flaps has this group.
            assert_eq!(id, "flaps", "group {id}");
            return vec![];
        };
        let body = svg[start..].split("</g>").next().expect("the group's end");
        body.match_indices("<path")
            .map(|(i, _)| {
                let element = body[i..].split('>').next().expect("an end");
                let d = attribute(element, " d").expect("d");
                (attribute(element, "class"), points(&d))
            })
            .collect()
    };
    let group = |id: &str| -> Vec<Vec<P>> { elements(id).into_iter().map(|e| e.1).collect() };
    let flap = |e: &(Option<String>, Vec<P>)| e.0.as_deref() == Some("flap");
    let (flaps, triangles): (Vec<_>, Vec<_>) = elements("guide").into_iter().partition(flap);
    let flap_slits = group("flaps");
    let lines = group("slits").into_iter().chain(flap_slits.iter().cloned());
    Drawing {
        slits: lines.map(|p| [p[0], p[1]]).collect(),
        flap_slits: flap_slits.len(),
        contours: group("contour"),
        triangles: triangles.into_iter().map(|e| e.1).collect(),
        flaps: flaps.into_iter().map(|e| e.1).collect(),
        kerf: number("data-kagome-kerf-mm"),
        hinge: number("data-kagome-hinge-width-mm"),
        edge: number("data-kagome-edge-mm"),
        tip: attribute(svg, "data-kagome-tip-radius-mm").map(|r| r.parse().expect("a radius")),
        corner_radius: attribute(svg, "data-kagome-corner-radius-mm")
            .map_or(0.0, |r| r.parse().expect("a radius")),
        tabs: svg.matches("<circle").count(),
    }
}

/// What a program burns, as straight pieces, and what it does wrong.
pub struct Burnt {
    /// Cuts: burnt with the program's full power.
    pub pieces: Vec<[P; 2]>,
    /// For each of them the stroke that it belongs to: from beam on to beam off, counted from 0.
    pub strokes: Vec<usize>,
    /// The power of cuts.
    pub power: f64,
    /// Marks: burnt with less.
    pub marks: Vec<[P; 2]>,
    pub faults: Vec<String>,
}

/// Runs the few words that a laser job needs: G0–G3 modal, X, Y, I, J, F, S, M3/M4/M5, G20/G21, G90/G91, M2.
pub fn burn(gcode: &str) -> Burnt {
    let (mut at, mut motion, mut beam, mut power, mut feed) = ([0.0, 0.0], None, false, 0.0, 0.0);
    let (mut mm, mut absolute, mut ended) = (false, false, false);
    let mut faults = vec![];
    // Each with its power and stroke.
    let mut burnt: Vec<([P; 2], f64, usize)> = vec![];
    let (mut stroke, mut burning) = (0, false);
    for (n, raw) in gcode.lines().enumerate() {
        let line = raw.split([';', '(']).next().unwrap_or("").trim();
        if line.len() > 79 {
            faults.push(format!("line {} is too long", n + 1));
        }
        let (mut to, mut moves, mut centre) = (at, false, at);
        for word in line.split_whitespace() {
            let value: f64 = word[1..]
                .parse()
                .unwrap_or_else(|_| panic!("line {}: {word}", n + 1));
            // Tenths, because of G90.1 and the like.
            match (&word[..1], (value * 10.0).round() as i64) {
                ("G", 0 | 10 | 20 | 30) => motion = Some(value as i64),
                ("G", 200) => faults.push("inches".into()),
                ("G", 210) => mm = true,
                ("G", 900) => absolute = true,
                ("G", 901) => faults.push("absolute centres of arcs".into()),
                ("G", 910) => faults.push("incremental".into()),
                ("M", 30) => faults.push(format!("line {}: constant power", n + 1)),
                ("M", 40) => beam = true,
                ("M", 50) => beam = false,
                ("M", 20 | 300) => ended = true,
                ("X", _) => (to[0], moves) = (value, true),
                ("Y", _) => (to[1], moves) = (value, true),
                ("I", _) => centre[0] += value,
                ("J", _) => centre[1] += value,
                ("F", _) => feed = value,
                ("S", _) => power = value,
                _ => {}
            }
        }
        let cutting = matches!(motion, Some(1..=3));
        // A full circle may name no end.
        if !moves && centre == at {
            continue;
        }
        if !mm || !absolute || ended {
            faults.push(format!("line {}: a move outside G21 G90 … M2", n + 1));
        }
        if cutting && feed <= 0.0 {
            faults.push(format!("line {}: no feed", n + 1));
        }
        if cutting && beam && power > 0.0 {
            stroke += usize::from(!burning);
            let way = match motion {
                Some(2 | 3) => {
                    let radii = [at, to].map(|p| (p[0] - centre[0]).hypot(p[1] - centre[1]));
                    if (radii[0] - radii[1]).abs() > 0.005 {
                        faults.push(format!("line {}: an arc with two radii", n + 1));
                    }
                    let angle = |p: P| (p[1] - centre[1]).atan2(p[0] - centre[0]);
                    let turn = std::f64::consts::TAU;
                    let left = (angle(to) - angle(at)).rem_euclid(turn);
                    let sweep = match (motion, to == at) {
                        (Some(3), true) => turn,
                        (Some(3), false) => left,
                        (_, true) => -turn,
                        (_, false) => left - turn,
                    };
                    along_arc(at, to, centre, sweep)
                }
                _ => vec![to],
            };
            let mut from = at;
            for p in way {
                burnt.push(([from, p], power, stroke - 1));
                from = p;
            }
            burning = true;
        } else {
            burning = false;
        }
        at = to;
    }
    if beam || !ended {
        faults.push("the program ends with the beam on, or not at all".into());
    }
    let power = burnt.iter().map(|b| b.1).fold(0.0, f64::max);
    let cuts = || burnt.iter().filter(|b| b.1 == power);
    Burnt {
        pieces: cuts().map(|b| b.0).collect(),
        strokes: cuts().map(|b| b.2).collect(),
        power,
        marks: burnt.iter().filter(|b| b.1 < power).map(|b| b.0).collect(),
        faults,
    }
}

pub(super) fn distance(p: P, s: &[P; 2]) -> f64 {
    let d = [s[1][0] - s[0][0], s[1][1] - s[0][1]];
    let q = [p[0] - s[0][0], p[1] - s[0][1]];
    let l = d[0] * d[0] + d[1] * d[1];
    let t = if l > 0.0 {
        ((q[0] * d[0] + q[1] * d[1]) / l).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (q[0] - t * d[0]).hypot(q[1] - t * d[1])
}

/// Pieces by the cells that they pass.
struct Map<'a> {
    pieces: &'a [[P; 2]],
    cells: HashMap<[i64; 2], Vec<usize>>,
}
const CELL: f64 = 2.0;

impl<'a> Map<'a> {
    fn new(pieces: &'a [[P; 2]]) -> Self {
        let mut cells: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
        for (i, s) in pieces.iter().enumerate() {
            let steps = ((s[1][0] - s[0][0]).hypot(s[1][1] - s[0][1]) / (0.5 * CELL)).ceil() as i64;
            for k in 0..=steps.max(1) {
                let t = k as f64 / steps.max(1) as f64;
                let p = [0, 1].map(|c| ((s[0][c] + t * (s[1][c] - s[0][c])) / CELL).floor() as i64);
                let list = cells.entry(p).or_default();
                if list.last() != Some(&i) {
                    list.push(i);
                }
            }
        }
        Self { pieces, cells }
    }
    fn nearest(&self, p: P) -> f64 {
        let c = [0, 1].map(|k: usize| (p[k] / CELL).floor() as i64);
        let mut best = f64::INFINITY;
        for i in -1..=1 {
            for j in -1..=1 {
                for &s in self.cells.get(&[c[0] + i, c[1] + j]).into_iter().flatten() {
                    best = best.min(distance(p, &self.pieces[s]));
                }
            }
        }
        best
    }
}

fn samples(s: &[P; 2], step: f64) -> impl Iterator<Item = P> + '_ {
    let n = ((s[1][0] - s[0][0]).hypot(s[1][1] - s[0][1]) / step)
        .ceil()
        .max(1.0) as usize;
    (0..=n).map(move |i| [0, 1].map(|k| s[0][k] + (s[1][k] - s[0][k]) * i as f64 / n as f64))
}

/// True if p lies inside the closed loops (even-odd).
pub(super) fn inside(p: P, loops: &[Vec<P>]) -> bool {
    let mut odd = false;
    for l in loops {
        for i in 0..l.len() {
            let (a, b) = (l[i], l[(i + 1) % l.len()]);
            if (a[1] > p[1]) != (b[1] > p[1])
                && p[0] < a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            {
                odd = !odd;
            }
        }
    }
    odd
}

/// Compares what is burnt with what is drawn. `tolerance` sideways; `end_gap` may be missing at the ends of a stroke.
pub fn compare(drawing: &Drawing, burnt: &[[P; 2]], tolerance: f64, end_gap: f64) -> Vec<String> {
    let mut faults = vec![];
    let k = drawing.kerf;
    let burnt_map = Map::new(burnt);
    let rim: Vec<[P; 2]> = drawing
        .contours
        .iter()
        .flat_map(|l| (0..l.len()).map(|i| [l[i], l[(i + 1) % l.len()]]))
        .collect();
    let (slit_map, rim_map) = (Map::new(&drawing.slits), Map::new(&rim));

    // Every slit is burnt from end to end.
    for s in &drawing.slits {
        let length = (s[1][0] - s[0][0]).hypot(s[1][1] - s[0][1]);
        for p in samples(s, 0.1) {
            let to_end = [s[0], s[1]].map(|e| (p[0] - e[0]).hypot(p[1] - e[1]));
            if to_end[0].min(to_end[1]) >= end_gap && burnt_map.nearest(p) > tolerance {
                faults.push(format!(
                    "the slit from {:.3?} ({length:.2} mm) is not burnt at {p:.3?}",
                    s[0]
                ));
                break;
            }
        }
    }
    // Every contour has a cut half a kerf outside: within k of a corner of 60°, within k/2 elsewhere.
    for s in &rim {
        let e = [s[1][0] - s[0][0], s[1][1] - s[0][1]];
        let l = e[0].hypot(e[1]);
        for p in samples(s, 0.2) {
            let out = [p[0] + 0.5 * k * e[1] / l, p[1] - 0.5 * k * e[0] / l];
            let to_end = (p[0] - s[0][0])
                .hypot(p[1] - s[0][1])
                .min((p[0] - s[1][0]).hypot(p[1] - s[1][1]));
            // At a corner that bends inwards the path turns before it gets there.
            if to_end > 2.0 * k + end_gap && burnt_map.nearest(out) > tolerance {
                faults.push(format!("the contour is not cut at {p:.3?}"));
                break;
            }
        }
    }
    // Nothing else is burnt: each burnt point is on a slit, or half a kerf outside a contour.
    for s in burnt {
        for p in samples(s, 0.1) {
            let on_slit = slit_map.nearest(p) <= tolerance;
            let beside =
                (rim_map.nearest(p) - 0.5 * k).abs() <= tolerance && !inside(p, &drawing.contours);
            if !on_slit && !beside {
                faults.push(format!(
                    "burnt at {p:.3?}: {:.3} mm from a slit, {:.3} mm from the contour",
                    slit_map.nearest(p),
                    rim_map.nearest(p)
                ));
                break;
            }
        }
    }
    // Nothing is burnt twice, by length.
    let length = |list: &[[P; 2]]| {
        list.iter()
            .map(|s| (s[1][0] - s[0][0]).hypot(s[1][1] - s[0][1]))
            .sum::<f64>()
    };
    let wanted = length(&drawing.slits) + length(&rim) + 8.0 * k * drawing.contours.len() as f64;
    if length(burnt) > wanted + 0.01 * length(&rim) + 1.0 {
        faults.push(format!(
            "{:.1} mm burnt, {wanted:.1} mm wanted",
            length(burnt)
        ));
    }
    faults
}

/// The narrowest ligament: the least distance between a slit's tip and another cut, less the kerf.
pub fn narrowest_ligament(drawing: &Drawing) -> f64 {
    let mut least = f64::INFINITY;
    for (i, s) in drawing.slits.iter().enumerate() {
        for (j, other) in drawing.slits.iter().enumerate() {
            // Arms of the lattice vertex ahead start near the tip, all others are far.
            if i != j && distance(s[1], other) < 2.0 * drawing.edge {
                least = least.min(distance(s[1], other) - drawing.kerf);
            }
        }
    }
    least
}

/// Area of the sheet by its contours, mm².
pub fn area(drawing: &Drawing) -> f64 {
    drawing.contours.iter().map(|l| loop_area(l)).sum()
}

/// Area inside a closed loop, negative if it runs clockwise.
pub fn loop_area(l: &[P]) -> f64 {
    (0..l.len())
        .map(|i| l[i][0] * l[(i + 1) % l.len()][1] - l[i][1] * l[(i + 1) % l.len()][0])
        .sum::<f64>()
        / 2.0
}

/// What the outlines of the flap triangles say: sides that they share with triangles of the sheet, with each other, and
/// faults: a flap that lies on something or hangs by fewer than two sides.
pub fn judge_flaps(drawing: &Drawing) -> (usize, usize, Vec<String>) {
    let same = 1e-3 * drawing.edge;
    let middle = |t: &[P], k: usize| [0, 1].map(|c| 0.5 * (t[k][c] + t[(k + 1) % 3][c]));
    let centre = |t: &[P]| [0, 1].map(|c| (t[0][c] + t[1][c] + t[2][c]) / 3.0);
    let apart = |p: P, q: P| (p[0] - q[0]).hypot(p[1] - q[1]);
    let (mut to_sheet, mut between, mut faults) = (0, 0, vec![]);
    for (n, flap) in drawing.flaps.iter().enumerate() {
        let here = centre(flap);
        let mut held = 0;
        let own = drawing.flaps.iter().enumerate().filter(|(m, _)| *m != n);
        let all = drawing.triangles.iter().map(|t| (t, true));
        for (other, sheet) in all.chain(own.map(|(_, t)| (t, false))) {
            if apart(here, centre(other)) < drawing.edge / 3f64.sqrt() - same {
                faults.push(format!("the flap at {here:.3?} lies on another triangle"));
            }
            let sides = (0..9).filter(|i| apart(middle(flap, i / 3), middle(other, i % 3)) < same);
            let sides = sides.count();
            held += sides;
            *(if sheet { &mut to_sheet } else { &mut between }) += sides;
        }
        if held < 2 {
            faults.push(format!("the flap at {here:.3?} hangs by {held} sides"));
        }
    }
    (to_sheet, between / 2, faults)
}
