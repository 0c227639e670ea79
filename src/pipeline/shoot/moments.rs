//! The photograph as it develops: the film after each share of the exposure.
//!
//! Light adds up, so a moment's film is that of the moment before and the light in between; it is
//! developed as the whole would be, without the noise of the sensor, with the room's light of the
//! time so far.

use super::Shot;
use noctograph_core::camera::Camera;
use noctograph_core::error::Result;
use noctograph_picture::expose::{Film, project};
use noctograph_picture::light::{Lamp, LightTrace};
use noctograph_picture::photo::{Noise, Photo, PhotoOptions, develop};

impl Shot {
    /// Develops the film at `n` moments, the last one at the end of the exposure, at a width in
    /// pixels. `each` receives the time of flight and the photo, in order.
    ///
    /// # Errors
    ///
    /// As [`noctograph_picture::expose::expose`] and [`develop`], and those of `each`.
    pub fn moments(
        &self,
        width_px: u32,
        n: u32,
        each: &mut dyn FnMut(f64, Photo) -> Result<()>,
    ) -> Result<()> {
        let mut film = Growing::new(self, width_px)?;
        (1..=n).try_for_each(|moment| {
            film.expose_to(film.moment_s(moment, n))?;
            each(film.time_s, film.photo()?)
        })
    }
}

/// A film that is being exposed, and its camera.
struct Growing<'a> {
    shot: &'a Shot,
    camera: Camera,
    options: PhotoOptions,
    film: Film,
    start_s: f64,
    end_s: f64,
    /// Up to when it is exposed.
    time_s: f64,
}

impl<'a> Growing<'a> {
    fn new(shot: &'a Shot, width_px: u32) -> Result<Self> {
        let camera = shot.camera.at_width(width_px);
        let (start_s, end_s) = (camera.shutter_open_s, camera.shutter_close_s);
        // Twice as coarse as the whole, so that the rounding of its parts cannot overflow.
        let scale_log2 = project(&shot.trace, &camera, &shot.shoot.scene.expose)?.scale_log2() + 1;
        let film = Film {
            width_px: camera.width_px,
            height_px: camera.height_px,
            counts: vec![0; 3 * camera.width_px as usize * camera.height_px as usize],
            scale_log2,
        };
        let options = PhotoOptions { noise: Noise::Off, ..shot.shoot.scene.photo.clone() };
        Ok(Self { shot, camera, options, film, start_s, end_s, time_s: start_s })
    }

    /// Time of the moment of a number, of `n`.
    fn moment_s(&self, moment: u32, n: u32) -> f64 {
        self.start_s + (self.end_s - self.start_s) * f64::from(moment) / f64::from(n)
    }

    /// Adds the light up to a time.
    fn expose_to(&mut self, end_s: f64) -> Result<()> {
        let (shutter_open_s, shutter_close_s) = (self.time_s, end_s);
        let camera = Camera { shutter_open_s, shutter_close_s, ..self.camera.clone() };
        let lit = part(&self.shot.trace, self.time_s, end_s);
        let latent = project(&lit, &camera, &self.shot.shoot.scene.expose)?;
        let more = latent.at_scale(self.film.scale_log2)?.develop_on_all().counts;
        for (sum, count) in self.film.counts.iter_mut().zip(more) {
            *sum = sum.saturating_add(count);
        }
        self.time_s = end_s;
        Ok(())
    }

    /// The photo so far.
    fn photo(&self) -> Result<Photo> {
        let camera = Camera { shutter_close_s: self.time_s, ..self.camera.clone() };
        let scene = &self.shot.shoot.scene;
        develop(&self.film, &camera, &scene.expose, &self.options, scene.seed)
    }
}

/// The samples of a time, with one before and one after it.
fn part(trace: &LightTrace, from_s: f64, to_s: f64) -> LightTrace {
    let part = |lamp: &Lamp| {
        let first = lamp.samples.partition_point(|sample| sample.time_s < from_s);
        let last = lamp.samples.partition_point(|sample| sample.time_s <= to_s);
        let samples = &lamp.samples[first.saturating_sub(1)..(last + 1).min(lamp.samples.len())];
        Lamp { drone: lamp.drone, emitter: lamp.emitter.clone(), samples: samples.to_vec() }
    };
    LightTrace { lamps: trace.lamps.iter().map(part).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Preset, Scene};
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
