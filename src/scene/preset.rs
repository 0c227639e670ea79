//! Named sets of values for a whole scene.

use crate::camera::{CameraOptions, Framing, Metering, TrailMetering, WordFraming};
use crate::letters::{Align, LetterOptions};
use crate::light::{LightOptions, RingEffect};
use crate::photo::PhotoOptions;
use crate::plan::PlanOptions;
use crate::settings::settings;
use crate::sim::{ControllerKind, EstimatorKind, Positioning, SimOptions};

settings! {
    /// A named set of values that a scene starts from. `ae483-2022` is a whole system; the others
    /// differ in the drone alone, and write, light and photograph in the same way.
    pub enum Preset {
        /// Crazyflie 2.1 as sold, with the Lighthouse and the LED-ring deck.
        "cf21" => Cf21,
        /// Crazyflie 2.1 with the thrust upgrade kit.
        "cf21-thrust-kit" => Cf21ThrustKit,
        /// Crazyflie 2.1 Brushless.
        "cf-brushless" => CfBrushless,
        /// The quadrotor of a lab on altitude hold, 1.15 kg, with its own sensors.
        "bzzz" => Bzzz,
        /// The reference team's flight of December 2022: their drone, gains, letters, timing and
        /// lamps.
        "ae483-2022" => Ae4832022,
    }
}

impl Preset {
    /// The drone. Crazyflies fly their firmware's defaults: its cascade of PID loops, and Lighthouse
    /// sweeps in its Kalman filter.
    pub(super) fn sim(self) -> SimOptions {
        let mut sim = match self {
            Self::Ae4832022 => return SimOptions::default(),
            Self::Bzzz => return SimOptions::bzzz(),
            Self::Cf21 => SimOptions::cf21(),
            Self::Cf21ThrustKit => SimOptions::cf21_thrust_kit(),
            Self::CfBrushless => SimOptions::cf_brushless(),
        };
        sim.controller.kind = ControllerKind::Pid;
        sim.observer.kind = EstimatorKind::Ekf;
        sim.sensors.positioning = Positioning::Sweeps;
        sim
    }

    /// The word's drawing, within what the default Lighthouse stations see well.
    pub(super) fn letters(self) -> LetterOptions {
        match self {
            Self::Ae4832022 => LetterOptions::default(),
            _ => LetterOptions {
                font: "simplex".into(),
                align: Align::Center,
                canvas_m: Some([3.2, 1.6]),
                ..LetterOptions::default()
            },
        }
    }

    /// The way of flying.
    pub(super) fn plan(self) -> PlanOptions {
        match self {
            Self::Ae4832022 => PlanOptions::default(),
            _ => PlanOptions::even(),
        }
    }

    /// The lamps: in an exported flight the ring's spinner and the LEDs of the board are off.
    pub(super) fn light(self) -> LightOptions {
        match self {
            Self::Ae4832022 => LightOptions::default(),
            _ => {
                LightOptions { led_bitmask: 128, ring: RingEffect::Off, ..LightOptions::default() }
            }
        }
    }

    /// The camera.
    pub(super) fn camera(self) -> CameraOptions {
        match self {
            Self::Ae4832022 => CameraOptions::default(),
            _ => CameraOptions {
                metering: Metering::Trail(TrailMetering::default()),
                framing: Framing::Word(WordFraming { fill_frac: 0.65 }),
                ..CameraOptions::default()
            },
        }
    }

    /// Room and picture: the room of the reference photograph, fitted by eye
    /// (`docs/photograph.toml`), is darker than the default.
    pub(super) fn photo(self) -> PhotoOptions {
        match self {
            Self::Ae4832022 => PhotoOptions::default(),
            _ => PhotoOptions { ambient_cd_m2: 0.008, ..PhotoOptions::default() },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn names_are_those_of_the_file_and_lead_back() {
        for &preset in Preset::ALL {
            let value = toml::Value::try_from(preset).unwrap();
            assert_eq!(value.as_str(), Some(preset.name()));
            assert_eq!(preset.name().parse::<Preset>().unwrap(), preset);
        }
    }

    #[test]
    fn the_crazyflies_fly_as_sold_and_write_anything_in_latin() {
        for preset in [Preset::Cf21, Preset::Cf21ThrustKit, Preset::CfBrushless] {
            let scene = Scene { word: "Zoë, 2027: Straße!".into(), ..Scene::preset(preset) };
            assert_eq!(scene.controller.kind, ControllerKind::Pid);
            assert_eq!(scene.strokes().unwrap().word.replace('\n', " "), scene.word);
            let [left, _, right, _] = scene.strokes().unwrap().bounds_m();
            assert!((left + right).abs() < 1e-9, "centered");
        }
        let team = Scene::preset(Preset::Ae4832022);
        assert_eq!((team.sim(), team.letters), (SimOptions::default(), LetterOptions::default()));
    }

    #[test]
    fn another_controller_keeps_the_gains_of_the_preset() {
        let text =
            "preset = \"cf21\"\ncontroller.kind = \"geometric\"\nobserver.kind = \"truth\"\n";
        let scene = Scene::parse(text, "my.toml").unwrap();
        let preset = Scene::preset(Preset::Cf21);
        assert_eq!(scene.controller.kind, ControllerKind::Geometric);
        assert_eq!(scene.controller.geometric, preset.controller.geometric);
        assert_eq!(scene.observer.ekf, preset.observer.ekf);
    }

    #[test]
    fn an_unknown_name_is_refused_with_the_list() {
        let error = "cf22".parse::<Preset>().unwrap_err().to_string();
        assert!(error.contains("cf21, cf21-thrust-kit, cf-brushless, bzzz, ae483-2022"), "{error}");
    }
}
