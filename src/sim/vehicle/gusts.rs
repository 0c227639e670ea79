//! Wind, with a steady part and gusts that push and rotate the drone.

use nalgebra::Vector3;

use super::{AirOptions, Gusts};
use noctograph_core::random::{Noise, Normals};
use noctograph_core::units::FOOT_M;

/// Correlation time in s of the torque from uneven air, as in the reference flight
/// ([`super::GustOptions`]).
pub const TORQUE_TIME_S: f64 = 1.5;
/// Minimum height in feet of the low-altitude model, whose values are also used below this height.
const LOWEST_FT: f64 = 10.0;

/// Wind at the drone, which is advanced step by step.
#[derive(Debug)]
pub(super) struct Wind {
    mean_m_s: Vector3<f64>,
    /// Directions of the three gust components in the world frame.
    axes: [Vector3<f64>; 3],
    gusts: Option<Filtered>,
    torques: Option<Filtered>,
}

/// Three components of filtered noise, which is stationary from the start.
#[derive(Debug)]
struct Filtered {
    filters: [Filter; 3],
    noise: Normals,
}

impl Filtered {
    /// Creates components whose stages are drawn from the stationary distribution.
    fn new(filters: [Filter; 3], noise: Noise) -> Self {
        let mut filtered = Self { filters, noise: Normals::new(noise) };
        filtered.filters.iter_mut().for_each(|filter| filter.settle(&mut filtered.noise));
        filtered
    }

    /// Advances the filters by a time step, and returns their three components in m/s for wind, or
    /// in N·m for torque.
    #[inline]
    fn advance(&mut self) -> [f64; 3] {
        self.filters.each_mut().map(|filter| filter.advance(&mut self.noise))
    }
}

/// Wind and torque during one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Gust {
    /// Wind in the world frame in m/s.
    pub(super) wind_m_s: Vector3<f64>,
    /// Torque in the body frame in N m.
    pub(super) torque_n_m: Vector3<f64>,
}

impl Wind {
    /// Creates the wind at the drone with index `drone`, which is advanced in steps of `dt_s`. The
    /// index selects the random numbers.
    pub(super) fn new(options: &AirOptions, dt_s: f64, seed: u64, drone: u64) -> Self {
        let mean_m_s = Vector3::from(options.wind_m_s);
        let level_m_s = libm::hypot(mean_m_s.x, mean_m_s.y);
        let mut axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let (mut filters, mut torques) = (None, None);
        match &options.gusts {
            Gusts::OrnsteinUhlenbeck(room) => {
                filters = Some(room.sigma_m_s.map(|s| Filter::new([s, 0.0], room.time_s, dt_s)));
                let strength = room.relative_strength();
                let sigmas_n_m = room.torque_sigma_n_m.map(|sigma| [sigma * strength, 0.0]);
                torques = Some(sigmas_n_m.map(|parts| Filter::new(parts, TORQUE_TIME_S, dt_s)));
            }
            // The axes are along the wind, across it, and up.
            Gusts::Dryden if level_m_s > 0.0 => {
                let along = Vector3::new(mean_m_s.x, mean_m_s.y, 0.0) / level_m_s;
                axes = [along, Vector3::z().cross(&along), Vector3::z()];
                filters = Some(dryden(level_m_s, dt_s));
            }
            Gusts::Dryden | Gusts::None => {}
        }
        // Gusts and torques draw from separate streams.
        let streams = [(filters, "gusts"), (torques, "gust torque")];
        let [gusts, torques] = streams.map(|(filters, stream)| {
            filters.map(|filters| Filtered::new(filters, Noise::new(seed, drone, stream)))
        });
        Self { mean_m_s, axes, gusts, torques }
    }

    /// True if the wind never changes.
    pub(super) fn is_steady(&self) -> bool {
        self.gusts.is_none() && self.torques.is_none()
    }

    /// Returns the wind (world frame) and the torque (body frame) of the next step.
    #[inline]
    pub(super) fn advance(&mut self) -> Gust {
        let mut gust = Gust { wind_m_s: self.mean_m_s, ..Gust::default() };
        if let Some(gusts) = &mut self.gusts {
            for (axis, part_m_s) in self.axes.iter().zip(gusts.advance()) {
                gust.wind_m_s += axis * part_m_s;
            }
        }
        if let Some(torques) = &mut self.torques {
            gust.torque_n_m = torques.advance().into();
        }
        gust
    }
}

/// Returns filters for Dryden's spectra below 1000 ft (MIL-F-8785C), for air that drifts past the
/// drone with the wind. The first filter is for gusts along the wind, and the others are for gusts
/// across it and upward. Their outputs are in m/s.
fn dryden(wind_m_s: f64, dt_s: f64) -> [Filter; 3] {
    // The formulas are σ_w = 0.1 u, σ_u = σ_w / (0.177 + 0.000823 h)^0.4, L_w = h, L_u = h /
    // (…)^1.2, with h in feet.
    let shape = 0.177 + 0.000_823 * LOWEST_FT;
    let vertical_m_s = 0.1 * wind_m_s;
    let level_m_s = vertical_m_s / libm::pow(shape, 0.4);
    let (vertical_m, level_m) = (LOWEST_FT * FOOT_M, LOWEST_FT * FOOT_M / libm::pow(shape, 1.2));
    let across = [(level_m_s, level_m), (vertical_m_s, vertical_m)];
    // Across the wind, σ/√2 (1 + √3 τ s) / (1 + τ s)² has a one-stage and a two-stage part.
    let [level, vertical] = across.map(|(sigma_m_s, length_m)| {
        let sigma = sigma_m_s / f64::sqrt(2.0);
        let parts = [f64::sqrt(3.0) * sigma, (1.0 - f64::sqrt(3.0)) * sigma];
        Filter::new(parts, length_m / wind_m_s, dt_s)
    });
    [Filter::new([level_m_s, 0.0], level_m / wind_m_s, dt_s), level, vertical]
}

/// Filter of white noise, `parts[0] / (1 + τs) + parts[1] / (1 + τs)²`, whose first stage has
/// variance 1, sampled without error.
#[derive(Clone, Copy, Debug)]
struct Filter {
    parts: [f64; 2],
    stages: [f64; 2],
    /// Decay of each stage in one step, and coupling of the first stage into the second.
    decay: f64,
    coupling: f64,
    /// Cholesky factor of the noise added in one step, which by stationarity has the covariance `P
    /// − F P Fᵀ` with `P = [[1, ½], [½, ½]]`.
    noise_factor: [f64; 3],
}

impl Filter {
    /// Creates a filter with the time constant `time_s`, steps of `dt_s`, and both stages at zero.
    /// `parts` are the factors of both stages in the output, in its unit.
    fn new(parts: [f64; 2], time_s: f64, dt_s: f64) -> Self {
        // The rows of F are (decay 0, coupling decay), and Q = P − F P Fᵀ has these entries.
        let decay = libm::exp(-dt_s / time_s);
        let coupling = decay * dt_s / time_s;
        let q11 = 1.0 - decay * decay;
        let q21 = 0.5 - decay * (coupling + 0.5 * decay);
        let q22 = 0.5 - coupling * coupling - decay * coupling - 0.5 * decay * decay;
        // The Cholesky factor of Q has the entries l11, l21 and l22.
        let l11 = q11.sqrt();
        let l21 = q21 / l11;
        let noise_factor = [l11, l21, (q22 - l21 * l21).max(0.0).sqrt()];
        Self { parts, stages: [0.0; 2], decay, coupling, noise_factor }
    }

    /// Draws the stages from their stationary distribution, by the Cholesky factor of P.
    fn settle(&mut self, noise: &mut Normals) {
        let first = noise.next();
        self.stages = [first, 0.5 * (first + noise.next())];
    }

    /// Advances the filter by a step, and returns its output in the unit of its parts.
    fn advance(&mut self, noise: &mut Normals) -> f64 {
        // A one-stage filter draws one random number per step, and a two-stage filter draws two.
        let [first, second] = self.stages;
        let draw = noise.next();
        let [l11, l21, l22] = self.noise_factor;
        self.stages[0] = self.decay * first + l11 * draw;
        if self.parts[1] == 0.0 {
            return self.parts[0] * self.stages[0];
        }
        let added = l21 * draw + l22 * noise.next();
        self.stages[1] = self.decay * second + self.coupling * first + added;
        self.parts[0] * self.stages[0] + self.parts[1] * self.stages[1]
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::vehicle::GustOptions;

    const DT_S: f64 = 0.02;
    const N: usize = 2048;
    const SEGMENTS: usize = 400;
    /// Frequencies, as numbers of periods per segment.
    const BINS: [f64; 5] = [4.0, 10.0, 30.0, 80.0, 200.0];

    fn indoors(room: GustOptions) -> AirOptions {
        AirOptions { gusts: Gusts::OrnsteinUhlenbeck(room), ..Default::default() }
    }

    /// Returns the one-sided densities of the wind's three components, minus the steady wind.
    fn spectra(options: &AirOptions) -> [[f64; BINS.len()]; 3] {
        let mean_m_s = Vector3::from(options.wind_m_s);
        spectra_of(options, |gust| gust.wind_m_s - mean_m_s)
    }

    /// Returns the one-sided densities of three components at [`BINS`], by Hann-windowed segments.
    fn spectra_of(
        options: &AirOptions,
        part: impl Fn(Gust) -> Vector3<f64>,
    ) -> [[f64; BINS.len()]; 3] {
        let mut wind = Wind::new(options, DT_S, 11, 0);
        let window: Vec<f64> =
            (0..N).map(|i| 0.5 - 0.5 * libm::cos(TAU * i as f64 / N as f64)).collect();
        let weight: f64 = window.iter().map(|w| w * w).sum();
        let mut density = [[0.0; BINS.len()]; 3];
        for _ in 0..SEGMENTS {
            let gusts: Vec<Vector3<f64>> = (0..N).map(|_| part(wind.advance())).collect();
            for (axis, row) in density.iter_mut().enumerate() {
                for (bin, value) in BINS.iter().zip(row) {
                    let (mut re, mut im) = (0.0, 0.0);
                    for (i, gust) in gusts.iter().enumerate() {
                        let (sin, cos) = libm::sincos(TAU * bin * i as f64 / N as f64);
                        re += window[i] * gust[axis] * cos;
                        im += window[i] * gust[axis] * sin;
                    }
                    *value += 2.0 * DT_S * (re * re + im * im) / weight / SEGMENTS as f64;
                }
            }
        }
        density
    }

    /// Checks densities, each estimated from 400 segments with a standard deviation of 5 %.
    fn assert_density(densities: &[f64; BINS.len()], want: impl Fn(f64) -> f64) {
        for (bin, density) in BINS.iter().zip(densities) {
            let ratio = density / want(TAU * bin / (N as f64 * DT_S));
            assert!((ratio - 1.0).abs() < 0.2, "{ratio} of the density at bin {bin}");
        }
    }

    #[test]
    fn indoor_gusts_have_their_density() {
        let (sigma_m_s, time_s) = ([0.1, 0.2, 0.05], 0.8);
        let room = GustOptions { sigma_m_s, time_s, ..Default::default() };
        for (spectrum, sigma) in spectra(&indoors(room)).iter().zip(sigma_m_s) {
            // The one-sided density per Hz is 4 σ² τ / (1 + ω²τ²). Aliasing above the Nyquist
            // frequency adds less than a tenth at these bins.
            assert_density(spectrum, |w| 4.0 * sigma * sigma * 0.8 / (1.0 + 0.64 * w * w));
        }
    }

    #[test]
    fn torques_have_their_density() {
        let torque_sigma_n_m = [1e-4, 2e-4, 3e-5];
        let room = GustOptions { torque_sigma_n_m, ..Default::default() };
        let spectrum = spectra_of(&indoors(room), |gust| gust.torque_n_m);
        for (spectrum, sigma) in spectrum.iter().zip(torque_sigma_n_m) {
            assert_density(spectrum, |w| 4.0 * sigma * sigma * 1.5 / (1.0 + 2.25 * w * w));
        }
    }

    #[test]
    fn stiller_air_turns_a_drone_less() {
        let sigmas_m_s = [[0.08; 3], [0.0; 3], [0.16; 3], [0.08, 0.0, 0.0]];
        let [room, still, twice, one_axis] = sigmas_m_s.map(|sigma_m_s| {
            let room = GustOptions { sigma_m_s, ..Default::default() };
            Wind::new(&indoors(room), 0.002, 1, 0).advance().torque_n_m
        });
        assert!(room.norm() > 0.0 && still.norm() == 0.0);
        for (torque, times) in [(twice, 2.0), (one_axis, f64::sqrt(1.0 / 3.0))] {
            let apart = torque - room * times;
            assert!(apart.norm() < 1e-12 * room.norm(), "{times}: {apart}");
        }
    }

    #[test]
    fn drydens_gusts_have_the_densities_of_the_specification() {
        let options =
            AirOptions { gusts: Gusts::Dryden, wind_m_s: [3.0, 0.0, 0.0], ..Default::default() };
        let spectrum = spectra(&options);
        // At 10 ft and 3 m/s, MIL-F-8785C gives σ_w 0.3 m/s, L_w 3.048 m and the shape 0.18523.
        let (sigma_w, sigma_u) = (0.3, 0.3 / libm::pow(0.18523, 0.4));
        let (t_w, t_u) = (3.048 / 3.0, 3.048 / libm::pow(0.18523, 1.2) / 3.0);
        assert_density(&spectrum[0], |w| 4.0 * sigma_u * sigma_u * t_u / (1.0 + t_u * t_u * w * w));
        fn across(sigma: f64, t: f64, w: f64) -> f64 {
            let s = t * t * w * w;
            2.0 * sigma * sigma * t * (1.0 + 3.0 * s) / ((1.0 + s) * (1.0 + s))
        }
        assert_density(&spectrum[1], |w| across(sigma_u, t_u, w));
        assert_density(&spectrum[2], |w| across(sigma_w, t_w, w));
    }

    #[test]
    fn gusts_have_their_variance_from_the_start() {
        let options =
            AirOptions { gusts: Gusts::Dryden, wind_m_s: [0.0, 2.0, 0.0], ..Default::default() };
        let n = 20_000_u32;
        let mut square = Vector3::zeros();
        for seed in 0..n {
            let gust = Wind::new(&options, DT_S, seed.into(), 0).advance().wind_m_s;
            let gust = gust - Vector3::y() * 2.0;
            square += gust.component_mul(&gust) / f64::from(n);
        }
        let level = 0.2 / libm::pow(0.18523, 0.4);
        for (spectrum, want) in square.iter().zip([level, level, 0.2]) {
            assert!((spectrum / (want * want) - 1.0).abs() < 0.04, "{spectrum} of {}", want * want);
        }
    }

    #[test]
    fn still_air_is_still_and_a_seed_decides() {
        assert_eq!(Wind::new(&AirOptions::default(), DT_S, 1, 0).advance(), Gust::default());
        let options = indoors(GustOptions::default());
        let [first, again, other, beside] = [(1, 0), (1, 0), (2, 0), (1, 1)]
            .map(|(seed, drone)| Wind::new(&options, DT_S, seed, drone).advance());
        assert_eq!(first, again);
        assert!(first != other && first != beside);
    }
}
