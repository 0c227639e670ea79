//! Photos, either rendered or from a real camera. The letter reader treats both alike.

use crate::error::Result;
use crate::product::{Rules, Valid, check_picture};

/// Rendered or real photograph.
pub type Photo = Valid<PhotoData>;

/// Data of a [`Photo`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PhotoData {
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// Red, green and blue of each pixel, row by row from the top left, sRGB-encoded.
    pub rgb8: Vec<u8>,
    /// Text of the scene from which the photo was rendered, if the file contains it.
    pub scene_toml: Option<String>,
}

impl Rules for PhotoData {
    fn check(&self) -> Result<()> {
        check_picture([self.width_px, self.height_px], self.rgb8.len(), 3)
    }
}
