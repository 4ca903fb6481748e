//! The order of cuts against the best tours known of fixed sets, and what a price of heat does.

#![expect(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests fail by panicking"
)]

use kagome::toolpath::{Heat, Spacing, Way, order_strokes, spacing};
use kurbo::Point;

struct Set {
    ends: Vec<[Point; 2]>,
    start: Point,
}

/// Stars of a hexagon of lattice points at most `radius` steps of 8 mm from its centre: every third point has three
/// slits of 7.2 mm, in two strokes (tip to tip, and centre to tip) or three. The head starts at the lower left.
fn stars(radius: i32, single: bool) -> Set {
    let (edge, height) = (8.0, 3f64.sqrt() / 2.0);
    let mut ends = Vec::new();
    for j in -radius..=radius {
        for i in -radius..=radius {
            if (i + j).abs() > radius || (i - j) % 3 != 0 {
                continue;
            }
            let centre = Point::new(
                edge * (f64::from(i) + 0.5 * f64::from(j)),
                edge * height * f64::from(j),
            );
            let tip = |k: usize| {
                let arm = ([1.0, -0.5, -0.5][k], [0.0, height, -height][k]);
                Point::new(centre.x + 0.9 * edge * arm.0, centre.y + 0.9 * edge * arm.1)
            };
            if single {
                ends.extend((0..3).map(|k| [centre, tip(k)]));
            } else {
                ends.extend([[tip(0), tip(1)], [centre, tip(2)]]);
            }
        }
    }
    let corner = -f64::from(radius) * edge;
    Set {
        ends,
        start: Point::new(corner, corner),
    }
}

/// Strokes anywhere in a square of 10 √n mm, up to 5 mm long in x and in y, by Knuth's 64-bit linear congruence from
/// 12345: the high 31 bits modulo the micrometres wanted. The head starts at the origin.
fn scattered(n: usize) -> Set {
    let mut state = 12345u64;
    let mut below = |micrometres: u64| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % micrometres) as f64 / 1000.0
    };
    let side = (10_000.0 * (n as f64).sqrt()) as u64;
    let ends = (0..n)
        .map(|_| {
            let p = Point::new(below(side), below(side));
            let d = (below(10_000) - 5.0, below(10_000) - 5.0);
            [p, p + d]
        })
        .collect();
    Set {
        ends,
        start: Point::ZERO,
    }
}

fn set(name: &str) -> Set {
    match name {
        "stars-13" => stars(13, false),
        "stars-27" => stars(27, false),
        "stars-70" => stars(70, false),
        "slits-11" => stars(11, true),
        "scattered-1000" => scattered(1000),
        other => panic!("no set {other}"),
    }
}

fn travel(set: &Set, order: &[(usize, bool)]) -> f64 {
    let mut at = set.start;
    let mut sum = 0.0;
    for &(s, reversed) in order {
        let [a, b] = set.ends[s];
        let (from, to) = if reversed { (b, a) } else { (a, b) };
        sum += at.distance(from);
        at = to;
    }
    sum
}

/// Name, number of strokes and best travel known, mm, of the sets whose size is in a range.
fn records(sizes: std::ops::Range<usize>) -> Vec<(String, usize, f64)> {
    include_str!("data/tours/best.txt")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let mut words = line.split_whitespace();
            let name = words.next().unwrap().to_string();
            let strokes: usize = words.next().unwrap().parse().unwrap();
            (name, strokes, words.next().unwrap().parse().unwrap())
        })
        .filter(|(_, strokes, _)| sizes.contains(strokes))
        .collect()
}

fn compare(sizes: std::ops::Range<usize>) {
    let records = records(sizes);
    assert!(!records.is_empty());
    for (name, strokes, best) in records {
        let set = set(&name);
        assert_eq!(set.ends.len(), strokes);
        let order = order_strokes(&set.ends, set.start, Way::Either, Heat::NONE);
        let ratio = travel(&set, &order) / best;
        println!(
            "{name}: {strokes} strokes, {:+.2} % of the best known",
            (ratio - 1.0) * 100.0
        );
        // Anything much below would mean that the record is none.
        assert!(
            ratio < 1.03 && ratio > 0.99,
            "{name}: {ratio} of the best known"
        );
    }
}

#[test]
fn travel_is_within_three_per_cent_of_the_best_tours_known() {
    compare(0..5000);
}

#[test]
#[ignore = "seconds without optimisation"]
fn travel_through_ten_thousand_strokes_is_within_three_per_cent_of_the_best_tour_known() {
    compare(5000..usize::MAX);
}

#[test]
fn a_price_of_heat_buys_distance_with_travel() {
    let set = stars(13, false);
    let run = |price_mm: f64| -> (f64, Spacing) {
        let heat = Heat {
            price_mm,
            reach_mm: 20.0,
        };
        let order = order_strokes(&set.ends, set.start, Way::Either, heat);
        let cuts: Vec<[Point; 2]> = order.iter().map(|&(s, _)| set.ends[s]).collect();
        (travel(&set, &order), spacing(&cuts).unwrap())
    };
    let runs = [0.0, 10.0, 20.0, 60.0].map(run);
    for (travel, spacing) in runs {
        println!("travel {travel:.0} mm, {spacing:?}");
    }
    for pair in runs.windows(2) {
        let ((less, close), (more, wide)) = (pair[0], pair[1]);
        assert!(wide.mean_mm > close.mean_mm && more > less);
    }
    // A high price keeps nearly all cuts a reach apart, for a few times the travel: a hop of one reach each.
    let (travel, wide) = runs[3];
    assert!(wide.low_mm > 15.0, "{wide:?}");
    assert!(travel < 2.0 * 20.0 * set.ends.len() as f64, "{travel}");
}
