//! Three small sheets, drawn and written as files that a person can read: a flat hexagon, a disk that closes to a cone, and
//! a ring with a row of flaps. Pixels say of each that what is written is right, whatever it was before.
//!
//! When the output changes on purpose, `KAGOME_BLESS=1 cargo test --test golden` writes the files anew; read the
//! difference before it is committed.

#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

mod judge;

use std::path::Path;

use judge::{raster, sheet};
use kagome::base::ids::Id;
use kagome::linkage::{Cell, Colour, Flap, Flaps, Handedness, Linkage, SeamSegment, TriangleId};
use kagome::pattern::{MarkOptions, Sheet, SheetOptions};
use kagome::{gcode, machine, material, pattern, toolpath};

fn compare(folder: &str, name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/golden")
        .join(folder)
        .join(name);
    if std::env::var_os("KAGOME_BLESS").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
    }
    let golden = std::fs::read_to_string(&path).unwrap();
    for (i, (new, old)) in text.lines().zip(golden.lines()).enumerate() {
        assert_eq!(new, old, "{folder}/{name}, line {}", i + 1);
    }
    assert_eq!(text.lines().count(), golden.lines().count(), "{name}");
}

/// Draws and cuts a linkage, compares, and judges by pixels.
fn golden(folder: &str, linkage: &Linkage, flaps: &Flaps, tabs: usize) {
    let machine = machine::load(machine::DEFAULT).unwrap();
    let material = material::load(material::DEFAULT).unwrap();
    let setting = material.cut_for(&machine).unwrap();
    let options = SheetOptions::plain(material.hinge_width_mm, setting.kerf_mm);
    let mut sheet: Sheet = Sheet::with_flaps(linkage, flaps, &options).unwrap();
    if linkage.hinges.iter().any(|h| h.seam) {
        sheet.marks = pattern::marks(
            linkage,
            &sheet,
            &MarkOptions {
                name: folder,
                back: false,
            },
        );
    }
    let (mut sheet, _) = pattern::placed(&sheet, &machine, false).unwrap();
    sheet.tabs = sheet.tabs_for(tabs, 0.5).unwrap();
    let marks = material.mark_for(&machine);
    let cut = toolpath::CutOptions::of(&setting, &machine, marks.as_ref());
    let path = toolpath::plan(&sheet, &cut, machine.park_mm()).unwrap();
    let svg = pattern::svg(&sheet);
    let job = gcode::write(&path, &machine, &material).unwrap();
    let proof = gcode::verify(&job, &machine, Some(&sheet), None).unwrap();
    assert!(proof.passed(), "{folder}: {:?}", proof.findings);

    let (drawing, burnt) = (sheet::read_drawing(&svg), sheet::burn(&job));
    assert_eq!(burnt.faults, Vec::<String>::new());
    let tips = raster::tips(&drawing, &burnt.pieces, 0.004);
    assert_eq!(tips.len(), drawing.slits.len());
    let wrong = raster::wrong_widths(&drawing, &tips, 0.02);
    assert_eq!(wrong, Vec::<String>::new(), "{folder}");
    let whole = raster::whole(&drawing, &burnt, 0.04);
    assert_eq!(whole.faults, Vec::<String>::new(), "{folder}");
    assert_eq!(whole.pieces, if tabs > 0 { 1 } else { 2 }, "{folder}");

    compare(folder, "pattern.svg", &svg);
    compare(folder, "job.nc", &job);
}

#[test]
fn the_flat_hexagon_is_drawn_and_cut_as_ever() {
    let linkage = Linkage::patch(20.0, Handedness::Right, &Linkage::hexagon_cells(1));
    golden("hexagon", &linkage, &Flaps::default(), 0);
}

/// Where a cell of [`Linkage::patch`] has its middle, in thirds of lattice steps.
fn middle((i, j, colour): (i32, i32, Colour)) -> (i32, i32) {
    let part = if colour == Colour::Up { 1 } else { 2 };
    (3 * i + part, 3 * j + part)
}

/// Two thirds of a hexagon with its middle left out: laid side on side, the two straight edges make a cone of 240°.
#[test]
fn the_cone_disk_is_drawn_and_cut_as_ever() {
    let mut cells = Linkage::hexagon_cells(3);
    let inner = Linkage::hexagon_cells(1);
    // The wedge between the directions (1, 0) and (−1, 1).
    cells.retain(|&c| {
        let (i, j) = middle(c);
        !(inner.contains(&c) || j > 0 && i + j > 0)
    });
    assert_eq!(cells.len(), 32);
    let linkage = Linkage::patch(16.0, Handedness::Right, &cells);
    golden("cone_disk", &linkage, &Flaps::default(), 0);
}

/// A strip that closes to a ring, with the flaps that double its first column at its last one, held by two tabs.
#[test]
fn the_ring_with_flaps_is_drawn_and_cut_as_ever() {
    let (around, across, edge) = (4, 2, 16.0);
    let mut cells = Vec::new();
    for j in 0..across {
        for i in 0..around {
            cells.extend([(i, j, Colour::Up), (i, j, Colour::Down)]);
        }
    }
    let flat = Linkage::patch(edge, Handedness::Left, &cells);
    let number = |i: i32, j: i32, colour: Colour| -> usize {
        let at = 2 * (j * around + i.rem_euclid(around)) as usize;
        at + usize::from(colour == Colour::Down)
    };
    // The same cells, with the last column beside the first one.
    let beside = flat.neighbours();
    let list: Vec<Cell> = flat
        .triangles
        .ids()
        .map(|t| {
            let triangle = &flat.triangles[t];
            let (i, j, colour) = cells[t.index()];
            let mut neighbours = beside[t].map(|n| n.map(|(u, side)| (u.index(), side)));
            match colour {
                Colour::Up if i == 0 => {
                    neighbours[2] = Some((number(around - 1, j, Colour::Down), 0));
                }
                Colour::Down if i == around - 1 => {
                    neighbours[0] = Some((number(0, j, Colour::Up), 2));
                }
                _ => {}
            }
            Cell {
                colour,
                flat: triangle.flat,
                neighbours,
                trim: None,
            }
        })
        .collect();
    let linkage = Linkage::assemble(edge, Handedness::Left, &list);
    assert_eq!(linkage.hinges.iter().filter(|h| h.seam).count(), 2);
    // Beyond the last column lies the first once more: its upward triangles, and the downward one between them.
    let count = linkage.triangles.len();
    let up = |j: i32| list[number(0, j, Colour::Up)].clone();
    let beyond = |cell: &Cell| {
        cell.flat
            .map(|p| p + nalgebra::Vector2::new(4.0 * edge, 0.0))
    };
    let flap = |cell: Cell, double: usize| Flap {
        cell,
        double: TriangleId::from_index(double),
        segment: 0,
    };
    let row: Vec<Flap> = vec![
        flap(
            Cell {
                flat: beyond(&up(0)),
                neighbours: [
                    None,
                    Some((count + 1, 2)),
                    Some((number(3, 0, Colour::Down), 0)),
                ],
                ..up(0)
            },
            number(0, 0, Colour::Up),
        ),
        flap(
            Cell {
                colour: Colour::Down,
                flat: beyond(&list[number(0, 0, Colour::Down)]),
                neighbours: [None, Some((count + 2, 0)), Some((count, 1))],
                trim: None,
            },
            number(0, 0, Colour::Down),
        ),
        flap(
            Cell {
                flat: beyond(&up(1)),
                neighbours: [
                    Some((count + 1, 1)),
                    None,
                    Some((number(3, 1, Colour::Down), 0)),
                ],
                ..up(1)
            },
            number(0, 1, Colour::Up),
        ),
    ];
    let flaps = Flaps {
        segments: vec![SeamSegment {
            edges: 2,
            doubled: 2,
            row: 3,
            flaps: 3,
        }],
        flaps: row,
    };
    golden("ring_with_flaps", &linkage, &flaps, 2);
}
