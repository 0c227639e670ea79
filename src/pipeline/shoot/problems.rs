//! Finds problems of a picture: obstacles, which make any word unreadable, and warnings.
//!
//! Obstacles come first: a shutter that misses the word, lamps that are dark or face away, a black
//! or a white picture. They are followed by warnings about the flights, gaps in logs, strokes
//! missing from a font, and strokes outside the picture.

use nalgebra::Vector3;

use noctograph_core::camera::Camera;
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::error::Error;
use noctograph_core::flight::Flight;
use noctograph_picture::light::gaps::{Gap, gaps};
use noctograph_picture::light::{Lamp, LightOptions, LightSample, LightTrace};
use noctograph_picture::photo::Photo;

/// Codes of the obstacles.
pub const OBSTACLES: [&str; 7] =
    ["shutter-closes", "shutter-opens", UNLIT, FACES_AWAY, "overexposed", UNDEREXPOSED, NO_PICTURE];
/// Codes of other flaws of a picture.
pub const FLAWS: [&str; 4] = ["log-gaps", "lost-strokes", "drawing-part", "outside"];

/// Code of the obstacle "no writing lamp is lit while the shutter is open".
pub const UNLIT: &str = "unlit";
/// Code of the obstacle "the writing lamps face away from the camera", with the fraction
/// `away_frac` of their light.
pub const FACES_AWAY: &str = "faces-away";
/// Code of the obstacle "nothing is exposed".
pub const UNDEREXPOSED: &str = "underexposed";
/// Code of the obstacle "a stage before the photo failed".
pub const NO_PICTURE: &str = "no-picture";

/// Returns the diagnostic for an obstacle.
fn obstacle(code: &'static str, message: String, help: &'static str) -> Diagnostic {
    Diagnostic::new(code, Severity::Stop, message).helped(help)
}

/// Returns the obstacle for a failure of a stage before the photo.
pub fn no_picture(error: &Error) -> Diagnostic {
    let help = "see `preview`; {camera.framing=word} frames the word";
    obstacle(NO_PICTURE, error.to_string(), help)
}

/// Returns a warning that strokes of `letters` are missing from a typeface's center lines.
pub(super) fn lost_strokes(font: &str, letters: &str) -> Diagnostic {
    let message =
        format!("the center lines of {font} lack a stroke of {letters}, which may be misread");
    Diagnostic::warning("lost-strokes", message)
        .with("letters", letters)
        .helped("write with {letters.font=simplex} or a plainer typeface")
}

/// Advice for a picture without light.
pub const CHECK_LIGHT: &str = "in {plan.lights}, name lamps of {light.deck}: headlights, ring \
                               (with an effect in {light.ring}) or color-led";

/// Maximum fraction of a lamp's light that may face away, enough for the end of a stroke.
const MOST_AWAY_FRAC: f64 = 0.02;

/// Maximum length, in cap heights, of a continuous path along which a lamp may face away. The check
/// `lit transit` lets strokes be too short by the same length, as those of a ring low in tall
/// letters.
const LONGEST_AWAY_H: f64 = 0.1;

/// Minimum intensity toward the camera that counts as light, as a fraction of the axial intensity.
const TOWARD_FRAC: f64 = 0.02;

/// Minimum difference in level between the brightest pixels and the median.
const CONTRAST: usize = 10;

/// Fraction of pixels that count as the brightest, small enough for a thin trail.
const BRIGHTEST_FRAC: f64 = 0.000_2;

/// Minimum level of a white pixel.
const WHITE_LEVEL: u8 = 245;
/// Maximum fraction of white pixels at which a trail may still be visible.
const MOST_WHITE_FRAC: f64 = 0.5;

/// Maximum number of log gaps that a message lists.
const MAX_SPANS: usize = 5;

/// Time that the shutter may cut off at the beginning and the end of a word.
const SLACK_S: f64 = 0.1;

/// Returns true if a lamp's sample is lit while a camera's shutter is open.
pub(crate) fn is_exposed(sample: &LightSample, camera: &Camera) -> bool {
    sample.level > 0.0 && (camera.shutter_open_s..=camera.shutter_close_s).contains(&sample.time_s)
}

/// Returns the writing lamps: those driven by the flights' channels or, without channels, all
/// lamps.
pub fn writing<'a>(
    flights: &[Flight],
    trace: &'a LightTrace,
    options: &LightOptions,
) -> Vec<&'a Lamp> {
    if flights.iter().all(|flight| flight.lights.is_empty()) {
        return trace.lamps.iter().collect();
    }
    // Lamps are named after their fixtures, and only fixtures that a channel drives are kept.
    let mut fixtures = options.fixtures();
    fixtures.retain(|fixture| {
        let mut channels = flights.iter().flat_map(|flight| flight.lights.keys());
        fixture.drive.channel().is_some_and(|lamp| channels.any(|channel| drives(channel, lamp)))
    });
    let lamps = trace.lamps.iter();
    lamps.filter(|lamp| fixtures.iter().any(|f| f.name == lamp.emitter.name)).collect()
}

/// Returns true if a channel of a flight drives a lamp or one of its colors.
fn drives(channel: &str, lamp: &str) -> bool {
    channel.strip_prefix(lamp).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// Returns the obstacles that flights, lamps and camera reveal without a photo. `cap_height_m` is
/// the height of the letters, or 0 if it is unknown.
pub(super) fn before_photo(
    flights: &[Flight],
    lamps: &[&Lamp],
    camera: &Camera,
    cap_height_m: f64,
) -> Vec<Diagnostic> {
    // The word lasts from the first to the last lettered sample of all drones.
    let samples = flights.iter().flat_map(|flight| &flight.samples);
    let written = samples.filter(|sample| sample.letter.is_some()).map(|sample| sample.time_s);
    let [first_s, last_s] =
        written.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], t| [a.min(t), b.max(t)]);
    let [open_s, close_s] = [camera.shutter_open_s, camera.shutter_close_s];
    let mut problems = Vec::new();
    let (early_s, late_s) = (last_s - close_s, open_s - first_s);
    if early_s > SLACK_S {
        let message = format!(
            "the shutter closes at {close_s:.1} s, {early_s:.1} s before the word is complete"
        );
        let closes = obstacle("shutter-closes", message, "omit {camera.shutter_close_s}");
        problems.push(closes.with("at_s", close_s).with("early_s", early_s));
    }
    if late_s > SLACK_S {
        let message =
            format!("the shutter opens at {open_s:.1} s, {late_s:.1} s after the word begins");
        let opens = obstacle("shutter-opens", message, "set {camera.shutter_open_s=0}");
        problems.push(opens.with("at_s", open_s).with("late_s", late_s));
    }
    problems.extend(unlit_or_away(lamps, camera, cap_height_m));
    problems
}

/// Returns an obstacle if the lamps are never lit while the shutter is open, or if they face away
/// from the camera. Returns `None` if one of the lamps is visible.
fn unlit_or_away(lamps: &[&Lamp], camera: &Camera, cap_height_m: f64) -> Option<Diagnostic> {
    // One visible lamp is sufficient, so the lamp that faces away the least decides.
    let away = lamps.iter().filter_map(|lamp| facing_away(lamp, camera));
    let Some((away_frac, longest_m)) = away.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        let message = "no lamp that writes is lit while the shutter is open".to_owned();
        return Some(obstacle(UNLIT, message, CHECK_LIGHT));
    };
    if away_frac <= MOST_AWAY_FRAC || longest_m <= LONGEST_AWAY_H * cap_height_m {
        return None;
    }
    let percent = 100.0 * away_frac;
    let message =
        format!("{percent:.0} % of the writing lamps' light is emitted away from the camera");
    let help = "turn the nose ({plan.yaw_rad}) or the lamps ({light.fixtures}), or move the camera \
                in front of them ({camera.framing})";
    Some(obstacle(FACES_AWAY, message, help).with("away_frac", away_frac))
}

/// Returns the fraction, 0 to 1, of a lamp's light that faces away from a camera, and the length in
/// m of the longest continuous path along which it does. Returns `None` for an unlit lamp.
fn facing_away(lamp: &Lamp, camera: &Camera) -> Option<(f64, f64)> {
    let (mut n_lit, mut n_away, mut path_m, mut longest_m) = (0_u32, 0_u32, 0.0, 0.0_f64);
    let mut previous_m: Option<Vector3<f64>> = None;
    for sample in &lamp.samples {
        let is_lit = is_exposed(sample, camera);
        let toward: Vector3<f64> = camera.position_m - sample.position_m;
        let cos = sample.axis.dot(&toward) / (sample.axis.norm() * toward.norm());
        let is_away = is_lit && lamp.emitter.relative_intensity(cos) < TOWARD_FRAC;
        n_lit += u32::from(is_lit);
        n_away += u32::from(is_away);
        // A sample that faces the camera interrupts the path.
        let step_m = previous_m.map_or(0.0, |from_m| (sample.position_m - from_m).norm());
        path_m = if is_away { path_m + step_m } else { 0.0 };
        previous_m = is_away.then_some(sample.position_m);
        longest_m = longest_m.max(path_m);
    }
    (n_lit > 0).then(|| (f64::from(n_away) / f64::from(n_lit), longest_m))
}

/// Returns true if no trail is visible in a photo, in which a reader might misread noise.
pub fn is_dark(photo: &Photo, camera: &Camera) -> bool {
    exposure_obstacle(photo, camera).is_some_and(|problem| problem.code == UNDEREXPOSED)
}

/// Returns the obstacle for a photo without a visible trail, which is overexposed or underexposed.
/// Returns `None` if a trail is visible.
pub(super) fn exposure_obstacle(photo: &Photo, camera: &Camera) -> Option<Diagnostic> {
    let pixels = photo.rgb8.as_chunks::<3>().0;
    let mut counts = [0_usize; 256];
    for &[r, g, b] in pixels {
        counts[usize::from(r.max(g).max(b))] += 1;
    }
    // The fraction of pixels at or above each level is accumulated from white downward.
    let (mut at_least_frac, mut n_at_least) = ([0.0; 256], 0);
    for level in (0..256).rev() {
        n_at_least += counts[level];
        at_least_frac[level] = n_at_least as f64 / pixels.len().max(1) as f64;
    }
    let settings = format!("f/{}, ISO {}", camera.f_number, camera.iso);
    let white_frac = at_least_frac[usize::from(WHITE_LEVEL)];
    if white_frac > MOST_WHITE_FRAC {
        let percent = 100.0 * white_frac;
        let message =
            format!("everything is exposed: {percent:.0} % of the picture is white at {settings}");
        let help = "lower {camera.iso}, raise {camera.f_number}, or darken the room \
                    ({photo.ambient_cd_m2})";
        return Some(obstacle("overexposed", message, help).with("white_frac", white_frac));
    }
    // `brightest` and `median` are the levels that the brightest pixels and half of all pixels
    // reach, respectively.
    let [brightest, median] = [BRIGHTEST_FRAC, 0.5]
        .map(|frac| (0..256).rev().find(|level| at_least_frac[*level] >= frac).unwrap_or(0));
    let help = "raise {camera.iso} or lower {camera.f_number} (see `meter`)";
    (brightest < (median + CONTRAST).min(255)).then(|| {
        let message = format!("nothing is exposed: no trail stands out at {settings}");
        obstacle(UNDEREXPOSED, message, help)
    })
}

/// Returns a warning about a flight's lit channels for which the scene has no lamp. Returns `None`
/// if every channel has a lamp, or none has.
pub(super) fn lampless(flight: &Flight, lamps: &LightOptions) -> Option<Diagnostic> {
    let fixtures = lamps.fixtures();
    let lit = flight.lights.iter().filter(|(_, levels)| levels.iter().any(|level| *level > 0.0));
    let (with_lamp, without): (Vec<&str>, Vec<&str>) =
        lit.map(|(channel, _)| channel.as_str()).partition(|channel| {
            let mut lamps = fixtures.iter().filter_map(|fixture| fixture.drive.channel());
            lamps.any(|lamp| drives(channel, lamp))
        });
    (!with_lamp.is_empty() && !without.is_empty()).then(|| {
        let names = without.join(", ");
        let message = format!("the scene has no lamp for the light of {names}, which is left out");
        Diagnostic::warning("lamp-missing", message)
    })
}

/// Returns warnings about log gaps bridged by a smooth path, and about gaps that break trails.
pub(super) fn log_gaps(flight: &Flight) -> impl Iterator<Item = Diagnostic> {
    let (bridged, open): (Vec<Gap>, Vec<Gap>) = gaps(flight).into_iter().partition(Gap::is_bridged);
    let most_m = bridged.iter().map(|gap| gap.uncertainty_m).fold(0.0, f64::max);
    let smooth = format!("bridged by a smooth path, uncertain by up to {:.0} mm", 1e3 * most_m);
    let broken = "too long to bridge, so trails have gaps there, although the lamps may have been \
                  lit";
    let kinds = [(bridged, smooth), (open, broken.to_owned())].into_iter();
    kinds.filter(|(gaps, _)| !gaps.is_empty()).map(|(gaps, effect)| {
        let spans_s = gaps.iter().take(MAX_SPANS).map(|gap| gap.span_s);
        let texts = spans_s.map(|[from, to]| format!("{from:.2}–{to:.2} s"));
        let spans = texts.collect::<Vec<_>>().join(", ");
        let (n, more) = (gaps.len(), if gaps.len() > MAX_SPANS { ", …" } else { "" });
        Diagnostic::warning("log-gaps", format!("gaps of the log: {n} {effect} ({spans}{more})"))
            .with("n", n)
            .helped("log fewer variables, or log to the \u{b5}SD card")
    })
}

/// Returns warnings about a word and about light partly outside the picture. The box of the word is
/// in m. `is_framed` is true for a camera that frames the word.
pub(super) fn outside(
    trace: &LightTrace,
    [left, bottom, right, top]: [f64; 4],
    camera: &Camera,
    is_framed: bool,
) -> impl Iterator<Item = Diagnostic> {
    let corners = [[left, 0.0, bottom], [right, 0.0, bottom], [left, 0.0, top], [right, 0.0, top]];
    let word = corners.map(Vector3::from).into_iter().filter(|_| left < right);
    let samples = trace.lamps.iter().flat_map(|lamp| &lamp.samples);
    let light = samples.filter(|s| is_exposed(s, camera)).map(|sample| sample.position_m);
    // A framed word is inside the picture, so light outside it is probably misplaced.
    let margin = "{camera.framing.fill_frac} sets the margin";
    let place = "{camera.framing.fill_frac} sets the margin around the word; is the flight in \
                 meters, with z up, and at the word's position?";
    let framing =
        "{camera.framing=word} frames the word; {camera.framing.fill_frac} sets the margin";
    let [help_word, help_light] = if is_framed { [margin, place] } else { [framing; 2] };
    let parts =
        [("word", camera.outside(word), help_word), ("light", camera.outside(light), help_light)];
    parts.into_iter().filter_map(|(what, sides, help)| {
        let message = format!("part of the {what} is outside the picture: {}", sides?);
        Some(Diagnostic::warning("outside", message).with("what", what).helped(help))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::flight::DroneIndex;
    use noctograph_picture::light::{Deck, Emitter, LightSample, LightTraceData};

    /// Checks that the advice about dark lamps and the docs page list every deck.
    #[test]
    fn what_lists_the_decks_lists_all_of_them() {
        let page = include_str!("../../serve/page/wish.js");
        for deck in Deck::ALL.iter().filter(|deck| **deck != Deck::None) {
            assert!(CHECK_LIGHT.contains(deck.channel()), "CHECK_LIGHT lacks {}", deck.name());
            assert!(
                page.contains(&format!("\"{}\"", deck.name())),
                "wish.js lacks {}",
                deck.name()
            );
        }
    }

    #[test]
    fn a_lamp_writes_whatever_its_name() {
        let mut options = LightOptions::default();
        let mut fixtures = options.fixtures();
        for fixture in &mut fixtures {
            fixture.name = format!("left: {}", fixture.name);
        }
        let lamps = fixtures.iter().map(|fixture| Lamp {
            drone: Some(DroneIndex(1)),
            emitter: Emitter { name: fixture.name.clone(), ..emitter() },
            samples: Vec::<LightSample>::new(),
        });
        let trace = LightTrace::made(LightTraceData { lamps: lamps.collect() });
        options.fixtures = Some(fixtures);
        let mut flight = Flight::default();
        flight.edit(|flight| flight.lights.insert("headlights".into(), vec![]));
        assert!(!writing(&[flight], &trace, &options).is_empty());
    }

    fn emitter() -> Emitter {
        Emitter {
            name: String::new(),
            intensity_cd: 1.0,
            rgb: [1.0; 3],
            beam_exponent: 0.0,
            isotropic_fraction: 0.0,
            visible_cos: -1.0,
            diameter_m: 0.005,
            depth_m: None,
        }
    }
}
