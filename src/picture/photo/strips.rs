//! Compresses the rows of a PNG in strips, which are computed in parallel.
//!
//! Input: the rows of a picture. Output: the contents of its IDAT chunks, which together are one
//! zlib stream (RFC 1950). The size of a strip is fixed, so that the bytes are the same for any
//! number of threads.
//!
//! 1. Each row is filtered by the row above it (Up) or by the mean of that and the pixel to the
//!    left (Average), whichever leaves the smaller sum of absolute values (PNG, 12.7). These two
//!    are best for noise.
//! 2. fdeflate compresses each strip to a deflate block (RFC 1951) with a fixed Huffman code.
//! 3. The blocks are joined as zlib's `Z_SYNC_FLUSH` does: all but the last lose the mark of the
//!    last block, and an empty stored block fills up their last byte. Checksums are combined.

use noctograph_core::parallel::prelude::*;

/// Number of bytes of filtered rows in a strip, or a single row if that is longer.
const STRIP_BYTES: usize = 1 << 18;

/// Maximum number of bytes in a stored block.
const MAX_STORED: usize = 0xffff;

/// The types of the filters, which precede each row.
const UP: u8 = 2;
const AVERAGE: u8 = 3;

/// Modulus of the checksum Adler-32.
const ADLER: u64 = 65_521;

/// A compressed strip.
struct Strip {
    /// Deflate blocks, the last of which ends at a whole byte.
    blocks: Vec<u8>,
    /// Adler-32 of the filtered rows, and their number of bytes.
    adler: [u64; 2],
    n_bytes: u64,
}

/// Returns the contents of the IDAT chunks of a picture with rows of `row_bytes`, and pixels of
/// `pixel_bytes`.
pub(super) fn idat_chunks(picture: &[u8], row_bytes: usize, pixel_bytes: usize) -> Vec<Vec<u8>> {
    let n_rows = picture.len() / row_bytes;
    let strip_rows = (STRIP_BYTES / (row_bytes + 1)).max(1);
    let n_strips = n_rows.div_ceil(strip_rows);
    let strips = (0..n_strips).into_par_iter().map_init(Vec::new, |filtered, strip| {
        let rows = strip * strip_rows..n_rows.min((strip + 1) * strip_rows);
        filter(picture, rows, [row_bytes, pixel_bytes], filtered);
        compress(filtered, strip + 1 == n_strips)
    });
    let strips: Vec<Strip> = strips.collect();
    // The stream begins with its header (32 kB window, fastest compression), and ends with the
    // checksum.
    let mut adler = [1, 0];
    let mut chunks: Vec<Vec<u8>> = Vec::with_capacity(strips.len() + 1);
    chunks.push(vec![0x78, 0x01]);
    for strip in strips {
        adler = combined(adler, strip.adler, strip.n_bytes);
        chunks.push(strip.blocks);
    }
    if let Some(last) = chunks.last_mut() {
        #[expect(clippy::cast_possible_truncation, reason = "below the modulus")]
        last.extend(((adler[1] << 16 | adler[0]) as u32).to_be_bytes());
    }
    chunks
}

/// Filters some rows of a picture, each preceded by the type of its filter.
fn filter(
    picture: &[u8],
    rows: std::ops::Range<usize>,
    [row_bytes, pixel_bytes]: [usize; 2],
    filtered: &mut Vec<u8>,
) {
    let above_first = vec![0_u8; row_bytes];
    filtered.resize(rows.len() * (row_bytes + 1), 0);
    let mut averaged = vec![0_u8; row_bytes];
    for (y, out) in rows.zip(filtered.chunks_exact_mut(row_bytes + 1)) {
        let above: &[u8] = match y {
            0 => &above_first,
            _ => &picture[(y - 1) * row_bytes..][..row_bytes],
        };
        let row = &picture[y * row_bytes..][..row_bytes];
        let (kind, out) = out.split_at_mut(1);
        noctograph_core::dispatch!(|| {
            for (out, (byte, above)) in out.iter_mut().zip(row.iter().zip(above)) {
                *out = byte.wrapping_sub(*above);
            }
            // The first pixel of a row has zeros to its left.
            for (out, (byte, above)) in
                averaged.iter_mut().zip(row.iter().zip(above)).take(pixel_bytes)
            {
                *out = byte.wrapping_sub(above >> 1);
            }
            let sides = above[pixel_bytes..].iter().zip(row);
            let bytes = row[pixel_bytes..].iter().zip(sides);
            for (out, (byte, (above, left))) in averaged[pixel_bytes..].iter_mut().zip(bytes) {
                *out = byte.wrapping_sub((above & left) + ((above ^ left) >> 1));
            }
            kind[0] = if magnitude(&averaged) < magnitude(out) {
                out.copy_from_slice(&averaged);
                AVERAGE
            } else {
                UP
            };
        });
    }
}

/// Returns the sum of the absolute values of signed bytes.
#[inline(always)]
fn magnitude(bytes: &[u8]) -> u64 {
    let sums = bytes.chunks(1 << 16).map(|bytes| {
        bytes.iter().map(|byte| u32::from(byte.cast_signed().unsigned_abs())).sum::<u32>()
    });
    sums.map(u64::from).sum()
}

/// Compresses the filtered rows of a strip.
fn compress(filtered: &[u8], is_last: bool) -> Strip {
    const FITS: &str = "a vector takes all bytes";
    // Photos compress to two fifths. Memory that is not reserved here would be copied as it grows.
    let out = Vec::<u8>::with_capacity(filtered.len() / 2);
    let mut compressor = fdeflate::Compressor::new(out).expect(FITS);
    compressor.write_data(filtered).expect(FITS);
    // The stream is its header of two bytes, one deflate block, and the checksum.
    let mut blocks = compressor.finish().expect(FITS);
    let checksum = blocks.split_off(blocks.len() - 4);
    let sum = checksum.iter().fold(0, |sum, byte| sum << 8 | u64::from(*byte));
    blocks.drain(..2);
    if blocks.len() > filtered.len() + 5 * filtered.len().div_ceil(MAX_STORED) {
        blocks = stored(filtered, is_last);
    } else if !is_last {
        // The lowest bit of a block marks the last one.
        blocks[0] &= !1;
        // A block's last code, the end of the block, ends with a one, and zeros fill up the byte.
        // An empty stored block begins with three zeros, and continues at the next whole byte.
        let free = blocks.last().map_or(0, |last| last.leading_zeros());
        blocks.extend((free < 3).then_some(0));
        blocks.extend([0, 0, 0xff, 0xff]);
    }
    Strip { blocks, adler: [sum & 0xffff, sum >> 16], n_bytes: filtered.len() as u64 }
}

/// Returns bytes as stored blocks, for rows that do not compress.
fn stored(bytes: &[u8], is_last: bool) -> Vec<u8> {
    let n_blocks = bytes.len().div_ceil(MAX_STORED);
    let blocks = bytes.chunks(MAX_STORED).enumerate().flat_map(|(block, bytes)| {
        let [low, high, ..] = bytes.len().to_le_bytes();
        let head = [u8::from(is_last && block + 1 == n_blocks), low, high, !low, !high];
        head.into_iter().chain(bytes.iter().copied())
    });
    blocks.collect()
}

/// Returns the Adler-32 of two parts, given the sums of each and the size of the second
/// (`adler32_combine` of zlib).
fn combined([a, b]: [u64; 2], [next_a, next_b]: [u64; 2], n_bytes: u64) -> [u64; 2] {
    let before = a + ADLER - 1;
    [(before + next_a) % ADLER, (b + next_b + n_bytes % ADLER * before) % ADLER]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns bytes that a decoder of PNG reads from the chunks.
    fn decoded(chunks: &[Vec<u8>], [width, height]: [u32; 2]) -> Vec<u8> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, width, height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header().unwrap();
        for chunk in chunks {
            writer.write_chunk(png::chunk::IDAT, chunk).unwrap();
        }
        writer.finish().unwrap();
        // The decoder of `png` verifies the checksum.
        let mut decoder = png::Decoder::new(std::io::Cursor::new(file));
        decoder.ignore_checksums(false);
        let mut reader = decoder.read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        reader.finish().unwrap();
        bytes
    }

    /// Returns `n` bytes of noise below `2^bits`.
    fn noise(n: usize, bits: u32, state: &mut u32) -> Vec<u8> {
        let bytes = (0..n).map(|_| {
            *state = state.wrapping_mul(0x9e37_79b9).wrapping_add(0x7f4a_7c15) ^ *state >> 15;
            state.to_le_bytes()[3].checked_shr(8 - bits).unwrap_or(0)
        });
        bytes.collect()
    }

    #[test]
    fn strips_of_any_size_join_to_the_picture() {
        let mut state = 1;
        for bits in [0, 1, 3, 8] {
            for width in [1, 2, 3, 40, STRIP_BYTES / 3, STRIP_BYTES / 7] {
                let (row_bytes, is_wide) = (3 * width, width > 40);
                let height = if is_wide { 9 } else { 40 };
                let picture = noise(height * row_bytes, bits, &mut state);
                let chunks = idat_chunks(&picture, row_bytes, 3);
                assert_eq!(chunks.len() > 2, is_wide, "{width}: strips");
                let size = [width, height].map(|side| u32::try_from(side).unwrap());
                assert!(decoded(&chunks, size) == picture, "{width} px, noise of {bits} bits");
            }
        }
    }

    #[test]
    fn a_strip_ends_at_any_bit_of_a_byte() {
        let (mut state, mut ends) = (5, [0; 8]);
        for n in 400..600 {
            let row = noise(n, 4, &mut state);
            let strip = compress(&row, false);
            let last = compress(&row, true).blocks.last().map_or(0, |last| last.leading_zeros());
            ends[last as usize] += 1;
            // Another decoder reads the strip twice, followed by the last block.
            let mut stream = strip.blocks.repeat(2);
            stream.extend(stored(b"end", true));
            let mut decoded = Vec::new();
            let mut decoder = flate2::read::DeflateDecoder::new(&*stream);
            std::io::Read::read_to_end(&mut decoder, &mut decoded).unwrap();
            assert!(decoded == [&*row, &row, b"end"].concat(), "{n} bytes");
        }
        assert!(ends.iter().all(|n| *n > 0), "{ends:?}");
    }

    #[test]
    fn rows_that_do_not_compress_are_stored() {
        let noisy: Vec<u8> =
            noise(3 * MAX_STORED, 8, &mut 3).iter().map(|byte| byte | 64).collect();
        assert_eq!(compress(&noisy, true).blocks.len(), noisy.len() + 15);
    }
}
