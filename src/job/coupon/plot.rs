//! Readings, fit and bound in one picture, and its place in a coupon's guide.

use svg::Document;
use svg::node::element::{Circle, Group, Path, Rectangle, Text};

use crate::base::units::short;
use crate::calibrate::{Bound, Calibration, Demand, Geometry};
use crate::material::Reading;

/// Between these two in `guide.html` stands what a fit found.
const PLACE: [&str; 2] = ["<!-- fit -->", "<!-- /fit -->"];

/// Drawing area, in units of the SVG.
const LEFT: f64 = 210.0;
const WIDTH: f64 = 420.0;
const TOP: f64 = 34.0;
/// Height of a strip's row, and of the curve below.
const ROW: f64 = 22.0;
const CURVE: f64 = 120.0;
const GAP: f64 = 30.0;

/// Of strips like one that was pulled, four of five are expected to fail between these survivals.
const BAND: [f64; 2] = [0.9, 0.1];

/// Points of the curve.
const POINTS: usize = 80;

const INK: &str = "#1f2730";
const PALE: &str = "#b9d3ea";
const STRONG: &str = "#c2410c";

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub struct FitPlot<'a> {
    /// All strips that the fit is from.
    pub readings: &'a [Reading],
    /// The fit.
    pub calibration: &'a Calibration,
    /// Hinges of the sheet for which σ is stated, and how many of them it has.
    pub sheet: (Geometry, usize),
    /// σ; none where there is none.
    pub bound: Option<&'a Bound>,
    /// With which confidence it was asked for.
    pub confidence: f64,
}

impl FitPlot<'_> {
    /// The picture as SVG text. Above, a row a strip: the stretch between the last mark that held and the one at which it
    /// failed, on the range where the fit expects four of five such strips to fail. Below, the probability that no hinge of
    /// the sheet fails, over its σ.
    pub fn svg(&self) -> String {
        let x_end = self.x_end();
        let x = |stretch: f64| LEFT + WIDTH * (stretch.clamp(1.0, x_end) - 1.0) / (x_end - 1.0);
        let rows_end = TOP + ROW * self.readings.len() as f64;
        let curve_top = rows_end + GAP;
        let curve_end = curve_top + CURVE;
        let height = curve_end + 46.0;
        let mut document = Document::new()
            .set(
                "viewBox",
                format!("0 0 {} {}", LEFT + WIDTH + 24.0, short(height, 1)),
            )
            .set("font-family", "system-ui,sans-serif")
            .set("font-size", 12)
            .set("role", "img")
            .set(
                "aria-label",
                "stretch of every strip, the fit, and the bound",
            )
            .add(
                Rectangle::new()
                    .set("width", "100%")
                    .set("height", "100%")
                    .set("fill", "#fff"),
            );
        let mut grid = Group::new().set("stroke", "#d5dae0").set("fill", "none");
        let step = if x_end > 1.45 { 0.1 } else { 0.05 };
        let ticks = ((x_end - 1.0) / step + 1e-6).floor() as usize;
        for n in 0..=ticks {
            let at = 1.0 + step * n as f64;
            grid = grid.add(line([x(at), TOP - 4.0], [x(at), curve_end]));
            document = document.add(words(&short(at, 2), x(at), curve_end + 16.0, "middle"));
        }
        document = document.add(grid).add(words(
            "stretch λ",
            LEFT + 0.5 * WIDTH,
            curve_end + 34.0,
            "middle",
        ));
        for (n, reading) in self.readings.iter().enumerate() {
            let y = TOP + ROW * (n as f64 + 0.5);
            document = document
                .add(words(&row_words(n, reading), LEFT - 10.0, y + 4.0, "end"))
                .add(self.row(reading, y, &x));
        }
        document = document.add(self.curve(curve_top, &x, x_end));
        for (share, name) in [(0.0, "0"), (0.5, "0.5"), (1.0, "1")] {
            let y = curve_end - CURVE * share;
            document = document.add(words(name, LEFT - 10.0, y + 4.0, "end"));
        }
        let text = format!("{} hinges hold", self.sheet.1);
        document = document.add(words(&text, LEFT - 40.0, curve_top + 0.5 * CURVE, "end"));
        if let Some(bound) = self.bound {
            let at = x(bound.sigma);
            document = document
                .add(
                    line([at, TOP - 10.0], [at, curve_end])
                        .set("stroke", STRONG)
                        .set("stroke-width", 1.6),
                )
                .add(
                    words(
                        &format!(
                            "σ = {} with confidence {}",
                            short(bound.sigma, 3),
                            bound.confidence
                        ),
                        at,
                        TOP - 16.0,
                        "middle",
                    )
                    .set("fill", STRONG),
                );
        }
        document.to_string()
    }

    fn x_end(&self) -> f64 {
        let most = |r: &Reading| r.tore.unwrap_or(r.held).max(r.held);
        let expected = |r: &Reading| self.failing(r, BAND[1]).unwrap_or(1.0);
        let ends = self.readings.iter().flat_map(|r| [most(r), expected(r)]);
        let widest = ends.chain(self.bound.map(|b| b.sigma)).fold(1.1, f64::max);
        ((widest * 20.0).ceil() / 20.0 + 0.05).min(2.0)
    }

    /// The stretch up to which a strip as this one holds with a probability.
    fn failing(&self, reading: &Reading, survival: f64) -> Option<f64> {
        let geometry = Geometry::of(reading);
        let count = reading.hinges as usize;
        self.calibration.expected(&geometry, count, survival).ok()
    }

    fn row(&self, reading: &Reading, y: f64, x: &impl Fn(f64) -> f64) -> Group {
        let mut row = Group::new();
        let band = BAND.map(|survival| self.failing(reading, survival));
        if let [Some(low), Some(high)] = band {
            row = row.add(
                Rectangle::new()
                    .set("x", short(x(low), 2))
                    .set("y", short(y - 0.36 * ROW, 2))
                    .set("width", short((x(high) - x(low)).max(1.0), 2))
                    .set("height", short(0.72 * ROW, 2))
                    .set("fill", PALE),
            );
        }
        let held = Circle::new()
            .set("cx", short(x(reading.held), 2))
            .set("cy", short(y, 2))
            .set("r", 3.2)
            .set("fill", INK);
        let bar = |to: f64| {
            line([x(reading.held), y], [to, y])
                .set("stroke", INK)
                .set("stroke-width", 3)
        };
        match reading.tore {
            Some(tore) => {
                let (at, arm) = (x(tore), 4.0);
                let cross = [[-arm, -arm], [-arm, arm]].map(|[dx, dy]| {
                    line([at + dx, y + dy], [at - dx, y - dy])
                        .set("stroke", INK)
                        .set("stroke-width", 2)
                });
                let [a, b] = cross;
                row.add(bar(at)).add(held).add(a).add(b)
            }
            // It never failed: the bar fades out.
            None => row
                .add(bar(LEFT + WIDTH).set("stroke-dasharray", "2 4"))
                .add(held),
        }
    }

    fn curve(&self, top: f64, x: &impl Fn(f64) -> f64, x_end: f64) -> Group {
        let bottom = top + CURVE;
        let (geometry, count) = self.sheet;
        let demand = Demand::all(count);
        let mut path = String::new();
        for n in 0..=POINTS {
            let sigma = 1.0 + (x_end - 1.0) * n as f64 / POINTS as f64;
            let Ok(chance) = self.calibration.chance(&geometry, &demand, sigma) else {
                break;
            };
            let letter = if path.is_empty() { 'M' } else { 'L' };
            path.push_str(&format!(
                "{letter}{} {}",
                short(x(sigma), 2),
                short(bottom - CURVE * chance, 2)
            ));
        }
        let asked = bottom - CURVE * self.confidence;
        let mut group = Group::new()
            .add(line([LEFT, bottom], [LEFT + WIDTH, bottom]).set("stroke", INK))
            .add(
                line([LEFT, asked], [LEFT + WIDTH, asked])
                    .set("stroke", STRONG)
                    .set("stroke-dasharray", "4 3"),
            );
        if !path.is_empty() {
            group = group.add(
                Path::new()
                    .set("d", path)
                    .set("fill", "none")
                    .set("stroke", "#1d6fb8")
                    .set("stroke-width", 2),
            );
        }
        group
    }
}

/// A guide with what a fit found in its place, in the place of what an earlier one found; none if it has no such place.
pub fn with_fit(guide: &str, plot: &FitPlot<'_>) -> Option<String> {
    let from = guide.find(PLACE[0])? + PLACE[0].len();
    let to = from + guide[from..].find(PLACE[1])?;
    let (geometry, hinges) = plot.sheet;
    let found = match plot.bound {
        Some(bound) => format!(
            "σ = {} for a sheet of {hinges} hinges of {} mm on edges of {} mm, all open to σ, with a confidence of {}.",
            short(bound.sigma, 3),
            short(geometry.hinge_width_mm, 3),
            short(geometry.edge_mm, 2),
            bound.confidence
        ),
        None => "These readings give no σ yet.".into(),
    };
    let text = format!(
        "\n<h2>What the strips say</h2><p>{found} A row is a strip: the dot is the last stretch that held, the cross the one \
         at which it failed. The band is where the fit expects four of five such strips to fail. The curve is the probability \
         that no hinge of the sheet fails; σ lies a little before it falls to the dashed line, for three tenths of the risk are \
         kept back.</p>\n<figure class=\"fit\">{}</figure>\n",
        plot.svg()
    );
    Some(format!("{}{text}{}", &guide[..from], &guide[to..]))
}

/// The place for [`with_fit`], in a new guide.
pub(super) fn place() -> String {
    PLACE.concat()
}

fn row_words(index: usize, reading: &Reading) -> String {
    let name = match &reading.strip {
        Some(name) => name.chars().take(10).collect(),
        None => (index + 1).to_string(),
    };
    format!(
        "{name}: {} mm on {} mm",
        short(reading.hinge_width_mm, 3),
        short(reading.edge_mm, 2)
    )
}

fn line(from: [f64; 2], to: [f64; 2]) -> Path {
    let [a, b, c, d] = [from[0], from[1], to[0], to[1]].map(|v| short(v, 2));
    Path::new()
        .set("d", format!("M{a} {b}L{c} {d}"))
        .set("fill", "none")
}

fn words(text: &str, x: f64, y: f64, anchor: &str) -> Text {
    Text::new(text)
        .set("x", short(x, 2))
        .set("y", short(y, 2))
        .set("text-anchor", anchor)
        .set("fill", INK)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::{FitOptions, Gauge, Law, SimulatedMaterial, fit};

    #[test]
    fn every_strip_has_its_row_at_its_stretches_and_a_second_fit_replaces_the_first() {
        let geometry = Geometry::plain(1.0, 0.2, 1.6, 12.0);
        let mut material = SimulatedMaterial::new(geometry, 1.6, 0.04, Law::Normal, 5);
        let gauge = Gauge {
            from: 1.05,
            step: 0.05,
            to: 2.0,
        };
        let mut pull = || material.pull(&geometry, 44, &gauge, "2026-05-31");
        let mut readings = vec![pull(), pull(), pull()];
        readings[1].tore = None;
        readings[1].failure = None;
        let calibration = fit(&readings, &FitOptions::default()).unwrap();
        let bound = calibration
            .bound(&geometry, &Demand::all(1000), 0.9)
            .unwrap();
        let plot = FitPlot {
            readings: &readings,
            calibration: &calibration,
            sheet: (geometry, 1000),
            bound: Some(&bound),
            confidence: 0.9,
        };
        let svg = plot.svg();
        let end = plot.x_end();
        assert!((1.1..=2.0).contains(&end));
        let place = |stretch: f64| LEFT + WIDTH * (stretch - 1.0) / (end - 1.0);
        assert_eq!(svg.matches("<circle").count(), 3);
        for reading in &readings {
            let held = format!("cx=\"{}\"", short(place(reading.held), 2));
            assert!(svg.contains(&held), "{held}");
        }
        // One strip never failed, the curve and the grid have no dots.
        assert_eq!(svg.matches("stroke-dasharray=\"2 4\"").count(), 1);
        assert!(svg.contains(&format!("σ = {} with", short(bound.sigma, 3))));
        // The bound stands where the curve is still above the dashed line.
        let chance = calibration
            .chance(&geometry, &Demand::all(1000), bound.sigma)
            .unwrap();
        assert!(chance > 0.9, "{chance}");

        let empty = format!("<html>a{}b</html>", super::place());
        let once = with_fit(&empty, &plot).unwrap();
        assert!(once.starts_with("<html>a<!-- fit -->") && once.ends_with("<!-- /fit -->b</html>"));
        assert_eq!(with_fit(&once, &plot).unwrap(), once);
        let none = FitPlot {
            bound: None,
            ..plot
        };
        let other = with_fit(&once, &none).unwrap();
        assert!(other.contains("no σ yet") && !other.contains("σ = "));
        assert!(with_fit("a page of something else", &plot).is_none());
    }
}
