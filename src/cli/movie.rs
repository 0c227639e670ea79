//! A movie of the exposure: the photograph as it comes about.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::{Error, Output, Progress, Result};
use crate::photo::Animation;
use crate::shoot::Shot;

/// Widest picture of a movie, pictures a second, and how many: six seconds.
const MAX_WIDTH_PX: u32 = 960;
const RATE_HZ: u16 = 12;
const N_PICTURES: u32 = 72;

/// Refuses a name that is not of a PNG.
pub(super) fn check(path: &Path) -> Result<()> {
    let end = path.extension().unwrap_or_default().to_string_lossy();
    if end.is_empty() || end.eq_ignore_ascii_case("png") || end.eq_ignore_ascii_case("apng") {
        return Ok(());
    }
    let hint = "name the movie movie.png: it is an animated PNG, which ffmpeg converts";
    Err(Error::input(path.display(), format!("a name *.{end}"), "*.png or *.apng", hint))
}

/// Writes the exposure of a shot as an animated PNG.
pub(super) fn write(shot: &Shot, path: &Path) -> Result<PathBuf> {
    let (mut bytes, mut progress) = (Vec::new(), Progress::new("movie"));
    let width_px = shot.camera.width_px.min(MAX_WIDTH_PX);
    let broken = |source| Error::write(path, source);
    let camera = shot.camera.at_width(width_px);
    let size_px = [camera.width_px, camera.height_px];
    let mut animation = Animation::new(&mut bytes, size_px, N_PICTURES, RATE_HZ).map_err(broken)?;
    let mut n = 0;
    shot.movie(width_px, N_PICTURES, &mut |picture| {
        n += 1;
        progress.update(f64::from(n) / f64::from(N_PICTURES));
        animation.add(picture).map_err(broken)
    })?;
    animation.finish().map_err(broken)?;
    Output::create(path)?.keep(|out| out.write_all(&bytes))
}
