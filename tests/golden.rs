//! A flat hexagon of six triangles, drawn and written as files that a person can read.
//!
//! When the output changes on purpose, `KAGOME_BLESS=1 cargo test --test golden` writes the files anew; read the
//! difference before it is committed.

#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::path::Path;

use kagome::linkage::{Handedness, Linkage};
use kagome::{gcode, machine, material, pattern, toolpath};

fn compare(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/golden/hexagon")
        .join(name);
    if std::env::var_os("KAGOME_BLESS").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let golden = std::fs::read_to_string(&path).unwrap();
    for (i, (new, old)) in text.lines().zip(golden.lines()).enumerate() {
        assert_eq!(new, old, "{name}, line {}", i + 1);
    }
    assert_eq!(text.lines().count(), golden.lines().count(), "{name}");
}

#[test]
fn the_flat_hexagon_is_drawn_and_cut_as_ever() {
    let machine = machine::load(machine::DEFAULT).unwrap();
    let material = material::load(material::DEFAULT).unwrap();
    let setting = material.cut_for(&machine).unwrap();
    let linkage = Linkage::patch(20.0, Handedness::Right, &Linkage::hexagon_cells(1));
    let sheet = pattern::Sheet::new(
        &linkage,
        &pattern::SheetOptions::plain(material.hinge_width_mm, setting.kerf_mm),
    )
    .unwrap();
    let (sheet, _) = pattern::placed(&sheet, &machine, false).unwrap();
    let park = machine.job.park;
    let path = toolpath::plan(
        &sheet,
        &toolpath::CutOptions::of(&setting, &machine, None),
        [park.x_mm, park.y_mm],
    )
    .unwrap();
    compare("pattern.svg", &pattern::svg(&sheet));
    compare("job.nc", &gcode::write(&path, &machine, &material).unwrap());
}
