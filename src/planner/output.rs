//! The output of a laser whose power follows its speed, just before the head stands.

use super::Profile;

/// GRBL prepares motion in pieces of this length, s, counted from the beginning of a block; the last one is shorter.
const SEGMENT_S: f64 = 0.01;

/// How long before the end of a block that ends at rest the output is zero already, s.
///
/// The output of a piece is computed from the speed at its end, which is zero for the last. Pieces hold whole steps:
/// a step begun at their end belongs to the next, which begins the earlier for it. `profile` is the block's last one and
/// begins `before_s` after the block; `steps_per_mm` is that of the fastest motor along the block.
pub fn dark_before_stop_s(profile: &Profile, before_s: f64, steps_per_mm: f64) -> f64 {
    // Pieces are of time as planned; the steps that they hold may come later.
    let stretch = profile.stretch();
    let profile = &profile.planned();
    let whole = before_s.max(0.0) / stretch + profile.duration_s();
    // Rounding must not make an empty piece.
    let pieces = (whole / SEGMENT_S - 1e-6).ceil().max(1.0);
    let rest = whole - (pieces - 1.0) * SEGMENT_S;
    let place = |left_s: f64| profile.at(profile.duration_s() - left_s).0;
    let here = place(rest);
    let steps = (profile.length_mm() - here) * steps_per_mm;
    let before = (here - place(rest + SEGMENT_S)) * steps_per_mm / SEGMENT_S;
    let early = if before > 0.0 {
        ((steps.ceil() - steps) / before).min(SEGMENT_S)
    } else {
        0.0
    };
    (rest + early).min(whole) * stretch
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_piece_is_dark_and_what_a_piece_lacks_of_a_whole_step() {
        // 0.196 s: nineteen pieces and 6 ms. 4.8 mm at 50 mm/s and 500 mm/s².
        let p = Profile::new(4.8, 0.0, 50.0, 0.0, 500.0);
        assert!((p.duration_s() - 0.196).abs() < 0.01);
        let rest = p.duration_s() % SEGMENT_S;
        let fine = dark_before_stop_s(&p, 0.0, 1e9);
        assert!((fine - rest).abs() < 1e-6, "{fine} {rest}");
        let coarse = dark_before_stop_s(&p, 0.0, 80.0);
        assert!(coarse >= fine && coarse < fine + SEGMENT_S);
    }

    #[test]
    fn a_block_planned_anew_keeps_its_pieces() {
        let p = Profile::new(4.8, 0.0, 50.0, 0.0, 500.0);
        let left = Profile::new(4.8 - p.at(0.033).0, p.at(0.033).1, 50.0, 0.0, 500.0);
        let (one, two) = (
            dark_before_stop_s(&p, 0.0, 80.0),
            dark_before_stop_s(&left, 0.033, 80.0),
        );
        assert!((one - two).abs() < 1e-6, "{one} {two}");
    }

    #[test]
    fn a_block_shorter_than_a_piece_is_all_dark() {
        let p = Profile::new(0.005, 0.0, 50.0, 0.0, 500.0);
        assert!((dark_before_stop_s(&p, 0.0, 80.0) - p.duration_s()).abs() < 1e-12);
    }
}
