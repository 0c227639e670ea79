use ab_glyph::{Font as _, FontVec, GlyphId};

use super::super::tables::face;
use super::*;

fn number(n: usize) -> [u8; 4] {
    u32::try_from(n).unwrap().to_be_bytes()
}

/// An index of `CFF ` or, with `long`, of `CFF2`.
fn index(pieces: &[Vec<u8>], long: bool) -> Vec<u8> {
    let count = number(pieces.len());
    let mut bytes = if long { count.to_vec() } else { count[2..].to_vec() };
    if pieces.is_empty() {
        return bytes;
    }
    bytes.push(4);
    let mut at = 1;
    bytes.extend(number(at));
    for piece in pieces {
        at += piece.len();
        bytes.extend(number(at));
    }
    bytes.extend(pieces.concat());
    bytes
}

/// A dictionary of offsets, each of five bytes.
fn dictionary(entries: &[(&[usize], &[u8])]) -> Vec<u8> {
    let operand = |n: &usize| [&[29][..], &number(*n)].concat();
    let entry = |(operands, operator): &(&[usize], &[u8])| {
        [operands.iter().flat_map(operand).collect(), operator.to_vec()].concat()
    };
    entries.iter().flat_map(entry).collect()
}

/// A face of one glyph.
fn face_of(glyph: &[u8], local: &[Vec<u8>], global: &[Vec<u8>], long: bool) -> Vec<u8> {
    let private = dictionary(&[(&[6], &[19])]);
    let top = |glyphs_at: usize, private_at: usize| match long {
        false => dictionary(&[(&[glyphs_at], &[17]), (&[private.len(), private_at], &[18])]),
        true => {
            let font_at = glyphs_at - 100;
            dictionary(&[(&[glyphs_at], &[17]), (&[font_at], &[12, 36]), (&[private_at], &[24])])
        }
    };
    let (global, local) = (index(global, long), index(local, long));
    let glyphs = index(&[glyph.to_vec()], long);
    let mut table = match long {
        false => [&[1, 0, 4, 4][..], &index(&[b"T".to_vec()], false)].concat(),
        true => [&[2, 0, 5][..], &number(top(100, 0).len())[2..]].concat(),
    };
    let behind = [if long { vec![] } else { vec![0, 0] }, global].concat();
    if long {
        // The font's dictionary, its private one and the variations stand before the glyphs.
        let font_at = table.len() + top(100, 0).len() + behind.len();
        let font = |at| index(&[dictionary(&[(&[private.len(), at], &[18])])], true);
        let private_at = font_at + font(0).len();
        let local_at = private_at + private.len();
        let store_at = local_at + local.len();
        // One item with one region of no axes.
        let store = [
            &[0, 0, 0, 1, 0, 0, 0, 12, 0, 1, 0, 0, 0, 16, 0, 0][..],
            &[0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0],
        ]
        .concat();
        let store = [&store[..10], &[0, 0, 0, 16][..], &[0, 0, 0, 1], &store[18..]].concat();
        let glyphs_at = store_at + store.len();
        let entries: [(&[usize], &[u8]); 3] =
            [(&[glyphs_at], &[17]), (&[font_at], &[12, 36]), (&[store_at], &[24])];
        table.extend(dictionary(&entries));
        table.extend([behind, font(private_at), private, local, store, glyphs].concat());
        return with_heads(b"CFF2", table);
    }
    let top_bytes = index(&[top(0, 0)], false).len();
    let glyphs_at = table.len() + top_bytes + behind.len();
    let private_at = glyphs_at + glyphs.len();
    table.extend(index(&[top(glyphs_at, private_at)], false));
    table.extend([behind, glyphs, private, local].concat());
    with_heads(b"CFF ", table)
}

fn with_heads(tag: &[u8; 4], table: Vec<u8>) -> Vec<u8> {
    let (mut head, mut hhea) = (vec![0; 54], vec![0; 36]);
    (head[18], hhea[35]) = (4, 1);
    let maxp = vec![0, 0, 0x50, 0, 0, 1];
    face(&[(tag, table), (b"head", head), (b"hhea", hhea), (b"maxp", maxp)])
}

/// The number of a subroutine as it stands before its call.
fn of(subroutine: u8) -> u8 {
    32 + subroutine
}

/// Ten levels of subroutines, each of ten calls of the next; the last draws, or does nothing.
fn bomb(leaf: &[u8], n_calls: usize) -> Vec<Vec<u8>> {
    let calls = (1..10).map(|level| [of(level), 10].repeat(n_calls));
    calls.chain([leaf.to_vec()]).collect()
}

#[test]
fn subroutines_within_subroutines_are_refused_in_no_time() {
    for (long, end) in [(false, &[14][..]), (true, &[])] {
        let glyph = [&[139, 22, of(0), 10][..], end].concat();
        for leaf in [&[144, 144, 5][..], &[]] {
            let file = face_of(&glyph, &bomb(leaf, 10), &[], long);
            assert!(work(&file, 0).is_none(), "ten billion calls");
            let file = face_of(&glyph, &bomb(leaf, 2), &[], long);
            assert!(work(&file, 0).is_some(), "a thousand");
        }
        let line = [139, 22, 144, 144, 5, 144, 134, 5];
        let file = face_of(&[&line[..], end].concat(), &[], &[], long);
        let face = FontVec::try_from_vec(file.clone()).unwrap();
        assert!(
            work(&file, 0).is_some() && face.outline(GlyphId(0)).is_some(),
            "a triangle, {long}"
        );
    }
    let file = face_of(&[139, 139, 139, 200, 14], &[], &[], false);
    assert!(work(&file, 0).is_none(), "a letter composed of two");
}

/// Programs by chance: whatever the parser draws has been run to its end, number for number.
#[test]
fn what_the_parser_draws_has_been_run_before() {
    let mut state = 7_u64;
    let mut roll = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (state >> 33) as usize % n
    };
    let mut drawn = 0;
    for _ in 0..20_000 {
        let long = roll(2) == 1;
        let mut program = |n: usize| {
            let mut code = Vec::new();
            for _ in 0..roll(n) {
                let piece: &[u8] = match roll(16) {
                    0 => &[144, 144, 5],
                    1 => &[144, 144, 144, 144, 144, 144, 8],
                    2 => &[140, 1],
                    3 => &[140, 140, 18],
                    4 => &[19, 10],
                    5 => &[28, 0, 10],
                    6 => &[255, 0, 3, 128, 0],
                    7 => &[247, 29],
                    8 => &[33, 10],
                    9 => &[34, 10],
                    10 => &[33, 29],
                    11 => &[10],
                    12 => &[144, 140, 6],
                    13 => &[140, 142, 140, 16],
                    14 => &[144, 4],
                    _ => &[146],
                };
                code.extend(piece);
            }
            code
        };
        let local = [program(3), program(6), program(6)];
        let global = [program(6), program(6)];
        let end: &[u8] = if long { &[] } else { &[14] };
        let glyph = [&[139, 144, 21][..], &program(12), end].concat();
        let file = face_of(&glyph, &local, &global, long);
        let face = FontVec::try_from_vec(file.clone()).unwrap();
        // The parser panics where a blend lacks its number.
        let outline = std::panic::catch_unwind(|| face.outline(GlyphId(0)));
        if let Ok(Some(outline)) = outline {
            drawn += 1;
            assert!(
                work(&file, 0).is_some(),
                "{glyph:?} {local:?} {global:?}: {}",
                outline.curves.len()
            );
        }
    }
    assert!(drawn > 1000, "{drawn}");
}
