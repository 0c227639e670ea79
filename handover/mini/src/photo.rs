#[path = "/work/wt/reader/src/photo/srgb.rs"] pub mod srgb;
use crate::error::{Error, Result};
#[derive(Clone, Debug, PartialEq)]
pub struct Photo { pub width_px: u32, pub height_px: u32, pub rgb8: Vec<u8>, pub scene_toml: Option<String> }
impl Photo { pub fn read(path: &std::path::Path) -> Result<Self> {
  let image = image::ImageReader::open(path).unwrap().with_guessed_format().unwrap().decode().unwrap().to_rgb8();
  let _ = |e: Error| e;
  Ok(Self { width_px: image.width(), height_px: image.height(), rgb8: image.into_raw(), scene_toml: None }) } }
