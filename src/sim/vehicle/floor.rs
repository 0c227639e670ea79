//! Ground effect: a rotor near the floor lifts more at the same speed.

use super::options::{GroundEffect, VehicleOptions};
use crate::sim::wide::{Each, Real};

/// Lowest height of the rotors, in radii, at which the models are used: below, they are no longer
/// supported by measurements, and Cheeseman and Bennett's runs to infinity at a quarter.
const MIN_HEIGHT_RADII: f64 = 0.5;

/// Thrust near the floor over thrust far from it, at the same rotor speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Floor<T> {
    model: GroundEffect,
    radius_m: T,
    rotor_height_m: T,
    spacing_m: T,
}

impl<T: Real> Floor<T> {
    /// All drones have the first one's model.
    pub(super) fn new(each: &Each<'_, VehicleOptions, T>) -> Self {
        Self {
            model: each.first().ground_effect,
            radius_m: each.figure(|o| o.rotor_radius_m),
            rotor_height_m: each.figure(|o| o.rotor_height_m),
            spacing_m: each.figure(|o| 2.0 * o.arm_m),
        }
    }

    /// The ratio for a level drone whose origin is `height_m` above the floor.
    #[inline(always)]
    pub(super) fn thrust_ratio(&self, height_m: T) -> T {
        let (radius, one) = (self.radius_m, height_m.all(1.0));
        let z = (height_m + self.rotor_height_m).at_least(radius * MIN_HEIGHT_RADII);
        let own = radius / (z * 4.0);
        match self.model {
            GroundEffect::None => one,
            GroundEffect::CheesemanBennett => one / (one - own * own),
            GroundEffect::SanchezCuevas => {
                let (square, d_sq) = (z * 4.0 * z, self.spacing_m * self.spacing_m);
                let (near, far) = (d_sq + square, d_sq * 2.0 + square);
                let images = z / (near * near.root()) + z / (far * far.root()) * 0.5;
                let others = radius * radius * images;
                one / (one - own * own - others)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn floor(model: GroundEffect) -> Floor<f64> {
        Floor { model, radius_m: 0.1, rotor_height_m: 0.02, spacing_m: 0.3 }
    }

    #[test]
    fn one_rotor_at_its_radius_lifts_a_fifteenth_more() {
        let ratio = floor(GroundEffect::CheesemanBennett).thrust_ratio(0.08);
        assert!((ratio - 16.0 / 15.0).abs() < 1e-15, "{ratio}");
        assert_eq!(floor(GroundEffect::None).thrust_ratio(0.0), 1.0);
    }

    #[test]
    fn the_other_rotors_images_add_to_it() {
        // By hand: z = 0.1, d = 0.3: 1/16 + 0.01·0.1·(0.13^-1.5 + 0.22^-1.5 / 2).
        let sum = 0.0625 + 0.001 * (libm::pow(0.13, -1.5) + 0.5 * libm::pow(0.22, -1.5));
        let ratio = floor(GroundEffect::SanchezCuevas).thrust_ratio(0.08);
        assert!((ratio - 1.0 / (1.0 - sum)).abs() < 1e-14, "{ratio}");
    }

    #[test]
    fn far_away_nothing_is_left_and_on_the_floor_it_stays_finite() {
        for model in [GroundEffect::CheesemanBennett, GroundEffect::SanchezCuevas] {
            let floor = floor(model);
            assert!((floor.thrust_ratio(20.0) - 1.0).abs() < 1e-5, "{model:?}");
            assert!((1.0..1.6).contains(&floor.thrust_ratio(-1.0)), "{model:?}");
        }
    }
}
