//! Repairs half-precision log values that were rounded without a carry.
//!
//! Firmware without [`Feature::HALF_PRECISION`] does not carry when it rounds the mantissa up into
//! an odd exponent. A value that rounds to 0.5, 2, 8 or another 2·4ⁿ is therefore logged as exactly
//! half. All other values are correct. If a sample is half of each neighbor, it is such a value,
//! and the correct value is twice the sample. Logs on the card do not use half precision.

use half::f16;

use super::recording::{Column, Recording};
use noctograph_core::crazyflie::{Feature, Release};

/// Maximum relative distances of each neighbor, and of their mean, from twice the sample.
const NEIGHBOR: f64 = 0.4;
const MEAN: f64 = 0.1;
/// Maximum number of such samples in a row. Few values lose their carry.
const LONGEST: usize = 4;
/// Decimal steps per unit of a value that is stored as text. Values with a finer resolution are
/// binary numbers.
const DECIMALS: [f64; 8] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];
/// Minimum size of a value in decimal steps. Smaller values are counts rather than measurements.
const STEPS: f64 = 64.0;

/// Doubles samples that lost their carry, with a warning. Logs of firmware that keeps the carry are
/// not changed.
pub(super) fn restored(mut log: Recording) -> Recording {
    let release = log.firmware.as_deref().and_then(Release::parse);
    if release.is_some_and(|release| release.has(&Feature::HALF_PRECISION)) {
        return log;
    }
    let mut restored = Vec::new();
    for block in &mut log.blocks {
        for Column { name, values, .. } in &mut block.columns {
            // The inexpensive search for suspects comes first, because most columns contain none.
            let rows = rows_without_carry(values);
            let Some(first) = rows.first().filter(|first| may_be_half(values, values[**first]))
            else {
                continue;
            };
            let (n, since_s) = (rows.len(), block.time_s[*first] - block.time_s[0]);
            restored.push(format!("{name} ({n} of {}, from {since_s:.2} s)", values.len()));
            rows.iter().for_each(|row| values[*row] *= 2.0);
        }
    }
    if !restored.is_empty() {
        let (last, list) = (Feature::HALF_PRECISION.last_without().name(), restored.join(", "));
        let text = format!(
            "samples that are half of both their neighbors are doubled, because firmware up to \
             {last} loses a carry when it rounds to half precision (FP16): {list}"
        );
        log.warn("half-precision", text);
    }
    log
}

/// Returns the rows of samples that are half of both their neighbors.
fn rows_without_carry(values: &[f64]) -> Vec<usize> {
    let (mut rows, mut start) = (Vec::new(), 0);
    for run in values.chunk_by(|a, b| a == b) {
        let (value, end) = (run[0], start + run.len());
        // A suspect is a run of equal values whose two neighbors are about twice as large.
        if start > 0 && end < values.len() && run.len() <= LONGEST && may_have_lost(value) {
            let (before, after) = (values[start - 1], values[end]);
            let mean = f64::midpoint(before, after);
            let checks = [(before, NEIGHBOR), (after, NEIGHBOR), (mean, MEAN)];
            let whole = 2.0 * value;
            if checks.iter().all(|(x, fraction)| (x - whole).abs() <= fraction * whole.abs()) {
                rows.extend(start..end);
            }
        }
        start = end;
    }
    rows
}

/// True if a value may have lost its carry, which yields ±1 times a power of 4.
fn may_have_lost(value: f64) -> bool {
    // The ten lowest bits are the fraction. The exponent of a power of 4 is odd, since 15 is added.
    let bits = f16::from_f64(value).to_bits();
    bits & 0x03ff == 0 && bits >> 10 & 1 == 1
}

/// True if all values have half precision, up to the rounding of their printed digits, and if these
/// digits resolve `value`.
fn may_be_half(values: &[f64], value: f64) -> bool {
    /// Relative error of a decimal number that was converted to binary, and of half a step.
    const ROUNDING: f64 = 1e-9;
    const HALF_STEP: f64 = 0.5 * (1.0 + 1e-6);
    let finite = || values.iter().filter(|value| value.is_finite());
    let are_whole = |scale: &f64| {
        finite().all(|value| {
            let scaled = value * scale;
            (scaled - scaled.round()).abs() <= ROUNDING * scaled.abs().max(1.0)
        })
    };
    // The rounding is limited by the printed step, which is zero for binary numbers.
    let step = DECIMALS.into_iter().find(are_whole).map_or(0.0, f64::recip);
    let is_half =
        |value: &f64| (value - f64::from(f16::from_f64(*value))).abs() <= HALF_STEP * step;
    step <= value.abs() / STEPS && finite().all(is_half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Block;
    use crate::tests::said;

    /// Returns a value as written by `single2half` (firmware up to 2026.04) and read by cflib.
    fn logged(value: f32) -> f64 {
        let bits = value.to_bits();
        let (sign, exponent) = (bits >> 31, bits >> 23 & 0xff);
        assert!((112..=142).contains(&exponent), "{value}");
        let mantissa = (bits >> 13 & 0x3ff) + (bits >> 12 & 1);
        let half = sign << 15 | (exponent - 112) << 10 | mantissa;
        f64::from(f16::from_bits(u16::try_from(half).unwrap()))
    }

    fn restored(values: &[f64], firmware: Option<&str>) -> (Vec<f64>, String) {
        let columns = vec![Column::new("a".into(), values.to_vec())];
        let time_s = (0_u32..).map(|i| 0.1 * f64::from(i)).take(values.len()).collect();
        let blocks = vec![Block { time_s, columns, ..Block::default() }];
        let firmware = firmware.map(str::to_owned);
        let log = super::restored(Recording { blocks, firmware, ..Recording::default() });
        (log.blocks[0].columns[0].values.clone(), said(&log))
    }

    #[test]
    fn the_firmwares_own_conversion_gives_these_bits() {
        let (mut n_lost, mut logs) = (0, Vec::new());
        for line in include_str!("recorded/half.txt").lines().filter(|it| !it.starts_with('#')) {
            let words: Vec<&str> = line.split(' ').collect();
            let [value, before, since] = words[..] else { panic!("{line}") };
            let [before, since] = [before, since]
                .map(|bits| f64::from(f16::from_bits(u16::from_str_radix(bits, 16).unwrap())));
            let value: f32 = value.parse().unwrap();
            assert_eq!(logged(value), before, "{value}");
            assert_eq!(since, if before == since { before } else { 2.0 * before }, "{value}");
            n_lost += usize::from(before != since);
            assert!(before == since || may_have_lost(before), "{value}");
            logs.push((before, since));
        }
        assert_eq!((n_lost, logs.len()), (8, 19));
    }

    #[test]
    fn the_values_that_lose_their_carry_are_those_below_twice_a_power_of_four() {
        assert_eq!([0.49995, 1.9998, -7.9995].map(logged), [0.25, 1.0, -4.0]);
        assert_eq!([0.9999, 3.9999, 0.4998].map(logged), [1.0, 4.0, 0.499_755_859_375]);
        for power in -6..=7 {
            let value = 4_f32.powi(power);
            let below = f32::from_bits((2.0 * value).to_bits() - 1);
            assert!(
                logged(below) == f64::from(value) && may_have_lost(f64::from(value)),
                "{below}"
            );
            assert!(!may_have_lost(f64::from(2.0 * value)));
        }
    }

    #[test]
    fn a_signal_that_reaches_them_comes_back_as_it_was_rounded() {
        for amplitude in [0.49995_f32, -0.49995, 1.9998, 31.997, 127.987] {
            let true_values: Vec<f32> = (0_u16..400)
                .map(|i| amplitude * (1.0 - 0.1 * libm::cosf(0.05 * f32::from(i) + 0.01).powi(2)))
                .collect();
            let seen: Vec<f64> = true_values.iter().copied().map(logged).collect();
            let (values, said) = restored(&seen, None);
            let jumps = |values: &[f64]| {
                let pairs = values.windows(2);
                pairs.filter(|pair| (pair[1] / pair[0] - 1.0).abs() > 0.3).count()
            };
            assert!(jumps(&seen) > 1 && said.contains("up to 2026.04"), "{amplitude}: {said}");
            assert_eq!(jumps(&values), 0, "{amplitude}");
            for (value, true_value) in values.iter().zip(&true_values) {
                let error = (value - f64::from(*true_value)).abs();
                assert!(error <= 0.5e-3 * value.abs(), "{value} of {true_value}");
            }
            assert_eq!(restored(&seen, Some("2026.04")).0, values);
            assert_eq!(restored(&seen, Some("2026.08")), (seen.clone(), String::new()));
            let printed: Vec<f64> = seen.iter().map(|v| (v * 1e4).round() / 1e4).collect();
            assert_eq!(jumps(&restored(&printed, None).0), 0, "{amplitude} with four decimals");
        }
    }

    #[test]
    fn what_is_no_half_is_left_as_it_is() {
        for values in [
            &[2.0, 2.0, 1.0, 2.0, 2.0, 3.0][..], // number of visible stations
            &[0.5, 0.25, 0.5, 0.25, 0.5],        // setpoints
            &[0.499_981, 0.500_123, 0.25, 0.500_021], // six decimals: an actual dip
            &[0.499_755_859_375, 0.25, 0.25, 0.25, 0.25, 0.25, 0.499_511_718_75],
            &[0.25, 0.499_755_859_375, 0.499_511_718_75, 0.25], // at the ends
            &[0.125, 0.25, 0.499_755_859_375, 1.0],             // during a climb
        ] {
            let (after, said) = restored(values, None);
            assert_eq!((after.as_slice(), said.as_str()), (values, ""));
        }
    }
}
