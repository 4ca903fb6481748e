//! The materials in the binary, and materials from files.

use std::path::{Path, PathBuf};

use super::profile::Material;
use crate::base::catalog::{Catalog, CatalogError};
use crate::base::document::{Document, DocumentError};

/// The material that is meant when none is named.
pub const DEFAULT: &str = "leather-1.6";

/// Every file of `profiles/`, in the order of their names.
const SHIPPED: &[(&str, &str)] = &[
    ("acrylic-3", include_str!("../../profiles/acrylic-3.toml")),
    ("brass-0.2", include_str!("../../profiles/brass-0.2.toml")),
    ("brass-1.5", include_str!("../../profiles/brass-1.5.toml")),
    (
        "cardboard-1.5",
        include_str!("../../profiles/cardboard-1.5.toml"),
    ),
    ("copper-0.2", include_str!("../../profiles/copper-0.2.toml")),
    ("copper-1.5", include_str!("../../profiles/copper-1.5.toml")),
    ("felt-3", include_str!("../../profiles/felt-3.toml")),
    (
        "leather-1.6",
        include_str!("../../profiles/leather-1.6.toml"),
    ),
    ("plywood-3", include_str!("../../profiles/plywood-3.toml")),
    ("steel-0.2", include_str!("../../profiles/steel-0.2.toml")),
    ("steel-1.5", include_str!("../../profiles/steel-1.5.toml")),
];

pub(super) const CATALOG: Catalog = Catalog {
    kind: "material",
    folder: "profiles",
    shipped: SHIPPED,
};

/// The names of the shipped materials with their texts.
pub fn shipped() -> impl ExactSizeIterator<Item = (&'static str, &'static str)> {
    SHIPPED.iter().copied()
}

/// A shipped material by its name, or one from a file by its path. A shipped name wins; `./NAME` means the file.
///
/// # Errors
/// [`CatalogError`]: unknown name (with the known ones), unreadable file, or a wrong profile with file, line and key.
pub fn load(name_or_path: &str) -> Result<Material, CatalogError> {
    CATALOG.load(name_or_path, parse)
}

/// What [`load`] takes for a name or a path, where a person has a folder `own` of profiles: `profiles/NAME.toml` in it
/// comes before a shipped material called NAME, and becomes its path.
///
/// # Errors
/// [`CatalogError`] for a profile of one's own that is wrong, and for a name that nobody knows.
pub fn resolve(name_or_path: &str, own: Option<&Path>) -> Result<String, CatalogError> {
    CATALOG.resolve(name_or_path, own, |file, text| Ok(parse(file, text)?.name))
}

/// The materials in a person's own folder, names with files.
///
/// # Errors
/// [`CatalogError::Folder`].
pub fn own_files(own: &Path) -> Result<Vec<(String, PathBuf)>, CatalogError> {
    CATALOG.own_files(own)
}

/// Where a person's own material of this name belongs; none for what is no name.
pub fn own_file(own: &Path, name: &str) -> Option<PathBuf> {
    CATALOG.own_file(own, name)
}

/// A material from the text of a profile; `file` is what messages call it.
///
/// # Errors
/// [`DocumentError`] with file, line and key.
pub fn parse(file: &str, text: &str) -> Result<Material, DocumentError> {
    Document::new(file, text).read(Material::validate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_embedded_and_bears_its_own_name() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("profiles");
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
    }

    #[test]
    fn each_check_has_a_text_that_fails_it() {
        let (_, good) = shipped().find(|(n, _)| *n == "leather-1.6").unwrap();
        for (from, to, key) in [
            ("format = 1", "format = 2", "format"),
            ("name = \"leather-1.6\"", "name = \"Leather 1\"", "name"),
            ("thickness_mm = 1.6", "thickness_mm = 0", "thickness_mm"),
            ("thickness_mm = 1.6", "thickness_mm = nan", "thickness_mm"),
            (
                "hinge_width_mm = 1.0",
                "hinge_width_mm = -1",
                "hinge_width_mm",
            ),
            (
                "thickness_mm = 1.6",
                "thickness_mm = 1.6\ncorner_radius_mm = nan",
                "corner_radius_mm",
            ),
            (
                "thickness_mm = 1.6",
                "thickness_mm = 1.6\nstock_mm = { x = 1, y = 500 }",
                "stock_mm.x",
            ),
            (
                "thickness_mm = 1.6",
                "thickness_mm = 1.6\nprice_per_m2 = 9",
                "price_per_m2",
            ),
            (
                "thickness_mm = 1.6",
                "thickness_mm = 1.6\ncurrency = \"EUR\"",
                "currency",
            ),
            (
                "thickness_mm = 1.6",
                "thickness_mm = 1.6\nprice_per_m2 = -1\ncurrency = \"EUR\"",
                "price_per_m2",
            ),
            (
                "thickness_mm = 1.6",
                "thickness_mm = 1.6\nprice_per_m2 = 1\ncurrency = \"Euro\"",
                "currency",
            ),
            (
                "[sigma]",
                "[tip]\nshape = \"plain\"\nradius_mm = 1\n[sigma]",
                "tip.radius_mm",
            ),
            (
                "[sigma]",
                "[tip]\nshape = \"round\"\n[sigma]",
                "tip.radius_mm",
            ),
            (
                "[sigma]",
                "[tip]\nshape = \"teardrop\"\nradius_mm = 0\n[sigma]",
                "tip.radius_mm",
            ),
            ("[sigma]", "[tip]\nshape = \"square\"\n[sigma]", ""),
            ("kerf_mm = 0.2", "kerf_mm = 0.2\namps = 20", "cut[0].amps"),
            (
                "kerf_mm = 0.2",
                "kerf_mm = 0.2\npierce_diameter_mm = 0.1",
                "cut[0].pierce_diameter_mm",
            ),
            (
                "kerf_mm = 0.2",
                "kerf_mm = 0.2\nlead_in_mm = -1",
                "cut[0].lead_in_mm",
            ),
            (
                "kerf_mm = 0.2",
                "kerf_mm = 0.2\nlead_out_mm = nan",
                "cut[0].lead_out_mm",
            ),
            (
                "kerf_mm = 0.2",
                "kerf_mm = 0.2\novercut_mm = 51",
                "cut[0].overcut_mm",
            ),
            (
                "process = \"laser\"",
                "process = \"plasma\"",
                "cut[0].laser",
            ),
            ("watts = 40\n", "", "cut[0].watts"),
            (
                "[[engrave]]\nprocess = \"laser\"\nlaser = \"co2\"",
                "[[engrave]]\nprocess = \"plasma\"\nlaser = \"co2\"",
                "engrave[0].laser",
            ),
            (
                "speed_mm_per_min = 6000",
                "speed_mm_per_min = 0",
                "engrave[0].speed_mm_per_min",
            ),
            (
                "power_percent = 12",
                "power_percent = 101",
                "engrave[0].power_percent",
            ),
            (
                "[[engrave]]\nprocess = \"laser\"\nlaser = \"diode\"\nwatts = 10",
                "[[engrave]]\nprocess = \"laser\"\nlaser = \"co2\"\nwatts = 40",
                "engrave[1].process",
            ),
            ("max = 1.8", "max = 2.5", "sigma.max"),
            ("max = 1.8", "max = 1", "sigma.max"),
            ("passes = 1", "passes = 0", "cut[0].passes"),
            ("kerf_mm = 0.2", "kerf_mm = inf", "cut[0].kerf_mm"),
            ("watts = 10", "watts = 40\npwer = 1", ""),
            (
                "laser = \"diode\"\nwatts = 10",
                "laser = \"co2\"\nwatts = 40",
                "cut[1].watts",
            ),
        ] {
            assert!(good.contains(from), "the fixture changed: {from}");
            let error = parse("x.toml", &good.replacen(from, to, 1)).unwrap_err();
            assert!(error.line.is_some(), "{error}");
            assert_eq!(error.key.as_deref().unwrap_or(""), key, "{error}");
        }
        let mut material = load("leather-1.6").unwrap();
        material.sigma.note = " ".into();
        assert_eq!(material.validate().unwrap_err().key, "sigma.note");
        let mut material = load("leather-1.6").unwrap();
        material.cut.clear();
        assert_eq!(material.validate().unwrap_err().key, "cut");
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones_and_a_missing_file_its_path() {
        let text = load("unobtainium").unwrap_err().to_string();
        assert!(
            text.contains("unobtainium") && text.contains("leather-1.6"),
            "{text}"
        );
        assert!(matches!(
            load("no/such.toml"),
            Err(CatalogError::Read { .. })
        ));
    }
}
