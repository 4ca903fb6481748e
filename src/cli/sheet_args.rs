//! Options for the shapes of what is cut and for the sheets that it is cut from.

use clap::{Args, ValueEnum};

use crate::job::{COOL_REACH_MM, RimWish, SheetWish, TAB_WIDTH_MM};
use crate::pattern::Tip;
use crate::toolpath::Heat;

/// Shapes and stock.
#[derive(Args, Clone, Debug)]
pub struct SheetArgs {
    /// A piece of stock in the corner of the bed, WIDTHxHEIGHT in millimetres [default: the whole bed]
    #[arg(long, value_name = "WxH", value_parser = size)]
    stock: Option<[f64; 2]>,
    /// Refuse a sheet that does not fit, in place of dividing it into pieces with flaps
    #[arg(long)]
    undivided: bool,
    /// Where the sheet ends: along the edges of whole triangles, or smooth, along the rim of the surface, through every
    /// triangle that keeps two hinges
    #[arg(long, value_enum, default_value = "lattice", hide_default_value = true)]
    rim: Rim,
    /// Ends of the slits: plain as the beam leaves them, round:R or teardrop:R with a finished radius in millimetres
    /// [default: the material's]
    #[arg(long, value_name = "SHAPE", value_parser = tip)]
    tip: Option<Tip>,
    /// Finished radius of the triangles' corners, 0 for sharp ones [default: the material's]
    #[arg(long, value_name = "MM", value_parser = length)]
    corner_radius: Option<f64>,
    /// Holes of this diameter in the middle of every flap triangle and of the one that it is glued on
    #[arg(long, value_name = "MM", value_parser = length, default_value_t = 0.0, hide_default_value = true)]
    alignment_holes: f64,
    /// Tabs that hold each part in the stock until they are broken: N, or N:WIDTH in millimetres
    #[arg(long, value_name = "N[:MM]", value_parser = tabs, default_value = "0", hide_default_value = true)]
    tabs: (usize, f64),
    /// Keep successive cuts apart, to spare thin material the heat: cutting next to a cut just made costs as much as PRICE
    /// millimetres of travel, less the farther away, and nothing from REACH millimetres on [default REACH: 20]
    #[arg(long, value_name = "PRICE[:REACH]", value_parser = cool)]
    cool: Option<Heat>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Rim {
    Lattice,
    Smooth,
}

impl SheetArgs {
    /// What is asked for.
    pub fn wish(&self) -> SheetWish {
        SheetWish {
            stock_mm: self.stock,
            divide: !self.undivided,
            rim: match self.rim {
                Rim::Lattice => RimWish::Lattice,
                Rim::Smooth => RimWish::Smooth { skirt_mm: None },
            },
            tip: self.tip,
            corner_radius_mm: self.corner_radius,
            alignment_hole_mm: self.alignment_holes,
            tabs: self.tabs.0,
            tab_width_mm: self.tabs.1,
            heat: self.cool.unwrap_or(Heat::NONE),
        }
    }

    /// The options that were given, by name.
    pub fn given(&self) -> Vec<&'static str> {
        [
            (self.stock.is_some(), "--stock"),
            (self.undivided, "--undivided"),
            (self.rim != Rim::Lattice, "--rim"),
            (self.tip.is_some(), "--tip"),
            (self.corner_radius.is_some(), "--corner-radius"),
            (self.alignment_holes != 0.0, "--alignment-holes"),
            (self.tabs.0 != 0, "--tabs"),
            (self.cool.is_some(), "--cool"),
        ]
        .into_iter()
        .filter_map(|(given, name)| given.then_some(name))
        .collect()
    }
}

/// A length of 0 or more, millimetres.
fn length(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if (0.0..=10_000.0).contains(&v) => Ok(v),
        _ => Err("a length in millimetres, 0 or more, for example 1.5".into()),
    }
}

/// Width and height, `WIDTHxHEIGHT` in millimetres.
pub(super) fn size(text: &str) -> Result<[f64; 2], String> {
    let wrong = || "width and height in millimetres, for example 300x200".to_owned();
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or_else(wrong)?;
    let one = |part: &str| {
        part.trim()
            .parse::<f64>()
            .ok()
            .filter(|v| (1.0..=100_000.0).contains(v))
    };
    match (one(width), one(height)) {
        (Some(width), Some(height)) => Ok([width, height]),
        _ => Err(wrong()),
    }
}

fn tip(text: &str) -> Result<Tip, String> {
    let wrong = || {
        "plain, round:R or teardrop:R with R above 0 in millimetres, for example teardrop:0.6"
            .to_owned()
    };
    if text == "plain" {
        return Ok(Tip::Plain);
    }
    let (shape, radius) = text.split_once(':').ok_or_else(wrong)?;
    let radius_mm = length(radius).ok().filter(|r| *r > 0.0).ok_or_else(wrong)?;
    match shape {
        "round" => Ok(Tip::Round { radius_mm }),
        "teardrop" => Ok(Tip::Teardrop { radius_mm }),
        _ => Err(wrong()),
    }
}

fn tabs(text: &str) -> Result<(usize, f64), String> {
    let wrong = || "how many, and how wide if not 0.5 mm, for example 4 or 4:0.8".to_owned();
    let (count, width) = text.split_once(':').unwrap_or((text, ""));
    let count: usize = count
        .parse()
        .ok()
        .filter(|n| *n <= 1000)
        .ok_or_else(wrong)?;
    let width = match width {
        "" => TAB_WIDTH_MM,
        width => length(width).ok().filter(|w| *w > 0.0).ok_or_else(wrong)?,
    };
    Ok((count, width))
}

fn cool(text: &str) -> Result<Heat, String> {
    let wrong = || {
        "a price in millimetres of travel, and from how far away on nothing is paid if not 20 mm, both above 0: for example 20 or 20:15".to_owned()
    };
    let (price, reach) = text.split_once(':').unwrap_or((text, ""));
    let positive = |text: &str| length(text).ok().filter(|v| *v > 0.0).ok_or_else(wrong);
    Ok(Heat {
        price_mm: positive(price)?,
        reach_mm: match reach {
            "" => COOL_REACH_MM,
            reach => positive(reach)?,
        },
    })
}
