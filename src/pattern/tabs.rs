//! Where tabs hold a part in the stock.

use super::sheet::{PatternError, Sheet, Tab};
use crate::base::curve::{Curve, Piece};

impl Sheet {
    /// `count` tabs for each part, spread evenly along its rim, each in the middle of the nearest straight piece that is
    /// long enough: a tab in a corner would be hard to break off cleanly.
    pub fn even_tabs(&self, count: usize, width_mm: f64) -> Vec<Tab> {
        let mut tabs = Vec::new();
        for contour in self.contours.iter().filter(|c| c.outer) {
            tabs.extend(along(&contour.line, count, width_mm, self.metadata.kerf_mm));
        }
        tabs
    }

    /// As [`Sheet::even_tabs`], where every part must be held.
    ///
    /// # Errors
    /// [`PatternError::NoTab`] if tabs are asked for and a part has no straight stretch long enough for one.
    pub fn tabs_for(&self, count: usize, width_mm: f64) -> Result<Vec<Tab>, PatternError> {
        if count > 0 {
            let kerf_mm = self.metadata.kerf_mm;
            let rims = self.contours.iter().filter(|c| c.outer);
            for rim in rims {
                if along(&rim.line, count, width_mm, kerf_mm).is_empty() {
                    let straight = rim.line.pieces().filter(|p| p.bulge == 0.0);
                    let longest = straight.map(|p| p.length()).fold(0.0, f64::max);
                    return Err(PatternError::NoTab {
                        width_mm,
                        most_mm: (0.5 * longest - kerf_mm).max(0.0),
                    });
                }
            }
        }
        Ok(self.even_tabs(count, width_mm))
    }
}

fn along(line: &Curve, count: usize, width_mm: f64, kerf_mm: f64) -> Vec<Tab> {
    // The stretches between two tabs must be worth cutting.
    let room = 2.0 * (width_mm + kerf_mm);
    let mut places: Vec<(f64, Piece)> = Vec::new();
    let mut before = 0.0;
    for piece in line.pieces() {
        let length = piece.length();
        if piece.bulge == 0.0 && length >= room {
            places.push((before + 0.5 * length, piece));
        }
        before += length;
    }
    let whole = before;
    let mut chosen: Vec<usize> = (0..count)
        .filter_map(|n| {
            let wanted = whole * (n as f64 + 0.5) / count as f64;
            let away = |at: f64| {
                let d = (at - wanted).abs();
                d.min(whole - d)
            };
            (0..places.len()).min_by(|a, b| away(places[*a].0).total_cmp(&away(places[*b].0)))
        })
        .collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen
        .into_iter()
        .map(|n| Tab {
            at: places[n].1.at(0.5),
            width_mm,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::linkage::{Handedness, Linkage};
    use crate::pattern::{PatternError, Sheet, SheetOptions};

    #[test]
    fn tabs_are_spread_over_the_sides_of_every_part() {
        let linkage = Linkage::patch(10.0, Handedness::Right, &Linkage::hexagon_cells(3));
        let sheet = Sheet::new(&linkage, &SheetOptions::plain(1.0, 0.2)).unwrap();
        for count in [0, 1, 3, 6] {
            let tabs = sheet.even_tabs(count, 0.5);
            assert_eq!(tabs.len(), count);
            for (i, a) in tabs.iter().enumerate() {
                for b in &tabs[..i] {
                    assert!(
                        a.at.distance(b.at) > 25.0,
                        "one for each side of 30 mm at the most"
                    );
                }
            }
        }
        assert_eq!(
            sheet.even_tabs(50, 0.5).len(),
            6,
            "no more than there are straight pieces"
        );
        assert!(
            sheet.even_tabs(3, 20.0).is_empty(),
            "no piece is long enough"
        );
        assert!(sheet.tabs_for(0, 20.0).unwrap().is_empty());
        let PatternError::NoTab { most_mm, .. } = sheet.tabs_for(3, 20.0).unwrap_err() else {
            panic!("an error about tabs");
        };
        assert_eq!(sheet.tabs_for(3, most_mm - 1e-9).unwrap().len(), 3);
        assert!(sheet.tabs_for(3, most_mm + 1e-6).is_err());
    }
}
