//! Plans and random numbers for several tests.

use nalgebra::Vector3;

use noctograph_letters::{LetterOptions, write};
use noctograph_plan::{Plan, PlanData, PlanOptions, Setpoint, plan};

/// Random numbers of the harnesses of `tests/firmware`, by splitmix64.
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    /// Returns a uniformly distributed number from 0 to 1.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / 9_007_199_254_740_992.0
    }

    /// Returns an approximately normally distributed number, from a sum of four uniform numbers.
    pub(crate) fn normal(&mut self) -> f64 {
        let sum: f64 = (0..4).map(|_| self.uniform()).sum();
        (sum - 2.0) * 1.732_050_807_568_877_2
    }
}

/// Returns the plan of a word in the reference team's letters.
pub(crate) fn written(word: &str, options: &PlanOptions) -> Plan {
    plan(&write(word, &LetterOptions::default()).unwrap(), options).unwrap()
}

/// Returns a plan in which the drone hovers at one position with its headlights on.
pub(crate) fn hover(position_m: [f64; 3], end_s: f64) -> Plan {
    let (position_m, letter) = (Vector3::from(position_m), Some(0));
    let setpoints =
        [0.0, end_s].map(|time_s| Setpoint { time_s, position_m, letter, ..Setpoint::default() });
    let lights = [("headlights".to_owned(), vec![1.0; 2])].into();
    Plan::made(PlanData { setpoints: setpoints.into(), lights, ..PlanData::default() })
}
