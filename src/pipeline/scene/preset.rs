//! Presets: named sets of values for a scene, in files that cite the source of each number.
//!
//! Published values differ by large factors between models (motor lag 0.02 to 0.25 s, yaw moment
//! 0.005 to 0.034 m), so a preset is taken from a single source if possible.

use std::sync::OnceLock;

use super::Scene;
use noctograph_core::settings::settings;

settings! {
    /// Named set of initial values for a scene. `ae483-2022` is a complete system. The other
    /// presets differ from each other only in the drone.
    pub enum Preset {
        /// Crazyflie 2.1 as sold, with the Lighthouse deck and the LED-ring deck.
        "cf21" => Cf21,
        /// Crazyflie 2.1 with the thrust upgrade kit.
        "cf21-thrust-kit" => Cf21ThrustKit,
        /// Crazyflie 2.1 Brushless.
        "cf-brushless" => CfBrushless,
        /// The 1.15 kg quadrotor of a lab course on altitude hold, with its own sensors.
        "bzzz" => Bzzz,
        /// The reference team's flight of December 2022, with its drone, gains, letters and lamps.
        "ae483-2022" => Ae4832022,
    }
}

impl Preset {
    /// Returns the text of the preset's file, or `None` if every setting has its default value.
    fn toml(self) -> Option<&'static str> {
        match self {
            Self::Cf21 => Some(include_str!("presets/cf21.toml")),
            Self::Cf21ThrustKit => Some(include_str!("presets/cf21-thrust-kit.toml")),
            Self::CfBrushless => Some(include_str!("presets/cf-brushless.toml")),
            Self::Bzzz => Some(include_str!("presets/bzzz.toml")),
            Self::Ae4832022 => None,
        }
    }

    /// Returns the preset's scene, whose text is parsed at the first call only.
    pub(super) fn scene(self) -> &'static Scene {
        static SCENES: [OnceLock<Scene>; Preset::ALL.len()] =
            [const { OnceLock::new() }; Preset::ALL.len()];
        SCENES[self as usize].get_or_init(|| {
            let scene = match self.toml() {
                Some(toml) => Scene::parse(toml, self.name()).expect("a preset is a scene"),
                None => Scene::default(),
            };
            Scene { preset: self, ..scene }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::flight::Flight;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::tracking::{Part, track};
    use noctograph_plan::{PlanOptions, plan};
    use noctograph_sim::sensors::{Positioning, SensorOptions};
    use noctograph_sim::vehicle::{AirOptions, Gusts};
    use noctograph_sim::{ControllerKind, Drone, EstimatorKind, MotorLag, SimOptions, fly};

    /// Returns a preset's drone in still air, with the team's regulator, observer and sensors.
    fn with_regulator(preset: Preset) -> SimOptions {
        let mut sim = preset.scene().sim();
        sim.controller.kind = ControllerKind::default();
        sim.observer.kind = EstimatorKind::default();
        sim.sensors.positioning = Positioning::default();
        sim.air = AirOptions::default();
        sim
    }

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
            assert_eq!(scene.air.gusts, Gusts::room(), "a typical flight, not an ideal one");
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

    fn noor(options: &SimOptions) -> Flight {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        fly(&plan(&strokes, &PlanOptions::default()).unwrap(), &Drone::new(options, 1), &mut |_| {})
            .unwrap()
    }

    #[test]
    fn every_set_passes_its_check_and_flies_noor_from_floor_to_floor() {
        // The bounds exceed the observed errors by a tenth.
        let sets = [
            (with_regulator(Preset::Cf21), [0.073, 0.01, 0.081]),
            (with_regulator(Preset::Cf21ThrustKit), [0.072, 0.01, 0.081]),
            (with_regulator(Preset::CfBrushless), [0.074, 0.01, 0.082]),
            (Preset::Bzzz.scene().sim(), [0.048, 0.033, 0.046]),
        ];
        for (options, bounds) in sets {
            options.check().unwrap();
            let flight = noor(&options);
            let rmse = track(&flight, Part::Letters).unwrap().rmse_m;
            for (actual, bound) in rmse.iter().zip(bounds) {
                assert!(*actual < bound, "{rmse} above {bounds:?}");
            }
            assert_eq!(flight.samples.last().unwrap().position_m.z, 0.0, "landed");
            assert!(flight.warnings.is_empty(), "{:?}", flight.warnings);
        }
    }

    #[test]
    fn every_crazyflie_bears_a_rooms_gusts_with_the_firmwares_controllers() {
        // A regulator without integral action cannot withstand gusts, which displace cf21 by 8 cm.
        for preset in [Preset::Cf21, Preset::Cf21ThrustKit, Preset::CfBrushless] {
            for (kind, bound_m) in [(ControllerKind::Pid, 0.12), (ControllerKind::Geometric, 0.06)]
            {
                let mut options = preset.scene().sim();
                options.controller.kind = kind;
                options.air.gusts = Gusts::room();
                let rmse_m = track(&noor(&options), Part::Letters).unwrap().rmse_m.norm();
                assert!(rmse_m < bound_m, "{kind:?}: {rmse_m} m");
            }
        }
    }

    #[test]
    fn the_reference_teams_gains_do_not_bear_the_motor_lag() {
        let mut options = with_regulator(Preset::Cf21);
        options.controller.lqr.motor_lag = MotorLag::Ignored;
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::default()).unwrap();
        let error = fly(&plan, &Drone::new(&options, 1), &mut |_| {}).unwrap_err().to_string();
        assert!(error.starts_with("the drone "), "{error}");
    }

    #[test]
    fn half_the_step_moves_the_flight_little_though_battery_and_ground_effect_are_held() {
        let mut options =
            SimOptions { sensors: SensorOptions::ideal(), ..with_regulator(Preset::Cf21) };
        let coarse = noor(&options);
        options.rates.steps_per_tick = 2;
        let fine = noor(&options);
        let apart_m = coarse.samples.iter().zip(&fine.samples).filter(|(a, _)| a.letter.is_some());
        let apart_m =
            apart_m.map(|(a, b)| (a.position_m - b.position_m).norm()).fold(0.0, f64::max);
        // Most of the difference comes from the lift-off time, known only to one time step.
        assert!(apart_m < 2e-5, "{apart_m} m apart");
    }
}
