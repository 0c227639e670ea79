//! Lines of a CSV stream, none of them endless.

use std::io::{Error, ErrorKind, Read, Result};

/// Longest record of a CSV file, line ends within quotes included: 1024 columns with long names.
const MAX_RECORD_BYTES: usize = 1 << 20;

/// A stream of CSV text that fails within a record longer than 1 MiB, before a parser collects it.
#[derive(Debug)]
pub struct Lines<R> {
    text: R,
    state: InCell,
    record_bytes: usize,
}

/// Place in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
enum InCell {
    Begin,
    Bare,
    Quoted,
    /// After a quotation mark within quotes: the end, or the first of two.
    QuoteEnd,
}

impl<R: Read> Lines<R> {
    /// The records of a text, from its beginning.
    pub fn new(text: R) -> Self {
        Self { text, state: InCell::Begin, record_bytes: 0 }
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let n = self.text.read(buffer)?;
        for byte in &buffer[..n] {
            self.record_bytes += 1;
            self.state = match (self.state, byte) {
                (InCell::Begin | InCell::QuoteEnd, b'"') => InCell::Quoted,
                (InCell::Quoted, b'"') => InCell::QuoteEnd,
                (InCell::Quoted, _) => InCell::Quoted,
                (_, b'\n' | b'\r') => {
                    self.record_bytes = 0;
                    InCell::Begin
                }
                (_, b',' | b';' | b'\t') => InCell::Begin,
                _ => InCell::Bare,
            };
            if self.record_bytes > MAX_RECORD_BYTES {
                let what = format!("a line of more than {} MiB", MAX_RECORD_BYTES >> 20);
                return Err(Error::new(ErrorKind::InvalidData, what));
            }
        }
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn passes(text: &str) -> bool {
        Lines::new(text.as_bytes()).read_to_end(&mut Vec::new()).is_ok()
    }

    #[test]
    fn many_lines_pass_and_one_endless_record_does_not() {
        assert!(passes(&"a,\"b \"\"c\",5\" disc\n".repeat(200_000)));
        assert!(!passes(&"a,".repeat(600_000)));
        assert!(!passes(&format!("\"{}", "a\n".repeat(600_000))), "line ends within quotes");
    }
}
