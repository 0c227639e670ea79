//! Checks of a shoot before a real flight: plans, simulated flights, lamps and base stations.

use nalgebra::Vector3;

use super::planned::ends;
use super::{Lighting, Planned, Recording, Shoot};
use crate::error::{Error, Result};
use crate::export::compressed::MEMORY_BYTES;
use crate::export::{Memory, memory};
use crate::flight::Flight;
use crate::geometry::bounds;
use crate::letters::Strokes;
use crate::light::{Drive, LightTrace};
use crate::plan::Plan;
use crate::plan::check::{
    Check, Finding, Flown, Profile, Severity, check_flown, check_letters, check_plans,
};
use crate::scene::Scene;
use crate::sim::coverage;

/// Duration of the pieces over which light along the path is summed: 1 cm at 0.2 m/s. A piece as
/// long as the lamp's blur tells hot spots from trembling.
const PIECE_S: f64 = 0.05;

/// Distance between two places at which the view of the base stations is checked.
const COVERAGE_STEP_M: f64 = 0.1;

impl Shoot {
    /// Checks letters, plans, simulated flights, light and base stations against a profile.
    ///
    /// # Errors
    ///
    /// Those of the stages, except that of an infeasible flight: it is a finding.
    pub fn preflight(&self, profile: &Profile) -> Result<Vec<Finding>> {
        if !self.in_step() {
            let fly = |drone| self.fly_drone(drone, &mut |_| {});
            return self.findings((0..self.plans.len()).map(fly).collect(), profile);
        }
        let flown = match self.fly(&|_, _| {}) {
            Ok(flights) => flights.into_iter().map(Ok).collect(),
            Err(Error::Infeasible { what, hint }) => {
                let lost = |_| Err(Error::Infeasible { what: what.clone(), hint: hint.clone() });
                self.plans.iter().map(lost).collect()
            }
            Err(error) => return Err(error),
        };
        self.findings(flown, profile)
    }

    /// What speaks against a real flight, of flights that were flown already: the checks that can
    /// stop one, without memory and picture.
    ///
    /// # Errors
    ///
    /// As [`Self::preflight`].
    pub fn inspect(&self, flights: &[Flight], profile: &Profile) -> Result<Vec<Finding>> {
        let mut findings = self.check_design(profile);
        for (drone, (planned, flight)) in self.plans.iter().zip(flights).enumerate() {
            findings.extend(self.check_flight(drone, &planned.plan, flight, profile)?);
            findings.extend(check_coverage(&planned.plan, &self.scene)?);
        }
        Ok(findings)
    }

    fn findings(&self, flown: Vec<Result<Flight>>, profile: &Profile) -> Result<Vec<Finding>> {
        let mut findings = self.check_design(profile);
        let mut recordings = Vec::new();
        for (drone, (Planned { plan, .. }, flight)) in self.plans.iter().zip(flown).enumerate() {
            findings.push(check_memory(plan));
            match flight {
                Ok(flight) => {
                    findings.extend(self.check_flight(drone, plan, &flight, profile)?);
                    recordings.push(Recording::Flight(flight));
                }
                Err(Error::Infeasible { what, .. }) => {
                    let finding = Finding::without_value(Check::Flight, Severity::Stop, 0.0);
                    findings.push(Finding { detail: what, ..finding });
                }
                Err(error) => return Err(error),
            }
            findings.extend(check_coverage(plan, &self.scene)?);
        }
        if recordings.len() == self.plans.len() {
            findings.extend(self.check_picture(recordings));
        }
        Ok(findings)
    }

    /// Letters and plans.
    fn check_design(&self, profile: &Profile) -> Vec<Finding> {
        let letters = self.strokes.iter();
        let letters = letters.flat_map(|word| check_letters(word, &self.scene.plan.style));
        let plans: Vec<Plan> = self.plans.iter().map(|planned| planned.plan.clone()).collect();
        letters.chain(check_plans(&plans, profile)).collect()
    }

    fn check_flight(
        &self,
        drone: usize,
        plan: &Plan,
        flight: &Flight,
        profile: &Profile,
    ) -> Result<Vec<Finding>> {
        let scene = &self.scene;
        let ends = ends(scene, plan, flight).unwrap_or_default();
        let painted = painted(flight, &self.light_drone(drone, flight)?, scene);
        let flown = Flown {
            flight,
            ends: &ends,
            painted: &painted,
            cap_height_m: self.strokes.as_ref().and_then(cap_height_m),
            motor_max: scene.vehicle.motor_max,
            battery_modeled: scene.battery.capacity_ah > 0.0,
        };
        Ok(check_flown(&flown, profile))
    }

    /// What only a preview would show: the word in the picture, while the shutter is open, lit.
    fn check_picture(&self, recordings: Vec<Recording>) -> Vec<Finding> {
        let texts = match self.light(recordings) {
            Ok(Lighting { obstacles, warnings, .. }) => [obstacles, warnings].concat(),
            Err(error) => vec![error.to_string()],
        };
        let finding = |severity| Finding::without_value(Check::Picture, severity, 0.0);
        if texts.is_empty() {
            return vec![finding(Severity::Fine)];
        }
        let warn = |detail| Finding { detail, ..finding(Severity::Warning) };
        texts.into_iter().map(warn).collect()
    }
}

/// Cap height of a word's letters; `None` of a drawing.
fn cap_height_m(strokes: &Strokes) -> Option<f64> {
    let letter = strokes.font.as_ref().and(strokes.glyphs.first())?;
    Some(letter.cell.cap_height_m)
}

/// Whether the plan fits the memory on board as a compressed trajectory, how many pieces it takes as
/// polynomials, and in which formats it can be exported.
fn check_memory(plan: &Plan) -> Finding {
    #[expect(clippy::cast_precision_loss, reason = "a few kilobytes")]
    let limit = MEMORY_BYTES as f64;
    match memory(plan) {
        #[expect(clippy::cast_precision_loss, reason = "a few kilobytes")]
        Ok(Memory { bytes, pieces, formats }) => {
            let fits = bytes <= MEMORY_BYTES;
            let finding = Finding::new(Check::Memory, fits, Severity::Warning, bytes as f64, limit);
            Finding { count: Some(pieces), detail: formats.join(", "), ..finding }
        }
        Err(error) => {
            let finding = Finding::without_value(Check::Memory, Severity::Unknown, limit);
            Finding { detail: error.to_string(), ..finding }
        }
    }
}

/// Light of the first lamp that follows the plan, in pieces along its path: start time, length and
/// seconds of full light.
fn painted(flight: &Flight, trace: &LightTrace, scene: &Scene) -> Vec<(f64, f64, f64)> {
    let fixtures = scene.light.fixtures();
    let follows = |name: &str| {
        fixtures.iter().any(|fixture| {
            fixture.name == name
                && matches!(&fixture.drive, Drive::Command(c) if flight.lights.contains_key(c))
        })
    };
    let Some(lamp) = trace.lamps.iter().find(|lamp| follows(&lamp.emitter.name)) else {
        return Vec::new();
    };
    let mut pieces: Vec<(f64, f64, f64)> = Vec::new();
    let mut from: Option<(f64, Vector3<f64>)> = None;
    let mut light_s = 0.0;
    for pair in lamp.samples.windows(2) {
        let lasts_s = pair[1].time_s - pair[0].time_s;
        let lit = 0.5 * (pair[0].level + pair[1].level);
        if lit <= 0.0 {
            (from, light_s) = (None, 0.0);
            continue;
        }
        let (start_s, start_m) = *from.get_or_insert((pair[0].time_s, pair[0].position_m));
        light_s += lit * lasts_s;
        if pair[1].time_s - start_s >= PIECE_S {
            pieces.push((start_s, (pair[1].position_m - start_m).xz().norm(), light_s));
            (from, light_s) = (None, 0.0);
        }
    }
    pieces
}

/// Whether two base stations see the box of the whole flight.
fn check_coverage(plan: &Plan, scene: &Scene) -> Result<Vec<Finding>> {
    if scene.sensors.lighthouse.stations.is_empty() {
        return Ok(vec![Finding::without_value(Check::Coverage, Severity::Unknown, 1.0)]);
    }
    let in_the_air = plan.setpoints.iter().filter(|setpoint| !setpoint.on_floor());
    let places = in_the_air.map(|setpoint| setpoint.position_m);
    let bounds_m = bounds(places.map(|p| [p.x, p.z]));
    if bounds_m[0] >= bounds_m[2] || bounds_m[1] >= bounds_m[3] {
        return Ok(Vec::new());
    }
    let frac = coverage(&scene.sensors, bounds_m, 0.0, COVERAGE_STEP_M)?.seen_frac();
    Ok(vec![Finding::new(Check::Coverage, frac >= 1.0, Severity::Stop, frac, 1.0)])
}
