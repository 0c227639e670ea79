//! Frame header of a JPEG file, from which the decoder's cost is known in advance (ITU-T T.81).
//!
//! The file size of a progressive picture does not limit the work. The decoder keeps all
//! coefficients, two bytes each, until the last scan, and a scan may take only a dozen bytes.

/// Costs of decoding a JPEG picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JpegFrame {
    /// Width and height in pixels.
    pub size_px: [u64; 2],
    /// Number of samples of all components, padded to whole blocks.
    pub samples: u64,
    /// Number of scans over the samples.
    pub scans: u64,
    /// True if the decoder keeps all coefficients in memory until the last scan.
    pub progressive: bool,
    /// True if the file contains an end marker. Without an end marker, the missing part is gray.
    pub has_end: bool,
}

/// Width and height of a coded block in pixels.
const BLOCK_PX: u64 = 8;

impl JpegFrame {
    /// Parses the first frame of a JPEG file (ITU-T T.81, B.2). Returns `None` if the file has
    /// none.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(b"\xff\xd8")?;
        loop {
            let [0xff, marker, high, low, ..] = *rest else { return None };
            let length = usize::from(u16::from_be_bytes([high, low]));
            match marker {
                // Any number of 0xff bytes may precede a marker. A frame begins with SOF0, SOF1 or
                // SOF2 (progressive). TEM, RST, SOI and EOI have no length, unlike all others.
                0xff => rest = &rest[1..],
                0xc0..=0xc2 => return Self::from_header(rest.get(4..)?, marker == 0xc2, bytes),
                0x01 | 0xd0..=0xd9 => rest = &rest[2..],
                _ => rest = rest.get(2 + length.max(2)..)?,
            }
        }
    }

    /// Parses a frame's header after its marker and length, or returns `None` if the header is cut
    /// off. `progressive` is the kind of frame. `bytes` is the whole file, whose scans are counted.
    fn from_header(header: &[u8], progressive: bool, bytes: &[u8]) -> Option<Self> {
        let [_, h1, h0, w1, w0, n, ref components @ ..] = *header else { return None };
        let size_px = [[w1, w0], [h1, h0]].map(|side| u64::from(u16::from_be_bytes(side)));
        let components = components.get(..3 * usize::from(n))?;
        // Each component has a pair of 4-bit sampling factors, horizontal and vertical. The width
        // and height of a coded unit are the largest factors in blocks.
        let factors = components.chunks(3).map(|c| [c[1] >> 4, c[1] & 15].map(u64::from));
        let most = factors.clone().fold([1, 1], |a, b| [a[0].max(b[0]), a[1].max(b[1])]);
        let units = |side: usize| size_px[side].div_ceil(BLOCK_PX * most[side]);
        let per_block = BLOCK_PX * BLOCK_PX;
        let samples = factors.map(|[h, v]| per_block * h * v * units(0) * units(1)).sum();
        // The data of a scan cannot contain the marker of another scan.
        let scans = bytes.windows(2).filter(|pair| *pair == [0xff, 0xda]).count() as u64;
        let has_end = header.windows(2).any(|pair| pair == [0xff, 0xd9]);
        Some(Self { size_px, samples, scans, progressive, has_end })
    }

    /// Returns the number of bytes that a decoder needs for the picture, with three channels per
    /// pixel, and for the coefficients if the picture is progressive.
    pub fn decoded_bytes(&self) -> u64 {
        let coefficients = if self.progressive { 2 * self.samples } else { 0 };
        3 * self.size_px[0] * self.size_px[1] + coefficients
    }

    /// Returns the time in ns that a core of a 2020 processor takes for the scans after the first.
    pub fn later_scans_ns(&self) -> u64 {
        // A block of 64 samples takes 20 ns.
        self.samples.saturating_mul(self.scans.saturating_sub(1)) / 3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates a file of 17 × 9 pixels whose components have these sampling factors.
    fn file(marker: u8, factors: &[u8], scans: usize) -> Vec<u8> {
        let mut bytes = b"\xff\xd8\xff\xe0\0\x04\xff\xd9\xff".to_vec();
        let n = u8::try_from(factors.len()).unwrap();
        bytes.extend([0xff, marker, 0, 8 + 3 * n, 8, 0, 9, 0, 17, n]);
        factors.iter().zip(0..).for_each(|(factor, id)| bytes.extend([id, *factor, 0]));
        bytes.extend(b"\xff\xda\0\x02data".repeat(scans));
        bytes
    }

    #[test]
    fn coefficients_of_progressive_pictures_count_and_their_scans() {
        let plain = JpegFrame::parse(&file(0xc0, &[0x11], 1)).unwrap();
        assert_eq!((plain.size_px, plain.samples), ([17, 9], 3 * 2 * 64), "whole blocks");
        assert_eq!(plain.decoded_bytes(), 3 * 17 * 9);
        let halved = JpegFrame::parse(&file(0xc2, &[0x22, 0x11, 0x11], 5)).unwrap();
        assert_eq!(halved.samples, 2 * (4 + 1 + 1) * 64, "two units of six blocks");
        assert_eq!(halved.decoded_bytes(), 3 * 17 * 9 + 2 * halved.samples);
        assert_eq!((halved.scans, halved.later_scans_ns()), (5, halved.samples * 4 / 3));
        assert!(!plain.has_end, "a thumbnail's end, before the frame, is none");
        let whole = [&file(0xc0, &[0x11], 1)[..], b"\xff\xd9trailer"].concat();
        assert!(JpegFrame::parse(&whole).unwrap().has_end);
    }

    #[test]
    fn what_has_no_frame_is_none() {
        let whole = file(0xc2, &[0x11, 0x11, 0x11], 1);
        for n in 0..whole.len() - 9 {
            assert_eq!(JpegFrame::parse(&whole[..n]).filter(|_| n < 28), None, "{n} bytes");
        }
        assert_eq!(JpegFrame::parse(b"\xff\xd8\xff\xe0\0\0"), None);
        assert_eq!(JpegFrame::parse(b"PNG"), None);
    }
}
