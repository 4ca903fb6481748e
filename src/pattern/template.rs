//! The sheet on paper at true size, for those who cut by hand or want to look first.
//!
//! A PDF with the lines as lines, tiled over as few pages as the sheet takes. Neighbouring pages overlap by a centimetre,
//! and crosses lie at the same places of the sheet on each of them, to put one on the other; the dashed frame is where
//! paper may be trimmed. Every page says which one it is, and carries a ruler of 100 mm to measure whether the printer
//! kept the size. Text is drawn with the engraver's letters, so that no font is needed.

use std::fmt::Write as _;

use kurbo::{Point, Rect, Vec2};

use super::font;
use super::mark::Label;
use super::sheet::Sheet;
use super::star::Star;
use crate::base::curve::Curve;
use crate::base::units::short;

/// Points, the unit of PDF, in a millimetre.
const POINTS_PER_MM: f64 = 72.0 / 25.4;

/// What printers leave white, and at the lower edge room for ruler and words, millimetres.
const MARGIN_MM: f64 = 10.0;
const FOOT_MM: f64 = 20.0;

/// What neighbouring pages have in common, millimetres.
const OVERLAP_MM: f64 = 10.0;

/// White around the sheet, millimetres.
const ROOM_MM: f64 = 2.0;

/// Length of the ruler, millimetres.
const RULER_MM: f64 = 100.0;

/// Arm of a registration cross, millimetres.
const CROSS_MM: f64 = 4.0;

/// More pages than anybody glues.
const MOST_PAGES: usize = 2000;

/// Coordinates are written to a tenth of a micrometre.
const DECIMALS: usize = 4;

/// A size of paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paper {
    /// 210 × 297 mm.
    A4,
    /// 8.5 × 11 in.
    Letter,
}

impl Paper {
    /// Width and height upright, millimetres.
    pub fn size_mm(self) -> [f64; 2] {
        match self {
            Self::A4 => [210.0, 297.0],
            Self::Letter => [215.9, 279.4],
        }
    }
}

/// A template for printing.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// The PDF.
    pub pdf: Vec<u8>,
    /// Number of its pages.
    pub pages: usize,
    /// Columns and rows of the grid that they tile; where nothing of the sheet lies, there is no page.
    pub grid: [usize; 2],
    /// Width and height of a page, millimetres.
    pub page_mm: [f64; 2],
    /// For every page the part of the sheet on it, in the sheet's frame, millimetres.
    pub tiles: Vec<Rect>,
}

/// Why there is no template.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TemplateError {
    /// Too large for paper.
    #[error(
        "the sheet of {width_mm:.0} x {height_mm:.0} mm would take {pages} pages; {most} are the most"
    )]
    TooManyPages {
        /// Width of the sheet.
        width_mm: f64,
        /// Its height.
        height_mm: f64,
        /// Pages that it would take.
        pages: f64,
        /// The limit.
        most: usize,
    },
    /// Nothing to print.
    #[error("the sheet has no contour: nothing would be on the paper")]
    Empty,
}

/// One kind of line.
struct Ink {
    lines: Vec<(Curve, Rect)>,
    grey: f64,
    width_mm: f64,
}

impl Ink {
    fn new(lines: impl IntoIterator<Item = Curve>, grey: f64, width_mm: f64) -> Self {
        let boxed = |line: Curve| line.bounds().map(|b| (line, b));
        Self {
            lines: lines.into_iter().filter_map(boxed).collect(),
            grey,
            width_mm,
        }
    }
}

/// The sheet tiled over pages. Upright or across, whichever takes fewer.
///
/// # Errors
/// [`TemplateError`]: nothing to print, or too many pages.
pub fn template(sheet: &Sheet, paper: Paper) -> Result<Template, TemplateError> {
    if sheet.contours.is_empty() {
        return Err(TemplateError::Empty);
    }
    let bounds = sheet.bounds().inflate(ROOM_MM, ROOM_MM);
    let [short_mm, long_mm] = paper.size_mm();
    let count = |page: [f64; 2]| -> [f64; 2] {
        let room = tile_mm(page);
        let along =
            |whole: f64, room: f64| ((whole - OVERLAP_MM) / (room - OVERLAP_MM)).ceil().max(1.0);
        [
            along(bounds.width(), room[0]),
            along(bounds.height(), room[1]),
        ]
    };
    let (upright, across) = ([short_mm, long_mm], [long_mm, short_mm]);
    let pages = |c: [f64; 2]| c[0] * c[1];
    let page_mm = if pages(count(across)) < pages(count(upright)) {
        across
    } else {
        upright
    };
    let grid = count(page_mm);
    if pages(grid) > MOST_PAGES as f64 {
        return Err(TemplateError::TooManyPages {
            width_mm: bounds.width(),
            height_mm: bounds.height(),
            pages: pages(grid),
            most: MOST_PAGES,
        });
    }
    let (columns, rows) = (grid[0] as usize, grid[1] as usize);
    let stars = sheet.slits.chunk_by(|a, b| a.star == b.star);
    let slits = stars.flat_map(|s| Star::new(s, &sheet.metadata).lines().collect::<Vec<_>>());
    let outlines = sheet.triangles.iter().chain(&sheet.flaps);
    let inks = [
        Ink::new(outlines.map(|t| Curve::polyline(*t, true)), 0.8, 0.1),
        Ink::new(sheet.marks.iter().flat_map(|m| m.strokes()), 0.4, 0.2),
        Ink::new(slits, 0.0, 0.25),
        Ink::new(sheet.contours.iter().map(|c| c.line.clone()), 0.0, 0.35),
    ];
    let [wide, high] = tile_mm(page_mm);
    let mut tiles = Vec::new();
    // Row by row from the top, as one reads.
    for row in 0..rows {
        for column in 0..columns {
            let x = bounds.x0 + column as f64 * (wide - OVERLAP_MM);
            let top = bounds.y1 - row as f64 * (high - OVERLAP_MM);
            let tile = Rect::new(x, top - high, x + wide, top);
            let touched = |ink: &Ink| ink.lines.iter().any(|(line, b)| touches(line, *b, tile));
            if inks.iter().any(touched) {
                tiles.push((tile, format!("{}{}", row_name(row), column + 1)));
            }
        }
    }
    let total = tiles.len();
    let contents: Vec<String> = tiles
        .iter()
        .enumerate()
        .map(|(n, (tile, name))| {
            content(
                *tile,
                page_mm,
                &inks,
                &format!("{name}  PAGE {}/{total}", n + 1),
            )
        })
        .collect();
    Ok(Template {
        pdf: pdf(&contents, page_mm),
        pages: total,
        grid: [columns, rows],
        page_mm,
        tiles: tiles.into_iter().map(|t| t.0).collect(),
    })
}

/// Room for the sheet on a page.
fn tile_mm(page: [f64; 2]) -> [f64; 2] {
    [page[0] - 2.0 * MARGIN_MM, page[1] - MARGIN_MM - FOOT_MM]
}

/// A, B, …, Z, AA, …
fn row_name(row: usize) -> String {
    let letter = |n: usize| char::from(b'A' + (n % 26) as u8);
    match row.checked_div(26) {
        Some(n) if n > 0 => format!("{}{}", letter(n - 1), letter(row)),
        _ => letter(row).to_string(),
    }
}

/// Whether a line passes through a rectangle.
fn touches(line: &Curve, bounds: Rect, tile: Rect) -> bool {
    let apart =
        bounds.x0 > tile.x1 || bounds.x1 < tile.x0 || bounds.y0 > tile.y1 || bounds.y1 < tile.y0;
    if apart {
        return false;
    }
    let mut points = line.flattened(0.05);
    points.extend(line.start().filter(|_| line.closed));
    points.windows(2).any(|w| clipped(w[0], w[1], tile))
}

/// Whether a segment passes through a rectangle (Liang and Barsky).
fn clipped(a: Point, b: Point, r: Rect) -> bool {
    let d = b - a;
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for (step, low, high) in [(d.x, r.x0 - a.x, r.x1 - a.x), (d.y, r.y0 - a.y, r.y1 - a.y)] {
        if step == 0.0 {
            if low > 0.0 || high < 0.0 {
                return false;
            }
            continue;
        }
        let (one, two) = (low / step, high / step);
        from = from.max(one.min(two));
        to = to.min(one.max(two));
    }
    from <= to
}

/// Operators of one page.
struct Page {
    text: String,
}

impl Page {
    fn put(&mut self, numbers: &[f64], operator: &str) {
        for n in numbers {
            self.text.push_str(&short(*n, DECIMALS));
            self.text.push(' ');
        }
        self.text.push_str(operator);
        self.text.push('\n');
    }

    fn path(&mut self, line: &Curve) {
        let Some(start) = line.start() else { return };
        self.put(&[start.x, start.y], "m");
        for piece in line.pieces() {
            let Some(arc) = piece.arc() else {
                self.put(&[piece.to.x, piece.to.y], "l");
                continue;
            };
            // Cubic curves for no more than 45° stray by 4·10⁻⁶ of the radius.
            let n = (arc.sweep.abs() / std::f64::consts::FRAC_PI_4)
                .ceil()
                .max(1.0);
            let step = arc.sweep / n;
            let reach = 4.0 / 3.0 * (0.25 * step).tan() * arc.radius;
            for k in 0..n as usize {
                let angle = |k: f64| Vec2::from_angle(arc.start + k * step);
                let (u, v) = (angle(k as f64), angle(k as f64 + 1.0));
                let along = |u: Vec2| Vec2::new(-u.y, u.x) * reach;
                let a = arc.centre + u * arc.radius + along(u);
                let end = arc.centre + v * arc.radius;
                let b = end - along(v);
                self.put(&[a.x, a.y, b.x, b.y, end.x, end.y], "c");
            }
        }
        self.text.push_str(if line.closed { "s\n" } else { "S\n" });
    }

    fn line(&mut self, from: Point, to: Point) {
        self.path(&Curve::line(from, to));
    }

    fn words(&mut self, text: &str, left: Point, height_mm: f64) {
        let label = Label {
            text: text.to_owned(),
            at: left + Vec2::new(0.5 * font::width_mm(text, height_mm), 0.5 * height_mm),
            up: Vec2::new(0.0, 1.0),
            height_mm,
        };
        font::lines(&label).iter().for_each(|l| self.path(l));
    }
}

fn content(tile: Rect, page_mm: [f64; 2], inks: &[Ink], name: &str) -> String {
    let mut page = Page {
        text: String::new(),
    };
    // Millimetres from the page's lower left corner; lines with round ends.
    page.text.push_str("q\n");
    let _ = writeln!(
        page.text,
        "{POINTS_PER_MM:.9} 0 0 {POINTS_PER_MM:.9} 0 0 cm"
    );
    page.text.push_str("1 J 1 j\n");
    let origin = Vec2::new(MARGIN_MM - tile.x0, FOOT_MM - tile.y0);
    page.text.push_str("q\n");
    page.put(&[MARGIN_MM, FOOT_MM, tile.width(), tile.height()], "re");
    page.text.push_str("W n\n");
    for ink in inks {
        page.put(&[ink.grey], "G");
        page.put(&[ink.width_mm], "w");
        for (line, bounds) in &ink.lines {
            if touches(line, *bounds, tile) {
                page.path(&line.moved(|p| p + origin, false));
            }
        }
    }
    page.text.push_str("Q\n");
    // The frame, dashed.
    page.put(&[0.6], "G");
    page.put(&[0.1], "w");
    page.text.push_str("[2 2] 0 d\n");
    page.put(&[MARGIN_MM, FOOT_MM, tile.width(), tile.height()], "re");
    page.text.push_str("S\n[] 0 d\n");
    // Crosses in the middle of what two or four pages share.
    page.put(&[0.0], "G");
    page.put(&[0.15], "w");
    let inset = 0.5 * OVERLAP_MM;
    for x in [MARGIN_MM + inset, MARGIN_MM + tile.width() - inset] {
        for y in [FOOT_MM + inset, FOOT_MM + tile.height() - inset] {
            page.line(Point::new(x - CROSS_MM, y), Point::new(x + CROSS_MM, y));
            page.line(Point::new(x, y - CROSS_MM), Point::new(x, y + CROSS_MM));
        }
    }
    // The ruler: a tick each centimetre.
    page.put(&[0.2], "w");
    let (x, y) = (MARGIN_MM, 10.0);
    page.line(Point::new(x, y), Point::new(x + RULER_MM, y));
    for tick in 0..=10 {
        let at = x + 0.1 * RULER_MM * f64::from(tick);
        let high = if tick % 5 == 0 { 4.0 } else { 2.0 };
        page.line(Point::new(at, y), Point::new(at, y + high));
    }
    page.words("100 MM", Point::new(x + RULER_MM + 3.0, y), 3.0);
    let width = font::width_mm(name, 4.0);
    page.words(name, Point::new(page_mm[0] - MARGIN_MM - width, y), 4.0);
    page.text.push_str("Q\n");
    page.text
}

/// A PDF of pages with these contents. Viewers are asked not to scale it when it is printed.
fn pdf(contents: &[String], page_mm: [f64; 2]) -> Vec<u8> {
    let mut text = String::from("%PDF-1.4\n");
    let mut offsets = Vec::with_capacity(2 + 2 * contents.len());
    let mut object = |text: &mut String, body: &str| {
        offsets.push(text.len());
        let _ = write!(text, "{} 0 obj\n{body}\nendobj\n", offsets.len());
    };
    object(
        &mut text,
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
    );
    let kids: Vec<String> = (0..contents.len())
        .map(|n| format!("{} 0 R", 3 + 2 * n))
        .collect();
    let size = page_mm.map(|mm| short(mm * POINTS_PER_MM, DECIMALS));
    object(
        &mut text,
        &format!(
            "<< /Type /Pages /Count {} /MediaBox [0 0 {} {}] /Kids [{}] >>",
            contents.len(),
            size[0],
            size[1],
            kids.join(" ")
        ),
    );
    for (n, content) in contents.iter().enumerate() {
        object(
            &mut text,
            &format!(
                "<< /Type /Page /Parent 2 0 R /Resources << >> /Contents {} 0 R >>",
                4 + 2 * n
            ),
        );
        object(
            &mut text,
            &format!(
                "<< /Length {} >>\nstream\n{content}\nendstream",
                content.len() + 1
            ),
        );
    }
    let start = text.len();
    let _ = write!(text, "xref\n0 {}\n0000000000 65535 f \n", offsets.len() + 1);
    for offset in &offsets {
        let _ = writeln!(text, "{offset:010} 00000 n ");
    }
    let _ = write!(
        text,
        "trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n",
        offsets.len() + 1
    );
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linkage::{Handedness, Linkage, cylinder_with_flaps};
    use crate::pattern::SheetOptions;

    fn sheet(radius: i32, edge: f64) -> Sheet {
        let linkage = Linkage::patch(edge, Handedness::Right, &Linkage::hexagon_cells(radius));
        Sheet::new(&linkage, &SheetOptions::plain(0.8, 0.2)).unwrap()
    }

    /// Segments of each page in millimetres of the page, from the PDF's operators m, l and c alone.
    fn read(pdf: &[u8]) -> Vec<Vec<[Point; 2]>> {
        let text = std::str::from_utf8(pdf).unwrap();
        let mut pages = Vec::new();
        for stream in text.split("stream\n").skip(1).step_by(2) {
            let (mut stack, mut at, mut scale, mut lines) = (vec![], Point::ORIGIN, 0.0, vec![]);
            for word in stream.split_whitespace() {
                let to = |stack: &[f64], scale: f64| {
                    let n = stack.len();
                    let mm = scale / POINTS_PER_MM;
                    Point::new(stack[n - 2] * mm, stack[n - 1] * mm)
                };
                match word {
                    "cm" => (scale, stack) = (stack[0], vec![]),
                    "m" => (at, stack) = (to(&stack, scale), vec![]),
                    "l" | "c" => {
                        let next = to(&stack, scale);
                        lines.push([at, next]);
                        (at, stack) = (next, vec![]);
                    }
                    "endstream" => break,
                    _ => match word.parse::<f64>() {
                        Ok(v) => stack.push(v),
                        Err(_) => stack.clear(),
                    },
                }
            }
            pages.push(lines);
        }
        pages
    }

    #[test]
    fn every_slit_is_on_paper_where_it_should_be_and_as_long_as_it_is() {
        let (linkage, flaps) = cylinder_with_flaps(20.0, 30, 12);
        let tube = Sheet::with_flaps(&linkage, &flaps, &SheetOptions::plain(0.8, 0.2)).unwrap();
        for sheet in [sheet(2, 20.0), sheet(5, 30.0), tube] {
            for paper in [Paper::A4, Paper::Letter] {
                let made = template(&sheet, paper).unwrap();
                let pages = read(&made.pdf);
                assert_eq!((pages.len(), made.tiles.len()), (made.pages, made.pages));
                assert!(made.pages <= made.grid[0] * made.grid[1]);
                for slit in &sheet.slits {
                    let mut length = 0.0;
                    let mut whole = false;
                    for (tile, lines) in made.tiles.iter().zip(&pages) {
                        let place =
                            |p: Point| p + Vec2::new(MARGIN_MM - tile.x0, FOOT_MM - tile.y0);
                        let (a, b) = (place(slit.tail), place(slit.tip));
                        let hit =
                            |l: &&[Point; 2]| l[0].distance(a) < 1e-3 && l[1].distance(b) < 1e-3;
                        if let Some(l) = lines.iter().find(hit) {
                            length = l[0].distance(l[1]);
                            whole |= tile.contains(slit.tail) && tile.contains(slit.tip);
                        }
                    }
                    assert!((length - slit.tail.distance(slit.tip)).abs() < 1e-3);
                    // A slit no longer than the overlap is whole on one page.
                    assert!(whole || slit.tail.distance(slit.tip) > OVERLAP_MM);
                }
                for lines in &pages {
                    let ruler = |l: &[Point; 2]| (l[0].distance(l[1]) - 100.0).abs() < 1e-3;
                    assert_eq!(
                        lines
                            .iter()
                            .filter(|l| ruler(l) && l[0].y == l[1].y && l[0].y < 15.0)
                            .count(),
                        1
                    );
                }
            }
        }
    }

    #[test]
    fn pages_are_as_many_as_the_sheet_takes() {
        // 104 x 90 mm with its room: one page.
        assert_eq!(template(&sheet(5, 10.0), Paper::A4).unwrap().pages, 1);
        // 404 x 350 mm: upright 3 by 2 pages of 190 x 267, across 2 by 3 of 277 x 180.
        let made = template(&sheet(10, 20.0), Paper::A4).unwrap();
        assert_eq!(made.page_mm, [210.0, 297.0]);
        assert_eq!(made.grid, [3, 2]);
        // Below the right corner of the hexagon there is nothing.
        assert_eq!(made.pages, 5);
        for (a, b) in made.tiles.iter().zip(&made.tiles[1..3]) {
            assert!((a.intersect(*b).width() - OVERLAP_MM).abs() < 1e-9);
        }
        // A long strip lies across.
        let cells: Vec<_> = (0..26)
            .flat_map(|i| {
                [
                    (i, 0, crate::linkage::Colour::Up),
                    (i, 0, crate::linkage::Colour::Down),
                ]
            })
            .collect();
        let strip = Linkage::patch(10.0, Handedness::Right, &cells);
        let strip = Sheet::new(&strip, &SheetOptions::plain(0.8, 0.2)).unwrap();
        let made = template(&strip, Paper::A4).unwrap();
        assert_eq!((made.pages, made.page_mm), (1, [297.0, 210.0]));
    }

    #[test]
    fn what_nobody_prints_is_refused() {
        let mut nothing = sheet(1, 10.0);
        nothing.contours.clear();
        assert_eq!(template(&nothing, Paper::A4), Err(TemplateError::Empty));
        let error = template(&sheet(2, 4000.0), Paper::Letter).unwrap_err();
        assert!(matches!(error, TemplateError::TooManyPages { .. }));
    }

    #[test]
    fn the_cross_reference_points_at_objects() {
        let pdf = template(&sheet(2, 30.0), Paper::A4).unwrap().pdf;
        let text = std::str::from_utf8(&pdf).unwrap();
        let table = text.split("xref\n").nth(1).unwrap();
        let mut count = 0;
        for line in table.lines().skip(2).take_while(|l| l.ends_with("n ")) {
            count += 1;
            let at: usize = line[..10].parse().unwrap();
            assert!(text[at..].starts_with(&format!("{count} 0 obj")));
            assert_eq!(line.len(), 19, "twenty bytes with the line's end");
        }
        assert_eq!(count, text.matches(" 0 obj").count());
        let start: usize = text
            .rsplit("startxref\n")
            .next()
            .unwrap()
            .lines()
            .next()
            .unwrap()
            .parse()
            .unwrap();
        assert!(text[start..].starts_with("xref"));
        for stream in text.split("/Length ").skip(1) {
            let length: usize = stream.split(' ').next().unwrap().parse().unwrap();
            let begin = stream.find("stream\n").unwrap() + "stream\n".len();
            assert_eq!(stream.find("endstream").unwrap() - begin, length);
        }
    }
}
