//! Tables of the lamps on existing drones and decks.
//!
//! A scene file contains the rows themselves, so changes to these tables do not affect its photo.
//!
//! The sources are Bitcraze's data sheets of the LED-ring deck (headlights "> 1800 mcd", twelve
//! WS2812B on a circle of 13.7 mm) and their firmware (`led.h`, `ledseq.c`, `ledring12.c`,
//! `color_led_deck.h`). WS2812B data sheets give 390–420, 660–720 and 180–200 mcd at 620, 522 and
//! 466 nm, respectively, a beam 120° wide, and pulse width modulation at 400 Hz or more. The
//! chromaticities are those of Gaussian spectra at these wavelengths, 20, 35 and 25 nm wide.

use super::{COLOR_LED, Die, Drive, Fixture, HEADLIGHTS, RING_LEDS};
use crate::settings::settings;

settings! {
    /// A deck with lamps.
    pub enum Deck {
        /// The LED-ring deck.
        "led-ring" => LedRing,
        /// The color LED deck.
        "color-led" => ColorLed,
        /// No deck.
        "none" => None,
    }
}

impl Deck {
    /// Returns the deck's lamps, and the name of the channel that drives the deck unless the scene
    /// names others.
    fn row(self) -> (Vec<Fixture>, &'static str) {
        match self {
            Self::LedRing => (led_ring(), HEADLIGHTS),
            Self::ColorLed => (color_led(), COLOR_LED.name),
            Self::None => (Vec::new(), HEADLIGHTS),
        }
    }

    /// Returns the lamps of a Crazyflie 2.x with this deck.
    pub fn fixtures(self) -> Vec<Fixture> {
        self.row().0.into_iter().chain(crazyflie()).collect()
    }

    /// Returns the channel that drives the deck unless the scene names others.
    pub fn channel(self) -> &'static str {
        self.row().1
    }
}

/// Chromaticity of red, 622 nm.
const RED: [f64; 2] = [0.694, 0.306];
/// Chromaticity of green, 525 nm.
const GREEN: [f64; 2] = [0.151, 0.758];
/// Chromaticity of the ring's blue, 466 nm.
const BLUE: [f64; 2] = [0.132, 0.049];
/// Chromaticity of the board's blue LEDs (475 nm), with 0.14 of green in the team's photograph.
const BOARD_BLUE: [f64; 2] = [0.121, 0.098];
/// Chromaticity of white, that of D65.
const WHITE: [f64; 2] = [0.3127, 0.329];
/// Chromaticity of the headlights' white, taken from the unclipped parts of the team's photograph.
const HEADLIGHT: [f64; 2] = [0.31, 0.335];

/// Returns the LEDs on the board of a Crazyflie 2.x, which appear in pictures but not in plans.
/// Positions are in m in the body frame, and intensities in cd.
///
/// The blue power LEDs at the rear (M2, M3) are always lit. The red status LED at the front right
/// (M1) is lit for 50 ms of every 0.5 s once the sensors are calibrated (`seq_calibrated_def`,
/// lines 65 to 69 of `ledseq.c` at 016e1e7). The link LED at the front left (M4) flashes red for
/// every packet sent (`radiolinkSyslinkDispatch`, `radiolink.c`), until the next 1 ms tick of its
/// timer, half a tick later on average (`seq_linkup_def` and `runLedseq`, `ledseq.c`). The
/// reference flight's log of 38 variables in seven blocks, sent every 10 ms if the radio keeps up,
/// takes 279 packets per second. At 0.2 m/s, the flashes are 0.7 mm apart and form a faint thin
/// line, as in the team's photograph. Received packets leave no green in that photograph.
///
/// The intensities are assumed to be 40 mcd of blue and 30 mcd of red in every direction, because a
/// small package (0603 class) and the white solder mask around it also emit sideways. The LEDs are
/// at the motor mounts, 30 mm from the center on both axes. From below, the board hides these LEDs.
/// The intensities are fitted to the team's photograph, in which a pixel is 3.1 mm. In 536 profiles
/// across a vertical blue strand, the green channel exceeds the levels 240, 200 and 150 over widths
/// of 2.9, 4.0 and 5.3 px, respectively (in our render 3.4, 4.5 and 5.5 px). A horizontal strand is
/// about half as wide, as if the light came from a flat disc around the LED.
pub fn crazyflie() -> Vec<Fixture> {
    let (blue, red) = (die(0.04, BOARD_BLUE), die(0.03, RED));
    let packets = Drive::Flicker { flashes_hz: 280.0, flash_s: 0.0005 };
    let status = Drive::Blink { on_s: 0.05, period_s: 0.5, phase_s: 0.0 };
    let mut rows = Vec::new();
    for (name, drive, [x, y], die, bit) in [
        ("power M2", Drive::Always, [-0.03, -0.03], blue.clone(), 5),
        ("power M3", Drive::Always, [-0.03, 0.03], blue, 0),
        ("status M1", status, [0.03, -0.03], red.clone(), 4),
        ("link M4", packets, [0.03, 0.03], red, 2),
    ] {
        rows.push(Fixture {
            name: name.into(),
            drive,
            position_body_m: [x, y, 0.0],
            axis_body: [0.0, 0.0, 1.0],
            dies: vec![die],
            spill: 1.0,
            visible_cos: -0.5,
            diameter_m: 0.0075,
            depth_m: Some(0.001),
            bitmask_bit: Some(bit),
            ..Fixture::default()
        });
    }
    // The first three LEDs have reflections. The link LED is too faint for one. The fractions of
    // light that propeller and body reflect, and the diameters of these reflections, are fitted to
    // the photograph.
    for led in 0..3 {
        let [x, y, _] = rows[led].position_body_m;
        let propeller_m = [0.044 * x.signum(), 0.044 * y.signum(), 0.01];
        rows.push(lit_by(&rows[led], "propeller", propeller_m, 0.1, 0.004));
        rows.push(lit_by(&rows[led], "body", rows[led].position_body_m, 0.4, 0.02));
    }
    rows
}

/// Returns the fixture for a part of the drone that reflects the light of an LED on the board.
/// `fraction` is the reflected part of the LED's intensity.
///
/// In the team's photograph, a fainter strand runs beside each blue one, and a fainter dot appears
/// beside each red one, 13 to 15 mm farther from the middle of the drone. In the fainter strand,
/// blue is unclipped at 0.7 of saturation. In the main strand, the green channel is clipped as
/// well. The propeller, which is a centimeter higher, is assumed to reflect that light. The body
/// consists of the motor, its mount and the arm around the LED.
fn lit_by(
    led: &Fixture,
    part: &str,
    position_body_m: [f64; 3],
    fraction: f64,
    diameter_m: f64,
) -> Fixture {
    let name = format!("{} on the {part}", led.name);
    let dies = led.dies.iter();
    let dies = dies.map(|led| die(led.intensity_cd * fraction, led.chromaticity)).collect();
    Fixture { name, position_body_m, dies, diameter_m, depth_m: None, ..led.clone() }
}

/// Returns the LED-ring deck below the body, with two headlights that point forward and twelve RGB
/// LEDs that point down.
///
/// LED 0 is at the front, and the numbers increase to the right, as in the deck's drawing.
///
/// Seen from the side, most of a headlight's light comes from the body. In the team's photograph, a
/// stroke is a band 11 to 14 px wide (3.1 mm per pixel), as wide as the front of the drone, at 0.6
/// to 0.8 of saturation. The band contains the saturated strands of the headlights. The first N and
/// the O's, which show the drone from its side, contain another strand 15 mm ahead of them. The R,
/// to the right of the camera, contains two such strands, 11 and 20 mm ahead in its stem and 17 and
/// 25 mm ahead in its bowl, as far to the left and right as the motors. The band has sharp edges.
/// Beyond the last pixel above level 200, green falls to 0.26, 0.016 and 0.005 of saturation (in
/// our render 0.34, 0.023 and 0.005). The drone's front is therefore modeled as a block instead of
/// a Gaussian lamp. Fitted to the photograph, 1.2 % of a headlight's light goes to its side, arms,
/// mounts and propellers reflect 0.13 cd of both headlights, and a motor reflects 0.03 cd of each.
///
/// The deck and the battery are assumed to hide a headlight beyond 120° from its beam.
///
/// Seen from the side, the white packages of the ring's LEDs glow. In a public photograph of a
/// flower (docs/photograph.md), strokes are ribbons with brighter edges, which are as wide as the
/// ring when the drone climbs. As far as a JPEG of 510 px shows, these ribbons are 5 to 30 times as
/// bright as a power LED of the board beside them. With an isotropic fraction of 0.15, they are 5
/// times as bright. From above, the deck hides the ring's LEDs. The team's camera, 16° and more
/// above the letters, only recorded the glow on the floor of a ring that swings by 4°.
pub fn led_ring() -> Vec<Fixture> {
    // The rows are the two headlights, the LEDs of the ring, and the parts of the body that the
    // headlights illuminate.
    let mut rows = vec![headlight("headlight left", 0.01), headlight("headlight right", -0.01)];
    rows.extend((0..RING_LEDS).map(|led| Fixture {
        name: format!("ring {led}"),
        drive: Drive::Ring(led),
        position_body_m: ring_position_body_m(led),
        axis_body: [0.0, 0.0, -1.0],
        dies: vec![die(0.4, RED), die(0.69, GREEN), die(0.19, BLUE)],
        spill: 0.15,
        visible_cos: -0.2,
        diameter_m: 0.005,
        ..Fixture::default()
    }));
    for (name, position_body_m, intensity_cd, diameter_m, depth_m) in [
        ("headlights on the body", [0.028, 0.0, 0.0], 0.13, 0.024, Some(0.025)),
        ("headlight left on the motor", [MOTOR_M, MOTOR_M, 0.0], 0.03, 0.008, None),
        ("headlight right on the motor", [MOTOR_M, -MOTOR_M, 0.0], 0.03, 0.008, None),
    ] {
        let dies = vec![die(intensity_cd, HEADLIGHT)];
        let lit = headlight(name, 0.0);
        rows.push(Fixture { position_body_m, dies, spill: 1.0, diameter_m, depth_m, ..lit });
    }
    rows
}

/// Distance of a motor from the middle on both axes in m, at 45° on an arm of 46 mm
/// (`vehicle.arm_m`).
const MOTOR_M: f64 = 0.0325;

/// Returns the position in m of an LED of the ring in the body frame. The LEDs are 30° apart,
/// clockwise on a circle of 13.7 mm, rounded to 0.01 mm, 12 mm below the drone's middle.
fn ring_position_body_m(led: usize) -> [f64; 3] {
    let (sin, cos) = libm::sincos(led as f64 * core::f64::consts::FRAC_PI_6);
    // The radius is in units of 0.01 mm, of which there are 1e5 in a meter. Adding zero turns a
    // negative zero into zero.
    let [forward_m, left_m] = [cos, -sin].map(|part| (1370.0 * part).round() / 1e5 + 0.0);
    [forward_m, left_m, -0.012]
}

/// Returns a headlight of the ring deck, at a distance `left_m` to the left of the center, with 1.8
/// cd along its axis.
fn headlight(name: &str, left_m: f64) -> Fixture {
    Fixture {
        name: name.into(),
        drive: Drive::Command(HEADLIGHTS.into()),
        position_body_m: [0.016, left_m, -0.01],
        axis_body: [1.0, 0.0, 0.0],
        dies: vec![die(1.8, HEADLIGHT)],
        spill: 0.012,
        visible_cos: -0.5,
        diameter_m: 0.003,
        ..Fixture::default()
    }
}

/// Returns the color LED deck of 2025 below the body, which has four dies under a diffuser.
///
/// The diffuser is a bowl 34.7 mm wide and 9.2 mm deep (Bitcraze's mechanical drawing of the LED
/// diffuser, which comes with the deck). In Bitcraze's film of the deck, the diffuser is evenly
/// bright from the side. A stroke is therefore wide when the drone climbs and narrow when it flies
/// level. Seen from the side, an evenly bright bowl has 0.31 times its intensity from below, which
/// is the ratio of the projected areas. Its luminous flux is 4.7 sr times the intensity from below.
/// According to the firmware, the dies emit 250, 139, 210 and 50 lm.
///
/// The diffuser is assumed to transmit 0.7 of their light. The board hides the bowl from above. The
/// dies are pulse width modulated at 1 kHz. The throttling of hot dies is not modeled.
pub fn color_led() -> Vec<Fixture> {
    let [white, red, green, blue] = [250.0, 139.0, 210.0, 50.0].map(|lm| lm * DIFFUSED);
    vec![Fixture {
        name: "color LED".into(),
        drive: Drive::ColorLed,
        position_body_m: [0.0, 0.0, -0.015],
        axis_body: [0.0, 0.0, -1.0],
        dies: vec![die(white, WHITE), die(red, RED), die(green, GREEN), die(blue, BLUE)],
        spill: 0.31,
        visible_cos: -0.3,
        diameter_m: 0.0347,
        depth_m: Some(0.0092),
        ..Fixture::default()
    }]
}

/// Intensity in cd below the color LED deck per lumen of a die.
const DIFFUSED: f64 = 0.7 / 4.7;

/// Returns a die of an intensity straight ahead and a chromaticity (CIE 1931 x and y).
fn die(intensity_cd: f64, chromaticity: [f64; 2]) -> Die {
    Die { intensity_cd, chromaticity }
}
