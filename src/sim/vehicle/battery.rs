//! A lithium-polymer battery: its voltage sags with charge and current, and limits the thrust.

use super::options::{BatteryOptions, Compensation};
use crate::sim::wide::{Each, Real};

const SECONDS_PER_HOUR: f64 = 3600.0;

/// A battery in use.
#[derive(Clone, Debug)]
pub(super) struct Battery<T> {
    open_circuit_v: [T; 11],
    capacity_a_s: T,
    resistance_ohm: T,
    idle_current_a: T,
    current_a_per_n: T,
    thrust_from_v_n: [T; 4],
    compensation: Compensation,
    cut_off_v: T,
    charge_frac: T,
    voltage_v: T,
    energy_j: T,
    /// 1 once the voltage has been below the cut-off, 0 before.
    cut_off: T,
}

/// What one motor can do at the present voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limit<T> {
    /// Thrust per thrust asked for.
    pub(super) gain: T,
    /// Largest thrust of one motor.
    pub(super) max_n: T,
}

impl<T: Real> Battery<T> {
    /// The battery of some options under no more than its idle current; `None` for one that never
    /// sags. All drones have one, with the first one's compensation, or none has.
    pub(super) fn new(each: &Each<'_, BatteryOptions, T>) -> Option<Self> {
        let zero = each.figure(|_| 0.0);
        let mut battery = Self {
            open_circuit_v: each.figures(|o| o.open_circuit_v),
            capacity_a_s: each.figure(|o| o.capacity_ah * SECONDS_PER_HOUR),
            resistance_ohm: each.figure(|o| o.resistance_ohm),
            idle_current_a: each.figure(|o| o.idle_current_a),
            current_a_per_n: each.figure(|o| o.current_a_per_n),
            thrust_from_v_n: each.figures(|o| o.thrust_from_v_n),
            compensation: each.first().compensation,
            cut_off_v: each.figure(|o| o.cut_off_v),
            charge_frac: each.figure(|o| o.charge_frac),
            voltage_v: zero,
            energy_j: zero,
            cut_off: zero,
        };
        battery.drain(zero, 0.0);
        each.first().has_charge().then_some(battery)
    }

    /// Voltage under load.
    pub(super) fn voltage_v(&self) -> T {
        self.voltage_v
    }

    /// Energy that has left it.
    pub(super) fn energy_j(&self) -> T {
        self.energy_j
    }

    /// Whether the voltage has been below the cut-off; the motors stay off from then on.
    pub(super) fn is_cut_off(&self, lane: usize) -> bool {
        self.cut_off.lane(lane) > 0.0
    }

    /// Bears a thrust of all rotors for `dt_s`.
    #[inline(always)]
    pub(super) fn drain(&mut self, thrust_n: T, dt_s: f64) {
        let (zero, one) = (thrust_n.all(0.0), thrust_n.all(1.0));
        let current_a = self.idle_current_a + self.current_a_per_n * thrust_n;
        let spent = current_a * dt_s / self.capacity_a_s;
        self.charge_frac = (self.charge_frac - spent).at_least(zero);
        self.voltage_v = self.open_circuit_v() - self.resistance_ohm * current_a;
        self.energy_j = self.energy_j + self.voltage_v * current_a * dt_s;
        self.cut_off = self.voltage_v.pick(self.cut_off_v, one, self.cut_off);
    }

    /// What the motors can do now; `full_n` is the thrust of a motor's largest command.
    #[inline(always)]
    pub(super) fn limit(&self, full_n: T) -> Limit<T> {
        let (zero, one) = (full_n.all(0.0), full_n.all(1.0));
        let [a, b, c, d] = self.thrust_from_v_n;
        let v = self.voltage_v;
        let max_n = (a + v * (b + v * (c + v * d))).at_least(zero);
        let gain = match self.compensation {
            Compensation::Firmware => one,
            Compensation::None => max_n / full_n,
        };
        Limit {
            gain: self.cut_off.pick(one, gain, zero),
            max_n: self.cut_off.pick(one, max_n, zero),
        }
    }

    #[inline(always)]
    fn open_circuit_v(&self) -> T {
        let [low, high, above] = (self.charge_frac * 10.0).knots(&self.open_circuit_v);
        low + (high - low) * above
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::SimOptions;

    fn cf21() -> (Battery<f64>, f64) {
        let options = SimOptions::cf21();
        (Battery::new(&Each::one(&options.battery)).unwrap(), options.vehicle.mass_kg * 9.81)
    }

    #[test]
    fn take_off_and_hover_sag_as_on_98_real_flights() {
        // NanoBench, computed in ../shared/spec/simulation.md: drop 0.57 V (quartiles 0.51 to
        // 0.67), then −2.65 mV/s (quartiles −3.5 to −2.0) over 35 s.
        let (mut battery, weight_n) = cf21();
        let on_floor_v = battery.voltage_v();
        battery.drain(weight_n, 0.002);
        let start_v = battery.voltage_v();
        let drop_v = on_floor_v - start_v;
        assert!((drop_v - 0.57).abs() < 0.01, "drop {drop_v} V");
        for _ in 0..17_500 {
            battery.drain(weight_n, 0.002);
        }
        let slope_v_s = (battery.voltage_v() - start_v) / 35.0;
        assert!((slope_v_s + 2.65e-3).abs() < 0.1e-3, "slope {slope_v_s} V/s");
    }

    #[test]
    fn energy_is_voltage_times_current_times_time() {
        let (mut battery, _) = cf21();
        (battery.open_circuit_v, battery.resistance_ohm) = ([4.0; 11], 0.5);
        (battery.idle_current_a, battery.current_a_per_n) = (0.2, 6.0);
        (0..1000).for_each(|_| battery.drain(0.3, 0.002));
        // 0.2 + 6 · 0.3 = 2 A leave 4 − 0.5 · 2 = 3 V: 6 W for 2 s.
        assert!((battery.energy_j() - 12.0).abs() < 1e-9, "{} J", battery.energy_j());
    }

    #[test]
    fn the_open_circuit_voltage_is_the_table() {
        let (mut battery, _) = cf21();
        for (charge_frac, want) in [(1.0, 4.2), (0.9, 4.1), (0.55, 3.94), (0.05, 3.39), (0.0, 3.0)]
        {
            battery.charge_frac = charge_frac;
            let found = battery.open_circuit_v();
            assert!((found - want).abs() < 1e-12, "{found} V at {charge_frac}");
        }
    }

    #[test]
    fn firmware_holds_the_thrust_until_the_voltage_gives_out() {
        let (mut battery, _) = cf21();
        battery.voltage_v = 3.0;
        let limit = battery.limit(0.12);
        assert_eq!(limit.gain, 1.0);
        // −0.01483 + 0.04724·3 − 0.01847·9 + 0.005961·27
        assert!((limit.max_n - 0.12160).abs() < 1e-4, "{}", limit.max_n);
        battery.compensation = Compensation::None;
        assert!((battery.limit(0.12).gain - limit.max_n / 0.12).abs() < 1e-15, "scales");
    }

    #[test]
    fn an_empty_battery_cuts_off_for_good() {
        let (mut battery, weight_n) = cf21();
        battery.charge_frac = 0.001;
        battery.drain(weight_n, 1.0);
        assert!(battery.is_cut_off(0), "{} V", battery.voltage_v());
        battery.drain(0.0, 0.0);
        assert_eq!(battery.limit(0.12).max_n, 0.0, "also without load");
    }

    #[test]
    fn no_capacity_is_no_battery() {
        assert!(Battery::new(&Each::<_, f64>::one(&BatteryOptions::default())).is_none());
    }
}
