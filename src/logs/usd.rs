//! Reads binary logs of the µSD-card deck, versions 1 and 2.
//!
//! Header: `0xBC`, u16 version, u16 number of event types. For each type: u16 id, name, u16 number
//! of variables, and each variable as `name(type)`. Texts end with a zero byte. Records: u16 id,
//! time (version 1: u32 ms, version 2: u64 µs) and the packed variables. End: CRC32 of everything
//! before it. All numbers are little-endian. Sources: `usddeck.c` and `tools/usdlog/cfusdlog.py` of
//! crazyflie-firmware.
//!
//! A drone that is switched off while logging leaves an incomplete record and no CRC. The file is
//! then read up to that record, with a warning. A complete file whose CRC does not match is
//! refused, except with [`Damaged::Recover`].

use std::collections::BTreeMap;

use super::recording::{Block, Column, Recording};
use super::{Damaged, Job, MAX_VARIABLES};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, push};

/// First byte of a log.
pub(super) const MAGIC: u8 = 0xBC;

/// Period after which the times of version 1, which are 32-bit milliseconds, restart at zero.
const WRAP_V1_S: f64 = 4_294_967.296;

/// Advice for a damaged log.
const HINT: &str =
    "copy the file from the card again, or if it is still damaged, recover its intact part";

/// Reads a µSD log, with one block per event type. Returns [`noctograph_core::error::Error::Input`]
/// for another version, and for damage if the options refuse it.
pub(super) fn read(bytes: &[u8], job: Job<'_>) -> Result<Recording> {
    let Job { file, options, budget } = job;
    let mut cursor = Cursor { bytes, offset: 1, file };
    let version = cursor.u16("the version")?;
    if !(1..=2).contains(&version) {
        return Err(cursor.error(1, format_args!("version {version}"), "version 1 or 2"));
    }
    let mut events = cursor.header()?;
    // If the CRC matches, its four bytes do not belong to the records.
    let body = &bytes[cursor.offset..];
    let is_crc_right = bytes.split_last_chunk::<4>().is_some_and(|(before, crc)| {
        before.len() >= cursor.offset && crc32fast::hash(before) == u32::from_le_bytes(*crc)
    });
    let end = if is_crc_right { body.len() - 4 } else { body.len() };
    let Stop { n_bytes, is_cut_off, reason } = records(&body[..end], version, &mut events, budget)?;
    let n: usize = events.values().map(|event| event.block.time_s.len()).sum();
    let mut log = Recording {
        wrap_s: (version == 1).then_some(WRAP_V1_S),
        is_on_card: true,
        ..Recording::new(file)
    };
    if !is_crc_right || n_bytes < end {
        let byte = cursor.offset + n_bytes;
        if (is_crc_right || !is_cut_off) && options.damaged == Damaged::Refuse {
            let wanted = "records of known events, and then the CRC32 of all preceding bytes";
            return Err(cursor.error(byte, reason, wanted));
        }
        log.warn("log-cut", format!("byte {byte}: {reason}; {n} records before it are read"));
    }
    log.blocks = events.into_values().map(|event| event.block).collect();
    Ok(log)
}

/// An event type, and its records read so far.
struct Event {
    /// Decoders of the variables, in the order of a record.
    decoders: Vec<Decoder>,
    /// Number of bytes of all variables in a record.
    n_bytes: usize,
    block: Block,
}

/// Work budget in steps for reading one number.
const STEPS: usize = 5;

/// Point at which no further record can be read.
struct Stop {
    /// Number of bytes before it.
    n_bytes: usize,
    /// True if the log may be truncated there.
    is_cut_off: bool,
    reason: String,
}

/// Reads records up to the first one that is incomplete or unknown, into the blocks of their
/// events.
fn records(
    body: &[u8],
    version: u16,
    events: &mut BTreeMap<u16, Event>,
    budget: &Budget,
) -> Result<Stop> {
    const SHORT: &str = "the log is cut off within a record";
    // A record begins with the event's number in two bytes and the time in four or eight.
    let n_header_bytes = if version == 1 { 6 } else { 10 };
    let zeros_from = body.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let mut offset = 0;
    loop {
        let rest = &body[offset..];
        let stop = |is_cut_off, reason: &str| {
            Ok(Stop { n_bytes: offset, is_cut_off, reason: reason.to_owned() })
        };
        // Without a further record, the log is complete if the caller has found a right CRC.
        let Some((id, _)) = rest.split_first_chunk::<2>() else {
            let between = "the log ends without a CRC, cut off between two records";
            return stop(true, if rest.is_empty() { between } else { SHORT });
        };
        let id = u16::from_le_bytes(*id);
        // Zeros are not a record, because the drone's counter is never zero. They are clusters of
        // the card that were allocated but never written. Four zeros may be a CRC.
        if id == 0 && rest.len() > 4 && offset >= zeros_from {
            return stop(true, "zeros up to the end: the log was cut off");
        }
        let Some(event) = events.get_mut(&id) else {
            // Four bytes that do not begin a record are probably a CRC.
            return match rest.len() {
                4 => {
                    stop(false, "the CRC does not match: the file was changed after it was written")
                }
                _ => stop(false, &format!("event {id}, which is not in the header")),
            };
        };
        if rest.len() < n_header_bytes + event.n_bytes {
            return stop(true, SHORT);
        }
        event.add(&rest[2..n_header_bytes], &rest[n_header_bytes..], budget)?;
        offset += n_header_bytes + event.n_bytes;
    }
}

impl Event {
    /// Adds a record, given the bytes of its time and those that begin with its variables.
    fn add(&mut self, time: &[u8], mut values: &[u8], budget: &Budget) -> Result<()> {
        let n_numbers = 1 + self.decoders.len();
        budget.bytes(size_of::<f64>() * n_numbers)?;
        budget.steps(STEPS * n_numbers)?;
        push(&mut self.block.time_s, stamp_s(time));
        for ((n_bytes, number), column) in self.decoders.iter().zip(&mut self.block.columns) {
            let (value, after) = values.split_at(*n_bytes);
            push(&mut column.values, number(value));
            values = after;
        }
        Ok(())
    }
}

/// Returns the time in s from four bytes of ms or eight bytes of µs, with the lowest byte first.
fn stamp_s(bytes: &[u8]) -> f64 {
    let mut wide = [0; 8];
    wide[..bytes.len()].copy_from_slice(bytes);
    let count = u64::from_le_bytes(wide) as f64;
    const PER_S: [f64; 2] = [1e3, 1e6];
    if bytes.len() == 4 { count / PER_S[0] } else { count / PER_S[1] }
}

/// Number of bytes of a type, and the function that decodes them.
type Decoder = (usize, fn(&[u8]) -> f64);

/// Returns the decoder of a type, given by its letter in Python's `struct`, or `None` for other
/// letters.
fn decoder(kind: &str) -> Option<Decoder> {
    macro_rules! decoder {
        ($type:ty, $number:expr) => {
            Some((size_of::<$type>(), |bytes| {
                let value = <$type>::from_le_bytes(bytes.try_into().expect("as many bytes"));
                $number(value)
            }))
        };
    }
    // The types are those in usddeck.c and in its Python reader.
    match kind {
        "b" => decoder!(i8, f64::from),
        "B" | "c" | "?" => decoder!(u8, f64::from),
        "h" => decoder!(i16, f64::from),
        "H" => decoder!(u16, f64::from),
        "i" | "l" => decoder!(i32, f64::from),
        "I" | "L" => decoder!(u32, f64::from),
        "q" => decoder!(i64, |value| value as f64),
        "Q" => decoder!(u64, |value| value as f64),
        "e" => decoder!(half::f16, f64::from),
        "f" => decoder!(f32, f64::from),
        "d" => decoder!(f64, |value| value),
        _ => None,
    }
}

/// Reading position in a log.
struct Cursor<'a> {
    bytes: &'a [u8],
    offset: usize,
    file: &'a str,
}

impl Cursor<'_> {
    /// Reads the header of a µSD log, and returns its event types by id. Returns
    /// [`noctograph_core::error::Error::Input`] for a header that is incomplete or contradicts
    /// itself.
    fn header(&mut self) -> Result<BTreeMap<u16, Event>> {
        let n_events = self.u16("the number of event types")?;
        let (mut events, mut n_all) = (BTreeMap::new(), 0);
        for _ in 0..n_events {
            let start = self.offset;
            let id = self.u16("an event's number")?;
            let name = self.text("an event's name")?;
            let n_variables = self.u16("the number of an event's variables")?;
            n_all += usize::from(n_variables);
            if n_all > MAX_VARIABLES {
                let wanted = format!("at most {MAX_VARIABLES} variables");
                return Err(self.error(start, format!("event {name} with {n_variables}"), wanted));
            }
            let mut event = Event {
                decoders: Vec::new(),
                n_bytes: 0,
                block: Block { name: name.clone(), ..Block::default() },
            };
            for _ in 0..n_variables {
                let start = self.offset;
                let text = self.text("a variable's name")?;
                let split = text.strip_suffix(')').and_then(|text| text.rsplit_once('('));
                let decoder = split.and_then(|(_, kind)| decoder(kind));
                let (Some((variable, _)), Some(decoder)) = (split, decoder) else {
                    let wanted = "name(type), where the type is one of b B h H i I q Q e f d";
                    return Err(self.error(start, format!("{text:?}"), wanted));
                };
                // The name of a variable in the log table includes its group. Other variables are
                // prefixed with the event's name.
                let full_name = if variable.contains('.') {
                    variable.to_owned()
                } else {
                    format!("{name}.{variable}")
                };
                event.n_bytes += decoder.0;
                event.decoders.push(decoder);
                event.block.columns.push(Column::new(full_name, Vec::new()));
            }
            if events.insert(id, event).is_some() {
                return Err(self.error(start, format!("event {id} twice"), "one event per number"));
            }
        }
        Ok(events)
    }

    /// Reads a number of two bytes, the lowest first. `wanted_item` describes it in the error.
    fn u16(&mut self, wanted_item: &str) -> Result<u16> {
        let Some((number, _)) = self.bytes[self.offset..].split_first_chunk::<2>() else {
            return Err(self.error(self.offset, "the end of the file", wanted_item));
        };
        self.offset += 2;
        Ok(u16::from_le_bytes(*number))
    }

    /// Reads a string of at most 255 bytes up to its terminating zero byte. `wanted_item` describes
    /// it in the error.
    fn text(&mut self, wanted_item: &str) -> Result<String> {
        let rest = &self.bytes[self.offset..];
        // The 256th byte is the zero byte of the longest string.
        let Some(length) = rest.iter().take(256).position(|byte| *byte == 0) else {
            let wanted = format!("{wanted_item}, which ends in one");
            return Err(self.error(self.offset, "no zero byte", wanted));
        };
        let Ok(text) = std::str::from_utf8(&rest[..length]) else {
            return Err(self.error(self.offset, "bytes that are not text", wanted_item));
        };
        self.offset += length + 1;
        Ok(text.to_owned())
    }

    /// Returns an error at a byte of the log.
    fn error(&self, byte: usize, text: impl std::fmt::Display, wanted: impl Into<String>) -> Error {
        Error::input(format!("byte {byte}"), text, wanted, HINT).in_file(self.file, None)
    }
}
