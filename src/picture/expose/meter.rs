//! Light meter: the exposure of each trail relative to saturation, and the settings for a target
//! exposure.
//!
//! Input: [`LightTrace`] and [`Camera`]. Output: one [`LampReading`] for each emitter. The exposure
//! in the middle of a trail is the sum of the lamp's light nearby, computed in f64 in the same way
//! as `expose` draws it, plus the light on the drone's body around the lamp. Light from other
//! lamps, glare and ambient light are not included.

use serde::Serialize;

use super::curves::error_function;
use super::merge::{self, Segment};
use super::project::{self, Px};
use crate::light::{Fixture, Lamp, LightTrace, emitter};
use noctograph_core::camera::Camera;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::DroneIndex;
use noctograph_core::srgb::luminance;
use noctograph_core::statistics::weighted_quantile;

/// Tolerance for merging segments, which is coarse because the meter needs less detail than a
/// picture.
const MERGE_PX: f64 = 0.05;

/// Distance along or across a segment, in σ, beyond which its light is ignored.
const REACH_SIGMA: f64 = 5.0;

/// Minimum exposure of a hot spot relative to its lamp's median. Even strokes vary by about 1 stop.
const HOT_STOPS: f64 = 2.0;

/// Minimum speed of a streak in the picture, relative to the median speed of its lamp.
const STREAK_SPEED: f64 = 2.0;

/// The exposure of an emitter's trail. Stops are relative to saturation (78 / ISO lx s in ISO
/// 12232) and refer to luminance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LampReading {
    /// The drone, which is part of the name in JSON. `None` if there is only one drone.
    #[serde(skip)]
    pub drone: Option<DroneIndex>,
    /// Label of the lamp, as returned by [`Lamp::label`].
    pub name: String,
    /// Time for which the lamp is lit inside the picture.
    pub lit_s: f64,
    /// Median exposure over the length of the trail.
    pub median_stops: f64,
    /// 5th percentile of the exposure over the length of the trail.
    pub p5_stops: f64,
    /// 95th percentile of the exposure over the length of the trail.
    pub p95_stops: f64,
    /// Points at which the lamp dwells, at least two stops above the median.
    pub hot_spots: Vec<HotSpot>,
    /// Time for which the lamp is lit and moves at more than twice its median speed.
    pub streak_s: f64,
}

/// A point at which a lit lamp dwells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HotSpot {
    /// Time at which the dwell starts.
    pub time_s: f64,
    /// Duration of the dwell.
    pub duration_s: f64,
    /// Position in the picture.
    pub at_px: [f64; 2],
    /// Exposure of the brightest part.
    pub stops: f64,
}

/// Settings, any one of which would give a trail the target exposure. A setting that cannot do so
/// is `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ExposureAdvice {
    /// Aperture number.
    pub f_number: f64,
    /// ISO sensitivity. `None` below the base sensitivity, at which the full well still saturates.
    pub iso: Option<f64>,
    /// Level of the lamp relative to its present level. `None` above 1, which a lamp at full level
    /// cannot reach.
    #[serde(rename = "level_factor")]
    pub level: Option<f64>,
}

impl LampReading {
    /// Returns the range of the exposure along the trail, from the 5th to the 95th percentile.
    pub fn evenness_stops(&self) -> f64 {
        self.p95_stops - self.p5_stops
    }

    /// Adds the light of discs around the lamp, such as the illuminated body, to each quantile.
    fn with_discs_around(&self, lamp: &Lamp, readings: &[(&Lamp, Self)]) -> Self {
        let mut sum = self.clone();
        for (_, disc) in readings.iter().filter(|(disc, _)| lamp.is_within(disc)) {
            for (stops, disc_stops) in [
                (&mut sum.median_stops, disc.median_stops),
                (&mut sum.p5_stops, disc.p5_stops),
                (&mut sum.p95_stops, disc.p95_stops),
            ] {
                *stops = libm::log2(libm::exp2(*stops) + libm::exp2(disc_stops));
            }
        }
        sum
    }

    /// Returns the settings that would move the median to `target_stops`.
    pub fn advice(&self, camera: &Camera, target_stops: f64) -> ExposureAdvice {
        let change_stops = target_stops - self.median_stops;
        ExposureAdvice {
            f_number: camera.f_number * libm::exp2(-0.5 * change_stops),
            iso: Some(camera.iso.max(camera.base_iso) * libm::exp2(change_stops))
                .filter(|iso| *iso >= camera.base_iso),
            level: Some(libm::exp2(change_stops)).filter(|level| *level <= 1.0),
        }
    }
}

/// Returns a reading for each emitter of a trace, in order of first appearance. Emitters without
/// light in the picture are omitted.
///
/// # Errors
///
/// Returns the same [`Error::Input`] as [`super::expose`].
pub fn meter(trace: &LightTrace, camera: &Camera) -> Result<Vec<LampReading>> {
    super::check(trace, camera, &super::ExposeOptions::default())?;
    // A row of the emitter table whose color changes becomes several lamps with the same name.
    let mut trails: Vec<(&Lamp, Vec<Segment>)> = Vec::new();
    for lamp in &trace.lamps {
        let mut segments = visible_segments(lamp, luminance(lamp.emitter.rgb), camera);
        let trail = trails.iter_mut().find(|(other, _)| {
            other.drone == lamp.drone && other.emitter.name == lamp.emitter.name
        });
        match trail {
            Some((_, trail)) => trail.append(&mut segments),
            None => trails.push((lamp, segments)),
        }
    }
    let readings = Vec::from_iter(trails.into_iter().filter_map(|(lamp, mut segments)| {
        segments.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        Some((lamp, reading(lamp, &segments, camera)?))
    }));
    if readings.is_empty() {
        let hint = "check the lights of the flight, the shutter and the pose of the camera";
        let lack = "no lamp that is lit in the picture";
        return Err(Error::input("light", lack, "light to measure", hint));
    }
    let with_discs =
        readings.iter().map(|(lamp, reading)| reading.with_discs_around(lamp, &readings));
    Ok(with_discs.collect())
}

/// Ratio of the strongest channel to luminance above which light is colored. It is 1 for white.
const COLORED: f64 = 1.25;

/// True if the light of a lamp with all dies at full level is metered as colored, not as white.
pub fn is_colored(lamp: &Fixture) -> bool {
    is_color(emitter(lamp, &vec![1.0; lamp.dies.len()]).rgb)
}

/// True if light in linear sRGB is metered as colored instead of white.
fn is_color(rgb: [f64; 3]) -> bool {
    rgb.into_iter().fold(0.0, f64::max) > COLORED * luminance(rgb)
}

/// Returns the exposures of a lamp's brightest color and of its brightest white, for the lamp with
/// this label. Each exposure is the median over the trail in the strongest channel, in stops
/// relative to saturation, or `None` if the lamp has no such light.
pub fn color_stops(trace: &LightTrace, camera: &Camera, name: &str) -> [Option<f64>; 2] {
    [true, false].map(|colored| {
        let lamps = trace.lamps.iter().filter(|lamp| lamp.label() == name);
        let channels = lamps.map(|lamp| (lamp, lamp.emitter.rgb.into_iter().fold(0.0, f64::max)));
        let matching = channels.filter(|(lamp, _)| is_color(lamp.emitter.rgb) == colored);
        let stops = matching.filter_map(|(lamp, fraction)| {
            Some(reading(lamp, &visible_segments(lamp, fraction, camera), camera)?.median_stops)
        });
        stops.max_by(f64::total_cmp)
    })
}

/// Returns the segments of a lamp's trail inside the picture, with `fraction` of the lamp's light.
fn visible_segments(lamp: &Lamp, fraction: f64, camera: &Camera) -> Vec<Segment> {
    let mut segments = Vec::new();
    merge::merge(project::intervals(lamp, camera), fraction, MERGE_PX, &mut segments);
    segments.retain(|segment| {
        let [x, y]: [f64; 2] = segment.middle_px().into();
        (0.0..=camera.width_px.into()).contains(&x) && (0.0..=camera.height_px.into()).contains(&y)
    });
    segments
}

/// Returns the brightest light on floor and walls in stops relative to saturation, or `None` if
/// they are dark or outside the picture.
pub fn floor_stops(
    trace: &LightTrace,
    camera: &Camera,
    options: &super::ExposeOptions,
) -> Option<f64> {
    let glow = super::floor::Glow::new(trace, camera, options)?;
    Some(libm::log2(glow.peak_lx_s / camera.saturation_lx_s()))
}

/// Number of segments of a trail above which successive segments at the same point are joined.
const MANY: usize = 20_000;

/// Maximum distance between segments at the same point, in σ of the spot.
const SAME_POINT_SIGMA: f64 = 0.1;

/// Minimum weight of a segment, so that quantiles are defined for a lamp at rest, too.
const MIN_LENGTH_PX: f64 = 1e-9;

/// Maximum gap in s between two segments that follow each other without a pause.
const SAME_TIME_S: f64 = 1e-6;

/// Joins successive segments at the same point, such as the pulses of a slow lamp. However many
/// pulses there are, each is then compared with only a few others.
fn joined(segments: &[Segment]) -> Vec<Segment> {
    let mut joined: Vec<Segment> = Vec::new();
    for segment in segments {
        let last = joined.last_mut().filter(|last| {
            let distances_px = segment.ends_px.map(|end| (end - last.ends_px[0]).length());
            distances_px[0].max(distances_px[1]) < SAME_POINT_SIGMA * last.sigma_px
        });
        match last {
            Some(last) => {
                last.ends_px[1] = segment.ends_px[1];
                last.light_lx_s += segment.light_lx_s;
                last.duration_s += segment.duration_s;
            }
            None => joined.push(*segment),
        }
    }
    joined
}

/// Returns the reading of a lamp from the segments of its trail, or `None` if it has none.
fn reading(lamp: &Lamp, segments: &[Segment], camera: &Camera) -> Option<LampReading> {
    let joined = (segments.len() > MANY).then(|| joined(segments));
    let segments = joined.as_deref().unwrap_or(segments);
    let stops = (0..segments.len())
        .map(|i| libm::log2(exposure_lx_s(segments, i) / camera.saturation_lx_s()));
    let stops: Vec<f64> = stops.collect();
    // Computes the quantiles of the exposure over the length of the trail.
    let lengths = segments.iter().map(|segment| segment.length_px().max(MIN_LENGTH_PX));
    let mut weighted: Vec<(f64, f64)> = stops.iter().copied().zip(lengths).collect();
    let [p5_stops, median_stops, p95_stops] =
        [0.05, 0.5, 0.95].map(|probability| weighted_quantile(&mut weighted, probability));
    let (p5_stops, median_stops, p95_stops) = (p5_stops?, median_stops?, p95_stops?);

    // Streaks are faster than a multiple of the median speed over time.
    let speeds = segments.iter().map(|s| (s.length_px() / s.duration_s, s.duration_s));
    let mut speeds: Vec<(f64, f64)> = speeds.collect();
    let median = weighted_quantile(&mut speeds, 0.5)?;
    let streaks = speeds.iter().filter(|(speed, _)| *speed > STREAK_SPEED * median && median > 0.0);
    Some(LampReading {
        drone: lamp.drone,
        name: lamp.label(),
        lit_s: segments.iter().map(|s| s.duration_s).sum(),
        median_stops,
        p5_stops,
        p95_stops,
        hot_spots: hot_spots(segments, &stops, median_stops + HOT_STOPS),
        streak_s: streaks.fold(0.0, |sum, (_, duration_s)| sum + duration_s),
    })
}

/// Returns the parts of a trail that are brighter than a limit. A dark gap separates two parts.
fn hot_spots(segments: &[Segment], stops: &[f64], limit_stops: f64) -> Vec<HotSpot> {
    let trail: Vec<(&Segment, f64)> = segments.iter().zip(stops.iter().copied()).collect();
    let runs = trail.chunk_by(|(a, stops), (b, next_stops)| {
        stops.min(*next_stops) > limit_stops && b.start_s <= a.start_s + a.duration_s + SAME_TIME_S
    });
    let spots = runs.filter(|run| run[0].1 > limit_stops).map(|run| {
        let (first, last) = (run[0].0, run[run.len() - 1].0);
        HotSpot {
            time_s: first.start_s,
            duration_s: last.start_s + last.duration_s - first.start_s,
            at_px: first.middle_px().into(),
            stops: run.iter().map(|(_, stops)| *stops).fold(limit_stops, f64::max),
        }
    });
    spots.collect()
}

/// Returns the exposure in the middle of segment `i`, from this segment and those that adjoin it.
fn exposure_lx_s(segments: &[Segment], i: usize) -> f64 {
    let point_px = segments[i].middle_px();
    let is_near = |s: &&Segment| {
        let [start, end] = s.ends_px.map(|end| (end - point_px).length());
        start.min(end) < REACH_SIGMA * s.sigma_px + s.half_px.max_element()
    };
    let after = segments[i + 1..].iter().take_while(is_near);
    let before = segments[..i].iter().rev().take_while(is_near);
    after.chain(before).chain([&segments[i]]).map(|s| segment_lx_s(s, point_px)).sum()
}

/// Returns the exposure in lx s that a segment leaves at a point.
fn segment_lx_s(segment: &Segment, point_px: Px) -> f64 {
    let Segment { ends_px: [start, end], sigma_px: sigma, light_lx_s, .. } = *segment;
    // A segment with a half width is a blurred rectangle, because its lamp is not a point.
    if segment.half_px != Px::ZERO {
        return rectangle_lx_s(segment, point_px);
    }
    // Multiplies a Gaussian across the segment by a Gaussian averaged over the segment's length.
    let root_tau = std::f64::consts::TAU.sqrt();
    let length = segment.length_px();
    let along = if length > 0.0 { (end - start) / length } else { Px::X };
    let (u, v) = ((point_px - start).dot(along) / sigma, along.perp_dot(point_px - start) / sigma);
    let across = libm::exp(-0.5 * v * v) / (sigma * root_tau);
    // For a very short segment, the difference in the mean would lose all significant digits.
    let smear = if length > MIN_LENGTH_SIGMA * sigma {
        let [upper, lower] = [u, u - length / sigma]
            .map(|x| 0.5 * error_function(x * std::f64::consts::FRAC_1_SQRT_2));
        (upper - lower) / length
    } else {
        libm::exp(-0.5 * u * u) / (sigma * root_tau)
    };
    light_lx_s * smear * across
}

/// Returns the exposure in lx s that a blurred rectangle leaves at a point. The exposure is the
/// mean over points along the segment, one σ apart.
fn rectangle_lx_s(segment: &Segment, point_px: Px) -> f64 {
    let Segment { ends_px: [start, end], sigma_px: sigma, half_px, light_lx_s, .. } = *segment;
    #[expect(clippy::cast_possible_truncation, reason = "within 1 and 1000")]
    let n = (segment.length_px() / sigma).ceil().clamp(1.0, 1000.0) as u32;
    let offsets = (0..n).map(|i| start.lerp(end, (f64::from(i) + 0.5) / f64::from(n)) - point_px);
    let near = offsets.filter(|d| (d.abs() - half_px).max_element() < REACH_SIGMA * sigma);
    let sum: f64 =
        near.map(|d| density(d.x, half_px.x, sigma) * density(d.y, half_px.y, sigma)).sum();
    light_lx_s * sum / f64::from(n)
}

/// Returns the light per pixel at a distance from the middle of a blurred line that extends `half`
/// to either side. The whole line has a light of 1.
fn density(from_middle: f64, half: f64, sigma: f64) -> f64 {
    let half = half.max(MIN_HALF_SIGMA * sigma);
    let [lower, upper] = [from_middle - half, from_middle + half]
        .map(|x| error_function(x / sigma * std::f64::consts::FRAC_1_SQRT_2));
    (upper - lower) / (4.0 * half)
}

/// Minimum half width of a line, in σ. The blur hides any narrower line.
const MIN_HALF_SIGMA: f64 = 1e-3;

/// Minimum length of a segment, in σ, over which a Gaussian is averaged.
const MIN_LENGTH_SIGMA: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::super::tests::{camera, lamp};
    use super::*;
    use crate::light::LightTraceData;

    /// Returns the exposure in lx s of the trail of a lamp that moves perpendicular to the optical
    /// axis, spread evenly over `width_m` on the sensor: `I τ π f / (4 N² d v w)`.
    fn trail_exposure_lx_s(
        intensity_cd: f64,
        camera: &Camera,
        distance_m: f64,
        speed_m_s: f64,
        width_m: f64,
    ) -> f64 {
        let Camera { focal_length_m, f_number, transmission, .. } = camera;
        intensity_cd * transmission * std::f64::consts::PI * focal_length_m
            / (4.0 * f_number * f_number * distance_m * speed_m_s * width_m)
    }

    #[test]
    fn the_exposure_table_of_the_field_comes_out() {
        // The rows contain intensity, aperture number, exposure and stops for 35 mm, 3 m, 0.2 m/s,
        // ISO 100 and a 3 mm source, whose image is 35 µm wide.
        let table = [
            (1.8, 8.0, 33.1, 5.4),
            (1.8, 22.0, 4.38, 2.5),
            (15.4, 8.0, 283.0, 8.5),
            (1.2, 8.0, 22.0, 4.8),
            (0.4, 22.0, 0.98, 0.3),
            (0.02, 8.0, 0.37, -1.1),
        ];
        for (intensity_cd, f_number, wanted_lx_s, wanted_stops) in table {
            let camera = Camera { f_number, ..camera(640, 400) };
            let exposure_lx_s = trail_exposure_lx_s(intensity_cd, &camera, 3.0, 0.2, 35e-6);
            let error = exposure_lx_s / wanted_lx_s - 1.0;
            assert!(error.abs() < 0.01, "{intensity_cd} cd at f/{f_number}: {exposure_lx_s} lx s");
            let stops = libm::log2(exposure_lx_s / camera.saturation_lx_s());
            assert!((stops - wanted_stops).abs() < 0.06, "{intensity_cd} cd: {stops} stops");
        }
    }

    #[test]
    fn a_reading_is_the_exposure_of_a_trail_as_wide_as_its_spot() {
        let path =
            (0..=400).map(|i| (f64::from(i) / 100.0, [f64::from(i) * 0.002 - 0.4, 3.0, 0.0]));
        let lamp = lamp(path);
        let camera = Camera { blur_m: 70e-6, base_iso: 0.01, ..camera(640, 400) };
        let sigma_m =
            project::intervals(&lamp, &camera).next().unwrap().sigma_px * camera.pixel_pitch_m();
        let metered =
            meter(&LightTrace::made(LightTraceData { lamps: vec![lamp] }), &camera).unwrap();
        // An evenly bright trail with a width of √(2π) σ has the same peak as the Gaussian.
        let width_m = std::f64::consts::TAU.sqrt() * sigma_m;
        let wanted = trail_exposure_lx_s(1.8, &camera, 3.0, 0.2, width_m);
        let wanted = libm::log2(wanted / camera.saturation_lx_s());
        assert!((metered[0].median_stops - wanted).abs() < 0.02, "{metered:?}, wanted {wanted}");
        assert!(
            metered[0].hot_spots.is_empty() && metered[0].evenness_stops() < 0.2,
            "{metered:?}"
        );

        let advice = metered[0].advice(&camera, 0.0);
        assert!((advice.iso.unwrap() / 100.0 - libm::exp2(-wanted)).abs() < 0.02, "{advice:?}");
        let full_well = Camera { base_iso: 100.0, ..camera.clone() };
        assert_eq!(metered[0].advice(&full_well, 0.0).iso, None, "it would change nothing");
        assert_eq!(metered[0].advice(&camera, wanted + 1.0).level, None, "a lamp at full level");
        let stops = -2.0 * libm::log2(advice.f_number / camera.f_number);
        assert!((stops + wanted).abs() < 0.02, "{advice:?}");
    }

    #[test]
    fn a_reading_of_a_diffuser_is_what_its_stroke_has_in_the_picture() {
        use super::super::tests::diffuser;
        let camera = camera(640, 400);
        for toward in [[0.1, 0.0], [0.0, 0.1], [0.06, 0.08]] {
            let path = (0..=100).map(|i| {
                let along = f64::from(i) / 50.0 - 1.0;
                (f64::from(i) / 50.0, [along * toward[0], 3.0, along * toward[1]])
            });
            let trace = LightTrace::made(LightTraceData { lamps: vec![diffuser(lamp(path))] });
            let metered = meter(&trace, &camera).unwrap();
            let options = super::super::ExposeOptions { floor_albedo: 0.0, ..Default::default() };
            let film = super::super::project(&trace, &camera, &options).unwrap().on_cpu().film;
            // The middle of the picture is a corner between pixels.
            let middle = film.exposure_lx_s(1, 200 * 640 + 320);
            let wanted = libm::log2(middle / camera.saturation_lx_s());
            let stops = metered[0].median_stops;
            assert!((stops - wanted).abs() < 0.05, "{stops}, {wanted} toward {toward:?}");
        }
    }

    #[test]
    fn a_lamp_that_changes_its_color_is_one_row() {
        fn half(from: f64) -> Lamp {
            let mut lamp = lamp((0..=100).map(|i| {
                let t = from + f64::from(i) / 100.0;
                (t, [0.2 * t - 0.2, 3.0, 0.0])
            }));
            lamp.emitter.rgb = if from > 0.0 { [4.7, 0.0, 0.0] } else { [0.0, 1.398_210, 0.0] };
            lamp
        }
        let camera = camera(640, 400);
        let metered =
            meter(&LightTrace::made(LightTraceData { lamps: vec![half(1.0), half(0.0)] }), &camera)
                .unwrap();
        let [row] = &metered[..] else { panic!("{metered:?}") };
        assert!((row.lit_s - 2.0).abs() < 1e-9, "{row:?}");
        assert!(row.evenness_stops() < 0.3, "equally bright in both colors: {row:?}");
    }

    #[test]
    fn a_lit_dwell_is_a_hot_spot_of_7_stops() {
        let stop = |t: f64| t.min(2.0) + (t - 4.0).max(0.0);
        let path = (0..=600).map(|i| {
            let t = f64::from(i) / 100.0;
            (t, [(stop(t) - 2.0) * 0.2, 3.0, 0.0])
        });
        let metered = meter(
            &LightTrace::made(LightTraceData { lamps: vec![lamp(path)] }),
            &camera(1920, 1080),
        )
        .unwrap();
        let [spot] = metered[0].hot_spots[..] else { panic!("{metered:?}") };
        assert!((spot.time_s - 2.0).abs() < 0.1 && (spot.duration_s - 2.0).abs() < 0.2, "{spot:?}");
        let over = spot.stops - metered[0].median_stops;
        assert!((6.0..9.0).contains(&over), "{over} stops over the stroke");
    }

    #[test]
    fn dwells_on_either_side_of_the_dark_are_two_spots() {
        fn rest(from_s: f64, x: f64, moves: f64) -> impl Iterator<Item = (f64, [f64; 3])> {
            (0..=200).map(move |i| {
                let t = f64::from(i) / 100.0;
                let along = if moves > 0.0 { (t - 1.0).max(0.0) } else { t.min(1.0) };
                (from_s + t, [x + 0.2 * along, 3.0, 0.0])
            })
        }
        let mut path = lamp(rest(0.0, -0.4, -1.0).chain(rest(3.0, 0.1, 1.0)));
        for dark in &mut path.samples[200..=201] {
            dark.level = 0.0;
        }
        let metered =
            meter(&LightTrace::made(LightTraceData { lamps: vec![path] }), &camera(1920, 1080))
                .unwrap();
        let spots: Vec<f64> = metered[0].hot_spots.iter().map(|spot| spot.time_s.round()).collect();
        assert_eq!(spots, [1.0, 3.0], "{:?}", metered[0].hot_spots);
    }
}
