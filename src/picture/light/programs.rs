//! Programs: the level of each die of a lamp during a flight.

use std::cell::OnceCell;

use nalgebra::{Matrix3, Vector3};

use super::radio::{Chance, Change, Timer, arrivals};
use super::ring::{Frame, byte, frames};
use super::tables::{color_led, led_ring};
use super::{
    COLOR_LED, COLOR_LED_COLORS, ColorLedLevels, Die, Drive, Fixture, LightOptions, RING, packed,
};
use noctograph_core::crazyflie::COLOR_LED_TICK_S;
use noctograph_core::flight::Flight;
use noctograph_core::srgb::{
    RGB_FROM_XYZ, encoded_from_linear, linear_from_encoded, rgb_from_xyz, xyz,
};

/// A flight and the options that determine the levels of its lamps.
#[derive(Debug)]
pub(super) struct Programs<'a> {
    flight: &'a Flight,
    options: &'a LightOptions,
    seed: u64,
    drone: u64,
    begin_s: f64,
    end_s: f64,
    ring: OnceCell<Vec<(f64, Frame)>>,
}

/// Bit of `led.bitmask` with which it takes control of the board's LEDs.
const BITMASK_ENABLED: u8 = 0x80;

/// Time over which flicker is averaged, in s.
const FLICKER_S: f64 = 0.1;

/// Scales of the white, red, green and blue dies of the color LED deck (`LED_PERCEPTUAL_SCALE` in
/// `color_led_deck.h`), which are the same in every release with the deck (2025.12 and later).
const COLOR_LED_SCALE: [f32; 4] = [0.99, 0.78, 0.51, 1.0];

impl<'a> Programs<'a> {
    /// Prepares the programs of a flight, from its first to its last sample.
    pub(super) fn new(
        flight: &'a Flight,
        options: &'a LightOptions,
        seed: u64,
        drone: u64,
    ) -> Self {
        let begin_s = flight.samples.first().map_or(0.0, |first| first.time_s);
        let end_s = flight.samples.last().map_or(0.0, |last| last.time_s);
        Self { flight, options, seed, drone, begin_s, end_s, ring: OnceCell::new() }
    }

    /// Returns the level changes of each die, 0 to 1. All dies are dark before their first change.
    pub(super) fn changes(&self, fixture: &Fixture) -> Vec<Vec<Change>> {
        let changes = match (&fixture.drive, self.bitmask(fixture)) {
            (_, Some(level)) => self.steady(level),
            (Drive::Always, _) => self.steady(1.0),
            (Drive::Command(channel), _) => self.commanded(channel),
            (Drive::Blink { on_s, period_s, phase_s }, _) => self.blink(*on_s, *period_s, *phase_s),
            (Drive::Flicker { flashes_hz, flash_s }, _) => {
                self.flicker(&fixture.name, *flashes_hz, *flash_s)
            }
            (Drive::Ring(led), _) => return (0..3).map(|die| self.ring(*led, die)).collect(),
            (Drive::ColorLed, _) => return self.color_led(),
        };
        vec![changes; fixture.dies.len()]
    }

    /// Returns the change to a constant level at the start of the flight.
    fn steady(&self, level: f64) -> Vec<Change> {
        vec![Change { time_s: self.begin_s, level }]
    }

    /// Returns the level, 0 or 1, that `led.bitmask` sets, or `None` if it does not control the
    /// lamp.
    fn bitmask(&self, fixture: &Fixture) -> Option<f64> {
        let mask = self.options.led_bitmask;
        let bit = fixture.bitmask_bit.filter(|_| mask & BITMASK_ENABLED != 0)?;
        Some(f64::from(mask >> bit & 1))
    }

    /// Returns the changes of a lamp that follows a channel of the plan over the radio, from the
    /// times at which commands take effect.
    fn commanded(&self, channel: &str) -> Vec<Change> {
        let chance = Chance::new(self.seed, self.drone, channel);
        let levels = self.flight.lights.get(channel).map_or(&[][..], |levels| levels);
        let arrivals = arrivals(&self.flight.samples, levels, 0.0, self.options, &chance);
        Timer { period_s: self.options.tick_s, phase_s: 0.0 }.hold(&arrivals)
    }

    /// Returns the changes of a lamp that is lit for `on_s` in each period of the flight. Periods
    /// begin at `phase_s` and at whole periods before and after it.
    fn blink(&self, on_s: f64, period_s: f64, phase_s: f64) -> Vec<Change> {
        let timer = Timer { period_s, phase_s };
        let mut changes = Vec::new();
        // The first flash may have begun before the flight, and is cut off at its start.
        let mut number = timer.next(self.begin_s - on_s);
        while timer.tick_s(number) < self.end_s {
            let tick_s = timer.tick_s(number);
            let start_s = tick_s.max(self.begin_s);
            changes.push(Change { time_s: start_s, level: 1.0 });
            changes.push(Change { time_s: (tick_s + on_s).max(start_s), level: 0.0 });
            number += 1.0;
        }
        changes
    }

    /// Returns the changes of a lamp with random flashes, `flashes_hz` on average and each of
    /// `flash_s`. The level is averaged over [`FLICKER_S`].
    fn flicker(&self, name: &str, flashes_hz: f64, flash_s: f64) -> Vec<Change> {
        let chance = Chance::new(self.seed, self.drone, name);
        let timer = Timer { period_s: FLICKER_S, phase_s: self.begin_s };
        let times_s = (0..).map(|index: u32| (u64::from(index), timer.tick_s(f64::from(index))));
        let changes =
            times_s.take_while(|(_, time_s)| *time_s < self.end_s).map(|(index, time_s)| {
                let flashes = f64::from(chance.poisson(index, flashes_hz * FLICKER_S));
                Change { time_s, level: (flashes * flash_s / FLICKER_S).min(1.0) }
            });
        changes.collect()
    }

    /// Returns the level changes of one die (0 red, 1 green, 2 blue) of an LED of the ring.
    fn ring(&self, led: usize, die: usize) -> Vec<Change> {
        let frames = self.ring.get_or_init(|| {
            let chance = Chance::new(self.seed, self.drone, RING.name);
            frames(self.flight, self.options, &chance)
        });
        let mut changes: Vec<Change> = Vec::new();
        for (time_s, frame) in frames {
            let level = f64::from(frame[led][die]) / 255.0;
            if changes.last().map_or(0.0, |last| last.level) != level {
                changes.push(Change { time_s: *time_s, level });
            }
        }
        changes
    }

    /// Returns the level changes of the four dies of the color LED deck.
    fn color_led(&self) -> Vec<Vec<Change>> {
        // The four bytes are packed into one number, so any change counts as a command.
        let commands = self.color_led_commands();
        let initial = commands.first().copied().unwrap_or(0.0);
        let chance = Chance::new(self.seed, self.drone, COLOR_LED.name);
        let arrivals = arrivals(&self.flight.samples, &commands, initial, self.options, &chance);
        let timer = Timer { period_s: COLOR_LED_TICK_S, phase_s: 0.0 };
        let mut changes = self.steady(initial);
        changes.extend(timer.hold(&arrivals));
        let mut dies = vec![Vec::new(); 4];
        for Change { time_s, level } in changes {
            #[expect(clippy::cast_possible_truncation, reason = "packed")]
            let wrgb = (level as u32).to_be_bytes();
            let levels = color_led_levels(wrgb, self.options.color_led_levels);
            dies.iter_mut().zip(levels).for_each(|(die, level)| die.push(Change { time_s, level }));
        }
        dies
    }

    /// Returns the command (`wrgb8888`) to the color LED deck at each sample: its color, dimmed.
    fn color_led_commands(&self) -> Vec<f64> {
        let level = self.flight.lights.get(COLOR_LED.name);
        let colors = COLOR_LED_COLORS.map(|name| self.flight.lights.get(name));
        // If the plan has no color channels, a letter's color persists until the next letter.
        let mut letter = None;
        let samples = self.flight.samples.iter().enumerate();
        Vec::from_iter(samples.map(|(row, sample)| {
            letter = sample.letter.or(letter);
            let wrgb = match colors {
                [Some(white), Some(red), Some(green), Some(blue)] => {
                    [white, red, green, blue].map(|levels| byte(levels[row]))
                }
                _ => self.options.wrgb_of(letter),
            };
            f64::from(packed(&wrgb, level.map_or(1.0, |levels| levels[row])))
        }))
    }
}

/// Intensity of white for the color LED deck, and for one LED of the ring, whose maximum is 1 cd.
/// Twice the deck's value overexposes a seven-letter word at f/22, and half of it leaves 8 steps of
/// green. Screen colors that differ only in brightness become one color, whose strongest channel is
/// as bright as white's.
const WHITE_CD: [f64; 2] = [3.0, 0.5];

/// Intensity factors that are tried in the search for the best bytes. The first is preferred.
const FACTORS: [f64; 17] = [
    1.0, 1.025, 0.975, 1.05, 0.95, 1.075, 0.925, 1.1, 0.9, 1.125, 0.875, 1.15, 0.85, 1.175, 0.825,
    1.2, 0.8,
];

/// Returns the white, red, green and blue bytes with which the color LED deck shows an sRGB color.
pub fn color_led_wrgb(srgb: [u8; 3], levels: ColorLedLevels) -> [u8; 4] {
    let dies = &color_led()[0].dies[1..];
    let [r, g, b] = closest_bytes(dies, srgb, WHITE_CD[0], |die, byte| {
        dies[die].intensity_cd * color_led_levels([byte; 4], levels)[die + 1]
    });
    [0, r, g, b]
}

/// Returns the red, green and blue bytes with which the LED ring shows an sRGB color.
pub fn ring_rgb(srgb: [u8; 3]) -> [u8; 3] {
    let ring = led_ring().into_iter().find(|row| matches!(row.drive, Drive::Ring(_)));
    let dies = ring.map_or(Vec::new(), |row| row.dies);
    closest_bytes(&dies, srgb, WHITE_CD[1], |die, byte| {
        dies[die].intensity_cd * f64::from(byte) / 255.0
    })
}

/// Returns the bytes for red, green and blue dies whose light is closest to an sRGB color, by the
/// largest channel difference on a screen. `cd` gives the luminous intensity of a die at a byte.
/// White has the intensity `white_cd`.
fn closest_bytes(
    dies: &[Die],
    srgb: [u8; 3],
    white_cd: f64,
    cd: impl Fn(usize, u8) -> f64,
) -> [u8; 3] {
    // Computes the color as a mixture of the dies, and as displayed on a screen.
    let chromaticities: [_; 3] = std::array::from_fn(|die| dies[die].chromaticity);
    let color = mixture(chromaticities, srgb);
    let wanted = at_full_scale(match srgb {
        [0, 0, 0] => [1.0; 3],
        _ => srgb.map(|level| linear_from_encoded(f64::from(level) / 255.0)),
    });
    let die_rgb = chromaticities.map(|die| Vector3::from(rgb_from_xyz(xyz(die))));
    // The candidates are, at each intensity, each die's byte below the mixture or the next one.
    let candidates = FACTORS.into_iter().flat_map(|factor| {
        let below = [0, 1, 2].map(|die| {
            let wanted_cd = factor * white_cd * color[die];
            (0..255).rev().find(|byte| cd(die, *byte) <= wanted_cd).unwrap_or(0)
        });
        // The three bits of `up` select one of the two bytes of each die.
        (0..8).map(move |up| std::array::from_fn(|die| below[die] + (up >> die & 1)))
    });
    let with_error = candidates.map(|bytes: [u8; 3]| {
        let rgb: Vector3<f64> = (0..3).map(|die| die_rgb[die] * cd(die, bytes[die])).sum();
        let screen = at_full_scale(rgb.into());
        let errors = (0..3).map(|channel| (screen[channel] - wanted[channel]).abs());
        (bytes, errors.fold(0.0, f64::max))
    });
    with_error.min_by(|a, b| a.1.total_cmp(&b.1)).map_or([0; 3], |(bytes, _)| bytes)
}

/// Scales linear light so that its strongest channel is 1, and encodes it as sRGB, 0 to 1.
fn at_full_scale(rgb: [f64; 3]) -> [f64; 3] {
    // The lower limit only prevents division by zero.
    let largest = rgb.into_iter().fold(1e-9, f64::max);
    rgb.map(|channel| encoded_from_linear((channel / largest).max(0.0)))
}

/// Returns the luminance of each die for an sRGB color at full scale, relative to white. Colors
/// outside the gamut of the dies are clipped, and black counts as white.
pub(super) fn mixture(dies: [[f64; 2]; 3], srgb: [u8; 3]) -> Vector3<f64> {
    let rgb_from_xyz = Matrix3::from_fn(|row, column| RGB_FROM_XYZ[row][column]);
    let xyz_from_dies = Matrix3::from_columns(&dies.map(|die| Vector3::from(xyz(die))));
    let dies_from_rgb = (rgb_from_xyz * xyz_from_dies).try_inverse();
    let linear = Vector3::from(srgb.map(|level| linear_from_encoded(f64::from(level) / 255.0)));
    let full = match linear.max() {
        largest if largest > 0.0 => linear / largest,
        _ => Vector3::repeat(1.0),
    };
    dies_from_rgb.map_or(full, |dies| dies * full).map(|luminance| luminance.max(0.0))
}

/// Returns the levels of the dies of the color LED deck, 0 to 1, which equal those of the integer
/// arithmetic in `color_led_deck.c`.
pub(super) fn color_led_levels(wrgb: [u8; 4], levels: ColorLedLevels) -> [f64; 4] {
    std::array::from_fn(|die| {
        let value = match levels {
            ColorLedLevels::Plain => f64::from(wrgb[die]),
            ColorLedLevels::Corrected => {
                #[expect(clippy::cast_possible_truncation, reason = "as the firmware")]
                let scaled = (f32::from(wrgb[die]) * COLOR_LED_SCALE[die]) as u8;
                // The level increases quadratically from 3 to 255, except that 0 stays dark.
                match f64::from(scaled) / 255.0 {
                    0.0 => 0.0,
                    level => (3.0 + 252.0 * level * level).round(),
                }
            }
        };
        value / 255.0
    })
}
