//! Flags that set the picture's camera, its position, the size or paper, and the compute device.

use std::path::PathBuf;

use super::flags::find_scene;
use super::names::{named, numbers};
use super::terminal::warn;
use crate::camera::{FixedPose, Framing};
use crate::error::Result;
use crate::expose::BackendChoice;
use crate::photo::{Noise, taken_as};
use crate::scene::{Preset, Scene};
use clap::Args;

/// Flags that select the camera.
#[derive(Debug, Args)]
pub(super) struct CameraFlags {
    /// Camera of another scene, or auto, which frames the word from directly in front
    #[arg(long, value_name = "SCENE|auto")]
    camera: Option<String>,
    /// Photograph whose EXIF sets sensor, lens, aperture, shutter time, ISO and aspect
    #[arg(long, value_name = "PHOTO")]
    camera_from: Option<PathBuf>,
}

impl CameraFlags {
    /// Returns true if a flag selects the camera.
    pub(super) fn is_given(&self) -> bool {
        self.camera.is_some() || self.camera_from.is_some()
    }

    /// Returns the scene from which the camera is taken, with the camera that the flags select. The
    /// scene also has the word that the camera frames.
    pub(super) fn scene(&self) -> Result<Scene> {
        let named = self.camera.as_deref().filter(|named| *named != "auto");
        let mut scene = named
            .map_or(Ok(Scene::preset(Preset::default())), |n| Ok(find_scene(n, &[])?.scene))?;
        self.apply(&mut scene)?;
        Ok(scene)
    }

    /// Sets the camera of the scene to the one that the flags select, and prints warnings about the
    /// EXIF of a photograph.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<()> {
        match self.camera.as_deref() {
            None => {}
            Some("auto") => scene.camera.framing = Framing::default(),
            Some(named) => scene.camera = find_scene(named, &[])?.scene.camera,
        }
        if let Some(path) = &self.camera_from {
            let camera = taken_as(std::mem::take(&mut scene.camera), path)?;
            warn(&camera.warnings);
            scene.camera = camera.product;
        }
        Ok(())
    }
}

/// Flag of the camera's position.
#[derive(Debug, Args)]
pub(super) struct StandFlag {
    /// Position of the camera, in m from the take-off mark: to the right, back (negative: in front)
    /// and up, such as 1.2,-3.5,1.4. The camera is aimed at the word
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true)]
    camera_at: Option<[f64; 3]>,
}

impl StandFlag {
    /// Moves the camera of a scene to the position that was typed. Returns an error if it is out of
    /// range.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<()> {
        if let Some(position_m) = self.camera_at {
            let pose = FixedPose { position_m, ..FixedPose::default() };
            scene.camera.framing = Framing::Fixed(pose);
            scene.camera.check()?;
        }
        Ok(())
    }
}

/// Reads a position such as `1.2,-3.5,1.4` as x, y and z in m of the world frame. Returns a message
/// for other texts.
fn place(text: &str) -> std::result::Result<[f64; 3], String> {
    numbers(text, &[',']).ok_or_else(|| "wanted X,Y,Z in meters, such as 1.2,-3.5,1.4".to_owned())
}

/// Flags of the picture, which set the camera, the size, and the device that computes the exposure.
#[derive(Debug, Args)]
pub(super) struct PictureFlags {
    #[command(flatten)]
    camera: CameraFlags,
    #[command(flatten)]
    stand: StandFlag,
    /// Size of the picture: pixels, such as 1920x1080, or for a print the paper size in landscape
    /// format and the dots per inch, such as A2@150 or 600x400mm@150. A print contains the noise of
    /// the camera's sensor, resampled to the print's dots
    #[arg(long, value_name = "WxH|PAPER@DPI", value_parser = size)]
    size: Option<Size>,
    /// Device that computes the exposure. The result is the same on every device
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = named::<BackendChoice>())]
    pub(super) backend: BackendChoice,
}

impl PictureFlags {
    /// Sets the camera and the picture size of the scene to those that the flags select. For a
    /// print, the sensor noise becomes that of the print's dots.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<()> {
        self.camera.apply(scene)?;
        self.stand.apply(scene)?;
        // A dot of a print combines the charge of several smaller photosites.
        if let Some(Size { px: [width_px, height_px], dots_per_inch }) = self.size {
            let Scene { camera, photo, .. } = scene;
            if let Noise::Emva1288(noise) = &mut photo.noise
                && dots_per_inch.is_some()
            {
                // If the scene already describes a print, the noise is that of the print's dots.
                let before_px = match camera.dots_per_inch {
                    Some(_) => f64::from(camera.width_px),
                    None => camera.body.figures().width_px,
                };
                let ratio = before_px / f64::from(width_px);
                *noise = noise.resampled(ratio * ratio);
            }
            (camera.width_px, camera.height_px) = (width_px, height_px);
            camera.dots_per_inch = dots_per_inch;
            scene.camera.check()?;
        }
        Ok(())
    }
}

/// Size of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Size {
    px: [u32; 2],
    /// Dots per inch, if the size is that of a print.
    dots_per_inch: Option<f64>,
}

/// Longer sides of the paper sizes A0 to A6 in mm (ISO 216). Each is also the shorter side of the
/// next larger size.
const PAPER_MM: [f64; 7] = [1189.0, 841.0, 594.0, 420.0, 297.0, 210.0, 148.0];
/// Length of an inch in mm.
const MM_PER_INCH: f64 = 25.4;
/// Smallest and largest resolution of a print, from a banner to a phototypesetter.
const DOTS_PER_INCH: std::ops::RangeInclusive<f64> = 10.0..=2400.0;

/// Parses a size in pixels such as `1920x1080`, or a paper size and dots per inch such as `A2@150`.
/// Returns a message for other texts.
fn size(text: &str) -> std::result::Result<Size, String> {
    let wanted = "wanted WIDTHxHEIGHT in pixels, such as 1920x1080, or a print: A0 to A5, or \
                  WIDTHxHEIGHTmm, with @ and its dots per inch (10 to 2400), such as A2@150";
    let size = match text.split_once('@') {
        Some((paper, dots)) => print_size(paper, dots),
        None => {
            let sides = text.split_once(['x', 'X', '×']);
            let px = sides.and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
            px.map(|px| Size { px, dots_per_inch: None })
        }
    };
    size.ok_or_else(|| wanted.to_owned())
}

/// Returns the size in pixels of a print, given its paper and its dots per inch, or `None` if these
/// are not understood.
fn print_size(paper: &str, dots: &str) -> Option<Size> {
    let dots: f64 = dots.parse().ok().filter(|dots| DOTS_PER_INCH.contains(dots))?;
    let number = paper.strip_prefix(['A', 'a']).and_then(|n| n.parse().ok());
    // Each paper size is half the previous one, so its shorter side is the longer side of the next.
    // A6 itself is not offered, because the list has no shorter side for it.
    let mm = match number.filter(|n: &usize| *n + 1 < PAPER_MM.len()) {
        Some(n) => [PAPER_MM[n], PAPER_MM[n + 1]],
        None => numbers(paper.strip_suffix("mm")?, &['x', 'X', '×'])?,
    };
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let px = mm.map(|mm: f64| (mm / MM_PER_INCH * dots).round() as u32);
    Some(Size { px, dots_per_inch: Some(dots) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_pixels_or_a_print() {
        let print = |px, dots| Ok(Size { px, dots_per_inch: Some(dots) });
        assert_eq!(size("1920x1080"), Ok(Size { px: [1920, 1080], dots_per_inch: None }));
        // A2 measures 594 mm by 420 mm (ISO 216), and an inch is 25.4 mm.
        assert_eq!(size("A2@150"), print([3508, 2480], 150.0));
        assert_eq!(size("a5@300"), print([2480, 1748], 300.0));
        assert_eq!(size("254x127mm@100"), print([1000, 500], 100.0));
        assert_eq!(size("1e99x10mm@100"), print([u32::MAX, 39], 100.0), "refused by its pixels");
        for wrong in ["A6@150", "A2", "A2@0", "A2@nan", "-1x5mm", "594x420@150", "x", "A2@150dpi"] {
            assert!(size(wrong).is_err_and(|wanted| wanted.contains("A2@150")), "{wrong}");
        }
    }

    #[test]
    fn a_print_has_its_sensors_noise_however_often_it_is_resized() {
        fn on(sizes: &[&str]) -> Scene {
            let mut scene = Scene::preset(Preset::default());
            for text in sizes {
                PictureFlags {
                    camera: CameraFlags { camera: None, camera_from: None },
                    stand: StandFlag { camera_at: None },
                    size: Some(size(text).unwrap()),
                    backend: BackendChoice::Auto,
                }
                .apply(&mut scene)
                .unwrap();
            }
            scene
        }
        let Noise::Emva1288(poster) = on(&["A2@150"]).photo.noise else { panic!("a sensor") };
        // A width of 6000 photosites is divided into 3508 dots.
        let n = (6000.0_f64 / 3508.0).powi(2);
        assert!((poster.full_well_e / 50_000.0 / n - 1.0).abs() < 1e-12, "{poster:?}");
        let Noise::Emva1288(twice) = on(&["A4@150", "A2@150"]).photo.noise else { panic!() };
        assert!((twice.full_well_e / poster.full_well_e - 1.0).abs() < 1e-12, "{twice:?}");
        assert_eq!(on(&["640x360"]).photo, Scene::preset(Preset::default()).photo);
        let mut large = Scene::preset(Preset::default());
        (large.camera.width_px, large.camera.height_px) = (14_043, 9933);
        let error = large.check().unwrap_err();
        assert!(error.hint().contains("dots per inch"), "A0@300: {error}");
    }
}
