//! Photo: a picture, rendered or real. The judge cannot tell them apart.

use crate::error::Result;
use crate::product::{Rules, Valid, check_picture};

/// A photograph, rendered or real.
pub type Photo = Valid<PhotoData>;

/// The data of a [`Photo`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PhotoData {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Red, green, blue by pixel, row by row from the top left, sRGB-encoded.
    pub rgb8: Vec<u8>,
    /// Text of the scene that made it, if the file has one.
    pub scene_toml: Option<String>,
}

impl Rules for PhotoData {
    fn check(&self) -> Result<()> {
        check_picture([self.width_px, self.height_px], self.rgb8.len(), 3)
    }
}
