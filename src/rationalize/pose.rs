//! The handle file: a pose, or several one after the other, as TOML that a person writes.
//!
//! ```toml
//! format = 1
//! sigma = 1.9                 # hinges open no farther; absent: no bound
//! smoothness = 0.1            # against 1 for the length of an edge; 0.1 if absent
//! rest = "start"              # what is smooth: the bends of the start, or "flat"
//!
//! [[group]]                   # a name for several points
//! name = "crown"
//! near_mm = [0.0, 0.0, 100.0]
//! within_mm = 12.0
//!
//! [[pin]]                     # held where they are, all the time
//! group = "rim"               # always there: the corners that hang on no hinge
//!
//! [[keyframe]]                # in turn; each starts from the end of the last
//! moves = 30                  # the handles go there in so many moves
//!
//! [[keyframe.handle]]
//! group = "crown"
//! by_mm = [0.0, 0.0, 25.0]    # from where each point is at the start of the keyframe
//! weight = 5.0                # softly; without it exactly
//!
//! [[keyframe.handle]]
//! point = 118                 # as in linkage.obj; or near_mm, the nearest point at the start
//! to_mm = [10.0, 0.0, 60.0]   # a place
//! ```

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use serde::Deserialize;

use super::RationalizeError;
use super::projection::Rest;
use super::session::{Edit, EditError, Hold, Session};
use crate::base::document::{Complaint, Document, DocumentError, ranged};
use crate::base::ids::Id as _;
use crate::base::progress::Progress;
use crate::linkage::{Linkage, PointId};
use crate::mesh::ClosestPoint;

/// The version of the format that this program reads.
pub const FORMAT: u32 = 1;

/// The group that every linkage has: the corners that hang on no hinge.
const RIM: &str = "rim";

/// Iterations after each move of the handles.
const STEPS_PER_MOVE: usize = 5;

/// A keyframe ends when no point moves farther than this in an iteration, as a part of L.
const STILL: f64 = 1e-7;

/// A handle file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseFile {
    /// Version of this format.
    pub format: u32,
    /// Largest scale factor; no bound if absent.
    #[serde(default)]
    pub sigma: Option<f64>,
    /// Weight of the smoothness.
    #[serde(default = "smoothness")]
    pub smoothness: f64,
    /// What is smooth.
    #[serde(default)]
    pub rest: Rest,
    /// Named sets of points.
    #[serde(default)]
    pub group: Vec<Group>,
    /// What is held where it is.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// The poses.
    pub keyframe: Vec<Keyframe>,
}

fn smoothness() -> f64 {
    0.1
}

/// `[[group]]`: listed points, or those of the rim, near a place, or both.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// Points by number, counted from 1 as in `linkage.obj`.
    #[serde(default)]
    pub points: Vec<u32>,
    /// Only corners that hang on no hinge.
    #[serde(default)]
    pub rim: bool,
    /// A place, millimetres; with `within_mm`.
    #[serde(default)]
    pub near_mm: Option<[f64; 3]>,
    /// All points no farther from it at the start, millimetres.
    #[serde(default)]
    pub within_mm: Option<f64>,
}

/// `[[pin]]`: one of the three.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pin {
    /// A point by number, counted from 1.
    #[serde(default)]
    pub point: Option<u32>,
    /// The point nearest to a place at the start, millimetres.
    #[serde(default)]
    pub near_mm: Option<[f64; 3]>,
    /// A group by name.
    #[serde(default)]
    pub group: Option<String>,
}

/// `[[keyframe]]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// The handles go to their places in so many equal moves.
    #[serde(default = "moves")]
    pub moves: usize,
    /// Iterations after the last move at the most.
    #[serde(default = "settle")]
    pub settle: usize,
    /// Handles put on, or moved on from the keyframe before.
    #[serde(default)]
    pub handle: Vec<Handle>,
    /// Handles taken off before, each by the same choice as a pin.
    #[serde(default)]
    pub release: Vec<Pin>,
}

fn moves() -> usize {
    20
}

fn settle() -> usize {
    500
}

/// `[[keyframe.handle]]`: which points, where to, how.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Handle {
    /// A point by number, counted from 1.
    #[serde(default)]
    pub point: Option<u32>,
    /// The point nearest to a place at the start, millimetres.
    #[serde(default)]
    pub near_mm: Option<[f64; 3]>,
    /// A group by name; with `by_mm`.
    #[serde(default)]
    pub group: Option<String>,
    /// The place, millimetres.
    #[serde(default)]
    pub to_mm: Option<[f64; 3]>,
    /// The way from where the point is when the keyframe begins, millimetres.
    #[serde(default)]
    pub by_mm: Option<[f64; 3]>,
    /// Drawn there by this weight, against 1 for the length of an edge; exactly there if absent.
    #[serde(default)]
    pub weight: Option<f64>,
}

/// Why a pose is not played.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// The file is wrong.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Handles and pins contradict each other; in which keyframe, counted from 1.
    #[error("keyframe {keyframe}: {source}")]
    Edit {
        /// The keyframe.
        keyframe: usize,
        /// What is wrong.
        source: EditError,
    },
    /// The solver gave up.
    #[error(transparent)]
    Rationalize(#[from] RationalizeError),
}

/// A handle file that fits its linkage.
#[derive(Clone, Debug)]
pub struct Pose {
    file: PoseFile,
    pins: Vec<PointId>,
    keyframes: Vec<Resolved>,
}

#[derive(Clone, Debug)]
struct Resolved {
    release: Vec<PointId>,
    handles: Vec<(PointId, Goal, Hold)>,
}

#[derive(Clone, Copy, Debug)]
enum Goal {
    To(Point3<f64>),
    By(Vector3<f64>),
}

impl Pose {
    /// Reads a handle file for a linkage whose points are at `start` (millimetres).
    ///
    /// # Errors
    /// [`DocumentError`]: not TOML, unknown keys, values out of range, points or groups that do not exist, with the
    /// line.
    pub fn read(
        document: &Document,
        linkage: &Linkage,
        start: &[Point3<f64>],
    ) -> Result<Self, DocumentError> {
        let file: PoseFile = document.read(check)?;
        let resolved = resolve(&file, linkage, start).map_err(|c| document.complain(c))?;
        Ok(resolved)
    }

    /// Plays all keyframes from `start`, drawn to `target` by a weight if there is one, and hands the positions
    /// (millimetres) after every move to `frame`. What comes back stands at the last keyframe, near to exact.
    ///
    /// # Errors
    /// [`PoseError`]: contradictory handles, interruption, memory.
    pub fn play(
        &self,
        linkage: &Linkage,
        start: &[Point3<f64>],
        target: Option<(Arc<ClosestPoint>, f64)>,
        progress: &dyn Progress,
        mut frame: impl FnMut(&Session),
    ) -> Result<Session, PoseError> {
        let mut session = Session::new(linkage, start)?;
        let mut edits = vec![
            Edit::Sigma(self.file.sigma),
            Edit::Smoothness(self.file.smoothness, self.file.rest),
        ];
        edits.extend(self.pins.iter().map(|p| Edit::Handle {
            point: *p,
            place_mm: start[p.index()],
            hold: Hold::Hard,
        }));
        if target.is_some() {
            edits.push(Edit::Target(target));
        }
        let apply = |session: &mut Session, edits: &[Edit], keyframe: usize| {
            session.apply(edits).map_err(|source| PoseError::Edit {
                keyframe: keyframe + 1,
                source,
            })
        };
        apply(&mut session, &edits, 0)?;
        for (number, (keyframe, resolved)) in
            self.file.keyframe.iter().zip(&self.keyframes).enumerate()
        {
            let release: Vec<Edit> = resolved.release.iter().map(|p| Edit::Release(*p)).collect();
            apply(&mut session, &release, number)?;
            let ways: Vec<_> = resolved
                .handles
                .iter()
                .map(|&(point, goal, hold)| {
                    let from = session.position(point).unwrap_or(start[point.index()]);
                    let to = match goal {
                        Goal::To(place) => place,
                        Goal::By(way) => from + way,
                    };
                    (point, from, to, hold)
                })
                .collect();
            for step in 1..=keyframe.moves {
                let part = step as f64 / keyframe.moves as f64;
                let last = step == keyframe.moves;
                let edits: Vec<Edit> = ways
                    .iter()
                    .map(|&(point, from, to, hold)| Edit::Handle {
                        point,
                        place_mm: if last { to } else { from + (to - from) * part },
                        // On the way two of one triangle may come too near: they are held exactly only at the end.
                        hold: if last { hold } else { softly(hold) },
                    })
                    .collect();
                apply(&mut session, &edits, number)?;
                for _ in 0..STEPS_PER_MOVE {
                    progress.check().map_err(RationalizeError::from)?;
                    session.step()?;
                }
                progress.advance(1);
                frame(&session);
            }
            for _ in 0..keyframe.settle {
                progress.check().map_err(RationalizeError::from)?;
                let step = session.step()?;
                if step.settled || step.moved_mm < STILL * linkage.edge_mm {
                    break;
                }
            }
            frame(&session);
        }
        Ok(session)
    }
}

/// Weight of a hard handle on its way.
const ON_THE_WAY: f64 = 100.0;

fn softly(hold: Hold) -> Hold {
    match hold {
        Hold::Hard => Hold::Soft(ON_THE_WAY),
        soft => soft,
    }
}

/// What can be said without the linkage.
fn check(file: &PoseFile) -> Result<(), Complaint> {
    if file.format != FORMAT {
        return Err(Complaint::new(
            "format",
            format!("is {}; this program reads {FORMAT}", file.format),
        ));
    }
    if let Some(sigma) = file.sigma {
        ranged("sigma", sigma, 1.0, 2.0)?;
    }
    if file.smoothness != 0.0 {
        ranged("smoothness", file.smoothness, 1e-6, 1e6)?;
    }
    for (i, group) in file.group.iter().enumerate() {
        let key = format!("group[{i}]");
        if group.name == RIM {
            return Err(Complaint::new(
                format!("{key}.name"),
                "is \"rim\", which every linkage has already",
            ));
        }
        if file.group[..i].iter().any(|g| g.name == group.name) {
            return Err(Complaint::new(
                format!("{key}.name"),
                format!("is \"{}\", as an earlier group is", group.name),
            ));
        }
        if group.near_mm.is_some() != group.within_mm.is_some() {
            return Err(Complaint::new(key, "needs near_mm and within_mm together"));
        }
        let chosen = group.rim || group.near_mm.is_some();
        if chosen != group.points.is_empty() {
            return Err(Complaint::new(
                key,
                "needs either points, or rim or near_mm with within_mm or both",
            ));
        }
        place(&format!("{key}.near_mm"), group.near_mm)?;
        if let Some(within) = group.within_mm {
            ranged(&format!("{key}.within_mm"), within, 0.0, 1e6)?;
        }
    }
    if file.keyframe.is_empty() {
        return Err(Complaint::new(
            "keyframe",
            "is empty; a pose needs one keyframe at least",
        ));
    }
    for (i, keyframe) in file.keyframe.iter().enumerate() {
        ranged(
            &format!("keyframe[{i}].moves"),
            keyframe.moves as f64,
            1.0,
            1e5,
        )?;
        ranged(
            &format!("keyframe[{i}].settle"),
            keyframe.settle as f64,
            0.0,
            1e6,
        )?;
        for (j, handle) in keyframe.handle.iter().enumerate() {
            let key = format!("keyframe[{i}].handle[{j}]");
            if handle.to_mm.is_some() == handle.by_mm.is_some() {
                return Err(Complaint::new(key, "needs either to_mm or by_mm"));
            }
            if handle.group.is_some() && handle.to_mm.is_some() {
                return Err(Complaint::new(
                    format!("{key}.to_mm"),
                    "is one place for a whole group; by_mm moves a group",
                ));
            }
            place(&format!("{key}.to_mm"), handle.to_mm)?;
            place(&format!("{key}.by_mm"), handle.by_mm)?;
            if let Some(weight) = handle.weight {
                ranged(&format!("{key}.weight"), weight, 1e-6, 1e6)?;
            }
        }
    }
    Ok(())
}

/// Coordinates of any size that a millimetre is still told apart at.
fn place(key: &str, place: Option<[f64; 3]>) -> Result<(), Complaint> {
    place
        .into_iter()
        .flatten()
        .try_for_each(|c| ranged(key, c, -1e9, 1e9))
}

struct Names<'a> {
    start: &'a [Point3<f64>],
    groups: BTreeMap<&'a str, Vec<PointId>>,
}

impl Names<'_> {
    fn number(&self, key: &str, number: u32) -> Result<PointId, Complaint> {
        if number == 0 || number as usize > self.start.len() {
            return Err(Complaint::new(
                key,
                format!(
                    "is {number}; the linkage has points 1 to {}",
                    self.start.len()
                ),
            ));
        }
        Ok(PointId(number - 1))
    }

    /// The points of a choice of which one must be given.
    fn choice(
        &self,
        key: &str,
        point: Option<u32>,
        near_mm: Option<[f64; 3]>,
        group: Option<&str>,
    ) -> Result<Vec<PointId>, Complaint> {
        match (point, near_mm, group) {
            (Some(number), None, None) => Ok(vec![self.number(&format!("{key}.point"), number)?]),
            (None, Some(at), None) => {
                place(&format!("{key}.near_mm"), near_mm)?;
                let at = Point3::from(at);
                let far = |p: &Point3<f64>| (p - at).norm_squared();
                let nearest = (0..self.start.len())
                    .min_by(|&a, &b| far(&self.start[a]).total_cmp(&far(&self.start[b])));
                Ok(nearest.map(PointId::from_index).into_iter().collect())
            }
            (None, None, Some(name)) => self.groups.get(name).cloned().ok_or_else(|| {
                let known: Vec<&str> = self.groups.keys().copied().collect();
                Complaint::new(
                    format!("{key}.group"),
                    format!(
                        "is \"{name}\", which is not among the groups: {}",
                        known.join(", ")
                    ),
                )
            }),
            _ => Err(Complaint::new(
                key,
                "needs exactly one of point, near_mm and group",
            )),
        }
    }

    fn pin(&self, key: &str, pin: &Pin) -> Result<Vec<PointId>, Complaint> {
        self.choice(key, pin.point, pin.near_mm, pin.group.as_deref())
    }
}

fn resolve(file: &PoseFile, linkage: &Linkage, start: &[Point3<f64>]) -> Result<Pose, Complaint> {
    let mut users = vec![0u8; start.len()];
    for p in linkage.triangles.iter().flat_map(|t| t.points) {
        users[p.index()] = users[p.index()].saturating_add(1);
    }
    let all = || (0..start.len()).map(PointId::from_index);
    let on_rim = |p: &PointId| users[p.index()] == 1;
    let mut names = Names {
        start,
        groups: BTreeMap::from([(RIM, all().filter(on_rim).collect())]),
    };
    for (i, group) in file.group.iter().enumerate() {
        let points: Vec<PointId> = if group.points.is_empty() {
            let near = |p: &PointId| match (group.near_mm, group.within_mm) {
                (Some(at), Some(within)) => (start[p.index()] - Point3::from(at)).norm() <= within,
                _ => true,
            };
            all()
                .filter(|p| (!group.rim || on_rim(p)) && near(p))
                .collect()
        } else {
            let number =
                |(k, n): (usize, &u32)| names.number(&format!("group[{i}].points[{k}]"), *n);
            group
                .points
                .iter()
                .enumerate()
                .map(number)
                .collect::<Result<_, _>>()?
        };
        if points.is_empty() {
            return Err(Complaint::new(
                format!("group[{i}]"),
                format!("\"{}\" has no point in it", group.name),
            ));
        }
        names.groups.insert(&group.name, points);
    }
    let mut pins = Vec::new();
    for (i, pin) in file.pin.iter().enumerate() {
        pins.extend(names.pin(&format!("pin[{i}]"), pin)?);
    }
    let mut keyframes = Vec::with_capacity(file.keyframe.len());
    for (i, keyframe) in file.keyframe.iter().enumerate() {
        let mut resolved = Resolved {
            release: Vec::new(),
            handles: Vec::new(),
        };
        for (j, release) in keyframe.release.iter().enumerate() {
            let key = format!("keyframe[{i}].release[{j}]");
            resolved.release.extend(names.pin(&key, release)?);
        }
        for (j, handle) in keyframe.handle.iter().enumerate() {
            let key = format!("keyframe[{i}].handle[{j}]");
            let points =
                names.choice(&key, handle.point, handle.near_mm, handle.group.as_deref())?;
            let goal = match (handle.to_mm, handle.by_mm) {
                (Some(place), _) => Goal::To(place.into()),
                (None, way) => Goal::By(Vector3::from(way.unwrap_or_default())),
            };
            let hold = handle.weight.map_or(Hold::Hard, Hold::Soft);
            resolved
                .handles
                .extend(points.into_iter().map(|p| (p, goal, hold)));
        }
        keyframes.push(resolved);
    }
    Ok(Pose {
        file: file.clone(),
        pins,
        keyframes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::progress::Silent;
    use crate::linkage::Handedness;
    use crate::rationalize::session::tests::opened;

    fn read(text: &str) -> Result<Pose, DocumentError> {
        let (linkage, start) = opened(3, 1.4);
        Pose::read(&Document::new("pose.toml", text), &linkage, &start)
    }

    const GOOD: &str = "format = 1
sigma = 1.9
[[group]]
name = \"crown\"
near_mm = [0.0, 0.0, 0.0]
within_mm = 6.0
[[pin]]
group = \"rim\"
[[keyframe]]
moves = 10
[[keyframe.handle]]
group = \"crown\"
by_mm = [0.0, 0.0, 4.0]
weight = 5.0
[[keyframe]]
[[keyframe.release]]
group = \"crown\"
[[keyframe.handle]]
near_mm = [0.0, 0.0, 0.1]
by_mm = [0.0, 0.0, 1.0]
";

    #[test]
    fn a_pose_is_played_keyframe_by_keyframe() {
        let (linkage, start) = opened(3, 1.4);
        let pose = read(GOOD).unwrap();
        assert!(!pose.pins.is_empty());
        let mut heights = Vec::new();
        let crown = pose.keyframes[0].handles[0].0;
        let session = pose
            .play(&linkage, &start, None, &Silent, |s| {
                heights.push(s.position(crown).unwrap().z)
            })
            .unwrap();
        assert_eq!(heights.len(), 11 + 21);
        assert!(
            heights[..10].is_sorted() && (heights[10] - 4.0).abs() < 1.0,
            "{heights:?}"
        );
        // The second keyframe let go of the crown and holds its middle a millimetre higher than the first left it.
        let held: Vec<_> = session
            .held()
            .filter(|(p, _)| !pose.pins.contains(p))
            .collect();
        assert_eq!(held.len(), 1);
        let (middle, place) = held[0];
        let positions = session.positions();
        assert!(place.z > 4.0 && place.z < 6.0, "{place}");
        assert_eq!(positions[middle.index()], place);
        for p in &pose.pins {
            assert_eq!(positions[p.index()], start[p.index()]);
        }
    }

    #[test]
    fn the_rim_is_every_corner_of_one_triangle() {
        let linkage = Linkage::patch(1.0, Handedness::Right, &Linkage::hexagon_cells(3));
        let free = linkage.point_count() - linkage.hinges.len();
        assert_eq!(read(GOOD).unwrap().pins.len(), free);
    }

    #[test]
    fn mistakes_are_told_with_their_line() {
        let cases = [
            ("format = 1", "format = 2", 1, "this program reads 1"),
            ("sigma = 1.9", "sigma = nan", 2, "sigma is NaN"),
            ("sigma = 1.9", "sigmas = 1.9", 2, "unknown field"),
            (
                "name = \"crown\"",
                "name = \"rim\"",
                4,
                "every linkage has already",
            ),
            (
                "within_mm = 6.0",
                "within_mm = 0.01",
                3,
                "has no point in it",
            ),
            ("within_mm = 6.0", "", 3, "near_mm and within_mm together"),
            (
                "group = \"rim\"",
                "group = \"rom\"",
                8,
                "not among the groups: crown, rim",
            ),
            (
                "group = \"rim\"",
                "",
                7,
                "exactly one of point, near_mm and group",
            ),
            (
                "near_mm = [0.0, 0.0, 0.1]",
                "point = 0",
                19,
                "the linkage has points 1 to",
            ),
            (
                "near_mm = [0.0, 0.0, 0.1]",
                "point = 5000",
                19,
                "the linkage has points 1 to",
            ),
            ("weight = 5.0", "weight = -5.0", 14, "not between"),
            (
                "by_mm = [0.0, 0.0, 4.0]",
                "to_mm = [0.0, 0.0, 4.0]",
                13,
                "by_mm moves a group",
            ),
            ("by_mm = [0.0, 0.0, 1.0]", "", 18, "either to_mm or by_mm"),
            ("moves = 10", "moves = 0", 10, "not between 1"),
        ];
        for (old, new, line, text) in cases {
            assert!(GOOD.contains(old), "{old}");
            let error = read(&GOOD.replace(old, new)).unwrap_err();
            assert!(error.problem.contains(text), "{new}: {error}");
            assert_eq!(error.line, Some(line), "{new}: {error}");
        }
    }

    #[test]
    fn contradictions_name_their_keyframe() {
        let (linkage, start) = opened(3, 1.4);
        let [a, b, _] = linkage.triangles[crate::linkage::TriangleId(0)].points;
        let text = format!(
            "format = 1\n[[keyframe]]\n[[keyframe]]\nmoves = 1\n\
             [[keyframe.handle]]\npoint = {a}\nto_mm = [0, 0, 0]\n\
             [[keyframe.handle]]\npoint = {b}\nto_mm = [0, 0, 1]\n"
        );
        let pose = Pose::read(&Document::new("pose.toml", text), &linkage, &start).unwrap();
        let error = pose
            .play(&linkage, &start, None, &Silent, |_| {})
            .err()
            .unwrap();
        let text = error.to_string();
        assert!(
            text.starts_with("keyframe 2: points") && text.contains("1.000000 mm apart"),
            "{text}"
        );
    }
}
