//! Composite glyphs of a TrueType face: how many points each becomes.
//!
//! A composite consists of glyphs that may be composites again: a kilobyte of them can stand for
//! billions of points, which a parser would collect before anything can be said about them. So they
//! are counted first, in the tables `loca` and `glyf` (OpenType 1.9).

use super::tables::{table, u16_at, u32_at};

/// Composites within composites that are followed, as the parser does.
const MAX_DEPTH: u32 = 32;

/// The tables that tell.
struct Tables<'a> {
    loca: &'a [u8],
    glyf: &'a [u8],
    /// Whether places are of 4 bytes.
    long: bool,
}

/// Points of every glyph of the first face of a file, composites followed; saturates. `None` for a
/// face without such outlines.
pub(super) fn points(file: &[u8]) -> Option<Vec<u32>> {
    let long = u16_at(table(file, b"head")?, 50)? != 0;
    let tables = Tables { loca: table(file, b"loca")?, glyf: table(file, b"glyf")?, long };
    let n_glyphs = u16_at(table(file, b"maxp")?, 4)?;
    let mut known = vec![None; n_glyphs.into()];
    Some((0..n_glyphs).map(|glyph| count(&tables, glyph, &mut known, 0)).collect())
}

fn count(tables: &Tables<'_>, glyph: u16, known: &mut [Option<u32>], depth: u32) -> u32 {
    match known.get(usize::from(glyph)) {
        Some(Some(points)) => return *points,
        Some(None) if depth < MAX_DEPTH => {}
        _ => return u32::MAX,
    }
    // A glyph that holds itself has no end.
    known[usize::from(glyph)] = Some(u32::MAX);
    let mut points = 1_u32;
    match tables.outline(glyph) {
        Some(data) if data[0] < 0x80 => {
            let contours = usize::from(u16_at(data, 0).unwrap_or(0));
            let last = contours.checked_sub(1).and_then(|last| u16_at(data, 10 + 2 * last));
            points += last.map_or(0, |last| u32::from(last) + 1);
        }
        Some(data) => {
            let mut at = 10;
            while let (Some(flags), Some(part)) = (u16_at(data, at), u16_at(data, at + 2)) {
                points = points.saturating_add(count(tables, part, known, depth + 1));
                // The parser takes arguments that are not a shift for none.
                let arguments = match flags & 0x3 {
                    0x3 => 4,
                    0x2 => 2,
                    _ => 0,
                };
                let scale = match flags {
                    flags if flags & 0x80 != 0 => 8,
                    flags if flags & 0x40 != 0 => 4,
                    flags if flags & 0x08 != 0 => 2,
                    _ => 0,
                };
                at += 4 + arguments + scale;
                if flags & 0x20 == 0 {
                    break;
                }
            }
        }
        None => {}
    }
    known[usize::from(glyph)] = Some(points);
    points
}

impl<'a> Tables<'a> {
    /// The description of a glyph; `None` where it is empty.
    fn outline(&self, glyph: u16) -> Option<&'a [u8]> {
        let place = |index: usize| match self.long {
            true => u32_at(self.loca, 4 * index).map(|at| at as usize),
            false => u16_at(self.loca, 2 * index).map(|at| 2 * usize::from(at)),
        };
        let index = usize::from(glyph);
        let data = self.glyf.get(place(index)?..place(index + 1)?)?;
        (data.len() >= 10).then_some(data)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tables::face;
    use super::*;

    const ROBOTO: &[u8] = include_bytes!("../../fonts/Roboto-Thin.ttf");

    /// A face of 32 composites, each of ten times the next, and a glyph of three points.
    fn bomb() -> Vec<u8> {
        let mut glyf: Vec<u8> = Vec::new();
        let mut loca: Vec<u32> = vec![0];
        for level in 0_u16..12 {
            glyf.extend([0xff, 0xff, 0, 0, 0, 0, 0, 0, 0, 0]);
            for part in 0..10 {
                // The last with a scale, which is not the one of four numbers.
                let flags: u16 = if part < 9 { 0x22 } else { 0x48 };
                glyf.extend(flags.to_be_bytes());
                glyf.extend((level + 1).to_be_bytes());
                glyf.extend([0; 4].iter().take(if part < 9 { 2 } else { 4 }));
            }
            loca.push(u32::try_from(glyf.len()).unwrap());
        }
        glyf.extend([0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2]);
        loca.push(u32::try_from(glyf.len()).unwrap());
        let loca: Vec<u8> = loca.into_iter().flat_map(u32::to_be_bytes).collect();
        let mut head = vec![0; 54];
        head[51] = 1;
        let maxp = [0, 1, 0, 0, 0, 13].to_vec();
        face(&[(b"glyf", glyf), (b"head", head), (b"loca", loca), (b"maxp", maxp)])
    }

    #[test]
    fn composites_within_composites_are_counted_in_no_time() {
        let points = points(&bomb()).unwrap();
        assert_eq!(points[12], 4, "three points, and the glyph");
        assert_eq!(points[10], 1 + 10 * (1 + 10 * 4));
        assert_eq!(points[0], u32::MAX, "a trillion");
        let maxp = |n: u8| (b"maxp", vec![0, 1, 0, 0, 0, n]);
        let two = face(&[maxp(1), maxp(2)]);
        assert_eq!(table(&two, b"maxp").unwrap()[5], 2, "the later of two, as the parser");
    }

    #[test]
    fn a_real_face_is_far_below_any_limit() {
        let points = points(ROBOTO).unwrap();
        let most = points.iter().max().unwrap();
        assert!(points.len() > 200 && (20..2000).contains(most), "{most}");
        for cut in 0..200 {
            let _ = super::points(&ROBOTO[..ROBOTO.len() * cut / 200]);
        }
    }
}
