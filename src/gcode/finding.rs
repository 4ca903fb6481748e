//! What is wrong with a job, where, and by which rule.

use std::fmt;

use kurbo::Point;

use crate::base::units::short;

/// How far a burnt line may be from a wanted one and still be it, millimetres. Rounding to three decimals takes 0.0007.
pub const TOLERANCE_MM: f64 = 0.01;

/// What a job must do or not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// The controller would refuse the line, or nobody can say what it does.
    Syntax,
    /// No line longer than the controller's limit.
    LineTooLong,
    /// Unit, distance mode and position are known before the first motion.
    Modes,
    /// The head stays on the bed.
    OffBed,
    /// No rapid arms the beam.
    BurnOnRapid,
    /// The beam is never on at rest.
    StandingBeam,
    /// A torch cuts at one height, above the sheet, and travels higher.
    Height,
    /// M3 only where the machine's profile accepts it.
    ConstantPower,
    /// The material that the job selects at the table is the one that it was made for.
    Material,
    /// Every burning move has a feed above 0 and within the machine's rates.
    Feed,
    /// Power within the machine's scale.
    Power,
    /// The beam is switched off before the end.
    BeamAtEnd,
    /// Every wanted cut is made, as often as wanted.
    Missing,
    /// No wanted cut is made more often.
    Repeated,
    /// Nothing else is burnt.
    Stray,
    /// No ligament is narrower than the hinge width.
    Ligament,
    /// Nothing falls out before the rim is cut.
    Loose,
    /// Rims come after everything inside them.
    Order,
    /// No pierce hole touches a ligament or what stays.
    Pierce,
    /// Marks are engraved with less than what cuts.
    Engraving,
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Finding {
    /// Line of the G-code, counted from 1, where one can be named.
    pub line: Option<usize>,
    /// The rule that is broken.
    pub rule: Rule,
    /// What, where, in words.
    pub text: String,
}

impl Finding {
    pub(super) fn at(line: usize, rule: Rule, text: String) -> Self {
        Self {
            line: Some(line),
            rule,
            text,
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "line {line}: {}", self.text),
            None => f.write_str(&self.text),
        }
    }
}

/// A place in words.
pub(super) fn place(p: Point) -> String {
    format!("({}, {})", short(p.x, 3), short(p.y, 3))
}
