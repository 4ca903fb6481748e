//! A maker's rows put to the items of a coupon.

use std::ops::Range;

use toml::Spanned;

use super::paper::{Paper, Row};
use super::words::{self, Pulled, Wrong};
use super::{FORMAT, MeasuredPiece, Readings, TriedSetting};
use crate::base::document::DocumentError;
use crate::base::units::rounded;
use crate::calibrate::coupon::{Coupon, KerfPiece, SettingSquare, Strip};
use crate::calibrate::kerf::{KerfError, kerf};
use crate::material::{Reading, check_date};

/// With which confidence outliers of the calipers are judged; the kerf itself does not depend on it.
const CONFIDENCE: f64 = 0.9;

/// Something on a coupon that can be measured.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Item<'a> {
    Strip(&'a Strip),
    Kerf(&'a KerfPiece),
    Setting(&'a SettingSquare),
}

impl<'a> Item<'a> {
    pub fn name(self) -> &'a str {
        match self {
            Self::Strip(strip) => &strip.name,
            Self::Kerf(piece) => &piece.name,
            Self::Setting(square) => &square.name,
        }
    }

    fn takes(self, column: &str) -> bool {
        match self {
            Self::Strip(_) => ["held", "tore", "failure"].contains(&column),
            Self::Kerf(_) => column == "measured_mm",
            Self::Setting(_) => column == "cut_through",
        }
    }

    fn what(self) -> &'static str {
        match self {
            Self::Strip(_) => "a strip, which takes held, tore and failure",
            Self::Kerf(_) => "for calipers and takes measured_mm only",
            Self::Setting(_) => "a square of the setting grid and takes cut_through only",
        }
    }
}

/// Everything on a coupon in the order in which it is measured.
pub(crate) fn items(coupon: &Coupon) -> Vec<Item<'_>> {
    let squares = coupon.setting.iter().map(Item::Setting);
    let pieces = coupon.kerf.iter().map(Item::Kerf);
    let strips = coupon.strip.iter().map(Item::Strip);
    squares.chain(pieces).chain(strips).collect()
}

/// What was read of an item.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Answer {
    Pulled(Pulled),
    Calipers(f64),
    CutThrough(bool),
}

/// An item with its answer, the day if it has its own, and where it stands in the file.
struct Found<'a> {
    item: Item<'a>,
    answer: Answer,
    date: Option<String>,
    row: Option<&'a Row>,
}

/// Why answers are no readings: which item, if one is to blame.
#[derive(Debug)]
pub(crate) struct Refused {
    pub item: Option<usize>,
    pub wrong: Wrong,
}

pub(super) fn merge(paper: &Paper, coupon: &Coupon, date: &str) -> Result<Readings, DocumentError> {
    let document = &paper.document;
    let blame = |column: &str, problem: String, span: Range<usize>| {
        document.blame(Some(column.into()), problem, Some(span))
    };
    if let Some(other) = &paper.coupon {
        let (material, machine) = other.get_ref();
        let same =
            *material == coupon.material && (machine.is_empty() || *machine == coupon.machine);
        if !same {
            return Err(blame(
                "material",
                format!(
                    "these readings are of a coupon of {material} on {machine}, and this coupon is of {} on {}: name the other coupon",
                    coupon.material, coupon.machine
                ),
                other.span(),
            ));
        }
    }
    let checked = |given: &Option<Spanned<String>>| -> Result<Option<String>, DocumentError> {
        let Some(day) = given else { return Ok(None) };
        check_date("date", day.get_ref())
            .map_err(|c| blame("date", format!("date {}", c.problem), day.span()))?;
        Ok(Some(day.get_ref().clone()))
    };
    let day = checked(&paper.date)?;
    let date = day.as_deref().unwrap_or(date);
    let all = items(coupon);
    let mut seen: Vec<&str> = Vec::new();
    let mut found = Vec::new();
    for row in &paper.rows {
        let name = row.name.get_ref().trim();
        let Some(&item) = all.iter().find(|i| i.name().eq_ignore_ascii_case(name)) else {
            return Err(blame(
                "name",
                format!(
                    "{name:?} is not on this coupon of {}; on it are {}",
                    coupon.material,
                    names(&all)
                ),
                row.name.span(),
            ));
        };
        if seen.contains(&item.name()) {
            return Err(blame(
                "name",
                format!("{} stands twice: which line is right?", item.name()),
                row.name.span(),
            ));
        }
        seen.push(item.name());
        if let Some(column) = row.filled().find(|c| !item.takes(c)) {
            return Err(blame(
                column,
                format!(
                    "{} has {column} filled in, and is {}",
                    item.name(),
                    item.what()
                ),
                row.span(column),
            ));
        }
        let answer = answer(item, row).map_err(|wrong| {
            blame(
                wrong.column,
                format!("{}: {} {}", item.name(), wrong.column, wrong.problem),
                row.span(wrong.column),
            )
        })?;
        if let Some(answer) = answer {
            found.push(Found {
                item,
                answer,
                date: checked(&row.date)?,
                row: Some(row),
            });
        }
    }
    if found.is_empty() {
        return Err(document.blame(
            None,
            "nothing was read: no line has a value filled in".into(),
            None,
        ));
    }
    put_together(&found, coupon, date).map_err(|refused| {
        let row = refused.item.and_then(|n| found[n].row);
        let column = refused.wrong.column;
        let name = refused.item.map(|n| found[n].item.name());
        let problem = match name {
            Some(name) => format!("{name}: {column} {}", refused.wrong.problem),
            None => refused.wrong.problem,
        };
        document.blame(Some(column.into()), problem, row.map(|r| r.span(column)))
    })
}

fn names(all: &[Item<'_>]) -> String {
    let names: Vec<&str> = all.iter().map(|i| i.name()).collect();
    names.join(", ")
}

/// What a row says of its item; `None` if nothing.
fn answer(item: Item<'_>, row: &Row) -> Result<Option<Answer>, Wrong> {
    let value = |cell: &Option<Spanned<f64>>| cell.as_ref().map(|c| *c.get_ref());
    match item {
        Item::Strip(strip) => {
            let failure = row.failure.as_ref().map(|c| *c.get_ref());
            let pulled = words::pulled(strip, value(&row.held), value(&row.tore), failure)?;
            Ok(pulled.map(Answer::Pulled))
        }
        Item::Kerf(piece) => {
            let Some(measured_mm) = value(&row.measured_mm) else {
                return Ok(None);
            };
            words::check_calipers(measured_mm, piece.nominal_mm)
                .map_err(|problem| Wrong::new("measured_mm", problem))?;
            Ok(Some(Answer::Calipers(measured_mm)))
        }
        Item::Setting(_) => Ok(row
            .cut_through
            .as_ref()
            .map(|c| Answer::CutThrough(*c.get_ref()))),
    }
}

impl Readings {
    /// From answers that were checked one by one.
    pub(crate) fn of_answers(
        answers: &[(Item<'_>, Answer)],
        coupon: &Coupon,
        date: &str,
    ) -> Result<Self, Refused> {
        let found: Vec<Found<'_>> = answers
            .iter()
            .map(|&(item, answer)| Found {
                item,
                answer,
                date: None,
                row: None,
            })
            .collect();
        put_together(&found, coupon, date)
    }
}

/// Ten-thousandths of a millimetre, so that a measured kerf is a number to be read.
pub(crate) const KERF_DECIMALS: i32 = 4;

fn put_together(found: &[Found<'_>], coupon: &Coupon, date: &str) -> Result<Readings, Refused> {
    let (mut pieces, mut places, mut setting) = (Vec::new(), Vec::new(), Vec::new());
    for (n, found) in found.iter().enumerate() {
        match (found.item, found.answer) {
            (Item::Kerf(piece), Answer::Calipers(measured_mm)) => {
                places.push(n);
                pieces.push(MeasuredPiece {
                    name: piece.name.clone(),
                    side: piece.side,
                    nominal_mm: piece.nominal_mm,
                    measured_mm,
                });
            }
            (Item::Setting(square), Answer::CutThrough(cut_through)) => {
                setting.push(TriedSetting {
                    name: square.name.clone(),
                    power_percent: square.power_percent,
                    speed_mm_per_min: square.speed_mm_per_min,
                    cut_through,
                });
            }
            _ => {}
        }
    }
    let kerf_mm = measured(&pieces, &places)?.unwrap_or(coupon.kerf_mm);
    // Half of it on each side of both cuts that leave a hinge.
    let more = coupon.kerf_mm - kerf_mm;
    let mut strips = Vec::new();
    for (n, found) in found.iter().enumerate() {
        let (Item::Strip(strip), Answer::Pulled(pulled)) = (found.item, found.answer) else {
            continue;
        };
        let reading = Reading {
            strip: Some(strip.name.clone()),
            date: found.date.clone().unwrap_or_else(|| date.to_owned()),
            hinge_width_mm: rounded(strip.hinge_width_mm + more, KERF_DECIMALS),
            kerf_mm,
            tip_radius_mm: coupon
                .tip_radius_mm
                .map(|r| rounded(r - 0.5 * more, KERF_DECIMALS)),
            thickness_mm: coupon.thickness_mm,
            edge_mm: strip.edge_mm,
            hinges: strip.hinges,
            held: pulled.held,
            tore: pulled.tore,
            failure: pulled.failure,
        };
        reading.check("").map_err(|complaint| Refused {
            item: Some(n),
            wrong: Wrong::new(
                "held",
                format!(
                    "cannot be used: with a kerf of {kerf_mm} mm, {} {}",
                    complaint.key.trim_start_matches('.'),
                    complaint.problem
                ),
            ),
        })?;
        strips.push(reading);
    }
    Ok(Readings {
        format: FORMAT,
        material: coupon.material.clone(),
        machine: coupon.machine.clone(),
        date: date.to_owned(),
        thickness_mm: coupon.thickness_mm,
        drawn_kerf_mm: coupon.kerf_mm,
        gauge_step: coupon.gauge_step,
        strips,
        kerf: pieces,
        setting,
    })
}

/// The kerf; none if too little was measured for one, which is a doubt and no error.
fn measured(pieces: &[MeasuredPiece], places: &[usize]) -> Result<Option<f64>, Refused> {
    let readings: Vec<_> = pieces.iter().map(MeasuredPiece::reading).collect();
    match kerf(&readings, CONFIDENCE) {
        Ok(found) => Ok(Some(rounded(found.kerf_mm, KERF_DECIMALS))),
        Err(KerfError::TooFew { .. }) => Ok(None),
        Err(error) => {
            let item = match error {
                KerfError::Reading { number, .. } | KerfError::Outlier { number, .. } => {
                    places.get(number - 1).copied()
                }
                _ => None,
            };
            let problem = match error {
                KerfError::Outlier { off_mm, .. } => {
                    format!("is {off_mm:+.2} mm off what the others say: measure it again")
                }
                other => other.to_string(),
            };
            Err(Refused {
                item,
                wrong: Wrong::new("measured_mm", problem),
            })
        }
    }
}
