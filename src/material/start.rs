//! A starting profile for one's own material.

use super::profile::check_name;
use super::shipped::{CATALOG, parse};
use crate::base::starting::{StartError, annotated, renamed};

/// What a key means, as a comment over it.
fn explain(table: &str, key: &str) -> Option<&'static str> {
    Some(match (table, key) {
        ("", "name") => "how --material FILE and the job's header call it",
        ("", "title") => "what it is, for people",
        ("", "kind") => "leather, wood, metal, plastic, paper or textile",
        ("", "thickness_mm") => "of the sheet",
        ("", "hinge_width_mm") => "width of the narrowest ligament at a hinge",
        ("", "corner_radius_mm") => "radius of the rounded corners of triangles",
        ("", "stock_mm") => "size of the sheets as they are bought",
        ("", "price_per_m2") => "price of a square metre, for the report",
        ("", "currency") => "three letters",
        ("sigma", "") => "how far it stretches when its hinges open: 1 closed, 2 fully open",
        ("sigma", "max") => "the largest stretch",
        ("sigma", "source") => "measured, literature or estimate",
        ("sigma", "note") => "from whom or how",
        ("tip", "") => "stress relief at the ends of slits",
        ("tip", "shape") => "plain, round or teardrop",
        ("tip", "radius_mm") => "radius of the end",
        ("cut", "") => "one way to cut it; as many of these tables as there are",
        ("cut", "process") => "laser or plasma",
        ("cut", "laser") => "co2, diode or fibre",
        ("cut", "watts") => "optical power of the laser that the figures are for",
        ("cut", "speed_mm_per_min") => "speed along the cut",
        ("cut", "power_percent") => "per cent of these watts",
        ("cut", "passes") => "how often each cut is gone over",
        ("cut", "pass_order") => "cut (all passes of a cut, then the next) or sheet (cooler)",
        ("cut", "air_assist") => "whether air must blow at the cut",
        ("cut", "kerf_mm") => {
            "width of what is burnt away: cut a square of 20 mm, measure it and its hole"
        }
        ("cut", "amps") => "current of the torch",
        ("cut", "pierce_delay_s") => "how long the torch stands until it is through",
        ("cut", "pierce_height_mm") => "its height meanwhile",
        ("cut", "cut_height_mm") => "its height while cutting",
        ("cut", "pierce_diameter_mm") => {
            "diameter of the hole where a cut begins; the kerf for a laser"
        }
        ("cut", "lead_in_mm") => "way from the pierce into the cut",
        ("cut", "lead_out_mm") => "way out of it",
        ("cut", "overcut_mm") => "how far a closed cut goes on past its beginning",
        ("cut", "source") => "measured, literature or estimate",
        ("cut", "note") => "from whom or how",
        ("engrave", "") => "one way to mark it",
        ("engrave", "process") => "laser, or plasma for the scribe of a plasma table",
        ("engrave", "laser") => "co2, diode or fibre",
        ("engrave", "watts") => "optical power of the laser that the figures are for",
        ("engrave", "speed_mm_per_min") => "speed along the line",
        ("engrave", "power_percent") => "per cent of these watts",
        ("engrave", "source") => "measured, literature or estimate",
        ("engrave", "note") => "from whom or how",
        _ => return None,
    })
}

/// A commented profile called `name`, with everything else as in the shipped `from`.
///
/// # Errors
/// [`StartError`].
pub fn start(name: &str, from: &str) -> Result<String, StartError> {
    check_name(name).map_err(|c| StartError::Name(c.problem))?;
    let text = renamed(&CATALOG, name, from)?;
    let text = format!(
        "# A material for kagome, made from the shipped {from}. Lengths in millimetres.\n# Change what differs, then: kagome materials check FILE\n# price_per_m2 = PRICE and currency = \"EUR\" below its title make reports say what a sheet costs.\n{}",
        annotated(&text, explain)
    );
    parse(name, &text)?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::super::shipped;
    use super::*;

    #[test]
    fn every_shipped_material_is_a_valid_start_with_a_comment_for_every_key() {
        for (from, text) in shipped() {
            let made = start("mine", from).unwrap();
            let mut material = parse("mine.toml", &made).unwrap();
            assert_eq!(material.name, "mine");
            material.name = from.into();
            assert_eq!(
                material,
                parse(from, text).unwrap(),
                "only the name differs"
            );
            for key in text
                .lines()
                .filter_map(|l| l.split_once(" = "))
                .map(|(k, _)| k)
            {
                if key != "format" {
                    let at = made.find(&format!("\n{key} = ")).unwrap();
                    let before = made[..at].lines().next_back().unwrap_or_default();
                    assert!(before.starts_with("# "), "{from}: {key}");
                }
            }
        }
    }

    #[test]
    fn names_that_would_not_be_found_are_refused() {
        assert!(matches!(
            start("My leather", "felt-3"),
            Err(StartError::Name(_))
        ));
        assert!(matches!(
            start("felt-3", "felt-3"),
            Err(StartError::Taken { .. })
        ));
        assert!(matches!(
            start("mine", "nothing"),
            Err(StartError::Unknown { .. })
        ));
    }
}
