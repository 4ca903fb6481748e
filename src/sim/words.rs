//! A line of G-code as letters and numbers, with GRBL's opinions on both.

/// Reads the next word of `line` at `*at`, GRBL's way: a letter, then digits with at most one point; no exponent.
///
/// # Errors
/// 1 no letter, 2 no number.
pub(crate) fn next_word(line: &[u8], at: &mut usize) -> Result<(u8, f64), u8> {
    let letter = line[*at];
    if !letter.is_ascii_uppercase() {
        return Err(1);
    }
    *at += 1;
    Ok((letter, number(line, at)?))
}

/// A number in GRBL's notation.
///
/// # Errors
/// 2 if there is none.
pub(crate) fn number(line: &[u8], at: &mut usize) -> Result<f64, u8> {
    let start = *at;
    if matches!(line.get(*at), Some(b'+' | b'-')) {
        *at += 1;
    }
    let (mut digits, mut point) = (0, false);
    while let Some(&c) = line.get(*at) {
        match c {
            b'0'..=b'9' => digits += 1,
            b'.' if !point => point = true,
            _ => break,
        }
        *at += 1;
    }
    if digits == 0 {
        return Err(2);
    }
    std::str::from_utf8(&line[start..*at])
        .ok()
        .and_then(|text| text.parse().ok())
        .ok_or(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_follow_each_other_without_spaces() {
        let line = b"G1X-.5Y+2.";
        let mut at = 0;
        let mut words = Vec::new();
        while at < line.len() {
            words.push(next_word(line, &mut at).unwrap());
        }
        assert_eq!(words, [(b'G', 1.0), (b'X', -0.5), (b'Y', 2.0)]);
    }

    #[test]
    fn no_letter_and_no_number_have_their_own_errors() {
        assert_eq!(next_word(b"1X", &mut 0), Err(1));
        assert_eq!(next_word(b"X", &mut 0), Err(2));
        assert_eq!(next_word(b"X-", &mut 0), Err(2));
        assert_eq!(next_word(b"X.", &mut 0), Err(2));
    }
}
