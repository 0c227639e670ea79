//! Options: which lamps the drone carries, and how they follow commands.

use serde::{Deserialize, Serialize};

use super::Fixture;
use super::tables::{color_led, crazyflie, led_ring};
use crate::error::{Result, within};

/// Which lamps the drone carries, and how they follow commands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightOptions {
    /// From sending a command to its arrival in the firmware. One parameter write takes about
    /// 20 ms one way (crazyswarm issue 245); too little hides streaks at the ends of strokes.
    pub radio_delay_s: f64,
    /// What a command may take longer, evenly spread. An assumption; repeated packets make it.
    pub radio_jitter_s: f64,
    /// From one parameter write to the next (crazyswarm issue 728): the ring's red, green and blue
    /// are three parameters and arrive this far apart.
    pub radio_write_s: f64,
    /// Period of the firmware's lamp timer (`ledring12.c`); changes wait for its next tick. With 0
    /// the headlights follow at once, and the ring's effects keep their 50 ms.
    pub tick_s: f64,
    /// When the timer first ticks.
    pub tick_phase_s: f64,
    /// How long a lamp takes from dark to full level, evenly. LEDs take less than 1 µs.
    pub rise_s: f64,
    /// How long it takes from full level to dark, evenly. A white LED's phosphor takes about 1 µs:
    /// a stroke that goes on too long has other causes.
    pub decay_s: f64,
    /// Whether pulse-width modulation is drawn.
    pub pwm: Pwm,
    /// The firmware's parameter `led.bitmask` (`led.c`): with bit 7 set, bits 0 to 6 are the
    /// board's LEDs, lit or not; 128 turns all of them off. 0 leaves them to the firmware.
    pub led_bitmask: u8,
    /// The LED ring's effect (`ring.effect`).
    pub ring_effect: RingEffect,
    /// Red, green, blue that the ring shows, 0 to 255, linear in light: `ring.solidRed` and so on
    /// for `solid`, `ring.fadeColor` for `fade`, all twelve LEDs for `memory`. The plan's channels
    /// `ring.red`, `ring.green`, `ring.blue` (1 is 255) go before it.
    pub ring_color: [u8; 3],
    /// How long the ring fades from one color to the next (`ring.fadeTime`).
    pub ring_fade_s: f64,
    /// White, red, green, blue of the color LED deck, 0 to 255 (`colorLedBot.wrgb8888`).
    pub color_led_wrgb: [u8; 4],
    /// What the color LED deck makes of them (`colorLedBot.brightCorr`).
    pub color_led_levels: ColorLedLevels,
    /// The deck below the body.
    pub deck: Deck,
    /// The lamps; those of the board and of the deck where it is `None`.
    #[serde(default)]
    pub fixtures: Option<Vec<Fixture>>,
}

/// How a lamp that is dimmed by pulse width is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pwm {
    /// As its mean: right where pulses blur into each other.
    #[default]
    Off,
    /// Pulse by pulse: right where the lamp moves by more than two widths of its spot from pulse to
    /// pulse (400 Hz at more than 1 m/s in a sharp picture). Makes many samples.
    On,
}

/// What the LED ring shows. The firmware knows more; these are what people use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RingEffect {
    /// 0: nothing.
    Off,
    /// 6, the firmware's default: a white and a blue light run against each other, a turn in 0.6 s.
    #[default]
    DoubleSpin,
    /// 7: one color, faded in within 1 s when the ring is switched on.
    Solid,
    /// 13, LED memory: one color, rounded to 16 bits (RGB565).
    Memory,
    /// 14: one color; another one is faded to within `ring_fade_s`.
    Fade,
}

/// What the color LED deck makes of its four numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColorLedLevels {
    /// Evened out and squared, the firmware's default: each die is scaled to the weakest one's
    /// 50 lm, then `3 + 252 (v/255)²`.
    #[default]
    Corrected,
    /// As they are.
    Plain,
}

/// A deck with lamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Deck {
    /// None.
    None,
    /// The LED-ring deck: [`super::tables::led_ring`].
    #[default]
    LedRing,
    /// The color LED deck: [`super::tables::color_led`].
    ColorLed,
}

impl Deck {
    /// The lamps of a Crazyflie 2.x with this deck.
    #[must_use]
    pub fn fixtures(self) -> Vec<Fixture> {
        let of_deck = match self {
            Self::None => Vec::new(),
            Self::LedRing => led_ring(),
            Self::ColorLed => color_led(),
        };
        of_deck.into_iter().chain(crazyflie()).collect()
    }
}

impl Default for LightOptions {
    /// The reference flight's drone: a Crazyflie 2.x with the LED-ring deck, its ring as the
    /// firmware starts it, since the team's script never turned it off.
    fn default() -> Self {
        Self {
            radio_delay_s: 0.02,
            radio_jitter_s: 0.01,
            radio_write_s: 0.015,
            tick_s: 0.05,
            tick_phase_s: 0.0,
            rise_s: 0.0,
            decay_s: 0.0,
            pwm: Pwm::Off,
            led_bitmask: 0,
            ring_effect: RingEffect::DoubleSpin,
            ring_color: [20; 3],
            ring_fade_s: 0.5,
            color_led_wrgb: [255, 0, 0, 0],
            color_led_levels: ColorLedLevels::Corrected,
            deck: Deck::LedRing,
            fixtures: Some(Deck::LedRing.fixtures()),
        }
    }
}

impl LightOptions {
    /// The lamps.
    #[must_use]
    pub fn fixtures(&self) -> Vec<Fixture> {
        self.fixtures.clone().unwrap_or_else(|| self.deck.fixtures())
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`crate::error::Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        within("light.radio_delay_s", self.radio_delay_s, 0.0, 10.0)?;
        within("light.radio_jitter_s", self.radio_jitter_s, 0.0, 10.0)?;
        within("light.radio_write_s", self.radio_write_s, 0.0, 10.0)?;
        if self.tick_s != 0.0 {
            within("light.tick_s", self.tick_s, 0.001, 10.0)?;
        }
        within("light.tick_phase_s", self.tick_phase_s, 0.0, 10.0)?;
        within("light.rise_s", self.rise_s, 0.0, 10.0)?;
        within("light.decay_s", self.decay_s, 0.0, 10.0)?;
        within("light.ring_fade_s", self.ring_fade_s, 0.0, 1000.0)?;
        self.fixtures().iter().try_for_each(|fixture| fixture.check("light.fixtures"))
    }
}
