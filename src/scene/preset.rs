//! Named sets of values for a whole scene.

use crate::settings::settings;
use crate::sim::SimOptions;

settings! {
    /// A named set of values that a scene starts from. They differ in the drone: its body, battery
    /// and gains.
    pub enum Preset {
        /// The reference team's flight of December 2022: their drone, gains, letters and timing.
        "ae483-2022" => Ae4832022,
        /// Crazyflie 2.1.
        "cf21" => Cf21,
        /// Crazyflie 2.1 with the thrust upgrade kit.
        "cf21-thrust-kit" => Cf21ThrustKit,
        /// Crazyflie 2.1 Brushless.
        "cf-brushless" => CfBrushless,
        /// The quadrotor of a lab on altitude hold, 1.3 kg.
        "bzzz" => Bzzz,
    }
}

impl Preset {
    /// The drone that it names.
    pub(super) fn sim(self) -> SimOptions {
        match self {
            Self::Ae4832022 => SimOptions::default(),
            Self::Cf21 => SimOptions::cf21(),
            Self::Cf21ThrustKit => SimOptions::cf21_thrust_kit(),
            Self::CfBrushless => SimOptions::cf_brushless(),
            Self::Bzzz => SimOptions::bzzz(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_file_and_lead_back() {
        for &preset in Preset::ALL {
            let value = toml::Value::try_from(preset).unwrap();
            assert_eq!(value.as_str(), Some(preset.name()));
            assert_eq!(preset.name().parse::<Preset>().unwrap(), preset);
        }
    }

    #[test]
    fn an_unknown_name_is_refused_with_the_list() {
        let error = "cf22".parse::<Preset>().unwrap_err().to_string();
        assert!(error.contains("ae483-2022, cf21, cf21-thrust-kit, cf-brushless, bzzz"), "{error}");
    }
}
