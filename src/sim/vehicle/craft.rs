//! All that moves a drone: rotors, battery, body, air and floor, put together. One drone, or one a
//! lane.

use super::battery::Battery;
use super::body::{Body, Inertia, Row};
use super::floor::Floor;
use super::gusts::Wind;
use super::model::GRAVITY_M_S2;
use super::rotors::{Load, Rotors};
use crate::sim::options::SimOptions;
use crate::sim::wide::{Each, Real};

/// Everything of a drone but where it is, or of as many drones as there are lanes.
#[derive(Debug)]
pub(in crate::sim) struct Craft<T> {
    rotors: Rotors<T>,
    battery: Option<Battery<T>>,
    inertia: Inertia<T>,
    floor: Floor<T>,
    dt_s: f64,
    thrust_per_command_n: T,
    full_thrust_n: T,
    /// The air about each drone, and whether in none of it anything changes.
    winds: Vec<Wind>,
    steady: bool,
    wind_m_s: [T; 3],
    /// Steps in which the battery could not give a motor the thrust asked for.
    short_steps: T,
}

impl<T: Real> Craft<T> {
    /// In the air (`z_m` above 0) the rotors carry the drone already; on the floor they stand still.
    /// The noise of each drone is that of its seed and of the index `drone`.
    pub(super) fn new(
        each: &Each<'_, SimOptions, T>,
        dt_s: f64,
        seeds: &[u64],
        drone: u64,
        z_m: f64,
    ) -> Self {
        let vehicle = each.part(|o| &o.vehicle);
        let carried = if z_m > 0.0 { 0.25 * GRAVITY_M_S2 } else { 0.0 };
        let options = seeds.iter().zip(each.all());
        let winds: Vec<Wind> =
            options.map(|(seed, o)| Wind::new(&o.air, dt_s, *seed, drone)).collect();
        Self {
            rotors: Rotors::new(&vehicle, |o| carried * o.mass_kg, dt_s),
            battery: Battery::new(&each.part(|o| &o.battery)),
            inertia: Inertia::new(&vehicle),
            floor: Floor::new(&vehicle),
            dt_s,
            thrust_per_command_n: vehicle.figure(|o| o.k_f_n),
            full_thrust_n: vehicle.figure(|o| o.full_thrust_n()),
            steady: winds.iter().all(Wind::is_steady),
            winds,
            wind_m_s: each.figures(|o| o.air.wind_m_s),
            short_steps: vehicle.figure(|_| 0.0),
        }
    }

    /// Whether the drones of two sets of options can be flown together: they differ in figures, not
    /// in what is reckoned with.
    pub(in crate::sim) fn together(one: &SimOptions, other: &SimOptions) -> bool {
        one.rates == other.rates
            && one.vehicle.ground_effect == other.vehicle.ground_effect
            && one.battery.has_charge() == other.battery.has_charge()
            && one.battery.compensation == other.battery.compensation
    }

    /// One step under motor commands m1…m4, each from 0 to the largest.
    #[inline(always)]
    pub(super) fn advance(&mut self, row: &Row<T>, commands: &[T; 4]) -> Row<T> {
        let wanted_n = self.thrusts_n(commands);
        // What changes slowly is held through the step: the ground effect at its middle height.
        let ground = self.floor.thrust_ratio(row[2] + row[5] * (0.5 * self.dt_s));
        let mut loads = self.rotors.advance(&wanted_n, ground);
        if !self.steady {
            let torque_n_m = self.gust();
            for load in &mut loads {
                for (sum, torque_n_m) in load.torque_n_m.iter_mut().zip(torque_n_m) {
                    *sum = *sum + torque_n_m;
                }
            }
        }
        if let Some(battery) = &mut self.battery {
            battery.drain(self.rotors.thrust_n(), self.dt_s);
        }
        let mut next = self.inertia.step(row, &loads, &self.wind_m_s, self.dt_s);
        if row[2].any(|z_m| z_m <= 0.0) | next[2].any(|z_m| z_m < 0.0) {
            self.touch(row, &mut next, &loads[2]);
        }
        next
    }

    /// What an accelerometer at the body origin reads, body frame: all forces but gravity, per mass.
    #[inline(always)]
    pub(super) fn specific_force_m_s2(&self, row: &Row<T>) -> [T; 3] {
        let load = self.rotors.load(self.floor.thrust_ratio(row[2]));
        let mut force_m_s2 = self.inertia.specific_force_m_s2(row, &load, &self.wind_m_s);
        if row[2].any(|z_m| z_m <= 0.0) {
            for lane in (0..T::LANES).filter(|lane| self.rests(row, &load, *lane)) {
                for (axis, carried_m_s2) in [0.0, 0.0, GRAVITY_M_S2].into_iter().enumerate() {
                    force_m_s2[axis].set_lane(lane, carried_m_s2);
                }
            }
        }
        force_m_s2
    }

    /// Voltage of a drone's battery under load; `None` where it never sags.
    pub(super) fn battery_v(&self, lane: usize) -> Option<f64> {
        self.battery.as_ref().map(|battery| battery.voltage_v().lane(lane))
    }

    /// Energy that has left a drone's battery, J; `None` where it never sags.
    pub(super) fn energy_j(&self, lane: usize) -> Option<f64> {
        self.battery.as_ref().map(|battery| battery.energy_j().lane(lane))
    }

    /// Steps so far in which a drone's battery could not give a motor the thrust asked for.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    pub(super) fn short_steps(&self, lane: usize) -> u32 {
        self.short_steps.lane(lane) as u32
    }

    /// What whoever reads the flight should know of the battery.
    pub(super) fn warnings(&self, lane: usize) -> Vec<String> {
        let mut warnings = Vec::new();
        let short_steps = self.short_steps(lane);
        if short_steps > 0 {
            let short_s = f64::from(short_steps) * self.dt_s;
            warnings.push(format!(
                "the battery could not give the thrust asked for during {short_s:.2} s"
            ));
        }
        if self.battery.as_ref().is_some_and(|battery| battery.is_cut_off(lane)) {
            warnings.push("the battery was empty and the motors stopped".into());
        }
        warnings
    }

    /// Thrust that each motor is driven to.
    #[inline(always)]
    fn thrusts_n(&mut self, commands: &[T; 4]) -> [T; 4] {
        let mut thrusts_n = *commands;
        for thrust_n in &mut thrusts_n {
            *thrust_n = *thrust_n * self.thrust_per_command_n;
        }
        let Some(battery) = &self.battery else { return thrusts_n };
        let limit = battery.limit(self.full_thrust_n);
        let mut short = limit.max_n.all(0.0);
        for thrust_n in &mut thrusts_n {
            let wanted_n = limit.gain * *thrust_n;
            short = limit.max_n.pick(wanted_n, short.all(1.0), short);
            *thrust_n = wanted_n.at_most(limit.max_n);
        }
        self.short_steps = self.short_steps + short;
        thrusts_n
    }

    /// Moves the air of every drone on by one step: the torque of its gusts.
    fn gust(&mut self) -> [T; 3] {
        let mut torque_n_m = [self.wind_m_s[0].all(0.0); 3];
        for (lane, wind) in self.winds.iter_mut().enumerate() {
            let gust = wind.advance();
            for (axis, torque_n_m) in torque_n_m.iter_mut().enumerate() {
                torque_n_m.set_lane(lane, gust.torque_n_m[axis]);
                self.wind_m_s[axis].set_lane(lane, gust.wind_m_s[axis]);
            }
        }
        torque_n_m
    }

    /// Lets those drones rest on the floor that do not rise from it, and those that come down to it.
    #[inline(never)]
    fn touch(&self, row: &Row<T>, next: &mut Row<T>, load: &Load<T>) {
        for lane in 0..T::LANES {
            let from = if self.rests(row, load, lane) {
                row
            } else if next[2].lane(lane) < 0.0 {
                &*next
            } else {
                continue;
            };
            let lying = Body::from_row(&from.map(|part| part.lane(lane))).on_floor().row();
            for (part, value) in next.iter_mut().zip(lying) {
                part.set_lane(lane, value);
            }
        }
    }

    /// Whether a drone is on the floor, which its rotors do not lift it from.
    fn rests(&self, row: &Row<T>, load: &Load<T>, lane: usize) -> bool {
        let lifts = load.thrust_n.lane(lane) > self.inertia.weight_n().lane(lane);
        row[2].lane(lane) <= 0.0 && !lifts
    }
}
