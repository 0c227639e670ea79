//! A subject as a scene, where no command line reads it.

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
    /// Brings the log, if there is one; returns the scene that came with it.
    fn carried(&self) -> Result<Option<CarriedScene>> {
        let Some(log) = &self.log else { return Ok(None) };
        let bytes = BASE64_STANDARD.decode(log).map_err(|broken| {
            Error::input(LOG, broken.to_string(), "a file in base64", "reload the page")
        })?;
        bring(LOG, bytes)?;
        Ok(CarriedScene::in_log(LOG.as_ref()))
    }

    /// The page's scene, or its log's, with the settings of a visitor, for a photo of about as many
    /// pixels; `face` is the file of another typeface.
    ///
    /// # Errors
    ///
    /// Those of the scene and its check; [`Error::Input`] for a room that is none.
    pub(crate) fn prepared(
        &self,
        base: &Base<'_>,
        face: Option<&str>,
        pixels: f64,
    ) -> Result<PreparedScene> {
        let drawing = self.drawing()?;
        let room = self.room.as_deref().map(|text| (text, parse_room(text)));
        let room_m = room.map(|(text, room)| {
            room.map_err(|wanted| {
                let wanted = wanted.strip_prefix("wanted ").unwrap_or(&wanted);
                Error::input("room", text, wanted, "reload the page")
            })
        });
        let room_m = room_m.transpose()?;
        let is_typed = |key: &str| self.settings.contains_key(key);
        let mut settings: Vec<(String, String)> = Vec::new();
        if let Some(room_m) = room_m {
            let is_height_typed = is_typed("letters.cap_height_m");
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
        match drawing {
            Some((name, bytes)) => bring(name, bytes)?,
            // A log may name its own word.
            None if self.word.is_empty() => {}
            None => scene.set_word(&self.word.replace("\\n", "\n")),
        }
        scene.check()?;
        let mut profile = Profile::indoor();
        if let Some(room_m) = room_m {
            hang_stations(&mut scene, room_m);
            if !["letters.cap_height_m", "letters.canvas_m"].into_iter().any(is_typed) {
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

/// Puts a file where the scene finds it: into the present folder, or into memory.
pub(crate) fn bring(name: &str, bytes: Vec<u8>) -> Result<()> {
    #[cfg(target_family = "wasm")]
    noctograph_core::files::bring(name, bytes);
    #[cfg(not(target_family = "wasm"))]
    noctograph_core::files::Output::create(name.as_ref())?.keep(bytes)?;
    Ok(())
}
