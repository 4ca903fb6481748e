//! Sheet → toolpath → G-code → verdict, over random linkages; and every kind of damage is found.

use std::collections::BTreeSet;

use kurbo::Vec2;
use proptest::prelude::*;

use super::{
    Declared, Finding, GcodeError, Rule, Slack, TOLERANCE_MM, compare_burnt, passes_of, read,
    verify, write,
};
use crate::base::curve::Curve;
use crate::base::ids::Id;
use crate::linkage::{Handedness, Linkage, TriangleId};
use crate::machine::{self, Machine};
use crate::material;
use crate::material::PassOrder;
use crate::pattern::{
    Contour, Label, Mark, MarkKind, Sheet, SheetOptions, Tip, placed, read_svg, svg,
};
use crate::toolpath::{CornerSlowdown, CutOptions, Role, Toolpath, plan};

/// The largest edge-connected part of a hexagon of cells without those of `removed`.
fn patch(handedness: Handedness, removed: &BTreeSet<usize>) -> Linkage {
    patch_of(12.0, handedness, removed)
}

fn patch_of(edge_mm: f64, handedness: Handedness, removed: &BTreeSet<usize>) -> Linkage {
    let mut cells = Linkage::hexagon_cells(3);
    let mut index = 0;
    cells.retain(|_| {
        index += 1;
        !removed.contains(&(index - 1))
    });
    let all = Linkage::patch(edge_mm, handedness, &cells);
    let neighbours = all.neighbours();
    let mut part = vec![usize::MAX; cells.len()];
    let mut sizes = Vec::new();
    for first in 0..cells.len() {
        if part[first] != usize::MAX {
            continue;
        }
        let mut stack = vec![first];
        part[first] = sizes.len();
        let mut size = 0;
        while let Some(t) = stack.pop() {
            size += 1;
            for (other, _) in neighbours[TriangleId::from_index(t)].iter().flatten() {
                if part[other.index()] == usize::MAX {
                    part[other.index()] = sizes.len();
                    stack.push(other.index());
                }
            }
        }
        sizes.push(size);
    }
    let largest = (0..sizes.len()).max_by_key(|p| sizes[*p]).unwrap();
    let kept: Vec<_> = (0..cells.len())
        .filter(|c| part[*c] == largest)
        .map(|c| cells[c])
        .collect();
    Linkage::patch(edge_mm, handedness, &kept)
}

fn job(linkage: &Linkage, passes: u32, mirror: bool) -> (Sheet, String, Machine) {
    let machine = machine::load(machine::DEFAULT).unwrap();
    let material = material::load(material::DEFAULT).unwrap();
    let mut setting = material.cut_for(&machine).unwrap();
    setting.passes = passes;
    let sheet = Sheet::new(
        linkage,
        &SheetOptions::plain(material.hinge_width_mm, setting.kerf_mm),
    )
    .unwrap();
    let (sheet, _) = placed(&sheet, &machine, mirror).unwrap();
    // What the verifier gets is the drawing, not our memory of it.
    let sheet = read_svg(&svg(&sheet)).unwrap();
    let toolpath = plan(
        &sheet,
        &CutOptions::of(&setting, &machine, None),
        [0.0, 0.0],
    )
    .unwrap();
    let text = write(&toolpath, &machine, &material).unwrap();
    (sheet, text, machine)
}

/// A letter on the first triangle.
fn name_mark(sheet: &Sheet) -> Mark {
    let corners = sheet.triangles[0];
    let middle = (corners.iter().fold(Vec2::ZERO, |s, p| s + p.to_vec2()) / 3.0).to_point();
    Mark {
        kind: MarkKind::Name,
        lines: vec![],
        label: Some(Label {
            text: "A1".into(),
            at: middle,
            up: Vec2::new(0.0, 1.0),
            height_mm: 2.0,
        }),
    }
}

/// The same with every shape that a sheet may have, cut in every way.
fn shaped(
    linkage: &Linkage,
    tip: Tip,
    rounded: bool,
    cut: CutOptions,
    tabs: bool,
) -> (Sheet, String, Machine) {
    let machine = machine::load(machine::DEFAULT).unwrap();
    let material = material::load(material::DEFAULT).unwrap();
    let options = SheetOptions {
        tip,
        corner_radius_mm: if rounded { 0.7 } else { 0.0 },
        ..SheetOptions::plain(0.8, 0.2)
    };
    let mut sheet = Sheet::new(linkage, &options).unwrap();
    sheet.marks.push(name_mark(&sheet));
    if tabs {
        sheet.tabs = sheet.even_tabs(3, 0.6);
    }
    let (sheet, _) = placed(&sheet, &machine, false).unwrap();
    let sheet = read_svg(&svg(&sheet)).unwrap();
    let toolpath = plan(&sheet, &cut, [0.0, 0.0]).unwrap();
    let text = write(&toolpath, &machine, &material).unwrap();
    (sheet, text, machine)
}

fn wide_cut(pierce_mm: f64, passes: u32, pass_order: PassOrder) -> CutOptions {
    let machine = machine::load(machine::DEFAULT).unwrap();
    let material = material::load(material::DEFAULT).unwrap();
    CutOptions {
        passes,
        pass_order,
        pierce_mm,
        lead_in_mm: 1.5,
        lead_out_mm: 0.8,
        overcut_mm: 0.9,
        corner: Some(CornerSlowdown {
            angle: 0.4,
            distance_mm: 0.5,
            percent: 60.0,
        }),
        engrave: Some((3000.0, 5.0)),
        ..CutOptions::of(&material.cut_for(&machine).unwrap(), &machine, None)
    }
}

/// A coarse sheet of steel for a plasma table, as its profiles say.
fn torch_job(
    machine_name: &str,
    removed: &BTreeSet<usize>,
    marked: bool,
) -> (Sheet, String, Machine) {
    let machine = machine::load(machine_name).unwrap();
    torch_job_on(machine, removed, marked, None)
}

/// The same with a round hole in the first triangle and the last.
fn torch_job_on(
    machine: Machine,
    removed: &BTreeSet<usize>,
    marked: bool,
    hole_mm: Option<f64>,
) -> (Sheet, String, Machine) {
    let material = material::load("steel-1.5").unwrap();
    let setting = material.cut_for(&machine).unwrap();
    let linkage = patch_of(50.0, Handedness::Right, removed);
    let mut sheet = Sheet::new(
        &linkage,
        &SheetOptions::plain(material.hinge_width_mm, setting.kerf_mm),
    )
    .unwrap();
    if marked {
        sheet.marks.push(name_mark(&sheet));
    }
    if let Some(hole_mm) = hole_mm {
        let middle = |t: &[kurbo::Point; 3]| {
            let sum = t.iter().fold(Vec2::ZERO, |s, p| s + p.to_vec2());
            (sum / 3.0).to_point()
        };
        let mut places = vec![middle(&sheet.triangles[0])];
        if sheet.triangles.len() > 1 {
            places.push(middle(&sheet.triangles[sheet.triangles.len() - 1]));
        }
        // Ahead of the others, so that what comes first in the list need not be cut first.
        sheet.contours.splice(
            0..0,
            places.into_iter().map(|at| Contour {
                line: Curve::circle(at, 0.5 * hole_mm, false),
                outer: false,
            }),
        );
    }
    let (sheet, _) = placed(&sheet, &machine, false).unwrap();
    let sheet = read_svg(&svg(&sheet)).unwrap();
    let marks = material.mark_for(&machine);
    let options = CutOptions::of(&setting, &machine, marks.as_ref());
    let toolpath = plan(&sheet, &options, machine.park_mm()).unwrap();
    let text = write(&toolpath, &machine, &material).unwrap();
    (sheet, text, machine)
}

fn removed() -> impl Strategy<Value = BTreeSet<usize>> {
    proptest::collection::btree_set(0usize..54, 0..20)
}

fn findings(text: &str, machine: &Machine, sheet: &Sheet, passes: u32) -> Vec<Finding> {
    verify(text, machine, Some(sheet), Some(passes))
        .unwrap()
        .findings
}

const TORCHES: [&str; 4] = [
    "plasma-generic",
    "plasma-grbl",
    "plasma-linuxcnc",
    "plasma-qtplasmac",
];

proptest! {
    #![proptest_config(crate::base::cases::cases(48))]

    #[test]
    fn every_torch_cuts_the_sheet(removed in removed(), torch in 0usize..4, marked: bool) {
        let (sheet, text, machine) = torch_job(TORCHES[torch], &removed, torch == 3 && marked);
        let verdict = verify(&text, &machine, Some(&sheet), None).unwrap();
        prop_assert_eq!(&verdict.findings, &[], "{}", text);
        prop_assert_eq!(verdict.ligaments.unwrap().pieces, Some(1));
        let program = super::read_as(&text, super::Dialect::of(&machine));
        let on = text.lines().filter(|l| *l == "M3" || (l.starts_with("M3 ") && !l.contains("$1"))).count();
        prop_assert_eq!(program.pierces.len(), on);
    }

    #[test]
    fn small_holes_are_cut_slowly_and_left_with_the_torch_off_where_qtplasmac_does_it(
        removed in removed(), torch in 0usize..4, hole_mm in 5.0..20.0f64, below_mm in 5.0..20.0f64,
    ) {
        let mut machine = machine::load(TORCHES[torch]).unwrap();
        if let Some(small) = machine.plasma.as_mut().unwrap().small_hole.as_mut() {
            small.below_mm = below_mm;
        }
        let (sheet, text, machine) = torch_job_on(machine, &removed, false, Some(hole_mm));
        let verdict = verify(&text, &machine, Some(&sheet), None).unwrap();
        prop_assert_eq!(&verdict.findings, &[], "{}", text);
        let holes = if sheet.triangles.len() > 1 { 2 } else { 1 };
        let small = if torch == 3 && hole_mm <= below_mm { holes } else { 0 };
        prop_assert_eq!(text.matches("M62 P3\n").count(), small);
        if small == 0 {
            return Ok(());
        }
        // In each the torch burns the whole line once at 60 %, the other way round than a clock, and then goes on
        // without burning for as far as the profile says.
        let program = super::read_as(&text, super::Dialect::of(&machine));
        let (mut off_mm, mut swept) = (0.0, 0.0);
        let line_mm = (hole_mm - sheet.metadata.kerf_mm) * std::f64::consts::PI;
        for (m, next) in program.moves.iter().zip(&program.moves[1..]) {
            let way = m.to - m.from.unwrap_or(m.to);
            if !m.rapid && !m.burns() {
                off_mm += way.hypot();
                prop_assert_eq!(m.feed_mm_per_min, 0.6 * 2600.0);
                if !next.rapid && !next.burns() {
                    swept += way.cross(next.to - m.to).signum();
                }
            }
        }
        let wanted = 4f64.min(0.5 * line_mm) * small as f64;
        prop_assert!((off_mm - wanted).abs() < 0.01, "{off_mm} {wanted}");
        prop_assert!(swept > 0.0);
        // Held off one line earlier, the hole stays closed; never held off or never let go again, it shows as well.
        let lines: Vec<&str> = text.lines().collect();
        let at = lines.iter().position(|l| *l == "M62 P3").unwrap();
        let mut early = lines.clone();
        early.swap(at, at - 1);
        prop_assert!(findings(&early.join("\n"), &machine, &sheet, 1).iter().any(|f| f.rule == Rule::Missing));
        let kept = text.replace("M5 $0\nM68 E3 Q0\nM65 P2\nM65 P3\n", "M5 $0\nM68 E3 Q0\nM65 P2\n");
        prop_assert!(kept != text);
        prop_assert!(findings(&kept, &machine, &sheet, 1).iter().any(|f| f.rule == Rule::Missing));
    }

    #[test]
    fn what_we_write_is_what_the_sheet_wants(removed in removed(), left: bool, mirror: bool, passes in 1u32..4) {
        let handedness = if left { Handedness::Left } else { Handedness::Right };
        let (sheet, text, machine) = job(&patch(handedness, &removed), passes, mirror);
        let verdict = verify(&text, &machine, Some(&sheet), None).unwrap();
        prop_assert_eq!(&verdict.findings, &[]);
        prop_assert_eq!(verdict.passes, Some(passes));
        prop_assert!(findings(&text, &machine, &sheet, passes + 1).iter().any(|f| f.rule == Rule::Missing));
    }

    #[test]
    fn every_shape_and_way_of_cutting_is_proved(
        removed in removed(),
        left: bool,
        shape in 0usize..3,
        rounded: bool,
        tabs: bool,
        pierce in prop_oneof![Just(0.1), Just(0.9)],
        passes in 1u32..3,
        by_sheet: bool,
    ) {
        let handedness = if left { Handedness::Left } else { Handedness::Right };
        let tip = [Tip::Plain, Tip::Round { radius_mm: 0.5 }, Tip::Teardrop { radius_mm: 0.4 }][shape];
        let order = if by_sheet { PassOrder::Sheet } else { PassOrder::Cut };
        let linkage = patch(handedness, &removed);
        let (sheet, text, machine) = shaped(&linkage, tip, rounded, wide_cut(pierce, passes, order), tabs);
        let verdict = verify(&text, &machine, Some(&sheet), None).unwrap();
        prop_assert_eq!(&verdict.findings, &[]);
        let ligaments = verdict.ligaments.unwrap();
        prop_assert_eq!(ligaments.pieces, Some(1));
        if !sheet.slits.is_empty() {
            prop_assert!((ligaments.narrowest_mm - 0.8).abs() < 0.003, "{}", ligaments.narrowest_mm);
        }
        // A pierce hole said to be wider reaches a ligament, or the part beside a lead.
        if pierce > 0.2 {
            let wider = text.replace("; pierce 0.9\n", "; pierce 8\n");
            prop_assert!(findings(&wider, &machine, &sheet, passes).iter().any(|f| f.rule == Rule::Pierce));
        }
        // Without its header's word nothing is burnt beside the drawing.
        let bare: String = text.lines().filter(|l| *l != "; leads").map(|l| format!("{l}\n")).collect();
        let leads = text.contains("; leads\n");
        prop_assert_eq!(findings(&bare, &machine, &sheet, passes).iter().any(|f| f.rule == Rule::Stray), leads);
    }

    #[test]
    fn damage_is_found(removed in removed(), at in any::<prop::sample::Index>(), kind in 0..7, passes in 1u32..3) {
        let (sheet, text, machine) = job(&patch(Handedness::Right, &removed), passes, false);
        prop_assert_eq!(findings(&text, &machine, &sheet, passes), vec![]);
        let mut lines: Vec<String> = text.lines().map(String::from).collect();
        // Motion lines of the slits: there every corner is sharp, so that every line counts.
        let first = lines.iter().position(|l| l.starts_with("; slits")).unwrap();
        let last = lines.iter().position(|l| l.starts_with("; holes") || l.starts_with("; rim")).unwrap();
        let motions: Vec<usize> = (first + 1..last).collect();
        let rapids: Vec<usize> = motions.iter().copied().filter(|l| lines[*l].starts_with("G0")).collect();
        let strokes: Vec<_> = read(&text).moves.into_iter().filter(|m| m.burns() && m.line <= last).collect();
        let line = motions[at.index(motions.len())];
        let rapid = rapids[at.index(rapids.len())];
        match kind {
            0 => { lines.remove(line); }
            1 => {
                let words: Vec<String> = lines[line].split(' ').map(|w| match w.split_at(1) {
                    ("X", v) => format!("X{:.3}", v.parse::<f64>().unwrap() + 0.05),
                    ("Y", v) => format!("Y{:.3}", v.parse::<f64>().unwrap() - 0.05),
                    _ => w.into(),
                }).collect();
                lines[line] = words.join(" ");
            }
            2 => lines[rapid] = lines[rapid].replacen("G0", "G1", 1),
            3 => {
                let m = &strokes[at.index(strokes.len())];
                let from = m.from.unwrap();
                let again = format!("X{:.3} Y{:.3}\nX{:.3} Y{:.3}", from.x, from.y, m.to.x, m.to.y);
                lines.insert(m.line, again);
            }
            4 => {
                let m = &strokes[at.index(strokes.len())];
                lines.insert(m.line, format!("X{:.3} Y{:.3}", m.to.x + 1.3, m.to.y + 0.4));
            }
            5 => lines[rapid].push_str(" S500"),
            _ => { lines.swap(line, if line + 1 < last { line + 1 } else { line - 1 }); }
        }
        let damaged = lines.join("\n");
        if damaged != text.trim_end() {
            prop_assert!(!findings(&damaged, &machine, &sheet, passes).is_empty(), "{}", damaged);
        }
    }
}

#[test]
fn damage_to_the_frame_of_the_job_is_found_by_its_rule() {
    let (sheet, text, machine) = job(&patch(Handedness::Right, &BTreeSet::new()), 1, false);
    for (from, to, rule) in [
        ("G21\n", "", Rule::Modes),
        ("G90\n", "", Rule::Modes),
        ("G21\n", "G20\n", Rule::OffBed),
        ("G90\n", "G91\n", Rule::Missing),
        ("M4 S0", "M3 S0", Rule::ConstantPower),
        ("M4 S0\n", "", Rule::Missing),
        ("M5\n", "", Rule::BeamAtEnd),
        ("F900", "F0", Rule::Feed),
        (" F900", "", Rule::Feed),
        ("F900", "F90000", Rule::Feed),
        ("S300", "S1001", Rule::Power),
        (
            "; slits",
            "; slits ................................................................................",
            Rule::LineTooLong,
        ),
        ("; slits", "; slits?", Rule::Syntax),
        ("M5\n", "G1 X700\nM5\n", Rule::OffBed),
        ("M5\n", "G2 X1 Y1\nM5\n", Rule::Syntax),
        ("G0 X", "X", Rule::Modes),
    ] {
        let damaged = text.replacen(from, to, 1);
        assert_ne!(damaged, text, "the fixture changed: {from}");
        let rules: Vec<Rule> = findings(&damaged, &machine, &sheet, 1)
            .iter()
            .map(|f| f.rule)
            .collect();
        assert!(rules.contains(&rule), "{from:?} → {to:?}: {rules:?}");
    }
}

#[test]
fn a_cut_is_rounded_by_less_than_a_micrometre_and_a_hundredth_is_too_much() {
    let (sheet, text, machine) = job(&patch(Handedness::Right, &BTreeSet::new()), 1, false);
    let moved = |by: f64| {
        let mut sheet = sheet.clone();
        for slit in &mut sheet.slits {
            slit.tail.x += by;
            slit.tip.x += by;
        }
        sheet
    };
    assert_eq!(findings(&text, &machine, &moved(0.009), 1), []);
    assert!(!findings(&text, &machine, &moved(0.012), 1).is_empty());
}

#[test]
fn no_line_is_longer_than_needed_and_modal_words_are_said_once() {
    let (_, text, _) = job(&patch(Handedness::Left, &BTreeSet::new()), 1, false);
    assert_eq!(text.matches('F').count(), 1);
    assert_eq!(
        text.lines()
            .filter(|l| l.contains(" S") && l.starts_with('G'))
            .count(),
        1
    );
    assert!(text.lines().all(|l| l.len() < 60));
    let motion: Vec<&str> = text
        .lines()
        .filter(|l| {
            ["G0 ", "G1 ", "G2 ", "G3 "]
                .iter()
                .any(|g| l.starts_with(g))
        })
        .collect();
    assert!(
        motion.windows(2).all(|w| w[0][..2] != w[1][..2]),
        "how to move is said only where it changes"
    );
}

#[test]
fn a_doubled_job_is_not_taken_for_one_of_two_passes() {
    let (sheet, text, machine) = job(&patch(Handedness::Right, &BTreeSet::new()), 1, false);
    assert_eq!(passes_of(&text), None);
    let start = text.find("; slits").unwrap();
    let end = text.find("M5\n").unwrap();
    let doubled = format!("{}{}{}", &text[..end], &text[start..end], &text[end..]);
    let rules: BTreeSet<Rule> = verify(&doubled, &machine, Some(&sheet), None)
        .unwrap()
        .findings
        .iter()
        .map(|f| f.rule)
        .collect();
    assert_eq!(rules, BTreeSet::from([Rule::Repeated, Rule::Order]));
    let (_, text, _) = job(&patch(Handedness::Right, &BTreeSet::new()), 3, false);
    assert_eq!(passes_of(&text), Some(3));
}

/// Rims pass the slits that begin at them by half a kerf, which here is less than the tolerance.
#[test]
fn a_kerf_below_the_tolerance_confuses_no_slit_with_its_rim() {
    let machine = machine::load(machine::DEFAULT).unwrap();
    let material = material::load(material::DEFAULT).unwrap();
    let linkage = patch_of(4.4, Handedness::Right, &BTreeSet::new());
    for (hinge_mm, kerf_mm) in [(0.02, 0.01), (0.05, 0.015), (0.2, 0.005)] {
        let mut setting = material.cut_for(&machine).unwrap();
        setting.kerf_mm = kerf_mm;
        let sheet = Sheet::new(&linkage, &SheetOptions::plain(hinge_mm, kerf_mm)).unwrap();
        let (sheet, _) = placed(&sheet, &machine, false).unwrap();
        let cut = CutOptions::of(&setting, &machine, None);
        let toolpath = plan(&sheet, &cut, [0.0, 0.0]).unwrap();
        let text = write(&toolpath, &machine, &material).unwrap();
        assert_eq!(findings(&text, &machine, &sheet, 1), []);
        // A rim that does come first is still found.
        let mut early = toolpath.clone();
        early.cuts.rotate_right(1);
        assert_eq!(early.cuts[0].role, Role::Outer);
        let text = write(&early, &machine, &material).unwrap();
        let found = findings(&text, &machine, &sheet, 1);
        let rules: Vec<Rule> = found.iter().map(|f| f.rule).collect();
        assert_eq!(rules, [Rule::Order], "{hinge_mm} {kerf_mm}: {found:?}");
    }
}

/// Every chord of the kerf's rounded corners is shorter than the gap that a controller may leave at the end of a stroke.
#[test]
fn a_missing_corner_of_short_pieces_is_found_as_one_gap() {
    let (sheet, text, _) = job(&patch(Handedness::Right, &BTreeSet::new()), 1, false);
    let all: Vec<[kurbo::Point; 2]> = read(&text)
        .moves
        .into_iter()
        .filter(|m| m.burns())
        .map(|m| [m.from.unwrap(), m.to])
        .collect();
    const GAP_MM: f64 = 0.06;
    assert_eq!(
        compare_burnt(
            &sheet,
            &all,
            1,
            &Declared::default(),
            Slack {
                sideways_mm: TOLERANCE_MM,
                gap_mm: GAP_MM
            }
        )
        .unwrap(),
        []
    );
    let is_short = |p: &[kurbo::Point; 2]| p[0].distance(p[1]) < GAP_MM - 0.02;
    // The longest row of short chords: one rounded corner.
    let mut longest = 0..0;
    let mut first = 0;
    for k in 0..=all.len() {
        if k == all.len() || !is_short(&all[k]) {
            if k - first > longest.len() {
                longest = first..k;
            }
            first = k + 1;
        }
    }
    let length: f64 = all[longest.clone()]
        .iter()
        .map(|p| p[0].distance(p[1]))
        .sum();
    assert!(
        longest.len() >= 3 && length > GAP_MM + 0.03,
        "{longest:?}: {length} mm"
    );
    let without = |row: std::ops::Range<usize>| [&all[..row.start], &all[row.end..]].concat();
    let found = compare_burnt(
        &sheet,
        &without(longest.clone()),
        1,
        &Declared::default(),
        Slack {
            sideways_mm: TOLERANCE_MM,
            gap_mm: GAP_MM,
        },
    )
    .unwrap();
    assert_eq!(
        found.iter().map(|f| f.rule).collect::<Vec<_>>(),
        [Rule::Missing],
        "{found:?}"
    );
    // One piece alone is a gap that is allowed.
    let one = longest.start..longest.start + 1;
    assert_eq!(
        compare_burnt(
            &sheet,
            &without(one),
            1,
            &Declared::default(),
            Slack {
                sideways_mm: TOLERANCE_MM,
                gap_mm: GAP_MM
            }
        )
        .unwrap(),
        []
    );
}

#[test]
fn characters_that_a_controller_may_obey_are_found_in_comments_too() {
    let (sheet, text, machine) = job(&patch(Handedness::Right, &BTreeSet::new()), 1, false);
    for bad in ["; \u{e4}rger", "(\u{20ac})", "; \u{1}", "; hello!"] {
        let damaged = text.replacen("; slits", bad, 1);
        let rules: Vec<Rule> = findings(&damaged, &machine, &sheet, 1)
            .iter()
            .map(|f| f.rule)
            .collect();
        assert_eq!(rules, [Rule::Syntax], "{bad:?}");
    }
}

#[test]
fn the_m3_word_is_found_even_if_nothing_is_burnt() {
    let machine = machine::load(machine::DEFAULT).unwrap();
    let text = "G21\nG90\nG0 X10 Y10\nM3 S500\nM5\n";
    let found = verify(text, &machine, None, None).unwrap().findings;
    assert_eq!(
        found.iter().map(|f| (f.line, f.rule)).collect::<Vec<_>>(),
        [(Some(4), Rule::ConstantPower)]
    );
}

#[test]
fn damage_to_a_torch_job_is_found_by_its_rule() {
    for (torch, from, to, rule) in [
        ("plasma-qtplasmac", "M3 $0 S1\n", "", Rule::Missing),
        ("plasma-qtplasmac", "M5 $0\n", "", Rule::BurnOnRapid),
        (
            "plasma-qtplasmac",
            "M3 $0 S1",
            "M3 $0 S1\nG4 P1",
            Rule::StandingBeam,
        ),
        ("plasma-qtplasmac", "M3 $0 S1", "M3 $1 S1", Rule::Engraving),
        ("plasma-qtplasmac", "M67 E3 Q60", "M67 E3 Q160", Rule::Feed),
        ("plasma-qtplasmac", "M67 E3 Q60", "M62 P3", Rule::Missing),
        ("plasma-qtplasmac", "M67 E3 Q60", "M67 E2 Q60", Rule::Syntax),
        ("plasma-qtplasmac", "M2\n", "", Rule::Syntax),
        ("plasma-qtplasmac", ", fr=2600", "", Rule::Syntax),
        (
            "plasma-qtplasmac",
            "F#<_hal[plasmac.cut-feed-rate]>",
            "F[1+2]",
            Rule::Feed,
        ),
        ("plasma-linuxcnc", "M3 S1\n", "", Rule::Missing),
        (
            "plasma-linuxcnc",
            "G92 Z0\nG0 Z3.8\n",
            "G0 Z-1\n",
            Rule::Height,
        ),
        (
            "plasma-linuxcnc",
            "G1 Z1.5 F2000",
            "G1 Z-1.5 F2000",
            Rule::Height,
        ),
        ("plasma-linuxcnc", "G0 Z20", "G0 Z1", Rule::Height),
        ("plasma-linuxcnc", "G4 P0.2", "G4 P200", Rule::StandingBeam),
        ("plasma-linuxcnc", "G92 Z0", "G92 X0", Rule::Modes),
        ("plasma-generic", "M5\n", "", Rule::BurnOnRapid),
        ("plasma-generic", "(leads)\n", "", Rule::Stray),
        ("plasma-generic", "M3\n", "M3\nM3\n", Rule::StandingBeam),
        ("plasma-generic", "F2600", "F26000", Rule::Feed),
    ] {
        let (sheet, text, machine) = torch_job(torch, &BTreeSet::new(), false);
        let damaged = text.replacen(from, to, 1);
        assert_ne!(damaged, text, "the fixture changed: {from}");
        let rules: Vec<Rule> = findings(&damaged, &machine, &sheet, 1)
            .iter()
            .map(|f| f.rule)
            .collect();
        assert!(
            rules.contains(&rule),
            "{torch}, {from:?} → {to:?}: {rules:?}"
        );
    }
}

#[test]
fn a_material_of_the_tables_own_list_is_selected_by_its_number_and_no_other_passes() {
    let mut machine = machine::load("plasma-qtplasmac").unwrap();
    let numbers = &mut machine.plasma.as_mut().unwrap().material_numbers;
    numbers.insert("steel-1.5".into(), 7);
    numbers.insert("plate-6".into(), 8);
    machine.validate().unwrap();
    let (sheet, text, machine) = torch_job_on(machine, &BTreeSet::new(), false, Some(12.0));
    let select = "\nM190 P7\nM66 P3 L3 Q1\n";
    assert!(text.contains(select) && !text.contains("(o="), "{text}");
    assert!(text.contains("\nF#<_hal[plasmac.cut-feed-rate]>\n"));
    assert_eq!(findings(&text, &machine, &sheet, 1), []);
    // A reader who knows the table's feed sees the one of the job that brings its material.
    let (_, inline, _) = torch_job_on(
        machine::load("plasma-qtplasmac").unwrap(),
        &BTreeSet::new(),
        false,
        Some(12.0),
    );
    let dialect = super::Dialect::of(&machine);
    let feeds = |program: super::Program| -> Vec<f64> {
        let all = program.moves.iter();
        all.filter(|m| m.burns())
            .map(|m| m.feed_mm_per_min)
            .collect()
    };
    let known = feeds(super::read_with(&text, dialect, Some(2600.0)));
    assert_eq!(known, feeds(super::read_as(&inline, dialect)));
    for (to, rule, word) in [
        ("\nM190 P8\nM66 P3 L3 Q1\n", Rule::Material, "`plate-6`"),
        ("\nM190 P9\nM66 P3 L3 Q1\n", Rule::Material, "none"),
        ("\nM190 P7\n", Rule::Feed, "M66 P3 L3 Q1"),
        ("\nM190 P7\nM66 P2 L3 Q1\n", Rule::Feed, "M66 P3 L3 Q1"),
        ("\nM190 P7.5\nM66 P3 L3 Q1\n", Rule::Syntax, "7.5"),
        ("\n", Rule::Feed, "no material was chosen"),
    ] {
        let found = findings(&text.replacen(select, to, 1), &machine, &sheet, 1);
        assert!(
            found
                .iter()
                .any(|f| f.rule == rule && f.text.contains(word)),
            "{to:?}: {found:?}"
        );
    }
    // The number is of no use for a job that was made for another material.
    let other = text.replacen("; material steel-1.5\n", "; material brass-1.5\n", 1);
    let found = findings(&other, &machine, &sheet, 1);
    assert_eq!(
        found.iter().map(|f| f.rule).collect::<Vec<_>>(),
        [Rule::Material]
    );
}

#[test]
fn constant_power_is_warned_of_and_what_a_torch_cannot_do_is_refused() {
    let material = material::load(material::DEFAULT).unwrap();
    let mut machine = machine::load(machine::DEFAULT).unwrap();
    let setting = material.cut_for(&machine).unwrap();
    let sheet = Sheet::new(
        &patch(Handedness::Right, &BTreeSet::new()),
        &SheetOptions::plain(1.0, setting.kerf_mm),
    )
    .unwrap();
    let (mut sheet, _) = placed(&sheet, &machine, false).unwrap();
    sheet.marks.push(name_mark(&sheet));
    let marks = material.mark_for(&machine);
    let mut options = CutOptions::of(&setting, &machine, marks.as_ref());
    options.passes = 2;
    let mut path = plan(&sheet, &options, [0.0, 0.0]).unwrap();
    let dynamic = write(&path, &machine, &material).unwrap();
    assert!(!dynamic.contains("warning") && !dynamic.contains("M3"));
    let laser = machine.laser.as_mut().unwrap();
    laser.power_mode = crate::machine::PowerMode::Constant;
    laser.accept_beam_on_after_lost_link = true;
    machine.validate().unwrap();
    let constant = write(&path, &machine, &material).unwrap();
    assert!(constant.contains("; warning: M3") && constant.contains("\nM3 S0\n"));
    let verdict = verify(&constant, &machine, Some(&sheet), None).unwrap();
    assert_eq!(verdict.findings, []);

    let steel = material::load("steel-1.5").unwrap();
    let torch = machine::load("plasma-linuxcnc").unwrap();
    assert_eq!(
        write(&path, &torch, &steel),
        Err(GcodeError::Passes { passes: 2 })
    );
    path.cuts.iter_mut().for_each(|c| c.passes = 1);
    assert!(matches!(
        write(&path, &torch, &steel),
        Err(GcodeError::Marks { .. })
    ));
    path.cuts.retain(|c| c.role != Role::Mark);
    assert!(write(&path, &torch, &steel).is_ok());
    assert!(matches!(
        write(&path, &torch, &material),
        Err(GcodeError::Cut(_))
    ));
    path.cuts[0].line.vertices[0].at.x = f64::NAN;
    assert!(matches!(
        write(&path, &torch, &steel),
        Err(GcodeError::NotFinite { .. })
    ));
}

/// What stands around the cuts is good by itself: nothing of a profile's own lines is a finding.
#[test]
fn the_frame_of_a_job_is_good_on_every_shipped_machine() {
    for (name, _) in machine::shipped() {
        let machine = machine::load(name).unwrap();
        let material = material::shipped()
            .map(|(m, _)| material::load(m).unwrap())
            .find(|m| m.cut_for(&machine).is_ok())
            .unwrap();
        let empty = Toolpath {
            passes: 1,
            cuts: vec![],
            start: kurbo::Point::ORIGIN,
            pierce_mm: None,
            overcut_mm: 0.0,
        };
        let text = write(&empty, &machine, &material).unwrap();
        let verdict = verify(&text, &machine, None, None).unwrap();
        assert_eq!(verdict.findings, [], "{name}: {text}");
        assert_eq!(super::machine_of(&text), Some(name));
    }
}

/// The job of a right-handed or left-handed patch without some of its cells, pierced wide, cut once.
fn pierced_wide(
    handedness: Handedness,
    removed: &[usize],
    rounded: bool,
    tabs: bool,
) -> (Sheet, Vec<Finding>) {
    let linkage = patch(handedness, &removed.iter().copied().collect());
    let cut = wide_cut(0.9, 1, PassOrder::Cut);
    let (sheet, text, machine) = shaped(&linkage, Tip::Plain, rounded, cut, tabs);
    let found = findings(&text, &machine, &sheet, 1);
    (sheet, found)
}

/// Between two triangles that stand 60° apart a beam on the way to their corner would eat from both.
#[test]
fn a_way_in_from_the_rim_keeps_out_of_a_narrow_notch() {
    for removed in [
        &[4, 14, 23, 27][..],
        &[16, 24, 36, 45],
        &[0, 16, 34, 45, 51],
    ] {
        let (_, found) = pierced_wide(Handedness::Left, removed, true, false);
        assert_eq!(found, [], "{removed:?}");
    }
}

/// Where a hole's corner touches the rim, a tab of the rim leaves the hole as it is: its scrap must fall out, and from
/// such a corner there is no way in.
#[test]
fn a_tab_of_the_rim_is_none_of_the_hole_that_touches_it() {
    for removed in [&[1, 4][..], &[48, 51], &[0, 2, 10, 49, 52], &[1, 4, 12]] {
        let (sheet, found) = pierced_wide(Handedness::Right, removed, false, true);
        assert_eq!(found, [], "{removed:?}");
        let corners = |c: &Contour| -> Vec<_> { c.line.vertices.iter().map(|v| v.at).collect() };
        let holes = sheet.contours.iter().filter(|c| !c.outer);
        assert!(
            holes
                .flat_map(corners)
                .any(|p| sheet.tabs.iter().any(|t| t.at.distance(p) < 0.001)),
            "no tab is where a hole touches the rim: {removed:?}"
        );
    }
}
