//! Photographs as different as people's: words, fonts, cameras, rooms and colors drawn at random, one
//! fault in each but every eleventh.

use noctograph::camera::{BodyModel, CustomLens, FixedPose, Framing, LensModel, WordFraming};
use noctograph::error::Result;
use noctograph::letters;
use noctograph::light::RingEffect;
use noctograph::photo::{Noise, SensorNoise};
use noctograph::plan::PlanOptions;
use noctograph::sim::ControllerKind;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use crate::bench::{FAULTS, LEVELS, Setting};

/// A set of photographs: no word and no seed is in both.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Set {
    /// What the score is fitted on.
    Main,
    /// What it is tested on.
    Blind,
}

/// One photograph to be.
pub(crate) struct Draw {
    pub(crate) setting: Setting,
    /// `None`: no fault. With the level's number.
    pub(crate) fault: Option<(usize, usize)>,
}

const MAIN: [&str; 24] = [
    "NOOR", "HELLO", "DRONE", "LIGHT", "ANNA", "BRUNO", "CLARA", "DAVID", "EMMA", "FELIX", "GRETA",
    "HUGO", "JULIA", "KEVIN", "LUIS", "MARY", "NIGHT", "OSCAR", "PETRA", "QUICK", "ROSA", "VIKTOR",
    "WAVE", "YES",
];
const BLIND: [&str; 24] = [
    "ADAM", "BEACH", "CHALK", "DOVE", "EARTH", "FJORD", "GHOST", "HARP", "IRIS", "JAZZ", "KITE",
    "LEMON", "MAGIC", "NOVA", "OPERA", "PIXEL", "QUEEN", "RIVER", "STAR", "TUBA", "URBAN",
    "VELVET", "WOLF", "ZEBRA",
];
const FONTS: [&str; 4] = ["simplex", "ae483-fixed", "fonts/Roboto-Thin.ttf", "simplex"];

/// White, warm, amber, red, green, blue, cyan, magenta: CIE 1931 x, y.
const COLORS: [[f64; 2]; 8] = [
    [0.3127, 0.329],
    [0.44, 0.40],
    [0.56, 0.43],
    [0.66, 0.32],
    [0.22, 0.68],
    [0.155, 0.08],
    [0.21, 0.33],
    [0.36, 0.18],
];

/// The photograph of a number in a set.
pub(crate) fn draw(set: Set, index: usize, background: &str) -> Result<Draw> {
    let seed = index as u64 + if set == Set::Main { 0 } else { 1 << 20 };
    let mut chance = ChaCha8Rng::seed_from_u64(seed);
    let mut setting = Setting::clean(&word(set, &mut chance), seed);
    let font = FONTS[chance.random_range(0..FONTS.len())];
    let cap_height_m = chance.random_range(0.3..0.6);
    let team = chance.random_range(0.0..1.0) < 0.25;
    let lamps = chance.random_range(0..3);
    let color =
        COLORS[if chance.random_range(0.0..1.0) < 0.4 { 0 } else { chance.random_range(0..8) }];
    for scene in setting.scenes() {
        scene.letters.font = font.into();
        // The team's proportions, in another size; corners and steps with it.
        scene.letters.cap_height_m = cap_height_m;
        if team {
            // The team's speed is of the team's size.
            scene.controller.kind = ControllerKind::Lqr;
            let stroke_speed_m_s = 0.2 * cap_height_m / 0.5;
            scene.plan = PlanOptions { stroke_speed_m_s, ..PlanOptions::default() };
        }
        if lamps == 0 {
            scene.light.ring = RingEffect::DoubleSpin;
        }
        if lamps < 2 {
            scene.light.led_bitmask = 0;
        }
        for fixture in scene.light.fixtures.iter_mut().flatten() {
            if fixture.name.starts_with("headlight") {
                fixture.dies[0].chromaticity = color;
            }
        }
    }
    photographer(&mut setting, &mut chance, background)?;
    let turn = chance.random_range(0..=FAULTS.len());
    let fault = (turn < FAULTS.len()).then(|| (turn, chance.random_range(0..LEVELS)));
    if let Some((fault, level)) = fault {
        (FAULTS[fault].turn)(&mut setting, FAULTS[fault].levels[level])?;
    }
    Ok(Draw { setting, fault })
}

/// A third are names and words, a third letters in any order, a third digits or both.
fn word(set: Set, chance: &mut ChaCha8Rng) -> String {
    let mut of = |characters: &str, n: std::ops::RangeInclusive<usize>| {
        let characters: Vec<char> = characters.chars().collect();
        let n = chance.random_range(n);
        (0..n).map(|_| characters[chance.random_range(0..characters.len())]).collect::<String>()
    };
    match of("012345", 1..=1).as_str() {
        "0" | "1" | "2" => {
            let words = if set == Set::Main { MAIN } else { BLIND };
            words[chance.random_range(0..words.len())].to_owned()
        }
        "3" | "4" => of("ABCDEFGHIJKLMNOPQRSTUVWXYZ", 3..=5),
        _ => of("0123456789", 2..=5),
    }
}

/// Camera, room, and where the photographer stands.
fn photographer(setting: &mut Setting, chance: &mut ChaCha8Rng, background: &str) -> Result<()> {
    let bodies = [BodyModel::FullFrame24Mp, BodyModel::A6400, BodyModel::OneInch, BodyModel::Phone];
    let body = bodies[chance.random_range(0..bodies.len())].clone();
    let bounds_m = letters::write(&setting.known.word, &setting.known.letters)?.bounds_m();
    let scene = &mut setting.actual;
    let camera = &mut scene.camera;
    // The lens of that body that sees as a 28 to 50 mm one does on full frame.
    let crop = body.sensor_width_m() / 0.036;
    let focal_length_m = crop * chance.random_range(0.028..0.05);
    camera.lens = LensModel::Custom(CustomLens { focal_length_m, ..CustomLens::default() });
    camera.blur_m *= crop;
    camera.f_number = (8.0 * crop).max(2.0);
    scene.photo.glare_radius_m *= crop;
    if let Some([full_well_e, read_noise_e]) = body.full_well_and_read_noise_e() {
        let noise = SensorNoise { full_well_e, read_noise_e, ..SensorNoise::default() };
        scene.photo.noise = Noise::Emva1288(noise);
    }
    camera.body = body;
    let sizes = [[480, 270], [640, 360], [480, 320], [400, 300]];
    [camera.width_px, camera.height_px] = sizes[chance.random_range(0..sizes.len())];
    let fill_frac = chance.random_range(0.45..0.75);
    camera.framing = Framing::Word(WordFraming { fill_frac });
    scene.photo.ambient_cd_m2 = 0.02 * libm::exp2(chance.random_range(-3.0..2.5));
    if chance.random_range(0.0..1.0) < 0.25 {
        background.clone_into(&mut scene.photo.background);
        scene.photo.background_stops = chance.random_range(-6.0..-3.0);
    }
    if chance.random_range(0.0..1.0) < 0.4 {
        // Up to 25 degrees to one side, half a metre above or below, not quite aimed at the middle.
        let square_on = camera.camera(bounds_m, 1.0)?;
        let middle = [0.5 * (bounds_m[0] + bounds_m[2]), 0.0, 0.5 * (bounds_m[1] + bounds_m[3])];
        let (far, angle) = (-square_on.position_m.y, chance.random_range(-0.44..0.44));
        let (sin, cos) = libm::sincos(angle);
        let mut off = |m: f64| chance.random_range(-m..m);
        camera.framing = Framing::Fixed(FixedPose {
            position_m: [middle[0] + far * sin, -far * cos, (middle[2] + off(0.5)).max(0.1)],
            target_m: [middle[0] + off(0.1), 0.0, middle[2] + off(0.1)],
            ..FixedPose::default()
        });
    }
    Ok(())
}
