//! The page's WebAssembly module, by which visitors' browsers make photos themselves.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use hyper::body::Bytes;
use noctograph_core::digest::sha256;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Limit;

const LIMIT: Limit =
    Limit { bytes: 64 << 20, what: "the page's module", hint: "write it with src/web/build" };

/// The module as it is sent.
#[derive(Debug)]
pub(crate) struct Module {
    /// Compressed by gzip, which every browser reads.
    pub(crate) gzip: Bytes,
    /// Its `ETag`.
    pub(crate) mark: String,
}

impl Module {
    /// Reads a module.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a file that is none; [`Error::Io`] for one that cannot be read.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = LIMIT.read(path)?;
        if !bytes.starts_with(b"\0asm") {
            let actual = "no WebAssembly module";
            let wanted = "noctograph.wasm, as src/web/build writes it";
            return Err(Error::input(path.display(), actual, wanted, LIMIT.hint));
        }
        let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
        gzip.write_all(&bytes).expect("memory takes it");
        let gzip = gzip.finish().expect("memory takes it").into();
        Ok(Self { gzip, mark: format!("\"{}\"", &sha256(&bytes)[..16]) })
    }
}
