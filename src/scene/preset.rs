//! Named sets of values for a whole scene.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::Scene;
use crate::error::{Error, Result};
use crate::plan::{PlanOptions, Style};
use crate::sim::SimOptions;

/// A named set of values that a scene starts from. They differ in the drone: its body, battery and
/// gains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The reference team's flight of December 2022: their drone, gains, letters and timing.
    #[default]
    #[serde(rename = "ae483-2022")]
    Ae4832022,
    /// [`SimOptions::cf21`].
    Cf21,
    /// [`SimOptions::cf21_thrust_kit`].
    Cf21ThrustKit,
    /// [`SimOptions::cf_brushless`].
    CfBrushless,
    /// [`SimOptions::bzzz`].
    Bzzz,
}

impl Preset {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::Ae4832022, Self::Cf21, Self::Cf21ThrustKit, Self::CfBrushless, Self::Bzzz];

    /// Its name in a scene file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ae4832022 => "ae483-2022",
            Self::Cf21 => "cf21",
            Self::Cf21ThrustKit => "cf21-thrust-kit",
            Self::CfBrushless => "cf-brushless",
            Self::Bzzz => "bzzz",
        }
    }

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

    /// The preset with the keys of a scene file, known to be sound, laid over it; the file's style
    /// of flying goes before the preset's.
    pub(super) fn under(self, toml: &str, style: Style) -> Scene {
        let scene = Scene { plan: PlanOptions::of(style), ..Scene::preset(self) };
        let mut values = toml::Table::try_from(scene).expect("a preset is a table");
        lay_over(&mut values, toml.parse().expect("the text was read before"));
        values.try_into().expect("sound keys over sound keys")
    }
}

impl FromStr for Preset {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Error::input("preset", name, format!("one of {names}"), "choose a name of the list")
        })
    }
}

/// Puts `over` into `base`, table into table.
fn lay_over(base: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(base)), toml::Value::Table(over)) => lay_over(base, over),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_file_and_lead_back() {
        for preset in Preset::ALL {
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
