//! A subject as a scene, without a command line.

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
    /// Stores the log, if there is one. Returns the scene that came with it.
    fn carried(&self) -> Result<Option<CarriedScene>> {
        let Some(log) = &self.log else { return Ok(None) };
        let bytes = BASE64_STANDARD.decode(log).map_err(|broken| {
            Error::input(LOG, broken.to_string(), "a file in base64", "reload the page")
        })?;
        bring(LOG, bytes)?;
        Ok(CarriedScene::in_log(LOG.as_ref()))
    }

    /// The scene of the page or of the log, with the settings of a visitor, for a photo of about
    /// `pixels`. `face` is the file of another typeface.
    pub(crate) fn prepared(
        &self,
        base: &Base<'_>,
        face: Option<&str>,
        pixels: f64,
    ) -> Result<PreparedScene> {
        let drawing = self.drawing()?;
        let mut room_m = None;
        if let Some(text) = &self.room {
            room_m = Some(parse_room(text).map_err(|wanted| {
                let wanted = wanted.strip_prefix("wanted ").unwrap_or(&wanted);
                Error::input("room", text, wanted, "reload the page")
            })?);
        }
        // 1. Settings, the later ones over the earlier: room, drawing, visitor, typeface.
        let mut settings: Vec<(String, String)> = Vec::new();
        let is_height_typed = self.settings.contains_key("letters.cap_height_m");
        if let Some(room_m) = room_m {
            settings.push(("expose.room_m".into(), format!("{room_m:?}")));
            settings.extend(letters_within(room_m, drawing.is_some(), is_height_typed));
        }
        if let Some((name, bytes)) = &drawing {
            settings.push(("letters.drawing".into(), (*name).into()));
            settings.push(("letters.drawing_sha256".into(), sha256(bytes)));
        }
        settings.extend(self.settings.clone());
        settings.extend(face.map(|face| ("letters.font".into(), face.into())));
        let settings: Vec<(&str, &str)> = settings.iter().map(|(k, v)| (&**k, &**v)).collect();
        let mut scene = match self.carried()? {
            Some(carried) => carried.distrusted_scene(&settings)?,
            None => base(&settings)?,
        };
        [scene.camera.width_px, scene.camera.height_px] = self.size_px(pixels);
        // 2. The word, or the file of the drawing, which the scene names already.
        match drawing {
            Some((name, bytes)) => bring(name, bytes)?,
            // The scene of a log has the word that was flown, which a visitor need not type.
            None if self.word.is_empty() => {}
            None => scene.set_word(&self.word.replace("\\n", "\n")),
        }
        scene.check()?;
        // 3. The room: stations, the size of the word, and the place of the camera.
        let mut profile = Profile::indoor();
        if let Some(room_m) = room_m {
            hang_stations(&mut scene, room_m);
            if !is_height_typed && !self.settings.contains_key("letters.canvas_m") {
                fit_within(&mut scene, room_m)?;
            }
        }
        if let Some(room_m) = scene.expose.room_m {
            profile = profile.in_room(room_m);
            frame_within(&mut scene, room_m)?;
        }
        Ok(PreparedScene { scene, profile })
    }
}

/// Writes a file into the present folder. A page has only memory.
pub(crate) fn bring(name: &str, bytes: Vec<u8>) -> Result<()> {
    #[cfg(target_family = "wasm")]
    noctograph_core::files::bring(name, bytes);
    #[cfg(not(target_family = "wasm"))]
    noctograph_core::files::Output::create(name.as_ref())?.keep(bytes)?;
    Ok(())
}
