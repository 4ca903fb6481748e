//! `kagome template`: the sheet on paper.

use std::path::PathBuf;

use clap::Args;

use super::{Failure, Global, Terminal, print};
use crate::base::atomic::write_file;
use crate::pattern::{Paper, read_drawing, template};

/// Arguments of `kagome template`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Example:
  kagome template mask/pattern.svg --paper letter -o mask.pdf

Print without scaling (\"actual size\", 100 %), and measure the ruler at the foot of a page: it is 100 mm long. Put one page on
the other so that the crosses meet.")]
pub struct TemplateArgs {
    /// The drawing (SVG)
    drawing: PathBuf,
    /// Size of the paper
    #[arg(long, value_enum, default_value_t = PaperArg::A4)]
    paper: PaperArg,
    /// The PDF
    #[arg(short, long, value_name = "FILE", default_value = "template.pdf")]
    output: PathBuf,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum PaperArg {
    /// 210 x 297 mm
    A4,
    /// 8.5 x 11 in
    Letter,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure::Bad`] for a drawing that cannot be used, or a file that cannot be written.
pub fn run(args: &TemplateArgs, global: &Global, terminal: &Terminal) -> Result<(), Failure> {
    let named = |e: String| Failure::Bad(format!("{}: {e}", args.drawing.display()));
    let text = std::fs::read_to_string(&args.drawing)
        .map_err(|e| named(format!("cannot be read: {e}")))?;
    let drawing = read_drawing(&text).map_err(|e| named(e.to_string()))?;
    let paper = match args.paper {
        PaperArg::A4 => Paper::A4,
        PaperArg::Letter => Paper::Letter,
    };
    let made = template(&drawing.sheet, paper).map_err(|e| named(e.to_string()))?;
    write_file(&args.output, &made.pdf).map_err(Failure::bad)?;
    terminal.clear();
    if !global.quiet {
        for warning in &drawing.warnings {
            eprintln!("warning: {warning}");
        }
    }
    if global.json {
        let result = serde_json::json!({
            "drawing": args.drawing,
            "written": args.output,
            "pages": made.pages,
            "grid": made.grid,
            "page_mm": made.page_mm,
            "warnings": drawing.warnings,
        });
        return print(&format!("{result:#}"));
    }
    if global.quiet {
        return Ok(());
    }
    print(&format!(
        "{}: {} page{} in {} column{} and {} row{}; print at actual size",
        args.output.display(),
        made.pages,
        plural(made.pages),
        made.grid[0],
        plural(made.grid[0]),
        made.grid[1],
        plural(made.grid[1]),
    ))
}

fn plural(n: usize) -> &'static str {
    if n == 1 { "" } else { "s" }
}
