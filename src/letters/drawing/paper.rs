//! Paper: its color in blocks of a picture, under shadows and lamps.

use super::levels::{around, histogram, level, morphed, quantile};
use noctograph_core::statistics::median;

/// Blocks of paper along the longer side.
const BLOCKS: usize = 24;
/// Share of a block's pixels that are darker than its paper.
const PAPER: f64 = 0.75;
/// Paper is brighter than this share of paper beside it, from the brightest block on, so that a
/// shadow with a soft edge may be as dark as it likes; what is darker is a patch of ink.
const SHADOW: f64 = 0.36;
/// Largest ratio of two channels, by that of paper beside it: what has another hue is a patch of
/// ink.
const HUE: f64 = 1.3;

/// Ratio of paper in the blocks around one, below which the edge of a shadow passes there; blocks
/// that are looked at; and pixels on either side that are wider than half a pen, by a block's.
const SHADED: f64 = 0.85;
const BESIDE: usize = 2;
const PEN: f64 = 0.25;

/// Ratio of the tones of paper that is evenly lit, and tones on which light ink is told as dark ink
/// is.
const EVEN: f64 = 1.35;
const MIDDLE: [f64; 2] = [70.0, 155.0];

/// Edges of shadows.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Edges {
    /// None is sharper than a block: what is may be a thing in a photograph.
    Soft,
    /// What has a sharp edge and is no photograph may be a shadow, too.
    Sharp,
}

/// Color of the paper in blocks.
pub(super) struct Paper {
    block: usize,
    columns: usize,
    rows: usize,
    levels: Vec<[f64; 3]>,
    /// The darkest and the brightest paper around each block; empty where it is evenly lit.
    around: Vec<[[f64; 3]; 2]>,
    /// The picture without its thin lines, and its width, where shadows have sharp edges.
    closed: Option<([Vec<f64>; 3], usize)>,
}

impl Paper {
    /// The paper of a picture by its channels, of which more is lighter.
    pub(super) fn of(channels: &[Vec<f64>; 3], width: usize, edges: Edges) -> Self {
        let (block, columns, mut levels) = blocks(channels, width, PAPER);
        levels.iter_mut().flatten().for_each(|level| *level = level.max(1.0));
        let rows = levels.len() / columns;
        let mut known = known(&levels, columns, rows);
        // Blocks in the middle of a patch have the paper of their neighbors.
        while known.contains(&false) {
            let before = known.clone();
            for at in (0..levels.len()).filter(|at| !before[*at]) {
                let near = around(at, columns, rows, 1).filter(|k| before[*k]);
                let papers: Vec<[f64; 3]> = near.map(|k| levels[k]).collect();
                if !papers.is_empty() {
                    let mean = |c: usize| papers.iter().map(|p| p[c]).sum::<f64>();
                    levels[at] = [0, 1, 2].map(|c| mean(c) / papers.len() as f64);
                    known[at] = true;
                }
            }
        }
        // Brightest, then darkest of the neighbors (a morphological closing): a patch as large as a
        // few blocks is filled, and the edge of a shadow stays where it is.
        let each = |levels: &[[f64; 3]], of: &dyn Fn(&[f64]) -> f64| -> Vec<[f64; 3]> {
            let near = |at, c: usize| {
                around(at, columns, rows, 1).map(|k| levels[k][c]).collect::<Vec<_>>()
            };
            (0..levels.len()).map(|at| [0, 1, 2].map(|c| of(&near(at, c)))).collect()
        };
        levels = each(&levels, &|near| near.iter().copied().fold(0.0, f64::max));
        levels = each(&levels, &|near| near.iter().copied().fold(f64::MAX, f64::min));
        let beside = |at: usize| {
            let near = || around(at, columns, rows, BESIDE).map(|k| levels[k]);
            let most = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|c| a[c].max(b[c]));
            let least = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|c| a[c].min(b[c]));
            [near().fold([f64::MAX; 3], least), near().fold([0.0; 3], most)]
        };
        let around: Vec<_> = (0..levels.len()).map(beside).collect();
        let steps = level(PEN * block as f64);
        let is_cut = edges == Edges::Sharp && around.iter().any(is_shaded);
        let closed = is_cut.then(|| {
            let closed = |c: usize| morphed(&channels[c], width, steps, f64::max, f64::min);
            ([0, 1, 2].map(closed), width)
        });
        levels = each(&levels, &|near| near.iter().sum::<f64>() / near.len() as f64);
        Self { block, columns, rows, levels, around, closed }
    }

    /// Paper of a middle tone that is evenly lit: the tone of most of each block and those around
    /// it, so that no ink of either kind counts. `None` for any other picture.
    pub(super) fn of_middle_tone(channels: &[Vec<f64>; 3], width: usize) -> Option<Self> {
        let (block, columns, blocks) = blocks(channels, width, 0.5);
        let rows = blocks.len() / columns;
        let near = |at: usize| {
            [0, 1, 2].map(|c| {
                let levels = around(at, columns, rows, 2).map(|at| blocks[at][c]);
                median(levels).unwrap_or(0.0)
            })
        };
        let levels: Vec<[f64; 3]> = (0..blocks.len()).map(near).collect();
        let mut tones: Vec<f64> = blocks.iter().map(|rgb| rgb.iter().sum::<f64>() / 3.0).collect();
        tones.sort_by(f64::total_cmp);
        let [low, middle, high] = [1, 5, 9].map(|tenth| tones[tenth * (tones.len() - 1) / 10]);
        let is_middle = high < EVEN * low && (MIDDLE[0]..MIDDLE[1]).contains(&middle);
        is_middle.then(|| {
            let (around, closed) = (Vec::new(), None);
            Self { block, columns, rows, levels, around, closed }
        })
    }

    /// Whether edges of shadows may cross it.
    pub(super) fn is_shaded(&self) -> bool {
        self.around.iter().any(is_shaded)
    }

    /// At a pixel, between the middles of blocks.
    pub(super) fn at(&self, x: usize, y: usize) -> [f64; 3] {
        let along = |at: usize, n: usize| {
            let place = ((at as f64 + 0.5) / self.block as f64 - 0.5).clamp(0.0, (n - 1) as f64);
            let first = level(place).min(n - 1);
            (first, (first + 1).min(n - 1), place - first as f64)
        };
        let (left, right, across) = along(x, self.columns);
        let (top, bottom, down) = along(y, self.rows);
        let around = self.around.get(y / self.block * self.columns + x / self.block);
        let shaded = self.closed.as_ref().zip(around.filter(|around| is_shaded(around)));
        [0, 1, 2].map(|c| {
            let row = |row: usize| {
                let [a, b] =
                    [left, right].map(|column| self.levels[row * self.columns + column][c]);
                a + across * (b - a)
            };
            let smooth = row(top) + down * (row(bottom) - row(top));
            shaded.map_or(smooth, |((closed, width), [darkest, _])| {
                closed[c][y * width + x].max(SHADED * darkest[c]).min(smooth)
            })
        })
    }
}

/// The size of blocks, how many there are across, and the color of each, than which a share of its
/// pixels is darker.
fn blocks(channels: &[Vec<f64>; 3], width: usize, share: f64) -> (usize, usize, Vec<[f64; 3]>) {
    let height = channels[0].len() / width;
    let block = width.max(height).div_ceil(BLOCKS);
    let columns = width.div_ceil(block);
    let mut counts = vec![[[0_usize; 256]; 3]; columns * height.div_ceil(block)];
    for (c, values) in channels.iter().enumerate() {
        for (at, value) in values.iter().enumerate() {
            counts[at / width / block * columns + at % width / block][c][level(*value)] += 1;
        }
    }
    let color = |counts: &[[usize; 256]; 3]| [0, 1, 2].map(|c| quantile(&counts[c], share) as f64);
    (block, columns, counts.iter().map(color).collect())
}

/// Whether the edge of a shadow passes a block, by the darkest and the brightest paper around it.
fn is_shaded([least, most]: &[[f64; 3]; 2]) -> bool {
    least.iter().sum::<f64>() < SHADED * most.iter().sum::<f64>()
}

/// Which blocks show paper: the brightest, and from them on what is as bright and of the same hue.
fn known(levels: &[[f64; 3]], columns: usize, rows: usize) -> Vec<bool> {
    let luma = |[r, g, b]: [f64; 3]| 0.299 * r + 0.587 * g + 0.114 * b;
    let lumas: Vec<f64> = levels.iter().map(|level| luma(*level)).collect();
    let brightest = lumas.iter().copied().fold(0.0, f64::max);
    // The hue of most of the bright blocks.
    let median = |c: usize| {
        let bright = (0..levels.len()).filter(|at| lumas[*at] > 0.8 * brightest);
        (quantile(&histogram(bright.map(|at| levels[at][c])), 0.5) as f64).max(1.0)
    };
    let paper = [0, 1, 2].map(median);
    let is_paper = |of: [f64; 3], beside: [f64; 3]| {
        let ratios = [0, 1, 2].map(|c| of[c] / beside[c]);
        let most = ratios.into_iter().fold(0.0, f64::max);
        let least = ratios.into_iter().fold(f64::MAX, f64::min);
        luma(of) > SHADOW * luma(beside) && most < HUE * least
    };
    let mut known: Vec<bool> = levels.iter().map(|of| is_paper(*of, paper)).collect();
    let mut grown: Vec<usize> = (0..levels.len()).filter(|at| known[*at]).collect();
    while let Some(from) = grown.pop() {
        for at in around(from, columns, rows, 1) {
            if !known[at] && is_paper(levels[at], levels[from]) {
                known[at] = true;
                grown.push(at);
            }
        }
    }
    if !known.contains(&true) {
        known.fill(true);
    }
    known
}
