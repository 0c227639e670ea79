//! Flights of one plan at the same time: their physics share the processor's wide registers.

use pulp::{Simd, WithSimd};

use super::options::SimOptions;
use super::recorder::Recorder;
use super::rig::{Rig, start_m};
use super::vehicle::{Craft, Plants};
use super::wide::{Real, Wide};
use super::{TICKS_PER_REPORT, check, fly_unlike};
use crate::error::Result;
use crate::flight::Flight;
use crate::plan::Plan;

/// What one drone carries, and its log.
#[derive(Debug)]
struct Aloft<'a> {
    rig: Rig,
    recorder: Recorder<'a>,
}

/// Flies as many drones as `T` has lanes, or fewer, with options and a seed each, through so many
/// ticks. One that is lost is an error in its place.
pub(super) fn fly_lanes<T: Real>(
    leave: T::Leave,
    plan: &Plan,
    believed: &SimOptions,
    drones: &[(&SimOptions, u64)],
    n_ticks: u32,
    progress: &mut dyn FnMut(f64),
) -> Vec<Result<Flight>> {
    let rates = &believed.rates;
    let ticks_per_sample = rates.control_hz / rates.log_hz;
    let dt_s = 1.0 / f64::from(rates.control_hz * rates.steps_per_tick);
    let mut plants = Plants::<T>::new(leave, drones, dt_s, start_m(plan));
    let take_off = |(actual, seed): &(&SimOptions, u64)| {
        let recorder = Recorder::new(plan, (n_ticks / ticks_per_sample + 1) as usize);
        Ok(Aloft { rig: Rig::new(plan, believed, actual, *seed)?, recorder })
    };
    let mut fleet: Vec<Result<Aloft<'_>>> = drones.iter().map(take_off).collect();
    for tick in 0..=n_ticks {
        let time_s = f64::from(tick) / f64::from(rates.control_hz);
        for (lane, drone) in fleet.iter_mut().enumerate() {
            let Ok(Aloft { rig, recorder }) = drone else { continue };
            let reality = plants.reality(lane);
            if let Err(lost) = rig.decide(plan, time_s, &reality) {
                *drone = Err(lost);
                continue;
            }
            plants.command(lane, &rig.motors());
            if tick.is_multiple_of(ticks_per_sample) {
                recorder.record(&rig.moment(time_s, &reality, plants.battery(lane)));
            }
        }
        if fleet.iter().all(Result::is_err) {
            break;
        }
        plants.advance(rates.steps_per_tick);
        if tick.is_multiple_of(TICKS_PER_REPORT) {
            progress(f64::from(tick) / f64::from(n_ticks.max(1)));
        }
    }
    let land = |(lane, drone): (usize, Result<Aloft<'_>>)| {
        drone.map(|Aloft { rig, recorder }| recorder.finish(rig.warnings(plants.warnings(lane))))
    };
    fleet.into_iter().enumerate().map(land).collect()
}

/// Flights of one plan with a drone each, in order, in the widest registers that there are.
pub(super) struct Together<'a> {
    pub(super) plan: &'a Plan,
    pub(super) believed: &'a SimOptions,
    pub(super) drones: &'a [(&'a SimOptions, u64)],
}

impl WithSimd for Together<'_> {
    type Output = Vec<Result<Flight>>;

    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { plan, believed, drones } = self;
        let mut flights = Vec::with_capacity(drones.len());
        let alike = |(one, _): &(&SimOptions, u64), (other, _): &(&SimOptions, u64)| {
            Craft::<f64>::together(one, other)
        };
        for drones in drones.chunk_by(alike).flat_map(|drones| drones.chunks(Wide::<S>::LANES)) {
            let checked = drones.iter().map(|(actual, _)| check(plan, believed, actual));
            match checked.collect::<Result<Vec<u32>>>().as_deref() {
                Ok([n_ticks, _, ..]) => {
                    let still = &mut |_| {};
                    let together =
                        fly_lanes::<Wide<S>>(simd, plan, believed, drones, *n_ticks, still);
                    flights.extend(together);
                }
                _ => {
                    flights.extend(drones.iter().map(|(actual, seed)| {
                        fly_unlike(plan, believed, actual, *seed, &mut |_| {})
                    }))
                }
            }
        }
        flights
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::plan::Setpoint;
    use crate::sim::{EstimatorKind, GroundEffect, Gusts, Positioning, fly_together};

    /// From the floor, up, along and back to the floor.
    fn road() -> Plan {
        let at = |(time_s, x, z): (f64, f64, f64)| Setpoint {
            time_s,
            position_m: Vector3::new(x, 0.0, z),
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: Vector3::zeros(),
            letter: Some(0),
        };
        let corners = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.4), (2.0, 0.2, 0.5), (3.0, 0.2, 0.0)];
        let setpoints = corners.into_iter().chain([(5.0, 0.2, 0.0)]).map(at).collect();
        Plan { setpoints, ..Plan::default() }
    }

    fn full(positioning: Positioning, kind: EstimatorKind) -> SimOptions {
        let mut options = SimOptions::cf21();
        options.rates.control_hz = 1000;
        options.sensors.positioning = positioning;
        options.observer.kind = kind;
        options
    }

    #[test]
    fn drones_fly_together_as_they_fly_alone_bit_for_bit() {
        let plan = road();
        let believed = full(Positioning::CrossingBeams, EstimatorKind::Luenberger);
        let drone = |i: u32| {
            let mut actual = believed.clone();
            let part = f64::from(i) / 20.0;
            actual.vehicle.mass_kg *= 1.0 + 0.05 * part;
            actual.vehicle.motor_rise_s *= if i == 2 { 0.0 } else { 1.0 + part };
            actual.vehicle.center_of_mass_m = [1e-3 * part, 0.0];
            actual.battery.charge_frac = 1.0 - part;
            actual.air.wind_m_s = [0.3 * part, 0.1, 0.0];
            match i {
                // Too heavy to be lifted by what its controller believes in; it stays down.
                3 => actual.vehicle.mass_kg *= 1.15,
                // Blown away.
                4 => actual.air.wind_m_s = [30.0, 0.0, 0.0],
                5..8 => actual.air.gusts = Gusts::OrnsteinUhlenbeck,
                8 => actual.air.gusts = Gusts::Dryden,
                9..12 => actual.vehicle.ground_effect = GroundEffect::SanchezCuevas,
                12..15 => actual.battery.capacity_ah = 0.0,
                // Not to be flown at all.
                17 => actual.vehicle.mass_kg = f64::NAN,
                _ => {}
            }
            actual
        };
        let actual: Vec<SimOptions> = (0..20).map(drone).collect();
        let drones: Vec<_> = actual.iter().zip(100..).collect();
        let together = fly_together(&plan, &believed, &drones);
        assert_eq!(together.len(), drones.len());
        let mut lost = 0;
        for ((actual, seed), together) in drones.into_iter().zip(together) {
            let alone = fly_unlike(&plan, &believed, actual, seed, &mut |_| {});
            match (alone, together) {
                (Ok(alone), Ok(together)) => assert!(alone == together, "seed {seed}"),
                (Err(alone), Err(together)) => {
                    assert_eq!(alone.to_string(), together.to_string(), "seed {seed}");
                    lost += 1;
                }
                (alone, together) => panic!("seed {seed}: {alone:?} but {together:?}"),
            }
        }
        assert_eq!(lost, 2, "one is blown away and one refused, the others beside them are not");
    }
}
