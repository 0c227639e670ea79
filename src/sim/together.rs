//! Flights of one plan at the same time: their physics share the processor's wide registers.

use pulp::{Arch, Simd, WithSimd};

use super::options::SimOptions;
use super::recorder::Recorder;
use super::rig::{Rig, start_m};
use super::vehicle::{Craft, Plants};
use super::wide::{Real, Wide};
use super::{TICKS_PER_REPORT, n_ticks};
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::plan::Plan;

/// One drone's rig and its log, until it is lost.
#[derive(Debug)]
struct Logged<'a> {
    rig: Rig,
    recorder: Recorder<'a>,
    lost: Option<Error>,
}

/// Flies as many drones as `T` has lanes, or fewer, with options and a seed each, tick by tick.
///
/// # Errors
///
/// What keeps all of them on the ground; what is lost by itself is in its place.
pub(super) fn fly_lanes<T: Real>(
    leave: T::Leave,
    plan: &Plan,
    believed: &SimOptions,
    drones: &[(&SimOptions, u64)],
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Result<Flight>>> {
    let rates = &drones[0].0.rates;
    let n_ticks = n_ticks(plan, rates.control_hz)?;
    let ticks_per_sample = rates.control_hz / rates.log_hz;
    let dt_s = 1.0 / f64::from(rates.control_hz * rates.steps_per_tick);
    let mut plants = Plants::<T>::new(leave, drones, dt_s, start_m(plan));
    let logged = drones.iter().map(|(actual, seed)| {
        let rig = Rig::new(plan, believed, actual, *seed)?;
        let recorder = Recorder::new(plan, (n_ticks / ticks_per_sample + 1) as usize);
        Ok(Logged { rig, recorder, lost: None })
    });
    let mut logged: Vec<Logged<'_>> = logged.collect::<Result<_>>()?;
    for tick in 0..=n_ticks {
        let time_s = f64::from(tick) / f64::from(rates.control_hz);
        for (lane, Logged { rig, recorder, lost }) in logged.iter_mut().enumerate() {
            if lost.is_some() {
                continue;
            }
            let reality = plants.reality(lane);
            *lost = rig.decide(plan, time_s, &reality).err();
            plants.command(lane, &rig.motors());
            if tick.is_multiple_of(ticks_per_sample) {
                recorder.record(&rig.moment(time_s, &reality, plants.battery(lane)));
            }
        }
        if logged.iter().all(|logged| logged.lost.is_some()) {
            break;
        }
        plants.advance(rates.steps_per_tick);
        if tick.is_multiple_of(TICKS_PER_REPORT) {
            progress(f64::from(tick) / f64::from(n_ticks.max(1)));
        }
    }
    let flights = logged.into_iter().enumerate();
    let flights = flights.map(|(lane, Logged { rig, recorder, lost })| match lost {
        Some(error) => Err(error),
        None => Ok(recorder.finish(rig.warnings(plants.warnings(lane)))),
    });
    Ok(flights.collect())
}

/// Flights of one plan with a drone each, in order, in the widest registers that there are.
pub(super) struct Together<'a> {
    pub(super) plan: &'a Plan,
    pub(super) believed: &'a SimOptions,
    pub(super) drones: &'a [(&'a SimOptions, u64)],
}

impl WithSimd for Together<'_> {
    type Output = Result<Vec<Result<Flight>>>;

    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { plan, believed, drones } = self;
        let mut flights = Vec::with_capacity(drones.len());
        let alike = |(one, _): &(&SimOptions, u64), (other, _): &(&SimOptions, u64)| {
            Craft::<f64>::together(one, other)
        };
        for drones in drones.chunk_by(alike).flat_map(|drones| drones.chunks(Wide::<S>::LANES)) {
            flights.extend(match drones {
                [_] => fly_lanes::<f64>((), plan, believed, drones, &mut |_| {})?,
                _ => fly_lanes::<Wide<S>>(simd, plan, believed, drones, &mut |_| {})?,
            });
        }
        Ok(flights)
    }
}

impl Together<'_> {
    pub(super) fn fly(self) -> Result<Vec<Result<Flight>>> {
        Arch::new().dispatch(self)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::plan::Setpoint;
    use crate::sim::{EstimatorKind, GroundEffect, Gusts, Positioning, fly_together, fly_unlike};

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
                _ => {}
            }
            actual
        };
        let actual: Vec<SimOptions> = (0..20).map(drone).collect();
        let drones: Vec<_> = actual.iter().zip(100..).collect();
        let together = fly_together(&plan, &believed, &drones).unwrap();
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
        assert_eq!(lost, 1, "one is blown away, the others beside it are not");
    }
}
