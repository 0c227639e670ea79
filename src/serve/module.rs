//! WebAssembly module of the page, with which visitors' browsers make photos.

use std::io::Read;
use std::path::Path;

use flate2::read::GzDecoder;
use hyper::body::Bytes;

use super::http::etag_of;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Limit;

const LIMIT: Limit = Limit {
    bytes: 64 << 20,
    what: "the page's module",
    hint: "build the module with src/photo_service/build",
};

/// The module, compressed by gzip as it is sent. The page decompresses it.
#[derive(Debug)]
pub(crate) struct Module {
    pub(crate) gzip: Bytes,
    pub(crate) etag: String,
}

impl Module {
    /// Reads a compressed module, and returns it with its `ETag`. Returns [`Error::Input`] for a
    /// file that does not begin like a WebAssembly module when it is decompressed.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = LIMIT.read(path)?;
        let mut magic = [0; 4];
        if GzDecoder::new(&*bytes).read_exact(&mut magic).is_err() || magic != *b"\0asm" {
            let actual = "no compressed WebAssembly module";
            let wanted = "the file noctograph.wasm.gz that src/photo_service/build writes";
            return Err(Error::input(path.display(), actual, wanted, LIMIT.hint));
        }
        let etag = etag_of(&bytes);
        Ok(Self { gzip: bytes.into(), etag })
    }
}
