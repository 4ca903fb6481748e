//! Places that the controller remembers: coordinate systems, and the two that G28 and G30 go to.

use super::block::Words;
use super::{Action, Modal};

/// G10 L2 and L20: where a work coordinate system has its origin.
pub(super) fn set_system(
    words: &mut Words,
    axis_words: [Option<f64>; 3],
    unit: f64,
    next: &mut Modal,
    todo: &mut Vec<Action>,
) -> Result<(), u8> {
    if axis_words.iter().all(Option::is_none) {
        return Err(26);
    }
    let (Some(l), Some(p)) = (words.take(b'L'), words.take(b'P')) else {
        return Err(28);
    };
    if l != 2.0 && l != 20.0 {
        return Err(20);
    }
    let index = match p {
        0.0 => next.system,
        1.0..=6.0 => {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "1 to 6"
            )]
            let index = p as usize - 1;
            index
        }
        _ => return Err(29),
    };
    for (k, word) in axis_words.iter().enumerate() {
        if let Some(value) = word {
            next.systems[index][k] = if l == 2.0 {
                value * unit
            } else {
                next.position[k] - next.g92[k] - next.tool_offset(k) - value * unit
            };
        }
    }
    todo.push(Action::Sync);
    todo.push(Action::Memory);
    Ok(())
}

/// G28.1 and G30.1: the present place is remembered.
pub(super) fn remembered(second: bool, next: &mut Modal, todo: &mut Vec<Action>) {
    next.places[usize::from(second)] = next.position;
    todo.push(Action::Sync);
    todo.push(Action::Memory);
}
