//! Growth of files, in which elements of valid files are repeated, nested and lengthened until the
//! file is as large as its reader accepts.
//!
//! [`crate::mutate`] changes small files in a few places, and such a file never takes more than a
//! few times the work of its seed. In contrast, this module makes thousands or millions of numbered
//! or identical copies of one kind of element, with or without a second kind.

use crate::heavy;
use crate::mutate::Random;
use crate::readers::Seed;

/// Brackets of the text formats.
const BRACKETS: [(u8, u8); 4] = [(b'{', b'}'), (b'[', b']'), (b'(', b')'), (b'<', b'>')];

/// Separators between elements.
const SIGNS: [&[u8]; 7] = [b"", b",", b" ", b"\n", b";", b", ", b"}{"];

/// Returns the maximum size of files that are grown for a reader, and the function that grows them.
/// The function repeats parts of valid files, or generates files.
pub(crate) fn grower(reader: &str) -> Option<(usize, Grower)> {
    const KIB: usize = 1 << 10;
    const MIB: usize = 1 << 20;
    Some(match reader {
        "scene" | "embedded" | "lighthouse" | "anchors" | "conditions" => (MIB, grown),
        "strokes" => (4 * MIB, grown),
        "typeface" => (64 * MIB, |_, most, random| heavy::typeface(most, random)),
        "svg" | "handwriting" => (8 * MIB, grown),
        "log-usd" => (128 * MIB, |_, most, random| heavy::log_usd(most, random)),
        "log-json" | "log-lines" | "log-cfclient" | "log-csv" => (128 * MIB, grown),
        "log-folder" => (32 * MIB, grown),
        "flight" | "plan" | "light" => (256 * MIB, grown),
        "png" => (64 * MIB, |_, most, random| heavy::png(most, random)),
        "store" => (320 * MIB, grown),
        "jpeg" | "picture" | "exif" => (256 * KIB, grown),
        _ => return None,
    })
}

/// Function that grows a file for a reader up to a number of bytes.
pub(crate) type Grower = fn(&[Seed], usize, &mut Random) -> Vec<u8>;

/// Returns a seed in which one or two elements are multiplied, with at most `most` bytes.
pub(crate) fn grown(seeds: &[Seed], most: usize, random: &mut Random) -> Vec<u8> {
    let good: Vec<&Seed> = seeds.iter().filter(|seed| seed.good).collect();
    let mut bytes = good[random.below(good.len())].bytes.clone();
    // The logarithm of the target size is uniformly distributed, so that small files are as
    // frequent as large ones.
    let target = |random: &mut Random| {
        let doublings = most.ilog2().saturating_sub(10) as usize;
        (most >> random.below(doublings + 1)).max(1 << 10)
    };
    let total = target(random);
    if random.below(2) == 0 {
        // An element of a second kind is grown first. It is then multiplied as part of the first
        // kind, or stands beside it.
        let part = (total >> (1 + random.below(10))).max(64);
        grow(&mut bytes, part, random);
    }
    grow(&mut bytes, total, random);
    bytes.truncate(most);
    bytes
}

/// Grows an element until the file has `target` bytes.
fn grow(bytes: &mut Vec<u8>, target: usize, random: &mut Random) {
    let room = target.saturating_sub(bytes.len());
    match random.below(8) {
        0 | 1 => repeat(bytes, line(bytes, random), b"", room, random),
        2 | 3 => {
            let element = element(bytes, random).unwrap_or_else(|| token(bytes, random));
            let sign = SIGNS[random.below(SIGNS.len())];
            repeat(bytes, element, sign, room, random);
        }
        4 => {
            let sign = SIGNS[random.below(SIGNS.len())];
            repeat(bytes, token(bytes, random), sign, room, random);
        }
        5 => nest(bytes, room, random),
        6 => repeat(bytes, token(bytes, random), b"", room, random),
        _ => {
            let begin = random.below(bytes.len());
            let end = (begin + 1 + random.below(64)).min(bytes.len());
            repeat(bytes, (begin, end), b"", room, random);
        }
    }
}

/// Start and end of a piece of a file, in bytes.
type Span = (usize, usize);

/// Returns the line at a random position.
fn line(bytes: &[u8], random: &mut Random) -> Span {
    let at = random.below(bytes.len());
    let begin = bytes[..at].iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let end = bytes[at..].iter().position(|byte| *byte == b'\n');
    (begin, end.map_or(bytes.len(), |n| at + n + 1))
}

/// Returns the name or number next to a random position.
fn token(bytes: &[u8], random: &mut Random) -> Span {
    let is_part = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'_' | b'-');
    let at = random.below(bytes.len());
    let begin = bytes[at..].iter().position(is_part).map_or(at, |n| at + n);
    let begin = bytes[..begin].iter().rposition(|byte| !is_part(byte)).map_or(0, |at| at + 1);
    let end = bytes[begin..].iter().position(|byte| !is_part(byte));
    (begin, end.map_or(bytes.len(), |n| begin + n))
}

/// Returns a pair of brackets with its content, or an XML element from its start tag to its end
/// tag.
fn element(bytes: &[u8], random: &mut Random) -> Option<Span> {
    let at = random.below(bytes.len());
    let is_open = |byte: &u8| BRACKETS.iter().any(|(open, _)| open == byte);
    let begin = at + bytes[at..].iter().position(is_open)?;
    let (open, close) = *BRACKETS.iter().find(|(open, _)| *open == bytes[begin])?;
    let mut depth = 0_i32;
    let length = bytes[begin..].iter().position(|byte| {
        depth += i32::from(*byte == open) - i32::from(*byte == close);
        depth == 0
    })?;
    let end = begin + length + 1;
    if open != b'<' || bytes[end - 2] == b'/' || !bytes[begin + 1].is_ascii_alphabetic() {
        return Some((begin, end));
    }
    let name = bytes[begin + 1..end].iter().position(|byte| !byte.is_ascii_alphanumeric())?;
    let closing = [b"</", &bytes[begin + 1..=begin + name], b">"].concat();
    let last = bytes[end..].windows(closing.len()).position(|tag| tag == closing)?;
    Some((begin, end + last + closing.len()))
}

/// Inserts copies of a piece after it, half of the time with a number in one of its names.
fn repeat(bytes: &mut Vec<u8>, span: Span, sign: &[u8], room: usize, random: &mut Random) {
    let piece = bytes[span.0..span.1].to_vec();
    if piece.is_empty() {
        return;
    }
    let numbered = (random.below(2) == 0).then(|| token(&piece, random).1);
    let mut copies = Vec::new();
    let mut number = 0;
    while copies.len() < room {
        copies.extend(sign);
        match numbered {
            Some(at) => {
                copies.extend(&piece[..at]);
                copies.extend(number.to_string().as_bytes());
                copies.extend(&piece[at..]);
            }
            None => copies.extend(&piece),
        }
        number += 1;
    }
    bytes.splice(span.1..span.1, copies);
}

/// Nests an element in itself repeatedly, around one of its inner elements.
fn nest(bytes: &mut Vec<u8>, room: usize, random: &mut Random) {
    let Some((begin, end)) = element(bytes, random) else { return };
    let outer = &bytes[begin..end];
    if outer.len() < 3 {
        return;
    }
    let (from, to) =
        element(&outer[1..], random).unwrap_or_else(|| token(&outer[1..outer.len() - 1], random));
    let (head, tail) = (outer[..=from].to_vec(), outer[to + 1..].to_vec());
    let times = room / (head.len() + tail.len()).max(1);
    // Half of the cases are nested to the full size, and the others less deeply, because readers
    // limit the depth.
    let times = if random.below(2) == 0 { times.min(1 + random.below(200)) } else { times };
    bytes.splice(begin + to + 1..begin + to + 1, tail.repeat(times));
    bytes.splice(begin..begin, head.repeat(times));
}
