use super::heat::gap_mm;
use super::tour::Random;
use super::*;

fn travel(ends: &[[Point; 2]], order: &[(usize, bool)], start: Point, way: Way) -> f64 {
    let mut at = start;
    let mut sum = 0.0;
    for &(s, reversed) in order {
        let (a, b) = (
            ends[s][usize::from(reversed)],
            ends[s][usize::from(!reversed)],
        );
        sum += at.distance(a);
        at = if way == Way::Back { a } else { b };
    }
    sum
}

/// Travel and heat.
fn price(ends: &[[Point; 2]], order: &[(usize, bool)], start: Point, way: Way, heat: Heat) -> f64 {
    let mut sum = travel(ends, order, start, way);
    if heat.counts() {
        for i in 0..order.len() {
            for k in 1..=LOOKBACK.min(i) {
                sum += heat.between(&ends[order[i - k].0], &ends[order[i].0], k);
            }
        }
    }
    sum
}

fn strokes(n: usize, seed: u64) -> Vec<[Point; 2]> {
    let mut random = Random(seed);
    let mut next = || random.below(100_000) as f64 / 1000.0;
    (0..n)
        .map(|_| {
            let p = Point::new(next(), next());
            [p, p + ((next() - 50.0) / 20.0, (next() - 50.0) / 20.0)]
        })
        .collect()
}

const WAYS: [Way; 3] = [Way::Either, Way::Forwards, Way::Back];

const HEATS: [Heat; 3] = [
    Heat::NONE,
    Heat {
        price_mm: 10.0,
        reach_mm: 15.0,
    },
    Heat {
        price_mm: 80.0,
        reach_mm: 30.0,
    },
];

/// The shortest of all tours, by dynamic programming over sets of strokes (M. Held, R. M. Karp 1962).
fn shortest(ends: &[[Point; 2]], start: Point, way: Way) -> f64 {
    let n = ends.len();
    let entries = if way == Way::Forwards { 1 } else { 2 };
    let exit = |s: usize, k: usize| ends[s][if way == Way::Back { k } else { 1 - k }];
    // best[set][2 · last + end by which it was entered]
    let mut best = vec![vec![f64::INFINITY; 2 * n]; 1 << n];
    for s in 0..n {
        for k in 0..entries {
            best[1 << s][2 * s + k] = start.distance(ends[s][k]);
        }
    }
    for set in 1..1usize << n {
        for last in (0..2 * n).filter(|l| set & (1 << (l / 2)) != 0) {
            let so_far = best[set][last];
            for s in (0..n).filter(|s| set & (1 << s) == 0) {
                for k in 0..entries {
                    let sum = so_far + exit(last / 2, last % 2).distance(ends[s][k]);
                    let other = &mut best[set | 1 << s][2 * s + k];
                    *other = other.min(sum);
                }
            }
        }
    }
    best[(1 << n) - 1]
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn every_stroke_comes_once_and_the_first_tour_is_never_better() {
    for n in [0, 1, 2, 3, 4, 7, 8, 9, 60, 400] {
        for way in WAYS {
            for heat in HEATS {
                let ends = strokes(n, n as u64 + 1);
                let order = order_strokes(&ends, Point::ZERO, way, heat);
                let mut seen: Vec<usize> = order.iter().map(|o| o.0).collect();
                seen.sort_unstable();
                assert_eq!(seen, (0..n).collect::<Vec<_>>());
                assert!(way != Way::Forwards || order.iter().all(|o| !o.1));
                if n > 0 {
                    let first = Tour::new(&ends, Point::ZERO, way, heat).order();
                    let (a, b) = (
                        price(&ends, &order, Point::ZERO, way, heat),
                        price(&ends, &first, Point::ZERO, way, heat),
                    );
                    assert!(a <= b + 1e-6, "{n} {way:?} {heat:?}: {a} {b}");
                }
                let again = order_strokes(&ends, Point::ZERO, way, heat);
                assert_eq!(order, again, "the same again");
            }
        }
    }
}

#[test]
fn small_sets_are_ordered_as_well_as_can_be() {
    for n in [5, 8, 11] {
        let (mut ours, mut best) = (0.0, 0.0);
        for seed in 0..6 {
            let ends = strokes(n, seed * 77 + 5);
            for way in WAYS {
                let order = order_strokes(&ends, Point::ZERO, way, Heat::NONE);
                let (a, b) = (
                    travel(&ends, &order, Point::ZERO, way),
                    shortest(&ends, Point::ZERO, way),
                );
                assert!(a >= b - 1e-9, "shorter than the shortest: {a} {b}");
                ours += a;
                best += b;
            }
        }
        assert!(ours < best * 1.03, "{n}: {ours} against {best}");
    }
}

#[test]
fn strokes_of_one_way_are_ordered_by_where_they_begin_and_where_they_end() {
    for seed in 0..3 {
        let ends = strokes(300, seed);
        let begins: Vec<[Point; 2]> = ends.iter().map(|e| [e[0]; 2]).collect();
        let travel_by = |ends_known: &[[Point; 2]]| {
            let order = order_strokes(ends_known, Point::ZERO, Way::Forwards, Heat::NONE);
            travel(&ends, &order, Point::ZERO, Way::Forwards)
        };
        let (both, first) = (travel_by(&ends), travel_by(&begins));
        assert!(both < first, "{seed}: {both} {first}");
    }
}

#[test]
fn the_gain_that_is_counted_is_the_gain_that_is_made() {
    for way in WAYS {
        for heat in HEATS {
            let ends = strokes(300, 4);
            let mut tour = Tour::new(&ends, Point::ZERO, way, heat);
            let sum = |t: &Tour<'_>| price(&ends, &t.order(), Point::ZERO, way, heat);
            let before = sum(&tour);
            let gained = tour.improve();
            assert!(gained > 0.0);
            assert!(
                (before - gained - sum(&tour)).abs() < 1e-6,
                "{way:?} {heat:?}: {before} {gained} {}",
                sum(&tour)
            );
            let before = sum(&tour);
            tour.kick(500);
            assert!(sum(&tour) < before);
        }
    }
}

#[test]
fn a_price_of_zero_is_the_plain_tour() {
    let ends = strokes(200, 9);
    let plain = order_strokes(&ends, Point::ZERO, Way::Either, Heat::NONE);
    for (price_mm, reach_mm) in [(0.0, 30.0), (30.0, 0.0), (-1.0, 5.0), (f64::NAN, 5.0)] {
        let heat = Heat { price_mm, reach_mm };
        assert_eq!(order_strokes(&ends, Point::ZERO, Way::Either, heat), plain);
    }
}

#[test]
fn strokes_in_one_place_or_of_no_length_are_ordered_too() {
    let ends = vec![[Point::new(3.0, 4.0); 2]; 50];
    for way in WAYS {
        for heat in HEATS {
            let order = order_strokes(&ends, Point::ZERO, way, heat);
            assert_eq!(order.len(), 50);
            assert_eq!(travel(&ends, &order, Point::ZERO, way), 5.0);
        }
    }
}

#[test]
fn places_that_are_no_numbers_leave_the_order_as_given() {
    for bad in [f64::NAN, f64::INFINITY] {
        let mut ends = strokes(20, 3);
        ends[7][1].y = bad;
        let order = order_strokes(&ends, Point::ZERO, Way::Either, Heat::NONE);
        assert_eq!(order, (0..20).map(|s| (s, false)).collect::<Vec<_>>());
    }
}

#[test]
fn the_gap_of_two_cuts_is_that_of_their_nearest_points() {
    let p = Point::new;
    let cut = [p(0.0, 0.0), p(10.0, 0.0)];
    assert_eq!(gap_mm(&cut, &[p(5.0, 3.0), p(5.0, 9.0)]), 3.0);
    assert_eq!(gap_mm(&cut, &[p(5.0, -3.0), p(5.0, 9.0)]), 0.0);
    assert_eq!(gap_mm(&cut, &[p(13.0, 4.0), p(20.0, 4.0)]), 5.0);
    assert_eq!(gap_mm(&cut, &[p(2.0, 7.0); 2]), 7.0);
    assert_eq!(gap_mm(&[p(1.0, 1.0); 2], &[p(4.0, 5.0); 2]), 5.0);
    let three = [
        cut,
        [p(0.0, 8.0), p(10.0, 8.0)],
        [p(0.0, 2.0), p(10.0, 2.0)],
    ];
    let found = spacing(&three).unwrap();
    assert_eq!((found.mean_mm, found.low_mm), (5.0, 2.0));
    assert_eq!(spacing(&three[..1]), None);
}
