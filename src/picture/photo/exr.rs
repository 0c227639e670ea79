//! Readouts as `OpenEXR` files, with scene-linear light and the standard attributes.
//!
//! Source: "OpenEXR File Layout", version 2 of the format, for one part of uncompressed scan lines.

use super::{Readout, metadata};
use crate::narrow;
use noctograph_core::camera::Camera;

/// Magic number, and version 2 without flags.
const HEAD: [u8; 8] = [0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
/// Primaries (red, green, blue) and white point of linear sRGB (ITU-R BT.709, D65).
const CHROMATICITIES: [f32; 8] = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];
/// Channels in the order of their names, which is that of the file, and their indices in a pixel.
const CHANNELS: [(u8, usize); 3] = [(b'B', 2), (b'G', 1), (b'R', 0)];
/// Pixel type of 32-bit floating-point numbers, without the flag for perceptual channels, and the
/// sampling of every column and row.
const CHANNEL: [u32; 4] = [2, 0, 1, 1];

/// Name, type and value of an attribute.
type Attribute = (&'static str, &'static str, Vec<u8>);

impl Readout {
    /// Returns the readout as an uncompressed EXR file with 32 bits per channel and without a time.
    ///
    /// The attributes are chromaticities, whiteLuminance, expTime, aperture, isoSpeed, focus (if
    /// the camera has one), software and comments. The comments have one line `keyword: text` per
    /// note, in UTF-8, which the official library and its Python module can read.
    pub fn encode_exr(&self, camera: &Camera, notes: &[(&str, String)]) -> Vec<u8> {
        let mut file = HEAD.to_vec();
        let about = self.about_light(camera, notes);
        for (name, kind, value) in self.about_layout().into_iter().chain(about) {
            let n_bytes = u32::try_from(value.len()).expect("notes are shorter than 4 GB");
            file.extend([name.as_bytes(), &[0], kind.as_bytes(), &[0]].concat());
            file.extend(n_bytes.to_le_bytes().into_iter().chain(value));
        }
        file.push(0);
        // The table has the position of each line in the file. A line has its row, its size in
        // bytes, and the values of one channel after another.
        let (width, row_bytes) = (self.width_px as usize, 12 * self.width_px);
        let first = (file.len() + 8 * self.height_px as usize) as u64;
        let positions = (0..self.height_px.into()).map(|y| first + y * u64::from(8 + row_bytes));
        file.extend(positions.flat_map(u64::to_le_bytes));
        for (y, rgb) in (0..self.height_px).zip(self.rgb.chunks_exact(3 * width)) {
            file.extend(bytes(&[y, row_bytes].map(u32::to_le_bytes)));
            for (_, channel) in CHANNELS {
                file.extend(rgb[channel..].iter().step_by(3).flat_map(|value| value.to_le_bytes()));
            }
        }
        file
    }

    /// Returns the attributes that every file must have.
    fn about_layout(&self) -> [Attribute; 10] {
        let window = bytes(&[0, 0, self.width_px - 1, self.height_px - 1].map(u32::to_le_bytes));
        let one = 1_f32.to_le_bytes().to_vec();
        let channel = |(name, _)| [&[name, 0][..], &bytes(&CHANNEL.map(u32::to_le_bytes))].concat();
        [
            ("chunkCount", "int", self.height_px.to_le_bytes().to_vec()),
            ("channels", "chlist", [&CHANNELS.map(channel).concat()[..], &[0]].concat()),
            ("compression", "compression", vec![0]),
            ("lineOrder", "lineOrder", vec![0]),
            ("displayWindow", "box2i", window.clone()),
            ("pixelAspectRatio", "float", one.clone()),
            ("screenWindowCenter", "v2f", vec![0; 8]),
            ("screenWindowWidth", "float", one),
            ("dataWindow", "box2i", window),
            ("type", "string", b"scanlineimage".to_vec()),
        ]
    }

    /// Returns the attributes of light, camera and program.
    fn about_light(&self, camera: &Camera, notes: &[(&str, String)]) -> Vec<Attribute> {
        let exposure_s = camera.shutter_close_s - camera.shutter_open_s;
        let luminance_cd_m2 = self.white_lx_s / camera.lx_s_of_luminance();
        let comments = notes.iter().map(|(keyword, text)| format!("{keyword}: {text}\n"));
        let comments = comments.collect::<String>().into_bytes();
        let float = |name, value: f64| (name, "float", narrow(value).to_le_bytes().to_vec());
        let chromaticities = bytes(&CHROMATICITIES.map(f32::to_le_bytes));
        let mut attributes =
            vec![float("whiteLuminance", luminance_cd_m2), ("comments", "string", comments)];
        attributes.extend(camera.focus_m.map(|focus_m| float("focus", focus_m)));
        attributes.extend([
            float("expTime", exposure_s),
            float("aperture", camera.f_number),
            float("isoSpeed", camera.iso),
            ("chromaticities", "chromaticities", chromaticities),
            ("software", "string", metadata::SOFTWARE.as_bytes().to_vec()),
        ]);
        attributes
    }
}

/// Returns the bytes of several numbers.
fn bytes(numbers: &[[u8; 4]]) -> Vec<u8> {
    numbers.as_flattened().to_vec()
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use exr::math::Vec2;
    use exr::meta::attribute::Chromaticities;
    use exr::prelude::{Encoding, Image, Layer, SpecificChannels, WritableImage};

    use super::*;
    use noctograph_core::camera::CameraOptions;

    /// The package exr writes the same bytes from what it read of the file.
    #[test]
    fn a_readout_reads_back_from_exr_with_its_attributes() {
        let rgb: Vec<f32> = (0..5 * 3 * 3).map(|i| (i as f32 - 3.0) / 41.0).collect();
        let readout = Readout { width_px: 5, height_px: 3, rgb: rgb.clone(), white_lx_s: 0.78 };
        let options = CameraOptions { focus_m: Some(2.5), ..CameraOptions::default() };
        let camera = options.camera([0.0, 0.5, 1.0, 1.0], 46.0).unwrap();
        let notes = [("noctograph.scene", "word = \"Zoë 漢 ψ\"\n".to_owned())];
        let file = readout.encode_exr(&camera, &notes);
        assert!(file == readout.encode_exr(&camera, &notes), "the same bytes twice");

        use exr::prelude::{ReadChannels, ReadLayers};
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                |_, _| vec![0.0_f32; 45],
                |values, p, (r, g, b): (f32, f32, f32)| {
                    values[3 * (p.y() * 5 + p.x())..][..3].copy_from_slice(&[r, g, b]);
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(&file))
            .unwrap();
        let read = &image.layer_data.channel_data.pixels;
        assert_eq!(read, &rgb, "the readout, exactly");
        let attributes = &image.layer_data.attributes;
        assert_eq!(attributes.exposure, Some(46.0));
        assert_eq!(attributes.aperture, Some(8.0));
        assert_eq!(attributes.iso_speed, Some(100.0));
        assert_eq!(attributes.focus, Some(2.5));
        // H = 0.78 lx s at f/8, 46 s and τ = 0.9 gives 4 · 64 · 0.78 / (0.9 π 46) cd/m².
        assert!((attributes.white_luminance.unwrap() - 1.5353).abs() < 1e-3);
        assert_eq!(attributes.capture_date, None, "no time stamp");
        let comments = std::str::from_utf8(attributes.comments.as_ref().unwrap().as_slice());
        assert_eq!(comments, Ok("noctograph.scene: word = \"Zoë 漢 ψ\"\n\n"));
        let [r, g, b, w] = [0, 2, 4, 6].map(|k| Vec2(CHROMATICITIES[k], CHROMATICITIES[k + 1]));
        let wanted = Chromaticities { red: r, green: g, blue: b, white: w };
        assert_eq!(image.attributes.chromaticities, Some(wanted));

        let pixel = |p: Vec2<usize>| {
            let rgb = &rgb[3 * (p.y() * 5 + p.x())..][..3];
            (rgb[0], rgb[1], rgb[2])
        };
        let channels = SpecificChannels::rgb(pixel);
        let layer = Layer::new((5, 3), attributes.clone(), Encoding::UNCOMPRESSED, channels);
        let mut again = Image::from_layer(layer);
        again.attributes = image.attributes;
        let mut written = Cursor::new(Vec::new());
        again.write().non_parallel().to_buffered(&mut written).unwrap();
        assert!(written.into_inner() == file, "the bytes that the package exr writes");
    }
}
