//! A scene that travels: the files that it names stand beside it.
//!
//! In memory a scene has paths of this machine. In a file it has names from that file's folder on,
//! so that a folder can be moved and handed on, and no folder of this machine is told.

use std::io::Write;
use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::Scene;
use noctograph_core::error::Result;
use noctograph_core::files::{Limit, Output, WholeFile, file_name, name_from, path_from};

/// The largest of the files: a typeface, a drawing or a background.
const LIMIT: Limit =
    Limit { bytes: 256 << 20, what: "a file of a scene", hint: "name a smaller file" };

/// Beginnings of names that verbs give to files beside a scene.
const OURS: [&str; 7] = ["photo.", "verdict.", "spread", "plan", "flight", "report.", "scene."];

/// A scene as a text, and the files that stand beside it.
#[derive(Clone, Debug)]
pub struct SceneFiles {
    /// TOML.
    pub toml: String,
    /// Copies, with their names.
    pub copies: Vec<(String, Vec<u8>)>,
}

impl SceneFiles {
    /// Writes the copies beside a file, without their names yet.
    ///
    /// # Errors
    ///
    /// As [`Output::write_with`].
    pub fn write_copies(&self, path: &Path) -> Result<Vec<WholeFile>> {
        let write = |(name, bytes): &(String, Vec<u8>)| {
            Output::create(&path.with_file_name(name))?.write_with(|out| out.write_all(bytes))
        };
        self.copies.iter().map(write).collect()
    }
}

impl Scene {
    /// The scene with names of its files instead of their paths, for sharing. No two files have one
    /// name, and none has that of a verb's.
    #[must_use]
    pub fn portable(&self) -> Self {
        let mut scene = self.clone();
        let mut taken: Vec<(String, String)> = Vec::new();
        for path in scene.files_mut().filter(|name| is_file(name)) {
            let name = file_name(&*path);
            let is_free = |name: &String| {
                let is_ours = OURS.iter().any(|ours| name.to_lowercase().starts_with(ours));
                !is_ours && taken.iter().all(|(other, known)| other == path || known != name)
            };
            let others = (2..).map(|n| format!("{n}-{name}"));
            let name = std::iter::once(name.clone()).chain(others).find(is_free);
            let name = name.expect("a number is free");
            taken.push((path.clone(), name.clone()));
            *path = name;
        }
        scene
    }

    /// The scene as a file in a folder. Files below the folder are named from there on; others are
    /// copied beside the scene, under `prefix` and their portable name.
    ///
    /// # Errors
    ///
    /// As [`Limit::read`].
    pub fn in_folder(&self, folder: &Path, prefix: &str) -> Result<SceneFiles> {
        let (mut scene, mut portable) = (self.clone(), self.portable());
        let mut copies: Vec<(String, Vec<u8>)> = Vec::new();
        let names = scene.files_mut().zip(portable.files_mut()).filter(|(path, _)| is_file(path));
        for (path, name) in names {
            // A pipe can be read once, when it is drawn.
            let below = Path::new(path).is_file().then(|| name_from(folder, path.as_ref()));
            *path = match below {
                None => name.clone(),
                Some(Some(below)) => below,
                Some(None) => {
                    let name = format!("{prefix}{name}");
                    if copies.iter().all(|(known, _)| *known != name) {
                        copies.push((name.clone(), LIMIT.read(path.as_ref())?));
                    }
                    name
                }
            };
        }
        Ok(SceneFiles { toml: scene.to_toml(), copies })
    }

    /// The scene as a file beside its plan or flight, or alone, see [`Self::in_folder`].
    ///
    /// # Errors
    ///
    /// As [`Self::in_folder`].
    pub fn beside(&self, path: &Path) -> Result<SceneFiles> {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let stem = stem.strip_suffix(".scene").unwrap_or(&stem);
        self.in_folder(&folder_of(path), &format!("{stem}."))
    }
}

/// The folder from which the names in a file are looked for: a pipe has none.
pub fn folder_of(path: &Path) -> PathBuf {
    let is_stream = path.exists() && !path.is_file();
    path.parent().filter(|_| !is_stream).map(Path::to_owned).unwrap_or_default()
}

/// Whether a font, a drawing or a background is a file's name: fonts of the program have no ending.
pub(super) fn is_file(name: &str) -> bool {
    name.contains('.')
}

/// Replaces the names of files in a scene's table by paths from a folder on.
pub(super) fn find_files(values: &mut Table, folder: &Path) {
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
                // A path that is no Unicode stays a name, which is right in its folder alone.
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
