//! Photo: film becomes a picture of 8 bits a channel, with all that is needed to make it again.

/// A photograph. A rendered one and a real one meet here; the judge can't tell them apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Photo {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Red, green, blue by pixel, row by row from the top left, sRGB-encoded.
    pub rgb8: Vec<u8>,
    /// The scene file that made it, where the picture carries one.
    pub scene_toml: Option<String>,
}
