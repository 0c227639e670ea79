//! Text that is almost JSON: JSON lines, printed Python dictionaries, NaN, and truncated logs.

use noctograph_core::error::{Error, Result};

/// True if the error means that the text ends too early, even within a number.
pub(super) fn is_cut(source: &serde_json::Error, text: &[u8]) -> bool {
    let last = text.rsplit(|byte| *byte == b'\n').next().unwrap_or_default();
    let is_number = last.last().is_some_and(|byte| b"-+.eE".contains(byte));
    source.is_eof() || is_number && source.column() == last.len()
}

/// Returns [`Error::Input`] for the truncated log of an exported script. Such a log contains one
/// variable after another, so the remaining part lacks variables and is not just a shorter flight.
/// `place` is the line and column of its end.
pub(super) fn refuse_cut_script(text: &[u8], file: &str, place: &str) -> Result<()> {
    let head = text.trim_ascii_start().strip_prefix(b"{").unwrap_or_default();
    if !head.trim_ascii_start().starts_with(b"\"noctograph\"") {
        return Ok(());
    }
    let hint = "import the file that the script named, which may be in the folder for temporary \
                files, or the file of single samples (.jsonl) beside it";
    let cut = format!("a script's log that ends too early, at {place}");
    Err(Error::input(file, cut, "the whole log", hint))
}

/// Converts lines to one JSON list. The lines are JSON, or the output of cflib's examples,
/// `[time][block]: {'variable': value}`. Returns `None` for other text.
pub(super) fn listed(text: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(text).ok()?;
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty()).peekable();
    let is_printed = lines.peek()?.contains("]: {");
    let rows = lines.map(|line| match line.split_once("]: {") {
        Some((head, data)) if is_printed => {
            let stamp = head.trim_start_matches('[').split(']').next()?;
            let data = data.replace('\'', "\"");
            Some(format!("{{\"timestamp\": {stamp}, \"data\": {{{data}}}"))
        }
        // Printed Python dictionaries use single quotes instead of JSON's double quotes.
        _ if line.starts_with("{'") => Some(line.replace('\'', "\"")),
        _ => (line.starts_with(['{', '[']) && line.ends_with(['}', ']'])).then(|| line.to_owned()),
    });
    let rows = rows.collect::<Option<Vec<String>>>().filter(|rows| is_printed || rows.len() > 1)?;
    Some(format!("[{}]", rows.join(",")).into_bytes())
}

/// Replaces Python's NaN and infinities, which are not JSON, with `""` and spaces of the same total
/// length. Returns the depth to which lists and objects are nested.
pub(super) fn replace_nan(text: &mut [u8]) -> usize {
    const ODD: [&[u8]; 4] = [b"NaN", b"Infinity", b"-Infinity", b"-NaN"];
    let (mut i, mut in_string, mut depth, mut deepest) = (0, false, 0_usize, 0);
    while i < text.len() {
        match text[i] {
            // Inside a string, nothing is replaced or counted.
            b'\\' if in_string => i += 1,
            b'"' => in_string = !in_string,
            b'{' | b'[' if !in_string => depth += 1,
            b'}' | b']' if !in_string => depth = depth.saturating_sub(1),
            b'N' | b'I' | b'-' if !in_string => {
                if let Some(odd) = ODD.into_iter().find(|odd| text[i..].starts_with(odd)) {
                    text[i..i + odd.len()].fill(b' ');
                    text[i..i + 2].fill(b'"');
                    i += odd.len() - 1;
                }
            }
            _ => {}
        }
        deepest = deepest.max(depth);
        i += 1;
    }
    deepest
}

/// Truncates an incomplete text after its last complete member, and appends the missing closing
/// brackets.
pub(super) fn close(text: &mut Vec<u8>) {
    let (mut open, mut cut) = (Vec::new(), (0, Vec::new()));
    let (mut in_string, mut escaped) = (false, false);
    for (i, &byte) in text.iter().enumerate() {
        if in_string {
            in_string = escaped || byte != b'"';
            escaped = byte == b'\\' && !escaped;
            continue;
        }
        // The last comma or bracket outside a string ends a complete member.
        match byte {
            b'"' => in_string = true,
            b'{' => open.push(b'}'),
            b'[' => open.push(b']'),
            b'}' | b']' => {
                open.pop();
                cut = (i + 1, open.clone());
            }
            b',' => cut = (i, open.clone()),
            _ => {}
        }
    }
    let (end, closing) = cut;
    text.truncate(end);
    text.extend(closing.iter().rev());
}
