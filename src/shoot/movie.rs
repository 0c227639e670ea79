//! The photograph as it comes about: what the film holds after each share of the exposure.
//!
//! Light adds up, so a moment's film is that of the moment before and the light in between; it is
//! developed as the whole would be, without the noise of the sensor, with the room's light of the
//! time so far. The lamps themselves stand out as points, as they do to the eye: the light of the
//! last instant counts several times.

use super::Shot;
use crate::camera::Camera;
use crate::error::Result;
use crate::expose::{Film, project};
use crate::light::{Lamp, LightTrace};
use crate::photo::{Noise, Photo, PhotoOptions, develop};

/// Time in which the eye takes a lamp for a point.
const INSTANT_S: f64 = 1.0 / 24.0;
/// How many times the light of the last instant counts.
const POINT_GAIN: u32 = 4;

impl Shot {
    /// Develops what the film holds at `n` moments, the last of them at the end of the exposure, at a
    /// width in pixels. `each` receives the time of flight and the photo, in order.
    ///
    /// # Errors
    ///
    /// As [`crate::expose::expose`] and [`develop`], and those of `each`.
    pub fn moments(
        &self,
        width_px: u32,
        n: u32,
        each: &mut dyn FnMut(f64, Photo) -> Result<()>,
    ) -> Result<()> {
        let Camera { shutter_open_s: open_s, shutter_close_s: close_s, .. } = self.camera;
        let height = u64::from(self.camera.height_px) * u64::from(width_px);
        let height = height.div_ceil(u64::from(self.camera.width_px)).max(1);
        let height_px = u32::try_from(height).unwrap_or(u32::MAX);
        let camera = Camera { width_px, height_px, ..self.camera.clone() };
        let until = |close_s: f64| Camera { shutter_close_s: close_s, ..camera.clone() };
        let options = PhotoOptions { noise: Noise::Off, ..self.scene.photo.clone() };
        let expose = &self.scene.expose;
        let scale_log2 = project(&self.trace, &camera, expose)?.scale_log2();
        let light = |from_s: f64, to_s: f64| -> Result<Film> {
            let camera = Camera { shutter_open_s: from_s, ..until(to_s) };
            let trace = between(&self.trace, from_s, to_s);
            Ok(project(&trace, &camera, expose)?.at_scale(scale_log2)?.develop_on_all())
        };
        let mut film = light(open_s, open_s)?;
        let mut time_s = open_s;
        for moment in 1..=n {
            let end_s = open_s + (close_s - open_s) * f64::from(moment) / f64::from(n);
            add(&mut film, &light(time_s, end_s)?, 1);
            time_s = end_s;
            let mut seen = film.clone();
            if moment < n {
                add(&mut seen, &light((time_s - INSTANT_S).max(open_s), time_s)?, POINT_GAIN);
            }
            each(time_s, develop(&seen, &until(time_s), &options, self.scene.seed)?)?;
        }
        Ok(())
    }
}

fn add(film: &mut Film, more: &Film, times: u32) {
    for (sum, count) in film.counts.iter_mut().zip(&more.counts) {
        *sum = sum.saturating_add(count.saturating_mul(times));
    }
}

/// The samples of a time, with one before and one after it.
fn between(trace: &LightTrace, from_s: f64, to_s: f64) -> LightTrace {
    let part = |lamp: &Lamp| {
        let first = lamp.samples.partition_point(|sample| sample.time_s < from_s);
        let last = lamp.samples.partition_point(|sample| sample.time_s <= to_s);
        let samples = &lamp.samples[first.saturating_sub(1)..(last + 1).min(lamp.samples.len())];
        Lamp { emitter: lamp.emitter.clone(), samples: samples.to_vec() }
    };
    LightTrace { lamps: trace.lamps.iter().map(part).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Preset, Scene};
    use crate::shoot::{Judging, Shoot};

    #[test]
    fn moments_end_with_the_photo_and_never_lose_light() {
        let mut scene = Scene { word: "I".into(), ..Scene::preset(Preset::Cf21) };
        (scene.camera.width_px, scene.camera.height_px) = (320, 180);
        scene.photo.noise = Noise::Off;
        let shoot = Shoot { judging: Judging::Skipped, ..Shoot::new(scene).unwrap() };
        let shot = shoot.take(&|_, _| {}).unwrap();
        let mut moments = Vec::new();
        shot.moments(320, 6, &mut |time_s, photo| {
            moments.push((time_s, photo));
            Ok(())
        })
        .unwrap();
        let light = |photo: &Photo| photo.rgb8.iter().map(|level| u64::from(*level)).sum::<u64>();
        assert_eq!(moments.len(), 6);
        assert!((moments[5].0 - shot.camera.shutter_close_s).abs() < 1e-9);
        // The point of the lamp comes and goes; what was written stays.
        assert!(light(&moments[0].1) < light(&moments[5].1));
        let off = |(a, b): (&u8, &u8)| a.abs_diff(*b);
        let whole = &shot.photo.rgb8;
        let most = moments[5].1.rgb8.iter().zip(whole).map(off).max().unwrap();
        assert!(most <= 2, "the last moment is the photo: {most} levels off");
    }
}
