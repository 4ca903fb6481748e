//! The key to a colour scale, as SVG for a page.

use std::fmt::Write as _;

use super::colour::ColourScale;
use crate::base::units::short;

/// A bar with five ticks over the range, and a swatch for what lies outside: `below` and `above` say in words what
/// that means (no swatch where a text is empty). `unit` follows the numbers.
///
/// The texts are put in as they are: escape them if they come from outside.
pub fn legend(scale: &ColourScale, unit: &str, below: &str, above: &str) -> String {
    const BAR: [f64; 2] = [300.0, 14.0];
    const CELLS: usize = 60;
    let (low, high) = scale.range();
    let swatches = [below, above].iter().filter(|t| !t.is_empty()).count();
    let mut svg = format!(
        "<svg class=\"legend\" viewBox=\"0 0 360 {}\" role=\"img\" aria-label=\"colour key\">",
        40 + 17 * swatches
    );
    let cell = BAR[0] / CELLS as f64;
    for i in 0..CELLS {
        let value = low + (high - low) * (i as f64 + 0.5) / CELLS as f64;
        // Overlapped by half a unit, so that no seam shows between the cells.
        let _ = write!(
            svg,
            "<rect x=\"{}\" y=\"4\" width=\"{}\" height=\"{}\" fill=\"{}\"/>",
            short(30.0 + i as f64 * cell, 2),
            short(if i + 1 < CELLS { cell + 0.5 } else { cell }, 2),
            BAR[1],
            scale.colour(value).css()
        );
    }
    let decimals = if high - low < 0.5 { 3 } else { 2 };
    for i in 0..5 {
        let part = f64::from(i) / 4.0;
        let x = short(30.0 + BAR[0] * part, 2);
        let _ = write!(
            svg,
            "<path d=\"M{x} 18v4\" stroke=\"#5b6570\"/><text x=\"{x}\" y=\"33\" text-anchor=\"middle\">{}{unit}</text>",
            short(low + (high - low) * part, decimals)
        );
    }
    let mut y = 46.0;
    for (colour, text) in [(scale.flags().0, below), (scale.flags().1, above)] {
        if !text.is_empty() {
            let _ = write!(
                svg,
                "<rect x=\"30\" y=\"{y}\" width=\"14\" height=\"10\" fill=\"{}\"/><text x=\"50\" y=\"{}\">{text}</text>",
                colour.css(),
                y + 9.0
            );
            y += 17.0;
        }
    }
    svg.push_str("</svg>");
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_legend_names_both_ends_and_shows_both_flags() {
        let scale = ColourScale::scale_factor(1.75);
        let svg = legend(&scale, "", "too small", "too large");
        assert!(svg.contains(">1</text>") && svg.contains(">1.75</text>"));
        for flag in [scale.flags().0, scale.flags().1] {
            assert!(svg.contains(&flag.css()));
        }
        assert_eq!(svg.matches("<rect").count(), 62);
        let svg = legend(&scale, "", "", "too large");
        assert!(!svg.contains(&scale.flags().0.css()));
    }
}
