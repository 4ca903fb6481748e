//! The materials in the binary, and materials from files.

use super::profile::Material;
use crate::base::catalog::{Catalog, CatalogError};
use crate::base::document::{Document, DocumentError};

/// The material that is meant when none is named.
pub const DEFAULT: &str = "leather-1.6";

/// Every file of `profiles/`, in the order of their names.
const SHIPPED: &[(&str, &str)] = &[
    ("acrylic-3", include_str!("../../profiles/acrylic-3.toml")),
    (
        "cardboard-1.5",
        include_str!("../../profiles/cardboard-1.5.toml"),
    ),
    ("copper-0.2", include_str!("../../profiles/copper-0.2.toml")),
    ("felt-3", include_str!("../../profiles/felt-3.toml")),
    (
        "leather-1.6",
        include_str!("../../profiles/leather-1.6.toml"),
    ),
    ("plywood-3", include_str!("../../profiles/plywood-3.toml")),
];

const CATALOG: Catalog = Catalog {
    kind: "material",
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

/// A material from the text of a profile; `file` is what messages call it.
///
/// # Errors
/// [`DocumentError`] with file, line and key.
pub fn parse(file: &str, text: &str) -> Result<Material, DocumentError> {
    Document::new(file, text).read(Material::validate)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

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
