//! Builds faces for tests from TrueType tables, whose glyphs have straight contours.

/// Contours of a glyph in font units.
pub(super) type Contours<'a> = &'a [&'a [[i16; 2]]];

/// Encodes numbers as they are stored in a table.
pub(super) fn words(numbers: impl IntoIterator<Item = u16>) -> Vec<u8> {
    numbers.into_iter().flat_map(u16::to_be_bytes).collect()
}

/// Returns a face that consists of these tables.
pub(super) fn face_of(tables: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let number = |n: usize| u32::try_from(n).unwrap().to_be_bytes();
    let n_tables = u16::try_from(tables.len()).unwrap().to_be_bytes();
    let mut file = [&[0, 1, 0, 0][..], &n_tables, &[0; 6]].concat();
    let mut offset = 12 + 16 * tables.len();
    for (tag, table) in tables {
        file.extend([&tag[..], &[0; 4], &number(offset), &number(table.len())].concat());
        offset += table.len();
    }
    tables.iter().for_each(|(_, table)| file.extend(table));
    file
}

/// Returns a face with 1000 units per em and these glyphs, numbered from 1, each with its character
/// (or none) and advance, and with additional tables.
pub(super) fn face(
    glyphs: &[(Option<char>, Contours<'_>)],
    advance: u16,
    rules: &[(&[u8; 4], Vec<u8>)],
) -> Vec<u8> {
    let half = |n: usize| u16::try_from(n).unwrap();
    let (mut glyf, mut loca, mut hmtx) = (Vec::new(), vec![0_u32; 2], vec![0; 4]);
    let mut groups = Vec::new();
    for (glyph, (character, contours)) in (1..).zip(glyphs) {
        let points = || contours.iter().copied().flatten();
        let side = |extreme: fn(i16, i16) -> i16, axis: usize| {
            points().map(|point| point[axis]).reduce(extreme).unwrap()
        };
        let box_ = [side(i16::min, 0), side(i16::min, 1), side(i16::max, 0), side(i16::max, 1)];
        glyf.extend(i16::try_from(contours.len()).unwrap().to_be_bytes());
        glyf.extend(box_.into_iter().flat_map(i16::to_be_bytes));
        let mut end = 0;
        for contour in *contours {
            end += contour.len();
            glyf.extend(half(end - 1).to_be_bytes());
        }
        glyf.extend([0, 0]);
        glyf.extend(vec![1; end]);
        for axis in 0..2 {
            let mut last = 0;
            for point in points() {
                glyf.extend((point[axis] - last).to_be_bytes());
                last = point[axis];
            }
        }
        glyf.resize(glyf.len().next_multiple_of(4), 0);
        loca.push(u32::try_from(glyf.len()).unwrap());
        hmtx.extend([advance.to_be_bytes(), box_[0].to_be_bytes()].concat());
        groups.extend(character.map(|c| [u32::from(c), u32::from(c), glyph]));
    }
    groups.sort_unstable();
    let n_groups = u32::try_from(groups.len()).unwrap();
    let mut cmap = words([0_u16, 1, 3, 10, 0, 12, 12, 0]);
    let head = [16 + 12 * n_groups, 0, n_groups];
    cmap.extend(head.iter().chain(groups.iter().flatten()).flat_map(|n| n.to_be_bytes()));
    let mut head = vec![0; 54];
    (head[18], head[19], head[51]) = (3, 232, 1);
    let n = half(glyphs.len() + 1).to_be_bytes();
    let tables = [
        (b"cmap", cmap),
        (b"glyf", glyf),
        (b"head", head),
        (b"hhea", [&[0; 34][..], &n].concat()),
        (b"hmtx", hmtx),
        (b"loca", loca.into_iter().flat_map(u32::to_be_bytes).collect()),
        (b"maxp", [&[0, 1, 0, 0][..], &n].concat()),
    ];
    face_of(&[rules, &tables].concat())
}

/// Returns a face with H, three Hebrew letters, and two Arabic letters that extend toward each
/// other to join.
pub(super) fn small_face() -> Vec<u8> {
    // Left edge, right edge and height of each glyph.
    let glyphs = [
        (Some('H'), [0, 100, 700]),
        (Some('\u{646}'), [100, 300, 100]), // noon
        (None, [0, 400, 100]),              // noon, initial
        (Some('\u{631}'), [100, 300, 100]), // reh
        (None, [100, 400, 100]),            // reh, final
        (Some('\u{5d0}'), [100, 200, 700]), // alef
        (Some('\u{5e8}'), [100, 300, 100]), // resh
        (Some('\u{5e9}'), [0, 400, 100]),   // shin, as wide as its advance
    ];
    let boxes = glyphs.map(|(_, [l, r, top])| [[l, 0], [r, 0], [r, top], [l, top]]);
    let contours = boxes.each_ref().map(|points| [&points[..]]);
    let glyphs: Vec<_> =
        glyphs.iter().zip(&contours).map(|((c, _), outline)| (*c, &outline[..])).collect();
    let tag =
        |text: &[u8; 4]| [0, 2].map(|offset| u16::from_be_bytes([text[offset], text[offset + 1]]));
    let single = |glyph| [1, 0, 1, 8, 1, 6, 1, 1, 1, glyph];
    let scripts = [&tag(b"arab")[..], &[8, 4, 0, 0, 0xffff, 2, 0, 1]].concat();
    let features =
        [&[2], &tag(b"fina")[..], &[14], &tag(b"init"), &[20, 0, 1, 0, 0, 1, 1]].concat();
    let lookups = [&[2, 6, 26][..], &single(4), &single(2)].concat();
    let offset = [10, 10 + 2 + 2 * scripts.len(), 12 + 2 * (scripts.len() + features.len())];
    let offset = offset.map(|offset| u16::try_from(offset).unwrap());
    let gsub =
        [&[1, 0, offset[0], offset[1], offset[2], 1][..], &scripts, &features, &lookups].concat();
    face(&glyphs, 400, &[(b"GSUB", words(gsub))])
}
