//! Photo: a picture, rendered or real. The judge cannot tell them apart.

/// A photograph, rendered or real.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Photo {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Red, green, blue by pixel, row by row from the top left, sRGB-encoded.
    pub rgb8: Vec<u8>,
    /// Text of the scene that made it, where the file has one.
    pub scene_toml: Option<String>,
}
