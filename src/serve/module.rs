//! The page's WebAssembly module, with which visitors' browsers make photos.

use std::io::Read;
use std::path::Path;

use flate2::read::GzDecoder;
use hyper::body::Bytes;
use noctograph_core::digest::sha256;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Limit;

const LIMIT: Limit = Limit {
    bytes: 64 << 20,
    what: "the page's module",
    hint: "write it with src/photo_service/build",
};

/// The module as it is sent: compressed by gzip, which the page unpacks.
#[derive(Debug)]
pub(crate) struct Module {
    pub(crate) gzip: Bytes,
    /// Its `ETag`.
    pub(crate) mark: String,
}

impl Module {
    /// Reads a module and checks its first bytes.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = LIMIT.read(path)?;
        let mut head = [0; 4];
        if GzDecoder::new(&*bytes).read_exact(&mut head).is_err() || head != *b"\0asm" {
            let actual = "no compressed WebAssembly module";
            let wanted = "noctograph.wasm.gz, as src/photo_service/build writes it";
            return Err(Error::input(path.display(), actual, wanted, LIMIT.hint));
        }
        let mark = format!("\"{}\"", &sha256(&bytes)[..16]);
        Ok(Self { gzip: bytes.into(), mark })
    }
}
