//! Drones that fly at the same time, each in a world of its own, from tick to tick.

use nalgebra::Vector3;
use pulp::NullaryFnOnce;

use super::body::{Body, Row};
use super::craft::Craft;
use crate::sim::options::SimOptions;
use crate::sim::wide::{Each, Real};

/// As many drones as `T` has lanes, or fewer.
#[derive(Debug)]
pub(in crate::sim) struct Plants<T: Real> {
    leave: T::Leave,
    craft: Craft<T>,
    row: Row<T>,
    specific_force_m_s2: [T; 3],
    commands: [T; 4],
}

/// What is true of one drone at a tick.
#[derive(Clone, Copy, Debug)]
pub(in crate::sim) struct Reality {
    /// Where it is and how it moves.
    pub(in crate::sim) body: Body,
    /// What an accelerometer at the body origin would read, body frame.
    pub(in crate::sim) specific_force_m_s2: Vector3<f64>,
    /// Steps so far in which the battery could not give what was asked for.
    pub(in crate::sim) short_steps: u32,
}

impl<T: Real> Plants<T> {
    /// Level drones at rest at `position_m`, as [`super::Plant::new`] makes them, moved in steps of
    /// `dt_s`.
    pub(in crate::sim) fn new(
        leave: T::Leave,
        drones: &[(&SimOptions, u64)],
        dt_s: f64,
        position_m: Vector3<f64>,
    ) -> Self {
        let (options, seeds): (Vec<&SimOptions>, Vec<u64>) = drones.iter().copied().unzip();
        let each = Each::new(leave, options);
        let craft = Craft::new(&each, dt_s, &seeds, 0, position_m.z);
        let row = Body::at(position_m).row().map(|value| each.figure(|_| value));
        let specific_force_m_s2 = craft.specific_force_m_s2(&row);
        Self { leave, craft, row, specific_force_m_s2, commands: [each.figure(|_| 0.0); 4] }
    }

    /// What is true of a drone now.
    pub(in crate::sim) fn reality(&self, lane: usize) -> Reality {
        Reality {
            body: Body::from_row(&std::array::from_fn(|part| self.row[part].lane(lane))),
            specific_force_m_s2: Vector3::from_fn(|axis, _| {
                self.specific_force_m_s2[axis].lane(lane)
            }),
            short_steps: self.craft.short_steps(lane),
        }
    }

    /// Voltage (V) of a drone's battery and the energy (J) that has left it; `None` where it never
    /// sags.
    pub(in crate::sim) fn battery(&self, lane: usize) -> Option<(f64, f64)> {
        self.craft.battery_v(lane).zip(self.craft.energy_j(lane))
    }

    /// Tells a drone's motors m1…m4 what to do from now on.
    pub(in crate::sim) fn command(&mut self, lane: usize, motors: &[f64; 4]) {
        for (command, motor) in self.commands.iter_mut().zip(motors) {
            command.set_lane(lane, *motor);
        }
    }

    /// Moves all drones on by so many steps.
    pub(in crate::sim) fn advance(&mut self, steps: u32) {
        T::run(self.leave, Steps(self, steps));
    }

    /// What whoever reads a drone's flight should know.
    pub(in crate::sim) fn warnings(&self, lane: usize) -> Vec<String> {
        self.craft.warnings(lane)
    }
}

/// Some steps of the physics.
struct Steps<'a, T: Real>(&'a mut Plants<T>, u32);

impl<T: Real> NullaryFnOnce for Steps<'_, T> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self(plants, steps) = self;
        for _ in 0..steps {
            plants.row = plants.craft.advance(&plants.row, &plants.commands);
        }
        plants.specific_force_m_s2 = plants.craft.specific_force_m_s2(&plants.row);
    }
}
