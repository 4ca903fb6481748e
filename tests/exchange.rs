//! What goes out to other programs and comes back: edited drawings, templates, bodies, and, where they are installed, what
//! those programs themselves make of our files.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a helper that fails, fails its test"
)]

mod judge;

use std::path::Path;
use std::process::{Command, Output};

use judge::run::kagome;
use kagome::linkage::{Handedness, Linkage};
use kagome::pattern::{self, MarkOptions, Sheet, SheetOptions};
use kagome::{machine, material};

fn says(output: &Output, code: i32, words: &[&str]) {
    let text = format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(output.status.code(), Some(code), "{text}");
    for word in words {
        assert!(text.contains(word), "{word:?} in {text}");
    }
}

/// A hexagon with marks in its place on the default bed.
fn hexagon(radius: i32, edge: f64) -> Sheet {
    let machine = machine::load(machine::DEFAULT).unwrap();
    let material = material::load(material::DEFAULT).unwrap();
    let kerf = material.cut_for(&machine).unwrap().kerf_mm;
    let linkage = Linkage::patch(edge, Handedness::Right, &Linkage::hexagon_cells(radius));
    let mut sheet = Sheet::new(&linkage, &SheetOptions::plain(1.0, kerf)).unwrap();
    let told = MarkOptions {
        name: "hexagon",
        back: false,
    };
    sheet.marks = pattern::marks(&linkage, &sheet, &told);
    pattern::placed(&sheet, &machine, false).unwrap().0
}

#[test]
fn an_edited_drawing_is_cut_as_it_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = pattern::svg(&hexagon(3, 12.0));
    std::fs::write(at("pattern.svg"), &text).unwrap();
    says(
        &kagome(&["cut", "pattern.svg"], folder.path()),
        0,
        &["job.nc", "verified and rehearsed"],
    );
    says(&kagome(&["verify", "job.nc"], folder.path()), 0, &["good"]);
    // What is there is not replaced unasked.
    says(
        &kagome(&["cut", "pattern.svg"], folder.path()),
        2,
        &["--force"],
    );

    // A slit deleted, everything moved, as an editor writes it.
    let gone = text
        .lines()
        .find(|l| l.contains("data-star=\"2\""))
        .unwrap();
    let edited = text
        .replacen(gone, "", 1)
        .replace("<g ", "<g transform=\"translate(7.5,-3.25)\" ");
    std::fs::write(at("edited.svg"), &edited).unwrap();
    let cut = kagome(
        &["cut", "edited.svg", "-o", "edited.nc", "--json"],
        folder.path(),
    );
    says(&cut, 0, &["\"strokes\""]);
    // Against itself, and not against what it was.
    says(
        &kagome(&["verify", "edited.nc"], folder.path()),
        0,
        &["good"],
    );
    let other = ["verify", "edited.nc", "--sheet", "pattern.svg"];
    says(
        &kagome(&other, folder.path()),
        1,
        &["where the sheet has no cut"],
    );
    // Under another name, beside the old drawing: a copy goes with it.
    let cut = kagome(&["cut", "edited.svg", "-o", "third.nc"], folder.path());
    says(&cut, 0, &["third.nc"]);
    says(
        &kagome(&["verify", "third.nc"], folder.path()),
        0,
        &["third.svg"],
    );
    let moved = pattern::read_svg(&edited).unwrap();
    assert_eq!(moved.slits.len() + 1, hexagon(3, 12.0).slits.len());
}

#[test]
fn a_drawing_that_cannot_be_cut_is_refused_with_the_place_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let sheet = hexagon(3, 12.0);
    let text = pattern::svg(&sheet);
    // One slit longer by a third of a millimetre.
    let mut longer = sheet.clone();
    let slit = &mut longer.slits[4];
    slit.tip += (slit.tip - slit.tail).normalize() * 0.3;
    let long = pattern::svg(&longer);
    for (name, drawing, words) in [
        ("longer", long.as_str(), ["0.740 mm", "another slit"]),
        (
            "text",
            &text.replace("</svg>", "<text>A1</text></svg>"),
            ["line ", "text"],
        ),
        (
            "scaled",
            &text.replace("<g ", "<g transform=\"scale(1.1)\" "),
            ["110 %", "--scale"],
        ),
        (
            "far",
            &text.replace("<g ", "<g transform=\"translate(-500)\" "),
            ["--place", "reaches from"],
        ),
        (
            "other",
            "<svg xmlns='http://www.w3.org/2000/svg'/>",
            ["data-kagome-format", "kagome wrote"],
        ),
    ] {
        let file = format!("{name}.svg");
        std::fs::write(at(&file), drawing).unwrap();
        let job = format!("{name}.nc");
        says(
            &kagome(&["cut", &file, "-o", &job], folder.path()),
            2,
            &words,
        );
        assert!(!at(&job).exists(), "{name}");
    }
    // Moved into the corner, the drawing as it is cut lies beside the job.
    let place = ["cut", "far.svg", "--place", "-o", "near.nc"];
    says(&kagome(&place, folder.path()), 0, &["near.nc"]);
    says(
        &kagome(&["verify", "near.nc"], folder.path()),
        0,
        &["near.svg"],
    );
    let over = ["cut", "near.svg", "--place", "-o", "near.nc", "--force"];
    says(&kagome(&over, folder.path()), 2, &["another name"]);
}

#[test]
fn templates_and_bodies_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("pattern.svg"), pattern::svg(&hexagon(4, 30.0))).unwrap();
    let print = [
        "template",
        "pattern.svg",
        "--paper",
        "letter",
        "-o",
        "t.pdf",
        "--json",
    ];
    let output = kagome(&print, folder.path());
    says(&output, 0, &["\"pages\": 2"]);
    let pdf = std::fs::read(at("t.pdf")).unwrap();
    assert!(pdf.starts_with(b"%PDF-1.4"));
    says(
        &kagome(&["template", "none.svg"], folder.path()),
        2,
        &["none.svg"],
    );

    let form = [
        "form",
        "sample:cap:faces=1000",
        "--base",
        "12",
        "--offset",
        "-0.8",
        "-o",
        "b.stl",
    ];
    says(&kagome(&form, folder.path()), 0, &["b.stl", "watertight"]);
    // What was written is a closed surface to our own reader.
    let inspect = ["inspect", "b.stl", "--json"];
    says(&kagome(&inspect, folder.path()), 0, &[]);
    let text = String::from_utf8(kagome(&inspect, folder.path()).stdout).unwrap();
    let found: serde_json::Value = serde_json::from_str(&text).unwrap();
    let rims = found
        .pointer("/rims")
        .and_then(|r| r.as_array())
        .map(Vec::len);
    assert!(rims.is_none_or(|n| n == 0), "{text}");
    for bad in [
        &["form", "sample:cap", "--up", "0,0", "-o", "c.stl"][..],
        &["form", "sample:cap", "--base", "-3", "-o", "c.stl"],
        &["form", "sample:octasphere", "--base", "900", "-o", "c.stl"],
    ] {
        says(&kagome(bad, folder.path()), 2, &[]);
        assert!(!at("c.stl").exists());
    }
}

/// Runs a program that must be there.
fn run(program: &str, args: &[&str], folder: &Path) -> Vec<u8> {
    let output = Command::new(program)
        .args(args)
        .env("QT_QPA_PLATFORM", "offscreen")
        .current_dir(folder)
        .output()
        .unwrap_or_else(|e| panic!("{program}: {e}"));
    assert!(
        output.status.success(),
        "{program} {args:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    output.stdout
}

/// Width and height of a picture in pixels, and of the box around what is not white in it.
fn ink(path: &Path) -> ([usize; 2], [usize; 2]) {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let samples = info.color_type.samples();
    let (width, height) = (info.width as usize, info.height as usize);
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for (n, pixel) in bytes.chunks(samples).take(width * height).enumerate() {
        let clear = samples == 4 && pixel[3] < 128;
        if clear || pixel[..samples.min(3)].iter().all(|b| *b > 200) {
            continue;
        }
        for (k, v) in [n % width, n / width].into_iter().enumerate() {
            low[k] = low[k].min(v);
            high[k] = high[k].max(v);
        }
    }
    ([width, height], [0, 1].map(|k| high[k] + 1 - low[k]))
}

/// A tenth of a millimetre to a pixel.
const DPI: &str = "254";

#[test]
#[ignore = "needs ezdxf, LibreCAD, librsvg and poppler; .ci/run installs them"]
fn other_programs_open_our_files_at_true_size() {
    let bench = tempfile::tempdir().unwrap();
    let folder = bench.path();
    // Small enough for a page of A4.
    let make = [
        "make",
        "sample:vase",
        "--size",
        "90",
        "--triangles",
        "200",
        "-q",
        "-o",
        "out",
    ];
    says(&kagome(&make, folder), 0, &[]);
    let text = std::fs::read_to_string(folder.join("out/pattern.svg")).unwrap();
    let sheet = pattern::read_svg(&text).unwrap();
    let figures = sheet.figures();
    let size = [figures.width_mm, figures.height_mm];
    let near = |found: f64, wanted: f64, by: f64, what: &str| {
        assert!(
            (found - wanted).abs() <= by,
            "{what}: {found}, {wanted} wanted"
        );
    };

    // ezdxf: nothing to mend, and the same lines.
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/judge/measure_dxf.py");
    let python = std::env::var("KAGOME_PYTHON").unwrap_or_else(|_| "python3".into());
    let told = run(
        &python,
        &[script.to_str().unwrap(), "out/pattern.dxf"],
        folder,
    );
    let found: serde_json::Value = serde_json::from_slice(&told).unwrap();
    assert_eq!(found["errors"], serde_json::json!([]));
    assert_eq!(
        (&found["version"], &found["units"]),
        (&"AC1009".into(), &4.into())
    );
    let number = |pointer: &str| found.pointer(pointer).and_then(|v| v.as_f64()).unwrap();
    near(
        number("/layers/contour/length_mm"),
        figures.contour_length_mm,
        0.01,
        "contours",
    );
    let slits = number("/layers/slits/length_mm") + number("/layers/flaps/length_mm");
    near(
        slits,
        figures.slit_length_mm,
        0.01 + 1e-4 * figures.slits as f64,
        "slits",
    );
    let written: f64 = sheet
        .marks
        .iter()
        .flat_map(|m| m.strokes())
        .map(|l| l.length())
        .sum();
    near(
        number("/layers/marks/length_mm"),
        written,
        0.01 * written,
        "marks",
    );
    assert_eq!(
        number("/layers/slits/count") as usize + number("/layers/flaps/count") as usize,
        figures.slits
    );
    for (n, wanted) in [
        sheet.bounds().x0,
        sheet.bounds().y0,
        sheet.bounds().x1,
        sheet.bounds().y1,
    ]
    .iter()
    .enumerate()
    {
        near(
            number(&format!("/layers/contour/box_mm/{n}")),
            *wanted,
            1e-3,
            "the box",
        );
    }
    for (layer, colour) in [
        ("contour", 1),
        ("slits", 5),
        ("flaps", 3),
        ("marks", 7),
        ("guide", 9),
    ] {
        assert_eq!(found["colours"][layer], colour, "{layer}");
    }

    // LibreCAD: printed at 1:1, beside the DXF.
    let print = ["dxf2pdf", "-c", "-s", "1", "out/pattern.dxf"];
    run("librecad", &print, folder);
    let picture = ["-r", DPI, "-png", "-singlefile", "out/pattern.pdf", "drawn"];
    run("pdftoppm", &picture, folder);
    let (_, box_px) = ink(&folder.join("drawn.png"));
    for k in 0..2 {
        // Half a line's width on each side.
        near(0.1 * box_px[k] as f64, size[k], 0.3, "LibreCAD's print");
    }

    // librsvg: the page and the contour.
    let convert = [
        "-d",
        DPI,
        "-p",
        DPI,
        "-b",
        "white",
        "-o",
        "sheet.png",
        "out/pattern.svg",
    ];
    run("rsvg-convert", &convert, folder);
    let (page_px, box_px) = ink(&folder.join("sheet.png"));
    for k in 0..2 {
        near(
            0.1 * page_px[k] as f64,
            size[k] + 2.0,
            0.15,
            "the page of the SVG",
        );
        near(
            0.1 * box_px[k] as f64,
            size[k] + 0.1,
            0.2,
            "the contour of the SVG",
        );
    }

    // poppler: the template's pages and its ruler.
    let template = ["template", "out/pattern.svg", "-o", "t.pdf", "--json"];
    let output = kagome(&template, folder);
    says(&output, 0, &[]);
    let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let info = String::from_utf8(run("pdfinfo", &["t.pdf"], folder)).unwrap();
    let pages = format!("Pages:           {}\n", told["pages"]);
    assert!(info.contains(&pages), "{info}");
    assert!(info.contains("(A4)"), "{info}");
    run(
        "pdftoppm",
        &[
            "-r",
            DPI,
            "-png",
            "-singlefile",
            "-x",
            "95",
            "-W",
            "1010",
            "-y",
            "2825",
            "-H",
            "55",
            "t.pdf",
            "ruler",
        ],
        folder,
    );
    if told["page_mm"][0] == 210.0 {
        let (_, box_px) = ink(&folder.join("ruler.png"));
        near(0.1 * box_px[0] as f64, 100.0, 0.4, "the ruler");
    }

    // The opened linkage as other programs load it.
    let glb = std::fs::read(folder.join("out/linkage.glb")).unwrap();
    assert!(glb.starts_with(b"glTF"));
}
