//! How far the hinges open: a histogram of λ.

use std::fmt::Write as _;

use crate::base::units::short;
use crate::job::picture::ColourScale;

/// Bars over [1, σ]; as many more of the same width as the values outside need.
const BARS: usize = 40;

/// Never more bars than this: beyond, the outermost takes the rest.
const MOST_BARS: usize = 120;

/// Values this far outside the range, in bars, are rounding.
const ROUNDING: f64 = 0.01;

/// Drawing area, in units of the SVG.
const LEFT: f64 = 40.0;
const TOP: f64 = 26.0;
const WIDTH: f64 = 620.0;
const HEIGHT: f64 = 150.0;

/// The histogram of `openings` (λ by hinge; values that are not finite are not counted) in the colours of `scale`,
/// with its ends marked.
pub fn histogram(openings: &[f64], scale: &ColourScale) -> String {
    let (low, high) = scale.range();
    let step = if high - low > 1e-6 {
        (high - low) / BARS as f64
    } else {
        0.01
    };
    let inside = (((high - low) / step).round() as i64).max(1);
    // Rounding at the ends of the range belongs to the bar inside.
    let bin = |value: f64| {
        let at = (value - low) / step;
        let past = at - inside as f64;
        if at < 0.0 && at > -ROUNDING {
            0
        } else if (0.0..ROUNDING).contains(&past) {
            inside - 1
        } else {
            at.floor() as i64
        }
    };
    let finite = || openings.iter().copied().filter(|x| x.is_finite());
    let room = (MOST_BARS - BARS) as i64;
    let first = finite().map(&bin).min().unwrap_or(0).clamp(-room / 2, 0) - 1;
    let last = finite()
        .map(&bin)
        .max()
        .unwrap_or(0)
        .clamp(inside - 1, inside - 1 + room / 2)
        + 1;
    let mut counts = vec![0usize; (last - first + 1) as usize];
    for value in finite() {
        counts[(bin(value).clamp(first, last) - first) as usize] += 1;
    }
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let bar = WIDTH / counts.len() as f64;
    let x_of = |value: f64| LEFT + ((value - low) / step - first as f64) * bar;
    let mut svg = format!(
        "<svg class=\"histogram\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"histogram of hinge openings\">",
        LEFT + WIDTH + 20.0,
        TOP + HEIGHT + 40.0
    );
    let bottom = TOP + HEIGHT;
    for (i, &count) in counts.iter().enumerate() {
        if count == 0 {
            continue;
        }
        let number = first + i as i64;
        let value = low + (number as f64 + 0.5) * step;
        let colour = if number < 0 {
            scale.flags().0
        } else if number >= inside {
            scale.flags().1
        } else {
            scale.colour(value.min(high))
        };
        // One hinge among thousands must still be seen.
        let height = (HEIGHT * count as f64 / most as f64).max(1.5);
        let _ = write!(
            svg,
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\"><title>{} hinges, {} to {}</title></rect>",
            short(LEFT + i as f64 * bar + 0.5, 2),
            short(bottom - height, 2),
            short(bar - 1.0, 2),
            short(height, 2),
            colour.css(),
            count,
            short(value - 0.5 * step, 3),
            short(value + 0.5 * step, 3)
        );
    }
    let _ = write!(
        svg,
        "<path d=\"M{LEFT} {bottom}h{WIDTH}\" stroke=\"#5b6570\" fill=\"none\"/><text x=\"{}\" y=\"{}\" text-anchor=\"end\">{most}</text><text x=\"{}\" y=\"{}\" text-anchor=\"end\">0</text>",
        LEFT - 6.0,
        TOP + 8.0,
        LEFT - 6.0,
        bottom
    );
    for (value, name) in [(low, "closed"), (high, "σ")] {
        let x = short(x_of(value), 2);
        let _ = write!(
            svg,
            "<path d=\"M{x} {}V{}\" stroke=\"#1f2730\" stroke-dasharray=\"4 3\" fill=\"none\"/><text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">{name}</text><text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            TOP - 6.0,
            bottom + 5.0,
            TOP - 11.0,
            bottom + 17.0,
            short(value, 3)
        );
    }
    for k in 1..4 {
        let value = low + (high - low) * f64::from(k) / 4.0;
        let x = short(x_of(value), 2);
        let _ = write!(
            svg,
            "<text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            bottom + 17.0,
            short(value, 3)
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">stretch λ of each hinge (height: number of hinges)</text></svg>",
        LEFT + 0.5 * WIDTH,
        bottom + 34.0
    );
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(svg: &str) -> Vec<(usize, String)> {
        svg.split("<rect ")
            .skip(1)
            .map(|rect| {
                let colour = rect.split("fill=\"").nth(1).unwrap()[..7].to_owned();
                let count = rect.split("<title>").nth(1).unwrap();
                (count.split(' ').next().unwrap().parse().unwrap(), colour)
            })
            .collect()
    }

    #[test]
    fn every_finite_hinge_is_in_one_bar_and_those_outside_are_flagged() {
        let scale = ColourScale::scale_factor(2.0);
        let (below, above) = scale.flags();
        let openings = [
            0.9,
            1.0,
            1.0 - 1e-9,
            1.0 + 1e-4,
            1.5,
            2.0,
            2.0 + 1e-6,
            2.4,
            50.0,
            f64::NAN,
        ];
        let bars = counts(&histogram(&openings, &scale));
        assert_eq!(bars.iter().map(|b| b.0).sum::<usize>(), 9);
        let flagged = |c: &str| bars.iter().filter(|b| b.1 == c).map(|b| b.0).sum::<usize>();
        assert_eq!((flagged(&below.css()), flagged(&above.css())), (1, 2));
        assert_eq!(bars[1], (3, scale.colour(1.0125).css()));
    }

    #[test]
    fn nothing_and_a_range_without_width_are_drawn_too() {
        assert!(counts(&histogram(&[], &ColourScale::scale_factor(1.5))).is_empty());
        let bars = counts(&histogram(&[1.0, 1.0], &ColourScale::scale_factor(1.0)));
        assert_eq!(bars.iter().map(|b| b.0).sum::<usize>(), 2);
    }
}
