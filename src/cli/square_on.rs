//! A photograph seen square on, by its corners or its camera.

use super::{CameraFlags, Corners};
use crate::camera::Framing;
use crate::error::Result;
use crate::photo::Photo;
use crate::score::View;

/// The photo with its line of writing seen square on, if corners or a camera are given.
pub(super) fn square_on(
    photo: Photo,
    corners: Option<&Corners>,
    flags: &CameraFlags,
) -> Result<Photo> {
    if let Some(Corners(corners_px)) = corners {
        return View::rectified_by_corners(&photo, *corners_px);
    }
    if !flags.is_given() {
        return Ok(photo);
    }
    let mut scene = flags.scene()?;
    (scene.camera.width_px, scene.camera.height_px) = (photo.width_px, photo.height_px);
    let fixed = matches!(scene.camera.framing, Framing::Fixed(_)) && !scene.has_strokes();
    let bounds_m = if fixed { [0.0; 4] } else { scene.strokes()?.bounds_m() };
    View::rectified_by_camera(&photo, &scene.camera.camera(bounds_m, 0.0)?)
}
