//! `guide.html`: a page to print and take to the machine.

use std::fmt::Write as _;

use crate::base::units::{fixed, short};
use crate::calibrate::CouponPlan;
use crate::job::report::{escape, svg_element};
use crate::machine::Machine;
use crate::material::Material;

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;max-width:190mm;margin:8mm auto;padding:0 4mm;color:#111}\
h1{font-size:22px}h2{font-size:17px;margin-top:1.4em}table{border-collapse:collapse}td,th{border:1px solid #999;padding:2px 8px;text-align:left}\
td:empty{min-width:18mm}figure{margin:1em 0}figure.plan svg{width:100%;height:auto;max-height:150mm}figure.plan path,figure.plan circle{vector-effect:non-scaling-stroke;stroke-width:.8px}\
@media print{h2{break-after:avoid}figure,tr{break-inside:avoid}}";

/// The page; `drawing` is the SVG of all parts in their places.
pub(super) fn html(
    plan: &CouponPlan,
    drawing: &str,
    material: &Material,
    machine: &Machine,
    machine_s: f64,
) -> String {
    let coupon = &plan.coupon;
    let mut out = String::new();
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Coupon: {0}</title><style>{STYLE}</style></head><body>\n\
         <h1>Coupon: {0}</h1>\n<p>For {1}. All of it lies on {2} x {3} mm of one piece and takes {4} min on the machine. \
         Leave the sheet where it is between the jobs.</p>\n",
        escape(&material.title),
        escape(&machine.title),
        short(plan.used.width().ceil(), 0),
        short(plan.used.height().ceil(), 0),
        short((machine_s / 60.0).ceil(), 0),
    );
    steps(&mut out, plan);
    let _ = writeln!(
        out,
        "<h2>Where everything is</h2><figure class=\"plan\">{}</figure>",
        svg_element(drawing).unwrap_or_default()
    );
    out.push_str("<h2>Strips</h2><table><tr><th>strip</th><th>hinge, mm</th><th>edge, mm</th><th>hinges</th><th>mark to mark, mm</th><th>held at</th><th>tore at</th><th>torn or plastic</th></tr>\n");
    for strip in &coupon.strip {
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td></td><td></td><td></td></tr>",
            escape(&strip.name),
            short(strip.hinge_width_mm, 3),
            short(strip.edge_mm, 3),
            strip.hinges,
            short(strip.gauge_mm, 2)
        );
    }
    out.push_str("</table>\n<h2>Calipers</h2><table><tr><th>name</th><th>drawn, mm</th><th>measured, mm</th></tr>\n");
    for piece in &coupon.kerf {
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td>{}</td><td></td></tr>",
            escape(&piece.name),
            fixed(piece.nominal_mm, 2)
        );
    }
    out.push_str("</table>\n");
    if !coupon.setting.is_empty() {
        out.push_str("<h2>Power and speed</h2><table><tr><th>square</th><th>power, %</th><th>speed, mm/min</th><th>through?</th></tr>\n");
        for square in &coupon.setting {
            let _ = writeln!(
                out,
                "<tr><td>{}</td><td>{}</td><td>{}</td><td></td></tr>",
                escape(&square.name),
                short(square.power_percent, 1),
                short(square.speed_mm_per_min, 1)
            );
        }
        out.push_str("</table>\n");
    }
    card(&mut out, plan);
    out.push_str(&super::plot::place());
    out.push_str("\n</body></html>\n");
    out
}

fn steps(out: &mut String, plan: &CouponPlan) {
    out.push_str("<ol>\n");
    let has_grid = plan.jobs.iter().any(|job| job.name == "settings");
    if has_grid {
        out.push_str("<li>Cut <b>settings.nc</b>. Which squares fall out by themselves, with a clean edge? If none but the hottest do, record these first, fit, and make a new coupon with the better setting.</li>\n");
    }
    out.push_str("<li>Cut <b>kerf.nc</b>. Measure each hole and the piece that fell out of it with calipers, upright in the picture's sense: of the slot its width. Write them down to a hundredth.</li>\n");
    out.push_str("<li>Cut <b>strips.nc</b>.");
    if !plan.engraved {
        out.push_str(" This machine does not engrave: write the names on the strips from the picture before you take them out.");
    }
    out.push_str("</li>\n<li>Hold a strip by its two grips (a hook or a bolt through the holes, or pliers) and pull slowly, one notch of the gauge after the other. Lay the card's zero on one mark of the strip, on the scale with the strip's name: at the other mark stands the stretch. Let hinges bend out of the way as they like; do not twist.</li>\n\
        <li>Write down the last stretch at which all hinges were whole, and the first at which one was not.</li>\n\
        <li><code>kagome calibrate record FOLDER</code> asks for everything, or fill in readings.csv and add <code>--readings readings.csv</code>; then <code>kagome calibrate fit FOLDER/readings.toml</code>, which draws what it found at the end of this page.</li></ol>\n");
}

/// The gauge card at true size.
fn card(out: &mut String, plan: &CouponPlan) {
    // Marks only: a printed card is cut with scissors.
    let bounds = plan.card.bounds();
    let mut lines = String::new();
    for stroke in plan
        .card
        .marks
        .iter()
        .flat_map(crate::pattern::Mark::strokes)
    {
        for (n, p) in stroke.flattened(0.02).iter().enumerate() {
            let _ = write!(
                lines,
                "{}{} {}",
                if n == 0 { 'M' } else { 'L' },
                fixed(p.x - bounds.x0, 3),
                fixed(bounds.y1 - p.y, 3)
            );
        }
    }
    let (width, height) = (bounds.width().max(104.0), bounds.height() + 10.0);
    let below = bounds.height() + 5.0;
    let _ = writeln!(
        out,
        "<h2>Gauge card</h2><p>Print at 100 %, without fitting to the page: the line below is 100 mm long.</p>\
         <figure class=\"card\"><svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}mm\" height=\"{1}mm\" viewBox=\"0 0 {0} {1}\" fill=\"none\" stroke=\"#000\" stroke-width=\"0.25\">\
         <path d=\"{lines}\"/><path d=\"M2 {2}h100M2 {3}v4M102 {3}v4\"/></svg></figure>",
        fixed(width, 3),
        fixed(height, 3),
        fixed(below, 3),
        fixed(below - 2.0, 3)
    );
}
