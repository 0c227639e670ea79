//! Mutations of files by bytes, numbers in text, lines, and pieces of other seeds.

use crate::readers::Seed;

/// Generator of a case's random numbers (splitmix64, Steele and others, 2014).
pub(crate) struct Random(u64);

impl Random {
    /// Creates the generator for a reader's case.
    pub(crate) fn new(reader: &str, case: u64) -> Self {
        let name =
            reader.bytes().fold(0, |hash: u64, byte| hash.wrapping_mul(31) + u64::from(byte));
        Self(name.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ case.wrapping_mul(0xd134_2543_de82_ef95))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// Returns a number below `n`, which is at least 1.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.next() % n.max(1) as u64).unwrap()
    }

    fn pick<'a, T: ?Sized>(&mut self, all: &[&'a T]) -> &'a T {
        all[self.below(all.len())]
    }
}

/// Numbers at the limits of types and of a drone's physical range.
const NUMBERS: [&str; 24] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "1e7",
    "1000000",
    "65536",
    "4294967296",
    "9223372036854775808",
    "-9223372036854775809",
    "0.1",
    "1e15",
    "1e30",
    "1e31",
    "3600.1",
    "-0",
    "99999999999999999999999",
    "2147483648",
    "255",
    "256",
    "1e-9",
];

/// Words that have a meaning in at least one of the formats.
const WORDS: [&[u8]; 24] = [
    b"\"",
    b"'",
    b",",
    b";",
    b"\n",
    b"\r\n",
    b"{",
    b"}",
    b"[",
    b"]",
    b"<",
    b">",
    b"&",
    b"=",
    b"#",
    b"/",
    b"..",
    b"\0",
    b"\xff",
    b"\xef\xbb\xbf",
    b"[[",
    b"]]",
    b"<g>",
    b"null",
];

/// Maximum size of a case in bytes, because repeated lines would otherwise fill the memory.
const MAX_BYTES: usize = 1 << 20;

/// Returns a seed with changes in one to eight places.
pub(crate) fn mutated(seeds: &[Seed], random: &mut Random) -> Vec<u8> {
    let mut bytes = seeds[random.below(seeds.len())].bytes.clone();
    for _ in 0..=random.below(8) {
        let other = &seeds[random.below(seeds.len())].bytes;
        change(&mut bytes, other, random);
        bytes.truncate(MAX_BYTES);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let at = random.below(bytes.len() + 1);
    let end = |random: &mut Random, most: usize| (at + random.below(most)).min(bytes.len());
    match random.below(12) {
        0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
        1 if at < bytes.len() => bytes[at] = u8::try_from(random.below(256)).unwrap(),
        2 => bytes.truncate(at),
        3 => {
            let end = end(random, 64);
            bytes.drain(at..end);
        }
        4 => {
            let word = random.pick(&WORDS).to_vec();
            bytes.splice(at..at, word);
        }
        5 => {
            let end = end(random, 200);
            let piece = bytes[at..end].to_vec();
            let times = 1 + random.below(40);
            let to = random.below(bytes.len() + 1);
            bytes.splice(to..to, piece.repeat(times));
        }
        6 => {
            let from = random.below(other.len() + 1);
            let piece = &other[from..(from + random.below(200)).min(other.len())];
            let end = end(random, 200);
            bytes.splice(at..end, piece.iter().copied());
        }
        7 => integer(bytes, at, random),
        8 => line(bytes, at, random),
        _ => number(bytes, at, random),
    }
}

/// Overwrites 2, 4 or 8 bytes at a position with an integer.
fn integer(bytes: &mut [u8], at: usize, random: &mut Random) {
    let values = [0, 1, 0x7f, 0xff, 0x7fff, 0xffff, 0x7fff_ffff, 0xffff_ffff, u64::MAX];
    let value = values[random.below(values.len())];
    let size = [2, 4, 8][random.below(3)];
    let (little, big) = (value.to_le_bytes(), value.to_be_bytes());
    let value = if random.below(2) == 0 { &little[..size] } else { &big[8 - size..] };
    if let Some(place) = bytes.get_mut(at..at + size) {
        place.copy_from_slice(value);
    }
}

/// Repeats or removes the line at a position.
fn line(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let begin = bytes[..at].iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let end =
        bytes[at..].iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |n| at + n + 1);
    match random.below(2) {
        0 => drop(bytes.drain(begin..end)),
        _ => {
            let again = bytes[begin..end].repeat(1 + random.below(30));
            bytes.splice(end..end, again);
        }
    }
}

/// Replaces the first number after a position.
fn number(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let is_part = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+');
    let Some(begin) = bytes[at..].iter().position(is_part).map(|n| at + n) else { return };
    let end = bytes[begin..].iter().position(|b| !is_part(b)).map_or(bytes.len(), |n| begin + n);
    let number = random.pick(&NUMBERS);
    bytes.splice(begin..end, number.bytes());
}

/// Corrects the checksums of a PNG file's chunks, because readers reject wrong ones.
pub(crate) fn mend_checksums(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4).and_then(|n| n.first_chunk()).copied() {
        let end = at + 8 + u32::from_be_bytes(length) as usize;
        let Some(sum) = bytes.get(at + 4..end).map(crc32fast::hash) else { return };
        let Some(place) = bytes.get_mut(end..end + 4) else { return };
        place.copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
}
