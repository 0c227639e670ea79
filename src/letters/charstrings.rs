//! Charstrings of a CFF or CFF2 face: how much work a glyph takes.
//!
//! A charstring calls subroutines, which call others, ten deep: a kilobyte of them can stand for
//! billions of points, or for as much work without one. So a glyph is run here first, not drawn, up
//! to a budget (Adobe's Technical Notes 5176 and 5177; OpenType 1.9, `CFF2`). What the parser would
//! refuse may pass here; what passes here is never more work for the parser.

use super::tables::{table, u16_at, u32_at};

/// Most numbers and operators of a glyph. A Chinese one takes some thousand.
const MAX_WORK: u32 = 100_000;

/// Subroutines within subroutines that the parser follows.
const MAX_DEPTH: u8 = 10;

/// Numbers and operators by which the parser draws a glyph of a file's first face; `None` where these
/// are too many. Letters composed by the obsolete `endchar` of four numbers count as too many.
pub(super) fn work(file: &[u8], glyph: u16) -> Option<u32> {
    let run = |tag, open: fn(&[u8], u16) -> Option<Opened<'_>>| {
        let Some(table) = table(file, tag) else { return Some(0) };
        let (mut program, code) = open(table, glyph)?;
        program.run(code, 0)?;
        Some(program.work)
    };
    Some(run(b"CFF ", cff)? + run(b"CFF2", cff2)?)
}

/// An array of pieces of data.
#[derive(Clone, Copy, Default)]
struct Index<'a> {
    offsets: &'a [u8],
    offset_bytes: usize,
    data: &'a [u8],
}

/// An index, and what is behind it.
type Read<'a> = (Index<'a>, &'a [u8]);

/// A program, and the charstring that begins it.
type Opened<'a> = (Program<'a>, &'a [u8]);

impl<'a> Index<'a> {
    /// Reads an index of `count` pieces; what is behind it.
    fn read(count: u32, bytes: &'a [u8]) -> Option<Read<'a>> {
        if count == 0 || count == u32::MAX {
            return Some((Self::default(), bytes));
        }
        let (offset_bytes, bytes) = bytes.split_first()?;
        let offset_bytes = usize::from(*offset_bytes);
        let length = (count as usize + 1).checked_mul(offset_bytes)?;
        let (offsets, bytes) = bytes.split_at_checked(length)?;
        let mut index = Self { offsets, offset_bytes, data: &[] };
        let end = (1..=4).contains(&offset_bytes).then(|| index.offset(count as usize))?;
        let Some(end) = end else { return Some((Self::default(), bytes)) };
        let behind;
        (index.data, behind) = bytes.split_at_checked(end)?;
        Some((index, behind))
    }

    /// Reads an index of `CFF `.
    fn short(bytes: &'a [u8]) -> Option<Read<'a>> {
        Self::read(u16_at(bytes, 0)?.into(), &bytes[2..])
    }

    /// Reads an index of `CFF2`.
    fn long(bytes: &'a [u8]) -> Option<Read<'a>> {
        Self::read(u32_at(bytes, 0)?, &bytes[4..])
    }

    fn offset(&self, at: usize) -> Option<usize> {
        let bytes = self.offsets.get(at * self.offset_bytes..)?.get(..self.offset_bytes)?;
        bytes.iter().fold(0, |n, byte| n << 8 | usize::from(*byte)).checked_sub(1)
    }

    fn len(&self) -> usize {
        self.offsets.len().checked_div(self.offset_bytes).unwrap_or(0).saturating_sub(1)
    }

    fn get(&self, at: usize) -> Option<&'a [u8]> {
        if at >= self.len() {
            return None;
        }
        self.data.get(self.offset(at)?..self.offset(at + 1)?)
    }

    /// The subroutine that a number on the stack means.
    fn subroutine(&self, number: f32) -> Option<&'a [u8]> {
        let bias = match self.len() {
            0..1240 => 107,
            1240..33900 => 1131,
            _ => 32768,
        };
        self.get(usize::try_from(integer(number)?.checked_add(bias)?).ok()?)
    }
}

/// The whole part of a number, which is known.
#[expect(clippy::cast_possible_truncation, reason = "within the range of integers")]
fn integer(number: f32) -> Option<i32> {
    (-2_147_483_648.0..2_147_483_648.0).contains(&number).then_some(number as i32)
}

/// The operands of an operator each time that it stands in a dictionary, where these are integers.
/// An operator after 12 counts from 1200.
fn operands(mut dictionary: &[u8], wanted: u16) -> Vec<Option<Vec<usize>>> {
    let (mut found, mut numbers) = (Vec::new(), Some(Vec::new()));
    while let Some((&byte, rest)) = dictionary.split_first() {
        let n_bytes = match byte {
            28 => 2,
            29 => 4,
            30 => rest.iter().take_while(|b| **b >> 4 != 15 && **b & 15 != 15).count() + 1,
            247..=254 => 1,
            12 => 1,
            _ => 0,
        };
        let Some((more, rest)) = rest.split_at_checked(n_bytes) else { break };
        dictionary = rest;
        let number = match byte {
            28 => Some(i32::from(i16::from_be_bytes([more[0], more[1]]))),
            29 => more.first_chunk().map(|bytes| i32::from_be_bytes(*bytes)),
            32..=246 => Some(i32::from(byte) - 139),
            247..=250 => Some((i32::from(byte) - 247) * 256 + i32::from(more[0]) + 108),
            30 | 251..=254 => None,
            _ => {
                let operator = more.first().map_or(byte.into(), |more| 1200 + u16::from(*more));
                if operator == wanted {
                    found.push(numbers);
                }
                numbers = Some(Vec::new());
                continue;
            }
        };
        let number = number.and_then(|number| usize::try_from(number).ok());
        numbers = numbers.zip(number).map(|(mut numbers, number)| {
            numbers.push(number);
            numbers
        });
    }
    found
}

/// The only operand of an operator that stands in a dictionary once.
fn operand(dictionary: &[u8], wanted: u16) -> Option<usize> {
    match &operands(dictionary, wanted)[..] {
        [Some(numbers)] if numbers.len() == 1 => Some(numbers[0]),
        _ => None,
    }
}

/// The subroutines of the private dictionary that another one names; none where there are none.
fn private<'a>(
    table: &'a [u8],
    dictionary: &[u8],
    index: fn(&'a [u8]) -> Option<Read<'a>>,
) -> Option<Index<'a>> {
    const PRIVATE: u16 = 18;
    const SUBROUTINES: u16 = 19;
    let [length, start] = match &operands(dictionary, PRIVATE)[..] {
        [] => return Some(Index::default()),
        [Some(range)] => range[..].try_into().ok()?,
        _ => return None,
    };
    let private = table.get(start..)?.get(..length)?;
    if operands(private, SUBROUTINES).is_empty() {
        return Some(Index::default());
    }
    Some(index(table.get(start + operand(private, SUBROUTINES)?..)?)?.0)
}

/// Opens a glyph of the table `CFF `.
fn cff(table: &[u8], glyph: u16) -> Option<Opened<'_>> {
    let (_names, rest) = Index::short(table.get(usize::from(*table.get(2)?).max(4)..)?)?;
    let (tops, rest) = Index::short(rest)?;
    let (_strings, rest) = Index::short(rest)?;
    let (global, _) = Index::short(rest)?;
    let top = tops.get(0)?;
    let (glyphs, _) = Index::short(table.get(operand(top, 17)?..)?)?;
    let by_character = !operands(top, 1230).is_empty();
    let local = if by_character {
        let (fonts, _) = Index::short(table.get(operand(top, 1236)?..)?)?;
        let font = font_of(table.get(operand(top, 1237)?..)?, glyph)?;
        private(table, fonts.get(font)?, Index::short)?
    } else {
        private(table, top, Index::short)?
    };
    let program = Program { global, local, ..Program::default() };
    Some((program, glyphs.get(glyph.into())?))
}

/// The dictionary of a glyph in a face by character numbers (`FDSelect`).
fn font_of(select: &[u8], glyph: u16) -> Option<usize> {
    let (format, data) = select.split_first()?;
    match format {
        0 => data.get(usize::from(glyph)).map(|font| (*font).into()),
        3 => {
            let first = |range: usize| u16_at(data, 2 + 3 * range);
            let mut ranges = 0..usize::from(u16_at(data, 0)?);
            let range = ranges.find(|r| Some(glyph) >= first(*r) && Some(glyph) < first(*r + 1))?;
            data.get(4 + 3 * range).map(|font| (*font).into())
        }
        _ => None,
    }
}

/// Opens a glyph of the table `CFF2`.
fn cff2(table: &[u8], glyph: u16) -> Option<Opened<'_>> {
    let top_at = usize::from(*table.get(2)?).max(5);
    let top_end = top_at + usize::from(u16_at(table, 3)?);
    let top = table.get(top_at..top_end)?;
    let (global, _) = Index::long(table.get(top_end..)?)?;
    let (glyphs, _) = Index::long(table.get(operand(top, 17)?..)?)?;
    let fonts = match operand(top, 1236) {
        Some(at) => Index::long(table.get(at..)?)?.0,
        None => Index::default(),
    };
    let locals = (0..fonts.len()).map_while(|font| fonts.get(font));
    let locals: Option<Vec<_>> = locals.map(|font| private(table, font, Index::long)).collect();
    let local = locals?.into_iter().find(|index| index.len() > 0).unwrap_or_default();
    let variations = table.get(operand(top, 24)? + 2..)?;
    let mut program = Program { global, local, variations: Some(variations), ..Program::default() };
    program.regions = program.regions_of(0.0)?;
    Some((program, glyphs.get(glyph.into())?))
}

/// What a charstring runs on. Numbers that depend on a variation are unknown: not a number.
#[derive(Default)]
struct Program<'a> {
    global: Index<'a>,
    local: Index<'a>,
    /// Of `CFF2`.
    variations: Option<&'a [u8]>,
    /// Numbers that a variation adds to each number.
    regions: usize,
    stack: Vec<f32>,
    stems: usize,
    work: u32,
}

impl Program<'_> {
    /// Runs a charstring; whether the glyph ends with it. `None` beyond the budget, and where the
    /// parser ends too.
    fn run(&mut self, mut code: &[u8], depth: u8) -> Option<bool> {
        while let Some((&operator, rest)) = code.split_first() {
            code = rest;
            self.work += 1;
            if self.work > MAX_WORK || self.stack.len() > 513 {
                return None;
            }
            match operator {
                28 | 32..=255 => code = self.push(operator, code)?,
                // Stems, and masks of as many bits.
                1 | 3 | 18..=20 | 23 => {
                    self.stems += self.stack.len() / 2;
                    self.stack.clear();
                    let mask =
                        if (19..=20).contains(&operator) { self.stems.div_ceil(8) } else { 0 };
                    code = code.get(mask..).unwrap_or_default();
                }
                // Moves, lines and curves.
                4..=8 | 21 | 22 | 24..=27 | 30 | 31 => self.stack.clear(),
                12 => {
                    let (flex, rest) = code.split_first()?;
                    (34..=37).contains(flex).then(|| self.stack.clear())?;
                    code = rest;
                }
                10 | 29 => {
                    let index = if operator == 10 { self.local } else { self.global };
                    let called = index.subroutine(self.stack.pop()?)?;
                    if depth == MAX_DEPTH {
                        return None;
                    }
                    if self.run(called, depth + 1)? {
                        return Some(true);
                    }
                }
                11 if self.variations.is_none() => return Some(false),
                14 if self.variations.is_none() => {
                    return (!(4..=5).contains(&self.stack.len())).then_some(true);
                }
                15 if self.variations.is_some() => {
                    let item = self.stack.pop()?;
                    self.regions = self.regions_of(item)?;
                    self.stack.clear();
                }
                16 if self.variations.is_some() => {
                    let n = usize::try_from(integer(self.stack.pop()?)?).ok()?;
                    let taken = n.checked_mul(self.regions + 1)?;
                    self.stack.truncate(self.stack.len().checked_sub(taken)?);
                    self.stack.resize(self.stack.len() + n, f32::NAN);
                }
                _ => return None,
            }
        }
        Some(false)
    }

    /// Pushes the number that a byte begins; the code behind it.
    fn push<'b>(&mut self, byte: u8, code: &'b [u8]) -> Option<&'b [u8]> {
        let n_bytes = match byte {
            28 => 2,
            247..=254 => 1,
            255 => 4,
            _ => 0,
        };
        let (more, code) = code.split_at_checked(n_bytes)?;
        let number = match byte {
            28 => f32::from(i16::from_be_bytes([more[0], more[1]])),
            247..=250 => f32::from(byte - 247) * 256.0 + f32::from(more[0]) + 108.0,
            251..=254 => f32::from(byte - 251) * -256.0 - f32::from(more[0]) - 108.0,
            255 => i32::from_be_bytes(*more.first_chunk()?) as f32 / 65536.0,
            _ => f32::from(byte) - 139.0,
        };
        self.stack.push(number);
        Some(code)
    }

    /// Regions of an item of the variation store.
    fn regions_of(&self, item: f32) -> Option<usize> {
        let store = self.variations?;
        let item = usize::try_from(integer(item)?).ok()?;
        if item >= u16_at(store, 6)?.into() {
            return None;
        }
        let at = u32_at(store, 8 + 4 * item)? as usize;
        Some(u16_at(store, at + 4)?.into())
    }
}

#[cfg(test)]
mod tests;
