//! Flight of a plan, tick by tick.

use nalgebra::Vector3;

use super::avionics::{Avionics, LOST, TIME_TOLERANCE_S};
use super::options::Drone;
use super::recorder::Recorder;
use crate::sensors::{Air, Fleet, Member};
use crate::vehicle::{Downwash, FloorOptions, Jet, Plant};
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::table::{FLIGHT_LONG, MAX_DURATION_S};
use noctograph_core::flight::{DroneIndex, Flight};
use noctograph_core::input_error;
use noctograph_core::plan::Plan;

/// Number of ticks between two reports of progress.
const TICKS_PER_REPORT: u32 = 250;

/// Flies a plan with one drone.
///
/// The flight lasts from 0 to the time of the last setpoint. The same plan and drone give the same
/// bytes on every machine. `progress` is called with the completed fraction, 0 to 1.
///
/// # Errors
///
/// Returns the errors of [`SimOptions::check`](crate::SimOptions::check). Returns [`Error::Input`]
/// for a plan without setpoints or with values that no drone can reach. Returns
/// [`Error::Infeasible`] for a plan longer than an hour, for weights that give no gain, and for a
/// drone that flips over or flies away.
///
/// # Panics
///
/// Panics if a column of `plan.lights` is not as long as `plan.setpoints`, or if the believed and
/// the actual drone have different rates.
pub fn fly(plan: &Plan, drone: &Drone<'_>, progress: &mut dyn FnMut(f64)) -> Result<Flight> {
    Ok(fly_fleet(&[(plan, *drone)], progress)?.remove(0))
}

/// Flies several plans in lockstep. Drones are affected by the downwash of those above
/// (`air.downwash`). If their sensors and estimators are set accordingly, they measure the
/// distances between them and exchange their measurements. A drone that has landed continues to
/// measure until all have landed.
///
/// # Errors
///
/// Returns the errors of [`fly`], with the drone's number. Returns [`Error::Input`] for a drone
/// without a list of received anchors.
///
/// # Panics
///
/// Panics in the cases of [`fly`], and if the drones have different clocks or seeds.
pub fn fly_fleet(
    fleet: &[(&Plan, Drone<'_>)],
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Flight>> {
    fly_watched(fleet, &mut |_, _, _| {}, progress)
}

/// Flies several plans as [`fly_fleet`] does, and calls `watch` for every drone with the tick's
/// number after the commands of each tick. `progress` receives the completed fraction.
pub fn fly_watched(
    fleet: &[(&Plan, Drone<'_>)],
    watch: &mut dyn FnMut(u32, &Plant, &Avionics),
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Flight>> {
    let Some((_, first)) = fleet.first() else { return Ok(Vec::new()) };
    let mut rigs = rigs(fleet)?;
    let indices: Vec<u64> = fleet.iter().map(|(_, drone)| drone.index).collect();
    let mut air = Air::new(&first.actual.sensors.peers, first.seed, &indices);
    let n_ticks = rigs.iter().map(|rig| rig.n_ticks).max().unwrap_or(0);
    let is_fleet = rigs.len() > 1;
    let has_downwash = is_fleet && first.actual.air.downwash == Downwash::Jet;
    for tick in 0..=n_ticks {
        let time_s = f64::from(tick) / f64::from(first.actual.rates.control_hz);
        // Positions, downwash and messages at one instant are collected before any drone moves, so
        // that the order of the drones has no effect.
        let in_fleet = rigs.iter().filter(|_| is_fleet);
        let fleet_m: Vec<_> = in_fleet.map(|rig| rig.plant.body().position_m).collect();
        let jets = rigs.iter().filter(|_| has_downwash).map(|rig| rig.plant.jet());
        let jets: Vec<Jet> = jets.collect();
        while let Some((to, message)) = air.arrived(time_s) {
            rigs[to].avionics.receive(&message);
        }
        for (place, rig) in rigs.iter_mut().enumerate() {
            if has_downwash {
                rig.plant.enter(jets[..place].iter().chain(&jets[place + 1..]));
            }
            let plan = fleet[place].0;
            if rig.avionics.sense(plan, time_s, &rig.plant, &fleet_m) {
                rig.avionics.control(plan, time_s);
            }
            let concluded = rig.conclude(plan, tick, time_s, watch);
            concluded.map_err(
                |error| if is_fleet { error.of_drone(DroneIndex(place)) } else { error },
            )?;
        }
        // Messages contain the measurements up to this tick, and arrive in a later tick.
        if is_fleet && air.is_due(time_s) {
            let messages = rigs.iter_mut().filter_map(|rig| rig.avionics.message());
            messages.for_each(|message| air.send(&message));
        }
        if tick.is_multiple_of(TICKS_PER_REPORT) {
            progress(f64::from(tick) / f64::from(n_ticks.max(1)));
        }
    }
    progress(1.0);
    Ok(rigs.into_iter().map(Rig::finish).collect())
}

/// Checks options and plans, and creates the drones of a fleet at rest at their starts. Returns the
/// errors of [`fly_fleet`]. Panics if the fleet is empty, or if its drones differ in rates or seed.
pub(super) fn rigs(fleet: &[(&Plan, Drone<'_>)]) -> Result<Vec<Rig>> {
    // All drones have the same clock and seed.
    let first = &fleet[0].1;
    let mut members = Vec::new();
    for (plan, drone) in fleet {
        let Drone { believed, actual, seed, index, .. } = *drone;
        assert_eq!(believed.rates, actual.rates, "one clock");
        assert!(actual.rates == first.actual.rates && seed == first.seed, "one clock, one seed");
        believed.check()?;
        actual.check()?;
        actual.sensors.uwb.heard_by(index)?;
        check_plan(plan, &actual.floor)?;
        members.push(Member::new(&actual.sensors, seed, index, start_m(plan, &actual.floor)));
    }
    let rigs = fleet.iter().enumerate().map(|(place, (plan, drone))| {
        Rig::new(plan, drone, &Fleet { members: members.clone(), place })
    });
    rigs.collect()
}

#[derive(Debug)]
pub(super) struct Rig {
    pub(super) plant: Plant,
    pub(super) avionics: Avionics,
    recorder: Recorder,
    pub(super) n_ticks: u32,
    /// Time between two ticks in s.
    pub(super) tick_s: f64,
    ticks_per_sample: u32,
    steps_per_tick: u32,
}

impl Rig {
    /// Creates a drone at rest at the start of its plan. Returns an error for a plan that is too
    /// long or for options without a gain.
    fn new(plan: &Plan, drone: &Drone<'_>, fleet: &Fleet) -> Result<Self> {
        let rates = &drone.actual.rates;
        let n_ticks = n_ticks(plan, rates.control_hz)?;
        let ticks_per_sample = rates.control_hz / rates.log_hz;
        let dt_s = 1.0 / f64::from(rates.control_hz * rates.steps_per_tick);
        let start_m = start_m(plan, &drone.actual.floor);
        let plant = Plant::new(drone.actual.plant(), dt_s, drone.seed, drone.index, start_m);
        Ok(Self {
            plant: plant.facing(plan.yaw_rad),
            avionics: Avionics::new(drone, fleet, plan)?,
            recorder: Recorder::new(plan, (n_ticks / ticks_per_sample + 1) as usize),
            n_ticks,
            tick_s: 1.0 / f64::from(rates.control_hz),
            ticks_per_sample,
            steps_per_tick: rates.steps_per_tick,
        })
    }

    /// Ends a tick. Checks that the drone is not lost, calls `watch`, and logs and moves the drone.
    pub(super) fn conclude(
        &mut self,
        plan: &Plan,
        tick: u32,
        time_s: f64,
        watch: &mut dyn FnMut(u32, &Plant, &Avionics),
    ) -> Result<()> {
        self.avionics.conclude(plan, time_s, &self.plant)?;
        watch(tick, &self.plant, &self.avionics);
        if tick.is_multiple_of(self.ticks_per_sample) && tick <= self.n_ticks {
            self.avionics.log(&mut self.recorder, plan, time_s, &self.plant);
        }
        let motors = self.avionics.motors();
        noctograph_core::dispatch!(|| for _ in 0..self.steps_per_tick {
            self.plant.advance(&motors);
        });
        Ok(())
    }

    /// Returns the recorded flight with its warnings.
    pub(super) fn finish(self) -> Flight {
        self.recorder.finish(self.avionics.warnings(&self.plant))
    }
}

/// Returns the true starting position, that of the first setpoint, but not below the floor.
fn start_m(plan: &Plan, floor: &FloorOptions) -> Vector3<f64> {
    let first_m = plan.setpoints[0].position_m;
    Vector3::new(first_m.x, first_m.y, first_m.z.max(floor.height_m(first_m.x, first_m.y)))
}

/// Checks that the plan has setpoints, that their values are within ±[`LOST`], and that they clear
/// the floor. Returns [`Error::Input`] with the number of the setpoint, counted from 0.
pub(super) fn check_plan(plan: &Plan, floor: &FloorOptions) -> Result<()> {
    let hint = "plan the word again, or correct the file that the plan was read from";
    if plan.setpoints.is_empty() {
        return Err(Error::input("plan", "no setpoint", "at least one setpoint", hint));
    }
    for (i, s) in plan.setpoints.iter().enumerate() {
        let sent_m = plan.sent_m(i);
        let derivatives = s.velocity_m_s.iter().chain(&s.acceleration_m_s2);
        let mut values = s.position_m.iter().chain(derivatives).chain(&sent_m);
        if let Some(value) = values.find(|value| value.abs() >= LOST) {
            let wanted = format!("a number within ±{LOST}");
            return Err(Error::input(format!("plan, setpoint {i}"), value, wanted, hint));
        }
    }
    check_clearance(plan, floor)
}

/// Checks that the plan stays above the steps of the floor while the drone is in the air.
fn check_clearance(plan: &Plan, floor: &FloorOptions) -> Result<()> {
    // For each setpoint, `heights_m` contains its height and the height of the floor below it.
    let positions_m = plan.setpoints.iter().map(|s| s.position_m);
    let heights_m: Vec<[f64; 2]> = positions_m.map(|p| [p.z, floor.height_m(p.x, p.y)]).collect();
    // The drone is in the air from the first setpoint that is above the floor or belongs to a
    // letter, to the last such setpoint.
    let mut in_air = (0..heights_m.len()).filter(|row| {
        let [height_m, floor_m] = heights_m[*row];
        height_m > floor_m || plan.setpoints[*row].letter.is_some()
    });
    let first = in_air.clone().next().unwrap_or(0);
    let last = in_air.next_back().unwrap_or(heights_m.len() - 1);
    // Before and after that, a ramp's setpoints may be inside a step if the ramp rises above it.
    // The drone then rests on the step with its motors off, as it does at a height of 0 or less.
    let mut numbered = heights_m.iter().enumerate();
    let refused = numbered.find(|(row, [height_m, floor_m])| {
        let mut ramp_m = heights_m.iter().filter(|[_, other_m]| other_m == floor_m);
        *height_m > 0.0
            && height_m <= floor_m
            && ((first..=last).contains(row) || !ramp_m.any(|[other_m, _]| other_m > floor_m))
    });
    let Some((i, [height_m, floor_m])) = refused else { return Ok(()) };
    Err(input_error!(
        format!("plan, setpoint {i}"),
        "a height of {height_m} m",
        "more than the floor's {floor_m} m there",
        "raise the word (letters.baseline_m), or lower or move floor.steps"
    ))
}

/// Returns the number of control ticks up to the last setpoint, or [`Error::Infeasible`] if the
/// plan is longer than [`MAX_DURATION_S`].
fn n_ticks(plan: &Plan, rate_hz: u32) -> Result<u32> {
    let duration_s = plan.duration_s();
    if !(0.0..=MAX_DURATION_S).contains(&duration_s) {
        return Err(Error::infeasible(
            format!(
                "the plan lasts {duration_s} s, but a flight may last at most \
                     {MAX_DURATION_S} s"
            ),
            "write a shorter word, or raise plan.stroke_speed_m_s",
        )
        .coded(FLIGHT_LONG));
    }
    #[expect(clippy::cast_possible_truncation, reason = "0 to 7.2e6")]
    Ok(((duration_s + TIME_TOLERANCE_S) * f64::from(rate_hz)) as u32)
}

#[cfg(test)]
pub(super) mod tests;
