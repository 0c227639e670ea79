//! Ground effect, which increases the lift of a rotor near the floor at the same speed.

use super::{GroundEffect, VehicleOptions};

/// Minimum rotor height in the models, in rotor radii. There are no measurements below it, and
/// Cheeseman and Bennett's model diverges at a quarter radius.
const MIN_HEIGHT_RADII: f64 = 0.5;

/// Ground effect on one drone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Floor {
    model: GroundEffect,
    radius_m: f64,
    rotor_height_m: f64,
    spacing_m: f64,
}

impl Floor {
    /// Creates the floor's effect on a vehicle's rotors. Neighboring rotors are two levers
    /// (`arm_m`) apart.
    pub(super) fn new(options: &VehicleOptions) -> Self {
        Self {
            model: options.ground_effect,
            radius_m: options.rotor_radius_m,
            rotor_height_m: options.rotor_height_m,
            spacing_m: 2.0 * options.arm_m,
        }
    }

    /// Returns the ratio of thrust near the floor to thrust far from it at the same rotor speed,
    /// for a level drone whose origin is `height_m` above the floor, by the formulas in
    /// [`GroundEffect`].
    #[inline(always)]
    pub(super) fn thrust_ratio(&self, height_m: f64) -> f64 {
        // The images are those of the rotor itself, of its two neighbors and of the opposite rotor.
        // The factors of 4 and 2 are those of the published formulas.
        let radius = self.radius_m;
        let z = (height_m + self.rotor_height_m).max(radius * MIN_HEIGHT_RADII);
        let image = radius / (z * 4.0);
        match self.model {
            GroundEffect::None => 1.0,
            GroundEffect::CheesemanBennett => 1.0 / (1.0 - image * image),
            GroundEffect::SanchezCuevas => {
                let (square, d_sq) = (z * 4.0 * z, self.spacing_m * self.spacing_m);
                let (near, far) = (d_sq + square, d_sq * 2.0 + square);
                let images = z / (near * near.sqrt()) + z / (far * far.sqrt()) * 0.5;
                let others = radius * radius * images;
                1.0 / (1.0 - image * image - others)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn floor(model: GroundEffect) -> Floor {
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
        // For z = 0.1 and d = 0.3, the sum is 1/16 + 0.01·0.1·(0.13^-1.5 + 0.22^-1.5 / 2), by hand.
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
