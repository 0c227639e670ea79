//! Writes a scene file that can be moved together with the files that it names.
//!
//! In memory, a scene contains local paths. In a file, it contains names relative to the file's
//! folder, so that the folder can be moved and published.

use std::io::Write;
use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::Scene;
use noctograph_core::error::{Result, is_device};
use noctograph_core::files::{Limit, Output, WholeFile, file_name, path_from, relative_name};

/// Size limit for each of these files: a typeface, a drawing or a background.
const LIMIT: Limit =
    Limit { bytes: 256 << 20, what: "a file of a scene", hint: "name a smaller file" };

/// Prefixes in the names of other output files next to a scene.
const RESERVED: [&str; 7] = ["photo.", "verdict.", "spread", "plan", "flight", "report.", "scene."];

/// Text of a scene, and the files next to it.
#[derive(Clone, Debug)]
pub struct SceneFiles {
    /// Text of the scene as TOML.
    pub toml: String,
    /// Names and contents of files that are copied next to the scene.
    pub copies: Vec<(String, Vec<u8>)>,
}

impl SceneFiles {
    /// Writes the copies next to the file `path`, under temporary names, which the caller makes
    /// final.
    pub fn write_copies(&self, path: &Path) -> Result<Vec<WholeFile>> {
        let copies = self.copies.iter().map(|(name, bytes)| {
            Output::create(&path.with_file_name(name))?.write_with(|out| out.write_all(bytes))
        });
        copies.collect()
    }
}

impl Scene {
    /// Returns the scene with file names instead of paths, for sharing. Different files are given
    /// different names, which also differ from those of other outputs.
    #[must_use]
    pub fn portable(&self) -> Self {
        let mut scene = self.clone();
        let mut used: Vec<(String, String)> = Vec::new();
        for path in scene.files_mut().filter(|name| is_file(name)) {
            let plain = file_name(&*path);
            let numbered = (2..).map(|n| format!("{n}-{plain}"));
            let name = std::iter::once(plain.clone()).chain(numbered).find(|name| {
                // Windows and macOS do not distinguish upper and lower case in file names.
                let name = name.to_lowercase();
                // A file that is used twice, as font and as fallback, has only one name.
                !is_device(&name)
                    && !RESERVED.iter().any(|reserved| name.starts_with(reserved))
                    && used.iter().all(|(other, used_name)| other == path || *used_name != name)
            });
            let name = name.expect("a number is free");
            used.push((path.clone(), name.to_lowercase()));
            *path = name;
        }
        scene
    }

    /// Returns the scene as the text of a file in a folder. Files below the folder are given
    /// relative names. Other files are copied next to the scene, under names that consist of
    /// `prefix` and their portable name.
    pub fn in_folder(&self, folder: &Path, prefix: &str) -> Result<SceneFiles> {
        let (mut scene, mut portable) = (self.clone(), self.portable());
        let mut copies: Vec<(String, Vec<u8>)> = Vec::new();
        let names = scene.files_mut().zip(portable.files_mut()).filter(|(path, _)| is_file(path));
        for (path, name) in names {
            let relative = Path::new(path).is_file().then(|| relative_name(folder, path.as_ref()));
            *path = match relative {
                // A named pipe has already been read for drawing and cannot be copied.
                None => name.clone(),
                Some(Some(relative)) => relative,
                Some(None) => {
                    let name = format!("{prefix}{name}");
                    if copies.iter().all(|(copied, _)| *copied != name) {
                        copies.push((name.clone(), LIMIT.read(path.as_ref())?));
                    }
                    name
                }
            };
        }
        Ok(SceneFiles { toml: scene.to_toml(), copies })
    }

    /// Returns the scene as the text of a file next to its plan or flight, or of a separate file,
    /// as described at [`Self::in_folder`]. Copies are named after that file.
    pub fn beside(&self, path: &Path) -> Result<SceneFiles> {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let stem = name.strip_suffix(".scene").unwrap_or(&name);
        self.in_folder(&folder_of(path), &format!("{stem}."))
    }
}

/// Returns the folder to which names in a file are relative. It is empty for a named pipe.
pub fn folder_of(path: &Path) -> PathBuf {
    let is_stream = path.exists() && !path.is_file();
    path.parent().filter(|_| !is_stream).map(Path::to_owned).unwrap_or_default()
}

/// Returns true if the name of a font, a drawing or a background is a file name. The names of
/// built-in fonts have no extension.
pub(super) fn is_file(name: &str) -> bool {
    name.contains('.')
}

/// Replaces file names in a scene's table with paths in `folder`. Paths that are absolute stay.
pub(super) fn resolve_files(values: &mut Table, folder: &Path) {
    for (table, keys) in
        [("letters", &["font", "fallback", "drawing"][..]), ("photo", &["background"])]
    {
        let Some(table) = values.get_mut(table).and_then(Value::as_table_mut) else { continue };
        for key in keys {
            let names = match table.get_mut(*key) {
                Some(Value::Array(names)) => names.iter_mut().collect(),
                name => Vec::from_iter(name),
            };
            for value in names {
                // If the path is not Unicode, the name is kept, which works within its folder.
                if let Value::String(name) = value
                    && is_file(name)
                    && let Some(path) = path_from(folder, name).to_str()
                {
                    *name = path.to_owned();
                }
            }
        }
    }
}
