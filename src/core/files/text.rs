//! Decoding of bytes to text, in UTF-8 without a byte order mark and with lines that end in LF.
//!
//! UTF-16, with or without a byte order mark, is also accepted, as is Windows-1252 with a note.

use std::borrow::Cow;

/// Text of a file, with notes on its decoding.
#[derive(Clone, Debug)]
pub struct Text<'a> {
    /// Bytes of the text in UTF-8. Bytes in an unknown encoding are unchanged.
    pub bytes: Cow<'a, [u8]>,
    /// Notes on assumptions about the encoding.
    pub notes: Vec<String>,
}

/// Characters of Windows-1252 from 0x80 to 0x9F. Each byte above 0x9F equals its code point.
const WINDOWS_1252: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8d}Ž\u{8f}\u{90}‘’“”•–—˜™š›œ\u{9d}žŸ";

impl<'a> Text<'a> {
    /// Decodes a file in UTF-8, UTF-16 or, with a note, Windows-1252.
    pub fn decode(bytes: &'a [u8]) -> Self {
        let bytes = Self::of_unicode(bytes);
        if !is_windows_1252(&bytes) {
            return Self { bytes, notes: Vec::new() };
        }
        let notes = vec!["the text is not UTF-8 and is read as Windows-1252".to_owned()];
        Self { bytes: Cow::Owned(from_windows_1252(&bytes).into_bytes()), notes }
    }

    /// Converts UTF-16 to UTF-8, removes a byte order mark, and converts single CRs to LF. Without
    /// a byte order mark, UTF-16 is recognized by two ASCII characters at its beginning. Bytes in
    /// another encoding are unchanged.
    pub fn of_unicode(bytes: &'a [u8]) -> Cow<'a, [u8]> {
        with_line_feeds(match bytes {
            [0xef, 0xbb, 0xbf, rest @ ..] => Cow::Borrowed(rest),
            [0xff, 0xfe, rest @ ..] => Cow::Owned(from_utf16(rest, u16::from_le_bytes)),
            [0xfe, 0xff, rest @ ..] => Cow::Owned(from_utf16(rest, u16::from_be_bytes)),
            [1..128, 0, 1..128, 0, ..] => Cow::Owned(from_utf16(bytes, u16::from_le_bytes)),
            [0, 1..128, 0, 1..128, ..] => Cow::Owned(from_utf16(bytes, u16::from_be_bytes)),
            _ => Cow::Borrowed(bytes),
        })
    }
}

/// Converts UTF-16, in code units read by `unit`, to UTF-8. Unpaired surrogates become U+FFFD.
fn from_utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Vec<u8> {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
    text.collect::<String>().into_bytes()
}

/// True if bytes are not UTF-8 and contain no control characters other than whitespace.
fn is_windows_1252(bytes: &[u8]) -> bool {
    // The error has no length if the text is UTF-8 up to a character that its end cuts off.
    std::str::from_utf8(bytes).is_err_and(|error| error.error_len().is_some())
        && !bytes.iter().any(|byte| *byte < 0x20 && !byte.is_ascii_whitespace())
}

/// Returns the text that bytes in Windows-1252 encode. The five bytes without a character become
/// control characters.
fn from_windows_1252(bytes: &[u8]) -> String {
    let characters = bytes.iter().map(|byte| match byte {
        0x80..0xa0 => WINDOWS_1252.chars().nth(usize::from(byte - 0x80)).unwrap_or_default(),
        byte => char::from(*byte),
    });
    characters.collect()
}

/// Ends all lines with LF if any line ends with a single CR. Other texts are unchanged, even if
/// their lines end with CR and LF.
fn with_line_feeds(text: Cow<'_, [u8]>) -> Cow<'_, [u8]> {
    let is_single_cr =
        |(index, byte): (usize, &u8)| *byte == b'\r' && text.get(index + 1) != Some(&b'\n');
    if !text.contains(&b'\r') || !text.iter().enumerate().any(is_single_cr) {
        return text;
    }
    // Each CR is either a line end or the first half of one.
    let mut lines = Vec::with_capacity(text.len());
    for (index, byte) in text.iter().enumerate() {
        match byte {
            b'\r' if text.get(index + 1) == Some(&b'\n') => {}
            b'\r' => lines.push(b'\n'),
            byte => lines.push(*byte),
        }
    }
    Cow::Owned(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_encoding_and_line_end_is_one_text() {
        let wanted = "t,Höhe °\n1,2\n";
        let utf16 = |unit: fn(u16) -> [u8; 2], mark: [u8; 2]| -> Vec<u8> {
            mark.into_iter().chain(wanted.encode_utf16().flat_map(unit)).collect()
        };
        let latin: Vec<u8> = wanted.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        for (bytes, notes) in [
            (wanted.as_bytes().to_vec(), 0),
            (format!("\u{feff}{wanted}").into_bytes(), 0),
            (utf16(u16::to_le_bytes, [0xff, 0xfe]), 0),
            (utf16(u16::to_be_bytes, [0xfe, 0xff]), 0),
            (utf16(u16::to_le_bytes, [0xff, 0xfe])[2..].to_vec(), 0),
            (utf16(u16::to_be_bytes, [0xfe, 0xff])[2..].to_vec(), 0),
            (wanted.replace('\n', "\r").into_bytes(), 0),
            (latin, 1),
        ] {
            let text = Text::decode(&bytes);
            assert_eq!(String::from_utf8_lossy(&text.bytes), wanted, "{bytes:x?}");
            assert_eq!(text.notes.len(), notes, "{bytes:x?}");
        }
        assert_eq!(&*Text::decode(b"a\x80\x99b").bytes, "a€™b".as_bytes());
        assert_eq!(&*Text::decode(b"\x01\xff,").bytes, b"\x01\xff,", "no text");
    }
}
