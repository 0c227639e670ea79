//! Settings of the floor below the flight, in the section `floor` of a scene.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use noctograph_core::error::{Error, Result};
use noctograph_core::settings::{Described, Shape, joined, settings};

/// Largest absolute coordinate in m that scenes and files may contain.
pub(crate) const MAX_COORDINATE_M: f64 = 1e4;
/// Smallest and largest height of a step in m.
const HEIGHTS_M: [f64; 2] = [0.001, 100.0];

settings! {
    /// The floor, which is level at z = 0 except for steps. The ranger detects the steps, and the
    /// drone can rest on them. Their sides do not stop the drone, and no light falls on them.
    pub struct FloorOptions {
        /// Steps, such as tables: `[{ x_m = [1, 2], y_m = [-1, 1], height_m = 0.5 }]`.
        steps: Vec<FloorStep> = Vec::new();
    }
}

/// Step of the floor, modeled as a box such as a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FloorStep {
    /// Smallest and largest x of the step in the world frame in m.
    pub x_m: [f64; 2],
    /// Smallest and largest y of the step in the world frame in m.
    pub y_m: [f64; 2],
    /// Height of the step's top above the floor in m.
    pub height_m: f64,
}

impl FloorStep {
    /// True if a point is within the step's horizontal extent.
    fn is_below(&self, x_m: f64, y_m: f64) -> bool {
        let ([left, right], [near, far]) = (self.x_m, self.y_m);
        (left..=right).contains(&x_m) && (near..=far).contains(&y_m)
    }

    /// True if the steps overlap in area.
    fn overlaps(&self, other: &Self) -> bool {
        let extents = [(self.x_m, other.x_m), (self.y_m, other.y_m)];
        extents.iter().all(|(a, b)| a[0] < b[1] && b[0] < a[1])
    }
}

impl Described for FloorStep {
    const SHAPE: Shape = Shape::Plain;

    /// Checks that the height is within `HEIGHTS_M`, and that each end is beyond its beginning.
    fn check(&self, place: &str, _: Option<[f64; 2]>) -> Result<()> {
        self.height_m.check(&joined(place, "height_m"), Some(HEIGHTS_M))?;
        for (key, extent_m) in [("x_m", self.x_m), ("y_m", self.y_m)] {
            let place = joined(place, key);
            extent_m.check(&place, Some([-MAX_COORDINATE_M, MAX_COORDINATE_M]))?;
            let [least, most] = extent_m;
            if least >= most {
                let extent = format!("{least} to {most} m");
                let hint = "write the smaller value first";
                return Err(Error::input(place, extent, "an end greater than the beginning", hint));
            }
        }
        Ok(())
    }
}

impl FloorOptions {
    /// Returns the height of the floor at a point in m.
    #[inline(always)]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let below = self.steps.iter().filter(|step| step.is_below(x_m, y_m));
        below.fold(0.0, |highest, step| step.height_m.max(highest))
    }

    /// Returns the distance in m from a point to the floor or to the nearest step along a downward
    /// unit vector.
    pub fn distance_m(&self, from_m: &Vector3<f64>, down: &Vector3<f64>) -> f64 {
        let to_steps_m = self.steps.iter().filter_map(|step| {
            let distance_m = (from_m.z - step.height_m) / -down.z;
            let foot_m = from_m + down * distance_m;
            (distance_m >= 0.0 && step.is_below(foot_m.x, foot_m.y)).then_some(distance_m)
        });
        to_steps_m.fold(from_m.z / -down.z, f64::min)
    }

    /// Checks that no two steps overlap, so that each point of the floor has one height.
    pub(crate) fn check_steps(&self) -> Result<()> {
        for (i, step) in self.steps.iter().enumerate() {
            if let Some(j) = self.steps[..i].iter().position(|other| step.overlaps(other)) {
                let FloorStep { x_m: [left, right], y_m: [near, far], .. } = step;
                let extent = format!("x {left} to {right} m, y {near} to {far} m");
                let wanted = format!("an area that floor.steps[{j}] does not cover");
                let hint = "divide the steps so that each point has one height";
                let error = Error::input("", extent, wanted, hint);
                return Err(error.of_item("floor.steps", i));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> FloorOptions {
        let step = FloorStep { x_m: [1.0, 2.0], y_m: [-1.0, 1.0], height_m: 0.5 };
        FloorOptions { steps: vec![step] }
    }

    #[test]
    fn a_ranger_sees_the_table_where_its_beam_falls() {
        let straight = -Vector3::z();
        let seen =
            |x_m: f64, down: &Vector3<f64>| table().distance_m(&Vector3::new(x_m, 0.0, 1.5), down);
        assert_eq!((seen(0.9, &straight), seen(1.5, &straight)), (1.5, 1.0));
        // When the drone leans forward, the beam hits the table before the drone is above it.
        let forward = Vector3::new(0.6, 0.0, -0.8);
        assert_eq!(seen(0.5, &forward), 1.0 / 0.8);
        assert_eq!(seen(0.0, &forward), 1.5 / 0.8);
        assert_eq!([0.9, 1.5].map(|x| table().height_m(x, 0.0)), [0.0, 0.5]);
    }

    #[test]
    fn steps_in_one_place_or_inside_out_are_refused() {
        fn refused(change: fn(&mut FloorStep)) -> Option<String> {
            let mut floor = table();
            let mut second = floor.steps[0].clone();
            change(&mut second);
            floor.steps.push(second);
            let checked =
                Described::check(&floor, "floor", None).and_then(|()| floor.check_steps());
            checked.err().map(|error| error.to_string())
        }
        let overlapping = refused(|step| step.x_m = [1.9, 3.0]).unwrap();
        assert!(overlapping.starts_with("floor.steps[1]: found x 1.9 to 3 m"), "{overlapping}");
        assert_eq!(refused(|step| step.x_m = [2.0, 3.0]), None, "side by side");
        let inverted = refused(|step| step.y_m = [1.0, -1.0]).unwrap();
        assert!(inverted.starts_with("floor.steps[1].y_m: found 1 to -1 m"), "{inverted}");
        let low = refused(|step| step.height_m = -0.5).unwrap();
        assert!(low.starts_with("floor.steps[1].height_m: found -0.5"), "{low}");
    }
}
