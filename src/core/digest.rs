//! Digests of products, as hexadecimal SHA-256 (FIPS 180-4) that is the same on every machine.

use std::io::Write;

use sha2::Digest as _;

/// SHA-256 computation to which a product is added piece by piece.
#[derive(Clone, Debug, Default)]
pub struct Digest(sha2::Sha256);

impl Digest {
    /// Adds bytes.
    pub fn add(&mut self, bytes: impl AsRef<[u8]>) {
        self.0.update(bytes);
    }

    /// Adds the bit patterns of numbers in little-endian order.
    pub fn add_numbers(&mut self, numbers: &[f64]) {
        // Numbers are added in chunks, because one call per number takes as long as the digest
        // itself.
        const CHUNK: usize = 64;
        const BYTES: usize = size_of::<f64>();
        let mut buffer = [0; BYTES * CHUNK];
        for chunk in numbers.chunks(CHUNK) {
            for (bytes, number) in buffer.chunks_exact_mut(BYTES).zip(chunk) {
                bytes.copy_from_slice(&number.to_le_bytes());
            }
            self.0.update(&buffer[..BYTES * chunk.len()]);
        }
    }

    /// Returns the digest as 64 hexadecimal digits.
    pub fn hex(self) -> String {
        self.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// Adds every written byte to the digest.
impl Write for Digest {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.add(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Writer that optionally computes the digest of its output.
#[derive(Debug)]
pub struct Digested<W> {
    /// Writer to which the output is passed on.
    pub to: W,
    /// Digest of the output so far, or `None` if no digest is wanted.
    pub digest: Option<Digest>,
}

impl<W: Write> Digested<W> {
    /// Wraps a writer, and computes the digest of everything written through it.
    pub fn new(to: W) -> Self {
        Self { to, digest: Some(Digest::default()) }
    }
}

impl<W: Write> Write for Digested<W> {
    /// Writes bytes, and adds those that were written to the digest, if one is wanted.
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let n = self.to.write(bytes)?;
        if let Some(digest) = &mut self.digest {
            digest.add(&bytes[..n]);
        }
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.to.flush()
    }
}

/// Returns the SHA-256 of bytes in hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    let mut digest = Digest::default();
    digest.add(bytes);
    digest.hex()
}

/// Returns the HMAC-SHA-256 (RFC 2104) of a message, with a key of at most 64 bytes (RFC 2104
/// hashes a longer key first).
pub fn hmac_sha256(key: &[u8], message: impl IntoIterator<Item = u8>) -> [u8; 32] {
    // As in RFC 2104, the key is XORed with a block of outer padding and a block of inner padding.
    const OPAD: u8 = 0x5c;
    const IPAD: u8 = 0x36;
    /// Returns the SHA-256 of a message after a block of 64 bytes, which is the exclusive or of the
    /// key and a padding.
    fn keyed_sha256(padding: u8, key: &[u8], message: &[u8]) -> [u8; 32] {
        let mut block = [padding; 64];
        block.iter_mut().zip(key).for_each(|(byte, key)| *byte ^= key);
        sha2::Sha256::new().chain_update(block).chain_update(message).finalize().into()
    }
    let message: Vec<u8> = message.into_iter().collect();
    keyed_sha256(OPAD, key, &keyed_sha256(IPAD, key, &message))
}

/// Returns the 64-bit FNV-1a hash (Fowler, Noll, Vo), which identifies random number streams.
pub fn fnv_1a(bytes: impl IntoIterator<Item = u8>) -> u64 {
    const OFFSET_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0100_0000_01b3;
    bytes.into_iter().fold(OFFSET_BASIS, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digest_is_the_standards() {
        // The expected digest is from the one-block example in FIPS 180-4.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256(b"abc"), abc);
        let mut pieces = Digest::default();
        pieces.add("a");
        pieces.add(b"bc");
        assert_eq!(pieces.hex(), abc);
        let mut numbers = Digest::default();
        numbers.add_numbers(&[1.5]);
        assert_eq!(numbers.hex(), sha256(&[0, 0, 0, 0, 0, 0, 0xf8, 0x3f]));
    }

    #[test]
    fn the_keyed_hash_is_the_standards() {
        // The expected hash is from test case 2 in RFC 4231.
        let hash = hmac_sha256(b"Jefe", b"what do ya want for nothing?".iter().copied());
        assert_eq!(hash[..8], [0x5b, 0xdc, 0xc1, 0x46, 0xbf, 0x60, 0x75, 0x4e]);
        assert_eq!(hash[24..], [0x9d, 0xec, 0x58, 0xb9, 0x64, 0xec, 0x38, 0x43]);
    }

    #[test]
    fn hash_is_the_published_fnv_1a() {
        // The expected hashes are test vectors from the authors' reference code.
        assert_eq!(fnv_1a("".bytes()), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv_1a("foobar".bytes()), 0x8594_4171_f739_67e8);
    }
}
