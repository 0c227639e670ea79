//! Typefaces of this machine: one that has a letter which a font lacks.

use std::path::PathBuf;

use fontdb::{Database, Source, Style};

use crate::letters::has_outline;

/// Most faces that are looked at.
const MAX_FACES: usize = 2000;

/// File of an upright typeface with a character, from the system's folders; light ones first, whose center
/// lines are nearest to their strokes.
pub(super) fn with(character: char) -> Option<PathBuf> {
    let mut faces = Database::new();
    faces.load_system_fonts();
    let files = faces.faces().filter(|face| face.index == 0).take(MAX_FACES);
    let mut found: Vec<_> = files
        .filter_map(|face| {
            let (Source::File(path) | Source::SharedFile(path, _)) = &face.source else {
                return None;
            };
            let has = faces.with_face_data(face.id, |data, _| has_outline(data, character))?;
            let rank = (face.style != Style::Normal, face.weight.0.abs_diff(300));
            has.then(|| (rank, path.clone()))
        })
        .collect();
    found.sort();
    Some(found.into_iter().next()?.1)
}
