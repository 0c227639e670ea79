//! Builds a scene from a subject without a command line.

use base64::prelude::{BASE64_STANDARD, Engine};

use noctograph_core::digest::sha256;
use noctograph_core::error::{Error, Result};
use noctograph_pipeline::preflight::{
    Profile, fit_within, frame_within, hang_stations, letters_within, parse_room,
};
use noctograph_pipeline::scene::CarriedScene;

use super::PreparedScene;
use super::answer::Base;
use super::request::{LOG, Subject};

impl Subject {
    /// Writes the log, if there is one, to a file, and returns the scene in the log. Returns `None`
    /// without a log or without a scene in it, and an error if the log is not base64.
    fn store_log(&self) -> Result<Option<CarriedScene>> {
        let Some(log) = &self.log else { return Ok(None) };
        let bytes = BASE64_STANDARD.decode(log).map_err(|broken| {
            Error::input(LOG, broken.to_string(), "a file in base64", "reload the page")
        })?;
        write_file(LOG, bytes)?;
        Ok(CarriedScene::in_log(LOG.as_ref()))
    }

    /// Returns the room's width, depth and height in m, or `None` if there is no room. Returns an
    /// error for a string that is not a room.
    fn room_m(&self) -> Result<Option<[f64; 3]>> {
        let Some(text) = &self.room else { return Ok(None) };
        let room_m = parse_room(text).map_err(|wanted| {
            // The parser's message begins with "wanted ", a word that the error adds itself.
            let wanted = wanted.strip_prefix("wanted ").unwrap_or(&wanted);
            Error::input("room", text, wanted, "reload the page")
        })?;
        Ok(Some(room_m))
    }

    /// Returns the scene of the page or of the log, with the visitor's settings, for a photo of
    /// about `pixels` pixels. `face` is a typeface file that replaces the scene's font. Writes the
    /// files of the drawing and of the log, which the scene refers to.
    pub(crate) fn prepared(
        &self,
        base: &Base<'_>,
        face: Option<&str>,
        pixels: f64,
    ) -> Result<PreparedScene> {
        let (drawing, room_m) = (self.drawing()?, self.room_m()?);
        let settings = self.scene_settings(drawing.as_ref(), room_m, face);
        let settings: Vec<(&str, &str)> = settings.iter().map(|(k, v)| (&**k, &**v)).collect();
        let mut scene = match self.store_log()? {
            Some(carried) => carried.distrusted_scene(&settings)?,
            None => base(&settings)?,
        };
        [scene.camera.width_px, scene.camera.height_px] = self.size_px(pixels);
        match drawing {
            Some((name, bytes)) => write_file(name, bytes)?,
            // If the word is empty, the log's scene keeps the word that was flown.
            None if self.word.is_empty() => {}
            None => scene.set_word(&self.word.replace("\\n", "\n")),
        }
        scene.check()?;
        // The room determines the places of stations, the size of the word, and the place of the
        // camera, in this order.
        if let Some(room_m) = room_m {
            hang_stations(&mut scene, room_m);
            let sizes = ["letters.cap_height_m", "letters.canvas_m"];
            if !sizes.iter().any(|key| self.settings.contains_key(*key)) {
                fit_within(&mut scene, room_m)?;
            }
        }
        let mut profile = Profile::indoor();
        if let Some(room_m) = scene.expose.room_m {
            profile = profile.in_room(room_m);
            frame_within(&mut scene, room_m)?;
        }
        Ok(PreparedScene { scene, profile })
    }

    /// Returns the settings of the room, the drawing, the visitor and the typeface as keys and
    /// values. Later settings override earlier ones.
    fn scene_settings(
        &self,
        drawing: Option<&(&str, Vec<u8>)>,
        room_m: Option<[f64; 3]>,
        face: Option<&str>,
    ) -> Vec<(String, String)> {
        let mut settings: Vec<(String, String)> = Vec::new();
        if let Some(room_m) = room_m {
            let is_height_typed = self.settings.contains_key("letters.cap_height_m");
            settings.push(("expose.room_m".into(), format!("{room_m:?}")));
            settings.extend(letters_within(room_m, drawing.is_some(), is_height_typed));
        }
        if let Some((name, bytes)) = drawing {
            settings.push(("letters.drawing".into(), (*name).into()));
            settings.push(("letters.drawing_sha256".into(), sha256(bytes)));
        }
        settings.extend(self.settings.clone());
        settings.extend(face.map(|face| ("letters.font".into(), face.into())));
        settings
    }
}

/// Writes a file into the current folder, or into the memory of a browser.
pub(crate) fn write_file(name: &str, bytes: Vec<u8>) -> Result<()> {
    #[cfg(target_family = "wasm")]
    noctograph_core::files::bring(name, bytes);
    #[cfg(not(target_family = "wasm"))]
    noctograph_core::files::Output::create(name.as_ref())?.keep(bytes)?;
    Ok(())
}
