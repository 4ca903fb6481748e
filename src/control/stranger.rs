//! Who answers when it is no GRBL controller: what was heard, in words for a person.

/// What other firmwares say when they start, and what they are.
const KNOWN: [(&str, &str); 8] = [
    ("marlin", "Marlin, a 3D printer's firmware"),
    ("echo:", "Marlin, a 3D printer's firmware"),
    ("smoothie", "Smoothieware"),
    ("klipper", "Klipper"),
    ("reprap", "RepRapFirmware"),
    ("repetier", "Repetier, a 3D printer's firmware"),
    ("tinyg", "TinyG"),
    ("g2core", "g2core"),
];

/// What a line that no GRBL controller says tells of the one who said it.
pub fn words(heard: &str) -> String {
    let lower = heard.to_lowercase();
    if let Some((_, who)) = KNOWN.iter().find(|(said, _)| lower.contains(said)) {
        return format!(
            "this is {who}, and it says {:?}; kagome streams to GRBL 1.1, grblHAL and FluidNC only",
            clipped(heard)
        );
    }
    // A wrong rate makes bytes that no firmware sends.
    let odd = heard
        .chars()
        .filter(|c| *c == char::REPLACEMENT_CHARACTER || (c.is_control() && *c != '\t'))
        .count();
    let all = heard.chars().count();
    if all > 0 && 4 * odd >= all {
        return "only noise is heard: the rate is wrong (--baud; most boards have 115200, some 250000 or 9600)".into();
    }
    // Marlin's first word, alone on its line.
    if lower.trim() == "start" {
        return "it says \"start\", as 3D printers do; kagome streams to GRBL 1.1, grblHAL and FluidNC only".into();
    }
    format!("it says {:?}", clipped(heard))
}

fn clipped(heard: &str) -> String {
    heard.chars().take(60).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn firmwares_and_wrong_rates_are_told_apart() {
        for (heard, part) in [
            ("Marlin 2.1.2", "3D printer"),
            ("echo:Unknown command: \"$I\"", "Marlin"),
            ("start", "3D printers"),
            ("Smoothie command shell", "Smoothieware"),
            ("\u{fffd}\u{fffd}x\u{1}\u{fffd}", "--baud"),
            ("login:", "login:"),
            ("", "\"\""),
        ] {
            assert!(words(heard).contains(part), "{heard}: {}", words(heard));
        }
        assert!(words(&"x".repeat(1000)).len() < 100);
    }
}
