//! Expose: lamps and a camera become a [`Film`].

/// What the sensor received: luminous exposure per pixel and color channel, as integer counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Film {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Three planes (red, green, blue: linear sRGB), each row by row from the top left.
    pub counts: Vec<u32>,
    /// One count is `2^scale_log2` lx s.
    pub scale_log2: i32,
}
