//! The readings asked for one by one, on any pair of reader and writer.

use std::io::{BufRead, Write};

use crate::calibrate::{
    Answer, Coupon, Item, Readings, check_calipers, check_stretch, failure, items, number, pulled,
    yes,
};
use crate::cli::Failure;

/// What a person typed.
enum Typed {
    Nothing,
    Back,
    Rest,
    Words(String),
}

/// What follows an item.
enum Next {
    Answered(Option<Answer>),
    Back,
    Rest,
}

struct Talk<'a> {
    reader: &'a mut dyn BufRead,
    writer: &'a mut dyn Write,
}

impl Talk<'_> {
    fn say(&mut self, text: &str) -> Result<(), Failure> {
        let done = self.writer.write_all(text.as_bytes());
        done.and_then(|()| self.writer.flush())
            .map_err(|e| Failure::Bad(format!("the terminal cannot be written to: {e}")))
    }

    fn hear(&mut self, question: &str) -> Result<Typed, Failure> {
        self.say(question)?;
        let mut line = String::new();
        let read = self
            .reader
            .read_line(&mut line)
            .map_err(|e| Failure::Bad(format!("the terminal cannot be read: {e}")))?;
        if read == 0 {
            return Err(Failure::Bad(
                "the dialogue was left before its end, and nothing is written; `done` leaves the rest unmeasured".into(),
            ));
        }
        Ok(match line.trim() {
            "" => Typed::Nothing,
            word if word.eq_ignore_ascii_case("back") => Typed::Back,
            word if word.eq_ignore_ascii_case("done") => Typed::Rest,
            word => Typed::Words(word.to_owned()),
        })
    }

    /// Asks until the answer is one.
    fn value<T>(
        &mut self,
        question: &str,
        read: impl Fn(&str) -> Result<T, String>,
    ) -> Result<Result<T, Typed>, Failure> {
        loop {
            match self.hear(question)? {
                Typed::Words(text) => match read(&text) {
                    Ok(value) => return Ok(Ok(value)),
                    Err(problem) => self.say(&format!("    That {problem}\n"))?,
                },
                other => return Ok(Err(other)),
            }
        }
    }

    fn item(&mut self, item: Item<'_>) -> Result<Next, Failure> {
        let name = item.name();
        let simple = |found: Result<Answer, Typed>| match found {
            Ok(answer) => Next::Answered(Some(answer)),
            Err(Typed::Back) => Next::Back,
            Err(Typed::Rest) => Next::Rest,
            Err(_) => Next::Answered(None),
        };
        match item {
            Item::Setting(square) => {
                let question = format!(
                    "{name}, {} % at {} mm/min: cut through? yes or no: ",
                    square.power_percent, square.speed_mm_per_min
                );
                Ok(simple(
                    self.value(&question, |t| yes(t).map(Answer::CutThrough))?,
                ))
            }
            Item::Kerf(piece) => {
                let nominal = piece.nominal_mm;
                let question = format!("{name}: what do the calipers say, mm: ");
                let read = |text: &str| {
                    let value = number(text)?;
                    check_calipers(value, nominal)?;
                    Ok(Answer::Calipers(value))
                };
                Ok(simple(self.value(&question, read)?))
            }
            Item::Strip(strip) => loop {
                let question = format!(
                    "{name}, hinges of {} mm: last stretch that held (1 if it failed at once): ",
                    strip.hinge_width_mm
                );
                let stretch = |text: &str| {
                    let value = number(text)?;
                    check_stretch(value, strip)?;
                    Ok(value)
                };
                let held = match self.value(&question, stretch)? {
                    Ok(value) => value,
                    Err(other) => return Ok(simple(Err(other))),
                };
                let tore = match self.value("    failed at (Enter: never): ", stretch)? {
                    Ok(value) => Some(value),
                    Err(Typed::Nothing) => None,
                    Err(Typed::Rest) => {
                        self.say("    `done` in the middle of a strip: finish it first.\n")?;
                        continue;
                    }
                    Err(_) => continue,
                };
                let how = match tore {
                    None => None,
                    Some(_) => {
                        match self.value("    how: torn, or plastic (stayed bent): ", failure)? {
                            Ok(how) => Some(how),
                            Err(Typed::Back) => continue,
                            Err(_) => None,
                        }
                    }
                };
                match pulled(strip, Some(held), tore, how) {
                    Ok(answer) => return Ok(Next::Answered(answer.map(Answer::Pulled))),
                    Err(wrong) => {
                        self.say(&format!("    {} {}. Again:\n", wrong.column, wrong.problem))?;
                    }
                }
            },
        }
    }
}

/// Asks for every item of a coupon.
pub(super) fn ask(
    coupon: &Coupon,
    date: &str,
    reader: &mut dyn BufRead,
    writer: &mut dyn Write,
) -> Result<Readings, Failure> {
    let all = items(coupon);
    let mut talk = Talk { reader, writer };
    talk.say(&format!(
        "Coupon of {} on {}. Enter: not measured; back: the one before; done: no more.\n",
        coupon.material, coupon.machine
    ))?;
    let mut answers: Vec<Option<Answer>> = vec![None; all.len()];
    let mut at = 0;
    loop {
        while let Some(&item) = all.get(at) {
            match talk.item(item)? {
                Next::Back => {
                    at = at.saturating_sub(1);
                    continue;
                }
                Next::Rest => break,
                Next::Answered(answer) => answers[at] = answer,
            }
            if answers[at].is_some() && !keeps(&mut talk, coupon, date, &all, &answers, at)? {
                answers[at] = None;
                continue;
            }
            at += 1;
        }
        let given = given(&all, &answers);
        if given.is_empty() {
            return Err(Failure::Bad("nothing was read; nothing is written".into()));
        }
        match Readings::of_answers(&given, coupon, date) {
            Ok(readings) => return Ok(readings),
            Err(refused) => {
                let name = refused.item.map(|n| given[n].0.name());
                talk.say(&format!(
                    "{}{} {}\n",
                    name.map_or(String::new(), |n| format!("{n}: ")),
                    refused.wrong.column,
                    refused.wrong.problem
                ))?;
                // To the one to blame, else to the first for calipers.
                at = all
                    .iter()
                    .position(|i| match name {
                        Some(name) => i.name() == name,
                        None => matches!(i, Item::Kerf(_)),
                    })
                    .unwrap_or(0);
            }
        }
    }
}

fn given<'a>(all: &[Item<'a>], answers: &[Option<Answer>]) -> Vec<(Item<'a>, Answer)> {
    let answered = all.iter().zip(answers);
    answered.filter_map(|(i, a)| Some((*i, (*a)?))).collect()
}

/// Shows what looks wrong about an answer, and whether it stays.
fn keeps(
    talk: &mut Talk<'_>,
    coupon: &Coupon,
    date: &str,
    all: &[Item<'_>],
    answers: &[Option<Answer>],
    at: usize,
) -> Result<bool, Failure> {
    // What cannot be put together yet is told at the end.
    let Ok(readings) = Readings::of_answers(&given(all, answers), coupon, date) else {
        return Ok(true);
    };
    let doubts: Vec<String> = readings
        .doubts()
        .into_iter()
        .filter(|d| d.name.as_deref() == Some(all[at].name()))
        .map(|d| d.to_string())
        .collect();
    if doubts.is_empty() {
        return Ok(true);
    }
    for doubt in doubts {
        talk.say(&format!("    looks wrong: {doubt}\n"))?;
    }
    let answer = talk.hear("    Enter keeps it, back asks again: ")?;
    Ok(!matches!(answer, Typed::Back))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::{KerfPiece, SettingSquare, Side, Strip};

    fn coupon() -> Coupon {
        let strip = |name: &str| Strip {
            name: name.into(),
            hinge_width_mm: 1.0,
            edge_mm: 12.0,
            hinges: 36,
            gauge_mm: 48.0,
        };
        let piece = |name: &str, side: Side| KerfPiece {
            name: name.into(),
            side,
            nominal_mm: 19.8,
        };
        Coupon {
            format: 1,
            material: "leather-1.6".into(),
            machine: "co2-600x400".into(),
            thickness_mm: 1.6,
            kerf_mm: 0.2,
            tip_radius_mm: None,
            gauge_step: 0.05,
            strip: vec![strip("A1"), strip("A2")],
            kerf: vec![piece("K1", Side::Hole), piece("K2", Side::Piece)],
            setting: vec![SettingSquare {
                name: "P1".into(),
                power_percent: 40.0,
                speed_mm_per_min: 900.0,
            }],
        }
    }

    fn talk(typed: &str) -> (Result<Readings, Failure>, String) {
        let mut shown = Vec::new();
        let found = ask(&coupon(), "2026-05-31", &mut typed.as_bytes(), &mut shown);
        (found, String::from_utf8(shown).unwrap())
    }

    #[test]
    fn everything_is_asked_once_and_enter_leaves_it_unmeasured() {
        let (found, shown) = talk("yes\n20\n\n1,35\n1.4\ntorn\n\n");
        let readings = found.unwrap();
        assert!(readings.setting[0].cut_through);
        assert_eq!(readings.kerf.len(), 1);
        assert_eq!(readings.strips.len(), 1);
        assert_eq!(readings.strips[0].held, 1.35);
        assert_eq!(readings.strips[0].strip.as_deref(), Some("A1"));
        assert!(shown.contains("A2, hinges of 1 mm"), "{shown}");
    }

    #[test]
    fn nonsense_is_asked_again_with_the_reason() {
        let typed = "perhaps\nno\ndone\nback\nno\n2.0\n20\n19.6\n135\n1.35\n1.3\ntorn\n1.35\n1.4\ntorn\ndone\n";
        let (found, shown) = talk(typed);
        // `done` at K1 ended it: only the square was read.
        let readings = found.unwrap();
        assert!(
            readings.strips.is_empty() && readings.setting.len() == 1,
            "{shown}"
        );
        assert!(shown.contains("\"perhaps\": \"yes\" or \"no\""), "{shown}");
        let typed = "\n2.0\n20\n19.6\n135\n1.35\n1.3\ntorn\n1.35\n1.4\nrotten\ntorn\ndone\n";
        let (found, shown) = talk(typed);
        let readings = found.unwrap();
        assert_eq!(readings.strips.len(), 1, "{shown}");
        assert_eq!(readings.strips[0].tore, Some(1.4));
        for word in ["centimetres", "write 1.35", "mixed up", "\"rotten\""] {
            assert!(shown.contains(word), "{word}: {shown}");
        }
    }

    #[test]
    fn back_goes_back_and_doubts_are_shown_at_once() {
        // A1 at first with a wide gap, then taken back; from A2 back to A1, which is not measured after all.
        let typed =
            "\n\n\n1.1\n1.5\ntorn\nback\n1.35\n1.4\nback\n1.35\n1.4\ntorn\nback\n\n1.3\n\n\n";
        let (found, shown) = talk(typed);
        let readings = found.unwrap();
        assert!(shown.contains("looks wrong: A1: held at 1.1"), "{shown}");
        assert_eq!(readings.strips.len(), 1);
        assert_eq!(readings.strips[0].strip.as_deref(), Some("A2"));
        assert_eq!(readings.strips[0].tore, None);
    }

    #[test]
    fn an_end_of_input_writes_nothing() {
        let (found, _) = talk("yes\n");
        assert!(matches!(found, Err(Failure::Bad(text)) if text.contains("nothing is written")));
        let (found, _) = talk("done\n");
        assert!(matches!(found, Err(Failure::Bad(text)) if text.contains("nothing was read")));
    }
}
