//! Jogging: a motion that changes no modal state.

use super::block::Words;
use super::{Action, Modal};

/// Interprets what follows `$J=`: a place or a distance, a feed, and nothing else but G20, G21, G53, G90, G91, for this
/// motion alone.
///
/// # Errors
/// GRBL's number: 16 what must not stand in a jog, 22 no feed, 26 no axis, and those of any line.
pub(crate) fn interpret_jog(line: &[u8], modal: &Modal) -> Result<Action, u8> {
    let mut words = Words::read(line)?;
    let axis_words = [b'X', b'Y', b'Z'].map(|l| words.take(l));
    let mode_words = words.motion.is_some()
        || words.plane.is_some()
        || words.system.is_some()
        || words.inverse_time.is_some()
        || words.tool_length.is_some()
        || words.flow.is_some()
        || words.spindle.is_some()
        || words.coolant.is_some()
        || matches!(words.other, Some(code) if code != 530);
    if mode_words {
        return Err(16);
    }
    words.take(b'N');
    let unit = if words.inches.unwrap_or(modal.inches) {
        25.4
    } else {
        1.0
    };
    let feed = words.take(b'F').filter(|f| *f > 0.0).ok_or(22u8)?;
    if axis_words.iter().all(Option::is_none) {
        return Err(26);
    }
    if words.value.iter().any(Option::is_some) {
        return Err(16);
    }
    let frame = Modal {
        incremental: words.incremental.unwrap_or(modal.incremental),
        ..modal.clone()
    };
    let target = frame.target(axis_words, unit, words.other == Some(530));
    if target.iter().any(|t| !t.is_finite() || t.abs() > 1e6) {
        return Err(33);
    }
    Ok(Action::Jog {
        target,
        rate_mm_min: feed * unit,
    })
}
