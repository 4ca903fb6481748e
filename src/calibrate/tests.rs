//! Truths of the fit and of its bound.

use super::bound::Demand;
use super::fit::{EXPONENT_SD, FitOptions, Limit, Observation, SPREAD, SPREADS, fit};
use super::geometry::{Geometry, Scale};
use super::refusal::{Measure, Refusal};
use super::scatter::{LAWS, Law};
use super::simulated::{Gauge, SimulatedMaterial};
use super::{Calibration, Candidate};
use crate::base::random::Random;
use crate::material::{Failure, Reading};

fn shape(width: f64) -> Geometry {
    Geometry::plain(width, 0.2, 1.6, 15.0)
}

fn reading(width: f64, hinges: u32, held: f64, tore: Option<f64>) -> Reading {
    Reading {
        strip: None,
        date: "2026-01-31".into(),
        hinge_width_mm: width,
        kerf_mm: 0.2,
        tip_radius_mm: None,
        thickness_mm: 1.6,
        edge_mm: 15.0,
        hinges,
        held,
        tore,
        failure: tore.map(|_| Failure::Torn),
    }
}

fn six() -> Vec<Reading> {
    [
        (0.8, 1.36, 1.38),
        (1.0, 1.30, 1.32),
        (1.25, 1.28, 1.30),
        (0.8, 1.34, 1.36),
        (1.0, 1.34, 1.36),
        (1.25, 1.26, 1.28),
    ]
    .map(|(width, held, tore)| reading(width, 24, held, Some(tore)))
    .to_vec()
}

fn fitted(readings: &[Reading]) -> Calibration {
    fit(readings, &FitOptions::default()).unwrap()
}

fn sigma(c: &Calibration, count: usize, confidence: f64) -> f64 {
    c.bound(&shape(1.0), &Demand::all(count), confidence)
        .unwrap()
        .sigma
}

#[test]
fn the_outcomes_of_a_strip_have_all_the_probability_there_is() {
    let marks = Gauge {
        from: 1.02,
        step: 0.02,
        to: 1.8,
    }
    .marks();
    for law in LAWS {
        for (level, spread) in [(-2.0, 0.05), (-1.5, 0.3), (0.5, 0.1), (-6.0, 0.2)] {
            for noise in [0.0, 0.02] {
                let starts = [1.0].into_iter().chain(marks.iter().copied());
                let ends = marks.iter().copied().map(Some).chain([None]);
                let sum: f64 = starts
                    .zip(ends)
                    .map(|(held, tore)| {
                        Observation::new(shape(1.0), 24.0, held, tore, noise)
                            .likelihood(law, level, spread)
                    })
                    .sum();
                assert!((sum - 1.0).abs() < 1e-12, "{law:?} {level} {spread}: {sum}");
            }
        }
    }
}

#[test]
fn a_strip_of_n_hinges_is_n_strips_of_one() {
    for law in LAWS {
        let held = |count: f64| {
            Observation::new(shape(1.0), count, 1.3, None, 0.0).likelihood(law, -1.0, 0.3)
        };
        let one = held(1.0);
        assert!(one > 0.1 && one < 1.0);
        for count in [2, 30] {
            assert!((held(f64::from(count)) / one.powi(count) - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn the_posterior_is_that_of_a_brute_force_simulation() {
    let readings = [
        reading(0.8, 24, 1.34, Some(1.38)),
        reading(1.25, 12, 1.26, Some(1.30)),
        reading(1.0, 24, 1.30, None),
    ];
    let options = FitOptions {
        noise: 0.01,
        ..FitOptions::default()
    };
    let found = fit(&readings, &options).unwrap();
    let demand = Demand::all(300);
    let asked = Scale::of(shape(1.1));
    let predictive = found.at(&shape(1.1)).unwrap();
    // Draws from the prior, weighted by the exact likelihood of readings with drawn noise.
    let step = 0.5 * (SPREAD[1] / SPREAD[0]).ln() / (SPREADS - 1) as f64;
    let (low, high) = (SPREAD[0].ln() - step, SPREAD[1].ln() + step);
    let scales: Vec<(Scale, &Reading)> = readings
        .iter()
        .map(|r| (Scale::of(Geometry::of(r)), r))
        .collect();
    let mean: f64 = readings.iter().map(|r| r.hinge_width_mm.ln()).sum::<f64>() / 3.0;
    let middle = asked.load(1.35);
    for (k, law) in LAWS.into_iter().enumerate() {
        let mut random = Random::new(5);
        let opened = [1.05, 1.1, 1.2, 1.3];
        let (mut total, mut survived) = (0.0, [0.0; 4]);
        for _ in 0..400_000 {
            let spread = random.between(low, high).exp() / found.slope;
            let level = middle + random.between(-1.0, 4.0);
            let exponent = EXPONENT_SD * random.normal();
            let mut weight = 1.0;
            for (scale, r) in &scales {
                let own = level + exponent * (r.hinge_width_mm.ln() - mean);
                let factor = (options.noise * random.normal()).exp();
                let bears = |opening: f64| {
                    let z = (scale.load(opening * factor) - own) / spread;
                    (f64::from(r.hinges) * law.ln_survival(z)).exp()
                };
                weight *= bears(r.held) - r.tore.map_or(0.0, bears);
                if weight <= 0.0 {
                    break;
                }
            }
            if weight <= 0.0 {
                continue;
            }
            total += weight;
            let own = level + exponent * (1.1f64.ln() - mean);
            for (sum, opening) in survived.iter_mut().zip(opened) {
                let z = (asked.load(opening) - own) / spread;
                *sum += weight * (300.0 * law.ln_survival(z)).exp();
            }
        }
        for (sum, opening) in survived.into_iter().zip(opened) {
            let (drawn, nodes) = (sum / total, predictive.survivals(&demand, opening)[k]);
            assert!(
                (drawn - nodes).abs() < 0.015,
                "{law:?} {opening}: {drawn} {nodes}"
            );
        }
    }
}

#[test]
fn more_hinges_and_more_confidence_lower_the_bound() {
    let found = fitted(&six());
    let mut last = 2.0;
    for count in [10, 100, 1000, 10_000] {
        let now = sigma(&found, count, 0.9);
        assert!(now < last && now > 1.0);
        last = now;
    }
    last = 2.0;
    for confidence in [0.5, 0.8, 0.9, 0.95, 0.99] {
        let now = sigma(&found, 500, confidence);
        assert!(now < last);
        last = now;
    }
}

#[test]
fn finer_marks_and_more_strips_that_agree_raise_the_bound() {
    let at = |half: f64, count: usize| {
        let readings = vec![reading(1.0, 24, 1.33 - half, Some(1.33 + half)); count];
        sigma(&fitted(&readings), 500, 0.9)
    };
    assert!(at(0.05, 6) < at(0.025, 6));
    assert!(at(0.025, 6) < at(0.01, 6));
    assert!(at(0.01, 3) < at(0.01, 6));
    assert!(at(0.01, 6) < at(0.01, 12));
    // A gauge that is said to be bad explains part of the differences.
    let told = |noise: f64| {
        let options = FitOptions {
            noise,
            ..FitOptions::default()
        };
        let found = fit(&six(), &options).unwrap();
        LAWS.map(|law| found.spread(law))
    };
    let (bad, good) = (told(0.02), told(0.0));
    assert!(bad[0] < good[0] && bad[1] < good[1], "{bad:?} {good:?}");
}

#[test]
fn openings_below_the_widest_cost_less_and_the_worst_case_is_all_of_them() {
    let found = fitted(&six());
    let widest = sigma(&found, 200, 0.9);
    let mut openings = vec![1.2; 20];
    openings.extend([1.05; 180]);
    let bound = |openings: &[f64]| {
        found
            .bound(&shape(1.0), &Demand::of_openings(openings), 0.9)
            .unwrap()
            .sigma
    };
    let own = bound(&openings);
    assert!(own > widest && own <= sigma(&found, 20, 0.9) + 1e-6);
    assert!((bound(&[1.2; 200]) - widest).abs() < 1e-6);
    // At the bound the posterior's survival is the confidence with the part of the risk that is used.
    let survival = found.survival(&shape(1.0), &[widest; 200]).unwrap();
    assert!((survival - 0.93).abs() < 1e-6, "{survival}");
    let margin = |opening: f64| found.margin(&shape(1.0), &[opening; 200], 0.9).unwrap();
    assert!((margin(1.1) - (widest - 1.1)).abs() < 1e-6 && margin(1.5) < 0.0);
    // What is no opening is no way to a better answer.
    assert!((found.survival(&shape(1.0), &[]).unwrap() - 1.0).abs() < 1e-12);
    assert!(found.survival(&shape(1.0), &[f64::NAN; 200]).unwrap() < 0.01);
    assert_eq!(
        found.bound(&shape(1.0), &Demand::of_openings(&[1.0; 9]), 0.9),
        Err(Refusal::NoHinges)
    );
    assert_eq!(
        found.bound(&shape(1.0), &Demand::all(9), 1.0),
        Err(Refusal::Confidence { confidence: 1.0 })
    );
}

#[test]
fn the_order_of_the_strips_does_not_matter() {
    let mut readings = six();
    let here = sigma(&fitted(&readings), 500, 0.9);
    readings.reverse();
    assert!((sigma(&fitted(&readings), 500, 0.9) - here).abs() < 1e-7);
}

#[test]
fn hopeless_readings_are_refused_with_the_reason() {
    let refused = |readings: &[Reading]| fit(readings, &FitOptions::default()).unwrap_err();
    let good = six();
    assert_eq!(refused(&[]), Refusal::TooFew { strips: 0 });
    assert_eq!(refused(&good[..1]), Refusal::TooFew { strips: 1 });
    let held = [reading(1.0, 24, 1.5, None), reading(1.0, 24, 1.6, None)];
    assert_eq!(
        refused(&held),
        Refusal::NothingTore {
            held: 1.5,
            full: false
        }
    );
    let most = shape(1.0).most_opening();
    let open = [reading(1.0, 24, most, None), reading(1.0, 24, most, None)];
    assert!(matches!(
        refused(&open),
        Refusal::NothingTore { full: true, .. }
    ));
    let at_once = [
        reading(1.0, 24, 1.0, Some(1.1)),
        reading(1.0, 24, 1.0, Some(1.05)),
    ];
    assert_eq!(refused(&at_once), Refusal::AllTore { tore: 1.1 });
    let beyond = [good[0].clone(), reading(1.0, 24, 1.95, Some(1.98))];
    assert!(matches!(refused(&beyond), Refusal::BeyondOpen { .. }));
    let mut thick = good.clone();
    thick[3].thickness_mm = 3.0;
    assert!(matches!(refused(&thick), Refusal::Thicknesses { .. }));
    let mut bad = good.clone();
    bad[2].held = 1.5;
    assert!(matches!(refused(&bad), Refusal::Reading(_)));
    let noise = FitOptions {
        noise: f64::NAN,
        ..FitOptions::default()
    };
    assert!(matches!(fit(&good, &noise), Err(Refusal::Noise { .. })));
    for refusal in [
        refused(&[]),
        refused(&held),
        refused(&open),
        refused(&at_once),
    ] {
        assert!(refusal.to_string().len() > 60, "{refusal}");
    }
}

#[test]
fn the_strip_that_the_others_contradict_is_named() {
    for (held, tore, low) in [(1.02, 1.04, true), (1.70, 1.72, false)] {
        let mut readings = six();
        readings.extend(six());
        readings[4] = reading(1.0, 24, held, Some(tore));
        readings[4].strip = Some("B2".into());
        assert_eq!(
            fit(&readings, &FitOptions::default()).unwrap_err(),
            Refusal::Contradiction {
                strip: "strip B2".into(),
                low
            }
        );
    }
}

#[test]
fn a_question_outside_of_the_strips_is_answered_lower_and_far_outside_refused() {
    let found = fitted(&six());
    let ask = |geometry: Geometry| found.bound(&geometry, &Demand::all(300), 0.9);
    assert!(ask(shape(1.0)).unwrap().cautions.is_empty());
    let near = ask(shape(0.65)).unwrap();
    assert_eq!(near.cautions[0].what, Measure::Width);
    // Narrower hinges are strained less; the step outside takes part of that back.
    let borne = f64::INFINITY;
    let (inside, _) = found
        .blurred(&shape(0.65), 0.0)
        .bound(&Demand::all(300), 0.9, borne);
    assert!(near.sigma < inside);
    let other = |change: &dyn Fn(&mut Geometry)| {
        let mut geometry = shape(1.0);
        change(&mut geometry);
        match ask(geometry) {
            Err(Refusal::Outside { what, .. }) => Some(what),
            _ => None,
        }
    };
    assert_eq!(other(&|g| g.hinge_width_mm = 3.0), Some(Measure::Width));
    assert_eq!(other(&|g| g.thickness_mm = 2.0), Some(Measure::Thickness));
    assert_eq!(other(&|g| g.edge_mm = 40.0), Some(Measure::Edge));
    assert_eq!(other(&|g| g.kerf_mm = 0.5), Some(Measure::Kerf));
    assert_eq!(other(&|g| g.tip_radius_mm = 0.5), Some(Measure::Tip));
    assert_eq!(other(&|g| g.thickness_mm = 1.65), None);
    assert_eq!(other(&|g| g.kerf_mm = 0.19), None);
    assert!(matches!(
        ask(Geometry::plain(1.0, 0.2, 1.6, f64::NAN)),
        Err(Refusal::Unsound { .. })
    ));
}

#[test]
fn what_only_stays_bent_is_a_failure_for_those_who_say_so() {
    let mut readings = six();
    for r in &mut readings[..3] {
        r.failure = Some(Failure::Plastic);
    }
    let of = |limit| {
        let options = FitOptions {
            limit,
            ..FitOptions::default()
        };
        sigma(&fit(&readings, &options).unwrap(), 300, 0.9)
    };
    assert_eq!(of(Limit::Damage), sigma(&fitted(&six()), 300, 0.9));
    // What bent had not torn.
    let mut held = six();
    for r in &mut held[..3] {
        r.held = r.tore.take().unwrap();
        r.failure = None;
    }
    assert_eq!(of(Limit::Tear), sigma(&fitted(&held), 300, 0.9));
    for r in &mut readings {
        r.failure = Some(Failure::Plastic);
    }
    assert!(matches!(
        fit(&readings, &FitOptions::default()),
        Err(Refusal::NothingTore { .. })
    ));
}

#[test]
fn never_more_than_a_strip_bore_and_never_more_than_fully_open() {
    let mut random = Random::new(11);
    for seed in 0..20 {
        let sigma = random.between(1.1, 2.0).min(shape(1.0).most_opening());
        let mut material = SimulatedMaterial::new(shape(1.0), sigma, 0.02, Law::Normal, seed);
        let gauge = Gauge {
            from: 1.02,
            step: 0.02,
            to: 2.0,
        };
        let readings: Vec<Reading> = (0..4)
            .map(|_| material.pull(&shape(1.0), 3, &gauge, "2026-01-31"))
            .collect();
        for r in &readings {
            r.check("sample").unwrap();
        }
        if let Ok(found) = fit(&readings, &FitOptions::default()) {
            let bound = found
                .bound(&shape(1.0), &Demand::all(1), 0.5)
                .unwrap()
                .sigma;
            let most = readings.iter().map(|r| r.held).fold(1.0, f64::max);
            assert!(bound <= most + 1e-9 && bound <= shape(1.0).most_opening());
        }
    }
}

#[test]
fn whatever_was_read_there_is_a_bound_or_a_reason() {
    let mut random = Random::new(21);
    let (mut answered, mut refused) = (0, 0);
    for _ in 0..40 {
        let count = 2 + random.bits() % 6;
        let readings: Vec<Reading> = (0..count)
            .map(|_| {
                let (a, b) = (random.between(0.98, 1.9), random.between(0.98, 1.9));
                let held = a.min(b).max(1.0);
                let tore = (random.unit() < 0.8).then(|| a.max(b).max(held + 0.001));
                let mut r = reading(
                    random.between(0.3, 2.0),
                    1 + (random.bits() % 100) as u32,
                    held,
                    tore,
                );
                r.thickness_mm = random.between(1.5, 1.7);
                r.edge_mm = random.between(8.0, 40.0);
                r
            })
            .collect();
        let asked = Geometry::plain(
            random.between(0.3, 2.0),
            random.between(0.1, 0.4),
            1.6,
            random.between(8.0, 40.0),
        );
        let bound = fit(&readings, &FitOptions::default())
            .and_then(|found| found.bound(&asked, &Demand::all(200), 0.9));
        match bound {
            Ok(bound) => {
                answered += 1;
                assert!(bound.sigma >= 1.0 && bound.sigma <= asked.most_opening());
            }
            Err(refusal) => {
                refused += 1;
                assert!(!refusal.to_string().is_empty());
            }
        }
    }
    assert!(answered > 5 && refused > 5, "{answered} {refused}");
}

#[test]
fn a_simulated_sheet_survives_as_often_as_its_law_says() {
    for law in LAWS {
        let mut material = SimulatedMaterial::new(shape(1.0), 1.4, 0.03, law, 9);
        for between in [0.0, 0.02] {
            material.between = between;
            let demand = Demand::all(50);
            let bound = material.true_bound(&shape(1.1), &demand, 0.8);
            assert!((material.survival(&shape(1.1), &demand, bound) - 0.8).abs() < 1e-6);
            let survived = (0..4000)
                .filter(|_| material.sheet_survives(&shape(1.1), &[bound; 50]))
                .count();
            // Four standard errors of the simulation.
            let share = survived as f64 / 4000.0;
            assert!(
                (share - 0.8).abs() < 4.0 * (0.16f64 / 4000.0).sqrt(),
                "{law:?}: {share}"
            );
        }
        // Half of single hinges bear σ.
        material.between = 0.0;
        let half = material.survival(&shape(1.0), &Demand::all(1), 1.4);
        assert!((half - 0.5).abs() < 1e-3, "{half}");
    }
}

#[test]
fn the_next_strip_raises_the_bound_and_is_the_one_that_tells_most() {
    let found = fitted(&six()[..3]);
    let candidates = [1, 48].map(|hinges| Candidate {
        geometry: shape(1.0),
        hinges,
    });
    let demand = Demand::all(500);
    let next = found
        .next_strip(&candidates, &shape(1.0), &demand, 0.9)
        .unwrap();
    // One hinge says next to nothing of the weakest of five hundred.
    assert_eq!(next.candidate, 1);
    assert!(next.then > next.now.unwrap(), "{next:?}");
    let marks = next.gauge.marks();
    assert!(marks.len() > 3 && marks[0] < 1.3, "{marks:?}");
    let far = Geometry::plain(2.2, 0.2, 1.6, 15.0);
    assert!(found.bound(&far, &demand, 0.9).is_err());
    assert!(matches!(
        found.next_strip(&candidates, &far, &demand, 0.9),
        Err(Refusal::Outside { .. })
    ));
    assert!(matches!(
        found.next_strip(&[], &shape(1.0), &demand, 0.9),
        Err(Refusal::TooFew { strips: 3 })
    ));
}
