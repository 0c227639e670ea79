//! A photograph seen square on, by its corners or its camera.

use super::flags::CameraFlags;
use crate::camera::Framing;
use crate::error::{Error, Result};
use crate::photo::Photo;
use crate::score::{Homography, View};

/// Four corners in a photo, clockwise from the upper left.
#[derive(Clone, Debug)]
pub(super) struct Corners(pub(super) [[f64; 2]; 4]);

impl std::str::FromStr for Corners {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let corner = |pair: &str| {
            let (x, y) = pair.split_once(',')?;
            Some([x.trim().parse().ok()?, y.trim().parse().ok()?])
        };
        let corners: Option<Vec<[f64; 2]>> = text.split_whitespace().map(corner).collect();
        corners.and_then(|corners| corners.try_into().ok()).map(Self).ok_or_else(|| {
            "wanted four corners \"X,Y X,Y X,Y X,Y\" in pixels, clockwise from the upper left"
                .into()
        })
    }
}

/// Room around the corners, in the line's height: letters may hang out of them.
const AROUND_CORNERS: f64 = 0.5;

/// A photo whose line of writing is seen square on, where corners or a camera say how.
pub(super) fn square_on(
    photo: Photo,
    corners: Option<&Corners>,
    flags: &CameraFlags,
) -> Result<Photo> {
    let size_px = [photo.width_px, photo.height_px];
    if let Some(Corners(corners)) = corners {
        let side = |a: usize, b: usize| {
            libm::hypot(corners[b][0] - corners[a][0], corners[b][1] - corners[a][1])
        };
        let [width, height] = [side(0, 1).max(side(3, 2)), side(0, 3).max(side(1, 2))];
        let view =
            View::Plane(Homography::from_corners([0.0, 0.0, width, height], *corners, size_px)?);
        let room = AROUND_CORNERS * height;
        return Ok(view.square_on(&photo, [-room, -room, width + room, height + room], 1.0));
    }
    if !flags.is_given() {
        return Ok(photo);
    }
    let mut scene = flags.scene()?;
    (scene.camera.width_px, scene.camera.height_px) = (photo.width_px, photo.height_px);
    let fixed = matches!(scene.camera.framing, Framing::Fixed(_)) && !scene.has_strokes();
    let bounds_m = if fixed { [0.0; 4] } else { scene.strokes()?.bounds_m() };
    let camera = scene.camera.camera(bounds_m, 0.0)?;
    let bounds_m = camera.plane_bounds_m().ok_or_else(|| {
        let wanted = "a camera all of whose picture shows the plane of the word";
        let hint = "name the scene that the photo was taken with, or the four --corners instead";
        Error::input("camera", "one that looks past the word", wanted, hint)
    })?;
    let px_per_m = f64::from(size_px[0]) / (bounds_m[2] - bounds_m[0]);
    Ok(View::from(&camera).square_on(&photo, bounds_m, px_per_m))
}
