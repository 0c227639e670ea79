//! The light of all drones, and the camera that sees it.

use nalgebra::Vector3;

use super::metering::{Metered, metered, recommended};
use super::{Recording, Shoot, Watch, obstacles};
use crate::camera::{Camera, Framing};
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::light::gaps::{Gap, gaps};
use crate::light::{LightSample, LightTrace, light};
use crate::scene::Scene;

/// Smallest distance of a lit lamp from the camera.
const MIN_DISTANCE_M: f64 = 0.1;

/// Flights, lamps and camera, ready to be exposed.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Flights that carried the lamps; none for light that was recorded alone.
    pub flights: Vec<Flight>,
    /// Lamps of all drones. Those of several have the drone's number, from 1, before their name.
    pub trace: LightTrace,
    /// Names of the lamps that follow the plans.
    pub writing: Vec<String>,
    /// The scene's camera, as the meter set it.
    pub camera: Camera,
    /// What keeps the word from being read whatever its letters are, the first cause first.
    pub obstacles: Vec<String>,
    /// What the meter set, if the scene asks for it.
    pub metered: Option<Metered>,
    /// Warnings of the simulated flights, and of light outside the picture.
    pub warnings: Vec<String>,
}

impl Lighting {
    /// Aperture and sensitivity that the light meter recommends for the scene: those that it set, if
    /// the scene asks for it. `None` for darkness.
    #[must_use]
    pub fn recommended(&self, scene: &Scene) -> Option<Metered> {
        let meter = || recommended(&self.trace, &self.camera, &scene.camera, &scene.photo);
        self.metered.or_else(meter)
    }
}

impl Shoot {
    /// Flies, or takes the recordings, and lights the lamps.
    ///
    /// # Errors
    ///
    /// As [`Shoot::fly`] and [`light`], and those of the camera.
    pub fn lighting(mut self, watch: &Watch<'_>) -> Result<Lighting> {
        match std::mem::take(&mut self.recordings) {
            recordings if recordings.is_empty() => self.light(self.record(watch)?),
            recordings => self.light(recordings),
        }
    }

    /// Lights the lamps of recordings, one for each drone.
    pub(super) fn light(&self, recordings: Vec<Recording>) -> Result<Lighting> {
        let several = recordings.len() > 1;
        let (mut flights, mut all, mut warnings) = (Vec::new(), LightTrace::default(), Vec::new());
        let mut end_s = 0.0_f64;
        for (drone, recording) in recordings.into_iter().enumerate() {
            let mut trace = match recording {
                Recording::Light(trace) => {
                    end_s = end_s.max(trace.end_s());
                    trace
                }
                Recording::Flight(flight) => {
                    end_s = end_s.max(flight.samples.last().map_or(0.0, |last| last.time_s));
                    if !self.plans.is_empty() {
                        let number =
                            if several { format!("drone {}: ", drone + 1) } else { String::new() };
                        warnings
                            .extend(flight.warnings.iter().map(|text| format!("{number}{text}")));
                    }
                    warnings.extend(gaps_in_words(&flight));
                    let trace = self.light_drone(drone, &flight)?;
                    flights.push(flight);
                    trace
                }
            };
            if several {
                trace.number(drone + 1);
            }
            all.append(trace);
        }
        warnings.extend(self.lost_strokes());
        let bounds_m = self.bounds_m(&flights)?;
        let Scene { camera: options, photo, .. } = &self.scene;
        let mut camera = options.camera(bounds_m, end_s)?;
        let metered = metered(&all, &mut camera, options, photo);
        check_place(&all, bounds_m, &camera)?;
        warnings.extend(outside(&all, bounds_m, &camera));
        let lamps = obstacles::writing(&flights, &all, &self.scene.light);
        let obstacles = obstacles::before(&flights, &lamps, &camera);
        let mut writing: Vec<String> = lamps.iter().map(|lamp| lamp.emitter.name.clone()).collect();
        writing.dedup();
        Ok(Lighting { flights, trace: all, writing, camera, metered, obstacles, warnings })
    }

    /// Lights the lamps of one drone, counted from 0.
    ///
    /// # Errors
    ///
    /// As [`light`].
    pub fn light_drone(&self, drone: usize, flight: &Flight) -> Result<LightTrace> {
        let lamps = self.actual.get(drone).map_or(&self.scene.light, |actual| &actual.light);
        light(flight, lamps, self.scene.seed, drone as u64)
    }

    /// A warning where the center lines of a typeface lack one of its strokes.
    fn lost_strokes(&self) -> Option<String> {
        let strokes = self.strokes.as_ref()?;
        let font = strokes.font.as_ref()?;
        let mut lost: Vec<char> = strokes.glyphs.iter().map(|glyph| glyph.character).collect();
        lost.sort_unstable();
        lost.dedup();
        lost.retain(|character| font.lost(*character) > 0.0);
        let letters: String = lost.into_iter().collect();
        (!letters.is_empty()).then(|| {
            format!(
                "the center lines of {} lack a stroke of {letters}: they may misread",
                font.name()
            )
        })
    }

    /// `[left, bottom, right, top]` of the writing, in the plane of the word: of the strokes,
    /// else of the letters in the flights' design; zeros for a fixed camera without either.
    fn bounds_m(&self, flights: &[Flight]) -> Result<[f64; 4]> {
        if let Some(strokes) = &self.strokes {
            return Ok(strokes.bounds_m());
        }
        let samples = flights.iter().flat_map(|flight| &flight.samples);
        let written = samples.filter(|sample| sample.letter.is_some());
        let none = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let [left, bottom, right, top] = written.fold(none, |[l, b, r, t], sample| {
            let at_m = sample.design_m;
            [l.min(at_m.x), b.min(at_m.z), r.max(at_m.x), t.max(at_m.z)]
        });
        match &self.scene.camera.framing {
            _ if left < right || bottom < top => Ok([left, bottom, right, top]),
            Framing::Fixed(_) => Ok([0.0; 4]),
            // Reports that the scene names no word.
            Framing::Word(_) => Ok(self.scene.strokes()?.bounds_m()),
        }
    }
}

/// Warnings of the gaps in a real flight's log.
fn gaps_in_words(flight: &Flight) -> Vec<String> {
    let (bridged, open): (Vec<Gap>, Vec<Gap>) = gaps(flight).into_iter().partition(Gap::is_bridged);
    let spans = |gaps: &[Gap]| {
        let first: Vec<String> = gaps
            .iter()
            .take(5)
            .map(|g| format!("{:.2}–{:.2} s", g.span_s[0], g.span_s[1]))
            .collect();
        let more = if gaps.len() > first.len() { ", …" } else { "" };
        first.join(", ") + more
    };
    let most_m = bridged.iter().map(|gap| gap.uncertainty_m).fold(0.0, f64::max);
    let bridges = (!bridged.is_empty()).then(|| {
        format!(
            "gaps of the log: {} bridged by a smooth path, uncertain by up to {:.0} mm ({})",
            bridged.len(),
            1e3 * most_m,
            spans(&bridged)
        )
    });
    let breaks = (!open.is_empty()).then(|| {
        format!(
            "gaps of the log: {} too long to bridge; trails break there, though the lamps may have \
             shone ({})",
            open.len(),
            spans(&open)
        )
    });
    [bridges, breaks].into_iter().flatten().collect()
}

/// Refuses a camera among the lamps, and one behind the word, where it reads mirrored.
fn check_place(trace: &LightTrace, [left, _, right, _]: [f64; 4], camera: &Camera) -> Result<()> {
    let hint =
        "set camera.framing.position_m meters in front of the word, or camera.framing = \"word\"";
    let [x, y, z] = camera.position_m.into();
    if left < right && y > 0.0 {
        let found = format!("[{x}, {y}, {z}], behind the word, which would read mirrored");
        return Err(Error::input(
            "camera.framing.position_m",
            found,
            "y below 0, in front of it",
            hint,
        ));
    }
    let distance_m = |s: &LightSample| (s.position_m - camera.position_m).norm();
    for lamp in &trace.lamps {
        let near = |s: &&LightSample| s.level > 0.0 && distance_m(s) < MIN_DISTANCE_M;
        if let Some(sample) = lamp.samples.iter().find(near) {
            let name = &lamp.emitter.name;
            let found = format!(
                "[{x}, {y}, {z}], {:.3} m from lamp `{name}` at {:.2} s",
                distance_m(sample),
                sample.time_s
            );
            let wanted = format!("at least {MIN_DISTANCE_M} m from every lit lamp");
            return Err(Error::input("camera.framing.position_m", found, wanted, hint));
        }
    }
    Ok(())
}

/// Warnings of the word and of light outside the picture.
fn outside(
    trace: &LightTrace,
    [left, bottom, right, top]: [f64; 4],
    camera: &Camera,
) -> Vec<String> {
    let corners = [[left, 0.0, bottom], [right, 0.0, bottom], [left, 0.0, top], [right, 0.0, top]];
    let word = corners.map(Vector3::from).into_iter().filter(|_| left < right);
    let open = camera.shutter_open_s..=camera.shutter_close_s;
    let lit = |s: &&LightSample| s.level > 0.0 && open.contains(&s.time_s);
    let samples = trace.lamps.iter().flat_map(|lamp| &lamp.samples).filter(lit);
    let light = samples.map(|sample| sample.position_m);
    let sides = [("word", camera.outside(word)), ("light", camera.outside(light))];
    let warning = |(name, outside): (&str, crate::camera::Outside)| {
        let sides = outside.in_words()?;
        Some(format!(
            "part of the {name} is outside the picture: {sides} (camera.framing = \"word\" frames \
             the word; camera.framing.fill_frac sets the margin)"
        ))
    };
    sides.into_iter().filter_map(warning).collect()
}
