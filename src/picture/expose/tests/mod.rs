//! Tests of complete exposures on the CPU. The module `twins` compares the backends.

use crate::light::{Emitter, Lamp, LightSample, LightTraceData};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

use super::*;
use noctograph_core::geometry::camera_from_world;

#[cfg(feature = "gpu")]
mod twins;

/// Returns a camera at the origin that looks along y: 36 mm wide sensor, 35 mm lens at f/8.
pub(super) fn camera(width_px: u32, height_px: u32) -> Camera {
    Camera {
        position_m: Vector3::zeros(),
        camera_from_world: Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0),
        focal_length_m: 0.035,
        sensor_width_m: 0.036,
        f_number: 8.0,
        transmission: 0.9,
        blur_m: 20e-6,
        focus_m: None,
        distortion: [0.0; 4],
        vignetting: 0.0,
        white_balance: [1.0; 3],
        iso: 100.0,
        base_iso: 100.0,
        shutter_open_s: 0.0,
        shutter_close_s: 100.0,
        width_px,
        height_px,
    }
}

/// Returns a white Lambertian lamp of 1.8 cd that shines toward the camera from these positions.
pub(super) fn lamp(places: impl IntoIterator<Item = (f64, [f64; 3])>) -> Lamp {
    let emitter = Emitter {
        name: "headlight".into(),
        intensity_cd: 1.8,
        rgb: [1.0; 3],
        beam_exponent: 1.0,
        isotropic_fraction: 0.0,
        visible_cos: -1.0,
        diameter_m: 0.003,
        depth_m: None,
    };
    let sample = |(time_s, place): (f64, [f64; 3])| LightSample {
        time_s,
        position_m: place.into(),
        axis: -Vector3::y(),
        level: 1.0,
    };
    Lamp { drone: None, emitter, samples: places.into_iter().map(sample).collect() }
}

/// Returns a camera 2 m above the floor that looks straight down.
pub(super) fn looking_down() -> Camera {
    let camera_from_world = camera_from_world(Vector3::new(0.0, 1.0, -1.0));
    Camera { position_m: Vector3::z() * 2.0, camera_from_world, ..camera(320, 200) }
}

/// Returns a lamp of 1.8 cd that shines straight down from a position for 3 s.
pub(super) fn hanging(place: [f64; 3]) -> LightTrace {
    let mut lamp = lamp([(0.0, place), (3.0, place)]);
    (lamp.emitter.isotropic_fraction, lamp.emitter.visible_cos) = (0.0, 0.0);
    lamp.samples.iter_mut().for_each(|sample| sample.axis = -Vector3::z());
    LightTrace::made(LightTraceData { lamps: vec![lamp] })
}

/// Returns a Lissajous figure of 2 m with a pause, sampled at 250 Hz, 3 m from the camera.
pub(super) fn figure(n: u32) -> Lamp {
    lamp((0..n).map(|i| {
        let t = f64::from(i) / 250.0;
        let s = if t < 1.0 { t } else { (t - 0.4).max(1.0) };
        let place = [libm::sin(1.1 * s), 3.0 + 0.1 * libm::sin(0.3 * t), 0.5 * libm::cos(1.9 * s)];
        (t, place)
    }))
}

/// Puts a lamp behind an upright diffuser that shines to all sides.
pub(super) fn diffuser(mut lamp: Lamp) -> Lamp {
    let emitter = &mut lamp.emitter;
    (emitter.isotropic_fraction, emitter.diameter_m, emitter.depth_m) = (1.0, 0.06, Some(0.02));
    lamp.samples.iter_mut().for_each(|sample| sample.axis = -Vector3::z());
    lamp
}

/// Returns the latent image of lamps.
fn latent(lamps: Vec<Lamp>, camera: &Camera, tolerance_px: f64) -> Latent {
    let options = ExposeOptions {
        merge_tolerance_px: tolerance_px,
        floor_albedo: 0.0,
        ..ExposeOptions::default()
    };
    project(&LightTrace::made(LightTraceData { lamps }), camera, &options).expect("light")
}

/// Returns named scenes that all backends must expose to the same bits.
pub(super) fn scenes() -> Vec<(&'static str, Latent)> {
    // Splitmix64 gives numbers from 0 to 1 for random hops, hovers and streaks across every border.
    let mut state = 7_u64;
    let mut throw = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    };
    let mut hops = lamp((0..400).map(|i| {
        let place = [3.4 * (throw() - 0.5), 1.0 + 4.0 * throw(), 2.2 * (throw() - 0.5)];
        (f64::from(i) * 0.01, place)
    }));
    hops.emitter.rgb = [0.3, 1.1, 2.2];
    let mut red = figure(1500);
    red.emitter.rgb = [4.7, 0.0, 0.0];
    let hover = lamp([(0.0, [0.2, 3.0, 0.1]), (9.0, [0.2, 3.0, 0.1])]);
    let corner = lamp([(0.0, [-1.54, 3.0, 0.96]), (9.0, [-1.54, 3.0, 0.96])]);
    let slow = lamp((0..300).map(|i| (f64::from(i) * 0.004, [f64::from(i) * 1e-4, 3.0, 0.0])));

    let vga = camera(640, 400);
    let soft = Camera { blur_m: 900e-6, ..camera(640, 400) };
    let tall = camera(97, 1500);
    vec![
        ("random hops", latent(vec![hops.clone()], &vga, 0.005)),
        ("random hops, soft lens", latent(vec![hops.clone()], &soft, 0.0)),
        ("figures", latent(vec![red, figure(1500)], &vga, 0.005)),
        ("hover, corner, slow", latent(vec![hover, corner, slow], &vga, 0.0)),
        ("tall picture", latent(vec![hops], &tall, 0.005)),
        ("diffuser", latent(vec![diffuser(figure(1500))], &vga, 0.005)),
        ("nothing", latent(Vec::new(), &camera(33, 17), 0.005)),
    ]
}

/// Returns the film that the CPU exposes after merging at `merge_tolerance_px`.
fn film(lamps: &[Lamp], camera: &Camera, merge_tolerance_px: f64, scale: Option<i32>) -> Film {
    let options = ExposeOptions { merge_tolerance_px, ..Default::default() };
    let latent =
        project(&LightTrace::made(LightTraceData { lamps: lamps.to_vec() }), camera, &options)
            .expect("latent");
    let latent = scale.map_or(Ok(latent.clone()), |scale| latent.at_scale(scale));
    latent.expect("a coarse scale").on_cpu().film
}

/// Computes the film in a second way: each interval in f64, with erf, at every pixel within 8 σ.
fn brute_force(lamp: &Lamp, camera: &Camera) -> Vec<f64> {
    let [width, height] = [camera.width_px as usize, camera.height_px as usize];
    let mut plane = vec![0.0; width * height];
    for interval in project::intervals(lamp, camera) {
        let ([a, b], sigma) = (interval.at_px, interval.sigma_px);
        let length = (b - a).length();
        let along = if length > 0.0 { (b - a) / length } else { project::Px::X };
        let reach = 8.0 * sigma + length;
        let range = |center: f64, n: usize| {
            (0..n).filter(move |i: &usize| (*i as f64 - center).abs() <= reach)
        };
        for y in range(a.y, height) {
            for x in range(a.x, width) {
                let p = project::Px::new(x as f64 + 0.5, y as f64 + 0.5) - a;
                let (u, v) = (p.dot(along) / sigma, along.perp_dot(p) / sigma);
                let root_2 = std::f64::consts::SQRT_2;
                let bell = |x: f64| libm::exp(-0.5 * x * x) / std::f64::consts::TAU.sqrt();
                let smear = if length > 1e-6 {
                    // Integral: (a + b u) [Φ(u) - Φ(u - L)] + b [g(u) - g(u - L)], u and L in σ.
                    let [first, last] = interval.light_lx_px2;
                    let ramp = (last - first) / (last + first);
                    let (l, end) = (length / sigma, u - length / sigma);
                    let (a, b) = (1.0 - ramp, 2.0 * ramp / l);
                    let between = 0.5 * (libm::erf(u / root_2) - libm::erf(end / root_2));
                    ((a + b * u) * between + b * (bell(u) - bell(end))) / length
                } else {
                    libm::exp(-0.5 * u * u) / (sigma * std::f64::consts::TAU.sqrt())
                };
                let across = libm::exp(-0.5 * v * v) / (sigma * std::f64::consts::TAU.sqrt());
                plane[y * width + x] += interval.light() * smear * across;
            }
        }
    }
    plane
}

/// Returns the largest difference of the red plane from the reference, relative to the peak.
fn error_of_peak(film: &Film, reference: &[f64]) -> f64 {
    let peak = reference.iter().copied().fold(0.0, f64::max);
    let errors = reference.iter().enumerate().map(|(i, r)| (film.exposure_lx_s(0, i) - r).abs());
    errors.fold(0.0, f64::max) / peak
}

#[test]
fn a_lamp_at_rest_leaves_its_intensity_through_the_pupil_over_the_distance_squared() {
    let camera = camera(640, 400);
    let pupil_m2 = std::f64::consts::PI * (0.035 / 16.0) * (0.035 / 16.0);
    for place in [[0.0, 3.0, 0.0], [0.8, 2.5, 0.3], [-0.3713, 4.0, -0.2217]] {
        let exposed = film(&[lamp([(1.0, place), (3.5, place)])], &camera, 0.005, None);
        // The lamp is Lambertian and faces the camera plane, so cos θ = cos α = y / d.
        let d = Vector3::from(place).norm();
        let cos = place[1] / d;
        let lumen_s = 1.8 * cos * cos * pupil_m2 * 0.9 / (d * d) * 2.5;
        let wanted = lumen_s / (camera.pixel_pitch_m() * camera.pixel_pitch_m());
        for channel in 0..3 {
            let error = exposed.light_lx_s_px2(channel) / wanted - 1.0;
            assert!(error.abs() < 1e-6, "channel {channel} at {place:?}: off by {error:e}");
        }
    }
}

#[test]
fn a_moving_lamp_leaves_the_textbook_exposure_across_its_trail() {
    // The blur is wide enough that the lower limit of the spot's width has no effect.
    let camera = Camera { blur_m: 70e-6, ..camera(640, 400) };
    let (v, d) = (0.2, 3.0);
    let path = (0..=2000).map(|i| (f64::from(i) / 500.0, [f64::from(i) / 500.0 * v - 0.4, d, 0.0]));
    let exposed = film(&[lamp(path)], &camera, 0.0, None);

    // H w = I τ π f / (4 N² d v) is the integral of the exposure across the trail, on the axis.
    let wanted = 1.8 * 0.9 * std::f64::consts::PI * 0.035 / (4.0 * 64.0 * d * v);
    let column: Vec<f64> = (0..400).map(|y| exposed.exposure_lx_s(0, y * 640 + 320)).collect();
    let across = column.iter().sum::<f64>() * camera.pixel_pitch_m();
    assert!((across / wanted - 1.0).abs() < 2e-5, "{across} lx s m, wanted {wanted}");

    // The profile is a Gaussian of blur, diffraction, disc and pixel. The axis is between pixels.
    let pitch = camera.pixel_pitch_m();
    let square = |x: f64| x * x;
    let disc = square(0.003 * 0.035 / d / pitch) / 16.0;
    let blur = square(70e-6 / pitch) + square(0.42 * 0.55e-6 * 8.0 / pitch);
    let sigma = (disc + blur + 1.0 / 12.0).sqrt();
    let peak = wanted / pitch / (sigma * std::f64::consts::TAU.sqrt());
    for (y, value) in column.iter().enumerate() {
        let away = (y as f64 + 0.5 - 200.0) / sigma;
        let error = (value - peak * libm::exp(-0.5 * away * away)) / peak;
        assert!(error.abs() < 2e-5, "row {y} is off by {error:e} of the peak");
    }
}

/// Compares with the sum of Gaussian lamps on a 1 mm grid across a diffuser's silhouette.
#[test]
fn a_diffuser_leaves_a_stroke_as_wide_as_it_looks_from_the_camera() {
    let camera = Camera { blur_m: 60e-6, ..camera(640, 400) };
    fn streak([x, z]: [f64; 2], [by_x, by_z]: [f64; 2]) -> Lamp {
        lamp([-1.0, 1.0].map(|t| (t + 1.0, [x + t * by_x, 3.0, z + t * by_z])))
    }
    for toward in [[0.2, 0.0], [0.0, 0.2], [0.12, 0.16]] {
        let lit = film(&[diffuser(streak([0.0; 2], toward))], &camera, 0.0, None);
        let mut points = Vec::new();
        for i in 0..60 {
            for j in 0..20 {
                let at_mm = [f64::from(i) - 29.5, f64::from(j) - 9.5];
                let mut point = streak(at_mm.map(|mm| mm * 1e-3), toward);
                let emitter = &mut point.emitter;
                (emitter.diameter_m, emitter.isotropic_fraction) = (0.0, 1.0);
                emitter.intensity_cd /= 1200.0;
                points.push(point);
            }
        }
        let wanted = film(&points, &camera, 0.0, None);
        let [light, sum] = [&lit, &wanted].map(|film| film.light_lx_s_px2(1));
        assert!((light / sum - 1.0).abs() < 1e-3, "{light}, {sum}");
        let pixels = 0..640 * 400;
        let peak = pixels.clone().map(|i| wanted.exposure_lx_s(1, i)).fold(0.0, f64::max);
        let errors = pixels.map(|i| (lit.exposure_lx_s(1, i) - wanted.exposure_lx_s(1, i)).abs());
        let worst = errors.fold(0.0, f64::max) / peak;
        assert!(worst < 5e-3, "{worst} of the peak toward {toward:?}");
    }
}

#[test]
fn films_are_within_2e_5_of_the_peak_unmerged_and_1e_3_merged() {
    let streak = |from, to| lamp([(0.0, from), (4.0, to)]);
    let mut decay = figure(200);
    for sample in &mut decay.samples {
        sample.level = libm::exp(-sample.time_s / 0.05);
    }
    let mut fade = streak([-1.0, 3.0, 0.1], [0.9, 3.0, -0.2]);
    fade.samples[1].level = 0.0;
    let small = Camera { blur_m: 110e-6, ..camera(320, 200) };
    // The shutter opens after the pause, because beside a hover a trail's error is tiny.
    let large = |blur_m| Camera { blur_m, shutter_open_s: 1.41, ..camera(960, 540) };
    // A spot of half a pixel is 1.4 % brighter or fainter between the pixels than at their centers.
    let cases = [
        ("sharp figure", figure(1500), large(5e-6), [1.5e-2; 2]),
        ("soft figure", figure(1500), large(60e-6), [2e-5, 1e-3]),
        ("decay, coarsely sampled", decay, small.clone(), [2e-5, 1e-3]),
        ("fade over a long line", fade, small.clone(), [2e-5, 1e-3]),
        ("across", streak([-9.0, 3.0, -2.0], [9.0, 3.0, 2.5]), small.clone(), [2e-5; 2]),
        ("upward", streak([0.1, 3.0, -8.0], [0.2, 3.0, 8.0]), small, [2e-5; 2]),
    ];
    for (name, lamp, camera, bounds) in cases {
        let reference = brute_force(&lamp, &camera);
        for (tolerance_px, bound) in [0.0, 0.005].into_iter().zip(bounds) {
            let lamp = std::slice::from_ref(&lamp);
            let error = error_of_peak(&film(lamp, &camera, tolerance_px, None), &reference);
            println!("{name}, merged within {tolerance_px} px: {error:.2e}");
            assert!(error < bound, "{name}, merged within {tolerance_px} px: {error:e}");
        }
    }
}

#[test]
fn the_exposure_of_a_trail_is_independent_of_the_shutter_time_and_follows_the_laws() {
    fn trail(v: f64, d: f64) -> Lamp {
        lamp((0..=400).map(|i| (f64::from(i) / 100.0, [(f64::from(i) / 100.0 - 2.0) * v, d, 0.0])))
    }
    // Returns the light across the middle of the trail, in lx s m on the sensor.
    fn across(v: f64, d: f64, camera: &Camera) -> f64 {
        let exposed = film(&[trail(v, d)], camera, 0.0, None);
        let column = (0..400).map(|y| exposed.exposure_lx_s(0, y * 640 + 320));
        column.sum::<f64>() * camera.pixel_pitch_m()
    }
    let usual = Camera { blur_m: 70e-6, shutter_close_s: 4.0, ..camera(640, 400) };
    let reference = across(0.2, 3.0, &usual);
    let close = |what: &str, value: f64, factor: f64| {
        let error = value / reference / factor - 1.0;
        assert!(error.abs() < 2e-5, "{what}: off by {error:e}");
    };
    let longer = Camera { shutter_close_s: 60.0, ..usual.clone() };
    close("a longer shutter", across(0.2, 3.0, &longer), 1.0);
    let shorter = Camera { shutter_open_s: 1.0, shutter_close_s: 3.0, ..usual.clone() };
    close("a shorter shutter", across(0.2, 3.0, &shorter), 1.0);
    close("twice the speed", across(0.4, 3.0, &usual), 0.5);
    close("twice the distance", across(0.4, 6.0, &usual), 0.25);
    let stopped_down = Camera { f_number: 16.0, ..usual.clone() };
    close("twice the aperture number", across(0.2, 3.0, &stopped_down), 0.25);
    let iso = Camera { iso: 200.0, ..usual.clone() };
    assert_eq!(iso.saturation_lx_s() * 2.0, usual.saturation_lx_s(), "one stop of ISO");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..Default::default() })]

    #[test]
    fn light_is_conserved_on_any_path_inside_the_picture(
        places in proptest::collection::vec((-1.2..1.2_f64, 2.8..5.0_f64, -0.6..0.6_f64), 2..40),
        blur_m in 0.0..150e-6_f64,
        step_s in 1e-4..2.0_f64,
        rgb in [0.05..3.0_f64, 0.05..3.0, 0.05..3.0],
        merge_tolerance_px in prop_oneof![Just(0.0), Just(0.005), Just(0.5)],
    ) {
        let camera = Camera { blur_m, ..camera(640, 400) };
        let timed = places.iter().enumerate().map(|(i, p)| (i as f64 * step_s, [p.0, p.1, p.2]));
        let mut lamp = lamp(timed);
        lamp.emitter.rgb = rgb;
        let sent: f64 = project::intervals(&lamp, &camera).map(|interval| interval.light()).sum();
        let exposed = film(&[lamp], &camera, merge_tolerance_px, None);
        for (channel, fraction) in rgb.iter().enumerate() {
            let error = exposed.light_lx_s_px2(channel) / (sent * fraction) - 1.0;
            prop_assert!(error.abs() < 1e-6, "channel {} is off by {:e}", channel, error);
        }
    }
}

/// Returns the sum of two films, which must have the same scale.
fn sum(a: &Film, b: &Film) -> Vec<u32> {
    assert_eq!(a.scale_log2, b.scale_log2, "films of one scale");
    a.counts.iter().zip(&b.counts).map(|(a, b)| a + b).collect()
}

#[test]
fn light_adds_up_over_split_shutters() {
    let lamp = figure(1000);
    let exposed = |open: f64, close: f64, tolerance: f64| {
        let camera = Camera { shutter_open_s: open, shutter_close_s: close, ..camera(480, 270) };
        film(std::slice::from_ref(&lamp), &camera, tolerance, Some(-15))
    };
    // If the shutter splits at a sample and nothing is merged, integers add up exactly.
    let whole = exposed(0.0, 9.0, 0.0);
    assert!(whole.light_lx_s_px2(0) > 0.0, "there is light to split");
    assert_eq!(sum(&exposed(0.0, 1.5, 0.0), &exposed(1.5, 9.0, 0.0)), whole.counts, "unmerged");

    // If the shutter splits between samples, merged films add up to the accuracy of merging.
    let whole = exposed(0.0, 9.0, 0.005);
    let peak = whole.counts.iter().copied().max().expect("pixels");
    let parts = sum(&exposed(0.0, 1.5017, 0.005), &exposed(1.5017, 9.0, 0.005));
    let worst = parts.iter().zip(&whole.counts).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(f64::from(worst.expect("pixels")) < 1e-3 * f64::from(peak), "{worst:?} of {peak}");
}

#[test]
fn lamps_add_up_and_their_order_does_not_matter() {
    let camera = camera(480, 270);
    let (a, mut b) = (figure(700), figure(900));
    b.emitter.rgb = [0.0, 1.2, 2.0];
    for sample in &mut b.samples {
        sample.position_m.z -= 0.21;
    }
    let exposed = |lamps: &[&Lamp]| {
        film(&lamps.iter().map(|&l| l.clone()).collect::<Vec<_>>(), &camera, 0.005, Some(-16))
    };
    let both = exposed(&[&a, &b]);
    assert_eq!(both.counts, sum(&exposed(&[&a]), &exposed(&[&b])), "a and b");
    assert_eq!(both.sha256(), exposed(&[&b, &a]).sha256(), "b and a");
    assert_ne!(both.sha256(), exposed(&[&a]).sha256(), "the hash tells films apart");
}

#[test]
fn a_step_of_the_level_is_exact() {
    let place = [0.1, 3.0, 0.1];
    let mut stepped = lamp([(0.0, place), (1.0, place), (1.0, place), (3.0, place)]);
    stepped.samples[2].level = 0.25;
    stepped.samples[3].level = 0.25;
    let steady = lamp([(0.0, place), (1.5, place)]);
    let camera = camera(320, 200);
    let light = |lamp| film(&[lamp], &camera, 0.005, None).light_lx_s_px2(1);
    let ratio = light(stepped) / light(steady);
    assert!((ratio - 1.0).abs() < 1e-7, "1 s at 1 and 2 s at 0.25 are 1.5 s at 1, got {ratio}");
}

#[test]
fn no_pixel_overflows_and_few_bits_are_unused() {
    // The lamp hovers on one spot for 12,000 samples, unmerged, with a trail beside it.
    let camera = camera(320, 200);
    let hover = lamp((0..12_000).map(|i| (f64::from(i) / 250.0, [0.2, 3.0, 0.0])));
    let lamps = [hover, figure(500)];
    let sent: f64 =
        lamps.iter().flat_map(|l| project::intervals(l, &camera)).map(|i| i.light()).sum();
    let exposed = film(&lamps, &camera, 0.0, None);
    let error = exposed.light_lx_s_px2(2) / sent - 1.0;
    assert!(error.abs() < 1e-6, "an overflow would lose 2^32 counts: off by {error:e}");
    let peak = exposed.counts.iter().copied().max().expect("pixels");
    assert!(peak > 1 << 26, "peak is {peak} counts");

    let trace = LightTrace::made(LightTraceData { lamps: lamps.to_vec() });
    let latent = project(&trace, &camera, &ExposeOptions::default()).expect("latent");
    let refused = latent.at_scale(exposed.scale_log2 - 8);
    assert!(matches!(refused, Err(Error::Infeasible { .. })), "a scale that overflows is refused");
}

#[test]
fn lamps_out_of_sight_leave_no_light_and_no_panic() {
    let camera = camera(64, 48);
    let dark = [
        [[0.0, -3.0, 0.0], [0.1, -3.0, 0.0]],
        [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        [[0.0, 0.05, 0.0], [0.0, 0.0999, 0.0]],
        [[-2.0, 0.01, 0.0], [2.0, 0.01, 0.0]],
        [[1e9, 3.0, 0.0], [2e9, 3.0, 1e9]],
        [[1e300, 1e300, -1e300], [1e300, 1e308, 1e308]],
        [[f64::MAX, f64::MAX, f64::MAX], [-f64::MAX, f64::MIN_POSITIVE, 1.0]],
        [[0.0, 3.0, 5.0], [0.0, 3.0, 6.0]],
    ];
    for [a, b] in dark {
        let exposed = film(&[lamp([(0.0, a), (1.0, b)])], &camera, 0.005, None);
        assert!(exposed.counts.iter().all(|&count| count == 0), "light from {a:?} to {b:?}");
    }
    // Lines go from far outside across the picture, and along the minimum depth.
    for [a, b] in [[[-9e3, 3.0, -9e3], [9e3, 3.0, 9e3]], [[-2.0, 0.1, 0.0], [2.0, 0.1, 0.0]]] {
        let exposed = film(&[lamp([(0.0, a), (1.0, b)])], &camera, 0.005, None);
        assert!(exposed.counts.iter().any(|&count| count != 0), "no light from {a:?} to {b:?}");
    }
    // Beams that point away from the camera, and a closed shutter, leave no light.
    let mut away = figure(10);
    for sample in &mut away.samples {
        sample.axis = Vector3::new(0.0, 1.0, 0.0);
    }
    assert_eq!(film(&[away], &camera, 0.0, None).light_lx_s_px2(0), 0.0, "beam away");
    let shut = Camera { shutter_open_s: 50.0, ..camera };
    assert_eq!(film(&[figure(10)], &shut, 0.0, None).light_lx_s_px2(0), 0.0, "shutter shut");
}

#[test]
fn broken_samples_are_refused_by_lamp_and_time() {
    fn refused(spoil: fn(&mut Lamp)) -> String {
        let mut lamp = figure(10);
        spoil(&mut lamp);
        LightTrace::new(LightTraceData { lamps: vec![lamp] }).expect_err("broken").to_string()
    }
    let text = refused(|lamp| lamp.samples[5].position_m.z = f64::NAN);
    assert!(text.contains("`headlight` at 0.02 s: position"), "{text}");
    let text = refused(|lamp| lamp.samples[4].level = f64::INFINITY);
    assert!(text.contains("`headlight` at 0.016 s: level"), "{text}");
    let text = refused(|lamp| lamp.samples[3].time_s = 0.0);
    assert!(text.contains("`headlight` at 0 s: time"), "{text}");
    let text = refused(|lamp| lamp.emitter.rgb[1] = -0.1);
    assert!(text.contains("`headlight`: rgb[1]"), "{text}");
    let text = refused(|lamp| lamp.emitter.visible_cos = f64::NAN);
    assert!(
        text.contains("`headlight`: visible_cos: found NaN, wanted a number from -1"),
        "{text}"
    );

    let options = ExposeOptions::default();
    let wide = project(&LightTrace::default(), &camera(16_385, 10), &options);
    assert!(matches!(wide, Err(Error::Input { .. })), "a picture too wide is refused");

    let one_pixel = |scale_log2, counts| {
        Film::new(FilmData { width_px: 1, height_px: 1, counts: vec![1; counts], scale_log2 })
    };
    assert!(one_pixel(-20, 3).is_ok());
    let coarse = one_pixel(i32::MAX, 3).expect_err("beyond f32").to_string();
    assert!(coarse.contains("scale_log2: found 2147483647, wanted -128 to 64"), "{coarse}");
    let short = one_pixel(-20, 2).expect_err("a count is missing").to_string();
    assert!(short.contains("2 values for 1 x 1 pixels"), "{short}");
}
