//! `kagome form`: a body to form the sheet over.

use std::path::PathBuf;

use clap::Args;
use nalgebra::Vector3;

use super::surface_args::SurfaceArgs;
use super::{Failure, Global, Terminal, print};
use crate::base::atomic::write_file;
use crate::base::progress::Progress as _;
use crate::base::units::short;
use crate::mesh::{Body, BodyOptions};

/// Arguments of `kagome form`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome form sample:mask --base 15 -o body.stl
  kagome form scan.obj --size 220 --offset -0.8 --up 0,0,1

Below a surface with a rim, walls run straight down to the base, BASE millimetres below its lowest point; further rims are
capped. Of a closed surface, the lowest BASE millimetres are cut off. The body is solid and watertight, in millimetres, its base
at z = 0. --offset -T/2 allows for half the sheet's thickness T.")]
pub struct FormArgs {
    #[command(flatten)]
    surface: SurfaceArgs,
    /// Height of the walls below the surface; of a closed surface, what is cut off
    #[arg(
        long,
        value_name = "MM",
        default_value_t = 10.0,
        allow_negative_numbers = true
    )]
    base: f64,
    /// Move the surface outwards by this, inwards if negative
    #[arg(
        long,
        value_name = "MM",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    offset: f64,
    /// Which way is up [default: where the surface faces; of a closed one 0,0,1]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    up: Option<Direction>,
    /// The body (binary STL)
    #[arg(short, long, value_name = "FILE", default_value = "body.stl")]
    output: PathBuf,
}

/// A value of `--up`.
#[derive(Clone, Copy, Debug)]
struct Direction(Vector3<f64>);

impl std::str::FromStr for Direction {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text
            .split(',')
            .filter_map(|n| n.trim().parse().ok())
            .collect();
        match numbers[..] {
            [x, y, z]
                if text.split(',').count() == 3 && [x, y, z].iter().all(|v| v.is_finite()) =>
            {
                Ok(Self(Vector3::new(x, y, z)))
            }
            _ => Err(format!(
                "{text:?} is no direction: give three numbers, such as 0,0,1"
            )),
        }
    }
}

/// Runs the verb.
///
/// # Errors
/// [`Failure::Bad`] for a surface that gives no body, or a file that cannot be written.
pub fn run(args: &FormArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    terminal.start("reading the surface", None);
    let import = args.surface.load()?;
    let options = BodyOptions {
        up: args.up.map(|d| d.0),
        base_mm: args.base,
        offset_mm: args.offset,
    };
    terminal.start("making the body", None);
    let body = Body::new(&import.surface, &options).map_err(Failure::bad)?;
    write_file(&args.output, &body.stl()).map_err(Failure::bad)?;
    terminal.clear();
    let (size, litres) = (body.size_mm(), body.volume_mm3() * 1e-6);
    if global.json {
        let result = serde_json::json!({
            "surface": args.surface.surface,
            "written": args.output,
            "triangles": body.faces.len(),
            "size_mm": size,
            "volume_mm3": body.volume_mm3(),
        });
        return print(&format!("{result:#}"));
    }
    if global.quiet {
        return Ok(());
    }
    let size = size.map(|mm| short(mm, 1));
    print(&format!(
        "{}: {} x {} x {} mm, {} l, {} triangles, watertight",
        args.output.display(),
        size[0],
        size[1],
        size[2],
        short(litres, 3),
        body.faces.len()
    ))
}
