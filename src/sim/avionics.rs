//! Avionics, which are a drone's sensors, estimator and controller, updated at every tick.

use nalgebra::Vector3;

use super::controller::{Command, Controller, Reference, controller};
use super::estimator::{AltitudeFilter, Estimator, Outside, Update, estimator};
use super::options::{ControllerKind, Drone, EstimatorKind, SetpointKind, Setpoints};
use super::radio::Link;
use super::recorder::Recorder;
use crate::sensors::{Fleet, Message, Readings, Sensors};
use crate::vehicle::{Plant, RigidBody, State, YAW, attitude, position, rate, velocity};
use noctograph_core::crazyflie::{LEVEL_OUT_S, MOTORS_STOP_S};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::FlightSample;
use noctograph_core::flight::table::on_grid;
use noctograph_core::flight::warning::{self, BATTERY};
use noctograph_core::geometry::turned;
use noctograph_core::plan::Plan;

/// Tolerance in s for the time of a setpoint, needed because times in plans are rounded to the
/// nearest microsecond.
pub(super) const TIME_TOLERANCE_S: f64 = 0.5e-6;
/// Magnitude of any state (m, rad, m/s, rad/s) beyond which the drone counts as lost. In a normal
/// flight, the states stay within a few meters and a few rad/s.
pub(super) const LOST: f64 = 1e4;

/// Onboard system of one drone, which contains everything that a tick changes except the motion.
#[derive(Debug)]
pub struct Avionics {
    controller: Box<dyn Controller>,
    estimator: Box<dyn Estimator>,
    sensors: Sensors,
    motor_max: f64,
    tick_s: f64,
    kinds: Kinds,
    /// Heading in rad that the drone holds, from world x toward y.
    yaw_rad: f64,
    estimate: State,
    /// True if `estimate` is up to date at the present tick.
    fresh: bool,
    /// Motor commands, held between two runs of the controller.
    command: Command,
    ticks: u32,
    ticks_per_command: u32,
    /// Indices of the setpoint that is due and of the last one received.
    setpoint: usize,
    heard: usize,
    link: Option<Link>,
    /// True if setpoints are received over the link.
    streamed: bool,
    /// Time in s at which the motors stopped permanently because no setpoint arrived.
    stopped_s: Option<f64>,
    /// Index of the first setpoint of the firmware's landing, if other setpoints precede it.
    lands_from: Option<usize>,
    mode: Mode,
    /// Number of steps of the plant so far in which the battery limited the thrust.
    short_steps: u32,
    /// Numbers of ticks with a motor at its limit, in total and while a letter was written.
    saturated_ticks: u32,
    saturated_writing_ticks: u32,
    /// True if the filter's covariance is logged, which is always the case for a fleet filter.
    logs_covariance: bool,
}

/// Kinds of the controller and the estimator. The estimator is `None` if it is outside the program.
#[derive(Clone, Copy, Debug)]
struct Kinds {
    controller: ControllerKind,
    estimator: Option<EstimatorKind>,
}

/// Kinds of setpoints that the firmware distinguishes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// Setpoints that the host sends.
    Sent,
    /// Setpoints that the firmware generates when the host stops sending.
    Level,
    /// Setpoints of the firmware's landing, if they follow setpoints of another kind.
    Landing,
}

/// Intervals in s at which an exported script repeats a full state (`RESEND_S`, `cflib.py`), and at
/// which the onboard commander evaluates its trajectory (`RATE_HL_COMMANDER`).
const RESEND_S: f64 = 0.1;
const COMMANDER_S: f64 = 0.01;

/// Time in s after the last letter at which an exported script tells the firmware to land. By then,
/// the lamps are dark.
const LANDS_AFTER_S: f64 = 0.5;

impl Avionics {
    /// Creates the onboard system of a drone at rest at its starting position in the fleet. Returns
    /// an error if the options give no gain for the controller or the estimator.
    pub(super) fn new(drone: &Drone<'_>, fleet: &Fleet, plan: &Plan) -> Result<Self> {
        let yaw_rad = plan.yaw_rad;
        let Drone { believed, actual, seed, room_seed, .. } = *drone;
        let rate_hz = actual.rates.control_hz;
        let seeds = [seed, room_seed];
        // The sensors are those of the actual drone. The estimator and the controller are designed
        // for the believed drone. The estimate starts with the sensors' constant error, as it would
        // after a wait on the floor.
        let sensors = Sensors::new(&actual.sensors, &actual.floor, rate_hz, seeds, fleet);
        let settled_m = sensors.settled_m(fleet.members[fleet.place].start_m);
        Ok(Self {
            controller: controller(believed)?,
            estimator: estimator(believed, settled_m, yaw_rad, fleet, seed)?,
            yaw_rad,
            sensors,
            motor_max: believed.vehicle.motor_max,
            tick_s: 1.0 / f64::from(rate_hz),
            kinds: Kinds {
                controller: believed.controller.kind,
                estimator: Some(believed.observer.kind),
            },
            estimate: State::zeros(),
            fresh: false,
            command: Command::default(),
            ticks: 0,
            ticks_per_command: rate_hz / actual.rates.attitude_hz(),
            setpoint: 0,
            heard: 0,
            link: Link::new(&actual.radio, seed, drone.index),
            streamed: actual.radio.setpoints == Setpoints::Streamed,
            stopped_s: None,
            lands_from: match believed.controller.setpoints {
                SetpointKind::FullState => landing_setpoint(plan),
                SetpointKind::Position => None,
            },
            mode: Mode::Sent,
            short_steps: 0,
            saturated_ticks: 0,
            saturated_writing_ticks: 0,
            logs_covariance: believed.observer.kind == EstimatorKind::Cooperative,
        })
    }

    /// Enables logging of the estimated position's standard deviation and normalized squared error
    /// (`estimate_sigma_m`, `estimate_nees`), if the filter has a covariance.
    pub fn log_covariance(&mut self) {
        self.logs_covariance = true;
    }

    /// Replaces the estimator with an external one, which `make` creates from the state at rest.
    pub fn estimate_by(&mut self, make: impl FnOnce([f64; 12]) -> Update) {
        let state = self.estimator.state();
        self.estimator = Box::new(Outside { update: make(state.into()), state });
        self.kinds.estimator = None;
    }

    /// Begins a tick by measuring and updating the estimate. `fleet_m` contains the fleet's true
    /// positions, for ranges between drones. While the motors are off, the controller and the
    /// filter over the fleet are reset. Returns true if [`Self::control`] must be called, which is
    /// never the case while the motors are off, and otherwise at each period of the controller.
    pub(super) fn sense(
        &mut self,
        plan: &Plan,
        time_s: f64,
        plant: &Plant,
        fleet_m: &[Vector3<f64>],
    ) -> bool {
        let is_battery_limited = plant.short_steps() > self.short_steps;
        self.short_steps = plant.short_steps();
        self.saturated_ticks += u32::from(self.command.saturated || is_battery_limited);
        self.advance_setpoint(plan, time_s);

        // The sensors and the estimator run at every tick, even while the motors are off.
        let body = plant.body();
        let throttle = self.command.motors.mean() / self.motor_max;
        let readings = self.sensors.read(&body, plant.specific_force_m_s2(), fleet_m);
        self.estimator.update(&Readings { throttle, ..readings }, self.tick_s);
        self.fresh = false;

        // A setpoint at or below the floor switches the motors off. If no setpoint arrives for too
        // long, the motors stop permanently.
        let target_m = &plan.setpoints[self.followed_setpoint()].position_m;
        let is_grounded = target_m.z <= plant.floor_m(target_m.x, target_m.y);
        if !is_grounded && self.silent_s(time_s) > MOTORS_STOP_S {
            self.stopped_s.get_or_insert(time_s);
        }
        if is_grounded || self.stopped_s.is_some() {
            if let Some(filter) = self.estimator.fleet_filter() {
                filter.rest();
            }
            self.refresh_estimate();
            self.controller.rest(&turned_ahead(&self.estimate, self.yaw_rad));
            self.command = Command::default();
            return false;
        }
        let due = self.ticks.is_multiple_of(self.ticks_per_command);
        if due {
            self.refresh_estimate();
        }
        due
    }

    /// Advances to the setpoint that is due, and to the last one received by radio.
    fn advance_setpoint(&mut self, plan: &Plan, time_s: f64) {
        let later = plan.setpoints.iter().skip(self.setpoint + 1);
        self.setpoint += later.take_while(|s| s.time_s <= time_s + TIME_TOLERANCE_S).count();
        self.heard = match &mut self.link {
            None => self.setpoint,
            Some(link) => link.hear(time_s, self.setpoint),
        };
    }

    /// Computes the motor commands, which are held until the next call, with the drone's
    /// controller. The drone levels out if no setpoint arrives for [`LEVEL_OUT_S`]. The controller
    /// is informed when the kind of setpoint changes.
    pub(super) fn control(&mut self, plan: &Plan, time_s: f64) {
        let row = self.followed_setpoint();
        let setpoint = &plan.setpoints[row];
        let reference_s = self.reference_time_s(plan, time_s);
        let mut motion = Reference::from_setpoint(setpoint, plan.sent_m(row), reference_s);
        motion.jerk_m_s3 = plan.jerk_m_s3(row);
        // Controllers are designed for a drone whose nose points along world x.
        let mut reference = motion.turned(-self.yaw_rad);
        let mut estimate = turned_ahead(&self.estimate, self.yaw_rad);
        // If the kind of setpoint changes, the controller is informed before the first new
        // setpoint.
        let mode = if self.silent_s(time_s) > LEVEL_OUT_S {
            Mode::Level
        } else if self.lands_from.is_some_and(|first| row >= first) {
            Mode::Landing
        } else {
            Mode::Sent
        };
        if std::mem::replace(&mut self.mode, mode) != mode {
            self.controller.change_mode(&estimate);
        }
        if mode == Mode::Level {
            self.controller.level_out(&mut estimate, &mut reference);
        }
        if let Some(filter) = self.estimator.altitude() {
            self.controller.set_thrust_map(filter.thrust_map());
        }
        self.command = self.controller.command(&estimate, &reference);
    }

    /// Commands the motors m1…m4, clamped to the range of the drone's motor commands. A command of
    /// NaN stops a motor.
    pub(super) fn command(&mut self, wanted: [f64; 4]) {
        let motors = wanted.map(|motor| motor.max(0.0).min(self.motor_max));
        self.command = Command { motors: motors.into(), saturated: motors != wanted };
    }

    /// Returns the index of the setpoint that the drone follows, which is the last one received if
    /// setpoints are streamed, or otherwise the one that is due.
    fn followed_setpoint(&self) -> usize {
        if self.streamed { self.heard } else { self.setpoint }
    }

    /// Returns the time at which the reference is evaluated on the setpoint's motion.
    fn reference_time_s(&self, plan: &Plan, time_s: f64) -> f64 {
        let holds = self.kinds.controller == ControllerKind::Geometric;
        let from_s = plan.setpoints[self.followed_setpoint()].time_s;
        // A late setpoint's motion begins when it is received, and ends when the next one is due.
        let now_s = match self.link.as_ref().filter(|_| self.streamed) {
            None => time_s,
            Some(link) => {
                // A held reference stays where it was when the last setpoint was received.
                let moved_until_s = if holds { time_s - link.silent_s(time_s) } else { time_s };
                let next = plan.setpoints.get(self.followed_setpoint() + 1);
                let until_s = next.map_or(from_s, |next| next.time_s);
                (from_s + (moved_until_s - link.since_s())).min(until_s).max(from_s)
            }
        };
        if !holds {
            return now_s;
        }
        // The firmware's geometric controller holds the last state that it received, either from
        // the script, which updates and repeats a long setpoint, or from the onboard commander.
        let step_s = if self.streamed { RESEND_S } else { COMMANDER_S };
        from_s + ((now_s - from_s + TIME_TOLERANCE_S) / step_s).floor() * step_s
    }

    /// Returns the time in s since the last setpoint was received, or 0 for an onboard trajectory.
    fn silent_s(&self, time_s: f64) -> f64 {
        let streamed = self.link.as_ref().filter(|_| self.streamed);
        streamed.map_or(0.0, |link| link.silent_s(time_s))
    }

    /// Ends a tick by counting it. Returns [`Error::Infeasible`] if the drone has flown away or
    /// flipped over, with the battery as the cause if it is empty.
    pub(super) fn conclude(&mut self, plan: &Plan, time_s: f64, plant: &Plant) -> Result<()> {
        self.ticks += 1;
        let is_writing = plan.setpoints[self.setpoint].letter.is_some();
        self.saturated_writing_ticks += u32::from(self.command.saturated && is_writing);
        let Some(fault) = loss(&plant.body(), &self.estimate) else { return Ok(()) };
        let [_, empty_code] = BATTERY;
        if plant.warnings().iter().any(|warning| warning.code == empty_code) {
            let duration_s = plan.duration_s();
            let what = format!(
                "the battery is empty, and the drone {fault} after {time_s:.0} of {duration_s:.0} s"
            );
            return Err(Error::infeasible(what, EMPTY_HELP).coded(empty_code));
        }
        let keys = tuning_keys(self.kinds);
        Err(Error::infeasible(
            format!("the drone {fault} after {time_s:.3} s"),
            format!("check that {keys} match the vehicle, and that the plan has no large jumps"),
        ))
    }

    /// Returns the estimated state as of the last refresh.
    pub(super) fn estimate(&self) -> &State {
        &self.estimate
    }

    /// Returns the planned motion at this instant, without the offset of sent positions.
    pub(super) fn design(&self, plan: &Plan, time_s: f64) -> Reference {
        let setpoint = &plan.setpoints[self.setpoint];
        Reference::from_setpoint(setpoint, setpoint.position_m, time_s)
    }

    /// Returns the drone's next message to the fleet, or `None` if its estimator sends none.
    pub(super) fn message(&mut self) -> Option<Message> {
        self.estimator.fleet_filter()?.message()
    }

    /// Passes a message from the fleet to the estimator. Estimators without a fleet filter ignore
    /// it.
    pub(super) fn receive(&mut self, message: &Message) {
        if let Some(filter) = self.estimator.fleet_filter() {
            filter.receive(message);
            self.fresh = false;
        }
    }

    /// Returns the commands of the motors m1…m4.
    pub fn motors(&self) -> [f64; 4] {
        self.command.motors.into()
    }

    /// Returns the altitude filter, if the estimator has one.
    pub fn altitude(&self) -> Option<&AltitudeFilter> {
        self.estimator.altitude()
    }

    /// Returns the sensors.
    pub fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// Logs this tick. Values are rounded to 1e-6, so that a file with six decimals contains
    /// exactly the same flight.
    pub(super) fn log(&mut self, recorder: &mut Recorder, plan: &Plan, time_s: f64, plant: &Plant) {
        self.refresh_estimate();
        let (setpoint, body) = (&plan.setpoints[self.setpoint], plant.body());
        let (state, estimate_m) = (body.state().map(on_grid), position(&self.estimate));
        let sample = FlightSample {
            time_s: on_grid(time_s),
            position_m: position(&state),
            attitude: attitude(&state),
            velocity_body_m_s: velocity(&state),
            rate_body_rad_s: rate(&state),
            estimate_m: estimate_m.map(on_grid),
            design_m: setpoint.design_m(time_s).map(on_grid),
            motors: self.motors().map(on_grid),
            letter: setpoint.letter,
        };
        // The normalized squared error, eᵀ P⁻¹ e / 3, is 1 on average if the filter is consistent.
        // A singular covariance gives 0.
        let covariance_m2 = self.estimator.covariance_m2().filter(|_| self.logs_covariance);
        let error_m = estimate_m - body.position_m;
        let nees = covariance_m2.map(|covariance_m2| {
            error_m.dot(&(covariance_m2.try_inverse().unwrap_or_default() * error_m)) / 3.0
        });
        let (volts, joules) = plant.battery().unzip();
        let saturated_s = f64::from(self.saturated_ticks) * self.tick_s;
        let sigma_m = covariance_m2.map(|covariance_m2| covariance_m2.trace().sqrt());
        // Light commands are received by radio, even with an onboard trajectory.
        let lights = plan.lights.values().map(|levels| levels[self.heard]);
        recorder.record(sample, lights, [Some(saturated_s), volts, joules, sigma_m, nees]);
    }

    /// Updates the estimated state unless it is up to date. This is done only when the state is
    /// used, because computing its angles takes as long as a step of the physics.
    fn refresh_estimate(&mut self) {
        if !self.fresh {
            self.estimate = self.estimator.state();
            self.fresh = true;
        }
    }

    /// Returns the warnings about saturated motors, missing setpoints, the plant and the sensors.
    /// Motors count as saturated only while a letter is written.
    pub(super) fn warnings(&self, plant: &Plant) -> Vec<Diagnostic> {
        let saturated_s = f64::from(self.saturated_writing_ticks) * self.tick_s;
        let saturated = (saturated_s > 0.0).then(|| warning::motor_at_limit(saturated_s));
        let silent = self.stopped_s.map(warning::host_silent);
        saturated
            .into_iter()
            .chain(silent)
            .chain(plant.warnings())
            .chain(self.sensors.warning())
            .collect()
    }
}

/// Returns the index of the first setpoint after an exported script tells the firmware to land, or
/// `None` if no letter is written or no setpoint follows the last letter. If the plan ends before
/// that time, the index is the number of setpoints.
fn landing_setpoint(plan: &Plan) -> Option<usize> {
    let last_written = plan.setpoints.iter().rposition(|setpoint| setpoint.letter.is_some())?;
    let written_s = plan.setpoints.get(last_written + 1)?.time_s;
    let lands_s = written_s + LANDS_AFTER_S - TIME_TOLERANCE_S;
    Some(plan.setpoints.partition_point(|setpoint| setpoint.time_s < lands_s))
}

/// Returns the state rotated about the vertical by `-yaw_rad`. The held heading is then along world
/// x, for which controllers are designed.
pub(super) fn turned_ahead(state: &State, yaw_rad: f64) -> State {
    if yaw_rad == 0.0 {
        return *state;
    }
    // Only position and yaw change, because velocity and rate are in the body frame.
    let mut ahead = *state;
    ahead.fixed_rows_mut::<3>(0).copy_from(&turned(&state.fixed_rows::<3>(0).into(), -yaw_rad));
    let (sin, cos) = libm::sincos(state[YAW] - yaw_rad);
    ahead[YAW] = libm::atan2(sin, cos);
    ahead
}

/// Returns the scene keys of the controller's and the estimator's gains and weights, for messages.
fn tuning_keys(Kinds { controller, estimator }: Kinds) -> String {
    use EstimatorKind::{Altitude, Cooperative, Ekf, EkfImproved, Luenberger, Truth};
    let estimator_keys = match estimator {
        None => ", and your estimator's units and signs,",
        Some(Luenberger) => " and observer.luenberger",
        Some(Ekf | EkfImproved | Cooperative) => " and observer.ekf",
        Some(Altitude) => " and observer.altitude",
        Some(Truth) => "",
    };
    format!("{}{estimator_keys}", controller.keys())
}

/// Hint for a drone that is lost because its battery is empty.
const EMPTY_HELP: &str = "shorten the flight: a shorter word, larger plan.style.stroke_speed_m_s, \
                          shorter plan.style.hover_s, or a larger battery.capacity_ah";

/// Returns what a lost drone does, according to its true or estimated state, or `None` if it is not
/// lost.
fn loss(body: &RigidBody, estimate: &State) -> Option<&'static str> {
    // The check has no branches that may be mispredicted. NaN counts as out of bounds.
    fn are_bounded(values: &[f64]) -> bool {
        values.iter().fold(true, |are_bounded, x| are_bounded & (x.abs() < LOST))
    }
    let RigidBody { position_m, velocity_m_s, rate_rad_s, .. } = body;
    let is_near = are_bounded(position_m.as_slice())
        & are_bounded(velocity_m_s.as_slice())
        & are_bounded(rate_rad_s.as_slice())
        & are_bounded(estimate.as_slice());
    if !is_near {
        Some("flies away")
    } else if body.is_on_its_back() {
        Some("turns over")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn a_lost_drone_and_a_lost_observer_are_both_found() {
        let (body, estimate) = (RigidBody::resting_at(Vector3::z()), State::zeros());
        assert_eq!(loss(&body, &estimate), None, "at the start");
        let away = RigidBody { position_m: Vector3::new(f64::NAN, 0.0, 0.0), ..body };
        assert_eq!(loss(&away, &estimate), Some("flies away"));
        let mut astray = estimate;
        astray[6] = -1e5;
        assert_eq!(loss(&body, &astray), Some("flies away"));
        for (axis, angle_rad, want) in [
            (Vector3::x_axis(), -2.0, Some("turns over")),
            (Vector3::x_axis(), 1.57, None),
            (Vector3::x_axis(), 1.58, Some("turns over")),
            (Vector3::y_axis(), -1.57, None),
            (Vector3::y_axis(), 1.58, Some("turns over")),
            (Vector3::z_axis(), 3.0, None),
        ] {
            let world_from_body = UnitQuaternion::from_axis_angle(&axis, angle_rad);
            assert_eq!(
                loss(&RigidBody { world_from_body, ..body }, &estimate),
                want,
                "{angle_rad}"
            );
        }
    }
}
