//! From linkage to verified G-code: sheet, order of cuts, text, verdict, for about 10³, 10⁴, 10⁵ and 10⁶ slits. From size
//! to size the time should grow little more than the number of slits does.
//!
//! The largest takes minutes; `cargo bench --bench sheet -- --skip 333 --skip 1000000` leaves it out.

#![expect(
    clippy::expect_used,
    reason = "a bench whose fixture is broken has nothing to measure"
)]

use std::sync::OnceLock;

use kagome::gcode;
use kagome::linkage::{Handedness, Linkage};
use kagome::machine::{self, Machine};
use kagome::material::{self, CutSetting, Material};
use kagome::pattern::{self, Sheet, SheetOptions};
use kagome::toolpath::{self, Heat, Toolpath, Way};
use kurbo::Point;

fn main() {
    divan::main();
}

/// A hexagon of radius r has 9 r² − 3 r slits.
const RADII: [i32; 4] = [11, 34, 105, 333];
const STROKES: [usize; 4] = [1000, 10_000, 100_000, 1_000_000];

/// Seconds for all runs of one size; there is always one.
const MAX_TIME_S: f64 = 10.0;

struct Case {
    linkage: Linkage,
    sheet: Sheet,
    setting: CutSetting,
    toolpath: Toolpath,
    text: String,
    machine: Machine,
    material: Material,
}

/// The case of a radius, made when it is first asked for.
fn case(radius: i32) -> &'static Case {
    static CASES: [OnceLock<Case>; RADII.len()] = [const { OnceLock::new() }; RADII.len()];
    let n = RADII.iter().position(|r| *r == radius);
    CASES[n.expect("one of them")].get_or_init(|| new_case(radius))
}

fn new_case(radius: i32) -> Case {
    let mut machine = machine::load(machine::DEFAULT).expect("shipped");
    machine.bed.width_mm = 10_000.0;
    machine.bed.height_mm = 10_000.0;
    let material = material::load(material::DEFAULT).expect("shipped");
    let setting = material.cut_for(&machine).expect("the defaults fit");
    let linkage = Linkage::patch(7.0, Handedness::Right, &Linkage::hexagon_cells(radius));
    let sheet = sheet(&linkage, &setting);
    let (sheet, _) = pattern::placed(&sheet, &machine, false).expect("a large bed");
    let toolpath = toolpath::plan(
        &sheet,
        &toolpath::CutOptions::of(&setting, &machine, None),
        [0.0, 0.0],
    )
    .expect("wide slots");
    let text = gcode::write(&toolpath, &machine, &material).expect("short lines");
    Case {
        linkage,
        sheet,
        setting,
        toolpath,
        text,
        machine,
        material,
    }
}

fn sheet(linkage: &Linkage, setting: &CutSetting) -> Sheet {
    Sheet::new(linkage, &SheetOptions::plain(1.0, setting.kerf_mm)).expect("wide triangles")
}

#[divan::bench(args = RADII, sample_count = 5, max_time = MAX_TIME_S)]
fn pattern_of(bencher: divan::Bencher<'_, '_>, radius: i32) {
    let c = case(radius);
    bencher.bench(|| sheet(&c.linkage, &c.setting));
}

#[divan::bench(args = RADII, sample_count = 5, max_time = MAX_TIME_S)]
fn svg_of(bencher: divan::Bencher<'_, '_>, radius: i32) {
    let c = case(radius);
    bencher.bench(|| pattern::svg(&c.sheet));
}

#[divan::bench(args = RADII, sample_count = 5, max_time = MAX_TIME_S)]
fn svg_read(bencher: divan::Bencher<'_, '_>, radius: i32) {
    let text = pattern::svg(&case(radius).sheet);
    bencher.bench(|| pattern::read_svg(&text));
}

/// Strokes of two to a star, as many stars as it takes.
fn strokes(n: usize) -> Vec<[Point; 2]> {
    let side = (n as f64 / 2.0).sqrt().ceil() as usize;
    (0..n)
        .map(|k| {
            let star = k / 2;
            let (i, j) = ((star % side) as f64, (star / side) as f64);
            let centre = Point::new(14.0 * i + 7.0 * (j % 2.0), 12.0 * j);
            let arm = |x: f64, y: f64| centre + (7.0 * x, 7.0 * y);
            if k % 2 == 0 {
                [arm(1.0, 0.0), arm(-0.5, 0.866)]
            } else {
                [centre, arm(-0.5, -0.866)]
            }
        })
        .collect()
}

#[divan::bench(args = STROKES, sample_count = 5, max_time = MAX_TIME_S)]
fn order(bencher: divan::Bencher<'_, '_>, n: usize) {
    let ends = strokes(n);
    bencher.bench(|| toolpath::order_strokes(&ends, Point::ZERO, Way::Either, Heat::NONE));
}

#[divan::bench(args = STROKES, sample_count = 5, max_time = MAX_TIME_S)]
fn order_cool(bencher: divan::Bencher<'_, '_>, n: usize) {
    let ends = strokes(n);
    let heat = Heat {
        price_mm: 20.0,
        reach_mm: 20.0,
    };
    bencher.bench(|| toolpath::order_strokes(&ends, Point::ZERO, Way::Either, heat));
}

#[divan::bench(args = RADII, sample_count = 5, max_time = MAX_TIME_S)]
fn toolpath_of(bencher: divan::Bencher<'_, '_>, radius: i32) {
    let c = case(radius);
    bencher.bench(|| {
        toolpath::plan(
            &c.sheet,
            &toolpath::CutOptions::of(&c.setting, &c.machine, None),
            [0.0, 0.0],
        )
    });
}

#[divan::bench(args = RADII, sample_count = 5, max_time = MAX_TIME_S)]
fn gcode_of(bencher: divan::Bencher<'_, '_>, radius: i32) {
    let c = case(radius);
    bencher.bench(|| gcode::write(&c.toolpath, &c.machine, &c.material));
}

#[divan::bench(args = RADII, sample_count = 5, max_time = MAX_TIME_S)]
fn verify(bencher: divan::Bencher<'_, '_>, radius: i32) {
    let c = case(radius);
    bencher.bench(|| gcode::verify(&c.text, &c.machine, Some(&c.sheet), None));
}
