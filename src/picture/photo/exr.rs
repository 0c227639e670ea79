//! Readouts as `OpenEXR` files, with scene-linear light and the standard attributes.

use std::io::Cursor;

use exr::math::Vec2;
use exr::meta::attribute::{Chromaticities, Text};
use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};

use super::{Readout, metadata};
use crate::narrow;
use noctograph_core::camera::Camera;

/// Primaries and white point of linear sRGB (ITU-R BT.709, D65).
const CHROMATICITIES: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.3, 0.6),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.329),
};

impl Readout {
    /// Returns the readout as an uncompressed EXR file with 32 bits per channel and without a time.
    ///
    /// The attributes are chromaticities, whiteLuminance, expTime, aperture, isoSpeed, focus (if
    /// the camera has one), software and comments. The comments have one line `keyword: text` per
    /// note, in UTF-8, which the official library and its Python module can read.
    pub fn encode_exr(&self, camera: &Camera, notes: &[(&str, String)]) -> Vec<u8> {
        let width = self.width_px as usize;
        let size = (width, self.height_px as usize);
        let attributes = self.attributes(camera, notes);
        let channels = SpecificChannels::rgb(|p: Vec2<usize>| {
            let rgb = &self.rgb[3 * (p.y() * width + p.x())..][..3];
            (rgb[0], rgb[1], rgb[2])
        });
        let layer = Layer::new(size, attributes, Encoding::UNCOMPRESSED, channels);
        let mut image = Image::from_layer(layer);
        image.attributes.chromaticities = Some(CHROMATICITIES);
        let mut file = Cursor::new(Vec::new());
        let written = image.write().non_parallel().to_buffered(&mut file);
        written.expect("a checked picture fits into memory");
        file.into_inner()
    }

    /// Returns the attributes of the file's layer.
    fn attributes(&self, camera: &Camera, notes: &[(&str, String)]) -> LayerAttributes {
        let exposure_s = camera.shutter_close_s - camera.shutter_open_s;
        let notes = notes.iter().map(|(keyword, text)| format!("{keyword}: {text}\n"));
        let notes: String = notes.collect();
        LayerAttributes {
            exposure: Some(narrow(exposure_s)),
            aperture: Some(narrow(camera.f_number)),
            iso_speed: Some(narrow(camera.iso)),
            focus: camera.focus_m.map(narrow),
            white_luminance: Some(narrow(self.white_lx_s / camera.lx_s_of_luminance())),
            software_name: Text::new_or_none(metadata::SOFTWARE),
            // `Text::new_or_none` is not used, because it writes Latin-1.
            comments: Some(Text::from_slice_unchecked(notes.as_bytes())),
            ..LayerAttributes::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::camera::CameraOptions;

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
            .from_buffered(Cursor::new(file))
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
        assert_eq!(image.attributes.chromaticities, Some(CHROMATICITIES));
    }
}
