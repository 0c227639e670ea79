//! Film: the product, as integer counts.

use noctograph_core::digest::Digest;

/// Luminous exposure of the sensor per pixel and color channel, as integer counts.
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

impl Film {
    /// Luminous exposure in lx s of one channel (0 red, 1 green, 2 blue) at a pixel,
    /// `y * width_px + x`. White light of H lx s has H in all three.
    ///
    /// # Panics
    ///
    /// If the film has no such channel or pixel.
    #[must_use]
    pub fn exposure_lx_s(&self, channel: usize, index: usize) -> f64 {
        libm::ldexp(f64::from(self.plane(channel)[index]), self.scale_log2)
    }

    /// Sum of one channel (0 red, 1 green, 2 blue) over the pixels, in lx s.
    ///
    /// # Panics
    ///
    /// If the film has no such channel.
    #[must_use]
    pub fn light_lx_s_px2(&self, channel: usize) -> f64 {
        let sum: u64 = self.plane(channel).iter().map(|&count| u64::from(count)).sum();
        libm::ldexp(sum as f64, self.scale_log2)
    }

    /// Counts of one channel.
    pub fn plane(&self, channel: usize) -> &[u32] {
        let pixels = self.counts.len() / 3;
        &self.counts[channel * pixels..][..pixels]
    }

    /// SHA-256 of size, scale and counts (little endian), in hexadecimal; the same for equal films
    /// on every backend and machine.
    #[must_use]
    pub fn sha256(&self) -> String {
        let mut digest = Digest::default();
        digest.add(self.width_px.to_le_bytes());
        digest.add(self.height_px.to_le_bytes());
        digest.add(self.scale_log2.to_le_bytes());
        for counts in self.counts.chunks(4096) {
            let bytes: Vec<u8> = counts.iter().flat_map(|count| count.to_le_bytes()).collect();
            digest.add(bytes);
        }
        digest.hex()
    }
}
