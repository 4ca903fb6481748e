//! What a controller answers to `$#`: its coordinate systems and the places that it remembers.

use super::reply::Reply;

/// Offsets by name (`G54` to `G59`, `G28`, `G30`, `G92`, `TLO`, `PRB`, more of some firmwares), each with all of its numbers,
/// in the order and the unit of the controller.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[serde(transparent)]
pub struct Offsets(Vec<(String, Vec<f64>)>);

impl Offsets {
    /// Those among the replies to `$#`. A line that is damaged tells none.
    pub fn of(replies: &[Reply]) -> Self {
        let offset = |reply: &Reply| {
            let Reply::Message(text) = reply else {
                return None;
            };
            let (name, values) = text.strip_prefix('[')?.strip_suffix(']')?.split_once(':')?;
            let numbers: Option<Vec<f64>> = values
                .split([',', ':'])
                .map(|v| v.parse().ok().filter(|v: &f64| v.is_finite()))
                .collect();
            Some((name.to_owned(), numbers?))
        };
        Self(replies.iter().filter_map(offset).collect())
    }

    /// The numbers of one; none if it was not told.
    pub fn get(&self, name: &str) -> Option<&[f64]> {
        let (_, values) = self.0.iter().find(|(n, _)| n == name)?;
        Some(values)
    }

    /// Where work zero lies in machine coordinates with a coordinate system (`G54`) in force: its own offset, and G92 on
    /// top. None if the system was not told.
    pub fn zero(&self, system: &str) -> Option<[f64; 3]> {
        let xyz = |name: &str| <[f64; 3]>::try_from(self.get(name)?.get(..3)?).ok();
        let (own, over) = (xyz(system)?, xyz("G92").unwrap_or_default());
        Some([0, 1, 2].map(|k| own[k] + over[k]))
    }

    /// All of them, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &[f64])> {
        self.0.iter().map(|(name, values)| (&**name, &**values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(lines: &[&str]) -> Offsets {
        let replies: Vec<Reply> = lines.iter().filter_map(|l| Reply::parse(l)).collect();
        Offsets::of(&replies)
    }

    #[test]
    fn work_zero_is_where_its_system_and_g92_put_it() {
        let told = told(&[
            "[G54:-400.000,-300.500,0.000]",
            "[G55:1.000,2.000,3.000,4.000]",
            "[MSG:Caution: Unlocked]",
            "[G92:0.500,0.000,-2.000]",
            "[TLO:0.000]",
            "[PRB:1.000,2.000,3.000:1]",
            "ok",
        ]);
        assert_eq!(told.zero("G54"), Some([-399.5, -300.5, -2.0]));
        // A fourth axis is told, and is none of work zero.
        assert_eq!(told.zero("G55"), Some([1.5, 2.0, 1.0]));
        assert_eq!(told.get("G55").map(<[f64]>::len), Some(4));
        assert_eq!(told.get("PRB"), Some(&[1.0, 2.0, 3.0, 1.0][..]));
        assert_eq!(told.zero("G56"), None);
        assert_eq!(told.zero("TLO"), None);
        let names: Vec<&str> = told.iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["G54", "G55", "G92", "TLO", "PRB"]);
    }

    #[test]
    fn a_damaged_line_tells_no_offset() {
        let told = told(&[
            "[G54:1.0,2.x,3.0]",
            "[G55:1.0,inf,3.0]",
            "[G56:1.0,2.0,3.0",
            "[G57]",
            "[G58:]",
        ]);
        assert_eq!(told, Offsets::default());
    }
}
