//! Problems of a picture: obstacles, which hide any word, and warnings.
//!
//! The former in this order: a shutter that misses the word, lamps that are dark or face away, a
//! black or a white picture. Then the flights' own warnings, gaps of logs, strokes that a font
//! lacks, and strokes outside the picture.

use nalgebra::Vector3;

use noctograph_core::camera::Camera;
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::error::Error;
use noctograph_core::flight::Flight;
use noctograph_picture::light::gaps::{Gap, gaps};
use noctograph_picture::light::{Lamp, LightOptions, LightSample, LightTrace};
use noctograph_picture::photo::Photo;

/// Codes of what hides any word.
pub const OBSTACLES: [&str; 7] =
    ["shutter-closes", "shutter-opens", UNLIT, FACES_AWAY, "overexposed", UNDEREXPOSED, NO_PICTURE];
/// Codes of what else is seen in a picture.
pub const FLAWS: [&str; 4] = ["log-gaps", "lost-strokes", "drawing-part", "outside"];

/// No lamp that writes is lit while the shutter is open.
pub const UNLIT: &str = "unlit";
/// The lamps that write face away from the camera, for `away_frac` of their light's time.
pub const FACES_AWAY: &str = "faces-away";
/// Nothing is exposed.
pub const UNDEREXPOSED: &str = "underexposed";
/// The stages before the photo refuse.
pub const NO_PICTURE: &str = "no-picture";

fn obstacle(code: &'static str, message: String, help: &'static str) -> Diagnostic {
    Diagnostic::new(code, Severity::Stop, message).helped(help)
}

/// The shutter closes before the word is done.
fn shutter_closes(close_s: f64, early_s: f64) -> Diagnostic {
    let message =
        format!("the shutter closes at {close_s:.1} s, {early_s:.1} s before the word is done");
    obstacle("shutter-closes", message, "leave {camera.shutter_close_s} out")
        .with("at_s", close_s)
        .with("early_s", early_s)
}

/// The shutter opens after the word is begun.
fn shutter_opens(open_s: f64, late_s: f64) -> Diagnostic {
    let message =
        format!("the shutter opens at {open_s:.1} s, {late_s:.1} s after the word is begun");
    obstacle("shutter-opens", message, "set {camera.shutter_open_s=0}")
        .with("at_s", open_s)
        .with("late_s", late_s)
}

/// The lamps that write face away from the camera for a share of their light's time.
fn faces_away(away_frac: f64) -> Diagnostic {
    let message = format!(
        "{:.0} % of the writing lamps' light is emitted away from the camera",
        100.0 * away_frac
    );
    let help = "turn the nose ({plan.yaw_rad}) or the lamps ({light.fixtures}), or move the camera \
                in front of them ({camera.framing})";
    obstacle(FACES_AWAY, message, help).with("away_frac", away_frac)
}

/// The stages before the photo refuse.
pub fn no_picture(error: &Error) -> Diagnostic {
    let help = "see `preview`; {camera.framing=word} frames the word";
    obstacle(NO_PICTURE, error.to_string(), help)
}

/// Gaps of a log, whose lit lamps are bridged, or break the trails: `bridged_m` is the largest
/// uncertainty of a position in the middle of those bridged.
fn log_gaps(spans_s: &[[f64; 2]], bridged_m: Option<f64>) -> Diagnostic {
    let what = match bridged_m {
        Some(m) => format!("bridged by a smooth path, uncertain by up to {:.0} mm", 1e3 * m),
        None => {
            "too long to bridge; trails break there, though the lamps may have shone".to_owned()
        }
    };
    let (n, spans) = (spans_s.len(), in_words(spans_s));
    Diagnostic::warning("log-gaps", format!("gaps of the log: {n} {what} ({spans})"))
        .with("n", n)
        .helped("log fewer variables, or on the \u{b5}SD card")
}

/// The center lines of a typeface lack a stroke of some letters.
pub(super) fn lost_strokes(font: &str, letters: &str) -> Diagnostic {
    let message =
        format!("the center lines of {font} lack a stroke of {letters}: they may misread");
    Diagnostic::warning("lost-strokes", message)
        .with("letters", letters)
        .helped("write with {letters.font=simplex} or a plainer typeface")
}

/// Advice where there is no light.
pub const CHECK_LIGHT: &str = "name lamps that {light.deck} has in {plan.lights}: headlights, ring (with an \
     effect in {light.ring}) or color-led";

/// The first of some spans of time.
fn in_words(spans_s: &[[f64; 2]]) -> String {
    let first = spans_s.iter().take(5).map(|[from, to]| format!("{from:.2}–{to:.2} s"));
    let more = if spans_s.len() > 5 { ", …" } else { "" };
    first.collect::<Vec<_>>().join(", ") + more
}

/// Share of a lamp's light that may face away from the camera: a stroke's end, not a letter.
const MOST_AWAY: f64 = 0.02;

/// Longest way at a stretch, in cap heights, along which it may: ends of strokes that are as much
/// too short are no fault of the light either (`lit transit`), and the ring's are, low in high
/// letters.
const LONGEST_AWAY_H: f64 = 0.1;

/// Least share of a lamp's intensity on its axis that counts as shining at the camera.
const AWAY_SHARE: f64 = 0.02;

/// Least difference of levels between the brightest pixels and the median.
const CONTRAST: u8 = 10;

/// Share of the pixels that counts as the brightest: a thin trail's.
const BRIGHTEST: f64 = 0.000_2;

/// Level of a white pixel, and the share of white pixels that hides every trail.
const WHITE: (u8, f64) = (245, 0.5);

/// Tolerance of the shutter at the ends of a word.
const SLACK_S: f64 = 0.1;

/// The lamps that write: those with a channel of the flights, or all if the flights have no
/// channels.
pub fn writing<'a>(
    flights: &[Flight],
    trace: &'a LightTrace,
    options: &LightOptions,
) -> Vec<&'a Lamp> {
    let fixtures = options.fixtures();
    let follows = |lamp: &&Lamp| {
        let name = &lamp.emitter.name;
        fixtures.iter().filter(|fixture| fixture.name == *name).any(|fixture| {
            fixture.drive.channel().is_some_and(|wanted| {
                let mut channels = flights.iter().flat_map(|flight| flight.lights.keys());
                channels
                    .any(|channel| channel == wanted || channel.starts_with(&format!("{wanted}.")))
            })
        })
    };
    if flights.iter().all(|flight| flight.lights.is_empty()) {
        return trace.lamps.iter().collect();
    }
    trace.lamps.iter().filter(follows).collect()
}

/// Obstacles that flights, lamps and camera show before a photo is taken.
pub(super) fn before(
    flights: &[Flight],
    lamps: &[&Lamp],
    camera: &Camera,
    cap_height_m: f64,
) -> Vec<Diagnostic> {
    let written = flights.iter().flat_map(|flight| &flight.samples);
    let written = written.filter(|sample| sample.letter.is_some()).map(|sample| sample.time_s);
    let [first_s, last_s] =
        written.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], t| [a.min(t), b.max(t)]);
    let [open_s, close_s] = [camera.shutter_open_s, camera.shutter_close_s];
    let (early_s, late_s) = (last_s - close_s, open_s - first_s);
    let early = (early_s > SLACK_S).then(|| shutter_closes(close_s, early_s));
    let late = (late_s > SLACK_S).then(|| shutter_opens(open_s, late_s));
    early.into_iter().chain(late).chain(unlit_or_away(lamps, camera, cap_height_m)).collect()
}

/// Lamps that are never lit while the shutter is open, or that face away from the camera.
fn unlit_or_away(lamps: &[&Lamp], camera: &Camera, cap_height_m: f64) -> Option<Diagnostic> {
    let open = camera.shutter_open_s..=camera.shutter_close_s;
    let lit = |s: &&LightSample| s.level > 0.0 && open.contains(&s.time_s);
    // Share of the light, and the longest way of it at a stretch.
    let away = |lamp: &&Lamp| {
        let (mut n_lit, mut n_away, mut way_m, mut longest_m) = (0_u32, 0_u32, 0.0, 0.0_f64);
        let mut before_m: Option<Vector3<f64>> = None;
        for sample in &lamp.samples {
            let toward: Vector3<f64> = camera.position_m - sample.position_m;
            let cos = || sample.axis.dot(&toward) / (sample.axis.norm() * toward.norm());
            let is_away = lit(&sample) && lamp.emitter.share(cos()) < AWAY_SHARE;
            n_lit += u32::from(lit(&sample));
            n_away += u32::from(is_away);
            let step_m = before_m.map_or(0.0, |from_m| (sample.position_m - from_m).norm());
            way_m = if is_away { way_m + step_m } else { 0.0 };
            before_m = is_away.then_some(sample.position_m);
            longest_m = longest_m.max(way_m);
        }
        (n_lit > 0).then(|| (f64::from(n_away) / f64::from(n_lit), longest_m))
    };
    let (away_frac, longest_m) = match lamps.iter().filter_map(away).reduce(least) {
        None => {
            let message = "no lamp that writes is lit while the shutter is open".to_owned();
            return Some(obstacle(UNLIT, message, CHECK_LIGHT));
        }
        Some(away) => away,
    };
    let is_seen = away_frac <= MOST_AWAY || longest_m <= LONGEST_AWAY_H * cap_height_m;
    (!is_seen).then(|| faces_away(away_frac))
}

/// The lamp that faces away the least.
fn least(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    if b.0 < a.0 { b } else { a }
}

/// Whether no trail stands out in a photo: a reader that raises faint light to full light may find
/// letters in its noise.
pub fn is_dark(photo: &Photo, camera: &Camera) -> bool {
    of_photo(photo, camera).is_some_and(|problem| problem.code == UNDEREXPOSED)
}

/// A photo without a visible trail: all black or all white.
pub(super) fn of_photo(photo: &Photo, camera: &Camera) -> Option<Diagnostic> {
    let mut histogram = [0_usize; 256];
    let pixels = photo.rgb8.as_chunks::<3>().0;
    for &[r, g, b] in pixels {
        histogram[usize::from(r.max(g).max(b))] += 1;
    }
    let n = pixels.len();
    let brighter =
        |level: u8| histogram[usize::from(level)..].iter().sum::<usize>() as f64 / n.max(1) as f64;
    let level_of =
        |share: f64| (0..=255).rev().find(|level| brighter(*level) >= share).unwrap_or(0);
    let (white, hiding) = WHITE;
    let settings = format!("f/{}, ISO {}", camera.f_number, camera.iso);
    let white_frac = brighter(white);
    if white_frac > hiding {
        let percent = 100.0 * white_frac;
        let message =
            format!("everything is exposed: {percent:.0} % of the picture is white at {settings}");
        let help = "lower {camera.iso}, raise {camera.f_number}, or darken the room \
                    ({photo.ambient_cd_m2})";
        return Some(obstacle("overexposed", message, help).with("white_frac", white_frac));
    }
    let (brightest, median) = (level_of(BRIGHTEST), level_of(0.5));
    let help = "raise {camera.iso} or lower {camera.f_number} (see `meter`)";
    (brightest < median.saturating_add(CONTRAST)).then(|| {
        let message = format!("nothing is exposed: no trail stands out at {settings}");
        obstacle(UNDEREXPOSED, message, help)
    })
}

/// Lit channels of a flight that no lamp of the scene follows, beside others that one follows.
pub(super) fn lampless(flight: &Flight, lamps: &LightOptions) -> Option<Diagnostic> {
    let fixtures = lamps.fixtures();
    let follows = |channel: &str| {
        let mut wanted = fixtures.iter().filter_map(|fixture| fixture.drive.channel());
        wanted.any(|wanted| {
            channel
                .strip_prefix(wanted)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        })
    };
    let lit = flight.lights.iter().filter(|(_, levels)| levels.iter().any(|level| *level > 0.0));
    let (known, unknown): (Vec<&str>, Vec<&str>) =
        lit.map(|(channel, _)| channel.as_str()).partition(|channel| follows(channel));
    (!known.is_empty() && !unknown.is_empty()).then(|| {
        let names = unknown.join(", ");
        let message = format!("the scene has no lamp for the light of {names}: it is left out");
        Diagnostic::warning("lamp-missing", message)
    })
}

/// The gaps in a real flight's log.
pub(super) fn of_log(flight: &Flight) -> impl Iterator<Item = Diagnostic> {
    let (bridged, open): (Vec<Gap>, Vec<Gap>) = gaps(flight).into_iter().partition(Gap::is_bridged);
    let most_m = bridged.iter().map(|gap| gap.uncertainty_m).fold(0.0, f64::max);
    let kinds = [(bridged, Some(most_m)), (open, None)].into_iter();
    kinds.filter(|(gaps, _)| !gaps.is_empty()).map(|(gaps, bridged_m)| {
        let spans_s: Vec<[f64; 2]> = gaps.iter().map(|gap| gap.span_s).collect();
        log_gaps(&spans_s, bridged_m)
    })
}

/// The word and light outside the picture.
pub(super) fn outside(
    trace: &LightTrace,
    [left, bottom, right, top]: [f64; 4],
    camera: &Camera,
    is_framed: bool,
) -> impl Iterator<Item = Diagnostic> {
    let corners = [[left, 0.0, bottom], [right, 0.0, bottom], [left, 0.0, top], [right, 0.0, top]];
    let word = corners.map(Vector3::from).into_iter().filter(|_| left < right);
    let open = camera.shutter_open_s..=camera.shutter_close_s;
    let lit = |s: &&LightSample| s.level > 0.0 && open.contains(&s.time_s);
    let samples = trace.lamps.iter().flat_map(|lamp| &lamp.samples).filter(lit);
    let light = samples.map(|sample| sample.position_m);
    let sides = [("word", camera.outside(word)), ("light", camera.outside(light))];
    let help = move |what: &str| match (is_framed, what) {
        (false, _) => {
            "{camera.framing=word} frames the word; {camera.framing.fill_frac} sets the margin"
        }
        (true, "light") => {
            "{camera.framing.fill_frac} sets the margin around the word; is the flight in meters, \
             with z up, and at the word's place?"
        }
        (true, _) => "{camera.framing.fill_frac} sets the margin",
    };
    sides.into_iter().filter_map(move |(what, sides)| {
        let message = format!("part of the {what} is outside the picture: {}", sides?);
        Some(Diagnostic::warning("outside", message).with("what", what).helped(help(what)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::flight::DroneIndex;
    use noctograph_picture::light::{Deck, Emitter, LightSample, LightTraceData};

    /// A deck that is new goes into the advice where no lamp shines, and into the page.
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
            spill: 0.0,
            visible_cos: -1.0,
            diameter_m: 0.005,
            depth_m: None,
        }
    }
}
