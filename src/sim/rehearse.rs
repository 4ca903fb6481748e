//! A whole job on the simulated machine, through the sender that drives a real one.

use std::time::Duration;

use serde::Serialize;

use super::burnt::{BeamChange, BeamTime, Burn, Stroke, strokes};
use super::controller::Controller;
use super::link::SimTransport;
use super::settings::Settings;
use crate::base::progress::Progress;
use crate::control::{
    Job, JobError, JobRules, SendError, SendOptions, SendReport, Unattended, send,
};

/// What a rehearsal showed.
#[derive(Clone, Debug, PartialEq)]
pub struct Rehearsal {
    /// Everything that was burnt, in order.
    pub burns: Vec<Burn>,
    /// The burns joined to strokes: the cuts, machine coordinates, mm.
    pub strokes: Vec<Stroke>,
    /// How long the machine took, s.
    pub time_s: f64,
    /// From the first motion to the last, s.
    pub motion_s: f64,
    /// How long and how often the beam was on.
    pub beam: BeamTime,
    /// Every switching of the beam; times from the first motion.
    pub beam_changes: Vec<BeamChange>,
    /// What the sender reports.
    pub report: SendReport,
    /// The figures that a person wants.
    pub summary: RehearsalSummary,
}

/// A rehearsal in numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RehearsalSummary {
    /// Number of cuts.
    pub strokes: usize,
    /// Length burnt, mm.
    pub burnt_mm: f64,
    /// Time with the beam on, s.
    pub beam_on_s: f64,
    /// Time with the beam on while the head stood still, s. Zero in a good job.
    pub standing_burn_s: f64,
    /// Length burnt on rapids, mm. Zero in a good job.
    pub rapid_burn_mm: f64,
    /// True if the beam was on at the end.
    pub beam_on_at_end: bool,
    /// Bytes lost to a full receive buffer. Zero for a good sender.
    pub lost_bytes: u64,
}

impl RehearsalSummary {
    /// The figures of what a machine has burnt.
    pub fn of(controller: &Controller) -> Self {
        let burns = controller.burns();
        let tolerance_mm = step_mm(controller.settings());
        // A fold from 0, because the sum of no numbers is -0, which a person should not have to read.
        let total = |of: &dyn Fn(&Burn) -> f64| burns.iter().map(of).fold(0.0, |a, b| a + b);
        let time = |b: &Burn| b.end_s - b.start_s;
        Self {
            strokes: strokes(&burns, tolerance_mm).len(),
            burnt_mm: total(&Burn::length_mm),
            beam_on_s: controller.beam_time().on_s,
            standing_burn_s: total(&|b| if b.standing() { time(b) } else { 0.0 }),
            rapid_burn_mm: total(&|b| if b.rapid { b.length_mm() } else { 0.0 }),
            beam_on_at_end: controller.beam_on(),
            lost_bytes: controller.lost_bytes(),
        }
    }
}

/// One step of the coarser of the two motors, mm.
fn step_mm(settings: &Settings) -> f64 {
    1.0 / settings.steps_per_mm[0].min(settings.steps_per_mm[1])
}

/// Why a rehearsal did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum RehearsalError {
    /// The job is no job.
    #[error(transparent)]
    Job(#[from] JobError),
    /// The sender stopped.
    #[error("rehearsal: {0}")]
    Send(#[from] Box<SendError>),
}

/// Runs a job on a simulated machine with these settings, homed, which stands at its origin, as fast as possible.
///
/// # Errors
/// What the sender would say at a real machine.
pub fn rehearse(
    job_text: &[u8],
    settings: &Settings,
    rules: &JobRules,
    progress: &dyn Progress,
) -> Result<Rehearsal, RehearsalError> {
    let job = Job::check(job_text, rules)?;
    let mut link = SimTransport::new(Controller::homed_at_zero(settings.clone()));
    let options = SendOptions {
        longest_pause: Some(Duration::from_secs(60)),
        buffer: Some(settings.receive_buffer),
        ..SendOptions::default()
    };
    let report = send(&mut link, &job, &options, &Unattended(progress)).map_err(Box::new)?;
    let controller = link.into_controller();
    let burns = controller.burns();
    let first_s = controller.first_motion_s().unwrap_or_default();
    Ok(Rehearsal {
        strokes: strokes(&burns, step_mm(settings)),
        burns,
        time_s: report.time_s,
        motion_s: controller.motion_s(),
        beam: controller.beam_time(),
        beam_changes: controller
            .beam_changes()
            .iter()
            .map(|change| BeamChange {
                at_s: change.at_s - first_s,
                on: change.on,
            })
            .collect(),
        report,
        summary: RehearsalSummary::of(&controller),
    })
}
