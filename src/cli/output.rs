//! Files that a verb writes.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::{Error, Result};
pub(super) use noctograph_core::files::{Output, OutputFolder};

/// Whether a path names an SVG drawing.
pub(super) fn is_svg(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("svg"))
}

/// Files of one kind, one for each drone: a file, or numbered files in a folder.
#[derive(Debug)]
pub(super) enum Outputs {
    One(Output),
    Several(OutputFolder, &'static str),
}

impl Outputs {
    /// Opens `path`, or by default `kind.csv` or the folder `kinds`.
    pub(super) fn create(path: Option<&Path>, kind: &'static str, n: usize) -> Result<Self> {
        let named = path.filter(|path| n > 1 && path.extension().is_some_and(|e| e == "csv"));
        if let Some(path) = named.filter(|path| !path.is_dir()) {
            let (found, hint) = (format!("a file for {n} drones"), "leave out .csv");
            let place = path.display().to_string();
            return Err(Error::input(place, found, "a folder for a file of each", hint));
        }
        let path = |default: String| path.map_or_else(|| default.into(), Path::to_owned);
        Ok(match n {
            1 => Self::One(Output::create(&path(format!("{kind}.csv")))?),
            _ => Self::Several(OutputFolder::create(&path(format!("{kind}s")))?, kind),
        })
    }

    pub(super) fn keep<T>(
        self,
        items: &[T],
        write: impl Fn(&T, &mut dyn Write) -> std::io::Result<()>,
    ) -> Result<Vec<PathBuf>> {
        match self {
            Self::One(file) => Ok(vec![file.keep(|out| write(&items[0], out))?]),
            Self::Several(folder, kind) => {
                let names = (1..=items.len()).map(|n| format!("{kind}-{n}.csv"));
                let names: Vec<String> = names.collect();
                for (item, name) in items.iter().zip(&names) {
                    folder.write(name, |out| write(item, out))?;
                }
                folder.keep(&names)
            }
        }
    }
}
