//! Every machine with every material: what fits makes a small job that is verified, and rehearsed where the simulated
//! machine is of its kind; what does not fit gives its refusal. And LinuxCNC's own interpreter, `rs274`, runs every
//! dialect's output: it must accept each line, and its motion must end where our reader says.
//!
//! The tests with `rs274` are ignored unless asked for, because they need the Debian package `linuxcnc-uspace`; `.ci/run`
//! installs it.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test may fail by panic"
)]

use std::process::Command;
use std::sync::{Mutex, PoisonError};

use kagome::base::curve::Curve;
use kagome::base::progress::Silent;
use kagome::control::JobRules;
use kagome::gcode::{Beam, Dialect, read_as, verify, write};
use kagome::linkage::{Handedness, Linkage};
use kagome::machine::{self, Machine};
use kagome::material::{self, Fit, Material};
use kagome::pattern::{Contour, Sheet, SheetOptions, Tip, placed};
use kagome::sim::{Settings, rehearse};
use kagome::toolpath::{CutOptions, plan};

/// A hexagon as coarse as the kerf asks for; if `shaped`, with round tips and rounded corners, so that there are arcs of
/// every kind.
fn job(machine: &Machine, material: &Material, shaped: bool) -> (Sheet, String) {
    let setting = material.cut_for(machine).unwrap();
    let edge_mm = 20.0 * (material.hinge_width_mm + setting.kerf_mm);
    let linkage = Linkage::patch(edge_mm, Handedness::Right, &Linkage::hexagon_cells(2));
    let plain = SheetOptions::plain(material.hinge_width_mm, setting.kerf_mm);
    let round = SheetOptions {
        tip: Tip::Round {
            radius_mm: 0.7 * setting.kerf_mm,
        },
        corner_radius_mm: 0.02 * edge_mm,
        ..plain
    };
    let mut sheet = Sheet::new(&linkage, if shaped { &round } else { &plain }).unwrap();
    if shaped {
        // A small hole.
        let [a, b, c] = sheet.triangles[0];
        let middle = a + ((b - a) + (c - a)) / 3.0;
        sheet.contours.push(Contour {
            line: Curve::circle(middle, 0.1 * edge_mm, false),
            outer: false,
        });
    }
    let (sheet, _) = placed(&sheet, machine, false).unwrap();
    let options = CutOptions::of(&setting, machine, None);
    let path = plan(&sheet, &options, machine.park_mm()).unwrap();
    let text = write(&path, machine, material).unwrap();
    (sheet, text)
}

/// What `rs274` does not know, said in words that it does, and nothing that moves the head changed. GRBL's M4 is a
/// spindle to it; G31 is other controllers' probe; M190, which chooses a material, is a script of QtPlasmaC's and left
/// out; the feed of a material is a number.
fn for_rs274(text: &str, machine: &Machine, feed: f64) -> String {
    let mut lines: Vec<String> = text
        .lines()
        .filter(|line| !line.starts_with("M190 "))
        .map(|line| {
            line.replace("F#<_hal[plasmac.cut-feed-rate]>", &format!("F{feed}"))
                .replace("G31 ", "G38.2 ")
        })
        .collect();
    // A probe must not begin where it ends: the head of rs274 stands at zero.
    if machine.plasma().is_some() {
        lines.insert(0, "G21 G90 G0 Z30".into());
    }
    if machine.controller.is_streamed() && !text.contains("M2\n") {
        lines.push("M2".into());
    }
    lines.join("\n") + "\n"
}

/// Ends of all canonical motion over the sheet, with whether it is fed.
fn canonical(text: &str) -> Vec<([f64; 2], bool)> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("job.ngc");
    std::fs::write(&file, text).unwrap();
    // Two at once share a piece of memory, and crash.
    static ALONE: Mutex<()> = Mutex::new(());
    let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let output = Command::new("rs274")
        .arg("-g")
        .arg(&file)
        .current_dir(folder.path())
        .output()
        .unwrap_or_else(|e| panic!("rs274 cannot be run: {e}; apt-get install linuxcnc-uspace"));
    drop(alone);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    // A program that was refused has no end.
    assert!(
        output.status.success() && said.contains("PROGRAM_END"),
        "rs274 refuses the job ({}): {}\n{}",
        output.status,
        String::from_utf8_lossy(&output.stderr),
        said.lines().next_back().unwrap_or_default()
    );
    said.lines()
        .filter_map(|line| {
            let (name, rest) = line.split_once('(')?;
            let name = name.split_whitespace().next_back()?;
            let numbers: Vec<f64> = rest
                .split([',', ')'])
                .filter_map(|v| v.trim().parse().ok())
                .collect();
            match name {
                "STRAIGHT_TRAVERSE" => Some(([numbers[0], numbers[1]], false)),
                "STRAIGHT_FEED" | "ARC_FEED" => Some(([numbers[0], numbers[1]], true)),
                _ => None,
            }
        })
        .collect()
}

/// Leaves out motion that does not move over the sheet: heights.
fn sideways(moves: impl IntoIterator<Item = ([f64; 2], bool)>) -> Vec<([f64; 2], bool)> {
    let mut kept: Vec<([f64; 2], bool)> = Vec::new();
    let mut at = [0.0; 2];
    for (to, fed) in moves {
        if (to[0] - at[0]).abs() + (to[1] - at[1]).abs() > 1e-6 {
            kept.push((to, fed));
        }
        at = to;
    }
    kept
}

#[test]
fn what_fits_makes_a_verified_job_and_what_does_not_is_refused() {
    let mut compatible = 0;
    for (machine, _) in machine::shipped() {
        let machine = machine::load(machine).unwrap();
        for (material, _) in material::shipped() {
            let material = material::load(material).unwrap();
            let pair = format!("{} on {}", material.name, machine.name);
            if material::classify(&machine, &material) != Fit::Compatible {
                let refusal = material.cut_for(&machine).unwrap_err().to_string();
                for name in [&machine.name, &material.name] {
                    assert!(refusal.contains(name), "{pair}: {refusal}");
                }
                continue;
            }
            compatible += 1;
            let (sheet, text) = job(&machine, &material, false);
            let passes = material.cut_for(&machine).unwrap().passes;
            let verdict = verify(&text, &machine, Some(&sheet), Some(passes)).unwrap();
            assert_eq!(verdict.findings, [], "{pair}");
            assert_eq!(verdict.ligaments.unwrap().pieces, Some(1), "{pair}");
            assert!(
                text.lines().all(|l| l.len() <= machine.line_limit()),
                "{pair}"
            );
            if machine.controller.is_streamed() {
                let rules = JobRules::of(&machine);
                let settings = Settings::of_machine(&machine);
                let run = rehearse(text.as_bytes(), &settings, &rules, &Silent).unwrap();
                assert_eq!(run.summary.rapid_burn_mm, 0.0, "{pair}");
                let standing = run.burns.iter().filter(|b| b.standing());
                let longest_s = standing.map(|b| b.end_s - b.start_s).fold(0.0, f64::max);
                // A torch stands to pierce.
                let pierce_s = material.cut_for(&machine).unwrap().torch;
                let allowed_s = pierce_s.map_or(0.0, |t| t.pierce_delay_s + 1.0);
                assert!(longest_s <= allowed_s, "{pair}: {longest_s} s");
                let burnt = run.summary.burnt_mm / verdict.burnt_mm;
                assert!((0.99..1.001).contains(&burnt), "{pair}: {burnt}");
            }
        }
    }
    assert!(compatible > 20);
}

#[test]
#[ignore = "needs LinuxCNC: .ci/run installs it"]
fn every_dialect_is_accepted_by_rs274_and_ends_where_our_reader_says() {
    let mut dialects = Vec::new();
    // QtPlasmaC once more with a material of the table's own list.
    let all = machine::shipped().map(|(name, _)| (name, false));
    for (name, listed) in all.chain([("plasma-qtplasmac", true)]) {
        let mut machine = machine::load(name).unwrap();
        let material = material::shipped()
            .map(|(m, _)| material::load(m).unwrap())
            .find(|m| m.cut_for(&machine).is_ok())
            .unwrap();
        if listed {
            let numbers = &mut machine.plasma.as_mut().unwrap().material_numbers;
            numbers.insert(material.name.clone(), 3);
            machine.validate().unwrap();
        }
        let feed = material.cut_for(&machine).unwrap().speed_mm_per_min;
        let (_, text) = job(&machine, &material, true);
        let theirs = sideways(canonical(&for_rs274(&text, &machine, feed)));
        let program = read_as(&text, Dialect::of(&machine));
        assert_eq!(program.findings, [], "{name}");
        // Our reader gives an arc as chords of one line: its end is the last.
        let last_of_line = program.moves.iter().enumerate().filter(|(k, m)| {
            program
                .moves
                .get(k + 1)
                .is_none_or(|next| next.line != m.line)
        });
        let ours = sideways(last_of_line.map(|(_, m)| ([m.to.x, m.to.y], !m.rapid)));
        assert_eq!(ours.len(), theirs.len(), "{name}");
        for (a, b) in ours.iter().zip(&theirs) {
            assert!(
                a.1 == b.1 && (a.0[0] - b.0[0]).abs() < 1e-3 && (a.0[1] - b.0[1]).abs() < 1e-3,
                "{name}: {a:?} and {b:?}"
            );
        }
        assert!(program.moves.iter().any(|m| m.beam != Beam::Off), "{name}");
        assert!(
            text.contains("\nG3 ") || text.contains("\nG2 "),
            "{name} has arcs"
        );
        let qtplasmac = Dialect::of(&machine) == Dialect::QtPlasmaC;
        assert_eq!(text.contains("\nM62 P3\n"), qtplasmac, "{name}");
        assert_eq!(text.contains("\nM190 P3\nM66 P3 L3 Q1\n"), listed, "{name}");
        dialects.push(Dialect::of(&machine));
    }
    for dialect in [
        Dialect::Laser,
        Dialect::QtPlasmaC,
        Dialect::LinuxCnc,
        Dialect::Table,
    ] {
        assert!(dialects.contains(&dialect));
    }
}

#[test]
#[ignore = "needs LinuxCNC: .ci/run installs it"]
fn rs274_refuses_what_our_reader_refuses() {
    for body in [
        "G1 X5",
        "F100\nG3 X0 Y2 I0 J1.05",
        "F100\nG1 G0 X1",
        "F100\nG1 X1 X2",
        "F100\nG2 X5 Y5",
        "F100\nG1 X1 (open",
        "M99999",
    ] {
        let text = format!("G21 G90 G17\nG0 X0 Y0\n{body}\nM2\n");
        let machine = machine::load("plasma-linuxcnc").unwrap();
        let verdict = verify(&text, &machine, None, None).unwrap();
        assert!(!verdict.passed(), "{body}");
        let refused = std::panic::catch_unwind(|| canonical(&text)).is_err();
        assert!(refused, "rs274 accepts {body:?}");
    }
}
