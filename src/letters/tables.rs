//! Tables of a TrueType or OpenType face, found as the parser finds them.

/// A table of the first face of a file. Of two under one name the later counts.
pub(super) fn table<'a>(file: &'a [u8], tag: &[u8; 4]) -> Option<&'a [u8]> {
    let start = if file.starts_with(b"ttcf") { u32_at(file, 12)? as usize } else { 0 };
    let n_tables = usize::from(u16_at(file, start + 4)?);
    let mut records = (0..n_tables).map(|i| start + 12 + 16 * i);
    let at = records.rfind(|at| file.get(*at..*at + 4) == Some(tag))?;
    let (from, length) = (u32_at(file, at + 8)? as usize, u32_at(file, at + 12)? as usize);
    file.get(from..from.checked_add(length)?)
}

/// The file with its tables of variations under a name that none reads. A variable face is drawn as it
/// is without them, and the parser would go through all of them for every point.
pub(super) fn without_variations(mut file: Vec<u8>) -> Vec<u8> {
    let start = if file.starts_with(b"ttcf") { u32_at(&file, 12).unwrap_or(0) as usize } else { 0 };
    let n_tables = u16_at(&file, start.saturating_add(4)).unwrap_or(0);
    for at in (0..usize::from(n_tables)).map(|i| start + 12 + 16 * i) {
        if let Some(tag) = file.get_mut(at..at + 4)
            && [b"fvar", b"gvar", b"avar", b"HVAR", b"VVAR", b"MVAR"].iter().any(|v| tag == &v[..])
        {
            tag.fill(b'-');
        }
    }
    file
}

pub(super) fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes(bytes.get(at..)?.first_chunk().copied()?))
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(at..)?.first_chunk().copied()?))
}

/// A face of these tables, for tests.
#[cfg(test)]
pub(super) fn face(tables: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let number = |n: usize| u32::try_from(n).unwrap().to_be_bytes();
    let n_tables = u16::try_from(tables.len()).unwrap().to_be_bytes();
    let mut file = [&[0, 1, 0, 0][..], &n_tables, &[0; 6]].concat();
    let mut at = 12 + 16 * tables.len();
    for (tag, table) in tables {
        file.extend([&tag[..], &[0; 4], &number(at), &number(table.len())].concat());
        at += table.len();
    }
    tables.iter().for_each(|(_, table)| file.extend(table));
    file
}
