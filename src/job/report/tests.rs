//! The page as a whole.

use nalgebra::Point2;

use super::*;
use crate::conformal::{ConeRequest, FlattenOptions, Singularities, Sizing, flatten};
use crate::job::Reason;
use crate::linkage::{Handedness, LinkageOptions, build};

/// A shallow dish of 2 · n² faces: a real layout and a real linkage, small enough for a test.
struct Job {
    surface: Surface,
    layout: Layout,
    built: crate::linkage::Built,
}

fn job() -> Job {
    let n = 14u32;
    let at = |i: u32| f64::from(i) / f64::from(n) * 100.0 - 50.0;
    let positions = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| (i, j)))
        .map(|(i, j)| Point3::new(at(i), at(j), (at(i).powi(2) + at(j).powi(2)) * 0.003))
        .collect();
    let mut faces = Vec::new();
    for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        let v = j * (n + 1) + i;
        faces.push([v, v + 1, v + n + 2]);
        faces.push([v, v + n + 2, v + n + 1]);
    }
    let surface = Surface::new(positions, faces).unwrap();
    let options = FlattenOptions {
        sigma: 2.0,
        sizing: Sizing::Triangles(120.0),
        cone_clearance: 0.7,
    };
    let quiet = crate::base::progress::Silent;
    let flat = flatten(
        &surface,
        &ConeRequest::Given(Singularities::default()),
        &options,
        &quiet,
    )
    .unwrap();
    let options = LinkageOptions {
        edge_mm: flat.edge_mm,
        orientation: 0.0,
        handedness: Handedness::Right,
        remove_at_cone: 0,
        sigma: 2.0,
    };
    let built = build(&surface, &flat.layout, &options, &quiet).unwrap();
    Job {
        surface,
        layout: flat.layout,
        built,
    }
}

const SHEET: &str = "<?xml version=\"1.0\"?>\n<svg width=\"9mm\" viewBox=\"0 0 9 9\" xmlns=\"http://www.w3.org/2000/svg\"><g id=\"slits\"><path d=\"M0,0 L9,9\"/></g></svg>\n";

fn with_page<T>(full: bool, then: impl FnOnce(&Page<'_>) -> T) -> T {
    let job = job();
    let verdict = Verdict {
        pass: full,
        reasons: vec![Reason {
            text: "the <tip> is 1.89 L away".into(),
            at_mm: (!full).then_some([0.0; 3]),
            surface: 0,
        }],
    };
    let strokes = [Stroke {
        role: Role::Cut,
        points: vec![Point2::new(0.0, 0.0), Point2::new(5.0, 5.0)],
    }];
    let sheets = [DrawnSheet {
        svg: SHEET.into(),
        toolpath: strokes.to_vec(),
    }];
    let risks = [HingeRisk {
        hinge: 0,
        point: 0,
        opening: 1.2,
        fold_deg: 3.0,
        strain: 0.1,
        share: 0.5,
    }];
    let pose = Pose {
        name: "dish",
        surface: &job.surface,
        layout: &job.layout,
        positions: &job.built.start,
        distances_in_l: &vec![0.01; job.built.start.len()],
        openings: &vec![1.2; job.built.linkage.hinges.len()],
        risks: &risks,
        margins: None,
    };
    then(&Page {
        title: "dish & \"bowl\" <1>",
        verdict: &verdict,
        summary: &[("sheet".into(), "90 × 80 mm & more".into())],
        warnings: &["σ is an <estimate>".into()],
        cone_opening_mm: 0.0,
        linkage: &job.built.linkage,
        poses: &[pose],
        distance_limit_in_l: 0.1,
        sigma: 2.0,
        sheets: if full { &sheets } else { &[] },
        figures: &serde_json::json!({ "quality": { "edge": "<b>" } }),
    })
}

/// Panics unless every element is closed in the right order.
fn assert_balanced(html: &str) {
    const VOID: [&str; 3] = ["meta", "img", "!DOCTYPE"];
    let mut open = Vec::new();
    for tag in html.split('<').skip(1) {
        let (inside, _) = tag.split_once('>').unwrap();
        let name = inside.split([' ', '/']).find(|s| !s.is_empty()).unwrap();
        if inside.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !inside.ends_with('/') && !inside.starts_with('?') && !VOID.contains(&name) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn a_passed_job_shows_every_section_balanced_and_escaped() {
    let html = with_page(true, html);
    assert_balanced(&html);
    for needed in [
        "<h1>dish &amp; &quot;bowl&quot; &lt;1&gt;</h1>",
        "verdict pass",
        "the &lt;tip&gt; is 1.89 L away",
        "90 × 80 mm &amp; more",
        "σ is an &lt;estimate&gt;",
        "<h2>Stretch</h2>",
        "<h2>The opened sheet</h2>",
        "<h2>Distance from the surface</h2>",
        "<h2>Hinges</h2>",
        "<h2>Hinges at risk</h2>",
        "<td>0.5</td>",
        "<h2>The sheet</h2>",
        "<h2>Order of cutting</h2>",
        "<h2>All figures</h2>",
        "<td>&lt;b&gt;</td>",
        "M0,0 L9,9",
    ] {
        assert!(html.contains(needed), "{needed}");
    }
    assert!(!html.contains("<?xml"));
    assert_eq!(
        html.matches("<img src=\"data:image/png;base64,").count(),
        1 + 3 + 2 + 3 + 3
    );
}

#[test]
fn a_failed_job_has_rings_and_neither_sheet_nor_toolpath() {
    let html = with_page(false, html);
    assert_balanced(&html);
    assert!(html.contains("verdict fail"));
    assert!(!html.contains("<h2>The sheet</h2>") && !html.contains("<h2>Order of cutting</h2>"));
    assert_eq!(html.matches("aria-hidden").count(), 3 + 2 + 3 + 3);
}

#[test]
fn the_page_fetches_nothing_and_runs_nothing() {
    let html = with_page(true, html);
    // The one address is the name of the drawing's language, which nobody looks up.
    let html = html.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    for outside in [
        "http:", "https:", "//", "<script", "<link", "@import", "url(",
    ] {
        let found = html
            .match_indices(outside)
            // Base64 may hold two slashes.
            .filter(|(at, _)| {
                !html[..*at]
                    .rsplit('"')
                    .next()
                    .is_some_and(|s| s.starts_with("data:"))
            })
            .count();
        assert_eq!(found, 0, "{outside}");
    }
}

/// Each of several surfaces has its own pictures and only its own rings.
#[test]
fn every_surface_is_shown_with_its_own_places() {
    let html = with_page(false, |page| {
        let reason = |surface| Reason {
            surface,
            ..page.verdict.reasons[0].clone()
        };
        let verdict = Verdict {
            pass: false,
            reasons: vec![reason(1), reason(1)],
        };
        let second = Pose {
            name: "a <second>",
            ..page.poses[0]
        };
        html(&Page {
            verdict: &verdict,
            poses: &[page.poses[0], second],
            ..*page
        })
    });
    assert_balanced(&html);
    let (first, second) = html.split_once("On a &lt;second&gt;").unwrap();
    assert!(first.contains("On dish"));
    let pictures = |part: &str| part.matches("<img").count();
    assert_eq!(pictures(first), pictures(second));
    // The hinges at risk have rings of their own on both.
    let (first, _) = first.split_once("<h2>Hinges at risk").unwrap();
    let (second, _) = second.split_once("<h2>Hinges at risk").unwrap();
    assert!(!first.contains("<circle cx"), "no ring on the first");
    assert!(second.contains("<circle cx"));
}

#[test]
fn the_same_job_gives_the_same_bytes() {
    assert!(with_page(true, html) == with_page(true, html));
}

#[test]
fn lists_that_are_too_short_leave_things_out_and_do_not_fail() {
    let html = with_page(true, |page| {
        html(&Page {
            poses: &[Pose {
                positions: &page.poses[0].positions[..5],
                distances_in_l: &[],
                openings: &[],
                ..page.poses[0]
            }],
            sheets: &[DrawnSheet {
                svg: "no drawing".into(),
                toolpath: vec![],
            }],
            sigma: f64::NAN,
            ..*page
        })
    });
    assert_balanced(&html);
    assert!(!html.contains("<h2>The sheet</h2>"));
}
