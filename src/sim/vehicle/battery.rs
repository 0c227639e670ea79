//! Lithium-polymer battery, whose voltage depends on charge and current, and limits the thrust.

use nalgebra::Vector4;

use super::{BatteryOptions, Compensation};

pub(super) const SECONDS_PER_HOUR: f64 = 3600.0;
/// Time in s below the cut-off after which the motors stop (`PM_BAT_CRITICAL_LOW_TIMEOUT`,
/// `pm_stm32f4.c` of firmware 2026.08), so that a voltage sag at take-off does not stop them.
const CUT_OFF_S: f64 = 5.0;

/// Upper end of the bisection for a motor's voltage, as a multiple of the battery's voltage, and
/// number of steps, for a resolution of 1e-9 V.
const HIGHEST_V: f64 = 8.0;
const BISECTIONS: u32 = 36;

/// State of a battery in use.
#[derive(Clone, Debug)]
pub(super) struct Battery {
    options: BatteryOptions,
    capacity_a_s: f64,
    charge_frac: f64,
    /// Voltage under load in V.
    pub(super) voltage_v: f64,
    /// Energy delivered so far in J.
    pub(super) energy_j: f64,
    /// Time in s for which the voltage has been below the cut-off.
    low_s: f64,
}

/// Limits of one motor at the present voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limit {
    /// Ratio of delivered to commanded thrust.
    pub(super) gain: f64,
    /// Maximum thrust in N.
    pub(super) max_n: f64,
    /// Thrust in N below which a motor stops or idles.
    pub(super) least_n: f64,
    /// Thrust of an idling motor in N.
    pub(super) idle_n: f64,
}

impl Battery {
    /// Creates a battery that supplies its idle current. Returns `None` without a capacity, in
    /// which case the voltage never sags.
    pub(super) fn new(options: &BatteryOptions) -> Option<Self> {
        let mut battery = Self {
            options: options.clone(),
            capacity_a_s: options.capacity_ah * SECONDS_PER_HOUR,
            charge_frac: options.charge_frac,
            voltage_v: 0.0,
            energy_j: 0.0,
            low_s: 0.0,
        };
        battery.drain(0.0, 0.0);
        (options.capacity_ah > 0.0).then_some(battery)
    }

    /// True once the voltage has been below the cut-off for too long. The motors then stay off.
    pub(super) fn is_cut_off(&self) -> bool {
        self.low_s >= CUT_OFF_S
    }

    /// Supplies the current for a total thrust of all rotors for `dt_s`, which updates charge,
    /// voltage, energy and the time below the cut-off.
    #[inline(always)]
    pub(super) fn drain(&mut self, thrust_n: f64, dt_s: f64) {
        // The voltage is U = U₀(charge) − R I, with a current that is linear in the thrust.
        let options = &self.options;
        let current_a = options.idle_current_a + options.current_a_per_n * thrust_n;
        let spent = current_a * dt_s / self.capacity_a_s;
        self.charge_frac = (self.charge_frac - spent).max(0.0);
        self.voltage_v =
            options.open_circuit_v(self.charge_frac) - options.resistance_ohm * current_a;
        self.energy_j += self.voltage_v * current_a * dt_s;
        if self.voltage_v < options.cut_off_v {
            self.low_s += dt_s;
        } else if !self.is_cut_off() {
            self.low_s = 0.0;
        }
    }

    /// Returns the limits at the present voltage. `full_n` is the thrust of one motor at its
    /// maximum command.
    #[inline(always)]
    pub(super) fn limit(&self, full_n: f64) -> Limit {
        if self.is_cut_off() {
            return Limit { gain: 0.0, max_n: 0.0, least_n: 0.0, idle_n: 0.0 };
        }
        let max_n = self.thrust_n(self.voltage_v);
        match self.options.compensation {
            Compensation::Firmware => Limit {
                gain: 1.0,
                max_n,
                least_n: self.options.least_thrust_n,
                idle_n: self.idle_n(),
            },
            Compensation::None => Limit { gain: max_n / full_n, max_n, least_n: 0.0, idle_n: 0.0 },
        }
    }

    /// Returns the thrusts that the motors provide if the battery cannot provide the wanted
    /// thrusts. `max_n` is the maximum thrust of a motor at the present voltage.
    #[inline(never)]
    pub(super) fn lowered(&self, wanted_n: &Vector4<f64>, max_n: f64) -> Vector4<f64> {
        // Without compensation, each motor is limited separately. With compensation, the duty
        // cycles of all four are lowered by the excess of the largest one, but not below idle.
        if self.is_cut_off() || self.options.compensation == Compensation::None {
            return wanted_n.map(|wanted_n| wanted_n.min(max_n));
        }
        let motors_v = wanted_n.map(|wanted_n| self.motor_v(wanted_n));
        let excess_v = motors_v.max() - self.voltage_v;
        let idle_n = self.idle_n();
        motors_v.map(|motor_v| {
            if motor_v > excess_v { self.thrust_n(motor_v - excess_v).max(idle_n) } else { idle_n }
        })
    }

    /// Returns the thrust of an idling motor at the present voltage in N.
    #[inline(always)]
    fn idle_n(&self) -> f64 {
        if self.options.idle_frac > 0.0 {
            self.thrust_n(self.options.idle_frac * self.voltage_v)
        } else {
            0.0
        }
    }

    /// Returns the thrust of a motor at a voltage in N.
    #[inline(always)]
    fn thrust_n(&self, motor_v: f64) -> f64 {
        let [a, b, c, d] = self.options.thrust_from_v_n;
        (a + motor_v * (b + motor_v * (c + motor_v * d))).max(0.0)
    }

    /// Returns the voltage in V of a motor that provides a thrust, by bisection, or 0 for no
    /// thrust.
    fn motor_v(&self, thrust_n: f64) -> f64 {
        if thrust_n <= 0.0 {
            return 0.0;
        }
        let [mut below_v, mut above_v] = [0.0, HIGHEST_V * self.voltage_v];
        for _ in 0..BISECTIONS {
            let middle_v = 0.5 * (below_v + above_v);
            let is_below = self.thrust_n(middle_v) < thrust_n;
            if is_below { below_v = middle_v } else { above_v = middle_v }
        }
        above_v
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SimOptions;

    fn cf21() -> (Battery, f64) {
        let options = SimOptions::cf21();
        (Battery::new(&options.battery).unwrap(), options.vehicle.mass_kg * 9.81)
    }

    #[test]
    fn take_off_and_hover_sag_as_on_98_real_flights() {
        // The medians of 98 flights of NanoBench (arXiv 2603.09908) are a drop of 0.57 V (quartiles
        // 0.51 to 0.67), followed by −2.65 mV/s (quartiles −3.5 to −2.0) over 35 s.
        let (mut battery, weight_n) = cf21();
        let on_floor_v = battery.voltage_v;
        battery.drain(weight_n, 0.002);
        let start_v = battery.voltage_v;
        let drop_v = on_floor_v - start_v;
        assert!((drop_v - 0.57).abs() < 0.01, "drop {drop_v} V");
        for _ in 0..17_500 {
            battery.drain(weight_n, 0.002);
        }
        let slope_v_s = (battery.voltage_v - start_v) / 35.0;
        assert!((slope_v_s + 2.65e-3).abs() < 0.1e-3, "slope {slope_v_s} V/s");
    }

    #[test]
    fn the_time_to_the_cut_off_is_that_of_a_hovering_drone() {
        for charge_frac in [1.0, 0.5, 0.0] {
            let (mut battery, weight_n) = cf21();
            battery.charge_frac = charge_frac;
            battery.options.charge_frac = charge_frac;
            battery.drain(weight_n, 0.0);
            let mut hovers_s = 0.0;
            while battery.voltage_v >= battery.options.cut_off_v {
                battery.drain(weight_n, 0.1);
                hovers_s += 0.1;
            }
            let lasts_s = battery.options.lasts_s(weight_n).unwrap();
            assert!((lasts_s - hovers_s).abs() < 1.0, "{charge_frac}: {lasts_s} and {hovers_s} s");
        }
    }

    #[test]
    fn energy_is_voltage_times_current_times_time() {
        let (mut battery, _) = cf21();
        (battery.options.open_circuit_v, battery.options.resistance_ohm) = ([4.0; 11], 0.5);
        (battery.options.idle_current_a, battery.options.current_a_per_n) = (0.2, 6.0);
        (0..1000).for_each(|_| battery.drain(0.3, 0.002));
        // At a current of 0.2 + 6 · 0.3 = 2 A, the voltage is 4 − 0.5 · 2 = 3 V, and 6 W flow for 2
        // s.
        assert!((battery.energy_j - 12.0).abs() < 1e-9, "{} J", battery.energy_j);
    }

    #[test]
    fn the_open_circuit_voltage_is_the_table() {
        let battery = SimOptions::cf21().battery;
        for (charge_frac, want) in [(1.0, 4.2), (0.9, 4.1), (0.55, 3.94), (0.05, 3.39), (0.0, 3.0)]
        {
            let open_v = battery.open_circuit_v(charge_frac);
            assert!((open_v - want).abs() < 1e-12, "{open_v} V at {charge_frac}");
        }
    }

    #[test]
    fn firmware_holds_the_thrust_until_the_voltage_gives_out() {
        let (mut battery, _) = cf21();
        battery.voltage_v = 3.0;
        let limit = battery.limit(0.12);
        assert_eq!(limit.gain, 1.0);
        // The thrust is −0.01483 + 0.04724·3 − 0.01847·9 + 0.005961·27 N.
        assert!((limit.max_n - 0.12160).abs() < 1e-4, "{}", limit.max_n);
        battery.options.compensation = Compensation::None;
        assert!((battery.limit(0.12).gain - limit.max_n / 0.12).abs() < 1e-15, "scales");
    }

    #[test]
    fn where_the_battery_is_the_limit_all_four_motors_are_lowered_alike() {
        let (mut battery, _) = cf21();
        battery.voltage_v = 3.0;
        let max_n = battery.limit(0.12).max_n;
        let wanted_n = Vector4::new(max_n + 0.02, max_n - 0.01, 0.05, 0.0);
        let given_n = battery.lowered(&wanted_n, max_n);
        assert!((given_n[0] - max_n).abs() < 1e-6, "the strongest is full");
        let [motors_v, lowered_v] =
            [wanted_n, given_n].map(|n| n.map(|thrust_n| battery.motor_v(thrust_n)));
        for motor in 1..3 {
            let by_v = [0, motor].map(|motor: usize| motors_v[motor] - lowered_v[motor]);
            assert!((by_v[0] - by_v[1]).abs() < 1e-6, "alike: {by_v:?}");
        }
        assert_eq!(given_n[3], 0.0);
        battery.options.compensation = Compensation::None;
        assert_eq!(battery.lowered(&wanted_n, max_n)[1], wanted_n[1], "each by itself");
    }

    #[test]
    fn an_armed_motor_idles() {
        let options = SimOptions::cf_brushless();
        let mut battery = Battery::new(&options.battery).unwrap();
        battery.voltage_v = 4.0;
        let limit = battery.limit(0.2);
        // The idle voltage is 7000/65,535 of 4 V.
        assert!((limit.idle_n - 0.00466).abs() < 1e-4, "{} N", limit.idle_n);
        let given_n = battery.lowered(&Vector4::new(0.4, 0.1, 0.001, 0.0), limit.max_n);
        assert_eq!((given_n[2], given_n[3]), (limit.idle_n, limit.idle_n));
        assert_eq!(cf21().0.limit(0.12).idle_n, 0.0, "brushed motors stop");
    }

    #[test]
    fn an_empty_battery_cuts_off_for_good() {
        let (mut battery, weight_n) = cf21();
        battery.charge_frac = 0.001;
        battery.drain(weight_n, 4.5);
        assert!(battery.voltage_v < 3.0 && !battery.is_cut_off(), "a sag");
        battery.drain(0.0, 1e-3);
        assert!(battery.voltage_v < 3.0, "{} V at rest", battery.voltage_v);
        battery.drain(weight_n, 0.5);
        assert!(battery.is_cut_off(), "{} V", battery.voltage_v);
        battery.drain(0.0, 0.0);
        assert_eq!(battery.limit(0.12).max_n, 0.0, "also without load");
    }

    #[test]
    fn no_capacity_is_no_battery() {
        assert!(Battery::new(&BatteryOptions::default()).is_none());
    }
}
