//! Shows how the photograph develops, as the film after each fraction of the exposure.
//!
//! Light is additive, so the film at each moment is the previous film plus the light since then. It
//! is developed like the complete film, but without the sensor's noise, and with the room's light
//! up to that moment.

use super::Shot;
use crate::scene::Scene;
use noctograph_core::camera::Camera;
use noctograph_core::error::Result;
use noctograph_picture::expose::{Film, FilmData, project};
use noctograph_picture::light::{Lamp, LightTrace, LightTraceData};
use noctograph_picture::photo::{Noise, Photo, PhotoOptions, develop, reflectance};

impl Shot {
    /// Develops the film, `width_px` wide, at `n` equally spaced moments, the last of which is the
    /// end of the exposure. Calls `each` with the time of flight and the photo, in order.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`noctograph_picture::expose::expose`], [`develop`] and `each`.
    pub fn moments(
        &self,
        width_px: u32,
        n: u32,
        each: &mut dyn FnMut(f64, Photo) -> Result<()>,
    ) -> Result<()> {
        let camera = self.camera.at_width(width_px);
        let Scene { expose, photo, seed, .. } = &self.shoot.scene;
        let options = PhotoOptions { noise: Noise::Off, ..photo.clone() };
        // Counts are half those of the complete film, so that rounding cannot cause an overflow.
        let room = reflectance(&camera, &options)?;
        let complete = project(&self.trace, &camera, expose)?.reflected_by(room.clone());
        let scale_log2 = complete.scale_log2() + 1;
        let (width_px, height_px) = (camera.width_px, camera.height_px);
        let counts = vec![0; 3 * width_px as usize * height_px as usize];
        let mut film = Film::made(FilmData { width_px, height_px, counts, scale_log2 });
        let Camera { shutter_open_s, shutter_close_s: end_s, .. } = camera;
        let mut time_s = shutter_open_s;
        for moment in 1..=n {
            let duration_s = (end_s - shutter_open_s) * f64::from(moment) / f64::from(n);
            let shutter_close_s = shutter_open_s + duration_s;
            // The lamps' light since the previous moment is added. Development adds the room's
            // light from the start of the exposure.
            let until = Camera { shutter_close_s, ..camera.clone() };
            let since = Camera { shutter_open_s: time_s, ..until.clone() };
            let trace = samples_between(&self.trace, time_s, shutter_close_s);
            let latent = project(&trace, &since, expose)?.reflected_by(room.clone());
            let added = latent.at_scale(scale_log2)?.develop_on_all();
            film.edit(|film| {
                for (sum, count) in film.counts.iter_mut().zip(&added.counts) {
                    *sum = sum.saturating_add(*count);
                }
            });
            time_s = shutter_close_s;
            each(time_s, develop(&film, &until, expose, &options, *seed)?)?;
        }
        Ok(())
    }
}

/// Returns the samples of lamps between two times in s, and one sample before and after them, so
/// that the path between is complete.
fn samples_between(trace: &LightTrace, from_s: f64, to_s: f64) -> LightTrace {
    let lamps = trace.lamps.iter().map(|lamp| {
        let first = lamp.samples.partition_point(|sample| sample.time_s < from_s);
        let last = lamp.samples.partition_point(|sample| sample.time_s <= to_s);
        let samples = &lamp.samples[first.saturating_sub(1)..(last + 1).min(lamp.samples.len())];
        Lamp { drone: lamp.drone, emitter: lamp.emitter.clone(), samples: samples.to_vec() }
    });
    LightTrace::made(LightTraceData { lamps: lamps.collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Preset;
    use crate::shoot::{Judging, Shoot};

    fn shot() -> Shot {
        let mut scene = Scene { word: "I".into(), ..Scene::preset(Preset::Cf21) };
        (scene.camera.width_px, scene.camera.height_px) = (320, 180);
        scene.photo.noise = Noise::Off;
        let shoot = Shoot { judging: Judging::Skipped, ..Shoot::new(scene).unwrap() };
        shoot.take(&|_, _| {}).unwrap()
    }

    #[test]
    fn moments_gather_light_and_end_with_the_photo() {
        let (shot, mut moments) = (shot(), Vec::new());
        shot.moments(320, 6, &mut |time_s, photo| {
            moments.push((time_s, photo));
            Ok(())
        })
        .unwrap();
        assert_eq!(moments.len(), 6);
        assert!((moments[5].0 - shot.camera.shutter_close_s).abs() < 1e-9);
        for pair in moments.windows(2) {
            let lost =
                pair[0].1.rgb8.iter().zip(&pair[1].1.rgb8).map(|(a, b)| a.saturating_sub(*b));
            assert!(lost.max().unwrap() <= 1, "light stays");
        }
        let pairs = moments[5].1.rgb8.iter().zip(&shot.photo.rgb8);
        let difference = pairs.map(|(moment, photo)| moment.abs_diff(*photo)).max().unwrap();
        assert!(difference <= 2, "the last moment is the photo: {difference} levels off");
    }
}
