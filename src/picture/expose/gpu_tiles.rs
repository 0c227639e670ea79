//! Parts of records on the lit tiles of a picture, in chunks for a graphics device.
//!
//! A workgroup of the shader handles one tile and goes through all parts on it, so that no two
//! threads add to the same pixel. The curves of the records are drawn here while the device adds up
//! earlier records.

use std::ops::Range;

use super::Latent;
use super::curves::Curves;
use super::record::{Record, SPOTS};

pub(super) const TILE_PX: u32 = 64;

/// Number of curve values (4 MB) after which a chunk is sent.
const CHUNK: usize = 1 << 18;

/// Maximum number of loop iterations in a workgroup. llvmpipe ends all loops after a total of
/// 65,535.
const MAX_ITERATIONS: u32 = 60_000;

/// The part of a record on one tile, in the layout of `Record` in `splat.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Part {
    pub(super) place: u32,
    pub(super) columns: u32,
    pub(super) rows: u32,
    pub(super) along: u32,
    pub(super) across: u32,
    pub(super) shift: u32,
    pub(super) dither: u32,
    pub(super) unused: u32,
}

/// The work of one submission to the device.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    /// The parts, each with the index of its tile among the lit tiles.
    parts: Vec<(usize, Part)>,
    pub(super) curves: Vec<[u32; SPOTS]>,
    /// Rounds of the device, each with the range of sorted parts of each tile. No tile has more
    /// than [`MAX_ITERATIONS`] in one round.
    pub(super) rounds: Vec<Vec<[u32; 2]>>,
    /// The parts, tile by tile.
    pub(super) sorted: Vec<Part>,
}

/// A tile that the records of a color touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct LitTile {
    /// Index of the color.
    pub(super) tint: usize,
    /// Column and row of the tile in the picture.
    pub(super) column: usize,
    pub(super) row: usize,
}

/// Returns the lit tiles of all colors, one color after another.
pub(super) fn lit_tiles(latent: &Latent) -> Vec<LitTile> {
    let [width, height] = latent.size_px;
    let across = width.div_ceil(TILE_PX) as usize;
    let mut lit_tiles = Vec::new();
    for (tint, records) in latent.tints.iter().map(|tint| &tint.records).enumerate() {
        let mut lit = vec![false; across * height.div_ceil(TILE_PX) as usize];
        for record in records {
            let [columns, rows] = record.inside(width, &(0..height)).map(tiles);
            for row in rows {
                lit[row * across + columns.start..row * across + columns.end].fill(true);
            }
        }
        let lit = (0..lit.len()).filter(|&tile| lit[tile]);
        lit_tiles.extend(lit.map(|tile| LitTile {
            tint,
            column: tile % across,
            row: tile / across,
        }));
    }
    lit_tiles
}

/// Returns the tiles that a range of pixels touches along one axis.
#[inline(always)]
fn tiles(pixels: Range<u32>) -> Range<usize> {
    (pixels.start / TILE_PX) as usize..pixels.end.div_ceil(TILE_PX) as usize
}

/// True if all records of an image fit into one chunk.
pub(super) fn fits_one_chunk(latent: &Latent) -> bool {
    let records = latent.tints.iter().flat_map(|tint| &tint.records);
    records.map(|record| (record.width + record.height) as usize).sum::<usize>() <= CHUNK
}

/// Calls `send` with the records of the colors in `lit` in chunks. A chunk contains the curves of
/// its records, and their parts on the tiles in `lit`.
pub(super) fn chunks(latent: &Latent, lit: &[LitTile], mut send: impl FnMut(&mut Chunk)) {
    let [width, height] = latent.size_px;
    let across = width.div_ceil(TILE_PX) as usize;
    // Maps each tile of the picture to its index among the lit tiles.
    let mut slots = vec![None; across * height.div_ceil(TILE_PX) as usize];
    let (mut curves, mut chunk, mut first) = (Curves::default(), Chunk::default(), 0);
    for lit in lit.chunk_by(|a, b| a.tint == b.tint) {
        slots.fill(None);
        for (slot, tile) in (first..).zip(lit) {
            slots[tile.row * across + tile.column] = Some(slot);
        }
        first += lit.len();
        for record in &latent.tints[lit[0].tint].records {
            let inside = record.inside(width, &(0..height));
            let [columns, rows] = inside.clone().map(tiles);
            let on_tiles = rows.flat_map(|row| columns.clone().map(move |column| [column, row]));
            let slots = |[column, row]: [usize; 2]| slots[row * across + column];
            // Records on other tiles than these belong to another call.
            if on_tiles.clone().all(|tile| slots(tile).is_none()) {
                continue;
            }
            curves.draw(record, latent.counts_per_lx_s());
            let starts = chunk.push_curves(record, &curves);
            for tile in on_tiles {
                if let Some(slot) = slots(tile) {
                    let part = part(record, curves.shift, starts, &inside, tile, slot);
                    chunk.parts.push((slot, part));
                }
            }
            // The device processes this chunk while the next one is drawn.
            if chunk.curves.len() > CHUNK {
                chunk.sort();
                send(&mut chunk);
                chunk.parts.clear();
                chunk.curves.clear();
            }
        }
    }
    if !chunk.parts.is_empty() {
        chunk.sort();
        send(&mut chunk);
    }
}

/// Returns the part of a record on a tile, whose index among the lit tiles is `slot`. `along` and
/// `across` are the start indices of the record's curves. `shift` is that of the curves.
#[expect(clippy::cast_possible_truncation, reason = "tiles have fewer than 2^32 pixels")]
fn part(
    record: &Record,
    shift: u32,
    [along, across]: [u32; 2],
    inside: &[Range<u32>; 2],
    tile: [usize; 2],
    slot: usize,
) -> Part {
    let corner = tile.map(|tile| tile as u32 * TILE_PX);
    let [columns, rows] = [0, 1].map(|axis| {
        let Range { start, end } = inside[axis];
        start.max(corner[axis])..end.min(corner[axis] + TILE_PX)
    });
    // The offsets wrap, because the box may start outside the picture.
    let [i, j] = [columns.start - corner[0], rows.start - corner[1]];
    Part {
        place: (slot as u32 * TILE_PX + j) * TILE_PX + i,
        columns: columns.end - columns.start,
        rows: rows.end - rows.start,
        along: along.wrapping_add(columns.start).wrapping_sub(record.x.cast_unsigned()),
        across: across.wrapping_add(rows.start).wrapping_sub(record.y.cast_unsigned()),
        shift,
        dither: record.dither_at(columns.start, rows.start),
        unused: 0,
    }
}

impl Chunk {
    /// Appends the curves of a record. Returns the indices where those along and across start.
    fn push_curves(&mut self, record: &Record, drawn: &Curves) -> [u32; 2] {
        let (width, height) = (record.width as usize, record.height as usize);
        let first = self.curves.len();
        self.curves.resize(first + width + height, [0; SPOTS]);
        let (along, across) = self.curves[first..].split_at_mut(width);
        for k in 0..record.spots as usize {
            for (to, from) in along.iter_mut().zip(drawn.along(k, 0)) {
                to[k] = *from;
            }
            // The upper and the lower part of a value are stored in one number, with 16 bits each.
            let [high, low] = drawn.across(k, 0..height);
            for (to, (high, low)) in across.iter_mut().zip(high.iter().zip(low)) {
                to[k] = high << 16 | low;
            }
        }
        [first, first + width].map(|first| u32::try_from(first).unwrap_or(u32::MAX))
    }

    /// Creates the chunk of one part on the first tile.
    pub(super) fn of_part(part: Part, curve: [u32; SPOTS]) -> Self {
        let mut chunk = Self { parts: vec![(0, part)], curves: vec![curve], ..Self::default() };
        chunk.sort();
        chunk
    }

    /// Sorts the parts by tile, and divides them into rounds.
    fn sort(&mut self) {
        self.parts.sort_by_key(|&(slot, _)| slot);
        let (mut rounds, mut end): (Vec<Vec<[u32; 2]>>, _) = (Vec::new(), 0);
        for tile in self.parts.chunk_by(|a, b| a.0 == b.0) {
            // The first part of a tile always starts a round.
            let (mut iterations, mut round) = (MAX_ITERATIONS, 0);
            for (_, part) in tile {
                // A tile with too much work for one dispatch continues in the next round.
                if iterations + part.iterations() > MAX_ITERATIONS {
                    rounds.resize(rounds.len().max(round + 1), Vec::new());
                    rounds[round].push([end, end]);
                    (iterations, round) = (0, round + 1);
                }
                iterations += part.iterations();
                end += 1;
                if let Some([_, last]) = rounds[round - 1].last_mut() {
                    *last = end;
                }
            }
        }
        self.rounds = rounds;
        self.sorted = self.parts.iter().map(|&(_, part)| part).collect();
    }
}

impl Part {
    /// Returns an upper bound on the iterations of the shader's loops, including their exits.
    fn iterations(&self) -> u32 {
        // Each iteration of a workgroup covers 16 columns.
        3 + (self.columns / 16 + 1) * (self.rows + 3)
    }
}
