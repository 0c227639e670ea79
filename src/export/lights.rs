//! Converts lights to commands that set firmware parameters.
//!
//! Lamps are controlled by parameters: deck lamps by those in [`CHANNELS`], a custom lamp by the
//! parameter in its row of the emitter table. The firmware shows a change at its next 50 ms tick.
//! Plans on the light's clock are sent early by the radio delay plus half a tick.
//!
//! A ring with few changes can play them from its timing memory (`Timing`), by the clock of an
//! onboard trajectory, so that no late packet delays them.

use nalgebra::Vector3;

use noctograph_core::crazyflie::{MAX_RING_TIMING, RING_TIMING_S};
use noctograph_core::error::{Error, Result};
use noctograph_core::lamps::{
    CHANNELS, COLOR_LED, Channel, ColorLedLevels, Deck, Fixture, LightOptions, RING, packed,
    ring_memory_rgb,
};
use noctograph_core::srgb::{encoded_from_linear, linear_from_encoded, rgb_from_xyz, xyz};
use noctograph_core::statistics::sort_by_number;
use noctograph_plan::Plan;

/// Value of `led.bitmask` at which the board's own LEDs are dark.
const BOARD_DARK: u32 = 128;
/// Parameter that is 1 if the color LED deck corrects its brightness, as [`COLOR_LED`] sets it.
const BRIGHTNESS_CORRECTION: &str = "colorLedBot.brightCorr";

/// Duration of the last, dark entry of a timing memory, in units. 80 ms include a tick of the ring
/// at any phase, even on a slow clock. An entry between two ticks is never shown, and at the end of
/// the list the LEDs are not changed (`timeMemEffect`, `ledring12.c`).
const LAST_UNITS: u64 = 2;

/// One light command.
#[derive(Clone, Debug, PartialEq)]
pub struct Command {
    /// Time in the plan, s.
    pub time_s: f64,
    /// Firmware parameter.
    pub parameter: String,
    /// Value of the parameter.
    pub value: u32,
    /// Light channel of the plan.
    pub channel: String,
    /// Level of the channel, 0 to 1.
    pub level: f64,
}

/// Parameter that is set by a light channel of a plan.
struct Target<'a> {
    parameter: &'a str,
    /// Color channels of the deck. Empty for a lamp without colors.
    colors: &'static [&'static str],
    /// Value at full level: 1 for a pin, or an arbitrary value for a custom lamp.
    most: u32,
}

impl<'a> Target<'a> {
    /// Returns the firmware parameter of a deck's channel or of a custom lamp. Returns
    /// [`Error::Input`] for other channels.
    fn new(channel: &str, fixtures: &'a [Fixture]) -> Result<Self> {
        if let Some(Channel { parameter, colors, .. }) = Channel::named(channel) {
            return Ok(Self { parameter, colors, most: 1 });
        }
        let mut lamps = fixtures.iter().filter(|lamp| lamp.drive.channel() == Some(channel));
        let custom = lamps.find_map(|lamp| Some((lamp.parameter.as_deref()?, lamp.parameter_max)));
        custom.map(|(parameter, most)| Self { parameter, colors: &[], most }).ok_or_else(|| {
            let names = CHANNELS.map(|channel| channel.name).join(", ");
            let wanted = format!("{names}, or a lamp that names its firmware parameter");
            let hint = "light with one of these, or set `parameter` of the lamp in light.fixtures";
            Error::input("plan.lights", channel, wanted, hint)
        })
    }

    /// Returns the command that sets a level from 0 to 1 at `time_s`. A lamp with colors shows
    /// `wrgb` at that level.
    fn command(&self, time_s: f64, channel: &str, level: f64, wrgb: [u8; 4]) -> Command {
        #[expect(clippy::cast_possible_truncation, reason = "within 0 and the maximum")]
        let (value, level) = match (self.colors.len(), self.most) {
            // A pin is on at any level above 0. A deck's color is in the last of four bytes.
            (0, 1) => (u32::from(level > 0.0), level.ceil()),
            (0, most) => ((f64::from(most) * level.clamp(0.0, 1.0)).round() as u32, level),
            (n, _) => (packed(&wrgb[4 - n..], level), level),
        };
        let (parameter, channel) = (self.parameter.to_owned(), channel.to_owned());
        Command { time_s, parameter, value, channel, level }
    }
}

/// Returns a plan's light channels that can only be on or off.
pub fn switches<'a>(plan: &'a Plan, options: &LightOptions) -> Vec<&'a str> {
    let fixtures = options.fixtures();
    let channels = plan.lamps().map(|(channel, _)| channel.as_str());
    Vec::from_iter(channels.filter(|channel| {
        let target = Target::new(channel, &fixtures);
        target.is_ok_and(|target| target.colors.is_empty() && target.most == 1)
    }))
}

/// Returns the color of a lamp at setpoint `row` in white, red, green and blue, each 0 to 255. The
/// color is taken from the plan's color channels or, if there are none, from the letter. A ring has
/// no white.
fn color(
    plan: &Plan,
    channel: &str,
    row: usize,
    letter: Option<usize>,
    options: &LightOptions,
) -> [u8; 4] {
    let [r, g, b] = options.ring_rgb_of(letter);
    let letter_wrgb = if channel == RING.name { [0, r, g, b] } else { options.wrgb_of(letter) };
    let colors = Channel::named(channel).map_or(&[][..], |channel| channel.colors);
    // The channels correspond to the last of the four bytes.
    std::array::from_fn(|k| {
        let name = (k + colors.len()).checked_sub(4).and_then(|k| colors.get(k));
        let levels = name.and_then(|name| plan.lights.get(*name));
        levels.map_or(letter_wrgb[k], |levels| byte(levels[row]))
    })
}

/// Returns a level from 0 to 1 as a byte from 0 to 255. Levels outside this range are clamped.
#[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
fn byte(level: f64) -> u8 {
    (255.0 * level.clamp(0.0, 1.0)).round() as u8
}

/// Returns a command for each change of a plan's initially dark lights, in order of time.
///
/// # Errors
///
/// Returns [`Error::Input`] for a channel that belongs to no deck.
pub fn commands(plan: &Plan, options: &LightOptions) -> Result<Vec<Command>> {
    let mut commands = Vec::new();
    let (letters, fixtures) = (noctograph_plan::light_letters(plan), options.fixtures());
    for (channel, levels) in plan.lamps() {
        let target = Target::new(channel, &fixtures)?;
        // A lamp is dark before the first setpoint, so a first command may be superfluous.
        let mut value = target.command(0.0, channel, 0.0, [0; 4]).value;
        for (row, (setpoint, level)) in plan.setpoints.iter().zip(levels).enumerate() {
            let wrgb = color(plan, channel, row, letters[row], options);
            let next = target.command(setpoint.time_s, channel, *level, wrgb);
            if next.value != value {
                value = next.value;
                commands.push(next);
            }
        }
    }
    sort_by_number(&mut commands, |command| command.time_s);
    Ok(commands)
}

/// Returns a command for each channel of a plan that switches it off.
///
/// # Errors
///
/// Returns the errors of [`commands`].
pub fn dark(plan: &Plan, options: &LightOptions) -> Result<Vec<Command>> {
    let fixtures = options.fixtures();
    let targets = plan.lamps().map(|(channel, _)| (channel, Target::new(channel, &fixtures)));
    targets.map(|(channel, target)| Ok(target?.command(0.0, channel, 0.0, [0; 4]))).collect()
}

/// Returns the names and values of the parameters to set before the flight. With them, the plan's
/// lamps are ready but dark, and other lamps are off.
pub(crate) fn preparation(plan: &Plan, options: &LightOptions) -> Result<Vec<(String, u32)>> {
    let mut parameters: Vec<(String, u32)> = vec![("led.bitmask".to_owned(), BOARD_DARK)];
    let fixtures = options.fixtures();
    for Channel { name, ready, idle, .. } in &CHANNELS {
        let is_fitted = |lamp: &Fixture| lamp.drive.channel() == Some(*name);
        let settings = if plan.lights.contains_key(*name) {
            *ready
        } else if fixtures.iter().any(is_fitted) {
            *idle
        } else {
            &[]
        };
        parameters.extend(settings.iter().map(|(name, value)| ((*name).to_owned(), *value)));
    }
    if options.color_led_levels == ColorLedLevels::Plain {
        let correction = parameters.iter_mut().find(|(name, _)| name == BRIGHTNESS_CORRECTION);
        correction.into_iter().for_each(|(_, value)| *value = 0);
    }
    // Custom lamps that the plan lights come first, followed by the others.
    let mut custom = dark(plan, options)?;
    custom.retain(|command| Channel::named(&command.channel).is_none());
    parameters.extend(custom.into_iter().map(|command| (command.parameter, command.value)));
    for parameter in fixtures.into_iter().filter_map(|lamp| lamp.parameter) {
        if parameters.iter().all(|(name, _)| *name != parameter) {
            parameters.push((parameter, 0));
        }
    }
    Ok(parameters)
}

/// Returns the number of timing memory entries of the ring that a plan's lights require. Returns
/// `None` if the ring is not the only lamp, is never lit, or is not dark at the end.
///
/// # Errors
///
/// Returns the errors of [`commands`].
pub fn timing_entries(plan: &Plan, options: &LightOptions) -> Result<Option<usize>> {
    Ok(timing(plan, &commands(plan, options)?).map(|timing| timing.entries.len()))
}

/// Lights that a ring plays from its timing memory (`ring.effect` 17), from the first change on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Timing {
    /// Duration of each entry in units of 40 ms, and its rounded color. The last entry is dark.
    pub(super) entries: Vec<(u8, [u8; 3])>,
    /// Time in the plan, s, level, and value of [`RING`]'s parameter for each change that the
    /// memory plays.
    pub(super) changes: Vec<(f64, f64, u32)>,
}

/// Returns the timing memory, of any length, for a plan that lights only the ring. Returns `None`
/// for other lamps, without commands, and if the ring is not dark at the end.
pub(super) fn timing(plan: &Plan, commands: &[Command]) -> Option<Timing> {
    let (first, last) = (commands.first()?, commands.last()?);
    if !plan.lamps().map(|(channel, _)| channel).eq([RING.name]) || last.value != 0 {
        return None;
    }
    // Times are counted in units since the first change.
    let (mut entries, mut changes, mut played) = (Vec::new(), Vec::new(), 0);
    for (index, command) in commands.iter().enumerate() {
        let time_s = first.time_s + RING_TIMING_S * played as f64;
        changes.push((time_s, command.level, command.value));
        // A change shorter than a unit is extended to one unit, and the next ones are shortened.
        let (until_s, least_units) = match commands.get(index + 1) {
            Some(next) => (next.time_s, 1),
            None => (command.time_s, LAST_UNITS),
        };
        #[expect(clippy::cast_possible_truncation, reason = "an hour")]
        let planned = ((until_s - first.time_s) / RING_TIMING_S).round() as u64;
        let [_, r, g, b] = command.value.to_be_bytes();
        let (until, color) = (planned.max(played + least_units), ring_memory_rgb([r, g, b]));
        // A color that lasts longer requires several entries.
        while played < until {
            let units = (until - played).min(MAX_RING_TIMING);
            entries.push((u8::try_from(units).expect("at most 255"), color));
            played += units;
        }
    }
    Some(Timing { entries, changes })
}

/// Returns the sRGB color in which a screen shows a command's light: its hue at full scale, times
/// its level. The bytes of the command are unsuitable, because the dies are far brighter than a
/// screen: red letters have the byte 3 of 255, which a screen shows as black.
pub(super) fn screen_rgb(command: &Command, options: &LightOptions) -> [u8; 3] {
    let deck = Channel::named(&command.channel).filter(|channel| !channel.colors.is_empty());
    // With corrected levels, all dies are equally bright and the bytes are sRGB levels.
    let is_corrected =
        deck == Some(COLOR_LED) && options.color_led_levels == ColorLedLevels::Corrected;
    // A deck's value contains one byte per die, with the last die in the lowest byte, so dies and
    // bytes are paired from the end. Any other lamp has all dies fully on.
    let low_bytes_first = deck.map_or([u8::MAX; 4], |_| command.value.to_le_bytes());
    let mut light = Vector3::zeros();
    for lamp in lamps_on(&command.channel, options) {
        let drives = low_bytes_first.into_iter().chain(std::iter::repeat(u8::MAX));
        for (drive, die) in drives.zip(lamp.dies.iter().rev()) {
            let drive = f64::from(drive) / 255.0;
            let linear =
                if is_corrected { linear_from_encoded(drive) } else { die.intensity_cd * drive };
            light += Vector3::from(rgb_from_xyz(xyz(die.chromaticity))) * linear;
        }
    }
    // Colors outside the screen's gamut have negative channels, which are clipped.
    let in_gamut = light.map(|channel: f64| channel.max(0.0));
    let most = in_gamut.max();
    if most <= 0.0 {
        return [0; 3];
    }
    in_gamut.map(|channel| byte(encoded_from_linear(channel / most * command.level))).into()
}

/// Returns the lamps driven by a channel: the scene's or, if the scene lists none, a deck's.
fn lamps_on(channel: &str, options: &LightOptions) -> Vec<Fixture> {
    let mut lamps = options.fixtures();
    lamps.retain(|lamp| lamp.drive.channel() == Some(channel));
    if lamps.is_empty() {
        lamps.extend(Deck::ALL.iter().flat_map(|deck| deck.fixtures()));
        lamps.retain(|lamp| lamp.drive.channel() == Some(channel));
    }
    lamps
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use noctograph_core::crazyflie::RING_TIMING_ENTRIES;
    use noctograph_core::lamps::{Die, Drive, RingColor, RingEffect};
    use noctograph_core::plan::PlanData;
    use noctograph_plan::Setpoint;

    fn lit(channel: &str, levels: &[f64]) -> Plan {
        let setpoint = |time_s| Setpoint {
            time_s,
            position_m: Vector3::z(),
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: Vector3::zeros(),
            letter: Some(0),
        };
        let times_s = (0..levels.len()).map(|row| f64::from(u8::try_from(row).unwrap()));
        let lights = [(channel.to_owned(), levels.to_vec())].into();
        Plan::made(PlanData {
            setpoints: times_s.map(setpoint).collect(),
            lights,
            ..PlanData::default()
        })
    }

    fn deck_command(channel: &str, level: f64, wrgb: [u8; 4]) -> Command {
        Target::new(channel, &[]).unwrap().command(0.0, channel, level, wrgb)
    }

    #[test]
    fn each_lamp_has_its_parameter_and_only_changes_are_sent() {
        let ring = RingEffect::Solid(RingColor { color: [200, 100, 0] });
        let options = LightOptions { ring, ..LightOptions::default() };
        let sent = |channel| {
            let commands = commands(&lit(channel, &[0.0, 0.5, 1.0, 1.0, 0.0]), &options).unwrap();
            commands.into_iter().map(|c| (c.time_s, c.parameter, c.value)).collect::<Vec<_>>()
        };
        let pin = || "ring.headlightEnable".to_owned();
        assert_eq!(sent("headlights"), [(1.0, pin(), 1), (4.0, pin(), 0)], "a pin is not dimmed");
        let ring = [(1.0, 0x64_3200), (2.0, 0xC8_6400), (4.0, 0)];
        let ring = ring.map(|(time_s, value)| (time_s, "ring.fadeColor".to_owned(), value));
        assert_eq!(sent("ring"), ring);
        assert_eq!(sent("color-led")[1], (2.0, "colorLedBot.wrgb8888".to_owned(), 0xFF00_0000));
        assert!(commands(&lit("laser", &[0.0]), &options).is_err());
    }

    #[test]
    fn a_lamp_of_ones_own_sets_the_parameter_that_it_names() {
        let lamp = |parameter: Option<&str>, parameter_max| Fixture {
            drive: Drive::Command("laser".to_owned()),
            parameter: parameter.map(str::to_owned),
            parameter_max,
            ..Fixture::default()
        };
        let with =
            |fixture| LightOptions { fixtures: Some(vec![fixture]), ..LightOptions::default() };
        let plan = lit("laser", &[0.0, 0.5, 1.0, 0.0]);
        let sent = |options: &LightOptions| -> Vec<u32> {
            let commands = commands(&plan, options).unwrap();
            assert!(commands.iter().all(|it| it.parameter == "deckled.level"));
            commands.iter().map(|it| it.value).collect()
        };
        let (dimmer, switch) =
            (with(lamp(Some("deckled.level"), 200)), with(lamp(Some("deckled.level"), 1)));
        assert_eq!((sent(&dimmer), sent(&switch)), (vec![100, 200, 0], vec![1, 0]));
        assert_eq!((switches(&plan, &dimmer), switches(&plan, &switch)), (vec![], vec!["laser"]));
        let before = preparation(&plan, &dimmer).unwrap();
        let both_off = [("led.bitmask".to_owned(), 128), ("deckled.level".to_owned(), 0)];
        assert_eq!(before, both_off);
        let idle = preparation(&lit("headlights", &[0.0]), &dimmer).unwrap();
        assert_eq!(idle.last(), both_off.last(), "off where the plan does not use it");
        assert!(commands(&plan, &with(lamp(None, 1))).is_err(), "nothing to set");
        for wrong in ["level", "deck led.level", "a.b.c"] {
            assert!(with(lamp(Some(wrong), 1)).check().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_ring_is_sent_the_color_of_the_letter_or_of_the_plan() {
        let options =
            LightOptions { letters_wrgb: vec![[0, 255, 0, 16]], ..LightOptions::default() };
        let mut plan = lit("ring", &[0.0, 1.0, 0.5, 0.0]);
        let values = |plan: &Plan| -> Vec<u32> {
            commands(plan, &options).unwrap().iter().map(|command| command.value).collect()
        };
        assert_eq!(values(&plan), [0xFF_0010, 0x80_0008, 0]);
        plan.edit(|plan| plan.lights.insert("ring.green".to_owned(), vec![0.0, 1.0, 0.2, 0.0]));
        assert_eq!(values(&plan), [0xFF_FF10, 0x80_1A08, 0]);
        assert_eq!(dark(&plan, &options).unwrap().len(), 1);
    }

    #[test]
    fn a_show_has_the_colors_that_were_asked_for() {
        use noctograph_picture::light::{color_led_wrgb, ring_rgb};

        let colors =
            [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3], [255, 128, 0], [255, 0, 255]];
        for srgb in colors {
            let plain = ColorLedLevels::Plain;
            let options = LightOptions { color_led_levels: plain, ..LightOptions::default() };
            let [r, g, b] = ring_rgb(srgb);
            for (channel, wrgb) in
                [("color-led", color_led_wrgb(srgb, plain)), ("ring", [0, r, g, b])]
            {
                let shown = screen_rgb(&deck_command(channel, 1.0, wrgb), &options);
                // The dies' gamut is larger than the screen's, and their levels are coarse.
                for (actual, wanted) in shown.iter().zip(srgb) {
                    let error = f64::from(*actual) - f64::from(wanted);
                    assert!(error.abs() <= 4.0, "{channel}: {shown:?} instead of {srgb:?}");
                }
                assert_eq!(shown.iter().max(), Some(&255), "{channel}: full scale");
            }
        }
        let laser = |chromaticities: &[[f64; 2]]| LightOptions {
            fixtures: Some(vec![Fixture {
                drive: Drive::Command("laser".to_owned()),
                dies: chromaticities
                    .iter()
                    .map(|xy| Die { intensity_cd: 2.0, chromaticity: *xy })
                    .collect(),
                parameter: Some("laser.power".to_owned()),
                parameter_max: 255,
                ..Fixture::default()
            }]),
            ..LightOptions::default()
        };
        fn shown(options: &LightOptions) -> [u8; 3] {
            let commands = commands(&lit("laser", &[0.0, 1.0, 0.0]), options).unwrap();
            screen_rgb(&commands[0], options)
        }
        let (red, green) = ([0.694, 0.306], [0.151, 0.758]);
        assert_eq!(shown(&laser(&[red])), [255, 0, 0], "the color of its die");
        assert_eq!(shown(&laser(&[green])), [0, 255, 0]);
        let [_, _, blue] = shown(&laser(&[red, green, red, green, red, green]));
        assert_eq!(blue, 0, "of all dies");
        assert_eq!(shown(&laser(&[[0.3127, 0.329]])), [255; 3]);
        fn screen(channel: &str, level: f64, wrgb: [u8; 4]) -> [u8; 3] {
            screen_rgb(&deck_command(channel, level, wrgb), &LightOptions::default())
        }
        assert_eq!(screen("headlights", 1.0, [0; 4]), [245, 255, 249], "their own white");
        assert_eq!(screen("ring", 0.0, [0, 9, 9, 9]), [0; 3]);
        let [white, ..] = screen("color-led", 1.0, [255, 0, 0, 0]);
        let [half, ..] = screen("color-led", 0.5, [255, 0, 0, 0]);
        // White is D65 to four digits, which is exact to one level.
        assert!(white == 255 && half.abs_diff(188) <= 1, "half the light is level 188: {half}");
    }

    #[test]
    fn few_changes_of_the_ring_fit_its_timing_memory() {
        let ring = RingEffect::Solid(RingColor { color: [200, 100, 0] });
        let options = LightOptions { ring, ..LightOptions::default() };
        let timing = |channel: &str, levels: &[f64], step_s: f64| {
            let mut plan = lit(channel, levels);
            plan.edit(|plan| plan.setpoints.iter_mut().for_each(|s| s.time_s *= step_s));
            timing(&plan, &commands(&plan, &options).unwrap())
        };
        // From 1.01 s on, the ring is lit for 2.02 s, dark for 1.01 s, and at half level for 1.01
        // s. The drift does not accumulate.
        let played = timing("ring", &[0.0, 1.0, 1.0, 0.0, 0.5, 0.0], 1.01).unwrap();
        let (on, dark, half) = ([197, 101, 0], [0; 3], [99, 49, 0]);
        assert_eq!(played.entries, [(51, on), (25, dark), (25, half), (2, dark)]);
        for ((time_s, ..), want) in played.changes.iter().zip([1.01, 3.03, 4.04, 5.05]) {
            assert!((time_s - want).abs() <= RING_TIMING_S / 2.0 + 1e-9, "{time_s} s");
        }
        let long = timing("ring", &[0.0, 1.0, 0.0], 25.0).unwrap().entries;
        assert_eq!(long, [(255, on), (255, on), (115, on), (2, dark)], "10.2 s each at most");
        let many: Vec<f64> = (0..11).map(|row| f64::from(row % 2)).collect();
        assert_eq!(timing("ring", &many, 1.0).unwrap().entries.len(), RING_TIMING_ENTRIES + 1);
        assert_eq!(timing("ring", &many[..10], 1.0), None, "still lit at the end");
        assert_eq!(timing("ring", &many[..9], 1.0).unwrap().entries.len(), 8);
        assert_eq!(timing("headlights", &many[..9], 1.0), None, "a pin is not in the memory");
    }

    /// Returns the colors of the ring at each tick, beginning with the first, when the firmware
    /// plays a timing memory. `clock` is the rate of its microseconds, and `phase_s` the time to
    /// the second tick.
    fn shown(entries: &[(u8, [u8; 3])], phase_s: f64, clock: f64, ticks: u32) -> Vec<[u8; 3]> {
        let ms = |time_s: f64| (1e3 * clock * time_s + 1e-6).floor();
        let (mut entry, mut began_ms, mut color) = (0, 0.0, [0; 3]);
        let mut colors = Vec::new();
        for tick in 0..ticks {
            let now_ms = if tick == 0 { 0.0 } else { ms(phase_s + 0.05 * f64::from(tick)) };
            while let Some((units, _)) = entries.get(entry)
                && began_ms + 40.0 * f64::from(*units) < now_ms
            {
                began_ms += 40.0 * f64::from(*units);
                entry += 1;
            }
            if let Some((_, entry)) = entries.get(entry) {
                color = *entry;
            }
            colors.push(color);
        }
        colors
    }

    #[test]
    fn a_timing_memory_is_played_as_the_firmwares_own_code_plays_it() {
        let recorded = include_str!("recorded/ring.txt");
        let mut digests =
            recorded.lines().filter(|l| !l.starts_with('#')).flat_map(|l| l.split(' '));
        let mut number = 7_u32;
        let expand = |value: u32, wide: u32, round: u32| u8::try_from((value * wide + round) >> 6);
        for memory in 0..20_usize {
            let n = 1 + memory % 9;
            let mut entry = |i: usize| {
                number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let dice = number >> 16;
                let units = if i == n { 2 } else { u8::try_from(1 + dice % 9).unwrap() };
                let packed = if i % 2 == 1 || i == n { 0 } else { dice | 1 };
                let red = expand(packed >> 11, 527, 23).unwrap();
                let green = expand(packed >> 5 & 63, 259, 33).unwrap();
                (units, [red, green, expand(packed & 31, 527, 23).unwrap()])
            };
            let entries: Vec<_> = (0..=n).map(&mut entry).collect();
            for phase in 0..50_u32 {
                let colors = shown(&entries, f64::from(phase) * 1e-3, 1.0, 100);
                let digest =
                    colors.as_flattened().iter().fold(2_166_136_261_u32, |digest, byte| {
                        (digest ^ u32::from(*byte)).wrapping_mul(16_777_619)
                    });
                let want = u32::from_str_radix(digests.next().unwrap(), 16).unwrap();
                assert_eq!(digest, want, "memory {memory}, phase {phase}");
            }
        }
    }

    #[test]
    fn the_ring_is_dark_after_the_word_at_every_phase_of_its_timer_and_on_a_slow_clock() {
        for step_s in (0..50).map(|k| 1.0 + 0.011 * f64::from(k)) {
            let mut plan = lit("ring", &[0.0, 1.0, 0.0, 1.0, 0.5, 0.0]);
            plan.edit(|plan| plan.setpoints.iter_mut().for_each(|s| s.time_s *= step_s));
            let commands = commands(&plan, &LightOptions::default()).unwrap();
            let entries = timing(&plan, &commands).unwrap().entries;
            for clock in [1.0, noctograph_core::crazyflie::SLOW_CLOCK] {
                for phase in 0..50_u32 {
                    let colors = shown(&entries, f64::from(phase) * 1e-3, clock, 200);
                    assert!(colors.contains(&[16, 20, 16]), "it was lit");
                    assert_eq!(colors.last(), Some(&[0; 3]), "{step_s} s, {phase} ms, {clock}");
                }
            }
        }
    }
}
