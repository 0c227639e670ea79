//! The photograph as it comes about: what the film holds after each share of the exposure.
//!
//! Light adds up, so a moment's film is that of the moment before and the light in between; it is
//! developed as the whole would be, without the noise of the sensor, with the room's light of the
//! time so far. In a movie the lamps are drawn as points, as they look to the eye.

use super::Shot;
use noctograph_core::camera::{Camera, ImagePoint};
use noctograph_core::error::Result;
use noctograph_picture::expose::{Film, project};
use noctograph_picture::light::{Lamp, LightSample, LightTrace};
use noctograph_picture::photo::{Noise, Photo, PhotoOptions, develop};

/// Width of the point of a lamp (σ) by the width of the picture.
const POINT_SHARE: f64 = 0.0025;

impl Shot {
    /// Develops what the film holds at `n` moments, the last of them at the end of the exposure, at
    /// a width in pixels. `each` receives the time of flight and the photo, in order.
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

    /// A movie of `n` pictures of the exposure at a width in pixels, with the lamps as points.
    /// `each` receives the pictures in order.
    ///
    /// # Errors
    ///
    /// As [`Self::moments`].
    pub fn movie(
        &self,
        width_px: u32,
        n: u32,
        each: &mut dyn FnMut(&Photo) -> Result<()>,
    ) -> Result<()> {
        let mut film = Growing::new(self, width_px)?;
        (1..=n).try_for_each(|picture| {
            film.expose_to(film.moment_s(picture, n))?;
            let mut photo = film.photo()?;
            if picture < n {
                self.draw_lamps(&mut photo, &film.camera, film.time_s);
            }
            each(&photo)
        })
    }

    /// Draws the lamps that are lit at a time as points.
    fn draw_lamps(&self, picture: &mut Photo, camera: &Camera, time_s: f64) {
        let sigma_px = POINT_SHARE * f64::from(picture.width_px);
        for lamp in &self.trace.lamps {
            let next = lamp.samples.partition_point(|sample| sample.time_s <= time_s);
            let [Some(a), Some(b)] = [next.checked_sub(1), Some(next)]
                .map(|index| index.and_then(|index| lamp.samples.get(index)))
            else {
                continue;
            };
            let LightSample { position_m, level, .. } = a.toward(b, time_s);
            if level > 0.0
                && let Some(place) = camera.image_from_world(position_m)
            {
                glow(picture, place, sigma_px);
            }
        }
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
        let scale_log2 = project(&shot.trace, &camera, &shot.scene.expose)?.scale_log2() + 1;
        let film = Film {
            width_px: camera.width_px,
            height_px: camera.height_px,
            counts: vec![0; 3 * camera.width_px as usize * camera.height_px as usize],
            scale_log2,
        };
        let options = PhotoOptions { noise: Noise::Off, ..shot.scene.photo.clone() };
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
        let latent = project(&lit, &camera, &self.shot.scene.expose)?;
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
        let scene = &self.shot.scene;
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

/// Adds a white point to a picture.
fn glow(picture: &mut Photo, ImagePoint { x_px, y_px, .. }: ImagePoint, sigma_px: f64) {
    let reach = 4.0 * sigma_px;
    let span = |at: f64, most: u32| {
        let [first, last] = [at - reach, at + reach].map(|px| px.clamp(0.0, f64::from(most)));
        #[expect(clippy::cast_possible_truncation, reason = "clamped")]
        (first as usize..last as usize)
    };
    for y in span(y_px, picture.height_px) {
        for x in span(x_px, picture.width_px) {
            let [dx, dy] = [x as f64 + 0.5 - x_px, y as f64 + 0.5 - y_px];
            let share = libm::exp(-0.5 * (dx * dx + dy * dy) / (sigma_px * sigma_px));
            let at = 3 * (y * picture.width_px as usize + x);
            for level in &mut picture.rgb8[at..at + 3] {
                *level = mixed(*level, 255, share);
            }
        }
    }
}

fn mixed(from: u8, to: u8, share: f64) -> u8 {
    let level = f64::from(from) + (f64::from(to) - f64::from(from)) * share;
    #[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
    (level.round().clamp(0.0, 255.0) as u8)
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

    fn most_off(a: &Photo, b: &Photo) -> u8 {
        a.rgb8.iter().zip(&b.rgb8).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
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
        let off = most_off(&moments[5].1, &shot.photo);
        assert!(off <= 2, "the last moment is the photo: {off} levels off");
    }

    #[test]
    fn a_movie_writes_and_ends_with_the_photo() {
        let (shot, mut pictures) = (shot(), Vec::new());
        shot.movie(320, 30, &mut |picture| {
            pictures.push(picture.clone());
            Ok(())
        })
        .unwrap();
        assert_eq!(pictures.len(), 30);
        assert!(most_off(&pictures[29], &shot.photo) <= 2);
        let mut developed = pictures.iter();
        shot.moments(320, 30, &mut |_, moment| {
            let pixels = developed.next().unwrap().rgb8.chunks(3).zip(moment.rgb8.chunks(3));
            let n_other = pixels.filter(|(a, b)| a != b).count();
            assert!(n_other < 100, "each is developed, and drawn on by points: {n_other} pixels");
            Ok(())
        })
        .unwrap();
        let bright = |photo: &Photo| photo.rgb8.iter().filter(|level| **level > 128).count();
        let bright: Vec<usize> = pictures.iter().map(bright).collect();
        assert!(bright[0] < 10 && bright[29] > 100, "{bright:?}");
        let grows = bright.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!(grows > 6, "it is written bit by bit: {bright:?}");
    }
}
