//! A bench in simulation: a coupon that was cut there, and what a person who pulls and measures it would write down.

use super::coupon::Coupon;
use super::geometry::Geometry;
use super::kerf::Side;
use super::readings::{Item, items, template};
use super::simulated::{Gauge, SimulatedMaterial};
use crate::base::random::Random;
use crate::base::units::{rounded, short};
use crate::material::Failure;

/// A machine whose kerf nobody told, a material with hidden limits, and calipers.
#[derive(Clone, Debug)]
pub struct SimulatedBench {
    /// What is pulled.
    pub material: SimulatedMaterial,
    /// What the beam takes away really, millimetres.
    pub kerf_mm: f64,
    /// Standard deviation of a caliper reading, millimetres.
    pub calipers_mm: f64,
    /// Power over speed, per cent a mm/min, from which on a square is cut through.
    pub least_heat: f64,
    random: Random,
}

impl SimulatedBench {
    /// A bench with exact calipers, where everything cuts through.
    pub fn new(material: SimulatedMaterial, kerf_mm: f64, seed: u64) -> Self {
        Self {
            material,
            kerf_mm,
            calipers_mm: 0.0,
            least_heat: 0.0,
            // Another sequence than that of a material with the same seed.
            random: Random::new(!seed),
        }
    }

    /// The hinges of a sheet that was drawn for another kerf, as this machine cuts them.
    pub fn as_cut(&self, drawn: &Geometry) -> Geometry {
        let less = self.kerf_mm - drawn.kerf_mm;
        Geometry {
            hinge_width_mm: drawn.hinge_width_mm - less,
            kerf_mm: self.kerf_mm,
            tip_radius_mm: (drawn.tip_radius_mm + 0.5 * less).max(0.5 * self.kerf_mm),
            ..*drawn
        }
    }

    /// The coupon's table, filled in: every strip pulled from mark to mark, every piece measured to a hundredth, every square
    /// looked at. `date` is `YYYY-MM-DD`.
    pub fn write_down(&mut self, coupon: &Coupon, date: &str) -> String {
        let gauge = Gauge {
            from: 1.0 + coupon.gauge_step,
            step: coupon.gauge_step,
            to: 2.0,
        };
        let mut text = String::new();
        // The head of the table is that which a person finds.
        for line in template(coupon).lines() {
            text.push_str(line);
            text.push('\n');
            if line.starts_with("name,") {
                break;
            }
        }
        for item in items(coupon) {
            let row = match item {
                Item::Strip(strip) => {
                    let drawn = Geometry {
                        hinge_width_mm: strip.hinge_width_mm,
                        kerf_mm: coupon.kerf_mm,
                        tip_radius_mm: coupon.tip_radius_mm.unwrap_or(0.5 * coupon.kerf_mm),
                        thickness_mm: coupon.thickness_mm,
                        edge_mm: strip.edge_mm,
                    };
                    let cut = self.as_cut(&drawn);
                    let read = self.material.pull(&cut, strip.hinges, &gauge, date);
                    let tore = read.tore.map_or_else(String::new, |t| short(t, 4));
                    let how = match read.failure {
                        Some(Failure::Torn) => "torn",
                        Some(Failure::Plastic) => "plastic",
                        None => "",
                    };
                    format!("{},{tore},{how},,", short(read.held, 4))
                }
                Item::Kerf(piece) => {
                    let real = match piece.side {
                        Side::Hole => piece.nominal_mm + self.kerf_mm,
                        Side::Piece => piece.nominal_mm - self.kerf_mm,
                    };
                    let read = real + self.calipers_mm * self.random.normal();
                    format!(",,,{},", short(rounded(read, 2), 2))
                }
                Item::Setting(square) => {
                    let heat = square.power_percent / square.speed_mm_per_min;
                    let through = heat >= self.least_heat;
                    format!(",,,,{}", if through { "yes" } else { "no" })
                }
            };
            text.push_str(&format!("{},{row}\n", item.name()));
        }
        text
    }
}
