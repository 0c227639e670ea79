//! Options: the lamps of the drone, and how they follow commands.

use super::{Deck, Fixture};
use crate::error::{Result, within};
use crate::settings::{Described, settings};

settings! {
    /// The lamps, and how they follow commands.
    ///
    /// By default those of the reference flight: a Crazyflie 2.x with the LED-ring deck, its ring
    /// as the firmware starts it, since the team's script never turned it off.
    pub struct LightOptions {
        /// Delay from sending a light command to its arrival in the firmware.
        ///
        /// One parameter write takes about 20 ms one way (crazyswarm issue 245). Too little hides
        /// streaks at the ends of strokes.
        radio_delay_s: f64 = 0.02, in 0.0..=10.0;
        /// Period of the lamp timer of the firmware, 0 or at least 0.001. Changes wait for its next
        /// tick. With 0 the headlights follow at once, and the effects of the ring keep 50 ms.
        ///
        /// `ledring12.c`.
        tick_s: f64 = 0.05, in 0.0..=10.0;
        /// Parameter led.bitmask of the firmware: with bit 7 set, bits 0 to 6 turn the LEDs of the
        /// board on, so that 128 turns all of them off. 0 leaves them to the firmware.
        ///
        /// `led.c`.
        led_bitmask: u8 = 0;
        /// White, red, green, blue of the color LED deck, 0 to 255.
        ///
        /// `colorLedBot.wrgb8888`.
        color_led_wrgb: [u8; 4] = [255, 0, 0, 0];
        /// White, red, green, blue of the letters in turn, of the color LED deck or, without white,
        /// of the ring, or empty if all are alike.
        letters_wrgb: Vec<[u8; 4]> = Vec::new();
        /// Brightness correction of the color LED deck.
        ///
        /// `colorLedBot.brightCorr`. The colors of a drawing are written without it.
        color_led_levels: ColorLedLevels = ColorLedLevels::Corrected;
        /// Deck below the body. Its lamps and the board's are the lamps, unless fixtures lists
        /// them.
        deck: Deck = Deck::LedRing, unless "light.fixtures";
        /// The lamps, in place of those of deck and board, one table each. Intensity off axis:
        /// `intensity_cd * (spill + (1 - spill) cos^beam_exponent)`.
        fixtures: Option<Vec<Fixture>> = None;
        /// Effect of the LED ring (ring.effect of the firmware).
        ring: RingEffect = RingEffect::default();
        fixed {
            /// Jitter of that delay, added with even distribution.
            ///
            /// An assumption: repeated packets cause it.
            radio_jitter_s: f64 = 0.01;
        }
    }

    /// Effect of the LED ring. The firmware has more than these.
    pub enum RingEffect tagged {
        /// 6, the default of the firmware: a white and a blue light that run against each other, a
        /// turn in 0.6 s.
        "double-spin" => DoubleSpin,
        /// 0: none.
        "off" => Off,
        /// 7: one color, faded in within 1 s when the ring is switched on.
        "solid" => Solid(RingColor),
        /// 13, LED memory: one color for all LEDs, rounded to 16 bits (RGB565).
        "memory" => Memory(RingColor),
        /// 14: one color that fades to the next.
        "fade" => Fade(RingFade),
    }

    /// Color of the ring.
    pub struct RingColor {
        /// Red, green, blue, 0 to 255, linear in light, unless the plan has the channels ring.red,
        /// ring.green, ring.blue (1 is 255).
        color: [u8; 3] = [20; 3];
    }

    /// Color of the ring, and its fading.
    pub struct RingFade {
        /// Red, green, blue, 0 to 255, linear in light, unless the plan has the channels ring.red,
        /// ring.green, ring.blue (1 is 255).
        color: [u8; 3] = [20; 3];
        /// Time from one color to the next (ring.fadeTime).
        fade_s: f64 = 0.5, in 0.0..=1000.0;
    }

    /// Brightness correction of the color LED deck.
    pub enum ColorLedLevels {
        /// Evened out and squared, the default of the firmware: white, red, green and blue are
        /// scaled by 0.99, 0.78, 0.51 and 1, then `3 + 252 (v/255)²`.
        "corrected" => Corrected,
        /// None.
        "plain" => Plain,
    }
}

impl LightOptions {
    /// The listed lamps, or those of deck and board if none are listed.
    pub fn fixtures(&self) -> Vec<Fixture> {
        self.fixtures.clone().unwrap_or_else(|| self.deck.fixtures())
    }

    /// White, red, green and blue of the color LED deck on a letter, counted from 0. The colors of
    /// the letters repeat.
    pub fn wrgb_of(&self, letter: Option<usize>) -> [u8; 4] {
        let colors = &self.letters_wrgb;
        match letter {
            Some(letter) if !colors.is_empty() => colors[letter % colors.len()],
            _ => self.color_led_wrgb,
        }
    }

    /// Red, green and blue of the ring on a letter, counted from 0: the letter's, unless it has
    /// only white, else that of the effect.
    pub fn ring_rgb_of(&self, letter: Option<usize>) -> [u8; 3] {
        match (self.wrgb_of(letter), &self.ring) {
            ([_, r, g, b], _) if !self.letters_wrgb.is_empty() && [r, g, b] != [0; 3] => [r, g, b],
            (_, RingEffect::Solid(ring) | RingEffect::Memory(ring)) => ring.color,
            (_, RingEffect::Fade(ring)) => ring.color,
            (_, RingEffect::DoubleSpin | RingEffect::Off) => RingColor::default().color,
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`crate::error::Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        Described::check(self, "light", None)?;
        if self.tick_s != 0.0 {
            within("light.tick_s", self.tick_s, 0.001, 10.0)?;
        }
        self.fixtures().iter().try_for_each(|fixture| fixture.check_drive("light.fixtures"))
    }
}
