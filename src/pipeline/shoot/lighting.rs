//! Computes the light of all drones, and the camera that records it.

use super::metering::{Metered, metered, recommended};
use super::{Recording, Shoot, Watch, problems};
use crate::scene::Scene;
use noctograph_core::camera::{Camera, Framing};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{DroneIndex, Flight, Quantity};
use noctograph_core::geometry::bounds;
use noctograph_letters::Strokes;
use noctograph_picture::light::{
    ColorLedLevels, LightOptions, LightTrace, RING, color_led_wrgb, light, ring_rgb,
};

/// Minimum distance between a lit lamp and the camera.
const MIN_DISTANCE_M: f64 = 0.1;

/// Flights, lamps and camera, ready for exposure.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Flights that carried the lamps. Empty for recorded light.
    pub flights: Vec<Flight>,
    /// Lamps of all drones, each with the drone's number if there are several drones.
    pub trace: LightTrace,
    /// Names of the writing lamps.
    pub writing: Vec<String>,
    /// Scene's camera with the settings of the light meter.
    pub camera: Camera,
    /// Settings chosen by the light meter, if the scene is metered.
    pub metered: Option<Metered>,
    /// Problems of the picture, beginning with those that make the word unreadable.
    pub problems: Vec<Diagnostic>,
}

impl Lighting {
    /// Returns the aperture and sensitivity that the light meter recommends or, in a metered scene,
    /// has set. Returns `None` without light.
    pub fn recommended(&self, scene: &Scene) -> Option<Metered> {
        self.metered.or_else(|| recommended(&self.trace, &self.camera, &scene.camera, &scene.photo))
    }
}

/// Returns the lamps in the colors of the drawing, unless the scene defines colors of letters.
pub(super) fn in_drawing_colors(
    lamps: &LightOptions,
    scene: &Scene,
    strokes: Option<&Strokes>,
) -> LightOptions {
    let mut lamps = lamps.clone();
    let Some(strokes) = strokes.filter(|_| lamps.letters_wrgb.is_empty()) else { return lamps };
    if strokes.colors.iter().any(|rgb| *rgb != [0; 3]) {
        // With the firmware's correction, the steps between dim colors are too coarse for mixing.
        lamps.color_led_levels = ColorLedLevels::Plain;
    }
    let by_ring = scene.plan.lights.iter().any(|lamp| lamp == RING.name);
    let colors = strokes.colors.iter().map(|rgb| match *rgb {
        // Black strokes are written in the lamp's default color, since a black lamp would be dark.
        [0, 0, 0] => lamps.color_led_wrgb,
        rgb if by_ring => {
            let [r, g, b] = ring_rgb(rgb);
            [0, r, g, b]
        }
        rgb => color_led_wrgb(rgb, lamps.color_led_levels),
    });
    lamps.letters_wrgb = colors.collect();
    lamps
}

impl Shoot {
    /// Returns the scene's lamps, in the drawing's colors unless the scene defines letter colors.
    pub fn lamps(&self) -> LightOptions {
        in_drawing_colors(&self.scene.light, &self.scene, self.strokes.as_ref())
    }

    /// Simulates the flights, or uses the recordings, and computes the light of the lamps.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Shoot::fly`], [`light`] and
    /// [`noctograph_core::camera::CameraOptions::camera`].
    pub fn lighting(mut self, watch: &Watch<'_>) -> Result<Lighting> {
        match std::mem::take(&mut self.recordings) {
            recordings if recordings.is_empty() => self.light(self.record(watch)?),
            recordings => self.light(recordings),
        }
    }

    /// Computes the light of recordings, one for each drone, the camera and the exposure for that
    /// light, and the problems that a photo would have.
    pub(super) fn light(&self, recordings: Vec<Recording>) -> Result<Lighting> {
        let n_drones = recordings.len();
        let (mut flights, mut trace) = (Vec::new(), LightTrace::default());
        let (mut problems, mut end_s) = (Vec::new(), 0.0_f64);
        // 1. The lamps of all drones, numbered if there are several drones, are combined in one
        //    trace.
        for (drone, recording) in recordings.into_iter().enumerate() {
            let number = (n_drones > 1).then_some(DroneIndex(drone));
            let mut lamps = match recording {
                Recording::Light(lamps) => {
                    end_s = end_s.max(lamps.end_s());
                    lamps
                }
                Recording::Flight(flight) => {
                    end_s = end_s.max(flight.samples.last().map_or(0.0, |last| last.time_s));
                    problems.extend(self.problems_of_flight(&flight, number));
                    let lamps = self.light_drone(drone, &flight)?;
                    flights.push(flight);
                    lamps
                }
            };
            if number.is_some() {
                lamps.edit(|trace| trace.lamps.iter_mut().for_each(|lamp| lamp.drone = number));
            }
            if trace.lamps.is_empty() {
                trace = lamps;
            } else {
                trace.edit(|trace| trace.append(lamps));
            }
        }
        problems.extend(self.problems_of_strokes());
        // 2. The camera frames the writing, and the light meter sets the exposure.
        let bounds_m = self.bounds_m(&flights, &trace)?;
        let Scene { camera: options, photo, .. } = &self.scene;
        let mut camera = options.camera(bounds_m, end_s)?;
        let metered = metered(&trace, &mut camera, options, photo);
        check_camera_position(&trace, bounds_m, &camera, &options.framing)?;
        // 3. The light in the camera's view is searched for problems, beginning with obstacles.
        let is_framed = matches!(options.framing, Framing::Word(_));
        problems.extend(problems::outside(&trace, bounds_m, &camera, is_framed));
        let lamps = problems::writing(&flights, &trace, &self.scene.light);
        let mut writing: Vec<String> = lamps.iter().map(|lamp| lamp.label()).collect();
        writing.dedup();
        let glyph = self.strokes.as_ref().and_then(|strokes| strokes.glyphs.first());
        let cap_height_m = glyph.map_or(0.0, |glyph| glyph.cell.cap_height_m);
        problems.splice(..0, problems::before_photo(&flights, &lamps, &camera, cap_height_m));
        Ok(Lighting { flights, trace, writing, camera, metered, problems })
    }

    /// Returns warnings about one flight: those of its simulation, a log's gaps, and channels
    /// without a lamp. `number` is the drone's number, if there are several.
    fn problems_of_flight(&self, flight: &Flight, number: Option<DroneIndex>) -> Vec<Diagnostic> {
        let is_simulated = !self.plans.is_empty();
        let simulated = flight.warnings.iter().filter(|_| is_simulated);
        let warnings = simulated.map(|warning| warning.clone().of_drone(number));
        let lampless = problems::lampless(flight, &self.scene.light);
        warnings.chain(problems::log_gaps(flight)).chain(lampless).collect()
    }

    /// Returns the light of the lamps of drone `drone`, counted from 0, during a flight.
    pub fn light_drone(&self, drone: usize, flight: &Flight) -> Result<LightTrace> {
        let actual = self.actual.get(drone).map_or(&self.scene.light, |actual| &actual.light);
        let lamps = in_drawing_colors(actual, &self.scene, self.strokes.as_ref());
        light(flight, &lamps, self.scene.seed, drone as u64)
    }

    /// Returns warnings about strokes missing from a typeface, and parts missing from a drawing.
    fn problems_of_strokes(&self) -> Vec<Diagnostic> {
        let Some(strokes) = &self.strokes else { return Vec::new() };
        let lost: String = strokes.lost.keys().collect();
        let font = strokes.font.as_ref().filter(|_| !lost.is_empty());
        let parts = strokes.warnings.iter().cloned();
        font.map(|font| problems::lost_strokes(font, &lost)).into_iter().chain(parts).collect()
    }

    /// Returns the box `[left, bottom, right, top]` in m of the writing in the plane of the word.
    /// The box encloses the strokes or, without strokes, the letters in the flights or, without
    /// letters, the light. Returns zeros for a fixed camera without strokes and letters.
    fn bounds_m(&self, flights: &[Flight], trace: &LightTrace) -> Result<[f64; 4]> {
        if let Some(strokes) = &self.strokes {
            return Ok(strokes.bounds_m());
        }
        let mut written_m = Vec::new();
        for flight in flights {
            let has_design = flight.has(Quantity::Design);
            let written = flight.samples.iter().filter(|sample| sample.letter.is_some());
            written_m.extend(written.map(|s| if has_design { s.design_m } else { s.position_m }));
        }
        let letters_m = bounds(written_m.iter().map(|m| [m.x, m.z]));
        if has_extent(letters_m) {
            return Ok(letters_m);
        }
        if let Framing::Fixed(_) = self.scene.camera.framing {
            return Ok([0.0; 4]);
        }
        let samples = trace.lamps.iter().flat_map(|lamp| &lamp.samples);
        let lit = samples.filter(|sample| sample.level > 0.0);
        let light_m = bounds(lit.map(|sample| [sample.position_m.x, sample.position_m.z]));
        if has_extent(light_m) {
            return Ok(light_m);
        }
        // `strokes` returns the error that the scene contains no word.
        Ok(self.scene.strokes()?.bounds_m())
    }
}

/// Returns true if a box has a nonzero width or height.
fn has_extent([left, bottom, right, top]: [f64; 4]) -> bool {
    left < right || bottom < top
}

/// Checks that the camera is not too close to a lit lamp, and that it is not behind the word, which
/// would appear mirrored.
fn check_camera_position(
    trace: &LightTrace,
    [left, _, right, _]: [f64; 4],
    camera: &Camera,
    framing: &Framing,
) -> Result<()> {
    // Which keys move the camera depends on the kind of framing.
    let (key, hint) = match framing {
        Framing::Fixed(_) => (
            "camera.framing.position_m",
            "set camera.framing.position_m to a position some meters in front of the word, or set \
             camera.framing = \"word\"",
        ),
        Framing::Word(_) => (
            "camera.framing",
            "write larger letters (letters.cap_height_m), or let them fill less of the picture \
             (camera.framing.fill_frac)",
        ),
    };
    let [x, y, z] = camera.position_m.into();
    if left < right && y > 0.0 {
        let actual = format!("[{x}, {y}, {z}], behind the word, which would be mirrored");
        return Err(Error::input(key, actual, "y below 0, in front of it", hint));
    }
    for lamp in &trace.lamps {
        for sample in lamp.samples.iter().filter(|sample| sample.level > 0.0) {
            let distance_m = (sample.position_m - camera.position_m).norm();
            if distance_m < MIN_DISTANCE_M {
                let what = format!(
                    "the camera at [{x}, {y}, {z}] is {:.3} m from lamp `{}` at {:.2} s, but must \
                     be at least {MIN_DISTANCE_M} m from every lit lamp",
                    // Rounded down to millimeters, so that it stays below the limit.
                    (1e3 * distance_m).floor() / 1e3,
                    lamp.label(),
                    sample.time_s
                );
                return Err(Error::infeasible(what, hint));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Preset;
    use noctograph_core::flight::{FlightData, FlightSample};
    use noctograph_picture::light::{COLOR_LED, Deck};

    #[test]
    fn the_colors_of_a_drawing_light_the_lamps_and_leave_the_scene_as_it_was_said() {
        let file = tempfile::Builder::new().suffix(".svg").tempfile().unwrap();
        fn line(y: i32, color: &str) -> String {
            format!("<path d='M0 {y}h9' stroke='{color}'/>")
        }
        let svg = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 9 9' fill='none'>";
        let text = [svg, &line(2, "#f00"), &line(7, "#00f"), "</svg>"].concat();
        std::fs::write(file.path(), text).unwrap();
        let mut scene = Scene::preset(Preset::default());
        scene.letters.drawing = file.path().display().to_string();
        scene.plan.lights = vec![COLOR_LED.name.to_owned()];
        scene.light.deck = Deck::ColorLed;
        let shoot = Shoot::new(scene.clone()).unwrap();
        assert_eq!(shoot.scene, scene);
        let lamps = shoot.lamps();
        assert_eq!(lamps.letters_wrgb.len(), 2, "{:?}", lamps.letters_wrgb);
        assert_eq!(lamps.color_led_levels, ColorLedLevels::Plain);
        let of_plan = &shoot.plans[0].plan.lights;
        assert!(of_plan.contains_key(COLOR_LED.colors[1]), "{:?}", of_plan.keys());
        scene.light.letters_wrgb = vec![[9, 9, 9, 9]];
        assert_eq!(Shoot::new(scene.clone()).unwrap().lamps(), scene.light, "its own are meant");
    }

    #[test]
    fn an_exposure_begins_with_the_first_recording_whatever_its_stamp() {
        fn begins_s(stamps_s: &[f64]) -> Vec<f64> {
            let recordings = stamps_s.iter().map(|stamp_s| {
                let times_s = (0..50).map(|row| stamp_s + 0.1 * f64::from(row));
                let samples =
                    times_s.map(|time_s| FlightSample { time_s, ..FlightSample::default() });
                let gaps = vec![[stamp_s + 1.0, stamp_s + 1.1]];
                let samples = samples.collect();
                Recording::Flight(Flight::made(FlightData {
                    samples,
                    gaps,
                    ..FlightData::default()
                }))
            });
            let scene = Scene::preset(Preset::default());
            let shoot = Shoot::with_recordings(scene, recordings.collect()).unwrap();
            let flights = shoot.recordings.iter().map(|recording| match recording {
                Recording::Flight(flight) => flight,
                Recording::Light(_) => unreachable!("all are flights"),
            });
            flights
                .map(|flight| {
                    let first_s = flight.samples[0].time_s;
                    assert_eq!(flight.samples[10].time_s, first_s + 1.0, "on the grid");
                    assert_eq!(flight.gaps, [[first_s + 1.0, first_s + 1.1]]);
                    first_s
                })
                .collect()
        }
        assert_eq!(begins_s(&[600.0, 602.5]), [0.0, 2.5], "on one clock");
        assert_eq!(begins_s(&[-8.0]), [0.0]);
        assert_eq!(begins_s(&[1.7e9]), [0.0]);
    }

    #[test]
    fn a_scene_out_of_range_is_no_shoot() {
        let mut scene = Scene { word: "I".into(), ..Scene::preset(Preset::default()) };
        scene.vehicle.mass_kg = f64::NAN;
        let error = Shoot::new(scene.clone()).unwrap_err().to_string();
        assert!(error.starts_with("vehicle.mass_kg"), "{error}");
        assert!(Shoot::with_plans(scene, Vec::new()).is_err());
    }
}
