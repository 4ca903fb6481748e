//! Why readings, or a question, cannot be answered, and what to do.

use crate::base::units::short;

/// Why there is no bound.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// A reading does not pass its own checks.
    #[error("{0}")]
    Reading(String),
    /// A noise that makes no sense.
    #[error(
        "a reading noise of {noise} is not between 0 and {most}: it is relative, 0.01 for one per cent"
    )]
    Noise {
        /// What was given.
        noise: f64,
        /// The most that is taken.
        most: f64,
    },
    /// One strip does not show how strips differ.
    #[error(
        "{strips} strip(s) were read, and a bound needs at least two: one strip does not show how much hinges differ. Pull another of the same kind; three or more give a bound that is of use"
    )]
    TooFew {
        /// Strips with a reading.
        strips: usize,
    },
    /// No strip failed.
    #[error(
        "no strip failed, all held at {held}: there is no limit to be seen. {}",
        if *full {
            "They were fully open: cut strips with wider hinges or a shorter edge, which strain the material more, or state sigma.max by hand"
        } else {
            "Pull them farther, until a hinge fails or they are fully open"
        }
    )]
    NothingTore {
        /// The least of the last stretches that held.
        held: f64,
        /// Whether they were fully open.
        full: bool,
    },
    /// Every strip failed at its first mark.
    #[error(
        "every strip failed at its first mark, by {tore}: it is not known what they would have held. Pull strips in smaller steps from 1 on, or cut narrower hinges or wider tips, which strain the material less"
    )]
    AllTore {
        /// The largest of these marks.
        tore: f64,
    },
    /// A stretch that the hinges do not allow.
    #[error(
        "{strip} is said to have held at {held}, and its hinges are fully open at {most:.3}: check the gauge, and the measures of the strip"
    )]
    BeyondOpen {
        /// Its name.
        strip: String,
        /// What was read.
        held: f64,
        /// The largest stretch of its geometry.
        most: f64,
    },
    /// Strips of different sheets.
    #[error(
        "{strip} is {thickness_mm} mm thick and the first one {other_mm} mm: these are different materials; fit them apart"
    )]
    Thicknesses {
        /// Its name.
        strip: String,
        /// Its thickness.
        thickness_mm: f64,
        /// That of the first strip.
        other_mm: f64,
    },
    /// One strip is beyond all the others.
    #[error(
        "{strip} failed far too {} for what the other strips say, whatever the spread of the hinges. Check its reading and its measures; if they are right, pull another strip of the same kind, and leave none out",
        if *low { "early" } else { "late" }
    )]
    Contradiction {
        /// Its name.
        strip: String,
        /// Whether it failed too early.
        low: bool,
    },
    /// Measures that make no hinge.
    #[error(
        "hinges of {} mm with a kerf of {} mm do not fit on edges of {} mm", short(*hinge_width_mm, 3), short(*kerf_mm, 3), short(*edge_mm, 3)
    )]
    Unsound {
        /// Width asked.
        hinge_width_mm: f64,
        /// Kerf asked.
        kerf_mm: f64,
        /// Edge asked.
        edge_mm: f64,
    },
    /// Far from all strips.
    #[error(
        "{} of {asked} mm was asked, and the strips have {} to {} mm: too far to say anything. Pull two or more strips of {asked} mm", what.words(), short(*low, 3), short(*high, 3), asked = short(*asked, 3)
    )]
    Outside {
        /// Which measure.
        what: Measure,
        /// What was asked, millimetres.
        asked: f64,
        /// The least that was pulled.
        low: f64,
        /// The most that was pulled.
        high: f64,
    },
    /// A confidence that is none.
    #[error("a confidence of {confidence} is not between 0.5 and 0.999")]
    Confidence {
        /// What was given.
        confidence: f64,
    },
    /// Nothing opens.
    #[error("the sheet has no hinges that open")]
    NoHinges,
}

/// A measure of a hinge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Measure {
    /// Width h.
    Width,
    /// Kerf k.
    Kerf,
    /// Radius r of the tip.
    Tip,
    /// Thickness t.
    Thickness,
    /// Edge L.
    Edge,
}

impl Measure {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Width => "a hinge width",
            Self::Kerf => "a kerf",
            Self::Tip => "a tip radius",
            Self::Thickness => "a thickness",
            Self::Edge => "an edge",
        }
    }
}
