//! Checks of a shoot before a real flight: plans, simulated flights, lamps and base stations.

use nalgebra::Vector3;

use super::planned::ends;
use super::{Lighting, Recording, Shoot, obstacles};
use crate::crazyflie::{RING_TIMING_ENTRIES, TRAJECTORY_MEMORY_BYTES};
use crate::error::{Error, Result};
use crate::export::lights::timing_entries;
use crate::export::{Form, Length, memory};
use crate::expose::meter::{LampReading, meter};
use crate::flight::Flight;
use crate::geometry::bounds;
use crate::letters::Strokes;
use crate::light::{Lamp, LightTrace};
use crate::plan::Plan;
use crate::plan::check::{
    Check, Finding, Flown, Profile, Severity, check_flown, check_letters, check_plans,
    check_separation,
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
            findings.extend(self.check_flight(drone, flight, None, profile)?);
            findings.extend(self.of_drone(drone, [check_coverage(&planned.plan, &self.scene)?]));
        }
        Ok(findings)
    }

    fn findings(&self, flown: Vec<Result<Flight>>, profile: &Profile) -> Result<Vec<Finding>> {
        let mut findings = self.check_design(profile);
        let picture = self.picture(&flown);
        for (drone, flight) in flown.into_iter().enumerate() {
            let plan = &self.plans[drone].plan;
            let memory = [self.check_memory(drone), self.check_led_memory(drone)];
            findings.extend(self.of_drone(drone, memory));
            match flight {
                Ok(flight) => {
                    findings.extend(self.check_flight(
                        drone,
                        &flight,
                        picture.as_ref(),
                        profile,
                    )?);
                }
                Err(Error::Infeasible { what, .. }) => {
                    let finding = Finding::without_value(Check::Flight, Severity::Stop, 0.0);
                    findings.extend(self.of_drone(drone, [Finding { detail: what, ..finding }]));
                }
                Err(error) => return Err(error),
            }
            findings.extend(self.of_drone(drone, [check_coverage(plan, &self.scene)?]));
        }
        findings.extend(self.check_picture(picture.as_ref()));
        Ok(findings)
    }

    /// The findings of one drone, counted from 0, with its number where there are several.
    fn of_drone(
        &self,
        drone: usize,
        findings: impl IntoIterator<Item = Finding>,
    ) -> impl Iterator<Item = Finding> {
        let number = Some(drone + 1).filter(|_| self.plans.len() > 1);
        findings.into_iter().map(move |finding| Finding { drone: number, ..finding })
    }

    /// Letters and plans.
    fn check_design(&self, profile: &Profile) -> Vec<Finding> {
        let mut findings = match &self.strokes {
            Some(strokes) => check_letters(strokes, &self.scene.plan.style),
            None => {
                vec![Finding::unchecked(Check::DoubledStroke, "no word is named for the plans")]
            }
        };
        findings.extend(check_plans(&self.designs(), profile));
        if !self.designs.is_empty() {
            // Drones with trajectories on board wait for their turn in the air.
            let flown: Vec<Plan> = self.plans.iter().map(|planned| planned.plan.clone()).collect();
            findings.retain(|finding| finding.check != Check::Separation);
            findings.extend(check_separation(&flown));
        }
        findings
    }

    /// What the flights leave in the picture; `None` where one of them fails.
    fn picture(&self, flown: &[Result<Flight>]) -> Option<Picture> {
        let flights = flown.iter().map(|flight| flight.as_ref().ok().cloned());
        let recordings: Option<Vec<_>> = flights.map(|f| f.map(Recording::Flight)).collect();
        Some(match self.light(recordings?) {
            Ok(Lighting { trace, camera, writing, obstacles, warnings, .. }) => {
                let mut readings = meter(&trace, &camera).unwrap_or_default();
                readings.retain(|reading| writing.contains(&reading.name));
                Picture { readings, warnings: [obstacles, warnings].concat() }
            }
            Err(error) => Picture { readings: Vec::new(), warnings: vec![error.to_string()] },
        })
    }

    fn check_flight(
        &self,
        drone: usize,
        flight: &Flight,
        picture: Option<&Picture>,
        profile: &Profile,
    ) -> Result<impl Iterator<Item = Finding>> {
        let scene = &self.scene;
        let ends = ends(scene, &self.plans[drone].plan, flight).unwrap_or_default();
        let trace = self.light_drone(drone, flight)?;
        let prefix = if self.plans.len() > 1 { format!("{}: ", drone + 1) } else { String::new() };
        let flown = Flown {
            flight,
            ends: &ends,
            painted: &painted(flight, &trace, scene),
            evenness_stops: picture.and_then(|picture| picture.evenness_stops(&prefix)),
            cap_height_m: self.strokes.as_ref().and_then(cap_height_m),
            motor_max: scene.vehicle.motor_max,
            battery_modeled: scene.battery.capacity_ah > 0.0,
        };
        Ok(self.of_drone(drone, check_flown(&flown, profile)))
    }

    /// What only a preview would show: the word in the picture, while the shutter is open, lit.
    fn check_picture(&self, picture: Option<&Picture>) -> Vec<Finding> {
        let finding = |severity| Finding::without_value(Check::Picture, severity, 0.0);
        let Some(picture) = picture else {
            return vec![Finding::unchecked(Check::Picture, "not every drone ends its flight")];
        };
        let mut setpoints = self.plans.iter().flat_map(|planned| &planned.plan.setpoints);
        if self.strokes.is_none() && !setpoints.any(|setpoint| setpoint.letter.is_some()) {
            return vec![Finding::unchecked(Check::Picture, "the plans write no letter")];
        }
        if picture.warnings.is_empty() {
            return vec![finding(Severity::Fine)];
        }
        let warn =
            |detail: &String| Finding { detail: detail.clone(), ..finding(Severity::Warning) };
        picture.warnings.iter().map(warn).collect()
    }

    /// Whether the plan fits the memory on board as either trajectory and the radio as setpoints.
    fn check_memory(&self, drone: usize) -> Finding {
        #[expect(clippy::cast_precision_loss, reason = "a few kilobytes")]
        match memory(&self.designs()[drone]) {
            Ok(memory) => {
                let (bytes, limit) = (memory.bytes as f64, TRAJECTORY_MEMORY_BYTES as f64);
                let fits = memory.fits_all;
                let finding = Finding::new(Check::Memory, fits, Severity::Warning, bytes, limit);
                let detail = memory.formats.join(", ");
                Finding { count: Some(memory.pieces), detail, ..finding }
            }
            Err(error) => Finding::unchecked(Check::Memory, &error.to_string()),
        }
    }

    /// Whether the LED timing memory plays the lights of the plan, where a ring alone writes.
    fn check_led_memory(&self, drone: usize) -> Finding {
        let flown = || match self.designs.is_empty() {
            true => self.as_exported(Form::Compressed, Form::Compressed.tolerance_m(), Length::Any),
            false => Ok(self.clone()),
        };
        let used = self.plans[drone].plan.lamps().map(|(lamp, _)| lamp).eq(["ring"]);
        let entries = match used {
            true => flown()
                .and_then(|shoot| timing_entries(&shoot.plans[drone].plan, &self.scene.light)),
            false => Ok(None),
        };
        #[expect(clippy::cast_precision_loss, reason = "entries")]
        let limit = RING_TIMING_ENTRIES as f64;
        match entries {
            Ok(None) => Finding::without_value(Check::LedMemory, Severity::Fine, limit),
            Ok(Some(n)) => {
                let (good, bad) = (n <= RING_TIMING_ENTRIES, Severity::Warning);
                #[expect(clippy::cast_precision_loss, reason = "entries")]
                Finding::new(Check::LedMemory, good, bad, n as f64, limit)
            }
            Err(error) => Finding::unchecked(Check::LedMemory, &error.to_string()),
        }
    }
}

/// What the light of all drones leaves in the picture.
struct Picture {
    /// Of the lamps that write.
    readings: Vec<LampReading>,
    warnings: Vec<String>,
}

impl Picture {
    /// Range of the exposure along the brightest trail of the lamps whose names begin so, stops.
    fn evenness_stops(&self, prefix: &str) -> Option<f64> {
        let own = self.readings.iter().filter(|reading| reading.name.starts_with(prefix));
        let brightest = own.max_by(|a, b| a.median_stops.total_cmp(&b.median_stops));
        brightest.map(LampReading::evenness_stops)
    }
}

/// Cap height of a word's letters; `None` of a drawing.
fn cap_height_m(strokes: &Strokes) -> Option<f64> {
    let letter = strokes.font.as_ref().and(strokes.glyphs.first())?;
    Some(letter.cell.cap_height_m)
}

/// Light of the first lamp that follows the plan, in pieces along its path: start time, length and
/// seconds of full light.
fn painted(flight: &Flight, trace: &LightTrace, scene: &Scene) -> Vec<(f64, f64, f64)> {
    let writing = obstacles::writing(std::slice::from_ref(flight), trace, &scene.light);
    let name = writing.first().map(|lamp| &lamp.emitter.name);
    // A lamp that changes its color is several emitters.
    let emitters = writing.iter().filter(|lamp| Some(&lamp.emitter.name) == name);
    let mut pieces: Vec<(f64, f64, f64)> = emitters.flat_map(|lamp| pieces_of(lamp)).collect();
    pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
    pieces
}

/// The same of one emitter, whose highest level counts as full light: the dies of a color LED are
/// balanced by their levels.
fn pieces_of(lamp: &Lamp) -> Vec<(f64, f64, f64)> {
    let full = lamp.samples.iter().map(|sample| sample.level).fold(0.0, f64::max);
    let mut pieces: Vec<(f64, f64, f64)> = Vec::new();
    let mut from: Option<(f64, Vector3<f64>)> = None;
    let mut light_s = 0.0;
    for pair in lamp.samples.windows(2) {
        let lasts_s = pair[1].time_s - pair[0].time_s;
        let lit = 0.5 * (pair[0].level + pair[1].level) / full.max(f64::MIN_POSITIVE);
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
fn check_coverage(plan: &Plan, scene: &Scene) -> Result<Finding> {
    if scene.sensors.lighthouse.stations.is_empty() {
        return Ok(Finding::unchecked(Check::Coverage, "the scene has no base stations"));
    }
    let in_the_air = plan.setpoints.iter().filter(|setpoint| !setpoint.on_floor());
    let places = in_the_air.map(|setpoint| setpoint.position_m);
    let bounds_m = bounds(places.map(|p| [p.x, p.z]));
    if bounds_m[0] >= bounds_m[2] || bounds_m[1] >= bounds_m[3] {
        return Ok(Finding::unchecked(Check::Coverage, "the flight has no width or no height"));
    }
    let frac = coverage(&scene.sensors, bounds_m, 0.0, COVERAGE_STEP_M)?.seen_frac();
    Ok(Finding::new(Check::Coverage, frac >= 1.0, Severity::Stop, frac, 1.0))
}
