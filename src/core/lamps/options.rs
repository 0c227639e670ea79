//! Options for the drone's lamps, and for how they follow commands.

use super::{Deck, Fixture};
use crate::error::{Result, within};
use crate::settings::{Described, settings};

settings! {
    /// The drone's lamps, and their response to commands.
    ///
    /// The defaults are those of the reference flight, a Crazyflie 2.x with the LED-ring deck. The
    /// ring shows the firmware's initial effect, because the team's script never turned it off.
    pub struct LightOptions {
        /// Delay from sending a light command to its arrival in the firmware.
        ///
        /// One parameter write takes about 20 ms one way (crazyswarm issue 245). If the delay is
        /// too short, the simulation lacks the streaks at the ends of strokes.
        radio_delay_s: f64 = 0.02, in 0.0..=10.0;
        /// Period of the firmware's lamp timer, 0 or at least 0.001. Changes of a lamp take effect
        /// at the timer's next tick. With a period of 0, the headlights follow immediately, and the
        /// effects of the ring keep their period of 50 ms.
        ///
        /// Source: `ledring12.c`.
        tick_s: f64 = 0.05, in 0.0..=10.0;
        /// Firmware parameter led.bitmask. With bit 7 set, bits 0 to 6 turn on the LEDs of the
        /// board, so that 128 turns off all of them. With 0, the firmware controls these LEDs.
        ///
        /// Source: `led.c`.
        led_bitmask: u8 = 0;
        /// White, red, green and blue of the color LED deck, 0 to 255.
        ///
        /// Firmware parameter: `colorLedBot.wrgb8888`.
        color_led_wrgb: [u8; 4] = [255, 0, 0, 0];
        /// White, red, green and blue of successive letters, for the color LED deck or, without
        /// white, for the ring. If empty, all letters have the same color.
        letters_wrgb: Vec<[u8; 4]> = Vec::new();
        /// Brightness correction of the color LED deck.
        ///
        /// Firmware parameter: `colorLedBot.brightCorr`. A drawing's colors are written without
        /// this correction.
        color_led_levels: ColorLedLevels = ColorLedLevels::Corrected;
        /// Deck below the body. If `fixtures` is empty, the drone's lamps are those of the deck and
        /// the board.
        deck: Deck = Deck::LedRing, unless "light.fixtures";
        /// Lamps that replace those of deck and board, one table each. The intensity off axis is
        /// `intensity_cd * (spill + (1 - spill) cos^beam_exponent)`.
        fixtures: Option<Vec<Fixture>> = None;
        /// Effect of the LED ring (firmware parameter ring.effect).
        ring: RingEffect = RingEffect::default();
        fixed {
            /// Maximum in s of a uniformly distributed jitter that is added to the radio delay.
            ///
            /// The value is an assumption. Jitter is caused by repeated packets.
            radio_jitter_s: f64 = 0.01;
            /// Maximum distance in m of a lamp from its path between two samples. The default is
            /// 1 % of a pixel that shows one millimeter. A smaller distance would require more
            /// samples without a visible benefit.
            path_tolerance_m: f64 = 10e-6;
        }
    }

    /// Effect of the LED ring. The firmware has further effects.
    pub enum RingEffect tagged {
        /// Effect 6, the default of the firmware, in which a white and a blue light rotate in
        /// opposite directions, one turn in 0.6 s.
        "double-spin" => DoubleSpin,
        /// Effect 0, no light.
        "off" => Off,
        /// Effect 7, one color, which fades in within 1 s when the ring is switched on.
        "solid" => Solid(RingColor),
        /// Effect 13, LED memory, one color for all LEDs, rounded to 16 bits (RGB565).
        "memory" => Memory(RingColor),
        /// Effect 14, one color that fades into the next.
        "fade" => Fade(RingFade),
    }

    /// Color of the ring.
    pub struct RingColor {
        /// Red, green and blue, 0 to 255, linear in light, unless the plan has the channels
        /// ring.red, ring.green and ring.blue (in which 1 corresponds to 255).
        color: [u8; 3] = [20; 3];
    }

    /// Color of the ring, and the duration of its fading.
    pub struct RingFade {
        /// Red, green and blue, 0 to 255, linear in light, unless the plan has the channels
        /// ring.red, ring.green and ring.blue (in which 1 corresponds to 255).
        color: [u8; 3] = [20; 3];
        /// Duration of fading from one color to the next (firmware parameter ring.fadeTime).
        fade_s: f64 = 0.5, in 0.0..=1000.0;
    }

    /// Brightness correction of the color LED deck.
    pub enum ColorLedLevels {
        /// Equalized and squared, the default of the firmware, which scales white, red, green and
        /// blue by 0.99, 0.78, 0.51 and 1, respectively, and then converts to `3 + 252 (v/255)²`.
        "corrected" => Corrected,
        /// No correction.
        "plain" => Plain,
    }
}

impl LightOptions {
    /// Returns the listed lamps, or those of the deck and the board if none are listed.
    pub fn fixtures(&self) -> Vec<Fixture> {
        self.fixtures.clone().unwrap_or_else(|| self.deck.fixtures())
    }

    /// Returns white, red, green and blue of the color LED deck for a letter, counted from 0. The
    /// listed colors repeat if there are more letters than colors.
    pub fn wrgb_of(&self, letter: Option<usize>) -> [u8; 4] {
        let colors = &self.letters_wrgb;
        match letter {
            Some(letter) if !colors.is_empty() => colors[letter % colors.len()],
            _ => self.color_led_wrgb,
        }
    }

    /// Returns red, green and blue of the ring for a letter, counted from 0. This is the letter's
    /// color or, if that is only white, the color of the effect.
    pub fn ring_rgb_of(&self, letter: Option<usize>) -> [u8; 3] {
        match (self.wrgb_of(letter), &self.ring) {
            ([_, r, g, b], _) if !self.letters_wrgb.is_empty() && [r, g, b] != [0; 3] => [r, g, b],
            (_, RingEffect::Solid(ring) | RingEffect::Memory(ring)) => ring.color,
            (_, RingEffect::Fade(ring)) => ring.color,
            (_, RingEffect::DoubleSpin | RingEffect::Off) => RingColor::default().color,
        }
    }

    /// Checks that all settings are within their ranges, and that the fixtures suit their drives.
    ///
    /// # Errors
    ///
    /// Returns [`crate::error::Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        Described::check(self, "light", None)?;
        if self.tick_s != 0.0 {
            within("light.tick_s", self.tick_s, 0.001, 10.0)?;
        }
        self.fixtures().iter().try_for_each(|fixture| fixture.check_drive("light.fixtures"))
    }
}
