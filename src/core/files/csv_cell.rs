//! Cells of a table: numbers, dates and quotation marks.

/// Number of decimal digits that an `f64` represents exactly as a whole number.
const EXACT_DIGITS: usize = 15;

/// True if a cell is a number, with a decimal point or a decimal comma.
pub(super) fn is_number(cell: &[u8]) -> bool {
    let text = with_points(unquoted(cell));
    let commas = cell.iter().filter(|byte| **byte == b',').count();
    commas <= 1 && std::str::from_utf8(&text).is_ok_and(|text| text.parse::<f64>().is_ok())
}

/// True if a cell is a number whose digits `separator` groups in thousands: one to three digits
/// that do not begin with zero, followed by groups of three.
pub(super) fn is_grouped(cell: &[u8], separator: u8) -> bool {
    let cell = cell.strip_prefix(b"-").or(cell.strip_prefix(b"+")).unwrap_or(cell);
    // If commas separate thousands, the groups of digits end at the decimal point.
    let whole = match cell.iter().position(|byte| *byte == b'.').filter(|_| separator == b',') {
        Some(point) if cell[point + 1..].iter().all(u8::is_ascii_digit) => &cell[..point],
        Some(_) => return false,
        None => cell,
    };
    let mut groups = whole.split(|byte| *byte == separator);
    let first = groups.next().unwrap_or_default();
    let are_digits = |group: &[u8]| group.iter().all(u8::is_ascii_digit);
    (1..=3).contains(&first.len())
        && first[0] != b'0'
        && are_digits(first)
        && groups.all(|group| group.len() == 3 && are_digits(group))
}

/// Returns a cell with its commas replaced by points.
pub(super) fn with_points(cell: &[u8]) -> Vec<u8> {
    cell.iter().map(|byte| if *byte == b',' { b'.' } else { *byte }).collect()
}

/// Returns a cell without its quotation marks.
pub(super) fn unquoted(cell: &[u8]) -> &[u8] {
    cell.strip_prefix(b"\"").and_then(|cell| cell.strip_suffix(b"\"")).unwrap_or(cell)
}

/// True if a cell begins with a digit and contains `:`, `-`, `/` or two points, as a date or a time
/// of day does.
pub(super) fn is_date(cell: &[u8]) -> bool {
    let cell = unquoted(cell);
    let digits = cell.first().is_some_and(u8::is_ascii_digit);
    let points = cell.iter().filter(|byte| **byte == b'.').count();
    digits && (points == 2 || cell.iter().any(|byte| matches!(byte, b':' | b'-' | b'/')))
}

/// Powers of ten, all of which are exact in an `f64`.
const TENS: [f64; 16] =
    [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Parses a number of up to [`EXACT_DIGITS`] digits without an exponent at the beginning of a
/// string, and returns it with its length in bytes. Returns `None` for any other text. The
/// numerator and the denominator are exact, so only their quotient is rounded (Clinger 1990).
pub(super) fn short_number(text: &[u8]) -> Option<(f64, usize)> {
    let is_negative = text.first() == Some(&b'-');
    // The digits are read as an integer. `point` is the index of the byte after the decimal point.
    let (mut numerator, mut point) = (0_u64, None);
    let mut length = usize::from(is_negative);
    let begin = length;
    while let Some(byte) = text.get(length).filter(|_| length < begin + EXACT_DIGITS + 1) {
        match byte {
            b'0'..=b'9' => numerator = 10 * numerator + u64::from(byte - b'0'),
            b'.' if point.is_none() => point = Some(length + 1),
            _ => break,
        }
        length += 1;
    }
    // The numerator and the power of ten are exact, so a single division gives the nearest number.
    let n_digits = length - begin - usize::from(point.is_some());
    let magnitude = numerator as f64 / TENS[point.map_or(0, |point| length - point)];
    let value = if is_negative { -magnitude } else { magnitude };
    (1..=EXACT_DIGITS).contains(&n_digits).then_some((value, length))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn short_numbers_are_rounded_as_any_are(text in "-?[0-9]{0,9}[.]?[0-9]{0,9}") {
            let actual = short_number(text.as_bytes()).filter(|(_, length)| *length == text.len());
            let actual = actual.map(|(value, _)| value);
            let wanted = text.parse::<f64>().ok();
            prop_assert!(actual.is_none() || actual.map(f64::to_bits) == wanted.map(f64::to_bits));
            let n_digits = text.bytes().filter(u8::is_ascii_digit).count();
            prop_assert_eq!(actual.is_some(), (1..=15).contains(&n_digits));
        }
    }
}
