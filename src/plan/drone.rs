//! Plans for a particular drone: its position loop is inverted, and its lamps are timed.

use super::feedforward::{feedforward, learn};
use super::lamp::LampTiming;
use super::light_timing::{Between, time_lights};
use super::stroke_ends::StrokeEnd;
use super::{LightClock, Plan, PlanOptions, ReferenceKind, fleet};
use crate::control::StepResponse;
use crate::error::Result;
use crate::flight::Flight;
use crate::letters::Strokes;

/// Properties of the drone that a plan depends on. The caller hands them in: planning has no
/// simulator of its own.
#[derive(Clone, Copy)]
pub struct DroneModel<'a> {
    /// Reference that its controller follows between two setpoints.
    pub between: Between,
    /// Delays from a light command to the light.
    pub lamp: LampTiming,
    /// Step responses of its position, along world x, y and z.
    pub step_responses: &'a dyn Fn() -> Result<[StepResponse; 3]>,
    /// Flies a plan in still air, with perfect sensors.
    pub rehearse: &'a dyn Fn(&Plan) -> Result<Flight>,
}

/// The plan of one drone.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// What is sent.
    pub plan: Plan,
    /// Light errors left at the ends of strokes, where light commands were timed on a flight.
    pub ends: Vec<StrokeEnd>,
}

/// Plans the flights that write a drawing, one a drone: [`fleet`], then the feedforward and the
/// light timing that the options ask for.
///
/// # Errors
///
/// As [`fleet`] and the functions of the model.
pub fn plan_for(
    strokes: &Strokes,
    options: &PlanOptions,
    drone: &DroneModel<'_>,
) -> Result<Vec<Planned>> {
    let plans = fleet(strokes, options)?;
    let inverse = options.reference == ReferenceKind::Inverse;
    let responses = if inverse { Some((drone.step_responses)()?) } else { None };
    let planned = plans.into_iter().map(|plan| {
        let plan = match (&responses, drone.between) {
            (None, _) => plan,
            (Some(responses), Between::Held) => feedforward(&plan, responses),
            (Some(responses), Between::Design) => {
                learn(&plan, &(drone.rehearse)(&plan)?, responses)
            }
        };
        match options.light_clock {
            LightClock::Setpoint => Ok(Planned { plan, ends: Vec::new() }),
            LightClock::Light => drone.time_lights(&plan, &(drone.rehearse)(&plan)?),
        }
    });
    planned.collect()
}

impl DroneModel<'_> {
    /// Times the light commands of a plan on a flight of it, rehearsed or real.
    ///
    /// # Errors
    ///
    /// As [`time_lights`].
    pub fn time_lights(&self, plan: &Plan, flight: &Flight) -> Result<Planned> {
        let (plan, ends) = time_lights(plan, flight, &self.lamp, self.between)?;
        Ok(Planned { plan, ends })
    }
}

impl std::fmt::Debug for DroneModel<'_> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("DroneModel").field("between", &self.between).finish_non_exhaustive()
    }
}
