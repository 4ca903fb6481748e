//! Number formats shared by the writers. Lengths are millimetres, angles radians, wherever no name says otherwise.

/// A number with at most `decimals` decimals, trailing zeros dropped and no negative zero: `1.5`, `-0.25`, `3`.
///
/// Every writer goes through this or [`fixed`], so that the same geometry gives the same bytes.
pub fn short(value: f64, decimals: usize) -> String {
    let mut text = format!("{value:.decimals$}");
    if text.contains('.') {
        let kept = text.trim_end_matches('0').trim_end_matches('.').len();
        text.truncate(kept);
    }
    if text == "-0" { "0".into() } else { text }
}

/// A number with exactly `decimals` decimals and no negative zero.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.into(),
        _ => text,
    }
}

/// A value rounded to so many decimals.
pub fn rounded(value: f64, decimals: i32) -> f64 {
    let factor = 10f64.powi(decimals);
    (value * factor).round() / factor
}

/// A value rounded down to so many decimals: for a bound, which is never rounded up.
pub fn floored(value: f64, decimals: i32) -> f64 {
    let factor = 10f64.powi(decimals);
    (value * factor).floor() / factor
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_as_short_as_their_value_allows() {
        assert_eq!(short(1.5, 3), "1.5");
        assert_eq!(short(-0.0001, 3), "0");
        assert_eq!(short(100.0, 3), "100");
        assert_eq!(short(100.0, 0), "100");
        assert_eq!(fixed(-0.0001, 3), "0.000");
        assert_eq!(fixed(-1.0, 3), "-1.000");
    }
}
