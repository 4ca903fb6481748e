//! The machines in the binary, and machines from files.

use std::path::{Path, PathBuf};

use super::profile::Machine;
use crate::base::catalog::{Catalog, CatalogError};
use crate::base::document::{Document, DocumentError};

/// The machine that is meant when none is named.
pub const DEFAULT: &str = "co2-600x400";

/// Every file of `machines/`, in the order of their names.
const SHIPPED: &[(&str, &str)] = &[
    (
        "co2-600x400",
        include_str!("../../machines/co2-600x400.toml"),
    ),
    (
        "co2-900x600-grblhal",
        include_str!("../../machines/co2-900x600-grblhal.toml"),
    ),
    ("diode-400", include_str!("../../machines/diode-400.toml")),
    (
        "diode-400-fluidnc",
        include_str!("../../machines/diode-400-fluidnc.toml"),
    ),
    ("fibre-300", include_str!("../../machines/fibre-300.toml")),
    (
        "plasma-generic",
        include_str!("../../machines/plasma-generic.toml"),
    ),
    (
        "plasma-grbl",
        include_str!("../../machines/plasma-grbl.toml"),
    ),
    (
        "plasma-linuxcnc",
        include_str!("../../machines/plasma-linuxcnc.toml"),
    ),
    (
        "plasma-qtplasmac",
        include_str!("../../machines/plasma-qtplasmac.toml"),
    ),
];

pub(super) const CATALOG: Catalog = Catalog {
    kind: "machine",
    folder: "machines",
    shipped: SHIPPED,
};

/// The names of the shipped machines with their texts.
pub fn shipped() -> impl ExactSizeIterator<Item = (&'static str, &'static str)> {
    SHIPPED.iter().copied()
}

/// A shipped machine by its name, or one from a file by its path. A shipped name wins; `./NAME` means the file.
///
/// # Errors
/// [`CatalogError`]: unknown name (with the known ones), unreadable file, or a wrong profile with file, line and key.
pub fn load(name_or_path: &str) -> Result<Machine, CatalogError> {
    CATALOG.load(name_or_path, parse)
}

/// What [`load`] takes for a name or a path, where a person has a folder `own` of profiles: `machines/NAME.toml` in it
/// comes before a shipped machine called NAME, and becomes its path.
///
/// # Errors
/// [`CatalogError`] for a profile of one's own that is wrong, and for a name that nobody knows.
pub fn resolve(name_or_path: &str, own: Option<&Path>) -> Result<String, CatalogError> {
    CATALOG.resolve(name_or_path, own, |file, text| Ok(parse(file, text)?.name))
}

/// The machines in a person's own folder, names with files.
///
/// # Errors
/// [`CatalogError::Folder`].
pub fn own_files(own: &Path) -> Result<Vec<(String, PathBuf)>, CatalogError> {
    CATALOG.own_files(own)
}

/// Where a person's own machine of this name belongs; none for what is no name.
pub fn own_file(own: &Path, name: &str) -> Option<PathBuf> {
    CATALOG.own_file(own, name)
}

/// A machine from the text of a profile; `file` is what messages call it.
///
/// # Errors
/// [`DocumentError`] with file, line and key.
pub fn parse(file: &str, text: &str) -> Result<Machine, DocumentError> {
    Document::new(file, text).read(Machine::validate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_embedded_and_bears_its_own_name() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|e| {
                e.unwrap()
                    .path()
                    .file_stem()
                    .unwrap()
                    .to_string_lossy()
                    .into_owned()
            })
            .collect();
        files.sort();
        let embedded: Vec<&str> = shipped().map(|(n, _)| n).collect();
        assert_eq!(files, embedded);
        for (name, _) in shipped() {
            assert_eq!(load(name).unwrap().name, name);
        }
        assert!(load(DEFAULT).is_ok());
    }

    #[test]
    fn every_machine_cuts_some_shipped_material_and_every_material_finds_a_machine() {
        let machines: Vec<Machine> = shipped().map(|(n, _)| load(n).unwrap()).collect();
        let materials: Vec<_> = crate::material::shipped()
            .map(|(n, _)| crate::material::load(n).unwrap())
            .collect();
        let pairs = |f: &dyn Fn(&Machine, &crate::material::Material) -> bool| {
            machines
                .iter()
                .flat_map(|a| materials.iter().map(move |b| (a, b)))
                .filter(|(a, b)| f(a, b))
                .count()
        };
        for machine in &machines {
            assert!(pairs(&|a, b| a.name == machine.name && b.cut_for(a).is_ok()) > 0);
        }
        for material in &materials {
            assert!(
                pairs(&|a, b| b.name == material.name && b.cut_for(a).is_ok()) > 0,
                "no machine cuts {}",
                material.name
            );
        }
        // Copper under a CO₂ beam is the refusal that matters: it reflects.
        assert_eq!(
            pairs(&|a, b| b.name == "copper-0.2" && b.cut_for(a).is_ok()),
            1
        );
    }

    #[test]
    fn each_check_has_a_text_that_fails_it() {
        let (_, good) = shipped().find(|(n, _)| *n == DEFAULT).unwrap();
        for (from, to, key) in [
            ("format = 1", "format = 7", "format"),
            ("name = \"co2-600x400\"", "name = \"\"", "name"),
            ("watts = 60", "watts = nan", "laser.watts"),
            ("s_max = 1000", "s_max = 0", "laser.s_max"),
            ("\"dynamic\"", "\"constant\"", "laser.power_mode"),
            ("width_mm = 600", "width_mm = 1", "bed.width_mm"),
            ("margin_mm = 5", "margin_mm = 300", "bed.margin_mm"),
            ("x = 30000", "x = -1", "motion.rate_mm_per_min.x"),
            ("y = 1000", "y = 0", "motion.acceleration_mm_per_s2.y"),
            (
                "junction_deviation_mm = 0.01",
                "junction_deviation_mm = 2",
                "motion.junction_deviation_mm",
            ),
            ("baud = 115200", "baud = 9", "connection.baud"),
            (
                "receive_buffer_bytes = 128",
                "receive_buffer_bytes = 64",
                "connection.receive_buffer_bytes",
            ),
            (
                "planner_blocks = 15",
                "planner_blocks = 0",
                "connection.planner_blocks",
            ),
            ("x_mm = 0", "x_mm = -3", "job.park.x_mm"),
            ("\"G54\"", "\"G54 ; ready?\"", "job.preamble[0]"),
            ("\"G54\"", "\"G54 (~)\"", "job.preamble[0]"),
            ("\"G54\"", "\"G54 ; f\u{fc}r\"", "job.preamble[0]"),
            ("\"G54\"", "\"\"", "job.preamble[0]"),
            (
                "\"M8\"",
                "\"M8 (0123456789012345678901234567890123456789012345678901234567890123456789012345)\"",
                "laser.air_on",
            ),
            ("controller = \"grbl\"", "controller = \"marlin\"", ""),
            (
                "controller = \"grbl\"",
                "controller = \"linuxcnc\"",
                "laser",
            ),
            (
                "[laser]",
                "[controller_limits]\nline_limit = 80\n[laser]",
                "controller_limits.line_limit",
            ),
            (
                "[laser]",
                "[controller_limits]\nlines_per_s = nan\n[laser]",
                "controller_limits.lines_per_s",
            ),
            ("\"M8\"", "\"M3 S5\"", "laser.air_on"),
            ("\"G54\"", "\"G54\", \"G0 X5\"", "job.preamble[1]"),
            ("\"M2\"", "\"M2\", \"M4\"", "job.postamble[0]"),
            ("homing", "hooming", ""),
        ] {
            assert!(good.contains(from), "the fixture changed: {from}");
            let error = parse("x.toml", &good.replacen(from, to, 1)).unwrap_err();
            assert!(error.line.is_some(), "{from}: {error}");
            assert_eq!(error.key.as_deref().unwrap_or(""), key, "{error}");
        }
        let accepted = good.replacen(
            "\"dynamic\"",
            "\"constant\"\naccept_beam_on_after_lost_link = true",
            1,
        );
        assert!(parse("x.toml", &accepted).is_ok());
    }

    #[test]
    fn each_check_of_a_torch_has_a_text_that_fails_it() {
        for (name, from, to, key) in [
            (
                "plasma-qtplasmac",
                "\"linuxcnc\"",
                "\"generic\"",
                "plasma.height_control",
            ),
            (
                "plasma-qtplasmac",
                "\"qtplasmac\"",
                "\"plain\"",
                "plasma.scribe",
            ),
            (
                "plasma-qtplasmac",
                "max_amps = 45",
                "max_amps = nan",
                "plasma.max_amps",
            ),
            (
                "plasma-qtplasmac",
                "percent = 60",
                "percent = 5",
                "plasma.corner.percent",
            ),
            (
                "plasma-qtplasmac",
                "distance_mm = 3",
                "distance_mm = 0",
                "plasma.corner.distance_mm",
            ),
            (
                "plasma-qtplasmac",
                "angle_deg = 60",
                "angle_deg = 181",
                "plasma.corner.angle_deg",
            ),
            (
                "plasma-qtplasmac",
                "below_mm = 32",
                "below_mm = 0",
                "plasma.small_hole.below_mm",
            ),
            (
                "plasma-qtplasmac",
                "32, percent = 60",
                "32, percent = 101",
                "plasma.small_hole.percent",
            ),
            (
                "plasma-qtplasmac",
                "overcut_mm = 4",
                "overcut_mm = 0",
                "plasma.small_hole.overcut_mm",
            ),
            (
                "plasma-qtplasmac",
                "scribe = true\n",
                "material_numbers = { \"steel-1.5\" = 1000000 }\n",
                "plasma.material_numbers.steel-1.5",
            ),
            (
                "plasma-qtplasmac",
                "scribe = true\n",
                "material_numbers = { \"Steel 1.5\" = 3 }\n",
                "plasma.material_numbers.Steel 1.5",
            ),
            (
                "plasma-linuxcnc",
                "max_amps",
                "small_hole = { below_mm = 32, percent = 60, overcut_mm = 4 }\nmax_amps",
                "plasma.small_hole",
            ),
            (
                "plasma-linuxcnc",
                "max_amps",
                "material_numbers = { \"steel-1.5\" = 3 }\nmax_amps",
                "plasma.material_numbers",
            ),
            (
                "plasma-qtplasmac",
                "[homing]",
                "[connection]\nbaud = 9600\nreceive_buffer_bytes = 300\nplanner_blocks = 9\nreset_on_open = false\n[homing]",
                "connection",
            ),
            (
                "plasma-qtplasmac",
                "controller = \"linuxcnc\"",
                "controller = \"grbl\"",
                "plasma.height_control",
            ),
            (
                "plasma-linuxcnc",
                "\"linuxcnc\"",
                "\"grbl\"",
                "plasma.accept_arc_on_after_lost_link",
            ),
            (
                "plasma-linuxcnc",
                "safe_height_mm = 20\n",
                "",
                "plasma.safe_height_mm",
            ),
            (
                "plasma-linuxcnc",
                "safe_height_mm = 20",
                "safe_height_mm = -1",
                "plasma.safe_height_mm",
            ),
            (
                "plasma-linuxcnc",
                "{pierce_height_mm}",
                "{height}",
                "plasma.template.begin_cut[2]",
            ),
            (
                "plasma-linuxcnc",
                "{pierce_height_mm}",
                "{pierce_height_mm",
                "plasma.template.begin_cut[2]",
            ),
            (
                "plasma-linuxcnc",
                "\"M3 S1\"",
                "\"M7\"",
                "plasma.template.begin_cut",
            ),
            (
                "plasma-linuxcnc",
                "\"M5\"",
                "\"M9\"",
                "plasma.template.end_cut",
            ),
            (
                "plasma-linuxcnc",
                "\"G92 Z0\"",
                "\"G92 X0\"",
                "plasma.template.begin_cut[1]",
            ),
            (
                "plasma-linuxcnc",
                "\"G92 Z0\"",
                "\"G91\"",
                "plasma.template.begin_cut",
            ),
            (
                "plasma-grbl",
                "accept_arc_on_after_lost_link = true",
                "",
                "plasma.accept_arc_on_after_lost_link",
            ),
            (
                "plasma-grbl",
                "M3 S1000",
                "M3",
                "plasma.template.begin_cut[3]",
            ),
            (
                "plasma-grbl",
                "G38.2",
                "G31",
                "plasma.template.begin_cut[0]",
            ),
            (
                "plasma-generic",
                "line_limit = 100",
                "line_limit = 20",
                "controller_limits.line_limit",
            ),
            (
                "plasma-generic",
                "[plasma]",
                "[laser]\nkind = \"co2\"\nwatts = 1\ns_max = 1\npower_mode = \"dynamic\"\n[plasma]",
                "plasma",
            ),
        ] {
            let (_, good) = shipped().find(|(n, _)| *n == name).unwrap();
            assert!(good.contains(from), "the fixture changed: {from}");
            let error = parse("x.toml", &good.replacen(from, to, 1)).unwrap_err();
            assert!(error.line.is_some(), "{from}: {error}");
            assert_eq!(error.key.as_deref().unwrap_or(""), key, "{error}");
        }
        let (_, good) = shipped().find(|(n, _)| *n == "plasma-qtplasmac").unwrap();
        let (start, end) = (good.find("[plasma]").unwrap(), good.find("[bed]").unwrap());
        let without = format!("{}{}", &good[..start], &good[end..]);
        assert_eq!(
            parse("x", &without).unwrap_err().key.as_deref(),
            Some("controller")
        );
    }
}
