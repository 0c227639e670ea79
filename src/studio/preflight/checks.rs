//! What an export needs to know of the checks: the facts by which a script judges the drone.

use crate::scene::{Preset, Scene};
use crate::shoot::Shoot;
use noctograph_core::digest::sha256;
use noctograph_core::error::Result;
use noctograph_core::flight::Flight;
use noctograph_export::safety::{Battery, Checks, Platform};

use super::Profile;

/// The drone of a scene as its firmware names it; `None`: none of Bitcraze's.
#[must_use]
pub fn platform(scene: &Scene) -> Option<Platform> {
    match scene.preset {
        Preset::Cf21 | Preset::Cf21ThrustKit | Preset::Ae4832022 => Some(Platform::Crazyflie2),
        Preset::CfBrushless => Some(Platform::Brushless),
        Preset::Bzzz => None,
    }
}

/// The facts behind the checks of flights within a profile.
#[must_use]
pub fn checks(shoot: &Shoot, flown: &[Result<Flight>], profile: &Profile) -> Checks {
    let (scene, platform) = (&shoot.scene, platform(&shoot.scene));
    let battery = |flight: &Result<Flight>| {
        let low_v = platform?.low_battery_v();
        Battery::of(&scene.battery, flight.as_ref().ok()?, low_v)
    };
    Checks {
        platform,
        positioning: scene.sensors.positioning,
        volume_m: profile.volume_m,
        room_m: profile.room_m,
        batteries: flown.iter().map(battery).collect(),
        scene_sha256: sha256(scene.to_toml().as_bytes()),
    }
}
