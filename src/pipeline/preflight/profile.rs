//! Profiles: flight limits for a kind of drone, indoors or outdoors.

use serde::Serialize;

use crate::scene::Scene;
use noctograph_plan::{EvenStyle, Style};
use noctograph_sim::sensors::{Generation, Station};

/// Flight limits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Profile {
    /// Name of the profile.
    pub name: &'static str,
    /// Minimum and maximum of x, y and z.
    pub volume_m: [[f64; 3]; 2],
    /// Width, depth and height of the room, if known. The volume is inside the room.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub room_m: Option<[f64; 3]>,
    /// Maximum distance from the word's plane.
    pub corridor_m: f64,
    /// Maximum speed.
    pub speed_m_s: f64,
    /// Maximum acceleration.
    pub acceleration_m_s2: f64,
    /// Maximum tilt.
    pub tilt_rad: f64,
    /// Maximum time in the air.
    pub flight_time_s: f64,
    /// Maximum mass of the drone.
    pub mass_kg: f64,
    /// Maximum wind speed including gusts.
    pub wind_m_s: f64,
    /// True if sunlight is possible.
    pub is_outdoors: bool,
}

/// Distance of the design from the walls and the ceiling of a room, equal to the reference team's
/// corridor, which flights stay within.
pub(super) const ROOM_MARGIN_M: f64 = 0.2;

/// Maximum horizontal distance, along each axis, from the middle of a wide room to a base station.
/// A station has a range of 6 m, so it sees the far end of a word 4 m wide.
const STATION_M: f64 = 2.5;

impl Profile {
    /// Returns the profile for a room with width, depth and height `room_m`. Its volume keeps a
    /// margin from the walls and the ceiling. The origin is in the middle of the floor.
    #[must_use]
    pub fn in_room(mut self, room_m: [f64; 3]) -> Self {
        let [width_m, depth_m, height_m] = room_m;
        let sides_m = [0.5 * width_m, 0.5 * depth_m, height_m].map(|side_m| side_m - ROOM_MARGIN_M);
        let [low, high] = &mut self.volume_m;
        for axis in 0..3 {
            high[axis] = high[axis].min(sides_m[axis]);
            // The volume extends down to the floor.
            if axis < 2 {
                low[axis] = low[axis].max(-sides_m[axis]);
            }
        }
        self.room_m = Some(room_m);
        self
    }

    /// Lowers the default speed and acceleration of a scene to the profile's limits. Values chosen
    /// by the user are kept and left to the check.
    pub fn slow(&self, scene: &mut Scene) {
        let Style::Even(style) = &mut scene.plan.style else { return };
        let usual = EvenStyle::default();
        if style.dark_speed_m_s == usual.dark_speed_m_s {
            style.dark_speed_m_s = usual.dark_speed_m_s.min(self.speed_m_s);
        }
        if style.acceleration_m_s2 == usual.acceleration_m_s2 {
            style.acceleration_m_s2 = usual.acceleration_m_s2.min(self.acceleration_m_s2);
        }
    }

    /// Returns two base stations in opposite corners of the room, 0.1 m below its ceiling and aimed
    /// at the middle of the volume. According to Bitcraze (tutorial "Getting started with the
    /// Lighthouse system"), two cover about 4 m by 4 m, mounted at least 0.4 m above the flight.
    pub fn stations(&self) -> [Station; 2] {
        let [low, high] = self.volume_m;
        let middle_m = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        let z_m = high[2] + 0.5 * ROOM_MARGIN_M;
        [low, high].map(|[x_m, y_m, _]| {
            let [x_m, y_m] = [x_m, y_m]
                .map(|side_m| side_m.signum() * (side_m.abs() + ROOM_MARGIN_M).min(STATION_M));
            Station::looking(Generation::V2, [x_m, y_m, z_m], middle_m)
        })
    }

    /// Returns a description of the volume with its sides in m, rounded to millimeters.
    pub fn volume(&self) -> String {
        let [low, high] = self.volume_m;
        let [w, d, h] = [0, 1, 2].map(|axis| (1e3 * (high[axis] - low[axis])).round() / 1e3);
        match self.room_m {
            Some(_) => format!(
                "{w} x {d} x {h} m: the profile's volume in the room, {ROOM_MARGIN_M} m from its \
                 walls and ceiling"
            ),
            None => format!("the profile's {w} x {d} x {h} m"),
        }
    }

    /// Returns all profiles.
    pub fn all() -> [Self; 3] {
        [Self::indoor(), Self::careful(), Self::outdoor()]
    }

    /// Returns the profile for a Crazyflie indoors. 1 m/s on each axis and 20° are the limits of
    /// the firmware's controller (`platform_defaults_cf2.h`), and 2 m/s² comes from firmware issue
    /// 882. A battery rated for 7 minutes lasts 4 minutes with decks (crazyswarm issue 148: 3 to
    /// 5). ±0.2 m is the reference team's corridor. A Lighthouse system covers 5 m by 5 m.
    pub fn indoor() -> Self {
        Self {
            name: "indoor",
            volume_m: [[-2.5, -2.5, 0.0], [2.5, 2.5, 2.5]],
            room_m: None,
            corridor_m: 0.2,
            speed_m_s: 1.0,
            acceleration_m_s2: 2.0,
            tilt_rad: 20.0_f64.to_radians(),
            flight_time_s: 240.0,
            // Assumptions: the weight of three heavy Crazyflies, and a draft with the gusts of a
            // fan.
            mass_kg: 0.15,
            wind_m_s: 1.5,
            is_outdoors: false,
        }
    }

    /// Returns the profile for flights indoors with visitors: 0.5 m/s (firmware issue 882).
    pub fn careful() -> Self {
        Self { name: "careful", speed_m_s: 0.5, ..Self::indoor() }
    }

    /// Returns the profile for a larger drone outdoors. The speed (2 m/s upward, here on all axes)
    /// and the height (150 m) are Skybrush's defaults. Acceleration and tilt are assumed to be half
    /// of a multirotor's maximum.
    pub fn outdoor() -> Self {
        Self {
            name: "outdoor",
            volume_m: [[-100.0, -100.0, 0.0], [100.0, 100.0, 150.0]],
            corridor_m: 2.0,
            speed_m_s: 2.0,
            acceleration_m_s2: 4.0,
            tilt_rad: 30.0_f64.to_radians(),
            flight_time_s: 720.0,
            // Assumptions: the weight limit of EU class C2, and a fresh breeze.
            mass_kg: 4.0,
            wind_m_s: 10.0,
            is_outdoors: true,
            ..Self::indoor()
        }
    }
}
