//! Animated PNG (APNG), which every browser plays: only what changes is written.

use std::io::Write;

use png::{BlendOp, ColorType, Compression, Encoder, Writer};

use super::Photo;

/// Levels by which a pixel may differ from what is shown before it is written again: none that one
/// sees, and glare moves most pixels by one level now and then.
const UNSEEN_LEVELS: u8 = 1;

/// An animated PNG that is being written.
pub struct Animation<W: Write> {
    writer: Writer<W>,
    /// What is shown; empty before the first picture.
    shown: Vec<u8>,
}

impl<W: Write> std::fmt::Debug for Animation<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Animation").finish_non_exhaustive()
    }
}

impl<W: Write> Animation<W> {
    /// Begins an animation of so many pictures, at a rate, that is played again and again.
    ///
    /// # Errors
    ///
    /// Those of the writer, and no picture at all.
    pub fn new(
        out: W,
        [width_px, height_px]: [u32; 2],
        n_pictures: u32,
        rate_hz: u16,
    ) -> std::io::Result<Self> {
        let mut encoder = Encoder::new(out, width_px, height_px);
        encoder.set_color(ColorType::Rgba);
        encoder.set_compression(Compression::Fast);
        encoder.set_animated(n_pictures, 0)?;
        encoder.set_frame_delay(1, rate_hz)?;
        Ok(Self { writer: encoder.write_header()?, shown: Vec::new() })
    }

    /// Adds a picture.
    ///
    /// # Errors
    ///
    /// Those of the writer; a picture of another size.
    pub fn add(&mut self, photo: &Photo) -> std::io::Result<()> {
        let (pixels, _) = photo.rgb8.as_chunks::<3>();
        if self.shown.is_empty() {
            self.shown.clone_from(&photo.rgb8);
            let opaque = pixels.iter().flat_map(|&[r, g, b]| [r, g, b, 255]);
            return Ok(self.writer.write_image_data(&opaque.collect::<Vec<_>>())?);
        }
        let width = photo.width_px as usize;
        let differs = |shown: &[u8; 3], pixel: &[u8; 3]| {
            shown.iter().zip(pixel).any(|(a, b)| a.abs_diff(*b) > UNSEEN_LEVELS)
        };
        let (shown, _) = self.shown.as_chunks_mut::<3>();
        let changed: Vec<bool> = shown.iter().zip(pixels).map(|(a, b)| differs(a, b)).collect();
        let [left, top, right, bottom] = bounds(&changed, width);
        let mut part = Vec::with_capacity(4 * (right - left) * (bottom - top));
        for at in (top..bottom).flat_map(|y| (left..right).map(move |x| y * width + x)) {
            if changed[at] {
                shown[at] = pixels[at];
                let [r, g, b] = pixels[at];
                part.extend([r, g, b, 255]);
            } else {
                part.extend([0; 4]);
            }
        }
        let px = |side: usize| u32::try_from(side).expect("a side of a picture");
        self.writer.set_blend_op(BlendOp::Over)?;
        self.writer.reset_frame_position()?;
        self.writer.set_frame_dimension(px(right - left), px(bottom - top))?;
        self.writer.set_frame_position(px(left), px(top))?;
        Ok(self.writer.write_image_data(&part)?)
    }

    /// Ends the file.
    ///
    /// # Errors
    ///
    /// Those of the writer; fewer pictures than announced.
    pub fn finish(self) -> std::io::Result<()> {
        Ok(self.writer.finish()?)
    }
}

/// Left, top, right and bottom of the changed pixels; a pixel where there are none.
fn bounds(changed: &[bool], width: usize) -> [usize; 4] {
    let mut bounds = [usize::MAX, usize::MAX, 0, 0];
    for (y, row) in changed.chunks_exact(width).enumerate() {
        let Some(first) = row.iter().position(|changed| *changed) else { continue };
        let last = row.iter().rposition(|changed| *changed).expect("there is a first");
        let [left, top, right, _] = bounds;
        bounds = [left.min(first), top.min(y), right.max(last + 1), y + 1];
    }
    if bounds[3] == 0 { [0, 0, 1, 1] } else { bounds }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_animation_plays_back_what_was_added() {
        let picture = |lit: &[usize]| {
            let mut rgb8 = vec![10; 3 * 8 * 6];
            lit.iter().for_each(|at| rgb8[3 * at..][..3].copy_from_slice(&[200, 100, 50]));
            Photo { width_px: 8, height_px: 6, rgb8, scene_toml: None }
        };
        let pictures = [picture(&[]), picture(&[9]), picture(&[9]), picture(&[9, 30, 31])];
        let mut file = Vec::new();
        let mut animation = Animation::new(&mut file, [8, 6], 4, 24).unwrap();
        pictures.iter().for_each(|picture| animation.add(picture).unwrap());
        animation.finish().unwrap();

        let mut reader = png::Decoder::new(std::io::Cursor::new(&file)).read_info().unwrap();
        assert_eq!(reader.info().animation_control.unwrap().num_frames, 4);
        let mut canvas = vec![0; 3 * 8 * 6];
        for want in &pictures {
            let mut part = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut part).unwrap();
            let frame = *reader.info().frame_control().unwrap();
            let (pixels, _) = part.as_chunks::<4>();
            let places = (0..frame.height).flat_map(|y| (0..frame.width).map(move |x| (x, y)));
            for (pixel, (x, y)) in pixels.iter().zip(places) {
                let at = 3 * (8 * (frame.y_offset + y) + frame.x_offset + x) as usize;
                if pixel[3] == 255 {
                    canvas[at..at + 3].copy_from_slice(&pixel[..3]);
                }
            }
            assert_eq!(canvas, want.rgb8);
        }
    }

    #[test]
    fn what_nobody_sees_is_not_written_again() {
        let picture = |level: u8| Photo {
            width_px: 64,
            height_px: 64,
            rgb8: (0..64 * 64 * 3_u32).map(|i| level + (i * i % 7) as u8).collect(),
            scene_toml: None,
        };
        let size = |levels: [u8; 2]| {
            let mut file = Vec::new();
            let mut animation = Animation::new(&mut file, [64, 64], 2, 24).unwrap();
            levels.iter().for_each(|level| animation.add(&picture(*level)).unwrap());
            animation.finish().unwrap();
            file.len()
        };
        assert!(size([10, 11]) + 1000 < size([10, 12]), "{} {}", size([10, 11]), size([10, 12]));
    }
}
