//! Ultra-wideband ranges: two-way, or differences between two anchors.
//!
//! White noise, an error of each link that depends on the drone's place, and strays. Anchors are
//! asked in turn; a difference is taken between an anchor and the next one in the list. Walls,
//! antennas' patterns and collisions of packets are not modeled.

use nalgebra::Vector3;

use crate::sim::noise::{Field, Noise};
use crate::sim::options::UwbOptions;

/// Distance over which a link's error changes: an assumption, of the size of the furniture.
const BIAS_LENGTH_M: f64 = 1.5;

/// One measured distance, or difference of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::sim) struct Range {
    /// Index of the anchor.
    pub(in crate::sim) anchor: usize,
    /// Index of the anchor whose distance was subtracted, for a difference.
    pub(in crate::sim) minus: Option<usize>,
    /// `|p − a|`, or `|p − a| − |p − b|`.
    pub(in crate::sim) distance_m: f64,
}

/// The anchors and the tag on the drone.
#[derive(Debug)]
pub(super) struct Uwb {
    anchors_m: Vec<Vector3<f64>>,
    differences: bool,
    rate_hz: f64,
    noise_m: f64,
    outlier_frac: f64,
    outlier_m: f64,
    /// One per link: an anchor, or the pair that begins with it.
    biases: Vec<Field<1>>,
    noise: Noise,
    strays: Noise,
    measured: u32,
    ranges: Vec<Range>,
}

impl Uwb {
    pub(super) fn new(
        options: &UwbOptions,
        differences: bool,
        noise: impl Fn(&str) -> Noise,
    ) -> Self {
        let bias = |i: usize| {
            let mut noise = noise(&format!("uwb link {i}"));
            Field::new(&mut noise, options.bias_m, BIAS_LENGTH_M)
        };
        let anchors_m: Vec<_> = options.anchors_m.iter().map(|a| Vector3::from(*a)).collect();
        Self {
            differences,
            rate_hz: options.rate_hz,
            noise_m: options.noise_m,
            outlier_frac: options.outlier_frac,
            outlier_m: options.outlier_m,
            biases: (0..anchors_m.len()).map(bias).collect(),
            noise: noise("uwb noise"),
            strays: noise("uwb strays"),
            measured: 0,
            // A rate of 2 kHz on a control loop of 50 Hz.
            ranges: Vec::with_capacity(64),
            anchors_m,
        }
    }

    /// The ranges that are due by `time_s`.
    pub(super) fn read(&mut self, position_m: &Vector3<f64>, time_s: f64) -> &[Range] {
        self.ranges.clear();
        while f64::from(self.measured) <= time_s * self.rate_hz {
            let anchor = self.measured as usize % self.anchors_m.len();
            self.measured += 1;
            let range = self.range(anchor, position_m);
            self.ranges.push(range);
        }
        &self.ranges
    }

    fn range(&mut self, anchor: usize, position_m: &Vector3<f64>) -> Range {
        let distance = |i: usize| (position_m - self.anchors_m[i]).norm();
        let minus = self.differences.then(|| (anchor + 1) % self.anchors_m.len());
        let true_m = distance(anchor) - minus.map_or(0.0, distance);
        let bias_m = self.biases[anchor].component(0, position_m);
        let white_m = self.noise.normal() * self.noise_m;
        let [luck, size] = [self.strays.uniform(), self.strays.uniform()];
        // Exponential; a difference strays either way.
        let either = if self.differences { size } else { 0.5 + 0.5 * size };
        let astray_m = match luck < self.outlier_frac {
            true if either < 0.5 => self.outlier_m * libm::log(1.0 - 2.0 * either),
            true => -self.outlier_m * libm::log(2.0 * (1.0 - either)),
            false => 0.0,
        };
        Range { anchor, minus, distance_m: true_m + bias_m + white_m + astray_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::sensors::density::{Series, white_density};

    const PLACE_M: Vector3<f64> = Vector3::new(0.3, -0.2, 0.8);

    /// Errors of ten minutes at rest, by link.
    fn errors(options: &UwbOptions, differences: bool) -> Vec<Vec<f64>> {
        let mut uwb = Uwb::new(options, differences, |sensor| Noise::new(4, 0, sensor));
        let anchors = uwb.anchors_m.clone();
        let mut errors = vec![Vec::new(); anchors.len()];
        for tick in 0..300_000 {
            for range in uwb.read(&PLACE_M, f64::from(tick) / 500.0) {
                let distance = |i: usize| (PLACE_M - anchors[i]).norm();
                let truth = distance(range.anchor) - range.minus.map_or(0.0, distance);
                errors[range.anchor].push(range.distance_m - truth);
            }
        }
        errors
    }

    #[expect(clippy::cast_precision_loss, reason = "small")]
    fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
        let n = values.len() as f64;
        values.sum::<f64>() / n
    }

    #[test]
    fn white_part_and_bias_have_their_size_and_links_their_turn() {
        for differences in [false, true] {
            let options = UwbOptions { outlier_frac: 0.0, ..UwbOptions::default() };
            let errors = errors(&options, differences);
            let mut bias_sq = 0.0;
            for link in &errors {
                assert!((13_499..13_502).contains(&link.len()), "{} of 108000 / 8", link.len());
                let bias = mean(link.iter().copied());
                let sigma = mean(link.iter().map(|e| (e - bias) * (e - bias))).sqrt();
                assert!((sigma / 0.06 - 1.0).abs() < 0.03, "white part {sigma}");
                let mut series = Series::new(180.0 / 8.0);
                link.iter().for_each(|error| series.push(*error));
                for density in white_density(&series) {
                    let want = 0.06 / f64::sqrt(0.5 * 180.0 / 8.0);
                    assert!((density / want - 1.0).abs() < 0.3, "{density} m/√Hz of {want}");
                }
                bias_sq += bias * bias / 8.0;
            }
            // Eight draws: between half and one and a half of 0.2 m in all but a few per cent.
            assert!((0.1..0.3).contains(&bias_sq.sqrt()), "bias {}", bias_sq.sqrt());
        }
    }

    #[test]
    fn strays_are_as_many_and_as_large_as_stated() {
        let options = UwbOptions {
            noise_m: 0.0,
            bias_m: 0.0,
            outlier_frac: 0.14,
            outlier_m: 2.0,
            ..UwbOptions::default()
        };
        for differences in [false, true] {
            let all: Vec<f64> = errors(&options, differences).concat();
            let strays: Vec<f64> = all.iter().copied().filter(|e| e.abs() > 1e-9).collect();
            #[expect(clippy::cast_precision_loss, reason = "small")]
            let share = strays.len() as f64 / all.len() as f64;
            assert!((share - 0.14).abs() < 0.005, "share {share}");
            let size = mean(strays.iter().map(|e| e.abs()));
            assert!((size / 2.0 - 1.0).abs() < 0.05, "mean size {size}");
            let shorter = strays.iter().filter(|e| **e < 0.0).count();
            let want = if differences { strays.len() / 2 } else { 0 };
            assert!(shorter.abs_diff(want) < strays.len() / 50, "{shorter} of {}", strays.len());
        }
    }
}
