//! Tests of whole flights with their lamps.

use noctograph_core::flight::{DroneIndex, FlightData, FlightSample};
use std::collections::BTreeSet;

use super::*;
use noctograph_core::geometry::Attitude;
use noctograph_core::srgb;

/// Returns a flight at 0.2 m/s along x for 4 s, sampled at 100 Hz, with the named channels on from
/// 0.5 s to 2.5 s.
fn flight(channels: &[&str]) -> Flight {
    let sample = |i: i32| FlightSample {
        time_s: f64::from(i) * 0.01,
        position_m: Vector3::new(f64::from(i) * 0.002, 0.0, 1.0),
        attitude: Attitude::default(),
        velocity_body_m_s: Vector3::x() * 0.2,
        rate_body_rad_s: Vector3::zeros(),
        estimate_m: Vector3::zeros(),
        design_m: Vector3::zeros(),
        motors: [0.0; 4],
        letter: Some(0),
    };
    let levels = |_| (0..=400).map(|i| if (50..250).contains(&i) { 1.0 } else { 0.0 }).collect();
    Flight::made(FlightData {
        samples: (0..=400).map(sample).collect(),
        lights: channels.iter().map(|name| ((*name).to_owned(), levels(name))).collect(),
        ..FlightData::default()
    })
}

#[test]
fn light_crosses_a_short_gap_of_the_log_and_no_long_one() {
    fn lit_s(flight: &Flight) -> f64 {
        let trace = light(flight, &LightOptions::default(), 0, 0).unwrap();
        let samples = &trace.lamps.iter().find(|l| l.emitter.name.contains("headlight")).unwrap();
        let mean = |p: &[LightSample]| 0.5 * (p[0].level + p[1].level);
        samples.samples.windows(2).map(|p| mean(p) * (p[1].time_s - p[0].time_s)).sum()
    }
    fn gapped(to_s: f64, named: bool) -> f64 {
        let mut flight = flight(&["headlights"]);
        let hole = |s: &FlightSample| s.time_s > 1.1 + 1e-9 && s.time_s < to_s - 1e-9;
        flight.edit(|flight| {
            let levels = flight.lights.get_mut("headlights").unwrap();
            let kept = flight.samples.iter().zip(&*levels).filter(|(s, _)| !hole(s));
            *levels = kept.map(|(_, level)| *level).collect();
            flight.samples.retain(|s| !hole(s));
            flight.gaps = if named { vec![[1.1, to_s]] } else { Vec::new() };
        });
        lit_s(&flight)
    }
    let whole_s = lit_s(&flight(&["headlights"]));
    assert!((gapped(1.3, false) - whole_s).abs() < 1e-9, "interpolated without a gap");
    assert!((gapped(1.5, true) - whole_s).abs() < 1e-6, "bridged");
    let long_s = gapped(2.0, true);
    assert!((long_s - (whole_s - 0.9)).abs() < 1e-6, "{long_s} of {whole_s}");
}

fn solid(color: [u8; 3]) -> LightOptions {
    LightOptions { ring: RingEffect::Solid(RingColor { color }), ..LightOptions::default() }
}

fn lit(options: &LightOptions, channels: &[&str]) -> LightTrace {
    light(&flight(channels), options, 0, 0).unwrap()
}

/// Returns the lit stretches of a lamp, from sample to sample, with the levels at both ends.
fn stretches(lamp: &Lamp) -> Vec<(LightSample, LightSample)> {
    let pairs = lamp.samples.windows(2).map(|pair| (pair[0], pair[1]));
    pairs.filter(|(a, b)| b.time_s > a.time_s && (a.level > 0.0 || b.level > 0.0)).collect()
}

/// Returns the level of a lamp at a time, or 0 if the lamp has no samples around it.
fn level(lamp: &Lamp, time_s: f64) -> f64 {
    let around = stretches(lamp).into_iter().find(|(a, b)| (a.time_s..b.time_s).contains(&time_s));
    around.map_or(0.0, |(a, b)| {
        a.level + (b.level - a.level) * (time_s - a.time_s) / (b.time_s - a.time_s)
    })
}

/// Returns the light in cd that all lamps with a name emit straight down at a time.
fn down_cd(trace: &LightTrace, name: &str, time_s: f64) -> f64 {
    let lamps = trace.lamps.iter().filter(|lamp| lamp.emitter.name.starts_with(name));
    lamps.map(|lamp| level(lamp, time_s) * lamp.emitter.intensity_cd(1.0)).sum()
}

fn named<'a>(trace: &'a LightTrace, name: &str) -> &'a Lamp {
    trace.lamps.iter().find(|lamp| lamp.emitter.name == name).expect("a lamp of that name")
}

#[test]
fn the_default_drone_is_never_dark() {
    let trace = lit(&LightOptions::default(), &["headlights"]);
    let names = ["headlight left", "headlight right", "power M2", "status M1", "link M4"];
    for name in names.into_iter().chain(["ring 0", "ring 11"]) {
        assert!(!named(&trace, name).samples.is_empty(), "{name}");
    }
    for time_s in [0.001, 1.0, 3.99] {
        assert_eq!(level(named(&trace, "power M3"), time_s), 1.0, "always lit");
    }
}

#[test]
fn a_led_and_its_glint_on_the_propeller_shine_at_once_14_mm_apart() {
    let trace = lit(&LightOptions::default(), &["headlights"]);
    let [led, glint] = ["status M1", "status M1 on the propeller"].map(|name| named(&trace, name));
    assert!((glint.emitter.intensity_cd / led.emitter.intensity_cd - 0.1).abs() < 1e-9);
    for (a, b) in led.samples.iter().zip(&glint.samples) {
        let apart_m = b.position_m - a.position_m;
        assert_eq!((a.time_s, a.level), (b.time_s, b.level));
        assert!((apart_m.x.abs() - 0.014).abs() < 1e-3, "{apart_m}");
    }
}

#[test]
fn headlights_glint_on_the_motors_ahead_to_all_sides_but_the_rear() {
    let trace = lit(&LightOptions::default(), &["headlights"]);
    let lamp = |name: &str| named(&trace, name);
    let headlights = ["headlight left", "headlight right"].map(lamp);
    let glints = ["headlight left on the motor", "headlight right on the motor"].map(lamp);
    for (headlight, glint) in headlights.into_iter().zip(glints) {
        assert_eq!(headlight.samples.len(), glint.samples.len(), "lit at once");
        let ahead_m = glint.samples[0].position_m - headlight.samples[0].position_m;
        assert!((ahead_m.x - 0.0165).abs() < 1e-9 && ahead_m.y.abs() > 0.02, "{ahead_m}");
        assert_eq!([1.0, 0.0, -1.0].map(|cos| glint.emitter.intensity_cd(cos)), [0.03, 0.03, 0.0]);
    }
}

#[test]
fn the_status_led_writes_a_dot_of_50_ms_every_10_cm() {
    let trace = lit(&LightOptions::default(), &["headlights"]);
    let dots: Vec<[LightSample; 2]> = {
        let samples = &named(&trace, "status M1").samples;
        let on = samples.windows(2).filter(|p| p[0].level < p[1].level).map(|p| p[1]);
        let dark = samples.windows(2).filter(|p| p[0].level > p[1].level).map(|p| p[0]);
        on.zip(dark).map(|(on, dark)| [on, dark]).collect()
    };
    assert_eq!(dots.len(), 8, "two a second for 4 s");
    for dot in &dots {
        assert!((dot[1].time_s - dot[0].time_s - 0.05).abs() < 1e-9, "50 ms: {dot:?}");
    }
    for pair in dots.windows(2) {
        let apart_m = pair[1][0].position_m.x - pair[0][0].position_m.x;
        assert!((apart_m - 0.1).abs() < 1e-6, "{apart_m} m");
    }
}

#[test]
fn bitmask_128_turns_the_boards_leds_off_and_bits_light_them() {
    fn names(led_bitmask: u8) -> Vec<String> {
        let options =
            LightOptions { led_bitmask, deck: Deck::None, fixtures: None, ..Default::default() };
        lit(&options, &[]).into_data().lamps.into_iter().map(|lamp| lamp.emitter.name).collect()
    }
    assert_eq!(names(0).len(), 10, "{:?}", names(0));
    assert_eq!(names(128), Vec::<String>::new());
    let lit = ["power M3", "status M1"].map(|led| {
        [String::new(), " on the propeller".into(), " on the body".into()]
            .map(|on| format!("{led}{on}"))
    });
    assert_eq!(BTreeSet::from_iter(names(128 | 1 << 4 | 1)), BTreeSet::from_iter(lit.concat()));
    assert_eq!(names(1 << 4).len(), 10, "without bit 7 the firmware rules");
}

#[test]
fn a_solid_ring_of_20_20_20_sends_1_2_cd_down() {
    let options = solid([20; 3]);
    let trace = lit(&options, &["headlights"]);
    let ring_cd = down_cd(&trace, "ring", 2.0);
    // The ring has 12 LEDs of 1.28 cd at 20/255.
    assert!((ring_cd - 1.2047).abs() < 1e-3, "{ring_cd} cd");
    let lamps = trace.lamps.iter().filter(|lamp| lamp.emitter.name.starts_with("ring")).count();
    assert_eq!(lamps, 12, "one color, one lamp an LED");
}

#[test]
fn a_switched_ring_fades_in_over_a_second_of_ticks() {
    let options = solid([20; 3]);
    let trace = lit(&options, &["ring"]);
    // The ring is commanded at 0.5 s, receives it after 20 to 30 ms, and its timer ticks at 0.55 s.
    assert_eq!(down_cd(&trace, "ring", 0.549), 0.0);
    let share = |time_s| down_cd(&trace, "ring", time_s) / 1.2047;
    assert!((share(0.551) - 0.05).abs() < 1e-3, "first of 20 steps: {}", share(0.551));
    assert!((share(1.001) - 0.5).abs() < 1e-3, "half after half a second: {}", share(1.001));
    assert!((share(1.501) - 1.0).abs() < 1e-3, "full after 20 steps: {}", share(1.501));
    assert!(share(1.499) < 0.96, "not before: {}", share(1.499));
    assert_eq!(down_cd(&trace, "ring", 2.551), 0.0, "off at once");
}

#[test]
fn a_fading_ring_keeps_its_light_however_many_colors_it_shows() {
    let mut flight = flight(&["headlights"]);
    let red = (0..=400).map(|i| if i < 100 { 0.0 } else { 1.0 }).collect();
    flight.edit(|flight| flight.lights.insert("ring.red".to_owned(), red));
    let options = LightOptions {
        ring: RingEffect::Fade(RingFade { color: [0, 255, 0], fade_s: 1.0 }),
        radio_jitter_s: 0.0,
        ..LightOptions::default()
    };
    let trace = light(&flight, &options, 0, 0).unwrap();
    let [before, middle, after] = [0.9, 1.551, 3.0].map(|t| down_cd(&trace, "ring", t));
    assert!((before - 12.0 * 0.69).abs() < 1e-9, "green: {before} cd");
    assert!((after - 12.0 * 1.09).abs() < 1e-9, "green and red: {after} cd");
    assert!((middle - 12.0 * (0.69 + 0.2)).abs() < 0.05, "half way: {middle} cd");
}

#[test]
fn commands_take_the_radio_the_jitter_and_the_tick() {
    let untimed = LightOptions { tick_s: 0.0, radio_jitter_s: 0.0, ..LightOptions::default() };
    fn on_s(options: &LightOptions, seed: u64) -> f64 {
        let trace = light(&flight(&["headlights"]), options, seed, 0).unwrap();
        named(&trace, "headlight left").samples[0].time_s
    }
    assert!((on_s(&untimed, 0) - 0.52).abs() < 1e-12, "the radio alone");
    let jitter = LightOptions { radio_jitter_s: 0.01, ..untimed.clone() };
    let late: Vec<f64> = (0..20).map(|seed| on_s(&jitter, seed) - 0.52).collect();
    assert!(late.iter().all(|late_s| (0.0..0.01).contains(late_s)), "{late:?}");
    assert!(late[1] != late[0] && on_s(&jitter, 1) == on_s(&jitter, 1), "by the seed");
    assert!((on_s(&LightOptions::default(), 0) - 0.55).abs() < 1e-12, "the next tick");
}

#[test]
fn the_color_led_follows_its_firmwares_curve() {
    let options = |color_led_levels| LightOptions {
        deck: Deck::ColorLed,
        fixtures: None,
        color_led_wrgb: [0, 0, 0, 255],
        color_led_levels,
        ..LightOptions::default()
    };
    let cd = |levels, wrgb| {
        let options = LightOptions { color_led_wrgb: wrgb, ..options(levels) };
        down_cd(&lit(&options, &[]), "color LED", 1.0)
    };
    let [white, blue] = [250.0, 50.0].map(|lm| 0.7 / 4.7 * lm);
    assert!((cd(ColorLedLevels::Corrected, [0, 0, 0, 255]) - blue).abs() < 1e-9);
    // White 255 is equalized to 252, and squaring gives 249 of 255.
    assert!((cd(ColorLedLevels::Corrected, [255, 0, 0, 0]) - white * 249.0 / 255.0).abs() < 1e-9);
    assert!((cd(ColorLedLevels::Plain, [255, 0, 0, 0]) - white).abs() < 1e-9);
    let switched = lit(&options(ColorLedLevels::Corrected), &["color-led"]);
    assert_eq!(down_cd(&switched, "color LED", 0.4), 0.0);
    assert!(down_cd(&switched, "color LED", 1.0) > 7.0, "switched on by its channel");
}

#[test]
fn every_byte_of_the_color_led_has_the_level_of_the_firmwares_own_code() {
    let recorded = include_str!("recorded/color_led.txt");
    let rows = recorded.lines().filter(|line| !line.starts_with('#'));
    for (die, row) in rows.enumerate() {
        for byte in 0..=255_u8 {
            let want = u8::from_str_radix(&row[2 * usize::from(byte)..][..2], 16).unwrap();
            let levels = programs::color_led_levels([byte; 4], ColorLedLevels::Corrected);
            assert_eq!(levels[die] * 255.0, f64::from(want), "die {die}, byte {byte}");
        }
    }
}

#[test]
fn the_body_hides_a_lamp_beyond_its_cone() {
    let trace = lit(&LightOptions::default(), &["headlights"]);
    let headlight = &named(&trace, "headlight left").emitter;
    assert!((headlight.intensity_cd(1.0) - 1.8).abs() < 1e-12, "on the axis");
    assert!((headlight.intensity_cd(0.0) - 0.0216).abs() < 1e-12, "spill to the side");
    assert_eq!(headlight.intensity_cd(-0.51), 0.0, "from behind");
    let ring = &named(&trace, "ring 0").emitter;
    let [side_cd, above_cd] = [0.0, -0.21].map(|cos| ring.intensity_cd(cos));
    assert!(side_cd > 0.0 && above_cd == 0.0, "{side_cd} from the side, {above_cd} from above");
}

#[test]
fn lamps_turn_with_the_body() {
    let mut flight = flight(&["headlights"]);
    flight.edit(|flight| {
        for sample in &mut flight.samples {
            sample.attitude.yaw_rad = std::f64::consts::FRAC_PI_2;
        }
    });
    let trace = light(&flight, &LightOptions::default(), 0, 0).unwrap();
    let sample = named(&trace, "headlight left").samples[0];
    assert!((sample.axis - Vector3::y()).norm() < 1e-12, "forward is now world y");
    let offset = sample.position_m - Vector3::new(0.2 * sample.time_s, 0.0, 1.0);
    assert!((offset - Vector3::new(-0.01, 0.016, -0.01)).norm() < 1e-9, "{offset}");
}

#[test]
fn omitted_samples_lie_on_the_path_of_the_lamp() {
    let mut flight = flight(&["headlights"]);
    flight.edit(|flight| {
        for (i, sample) in (0..).zip(&mut flight.samples) {
            let t = f64::from(i) * 0.01;
            sample.position_m.z = 1.0 + 0.01 * libm::sin(2.0 * t);
            sample.attitude.pitch_rad = 0.02 * libm::cos(2.0 * t);
        }
    });
    let trace = light(&flight, &LightOptions::default(), 0, 0).unwrap();
    let lamp = named(&trace, "power M2");
    assert!(lamp.samples.len() < 300, "{} of 401 samples", lamp.samples.len());
    let on_body_m = Vector3::new(-0.03, -0.03, 0.0);
    for sample in &flight.samples[1..400] {
        let truth_m = sample.position_m + sample.attitude.world_from_body() * on_body_m;
        let after = lamp.samples.partition_point(|s| s.time_s < sample.time_s);
        let (a, b) = (lamp.samples[after - 1], lamp.samples[after]);
        let part = (sample.time_s - a.time_s) / (b.time_s - a.time_s);
        let off_m = (a.position_m.lerp(&b.position_m, part) - truth_m).norm();
        assert!(off_m <= 10e-6, "{off_m} m at {} s", sample.time_s);
    }
}

#[test]
fn drones_differ_in_random_numbers_alone_and_add_up() {
    let lit = |drone| light(&flight(&["headlights"]), &LightOptions::default(), 0, drone).unwrap();
    let (mut both, second) = (lit(0), lit(1));
    let flicker = |trace: &LightTrace| named(trace, "link M4").samples.clone();
    assert_ne!(flicker(&both), flicker(&second));
    assert_eq!(named(&both, "ring 2"), named(&second, "ring 2"));
    let n = both.lamps.len();
    both.edit(|both| both.append(second.clone()));
    assert_eq!(both.lamps[n..], second.lamps);
}

#[test]
fn a_flight_without_light_columns_is_refused_if_lamps_follow_one() {
    let error = light(&flight(&[]), &LightOptions::default(), 0, 0).unwrap_err().to_string();
    assert!(error.contains("light.headlights"), "{error}");
    let laser = Fixture { drive: Drive::Command("laser".to_owned()), ..Fixture::default() };
    let custom = LightOptions { fixtures: Some(vec![laser]), ..LightOptions::default() };
    let error = light(&flight(&["headlights"]), &custom, 0, 0).unwrap_err();
    assert!(error.hint().contains("set plan.lights to [\"laser\"]"), "{}", error.hint());
    let dark = LightOptions { deck: Deck::None, fixtures: None, ..LightOptions::default() };
    assert!(light(&flight(&[]), &dark, 0, 0).is_ok(), "the lamps of the board follow no channel");
}

#[test]
fn impossible_rows_are_refused_by_name() {
    fn refused(change: fn(&mut Fixture)) -> String {
        let mut fixtures = Deck::LedRing.fixtures();
        change(&mut fixtures[2]);
        let options = LightOptions { fixtures: Some(fixtures), ..LightOptions::default() };
        options.check().unwrap_err().to_string()
    }
    assert!(refused(|row| row.drive = Drive::Ring(12)).contains("ring 0"));
    assert!(refused(|row| row.dies.truncate(2)).contains("3 dies"));
    assert!(refused(|row| row.spill = f64::NAN).contains("light.fixtures[2].spill"));
    assert!(
        refused(|row| row.dies[0].chromaticity = [0.7, 0.0]).contains("`ring 0`: chromaticity")
    );
    assert!(refused(|row| row.visible_cos = 1.5).contains("visible_cos"));
}

#[test]
fn the_color_led_writes_each_letter_in_its_color() {
    let samples = Vec::from_iter((0..40).map(|k: u32| FlightSample {
        time_s: 0.1 * f64::from(k),
        letter: [None, Some(0), Some(1), Some(2)][(k as usize / 10) % 4],
        ..FlightSample::default()
    }));
    let levels = (0..40).map(|k| if k >= 10 && k % 10 > 1 { 1.0 } else { 0.0 }).collect();
    let lights = [("color-led".to_owned(), levels)].into();
    let flight = Flight::made(FlightData { samples, lights, ..FlightData::default() });
    let options = LightOptions {
        deck: Deck::ColorLed,
        letters_wrgb: vec![[0, 255, 0, 0], [0, 0, 0, 255]],
        ..LightOptions::default()
    };
    let trace = light(&flight, &options, 1, 0).unwrap();
    let [first, second, third] = [1.5, 2.5, 3.5].map(|time_s: f64| {
        let is_lit = |s: &&LightSample| s.level > 0.0 && (s.time_s - time_s).abs() < 0.3;
        let mut lit = trace.lamps.iter().filter(|lamp| lamp.samples.iter().any(|s| is_lit(&s)));
        let (lamp, other) = (lit.next().unwrap(), lit.find(|l| l.emitter.name == "color LED"));
        assert!(other.is_none_or(|other| other == lamp), "one color at a time");
        lamp.emitter.rgb
    });
    assert!(first[0] > 2.0 * first[2] && second[2] > 2.0 * second[0], "{first:?}, {second:?}");
    assert_eq!(first, third, "two colors in turn");
}

#[test]
fn a_lamp_of_several_drones_is_labeled_by_its_drone_and_keeps_its_name() {
    let mut trace = lit(&LightOptions::default(), &["headlights"]).into_data();
    let lamp = &mut trace.lamps[0];
    lamp.emitter.name = "2: spare".to_owned();
    assert_eq!(lamp.label(), "2: spare");
    lamp.drone = Some(DroneIndex(0));
    assert_eq!((lamp.label().as_str(), lamp.emitter.name.as_str()), ("1: 2: spare", "2: spare"));
}

#[test]
fn colors_of_the_screen_are_those_of_the_lamps() {
    fn color_led(srgb: [u8; 3]) -> [f64; 3] {
        let plain = ColorLedLevels::Plain;
        let levels = programs::color_led_levels(color_led_wrgb(srgb, plain), plain);
        emitter(&tables::color_led()[0], &levels).rgb
    }
    let ring = |srgb| {
        let rows = tables::led_ring();
        let row = rows.iter().find(|row| matches!(row.drive, Drive::Ring(_))).unwrap();
        emitter(row, &ring_rgb(srgb).map(|byte| f64::from(byte) / 255.0)).rgb
    };
    // In linear sRGB light, 165 is 0.376, 127 is 0.212, 105 is 0.141, and 180 is 0.456.
    for (srgb, wanted) in [
        ([255, 0, 0], [1.0, 0.0, 0.0]),
        ([255, 165, 0], [1.0, 0.376, 0.0]),
        ([255, 255, 0], [1.0, 1.0, 0.0]),
        ([255, 105, 180], [1.0, 0.141, 0.456]),
        ([0, 255, 255], [0.0, 1.0, 1.0]),
        ([0, 128, 0], [0.0, 1.0, 0.0]),
        ([255, 255, 255], [1.0, 1.0, 1.0]),
    ] {
        // At this brightness the deck has 8 steps of green, and 3 to 5 of red and blue.
        for (lamp, rgb, within) in
            [("color LED", color_led(srgb), 0.16), ("ring", ring(srgb), 0.02)]
        {
            let most = rgb.into_iter().fold(0.0, f64::max);
            for (actual, wanted) in rgb.iter().zip(wanted) {
                assert!((actual / most - wanted).abs() < within, "{lamp}, {srgb:?}: {rgb:?}");
            }
        }
    }
}

#[test]
fn colors_beyond_the_lamps_of_a_row_are_the_mixtures_of_its_dies_all_the_same() {
    let fixture = &tables::color_led()[0];
    let levels = |row: u32, die: u32| f64::from((row * (2 * die + 3) + die) % 11) / 10.0;
    let changes = |die: u32| {
        (0..12).map(|row: u32| Change { time_s: f64::from(row), level: levels(row, die) }).collect()
    };
    let dies: Vec<Vec<Change>> = (0..4).map(changes).collect();
    let sources = sources(fixture, &dies);
    assert_eq!(sources.len(), 3);
    for row in 0..12 {
        let wanted = emitter(fixture, &[0, 1, 2, 3].map(|die| levels(row, die)));
        let parts = sources.iter().map(|(emitter, changes)| {
            Vector3::from(emitter.rgb) * (emitter.intensity_cd * changes[row as usize].level)
        });
        let wanted = Vector3::from(wanted.rgb) * wanted.intensity_cd;
        let error = (parts.sum::<Vector3<f64>>() - wanted).norm();
        assert!(error < 1e-9 * wanted.norm(), "{row}: {error}");
    }
}

#[test]
fn colors_have_luminance_one_and_no_negative_light() {
    for chromaticity in [[0.7, 0.29], [0.15, 0.75], [0.13, 0.05], [0.3127, 0.329], [0.4, 0.4]] {
        let [r, g, b] = rgb(xyz(chromaticity));
        assert!(r >= 0.0 && g >= 0.0 && b >= 0.0, "{chromaticity:?}: {r} {g} {b}");
        let luminance = luminance([r, g, b]);
        assert!((luminance - 1.0).abs() < 1e-12, "{chromaticity:?}: luminance {luminance}");
    }
}

#[test]
fn a_mixture_of_dies_is_the_color_that_was_asked_for() {
    let dies = [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06]];
    let mixed = programs::mixture(dies, [255, 165, 0]);
    let wanted = Vector3::new(0.2126, 0.7152 * srgb::linear_from_encoded(165.0 / 255.0), 0.0);
    assert!((mixed - wanted).norm() < 1e-3, "the primaries of sRGB themselves: {mixed}");
    assert!((programs::mixture(dies, [255; 3]).sum() - 1.0).abs() < 1e-3, "white");
}

#[test]
fn daylight_is_white_and_a_blue_led_is_the_blue_primary() {
    for share in rgb(xyz([0.3127, 0.329])) {
        assert!((share - 1.0).abs() < 1e-3, "D65 is white: {share}");
    }
    let [r, g, b] = rgb(xyz([0.131, 0.05]));
    assert!(r == 0.0 && g < 0.02 && b > 13.7, "{r} {g} {b}");
}
