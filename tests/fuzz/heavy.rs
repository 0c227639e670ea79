//! Generators of large binary files, which are typefaces of many glyphs with many points each,
//! flight logs of the µSD card, and photos.

use crate::mutate::Random;

/// Returns a typeface of at most `most` bytes in which each letter has a different outline.
pub(crate) fn typeface(most: usize, random: &mut Random) -> Vec<u8> {
    let n_points = (4 << random.below(12)).min(7900);
    // The glyphs start at `!`, so that they include the letters of a word.
    let n_glyphs = (most / (n_points * 5 + 24)).clamp(96, 1000);
    typeface_of(n_glyphs, n_points, random.below(4), random)
}

/// Returns a typeface of the characters from `!` on, each with the given number of points in one of
/// four shapes.
pub(crate) fn typeface_of(
    n_glyphs: usize,
    n_points: usize,
    shape: usize,
    random: &mut Random,
) -> Vec<u8> {
    let mut glyf = Vec::new();
    let mut loca = vec![0_u32, 0];
    for _ in 0..n_glyphs {
        glyf.extend(outline(shape, n_points, random));
        loca.push(u32::try_from(glyf.len()).unwrap());
    }
    let n = u16::try_from(n_glyphs + 1).unwrap();
    let [n_high, n_low] = n.to_be_bytes();
    let mut head = vec![0; 54];
    head[..4].copy_from_slice(&[0, 1, 0, 0]);
    head[12..16].copy_from_slice(&[0x5f, 0x0f, 0x3c, 0xf5]);
    head[18..20].copy_from_slice(&1000_u16.to_be_bytes());
    head[51] = 1;
    let mut hhea = vec![0; 36];
    hhea[..8].copy_from_slice(&[0, 1, 0, 0, 3, 32, 0xff, 0x38]);
    hhea[35] = 1;
    let maxp = vec![0, 0, 0x50, 0, n_high, n_low];
    let hmtx = [vec![2, 88, 0, 0], vec![0; 2 * usize::from(n)]].concat();
    // The table maps consecutive characters from `!` on (format 12).
    let groups = [1_u32, 0x21, 0x21 + u32::from(n) - 2, 1];
    let mut cmap = [0_u16, 1, 3, 10, 0, 12].map(u16::to_be_bytes).concat();
    cmap.extend([0, 12, 0, 0].into_iter().chain(28_u32.to_be_bytes()).chain([0; 4]));
    cmap.extend(groups.into_iter().flat_map(u32::to_be_bytes));
    let loca = loca.into_iter().flat_map(u32::to_be_bytes).collect();
    face(&[
        (b"cmap", cmap),
        (b"glyf", glyf),
        (b"head", head),
        (b"hhea", hhea),
        (b"hmtx", hmtx),
        (b"loca", loca),
        (b"maxp", maxp),
    ])
}

/// Returns a glyph with one contour of straight lines within 1000 × 1000 units.
fn outline(shape: usize, n_points: usize, random: &mut Random) -> Vec<u8> {
    let n = i32::try_from(n_points).unwrap();
    let at = |k: i32, random: &mut Random| match shape {
        // The shapes are a tangle, a comb, a star, and a staircase.
        0 => [random.below(1000), random.below(1000)].map(|x| i32::try_from(x).unwrap()),
        1 => [1000 * k / n, if k % 2 == 0 { 0 } else { 1000 }],
        2 => {
            let turn = f64::from(k) / f64::from(n) * std::f64::consts::TAU;
            let radius = if k % 2 == 0 { 500.0 } else { 50.0 };
            #[expect(clippy::cast_possible_truncation, reason = "below 1000")]
            [libm::cos(turn), libm::sin(turn)].map(|x| (500.0 + radius * x) as i32)
        }
        _ => [1000 * (k / 2) / n, 1000 * k.div_euclid(2) / n + 100 * (k % 2)],
    };
    let points: Vec<[i32; 2]> = (0..n).map(|k| at(k, random)).collect();
    let short = |x: i32| i16::try_from(x).unwrap().to_be_bytes();
    let mut glyph: Vec<u8> = [1, 0, 0, 1000, 1000, n - 1, 0].map(short).concat();
    glyph.extend(vec![1; n_points]);
    for axis in 0..2 {
        let mut before = 0;
        for point in &points {
            glyph.extend(short(point[axis] - before));
            before = point[axis];
        }
    }
    glyph.resize(glyph.len().next_multiple_of(4), 0);
    glyph
}

/// Returns a typeface file with the given tables.
fn face(tables: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
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

/// Returns a complete µSD log of at most `most` bytes, with few or many variables.
pub(crate) fn log_usd(most: usize, random: &mut Random) -> Vec<u8> {
    let most_variables = 1 << random.below(11);
    let n_variables = 1 + random.below(most_variables);
    let mut bytes = vec![0xBC, 2, 0, 1, 0, 7, 0];
    bytes.extend(b"fixed\0");
    bytes.extend(u16::try_from(n_variables).unwrap().to_le_bytes());
    for n in 0..n_variables {
        let name = match n {
            0..3 => format!("stateEstimate.{}(B)\0", ["x", "y", "z"][n]),
            _ => format!("a.v{n}(B)\0"),
        };
        bytes.extend(name.as_bytes());
    }
    let step_us = [1, 1000, 10_000, 100_000][random.below(4)];
    let mut stamp_us = 0_u64;
    while bytes.len() + 10 + n_variables + 4 <= most {
        bytes.extend(7_u16.to_le_bytes());
        bytes.extend(stamp_us.to_le_bytes());
        bytes.resize(bytes.len() + n_variables, 1);
        stamp_us += step_us;
    }
    let crc = crc32fast::hash(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// Returns a single-colored picture with as many pixels as its reader could store in `most` bytes.
pub(crate) fn png(most: usize, random: &mut Random) -> Vec<u8> {
    let wide = 1 << random.below(14);
    let high = (most / wide).clamp(1, 65_535);
    let mut file = Vec::new();
    let size = [wide, high].map(|side| u32::try_from(side).unwrap());
    let mut info = png::Info::with_size(size[0], size[1]);
    info.color_type = png::ColorType::Grayscale;
    let n = info.raw_bytes() - high;
    let mut encoder = png::Encoder::with_info(&mut file, info).unwrap();
    encoder.set_compression(png::Compression::Fastest);
    encoder.write_header().unwrap().write_image_data(&vec![200; n]).unwrap();
    file
}
