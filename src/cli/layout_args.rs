//! The size of the pattern and the singularities of the map: shared by all verbs that map a surface.

use clap::Args;

use super::Failure;
use crate::conformal::Sizing;
use crate::job::{ConePlace, ConeWish, DEFAULT_TRIANGLES, DartWish};

/// How large the triangles are, and how far they open.
#[derive(Args, Clone, Debug)]
pub struct SizeArgs {
    /// Triangle edge in millimetres
    #[arg(
        long,
        value_name = "MM",
        conflicts_with = "triangles",
        allow_negative_numbers = true
    )]
    pub edge: Option<f64>,
    /// Number of triangles wanted, about [default: 1500]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub triangles: Option<f64>,
    /// Material profile, by name (see `kagome materials list`) or file
    #[arg(long, value_name = "NAME|FILE", default_value = crate::material::DEFAULT)]
    pub material: String,
    /// Largest stretch, in place of the material's: above 1, at most 2
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub sigma: Option<f64>,
    /// Probability that no hinge fails, 0.5 to 0.999, for a material of which strips were pulled (see `kagome calibrate`);
    /// with --sigma, it is proved for that [default: 0.9, and nothing is proved for --sigma]
    #[arg(long, value_name = "P", allow_negative_numbers = true)]
    pub confidence: Option<f64>,
}

impl SizeArgs {
    /// The size that they ask for.
    pub fn sizing(&self) -> Sizing {
        match (self.edge, self.triangles) {
            (Some(edge), _) => Sizing::EdgeMm(edge),
            (None, count) => Sizing::Triangles(count.unwrap_or(DEFAULT_TRIANGLES)),
        }
    }

    /// Those that were given, by name.
    pub fn given(&self) -> Vec<&'static str> {
        let given = [
            (self.edge.is_some(), "--edge"),
            (self.triangles.is_some(), "--triangles"),
            (self.material != crate::material::DEFAULT, "--material"),
            (self.sigma.is_some(), "--sigma"),
            (self.confidence.is_some(), "--confidence"),
        ];
        given
            .into_iter()
            .filter_map(|(g, n)| g.then_some(n))
            .collect()
    }
}

/// Where curvature may stay, and where the surface is opened.
#[derive(Args, Clone, Debug)]
pub struct LayoutArgs {
    /// auto, none, a point X,Y,Z or a vertex vN; :K after it is its curvature in units of 120° (1 if absent)
    #[arg(long = "cone", value_name = "CONE", allow_hyphen_values = true)]
    cones: Vec<ConeArg>,
    /// auto, none, or an open cut past two or more places, X,Y,Z;X,Y,Z or vN;vN; repeatable
    #[arg(long = "dart", value_name = "DART", allow_hyphen_values = true)]
    darts: Vec<DartArg>,
    /// Triangles to drop at the cone: 4, 16, … [default: 4 at a positive cone, 16 where that fits better]
    #[arg(long, value_name = "N")]
    pub remove: Option<usize>,
    /// How far a rim turns in degrees, a multiple of 120 (-360: a hole in a plane, 0: a tube's end); once for each rim
    /// but the first, as `inspect` lists them [default: what needs least stretch]
    #[arg(long = "turning", value_name = "DEG", allow_hyphen_values = true)]
    turnings: Vec<i32>,
    /// Make this rim a straight hem, by its number in `inspect`: the end of a tube then lies on one line of the sheet,
    /// and the lattice follows it; repeatable
    #[arg(long = "hem", value_name = "N")]
    hems: Vec<u32>,
}

impl LayoutArgs {
    /// Those that were given, by name.
    pub fn given(&self) -> Vec<&'static str> {
        let given = [
            (!self.cones.is_empty(), "--cone"),
            (!self.darts.is_empty(), "--dart"),
            (self.remove.is_some(), "--remove"),
            (!self.turnings.is_empty(), "--turning"),
            (!self.hems.is_empty(), "--hem"),
        ];
        given
            .into_iter()
            .filter_map(|(g, n)| g.then_some(n))
            .collect()
    }

    /// The cones that they ask for.
    ///
    /// # Errors
    /// [`Failure::Bad`] if auto or none stand beside others.
    pub fn cones(&self) -> Result<ConeWish, Failure> {
        match &self.cones[..] {
            [] | [ConeArg::Auto] => Ok(ConeWish::Auto),
            [ConeArg::None] => Ok(ConeWish::Given(Vec::new())),
            given => given
                .iter()
                .map(|cone| match cone {
                    ConeArg::At(place, units) => Ok((*place, *units)),
                    _ => Err(Failure::Bad(
                        "--cone auto and --cone none stand alone; leave out the other --cone"
                            .into(),
                    )),
                })
                .collect::<Result<_, _>>()
                .map(ConeWish::Given),
        }
    }

    /// The darts that they ask for.
    ///
    /// # Errors
    /// [`Failure::Bad`] if auto or none stand beside others.
    pub fn darts(&self) -> Result<DartWish, Failure> {
        match &self.darts[..] {
            [] | [DartArg::Auto] => Ok(DartWish::Auto),
            [DartArg::None] => Ok(DartWish::Given(Vec::new())),
            many => many
                .iter()
                .map(|dart| match dart {
                    DartArg::Past(places) => Ok(places.clone()),
                    _ => Err(Failure::Bad(
                        "--dart auto and --dart none stand alone".to_owned(),
                    )),
                })
                .collect::<Result<_, _>>()
                .map(DartWish::Given),
        }
    }

    /// Turnings in units of 120°; `None` if the program is to choose.
    ///
    /// # Errors
    /// [`Failure::Bad`] for an angle that is no multiple of 120°.
    pub fn turnings(&self) -> Result<Option<Vec<i32>>, Failure> {
        if let Some(wrong) = self.turnings.iter().find(|deg| *deg % 120 != 0) {
            return Err(Failure::Bad(format!(
                "--turning {wrong}: a rim turns by a multiple of 120°, so that the pattern closes around it"
            )));
        }
        let units = self.turnings.iter().map(|deg| deg / 120).collect();
        Ok(Some(units).filter(|_| !self.turnings.is_empty()))
    }

    /// Straight rims, counted from 0.
    ///
    /// # Errors
    /// [`Failure::Bad`] for the number 0.
    pub fn hems(&self) -> Result<Vec<usize>, Failure> {
        if self.hems.contains(&0) {
            return Err(Failure::Bad(
                "--hem 0: rims are counted from 1, see `kagome inspect`".into(),
            ));
        }
        let mut hems: Vec<usize> = self.hems.iter().map(|n| *n as usize - 1).collect();
        hems.sort_unstable();
        hems.dedup();
        Ok(hems)
    }
}

/// A value of `--cone`.
#[derive(Clone, Debug, PartialEq)]
enum ConeArg {
    Auto,
    None,
    At(ConePlace, i32),
}

impl std::str::FromStr for ConeArg {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let form = || {
            format!(
                "{text:?} is not auto, none, X,Y,Z[:K] or vN[:K], for example 0,12.5,80 or v120:-1"
            )
        };
        match text {
            "auto" => return Ok(Self::Auto),
            "none" => return Ok(Self::None),
            _ => {}
        }
        let (place, units) = match text.split_once(':') {
            Some((place, units)) => (
                place,
                units
                    .trim_start_matches('+')
                    .trim_start_matches('±')
                    .parse()
                    .map_err(|_| form())?,
            ),
            None => (text, 1),
        };
        if let Some(number) = place.strip_prefix('v') {
            return Ok(Self::At(
                ConePlace::Vertex(number.parse().map_err(|_| form())?),
                units,
            ));
        }
        let numbers: Vec<f64> = place
            .split(',')
            .map(|n| n.trim().parse::<f64>().map_err(|_| form()))
            .collect::<Result<_, _>>()?;
        match numbers[..] {
            [x, y, z] if numbers.iter().all(|n| n.is_finite()) => {
                Ok(Self::At(ConePlace::Point([x, y, z]), units))
            }
            _ => Err(form()),
        }
    }
}

/// A value of `--dart`.
#[derive(Clone, Debug, PartialEq)]
enum DartArg {
    Auto,
    None,
    Past(Vec<ConePlace>),
}

impl std::str::FromStr for DartArg {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => return Ok(Self::Auto),
            "none" => return Ok(Self::None),
            _ => {}
        }
        places(text).map(Self::Past).ok_or_else(|| {
            format!(
                "{text:?} is not auto, none, or two or more places, for example \"0,12.5,80;0,60,20\" or \"v12;v905\""
            )
        })
    }
}

/// A value of `--cut`.
#[derive(Clone, Debug, PartialEq)]
pub struct CutArg(pub Vec<ConePlace>);

impl std::str::FromStr for CutArg {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        places(text).map(Self).ok_or_else(|| {
            format!(
                "{text:?} is not two or more places, for example \"0,12.5,80;0,60,20\" or \"v12;v905\""
            )
        })
    }
}

/// Two or more places; none if the text is something else.
fn places(text: &str) -> Option<Vec<ConePlace>> {
    let places: Option<Vec<ConePlace>> = text
        .split(';')
        .map(|part| match part.trim().parse() {
            Ok(ConeArg::At(place, _)) if !part.contains(':') => Some(place),
            _ => None,
        })
        .collect();
    places.filter(|places| places.len() > 1)
}
