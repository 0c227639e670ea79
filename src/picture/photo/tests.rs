//! Tests of the processing from film to photo.

use super::noise::{POISSON, Source, Stream};
use super::*;
use crate::expose::FilmData;
use noctograph_core::camera::CameraOptions;
use noctograph_core::error::Result;
use noctograph_core::srgb;

/// Returns the developed readout of a film in a room without walls.
fn develop(film: &Film, camera: &Camera, options: &PhotoOptions, seed: u64) -> Result<Photo> {
    super::develop(film, camera, &ExposeOptions::default(), options, seed)
}

fn read_out(film: &Film, camera: &Camera, options: &PhotoOptions, seed: u64) -> Result<Readout> {
    super::read_out(film, camera, &ExposeOptions::default(), options, seed)
}

fn camera(size_px: [u32; 2], change: impl FnOnce(&mut CameraOptions)) -> Camera {
    let mut options = CameraOptions::default();
    [options.width_px, options.height_px] = size_px;
    change(&mut options);
    options.camera([0.0, 0.5, 1.0, 1.0], 10.0).unwrap()
}

/// Returns a film whose unit of counts is 2^-20 lx s.
fn film([width_px, height_px]: [u32; 2], count: impl Fn(usize, usize, usize) -> u32) -> Film {
    let (width, height) = (width_px as usize, height_px as usize);
    let rows =
        (0..3 * height).flat_map(|row| (0..width).map(move |x| (row / height, x, row % height)));
    let counts = rows.map(|(channel, x, y)| count(channel, x, y)).collect();
    Film::made(FilmData { width_px, height_px, counts, scale_log2: -20 })
}

#[expect(clippy::cast_possible_truncation, reason = "far below u32::MAX")]
fn count(share_of_saturation: f64) -> u32 {
    (share_of_saturation * 0.78 * libm::exp2(20.0)) as u32
}

fn random(x: usize, y: usize) -> u32 {
    Stream::new(5, y, 0, Source::Shot).bits(u32::try_from(x).unwrap())
}

/// Returns a film that shows a thin trail and some dots on a dark background.
fn drawing(size_px: [u32; 2]) -> Film {
    film(size_px, |channel, x, y| match (x + 2 * y) % 97 {
        0 => count(8.0) >> channel,
        40 if random(x, y).is_multiple_of(10) => count(2000.0),
        _ => 0,
    })
}

fn rgb8(film: &Film, camera: &Camera, options: &PhotoOptions) -> Vec<u8> {
    develop(film, camera, options, 0).unwrap().into_data().rgb8
}

fn electrons_only() -> PhotoOptions {
    noisy(|_| {})
}

/// Returns options with read noise and all noise that `change` adds.
fn noisy(change: impl FnOnce(&mut SensorNoise)) -> PhotoOptions {
    let mut noise = SensorNoise {
        response: [1.0; 3],
        dark_current_e_s: 0.0,
        prnu_frac: 0.0,
        hot_pixel_frac: 0.0,
        ..SensorNoise::default()
    };
    change(&mut noise);
    PhotoOptions { noise: Noise::Emva1288(noise), ..PhotoOptions::plain() }
}

#[test]
fn with_all_effects_off_the_sensor_clips_and_the_curve_is_srgb() {
    let camera = camera([64, 33], |_| {});
    let film = film([64, 33], |channel, x, y| random(x, y) >> ((3 * channel + x + y) % 32));
    // Computes the smallest integer count that reaches each level.
    let thresholds: Vec<u32> = (0..255)
        .map(|level| {
            let light = srgb::linear_from_encoded((f64::from(level) + 0.5) / 255.0);
            #[expect(clippy::cast_possible_truncation, reason = "counts")]
            let count = (light * 0.78 * libm::exp2(20.0)).ceil() as u32;
            count
        })
        .collect();
    let photo = rgb8(&film, &camera, &PhotoOptions::plain());
    for (index, level) in photo.iter().enumerate() {
        let count = film.counts[index % 3 * 64 * 33 + index / 3];
        let wanted = thresholds.partition_point(|threshold| *threshold <= count);
        assert_eq!(usize::from(*level), wanted, "count {count}");
    }
}

#[test]
fn one_stop_of_iso_is_one_stop_of_light() {
    let bright = film([64, 9], |_, x, y| 2 * (random(x, y) >> 12));
    let dark = Film::made(FilmData {
        counts: bright.counts.iter().map(|c| c / 2).collect(),
        ..bright.clone().into_data()
    });
    for tone in [Tone::Camera, Tone::Neutral, Tone::Linear] {
        let options = PhotoOptions { tone, crosstalk: true, ..PhotoOptions::plain() };
        let at_100 = rgb8(&bright, &camera([64, 9], |c| c.iso = 100.0), &options);
        let at_200 = rgb8(&dark, &camera([64, 9], |c| c.iso = 200.0), &options);
        assert_eq!(at_100, at_200);
        assert_ne!(at_100, rgb8(&dark, &camera([64, 9], |c| c.iso = 100.0), &options));
    }
}

#[test]
fn the_lens_keeps_every_count() {
    for size_px in [[1, 1], [5, 3], [67, 45], [256, 144], [640, 361]] {
        let film = drawing(size_px);
        let camera = camera(size_px, |c| c.f_number = 11.0);
        let options = PhotoOptions { glare_frac: 0.3, ..PhotoOptions::default() };
        let glare = Glare::new(&film, &camera, &options);
        let spikes = starburst(&film, &camera, 7);
        assert_eq!(glare.is_some(), size_px[1] >= 8, "{size_px:?}");
        assert!(!spikes.is_empty() || size_px[1] < 100, "{size_px:?}");
        let lens = Lens { film: &film, glare, spikes };
        let (mut scratch, mut row) = (Vec::new(), vec![0; size_px[0] as usize]);
        let (mut moved, pixels) = (0, film.counts.len() / 3);
        for channel in 0..3 {
            let mut sum = 0_u64;
            for y in 0..size_px[1] as usize {
                lens.row(channel, y, &mut scratch, &mut row);
                sum += row.iter().map(|count| u64::from(*count)).sum::<u64>();
                let before = &film.counts[channel * pixels + y * row.len()..][..row.len()];
                moved += before.iter().zip(&row).filter(|(a, b)| a != b).count();
            }
            let before = &film.counts[channel * pixels..][..pixels];
            assert_eq!(sum, before.iter().map(|c| u64::from(*c)).sum::<u64>(), "{size_px:?}");
        }
        assert!(moved > 0 || size_px[1] < 8, "{size_px:?}: the lens did nothing");
    }
}

#[test]
fn glare_has_the_share_and_the_slope_of_the_scatter() {
    let size_px = [1024, 1024];
    let film = film(size_px, |_, x, y| if (x, y) == (512, 512) { 1 << 31 } else { 0 });
    let camera = camera(size_px, |_| {});
    let radius_px = 2.0;
    for (glare_exponent, tolerance) in [(1.1, 0.1), (1.6, 0.3)] {
        let glare_radius_m = radius_px * camera.pixel_pitch_m();
        let options = PhotoOptions {
            glare_frac: 0.05,
            glare_radius_m,
            glare_exponent,
            ..PhotoOptions::plain()
        };
        let glare = Glare::new(&film, &camera, &options).unwrap();
        let lens = Lens { film: &film, glare: Some(glare), spikes: Vec::new() };
        let (mut scratch, mut row) = (Vec::new(), vec![0; 1024]);
        let mut beyond = [0.0; 3];
        for y in 0..1024 {
            lens.row(1, y, &mut scratch, &mut row);
            for (x, count) in row.iter().enumerate() {
                let r = libm::hypot(x as f64 - 512.0, y as f64 - 512.0);
                for (sum, radius) in beyond.iter_mut().zip([10.0, 40.0, 160.0]) {
                    *sum += if r > radius { f64::from(*count) / libm::exp2(31.0) } else { 0.0 };
                }
            }
        }
        let within =
            |r: f64| 1.0 - libm::pow(1.0 + r * r / (radius_px * radius_px), 1.0 - glare_exponent);
        for (sum, radius) in beyond.into_iter().zip([10.0, 40.0, 160.0]) {
            let wanted = 0.05 * (1.0 - within(radius) / within(1448.0));
            let error = sum / wanted - 1.0;
            assert!(error.abs() < tolerance, "{sum} beyond {radius} px, wanted {wanted}");
        }
    }
}

#[test]
fn spikes_are_where_a_lamp_dwells_and_not_along_a_trail() {
    let size_px = [400, 300];
    let camera = camera(size_px, |c| c.f_number = 16.0);
    let spikes = |film: &Film, blades| starburst(film, &camera, blades);
    let trail = film(size_px, |_, x, y| if x.abs_diff(y) < 3 { count(40.0) } else { 0 });
    assert!(spikes(&trail, 7).is_empty(), "a trail");
    let dwell = film(size_px, |_, x, y| {
        if x.abs_diff(200) < 3 && y.abs_diff(150) < 3 {
            count(400.0)
        } else {
            trail.counts[y * 400 + x]
        }
    });
    for (blades, wanted) in [(7, 14), (6, 6)] {
        let changes = spikes(&dwell, blades);
        // By direction, the light in a ring around the point has its peaks at the spikes.
        let mut around = [0; 120];
        for change in &changes {
            let x = (change.index % 400) as f64 - 200.0;
            let y = (change.index / 400) as f64 - 150.0;
            if (60.0..90.0).contains(&libm::hypot(x, y)) {
                let turns = libm::atan2(y, x) / std::f64::consts::TAU + 0.5;
                #[expect(clippy::cast_possible_truncation, reason = "a fraction of 120")]
                let direction = (turns * 119.999) as usize;
                around[direction] += change.counts[1];
            }
        }
        let half = around.iter().max().unwrap() / 4;
        let rises = (0..120).filter(|i| around[*i] > half && around[(*i + 119) % 120] <= half);
        let number = rises.count();
        assert_eq!(number, wanted, "{number} spikes of {blades} blades");
    }
}

#[test]
fn an_overexposed_color_turns_white_and_others_stay() {
    let options = PhotoOptions { crosstalk: true, ..PhotoOptions::plain() };
    let film = film([2, 1], |channel, x, _| count([[0.0, 0.1, 0.5], [0.0, 5.0, 50.0]][x][channel]));
    let readout = read_out(&film, &camera([2, 1], |_| {}), &options, 0).unwrap();
    for (value, wanted) in readout.rgb[..3].iter().zip([0.0, 0.1, 0.5]) {
        assert!((value - wanted).abs() < 1e-5, "{:?}", &readout.rgb[..3]);
    }
    assert!(readout.rgb[3..].iter().all(|value| *value > 0.9), "{:?}", &readout.rgb[3..]);
}

/// Returns the mean and the variance, in electrons, of the sensor's readout of uniform light.
fn statistics(options: &PhotoOptions, electrons: f64) -> (f64, f64) {
    let film = film([1000, 700], |_, _, _| count(electrons / 50_000.0));
    let rgb = read_out(&film, &camera([1000, 700], |_| {}), options, 3).unwrap().rgb;
    let values = || rgb.iter().map(|value| f64::from(*value) * 50_000.0);
    let mean = values().sum::<f64>() / rgb.len() as f64;
    (mean, values().map(|v| (v - mean) * (v - mean)).sum::<f64>() / rgb.len() as f64)
}

#[test]
fn photon_transfer_has_the_slope_of_electrons_and_the_offset_of_reading() {
    let options = noisy(|noise| noise.read_noise_e = 6.0);
    let points: Vec<(f64, f64)> =
        [2.0, 10.0, 24.0, 30.0, 200.0, 900.0].map(|e| statistics(&options, e)).into();
    for (mean, variance) in &points {
        assert!((variance / (mean + 36.0) - 1.0).abs() < 0.005, "{variance} at {mean}");
    }
    let n = points.len() as f64;
    let [x, y] = [0, 1].map(|i| points.iter().map(|p| [p.0, p.1][i]).sum::<f64>() / n);
    let along: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    let slope = along / points.iter().map(|p| (p.0 - x) * (p.0 - x)).sum::<f64>();
    assert!((slope - 1.0).abs() < 0.005, "slope {slope}");
    let offset = y - slope * x;
    assert!((offset - 36.0).abs() < 0.4, "offset {offset}");
}

#[test]
fn nonuniform_gain_adds_its_square() {
    let options = noisy(|noise| (noise.prnu_frac, noise.read_noise_e) = (0.02, 0.0));
    let (mean, variance) = statistics(&options, 20_000.0);
    let wanted = mean + (0.02 * mean) * (0.02 * mean);
    assert!((variance / wanted - 1.0).abs() < 0.005, "{variance} for {wanted}");
}

#[test]
fn blocks_of_even_light_pass_the_z_test() {
    // Compares the means of 2,000 blocks of 100 pixels. Šidák's bound for 1 % over all is 4.42 σ.
    for electrons in [4.0, 60.0, 4000.0] {
        let options = noisy(|noise| noise.read_noise_e = 2.0);
        let film = film([1000, 200], |_, _, _| count(electrons / 50_000.0));
        let mean = f64::from(film.counts[0]) / (0.78 * libm::exp2(20.0)) * 50_000.0;
        let rgb = read_out(&film, &camera([1000, 200], |_| {}), &options, 8).unwrap().rgb;
        let green: Vec<f64> = rgb.chunks(3).map(|p| f64::from(p[1]) * 50_000.0).collect();
        let z: Vec<f64> = green
            .chunks(100)
            .map(|block| block.iter().sum::<f64>() / 100.0 - mean)
            .map(|deviation| deviation / ((mean + 4.0) / 100.0).sqrt())
            .collect();
        let accepted = z.iter().filter(|z| z.abs() < 4.42).count();
        assert!(accepted as f64 >= 0.9975 * z.len() as f64, "{accepted} at {electrons} e-");
        let spread = z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
        assert!((spread - 1.0).abs() < 0.13, "neighbors are not independent: {spread}");
    }
}

#[test]
fn few_electrons_are_poisson() {
    let mean = 3.7_f32;
    let n = 400_000;
    let mut histogram = [0_u32; 40];
    let stream = Stream::new(1, 0, 0, Source::Shot);
    for x in 0..n {
        #[expect(clippy::cast_possible_truncation, reason = "few")]
        let [number] = POISSON.numbers([mean], [stream.bits(x)]).map(|number| number as usize);
        histogram[number.min(39)] += 1;
    }
    let mut fraction = libm::exp(-f64::from(mean));
    let mut chi_sq = 0.0;
    for (number, count) in histogram.iter().enumerate().take(13) {
        let wanted = fraction * f64::from(n);
        chi_sq += (f64::from(*count) - wanted) * (f64::from(*count) - wanted) / wanted;
        fraction *= f64::from(mean) / (number + 1) as f64;
    }
    assert!(chi_sq < 34.5, "χ² of 13 bins is {chi_sq}, 99.9 % are below 34.5");
}

#[test]
fn a_full_well_clips() {
    fn fraction(electrons: f64) -> f64 {
        let film = film([500, 400], |_, _, _| count(electrons / 50_000.0));
        let options = electrons_only();
        let rgb = read_out(&film, &camera([500, 400], |_| {}), &options, 2).unwrap().rgb;
        assert!(rgb.iter().all(|value| *value <= 1.0));
        rgb.iter().filter(|value| **value == 1.0).count() as f64 / rgb.len() as f64
    }
    // σ is √50000 = 223.6 electrons, so that 84.1 % clip at one σ above the full well.
    assert!((fraction(50_223.6) - 0.8413).abs() < 0.003, "{}", fraction(50_223.6));
    assert!((fraction(50_000.0) - 0.5).abs() < 0.003, "{}", fraction(50_000.0));
    assert_eq!(fraction(55_000.0), 1.0);
    assert_eq!(fraction(48_000.0), 0.0);
}

#[test]
fn hot_pixels_are_white_and_have_their_density_and_mean() {
    let options = noisy(|noise| {
        (noise.hot_pixel_frac, noise.read_noise_e) = (1e-3, 1.0);
    });
    let film = film([1000, 1000], |_, _, _| 0);
    let rgb = read_out(&film, &camera([1000, 1000], |_| {}), &options, 4).unwrap().rgb;
    // The distribution is exponential with a mean of 100 e-/s · 10 s, so exp(-0.1) of 1,000 hot
    // pixels are above 100 e-.
    fn electrons(value: f32) -> f64 {
        f64::from(value) * 50_000.0
    }
    let hot = Vec::from_iter(rgb.as_chunks::<3>().0.iter().filter(|rgb| electrons(rgb[1]) > 100.0));
    for [red, green, _] in &hot {
        let [red, green] = [*red, *green].map(electrons);
        assert!((red - green).abs() < 6.0 * (2.0 * green).sqrt(), "{red} and {green}");
    }
    let (number, sum) = (hot.len() as f64, hot.iter().map(|rgb| electrons(rgb[1])).sum::<f64>());
    let wanted = 1000.0 * libm::exp(-0.1);
    assert!((number - wanted).abs() < 4.0 * wanted.sqrt(), "{number} for {wanted}");
    assert!((sum / number - 1100.0).abs() < 4.0 * 1000.0 / number.sqrt(), "{}", sum / number);
}

/// Tests that four photosites of a sensor and one pixel of a print have the same mean and variance,
/// whether photons, reading, dark current, uneven gain or hot photosites dominate.
#[test]
fn a_print_has_the_noise_of_the_photosites_that_its_dots_stand_for() {
    let sensor = SensorNoise {
        read_noise_e: 30.0,
        dark_current_e_s: 20.0,
        prnu_frac: 0.02,
        hot_pixel_frac: 2e-3,
        ..SensorNoise::default()
    };
    fn mean_and_variance(side: u32, noise: &SensorNoise, light: f64) -> (f64, f64) {
        let (size_px, block) = ([side; 2], side as usize / 200);
        let options =
            PhotoOptions { noise: Noise::Emva1288(noise.clone()), ..PhotoOptions::plain() };
        let film = film(size_px, |_, _, _| count(light));
        let rgb = read_out(&film, &camera(size_px, |_| {}), &options, 1).unwrap().rgb;
        let side = side as usize;
        let blocks = Vec::from_iter((0..40_000).map(|i: usize| {
            let (x, y) = (block * (i % 200), block * (i / 200));
            let pixels = (0..block * block).map(|j| 3 * ((y + j / block) * side + x + j % block));
            pixels.map(|index| f64::from(rgb[index + 1])).sum::<f64>() / (block * block) as f64
        }));
        let mean = blocks.iter().sum::<f64>() / 4e4;
        (mean, blocks.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / 4e4)
    }
    for light in [0.0, 0.02, 0.5] {
        let (mean, variance) = mean_and_variance(400, &sensor, light);
        let (print, spread) = mean_and_variance(200, &sensor.resampled(4.0), light);
        assert!((mean - print).abs() < 0.02 * variance.sqrt() + 1e-4, "{light}: {mean}, {print}");
        assert!((spread / variance - 1.0).abs() < 0.08, "{light}: {spread} and {variance}");
    }
    assert_eq!(sensor.resampled(1.0), sensor);
}

#[test]
fn room_light_follows_luminance_time_and_aperture() {
    let options =
        PhotoOptions { ambient_cd_m2: 0.05, ambient_rgb: [1.0; 3], ..PhotoOptions::plain() };
    let dark = film([3, 3], |_, _, _| 0);
    let light = |change: fn(&mut CameraOptions)| {
        read_out(&dark, &camera([3, 3], change), &options, 0).unwrap().rgb[3 * 4]
    };
    // The light at the center is π τ L t / (4 N²), or 0.7854 · 0.9 · 0.05 · 10 / 64 / 0.78.
    let at_8 = light(|_| {});
    assert!((at_8 - 0.007_080).abs() < 1e-5, "{at_8}");
    let stops = options.ambient_stops(&camera([3, 3], |_| {})).unwrap();
    assert!((stops - libm::log2(f64::from(at_8))).abs() < 1e-3, "the meter's {stops} stops");
    let before = PhotoOptions { background: "room.png".into(), ..options.clone() };
    assert_eq!(before.ambient_stops(&camera([3, 3], |_| {})), None, "in the picture");
    assert_eq!(light(|c| c.f_number = 16.0), at_8 / 4.0, "N²");
    assert_eq!(light(|c| c.iso = 400.0), at_8 * 4.0, "ISO");
    assert_eq!(light(|c| c.shutter_close_s = Some(5.0)), at_8 / 2.0, "time");
}

#[test]
fn vignetting_dims_the_room_as_it_dims_a_lamp() {
    let options =
        PhotoOptions { ambient_cd_m2: 0.05, ambient_rgb: [1.0; 3], ..PhotoOptions::plain() };
    let dark = film([64, 48], |_, _, _| 0);
    let light = |change: fn(&mut CameraOptions)| {
        read_out(&dark, &camera([64, 48], change), &options, 0).unwrap().rgb
    };
    let [clear, dim] = [light(|_| {}), light(|c| c.vignetting = Some(0.6))];
    let lens = camera([64, 48], |c| c.vignetting = Some(0.6));
    for [x, y] in [[0, 0], [63, 47], [5, 30], [32, 24]] {
        let index = 3 * (y * 64 + x);
        let left = f64::from(dim[index] / clear[index]);
        let wanted = lens.unvignetted(x as f64 + 0.5, y as f64 + 0.5);
        assert!((left - wanted).abs() < 1e-5, "{left} at {x}, {y}, wanted {wanted}");
    }
}

#[test]
fn floor_and_walls_differ_in_the_light_of_the_room() {
    let options =
        PhotoOptions { ambient_cd_m2: 0.05, ambient_rgb: [1.0; 3], ..PhotoOptions::plain() };
    let camera = camera([160, 120], |_| {});
    let dark = film([160, 120], |_, _, _| 0);
    let bare = ExposeOptions { unevenness: 0.0, ..ExposeOptions::default() };
    let walls = ExposeOptions { room_m: Some([4.0, 4.0, 2.5]), ..bare.clone() };
    let [even, walled] = [bare, walls.clone()]
        .map(|room| super::read_out(&dark, &camera, &room, &options, 0).unwrap().rgb);
    let room = crate::expose::Room::new(&walls, camera.position_m);
    let mut met = [0; 3];
    for (x, y) in (0..160).flat_map(|x| (0..120).map(move |y| (x, y))) {
        let ray = camera.world_from_image(f64::from(x) + 0.5, f64::from(y) + 0.5).unwrap();
        let (on, point_m) = room.intersection(ray).unwrap();
        let index = 3 * (y as usize * 160 + x as usize);
        let fraction = f64::from(walled[index] / even[index]);
        let error = (fraction / room.ambient(on, point_m, None) - 1.0).abs();
        met[0] += usize::from(on == 0);
        met[1] += usize::from(on == 1);
        met[2] += usize::from(error > 0.02);
    }
    assert!(met[0] > 1000 && met[1] > 1000, "floor and back wall: {met:?}");
    assert!(met[2] < 800, "{} pixels off the edges differ", met[2]);
}

#[test]
fn a_gray_room_in_lamp_light_is_gray_with_crosstalk_too() {
    for kelvin in [2000.0, 3200.0, 5000.0, 9000.0] {
        let gains = noctograph_core::camera::WhiteBalance::Kelvin(kelvin).gains();
        let options = PhotoOptions {
            ambient_cd_m2: 0.05,
            ambient_rgb: gains.map(|gain| 1.0 / gain),
            crosstalk: true,
            ..PhotoOptions::plain()
        };
        let camera = Camera { white_balance: gains, ..camera([3, 3], |_| {}) };
        let rgb = read_out(&film([3, 3], |_, _, _| 0), &camera, &options, 0).unwrap().rgb;
        let [r, g, b] = [rgb[12], rgb[13], rgb[14]];
        assert!((r / g - 1.0).abs() < 0.002 && (b / g - 1.0).abs() < 0.002, "{:?}", [r, g, b]);
        let bright = film([3, 3], |_, _, _| count(100.0));
        let rgb = read_out(&bright, &camera, &options, 0).unwrap().rgb;
        assert!(rgb.iter().all(|v| (v - 1.0).abs() < 1e-6), "white at {kelvin} K: {rgb:?}");
    }
}

#[test]
fn below_its_base_sensitivity_a_sensor_saturates_at_its_full_well() {
    fn white(iso: f64, base_iso: f64) -> f64 {
        let camera = Camera { iso, base_iso, ..camera([1, 1], |_| {}) };
        let readout = read_out(&film([1, 1], |_, _, _| 0), &camera, &PhotoOptions::plain(), 0);
        assert_eq!(readout.unwrap().white_lx_s, camera.saturation_lx_s(), "one white everywhere");
        camera.saturation_lx_s()
    }
    assert_eq!(white(100.0, 100.0), 0.78);
    assert_eq!(white(25.0, 100.0), 0.78, "the well is full");
    assert_eq!(white(25.0, 50.0), 1.56);
    assert_eq!(white(400.0, 100.0), 0.195, "the converter clips");
}

#[test]
fn hot_pixels_belong_to_the_camera() {
    fn hot(seed: u64) -> Vec<usize> {
        let options = noisy(|noise| noise.hot_pixel_frac = 1e-3);
        let dark = film([200, 100], |_, _, _| 0);
        let rgb = read_out(&dark, &camera([200, 100], |_| {}), &options, seed).unwrap().rgb;
        (0..rgb.len()).filter(|index| rgb[*index] > 0.005).collect()
    }
    let [one, other] = [hot(1), hot(2)];
    assert!(one.len() > 30, "{one:?}");
    // Close to the threshold, electron noise determines which pixels count as hot.
    let shared = one.iter().filter(|index| other.contains(index)).count();
    assert!(20 * shared > 19 * one.len().max(other.len()), "the same in every flight: {shared}");
}

#[test]
fn a_background_joins_in_linear_light() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.png");
    let rgb8 = vec![10, 100, 200, 250, 0, 60];
    let room =
        Photo::made(PhotoData { width_px: 2, height_px: 1, rgb8: rgb8.clone(), scene_toml: None });
    std::fs::write(&path, encode_png(&room, None, &[])).unwrap();
    let background = path.to_str().unwrap().to_owned();
    let options = PhotoOptions { background, ..PhotoOptions::plain() };
    let (dark, camera) = (film([2, 1], |_, _, _| 0), camera([2, 1], |_| {}));
    for tone in [Tone::Camera, Tone::Linear] {
        // The picture already contains the light of the room.
        let options = PhotoOptions { tone, ambient_cd_m2: 1.0, ..options.clone() };
        assert_eq!(tests::rgb8(&dark, &camera, &options), rgb8, "its own levels");
    }

    let half = film([2, 1], |_, _, _| count(0.25));
    let light = |film: &Film, background_stops| {
        let options = PhotoOptions { background_stops, ..options.clone() };
        f64::from(read_out(film, &camera, &options, 0).unwrap().rgb[1])
    };
    let linear = srgb::linear_from_encoded(100.0 / 255.0);
    assert!((light(&half, 0.0) - 0.25 - linear).abs() < 1e-6, "light adds up");
    assert!((light(&dark, -1.0) - 0.5 * linear).abs() < 1e-6, "a stop darker");
}

#[test]
fn a_room_reflects_by_its_picture_relative_to_the_median() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.png");
    fn light(level: f64) -> f64 {
        srgb::linear_from_encoded(level / 255.0)
    }
    let rgb8 = [[0; 3], [100, 100, 200], [100; 3], [120; 3], [255; 3]].concat();
    let room = Photo::made(PhotoData { width_px: 5, height_px: 1, rgb8, scene_toml: None });
    std::fs::write(&path, encode_png(&room, None, &[])).unwrap();
    let background = path.to_str().unwrap().to_owned();
    let options = PhotoOptions { background, ..PhotoOptions::plain() };
    let [red, _, blue] = &*reflectance(&camera([5, 1], |_| {}), &options).unwrap().unwrap();
    let wanted = [light(4.0) / light(100.0), 1.0, 1.0, light(120.0) / light(100.0), 4.0];
    for (fraction, wanted) in red.iter().zip(wanted) {
        assert!((f64::from(*fraction) - wanted).abs() < 1e-5, "{red:?}");
    }
    assert!(blue[1] > 2.0 && blue[2] < 1.0, "a blue wall: {blue:?}");
    let none = reflectance(&camera([5, 1], |_| {}), &PhotoOptions::plain()).unwrap();
    assert!(none.is_none(), "no picture");
}

#[test]
fn impossible_settings_are_named() {
    let (dark, camera) = (film([2, 1], |_, _, _| 0), camera([2, 1], |_| {}));
    let fails =
        |options: &PhotoOptions| develop(&dark, &camera, options, 0).unwrap_err().to_string();
    let plain = PhotoOptions::plain;
    let missing = PhotoOptions { background: "nowhere/room.png".into(), ..plain() };
    assert!(fails(&missing).contains("nowhere/room.png"));
    let glare = PhotoOptions { glare_frac: f64::NAN, ..plain() };
    assert!(fails(&glare).contains("photo.glare_frac: found NaN"));
    let response = noisy(|noise| noise.response[1] = 0.0);
    assert!(fails(&response).contains("photo.noise.response[1]: found 0"));
    let error = develop(&film([1, 2], |_, _, _| 0), &camera, &plain(), 0).unwrap_err();
    assert!(error.to_string().contains("1x2"), "{error}");
}

#[test]
fn the_same_seed_makes_the_same_bytes_on_every_machine() {
    let size_px = [640, 360];
    let options = PhotoOptions { ambient_cd_m2: 0.1, ..PhotoOptions::default() };
    let hash = |seed| {
        let photo = develop(&drawing(size_px), &camera(size_px, |_| {}), &options, seed).unwrap();
        noctograph_core::digest::sha256(&photo.rgb8)
    };
    assert_eq!(hash(1), "25ed342bc54d45ee7955fbc47db9b19b1330a3004d323260334a14f03af9a641");
    assert_ne!(hash(1), hash(2));
}
