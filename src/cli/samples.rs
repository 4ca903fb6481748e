//! `kagome samples`: the surfaces that can be named instead of a file.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{Failure, Global, Terminal, print};
use crate::base::atomic::write_file;
use crate::base::progress::Progress as _;
use crate::mesh::{Sample, write::surface_obj};

/// Arguments of `kagome samples`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:
  kagome samples list
  kagome samples write mask -o mask.obj
  kagome samples write cap:half_angle_deg=75,faces=4000 -o cap.obj
Wherever a surface is wanted, sample:NAME:key=value,… stands for one of these.")]
pub struct SamplesArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Clone, Debug)]
enum What {
    /// List the samples with their parameters
    List,
    /// Write a sample as an OBJ file in millimetres
    Write {
        /// NAME or NAME:key=value,key=value
        name: String,
        /// The file to write; standard output if not given
        #[arg(short, long, value_name = "FILE.obj")]
        output: Option<PathBuf>,
        /// Replace the file if it exists
        #[arg(long)]
        force: bool,
    },
}

/// Lists or writes samples.
///
/// # Errors
/// [`Failure::Bad`] for an unknown name or key, or a place that cannot be written.
pub fn run(args: &SamplesArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    match &args.what {
        What::List => {
            print(&if global.json { list_json() } else { list() })?;
            Ok(())
        }
        What::Write {
            name,
            output,
            force,
        } => {
            let sample = Sample::parse(name).map_err(Failure::bad)?;
            let surface = sample.generate().map_err(Failure::bad)?;
            let text = surface_obj(&format!("kagome sample:{sample}\nmillimetres"), &surface);
            let Some(path) = output else {
                print(&text)?;
                return Ok(());
            };
            if path.exists() && !force {
                return Err(Failure::Bad(format!(
                    "{} exists already; add --force to replace it, or choose another name with -o",
                    path.display()
                )));
            }
            write_file(path, text.as_bytes()).map_err(Failure::bad)?;
            if global.json {
                let result = serde_json::json!({
                    "sample": sample.to_string(),
                    "file": path,
                    "vertices": surface.positions().len(),
                    "faces": surface.faces().len(),
                });
                print(&format!("{result:#}"))?;
            } else {
                terminal.note(&format!(
                    "{}: {} vertices, {} faces",
                    path.display(),
                    surface.positions().len(),
                    surface.faces().len()
                ));
            }
            Ok(())
        }
    }
}

fn list() -> String {
    let mut text = String::new();
    for sample in Sample::all() {
        text += &format!("{}: {}\n", sample.name(), sample.summary());
        for p in sample.parameters() {
            text += &format!(
                "    {}={}  {}; {} to {}\n",
                p.key,
                p.default,
                p.help.trim(),
                p.least,
                p.most
            );
        }
    }
    text
}

fn list_json() -> String {
    let samples: Vec<_> = Sample::all()
        .iter()
        .map(|sample| {
            let parameters: Vec<_> = sample
                .parameters()
                .iter()
                .map(|p| {
                    serde_json::json!({
                        "key": p.key, "help": p.help.trim(), "default": p.default,
                        "least": p.least, "most": p.most,
                    })
                })
                .collect();
            serde_json::json!({
                "name": sample.name(), "summary": sample.summary(), "parameters": parameters,
            })
        })
        .collect();
    format!("{:#}\n", serde_json::Value::from(samples))
}
