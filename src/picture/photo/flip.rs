//! ꟻLIP: the difference that a person sees when flipping between two pictures (Andersson, Nilsson,
//! Akenine-Möller, Oskarsson, Åström and Fairchild 2020, "ꟻLIP: A difference evaluator for
//! alternating images", with the constants of that paper).
//!
//! Colors are filtered by the eye's contrast sensitivity at a distance (`PIXELS_PER_DEGREE`),
//! compared in Hunt-adjusted `L*a*b*` by the distance `HyAB`, and weighted by differences of edges
//! and points. 0 means equal, and 1 the largest difference (black and white, or green and blue).

use std::f32::consts::PI;
use std::iter::Sum;
use std::ops::{Add, Div, Mul};

use glam::{Mat3, Vec3};

use super::{Photo, PhotoData};
use noctograph_core::srgb;

/// Pixels per degree of visual angle: a 4K screen that is 0.7 m wide, seen from 0.7 m.
const PIXELS_PER_DEGREE: f32 = 67.0;

/// White in XYZ (D65).
const WHITE: Vec3 = Vec3::new(0.950_428_5, 1.0, 1.088_900_4);

const XYZ_FROM_RGB: Mat3 = Mat3::from_cols(
    Vec3::new(0.412_390_8, 0.212_639, 0.019_330_818),
    Vec3::new(0.357_584_33, 0.715_168_65, 0.119_194_78),
    Vec3::new(0.180_480_8, 0.072_192_32, 0.950_532_14),
);

/// Contrast sensitivity of the eye as two Gaussians `a √(π/b) exp(-π² x² / b)` with x in degrees: a
/// and b for luminance, red-green and blue-yellow.
const SENSITIVITY: [[Vec3; 2]; 2] = [
    [Vec3::new(1.0, 1.0, 34.1), Vec3::new(0.0047, 0.0053, 0.04)],
    [Vec3::new(0.0, 0.0, 13.5), Vec3::new(1e-5, 1e-5, 0.025)],
];

const COLOR_EXPONENT: f32 = 0.7;
const FEATURE_EXPONENT: f32 = 0.5;

/// Compression of large color differences: the first fraction of the largest maps to the second.
const COMPRESSED: [f32; 2] = [0.4, 0.95];

/// Width in degrees of the features that the eye detects.
const FEATURE_DEG: f32 = 0.082;

/// The difference between two pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Width of the pictures.
    pub width_px: u32,
    /// Height of the pictures.
    pub height_px: u32,
    /// ꟻLIP error of each pixel, 0 to 1, row by row from the top left.
    pub values: Vec<f32>,
}

impl Difference {
    /// Returns the mean error, 0 to 1, over pixels for whose index `mask` is true, or 0 if there
    /// are none.
    pub fn mean(&self, mask: impl Fn(usize) -> bool) -> f64 {
        let masked = self.values.iter().enumerate().filter(|(index, _)| mask(*index));
        let (n, sum) = masked.fold((0.0, 0.0), |(n, sum), (_, v)| (n + 1.0, sum + f64::from(*v)));
        if n > 0.0 { sum / n } else { 0.0 }
    }

    /// Returns a picture with colors from black over purple and orange to white, by matplotlib's
    /// color map "magma" (polynomial fit by Zucker, public domain).
    pub fn picture(&self) -> Photo {
        const FIT: [[f32; 3]; 7] = [
            [-0.002_136_5, -0.000_749_7, -0.005_386_1],
            [0.251_660_5, 0.677_523_2, 2.494_026_6],
            [8.353_717, -3.577_719_5, 0.314_467_9],
            [-27.668_733, 14.264_731, -13.649_213],
            [52.176_14, -27.943_606, 12.944_169],
            [-50.768_525, 29.046_583, 4.234_153],
            [18.655_705, -11.489_774, -5.601_961_5],
        ];
        #[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
        let rgb8 = self.values.iter().flat_map(|value| {
            // Evaluates the polynomial by Horner's rule.
            let color = FIT.iter().rev().fold(Vec3::ZERO, |sum, k| sum * value + Vec3::from(*k));
            color.to_array().map(|channel| (channel.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
        });
        let (width_px, height_px) = (self.width_px, self.height_px);
        let rgb8 = rgb8.collect();
        Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None })
    }
}

/// Returns the difference between two pictures of the same size.
///
/// # Panics
///
/// Panics if the sizes differ.
pub fn difference(a: &Photo, b: &Photo) -> Difference {
    let size = [a.width_px, a.height_px];
    assert_eq!(size, [b.width_px, b.height_px], "pictures of one size");
    let [a, b] = [Perceived::new(a), Perceived::new(b)];
    // The largest difference, that between green and blue, scales the compression.
    let [green, blue] = [Vec3::Y, Vec3::Z].map(|rgb| hunt_lab(XYZ_FROM_RGB * rgb));
    let largest = libm::powf(hyab(green, blue), COLOR_EXPONENT);
    let values = (0..a.lab.len()).map(|i| {
        let color = compressed(libm::powf(hyab(a.lab[i], b.lab[i]), COLOR_EXPONENT), largest);
        let edge = (a.edges.values[i] - b.edges.values[i]).abs();
        let point = (a.points.values[i] - b.points.values[i]).abs();
        let feature = edge.max(point) / std::f32::consts::SQRT_2;
        libm::powf(color, 1.0 - libm::powf(feature, FEATURE_EXPONENT))
    });
    let values = values.collect();
    Difference { width_px: size[0], height_px: size[1], values }
}

/// Values of all pixels, row by row: a gray picture, or one with three channels.
#[derive(Clone, Debug)]
struct Plane<T> {
    width: usize,
    values: Vec<T>,
}

/// A picture as the eye perceives it.
struct Perceived {
    /// Hunt-adjusted `L*`, `a*` and `b*`.
    lab: Vec<Vec3>,
    edges: Plane<f32>,
    points: Plane<f32>,
}

impl Perceived {
    /// Filters a picture's colors, and detects its edges and points.
    fn new(photo: &Photo) -> Self {
        let width = photo.width_px as usize;
        let light = srgb::linear_from_level();
        let opponent = photo.rgb8.as_chunks::<3>().0.iter().map(|pixel| {
            let rgb = Vec3::from(pixel.map(|level| light[usize::from(level)]));
            opponent_from_xyz(XYZ_FROM_RGB * rgb)
        });
        // Features are detected in unfiltered luminance, and colors are filtered in linear light.
        let opponent = Plane { width, values: opponent.collect() };
        let gray = opponent.values.iter().map(|color| (color.x + 16.0) / 116.0);
        let [edges, points] = Plane { width, values: gray.collect() }.features();
        let rgb_from_xyz = XYZ_FROM_RGB.inverse();
        let lab = opponent.filtered().values.into_iter().map(|color| {
            let rgb = rgb_from_xyz * xyz_from_opponent(color);
            hunt_lab(XYZ_FROM_RGB * rgb.clamp(Vec3::ZERO, Vec3::ONE))
        });
        Self { lab: lab.collect(), edges, points }
    }
}

impl Plane<Vec3> {
    /// Returns the colors filtered by the contrast sensitivity of the eye, a sum of two separable
    /// Gaussians.
    fn filtered(&self) -> Self {
        // All channels use the radius of three standard deviations of the widest Gaussian, as in
        // the paper's reference program.
        let widest = SENSITIVITY.iter().map(|[_, b]| b.max_element()).fold(0.0, f32::max);
        let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil();
        let [(first, mut out), (second, wide)] = SENSITIVITY.map(|[a, b]| {
            let exponentials = kernel(radius, |x| b.map(|b| libm::expf(-PI * PI * x * x / b)));
            // The factor a √(π/b) is applied only once, not for each axis.
            let area: Vec3 = exponentials.iter().sum();
            let bell = unit(exponentials);
            (a * b.map(|b| (PI / b).sqrt()) * area * area, self.along_x(&bell).along_y(&bell))
        });
        for (out, wide) in out.values.iter_mut().zip(wide.values) {
            *out = (first * *out + second * wide) / (first + second);
        }
        out
    }
}

impl Plane<f32> {
    /// Returns the strengths of edges and of points, 0 to 1, which are detected by the first and
    /// the second derivative of a Gaussian, respectively.
    fn features(&self) -> [Self; 2] {
        let sigma = 0.5 * FEATURE_DEG * PIXELS_PER_DEGREE;
        let radius = (3.0 * sigma).ceil();
        // The functions below expect pixels, but `kernel` passes degrees.
        let in_px = |f: &dyn Fn(f32) -> f32| kernel(radius, |x| f(x * PIXELS_PER_DEGREE));
        let bell = |x: f32| libm::expf(-x * x / (2.0 * sigma * sigma));
        let flat = unit(in_px(&bell));
        let edge = balanced(in_px(&|x| -x * bell(x)));
        let point = balanced(in_px(&|x| (x * x / (sigma * sigma) - 1.0) * bell(x)));
        [edge, point].map(|across| {
            let x = self.along_x(&across).along_y(&flat);
            let y = self.along_y(&across).along_x(&flat);
            let strength = x.values.iter().zip(&y.values).map(|(x, y)| (x * x + y * y).sqrt());
            Self { width: self.width, values: strength.collect() }
        })
    }
}

impl<T: Copy + Default + Add<Output = T> + Mul<Output = T>> Plane<T> {
    /// Convolves rows with a kernel. Pixels beyond the border repeat the border pixel.
    fn along_x(&self, kernel: &[T]) -> Self {
        let radius = kernel.len() / 2;
        let mut padded = Vec::new();
        let mut values = Vec::with_capacity(self.values.len());
        for row in self.values.chunks_exact(self.width) {
            padded.clear();
            padded.extend(std::iter::repeat_n(row[0], radius));
            padded.extend_from_slice(row);
            padded.extend(std::iter::repeat_n(row[self.width - 1], radius));
            values.extend(padded.windows(kernel.len()).map(|window| {
                let products = window.iter().zip(kernel).map(|(value, weight)| *value * *weight);
                products.fold(T::default(), T::add)
            }));
        }
        Self { width: self.width, values }
    }

    /// Convolves columns with a kernel. Pixels beyond the border repeat the border pixel.
    fn along_y(&self, kernel: &[T]) -> Self {
        let radius = (kernel.len() / 2).cast_signed();
        let height = (self.values.len() / self.width).cast_signed();
        let mut values = vec![T::default(); self.values.len()];
        for (y, out) in (0..height).zip(values.chunks_exact_mut(self.width)) {
            for (k, weight) in (-radius..).zip(kernel) {
                let from = (y + k).clamp(0, height - 1).cast_unsigned() * self.width;
                for (out, value) in out.iter_mut().zip(&self.values[from..]) {
                    *out = *out + *weight * *value;
                }
            }
        }
        Self { width: self.width, values }
    }
}

/// Returns the values of a function of degrees of the field of view at whole pixels from `-radius`
/// to `radius`.
fn kernel<T>(radius: f32, value: impl Fn(f32) -> T) -> Vec<T> {
    #[expect(clippy::cast_possible_truncation, reason = "some ten pixels")]
    let radius = radius as i32;
    (-radius..=radius).map(|px| value(px as f32 / PIXELS_PER_DEGREE)).collect()
}

/// Scales a kernel so that its sum is 1.
fn unit<T: Copy + Sum + Div<Output = T>>(kernel: Vec<T>) -> Vec<T> {
    let sum: T = kernel.iter().copied().sum();
    kernel.into_iter().map(|value| value / sum).collect()
}

/// Scales the positive values of a kernel to a sum of 1, and the negative ones to a sum of -1.
fn balanced(mut kernel: Vec<f32>) -> Vec<f32> {
    let [positive, negative] =
        [1.0, -1.0].map(|sign| kernel.iter().map(|v| (sign * v).max(0.0)).sum::<f32>());
    kernel.iter_mut().for_each(|value| *value /= if *value > 0.0 { positive } else { negative });
    kernel
}

/// Converts XYZ to `YCxCz`, which is `L*a*b*` without the cube roots. The constants are those of
/// CIE 1976.
fn opponent_from_xyz(xyz: Vec3) -> Vec3 {
    let Vec3 { x, y, z } = xyz / WHITE;
    Vec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// Converts `YCxCz` to XYZ, as the inverse of [`opponent_from_xyz`].
fn xyz_from_opponent(color: Vec3) -> Vec3 {
    let y = (color.x + 16.0) / 116.0;
    Vec3::new(y + color.y / 500.0, y, y - color.z / 200.0) * WHITE
}

/// Converts XYZ to `L*a*b*` with less colorfulness at lower lightness (Hunt effect).
fn hunt_lab(xyz: Vec3) -> Vec3 {
    // CIE 1976: a cube root above δ³, and a straight line below.
    let delta = 6.0_f32 / 29.0;
    let Vec3 { x, y, z } = (xyz / WHITE).map(|value| match value {
        value if value > delta * delta * delta => libm::cbrtf(value),
        value => value / (3.0 * delta * delta) + 4.0 / 29.0,
    });
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    Vec3::new(lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z))
}

/// Returns the distance `HyAB` between two colors in `L*a*b*`.
fn hyab(a: Vec3, b: Vec3) -> f32 {
    (a.x - b.x).abs() + libm::hypotf(a.y - b.y, a.z - b.z)
}

/// Maps a color difference up to `largest` to the range 0 to 1, and compresses its upper part.
fn compressed(difference: f32, largest: f32) -> f32 {
    let [from, to] = COMPRESSED;
    let knee = from * largest;
    if difference < knee {
        to / knee * difference
    } else {
        to + (difference - knee) / (largest - knee) * (1.0 - to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 3]) -> Photo {
        let rgb8 = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let rgb8 = rgb8.flat_map(|(x, y)| pixel(x, y)).collect();
        Photo::made(PhotoData { width_px: width, height_px: height, rgb8, scene_toml: None })
    }

    fn drawing(shift: u32) -> Photo {
        picture(96, 64, |x, y| {
            let (x, y) = (x + shift, y);
            if (2 * y).abs_diff(x) < 4 {
                [255, 250, 240]
            } else if x.abs_diff(70) < 2 && y.abs_diff(12) < 2 {
                [250, 40, 20]
            } else if y > 48 {
                [level(x * 2), level(y * 3), level(255 - x * 2)]
            } else if x > 60 && y > 24 {
                if (x / 3 + y / 3).is_multiple_of(2) { [20, 60, 200] } else { [10, 10, 12] }
            } else {
                [8, 7, 6]
            }
        })
    }

    fn level(value: u32) -> u8 {
        u8::try_from(value.min(255)).unwrap()
    }

    #[test]
    fn mean_errors_are_those_of_flip_evaluator() {
        // Expected: flip-evaluator 1.7, evaluate(a, b, "LDR", inputsRGB=True), 67 px per degree.
        for (name, a, b, wanted) in [
            ("shifted", drawing(0), drawing(3), 0.186_907),
            ("dark", drawing(0), picture(96, 64, |_, _| [0, 0, 0]), 0.532_208),
            (
                "green and blue",
                picture(96, 64, |_, _| [0, 255, 0]),
                picture(96, 64, |_, _| [0, 0, 255]),
                1.0,
            ),
        ] {
            let mean = difference(&a, &b).mean(|_| true);
            assert!((mean - wanted).abs() < 2e-4, "{name}: {mean}, wanted {wanted}");
        }
    }

    #[test]
    fn it_is_symmetric_and_zero_for_equal_pictures() {
        let (a, b) = (drawing(0), drawing(5));
        assert!(difference(&a, &a).values.iter().all(|value| *value == 0.0));
        let [there, back] = [difference(&a, &b), difference(&b, &a)];
        for (there, back) in there.values.iter().zip(&back.values) {
            assert!((there - back).abs() < 1e-5 && (0.0..=1.0).contains(there));
        }
    }

    #[test]
    fn one_pixel_differs_at_its_place() {
        let mut changed = drawing(0);
        let index = (20 * 96 + 10) * 3;
        changed.edit(|changed| changed.rgb8[index..index + 3].copy_from_slice(&[90, 90, 90]));
        let map = difference(&drawing(0), &changed);
        let brightest = (0..96 * 64).max_by(|a, b| map.values[*a].total_cmp(&map.values[*b]));
        assert_eq!(brightest, Some(20 * 96 + 10));
    }
}
