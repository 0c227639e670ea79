//! Effects of the LED ring: the colors of its twelve LEDs from tick to tick.
//!
//! The effects follow Bitcraze's `ledring12.c`, whose timer calls the effect every 50 ms. Values
//! are 0 to 255, and the light of a WS2812B is proportional to them. Single precision and
//! truncation are the same as in the firmware.

use super::radio::{Chance, Change, Timer, arrivals};
use super::{
    LightOptions, RING, RING_COLORS, RING_LEDS, RingColor, RingEffect, RingFade, ring_memory_rgb,
};
use noctograph_core::crazyflie::RING_TICK_S;
use noctograph_core::flight::Flight;
use noctograph_core::statistics::sort_by_number;

/// Red, green and blue of each LED.
pub(super) type Frame = [[u8; 3]; RING_LEDS];

/// Time between two parameter writes. Red, green and blue of the ring are separate parameters
/// (Crazyswarm issue 728).
const RADIO_WRITE_S: f64 = 0.015;
/// Duration in s that the effect's own arithmetic assumes for one call.
const FADE_STEP_S: f32 = 0.05;
/// Increase of a solid color's brightness per call: 20 calls, or one second, from dark to full.
const BRIGHTNESS_STEP: f32 = 0.05;
const DARK: Frame = [[0; 3]; RING_LEDS];

/// The ring's channels in a plan: on, red, green and blue.
pub(super) const CHANNELS: [&str; 4] = [RING.name, RING_COLORS[0], RING_COLORS[1], RING_COLORS[2]];

/// Returns the frames that the ring shows during a flight, each with its time, except those that
/// repeat the previous frame. A ring without the channel `ring` is always on. A ring that is on at
/// the start of the flight has finished fading in.
pub(super) fn frames(
    flight: &Flight,
    options: &LightOptions,
    chance: &Chance,
) -> Vec<(f64, Frame)> {
    let (Some(first), Some(last)) = (flight.samples.first(), flight.samples.last()) else {
        return Vec::new();
    };
    let period_s = if options.tick_s == 0.0 { RING_TICK_S } else { options.tick_s };
    let timer = Timer { period_s, phase_s: 0.0 };
    let mut ring = Ring::at_start(flight, options);
    let mut commands = commands(flight, options, chance).into_iter().peekable();

    let mut frames = vec![(first.time_s, ring.tick())];
    let mut number = timer.next(first.time_s);
    while timer.tick_s(number) <= last.time_s {
        // At each tick, the firmware applies all commands that have arrived by then.
        let time_s = timer.tick_s(number);
        while let Some((channel, change)) =
            commands.next_if(|(_, c)| timer.next(c.time_s) <= number)
        {
            ring.obey(channel, change.level);
        }
        let frame = ring.tick();
        if frames.last().is_none_or(|(_, previous)| *previous != frame) {
            frames.push((time_s, frame));
        }
        number += 1.0;
    }
    frames
}

/// Returns the commands in order of arrival, each with the index of its channel in [`CHANNELS`].
fn commands(flight: &Flight, options: &LightOptions, chance: &Chance) -> Vec<(usize, Change)> {
    let mut commands = Vec::new();
    let mut write_s = 0.0;
    for (index, channel) in CHANNELS.iter().enumerate() {
        let levels = flight.lights.get(*channel).map_or(&[][..], |levels| levels);
        let initial_level = levels.first().copied().unwrap_or(0.0);
        let changes = arrivals(&flight.samples, levels, initial_level, options, chance).into_iter();
        commands.extend(changes.map(|c| (index, Change { time_s: c.time_s + write_s, ..c })));
        // The color of a fade is one parameter. A solid color has three parameters, which arrive
        // one after another.
        if index > 0 && matches!(options.ring, RingEffect::Solid(_)) {
            write_s += RADIO_WRITE_S;
        }
    }
    sort_by_number(&mut commands, |(_, command)| command.time_s);
    commands
}

/// The state of the ring in the firmware.
#[derive(Debug)]
struct Ring {
    effect: RingEffect,
    on: bool,
    /// True if the ring was on at the last tick.
    was_on: bool,
    color: [u8; 3],
    /// Number of calls since the effect was switched on.
    calls: usize,
    /// Brightness of a solid color, 0 to 1.
    brightness: f32,
    fade: Fade,
}

/// A fade from one color to another.
#[derive(Debug)]
struct Fade {
    from: [f32; 3],
    to: [u8; 3],
    duration_s: f32,
    remaining_s: f32,
}

impl Ring {
    /// Returns the state at the start of a flight, from the first levels of its channels.
    fn at_start(flight: &Flight, options: &LightOptions) -> Self {
        let initial = |channel: usize| flight.lights.get(CHANNELS[channel])?.first().copied();
        let on = initial(0).is_none_or(|level| level > 0.0);
        let (mut color, fade_s) = match &options.ring {
            RingEffect::Off | RingEffect::DoubleSpin => ([0; 3], 0.0),
            RingEffect::Solid(RingColor { color }) | RingEffect::Memory(RingColor { color }) => {
                (*color, 0.0)
            }
            RingEffect::Fade(RingFade { color, fade_s }) => (*color, *fade_s),
        };
        // Channels of the plan take precedence over the color in the scene.
        for (value, channel) in color.iter_mut().zip(1..) {
            *value = initial(channel).map_or(*value, byte);
        }
        #[expect(clippy::cast_possible_truncation, reason = "the firmware's precision")]
        let duration_s = fade_s as f32;
        let fade = Fade { from: color.map(f32::from), to: color, duration_s, remaining_s: 0.0 };
        let effect = options.ring.clone();
        Self { effect, on, was_on: on, color, calls: 0, brightness: 1.0, fade }
    }

    /// Sets a channel, given by its index in [`CHANNELS`], to a level from 0 to 1.
    fn obey(&mut self, channel: usize, level: f64) {
        match channel {
            0 => self.on = level > 0.0,
            _ => self.color[channel - 1] = byte(level),
        }
    }

    /// Calls the effect once, and returns the frame that it shows.
    fn tick(&mut self) -> Frame {
        if self.on && !self.was_on {
            (self.calls, self.brightness) = (0, 0.0);
        }
        self.was_on = self.on;
        if !self.on {
            return DARK;
        }
        self.calls += 1;
        match &self.effect {
            RingEffect::Off => DARK,
            RingEffect::DoubleSpin => double_spin(self.calls),
            RingEffect::Solid(_) => {
                // As in the firmware, the sum of rounded steps may exceed 1 for one call.
                if self.brightness < 1.0 {
                    self.brightness += BRIGHTNESS_STEP;
                } else {
                    self.brightness = 1.0;
                }
                [self.color.map(|value| cut(f32::from(value) * self.brightness)); RING_LEDS]
            }
            RingEffect::Memory(_) => [ring_memory_rgb(self.color); RING_LEDS],
            RingEffect::Fade(_) => [self.fade.tick(self.color); RING_LEDS],
        }
    }
}

impl Fade {
    /// Advances one call toward `color`, linearly in time. Returns the color before the call,
    /// because the first call after a new color still shows the old one.
    fn tick(&mut self, color: [u8; 3]) -> [u8; 3] {
        if color != self.to {
            self.from = self.present_color();
            (self.to, self.remaining_s) = (color, self.duration_s);
        }
        if self.remaining_s <= 0.0 {
            return self.to;
        }
        let shown = self.present_color();
        self.remaining_s -= FADE_STEP_S;
        shown.map(cut)
    }

    /// Returns the present color between the two ends of the fade, 0 to 255 in each channel.
    fn present_color(&self) -> [f32; 3] {
        let is_fading = self.remaining_s > 0.0;
        let remaining = if is_fading { self.remaining_s / self.duration_s } else { 0.0 };
        let [from, to] = [self.from, self.to.map(f32::from)];
        std::array::from_fn(|i| remaining * from[i] + (1.0 - remaining) * to[i])
    }
}

/// The two lights of the double spinner, each a head and a tail of two LEDs. All other LEDs are
/// dark.
const WHITE_LIGHT: [[u8; 3]; 3] = [[32; 3], [8; 3], [2; 3]];
const BLUE_LIGHT: [[u8; 3]; 3] = [[64, 64, 255], [32, 32, 64], [8, 8, 16]];

/// Returns the frame of the double spinner at a call, counted from 1. The white light moves toward
/// lower LED numbers and the blue light toward higher ones, by one LED per call. Their tails
/// follow. Each LED shows half of both lights.
fn double_spin(call: usize) -> Frame {
    let mut frame = DARK;
    for (behind, (white, blue)) in WHITE_LIGHT.iter().zip(BLUE_LIGHT).enumerate() {
        let turn = call % RING_LEDS;
        for (led, light) in [(RING_LEDS + behind - turn, white), (RING_LEDS + turn - behind, &blue)]
        {
            for (sum, value) in frame[led % RING_LEDS].iter_mut().zip(light) {
                *sum += value / 2;
            }
        }
    }
    frame
}

/// Returns the byte, 0 to 255, that is nearest to a level from 0 to 1.
#[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
pub(super) fn byte(level: f64) -> u8 {
    (255.0 * level).round().clamp(0.0, 255.0) as u8
}

/// Truncates a value to a byte, as the firmware does.
#[expect(clippy::cast_possible_truncation, reason = "as the firmware")]
fn cut(value: f32) -> u8 {
    value as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(ring: RingEffect) -> Ring {
        let options = LightOptions { ring, ..LightOptions::default() };
        Ring::at_start(&Flight::default(), &options)
    }

    #[test]
    fn a_solid_color_is_faded_in_within_20_calls_when_the_ring_is_switched_on() {
        let mut ring = ring(RingEffect::Solid(RingColor { color: [200, 20, 0] }));
        assert_eq!(ring.tick()[0], [200, 20, 0], "long switched on");
        ring.on = false;
        assert_eq!(ring.tick(), DARK);
        ring.on = true;
        let frames: Vec<[u8; 3]> = (0..20).map(|_| ring.tick()[7]).collect();
        assert_eq!((frames[0], frames[9], frames[19]), ([10, 1, 0], [100, 10, 0], [200, 20, 0]));
        assert!(frames.windows(2).all(|pair| pair[0][0] < pair[1][0]), "{frames:?}");
        ring.color = [100, 0, 0];
        assert_eq!(ring.tick()[0], [100, 0, 0], "another color comes at once");
    }

    #[test]
    fn a_fade_is_linear_over_its_time() {
        let mut ring = ring(RingEffect::Fade(RingFade { color: [0; 3], fade_s: 0.5 }));
        ring.tick();
        ring.color = [200, 100, 0];
        let reds: Vec<u8> = (0..12).map(|_| ring.tick()[0][0]).collect();
        for (step, red) in reds.iter().enumerate() {
            let linear = 20.0 * f64::from(u8::try_from(step).unwrap());
            assert!((f64::from(*red) - linear.min(200.0)).abs() <= 1.0, "{reds:?}");
        }
        ring.fade.duration_s = 0.0;
        ring.color = [7, 8, 9];
        assert_eq!(ring.tick()[0], [7, 8, 9], "no time, no fade");
    }

    #[test]
    fn the_double_spinner_turns_in_12_calls_with_a_white_and_a_blue_light() {
        assert_eq!(double_spin(1), double_spin(13));
        let frame = double_spin(3);
        assert_eq!((frame[9], frame[10], frame[11]), ([16; 3], [4; 3], [1; 3]), "white");
        assert_eq!((frame[3], frame[2]), ([32, 32, 127], [16, 16, 32]), "blue");
        assert_eq!(frame[1], [4, 4, 8]);
        assert_eq!(double_spin(12)[0], [48, 48, 143], "where they meet they add");
        let sums = [0, 1, 2].map(|die| frame.iter().map(|led| u32::from(led[die])).sum::<u32>());
        assert_eq!(sums, [73, 73, 188], "of 3060");
    }

    #[test]
    fn led_memory_rounds_to_16_bits() {
        // In the firmware, R8 = (R5·527 + 23) >> 6 and G8 = (G6·259 + 33) >> 6.
        assert_eq!(ring_memory_rgb([255; 3]), [255; 3]);
        assert_eq!(ring_memory_rgb([0; 3]), [0; 3]);
        assert_eq!(ring_memory_rgb([20, 20, 20]), [16, 20, 16], "20 is 2 of 31 and 5 of 63");
        for value in 0..=255_u8 {
            let [red, green, _] = ring_memory_rgb([value; 3]);
            assert!(red.abs_diff(value) <= 4 && green.abs_diff(value) <= 2, "{value}");
        }
    }
}
