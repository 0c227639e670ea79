//! What keeps a word from being read whatever its letters are, in the order in which it is looked
//! for: a shutter that misses the word, a picture without or with nothing but light, lamps that face
//! away, a word outside the picture.

use nalgebra::Vector3;

use crate::camera::Camera;
use crate::flight::Flight;
use crate::light::{Drive, Lamp, LightOptions, LightSample, LightTrace};
use crate::photo::Photo;

/// Least share of a lamp's intensity on its axis that counts as shining at the camera.
const AWAY_SHARE: f64 = 0.02;

/// Least difference of levels between the brightest pixels and the median.
const CONTRAST: u8 = 10;

/// Share of the pixels that counts as the brightest: a thin trail's.
const BRIGHTEST: f64 = 0.000_2;

/// Level from which a pixel counts as white, and the share of such pixels that hides every trail.
const WHITE: (u8, f64) = (245, 0.5);

/// Time by which a shutter may miss the ends of a word.
const SLACK_S: f64 = 0.1;

/// The lamps that write: those that follow a channel of the flights; all, of light without any.
pub(super) fn writing<'a>(
    flights: &[Flight],
    trace: &'a LightTrace,
    options: &LightOptions,
) -> Vec<&'a Lamp> {
    let fixtures = options.fixtures();
    let has = |wanted: &str| {
        let mut channels = flights.iter().flat_map(|flight| flight.lights.keys());
        channels.any(|channel| channel == wanted || channel.starts_with(&format!("{wanted}.")))
    };
    let follows = |lamp: &&Lamp| {
        // Lamps of several drones have the drone's number before their name.
        let name = lamp.emitter.name.rsplit(": ").next().unwrap_or_default();
        fixtures.iter().filter(|fixture| fixture.name == name).any(|fixture| match &fixture.drive {
            Drive::Command(channel) => has(channel),
            Drive::Ring(_) => has("ring"),
            Drive::ColorLed => has("color-led"),
            Drive::Always | Drive::Blink { .. } | Drive::Flicker { .. } => false,
        })
    };
    if flights.iter().all(|flight| flight.lights.is_empty()) {
        return trace.lamps.iter().collect();
    }
    trace.lamps.iter().filter(follows).collect()
}

/// Obstacles that flights, lamps and camera show before a photo is taken.
pub(super) fn before(flights: &[Flight], lamps: &[&Lamp], camera: &Camera) -> Vec<String> {
    let written = flights.iter().flat_map(|flight| &flight.samples);
    let written = written.filter(|sample| sample.letter.is_some()).map(|sample| sample.time_s);
    let [first_s, last_s] =
        written.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], t| [a.min(t), b.max(t)]);
    let [open_s, close_s] = [camera.shutter_open_s, camera.shutter_close_s];
    let early = (close_s < last_s - SLACK_S).then(|| {
        format!(
            "the shutter closes at {close_s:.1} s, {:.1} s before the word is done: leave \
             camera.shutter_close_s out",
            last_s - close_s
        )
    });
    let late = (open_s > first_s + SLACK_S).then(|| {
        format!(
            "the shutter opens at {open_s:.1} s, {:.1} s after the word is begun: set \
             camera.shutter_open_s to 0",
            open_s - first_s
        )
    });
    early.into_iter().chain(late).chain(unlit_or_away(lamps, camera)).collect()
}

/// Lamps that are never lit while the shutter is open, or that face away from the camera.
fn unlit_or_away(lamps: &[&Lamp], camera: &Camera) -> Option<String> {
    let open = camera.shutter_open_s..=camera.shutter_close_s;
    let lit = |s: &&LightSample| s.level > 0.0 && open.contains(&s.time_s);
    let mut most_share: Option<f64> = None;
    for lamp in lamps {
        for sample in lamp.samples.iter().filter(lit) {
            let toward: Vector3<f64> = camera.position_m - sample.position_m;
            let cos = sample.axis.dot(&toward) / (sample.axis.norm() * toward.norm());
            let share = lamp.emitter.share(cos);
            most_share = Some(most_share.map_or(share, |most| most.max(share)));
        }
    }
    match most_share {
        None => Some(
            "no lamp that writes is lit while the shutter is open: check plan.lights, light.deck \
             and light.ring"
                .into(),
        ),
        Some(share) if share < AWAY_SHARE => Some(
            "the lamps that write face away from the camera: move the camera in front of them \
             (camera.framing), or turn the lamps (light.fixtures)"
                .into(),
        ),
        Some(_) => None,
    }
}

/// A photo that shows no trail: nothing is exposed, or everything.
pub(super) fn of_photo(photo: &Photo, camera: &Camera) -> Option<String> {
    let mut histogram = [0_usize; 256];
    for pixel in photo.rgb8.chunks_exact(3) {
        histogram[usize::from(pixel[0].max(pixel[1]).max(pixel[2]))] += 1;
    }
    let n = photo.rgb8.len() / 3;
    #[expect(clippy::cast_precision_loss, reason = "pixels")]
    let brighter =
        |level: u8| histogram[usize::from(level)..].iter().sum::<usize>() as f64 / n.max(1) as f64;
    let level_of =
        |share: f64| (0..=255).rev().find(|level| brighter(*level) >= share).unwrap_or(0);
    let (white, hiding) = WHITE;
    let settings = format!("f/{}, ISO {}", camera.f_number, camera.iso);
    if brighter(white) > hiding {
        return Some(format!(
            "everything is exposed: {:.0} % of the picture is white at {settings}: lower camera.iso, \
             raise camera.f_number, or darken the room (photo.ambient_cd_m2)",
            100.0 * brighter(white)
        ));
    }
    let (brightest, median) = (level_of(BRIGHTEST), level_of(0.5));
    (brightest < median.saturating_add(CONTRAST)).then(|| {
        format!(
            "nothing is exposed: no trail stands out at {settings}: raise camera.iso or lower \
             camera.f_number (see `meter`)"
        )
    })
}
