//! What a page shows: of strokes and rims, the parts that clips and masks leave, that no later
//! shape covers, and that stand out from what is beneath them.
//!
//! A picture is layers of fills from back to front, each within its clips and masks. A line is cut
//! where it crosses the edges of areas, and each piece is looked at in its middle, a little to its
//! left and right. Lines have no width: one that crosses another covers nothing of it, unless it
//! has the color of the paper.

use kurbo::{BezPath, Shape as _};

use super::super::curves::polylines;
use super::MAX_POINTS;
use super::gradient::{Gradient, Paint};
use super::layers::{Area, Cut, FLATNESS, Layer, Limit, Painted, layer, stroke_outline};
use noctograph_core::files::Budget;
use noctograph_core::geometry::{arc_lengths, bounds, distance};

/// Opacity from which a fill hides what is under it.
const OPAQUE: f64 = 0.9;

/// Difference of two colors in a channel, of 255, up to which they are one.
const ALIKE: f64 = 3.0;

/// Steps of a line's piece.
const STEPS: usize = 20;

/// How far beside a line its sides are looked at, by the page's larger side.
const BESIDE: f64 = 4e-4;

/// All that lies on a page.
pub(super) struct Page<'a> {
    layers: Vec<Layer<'a>>,
    limits: Vec<Limit<'a>>,
    gradients: &'a [Gradient],
    paper: [f64; 3],
    size: f64,
    budget: &'a Budget,
}

/// A visible part of a line, and its color.
pub(super) type Part = (Vec<[f64; 2]>, Paint);

/// What is left of an element.
pub(super) enum Shown {
    /// All of it, as it is: its stroke, or its rim.
    Whole(Paint),
    Parts(Vec<Part>),
}

impl<'a> Page<'a> {
    pub(super) fn new(
        painted: &[Painted],
        cuts: &[Cut],
        gradients: &'a [Gradient],
        [width, height]: [f64; 2],
        budget: &'a Budget,
    ) -> Self {
        let size = width.max(height);
        let area = |path: &BezPath, even_odd| Area::new(path, even_odd, size, budget);
        let limits = cuts.iter().map(|cut| match cut {
            Cut::Page(path) => Limit::Page(area(path, false)),
            Cut::Clip(parts) => {
                let parts = parts.iter().filter(|part| part.fill.is_some());
                let part = |part: &Painted| (area(&part.path, part.even_odd), part.cuts.clone());
                Limit::Clip(parts.map(part).collect())
            }
            Cut::Mask(parts, by_alpha, rectangle) => {
                let layers = parts.iter().enumerate().flat_map(|(index, part)| {
                    let fill = part.fill.map(|(paint, alpha)| {
                        layer(index, area(&part.path, part.even_odd), paint, alpha, part)
                    });
                    let stroke = part.stroke.map(|(paint, alpha)| {
                        layer(index, area(&stroke_outline(part, size), false), paint, alpha, part)
                    });
                    [fill, stroke].into_iter().flatten()
                });
                Limit::Mask(layers.collect(), *by_alpha, area(rectangle, false))
            }
        });
        let limits = limits.collect();
        let colors = painted.iter().flat_map(|item| [item.fill, item.stroke]).flatten();
        let is_white = |(paint, _): &(Paint, f64)| *paint == Paint::Plain([255; 3]);
        // White ink alone has a dark ground.
        let paper = if colors.clone().all(|color| is_white(&color)) { 0.0 } else { 255.0 };
        let mut page =
            Self { layers: Vec::new(), limits, gradients, paper: [paper; 3], size, budget };
        let mut ground = page.paper;
        for (element, item) in painted.iter().enumerate() {
            if let Some((paint, alpha)) = item.fill {
                let fill = layer(element, area(&item.path, item.even_odd), paint, alpha, item);
                let [left, bottom, right, top] = fill.area.bounds;
                let slack = BESIDE * size;
                let covers = left <= slack && top >= -slack;
                if let Paint::Plain(color) = paint
                    && covers
                    && right >= width - slack
                    && bottom <= slack - height
                {
                    ground = color.map(f64::from);
                }
                page.layers.push(fill);
            }
            if let Some((paint @ Paint::Plain(color), alpha)) = item.stroke
                && item.stroke_area.is_some()
                && alike(ground, color.map(f64::from))
            {
                let outline = area(&stroke_outline(item, size), false);
                let stroke = layer(element, outline, paint, alpha, item);
                page.layers.push(Layer { is_stroke: true, ..stroke });
            }
        }
        page
    }

    /// What is left of an element, and whether a part of its stroke has the color of what is
    /// beneath.
    pub(super) fn shown(&self, index: usize, item: &Painted) -> (Shown, bool) {
        let box_ = item.path.bounding_box();
        let extent = [box_.x0, box_.y0, box_.x1, box_.y1];
        self.budget.spend_steps(self.layers.len() / 8);
        let near: Vec<&Layer<'a>> =
            self.layers.iter().filter(|layer| layer.area.meets(extent)).collect();
        let Some((paint, alpha)) = item.stroke else {
            return (self.rim(index, item, &near), false);
        };
        let others = near.iter().filter(|layer| layer.element != index).count();
        let is_cut = item.cuts.iter().any(|cut| self.may_cut(*cut, extent));
        let color = match paint {
            Paint::Plain(color) => Some(color.map(f64::from)),
            Paint::Gradient(_) => None,
        };
        let on_paper = color.is_some_and(|color| self.blended(self.paper, color, alpha));
        if others == 0 && !is_cut && !on_paper {
            return (Shown::Whole(paint), false);
        }
        let mut is_alike = false;
        let state = |place: [f64; 2], sides: [[f64; 2]; 2]| {
            let around = [sides[0], place, sides[1]];
            let is_within = around.iter().any(|place| self.within(&item.cuts, *place));
            let covered = |place: &[f64; 2]| {
                let covers = |layer: &&&Layer<'a>| layer.element > index && layer.alpha >= OPAQUE;
                near.iter().filter(covers).any(|layer| self.lies_at(layer, *place))
            };
            if !is_within || around.iter().all(covered) {
                return None;
            }
            let below = |layer: &Layer<'a>| layer.element < index;
            let is_alike = color.is_some_and(|color| {
                sides.iter().all(|side| {
                    let (ground, _) = self.color_at(*side, &near, below);
                    self.blended(ground, color, alpha)
                })
            });
            Some(if is_alike { Look::Alike } else { Look::Seen(paint) })
        };
        let parts = self.parts(&self.lines(&item.path), item, &near, &mut |at, sides| match state(
            at, sides,
        ) {
            Some(Look::Alike) => {
                is_alike = true;
                None
            }
            Some(Look::Seen(paint)) => Some(paint),
            None => None,
        });
        match parts {
            (_, true) => (Shown::Whole(paint), false),
            // The edge of what lies under an outline in the color of the paper.
            (parts, _) if parts.is_empty() && is_alike && item.fill.is_some() => {
                (self.rim(index, item, &near), is_alike)
            }
            (parts, _) => (Shown::Parts(parts), is_alike),
        }
    }

    /// The rim of a fill: where the colors on its two sides differ.
    fn rim(&self, index: usize, item: &Painted, near: &[&Layer<'a>]) -> Shown {
        let Some((paint, _)) = item.fill else { return Shown::Parts(Vec::new()) };
        let Some(own) = near.iter().find(|layer| layer.element == index && !layer.is_stroke) else {
            // A line encloses nothing.
            return Shown::Parts(Vec::new());
        };
        let look = |is_own: bool, place: [f64; 2], sides: [[f64; 2]; 2]| {
            let in_own = sides.map(|side| self.lies_at(own, side));
            if is_own && in_own == [false; 2] && sides.iter().all(|side| !own.area.holds(*side)) {
                // Thinner than a look to its sides.
                let covers = |layer: &&&Layer<'a>| layer.element > index && layer.alpha >= OPAQUE;
                let covered = near.iter().filter(covers).any(|layer| self.lies_at(layer, place));
                let seen = !covered && self.within(&item.cuts, place);
                return seen.then_some(paint);
            }
            let [left, right] = sides.map(|side| self.color_at(side, near, |_| true));
            let own_on_top = [&left, &right].iter().any(|(_, top)| *top == Some(index));
            if !own_on_top || alike(left.0, right.0) {
                return None;
            }
            // A hole in the color of the paper is the edge of what is around it.
            let is_paper = alike(own_color(paint), self.paper);
            let other = [left.1, right.1].into_iter().flatten().find(|top| *top != index);
            let of_other = other.filter(|_| is_paper).and_then(|other| {
                near.iter().find(|layer| layer.element == other).map(|layer| layer.paint)
            });
            Some(of_other.unwrap_or(paint))
        };
        let lines = self.lines(&item.path);
        let (mut parts, is_whole) =
            self.parts(&lines, item, near, &mut |place, sides| look(true, place, sides));
        let n_own = parts.len();
        // Where a clip ends it.
        for contour in item.cuts.iter().flat_map(|cut| self.contours(*cut)) {
            let [left, bottom, right, top] = bounds(contour.iter().copied());
            if own.area.meets([left, bottom, right, top]) {
                let lines = std::slice::from_ref(contour);
                let mut look = |place, sides| look(false, place, sides);
                parts.extend(self.parts(lines, item, near, &mut look).0);
            }
        }
        match parts.first() {
            Some((_, paint)) if is_whole && parts.len() == n_own => Shown::Whole(*paint),
            _ => Shown::Parts(parts),
        }
    }

    fn lines(&self, path: &BezPath) -> Vec<Vec<[f64; 2]>> {
        polylines(path, FLATNESS * self.size, MAX_POINTS).unwrap_or_default()
    }

    /// The parts of lines that are seen, and whether these are all of them, in one paint.
    fn parts(
        &self,
        lines: &[Vec<[f64; 2]>],
        item: &Painted,
        near: &[&Layer<'a>],
        look: &mut dyn FnMut([f64; 2], [[f64; 2]; 2]) -> Option<Paint>,
    ) -> (Vec<Part>, bool) {
        let mut areas: Vec<&Area<'a>> = near.iter().map(|layer| &layer.area).collect();
        near.iter().for_each(|layer| self.areas(&layer.cuts, &mut areas));
        self.areas(&item.cuts, &mut areas);
        areas.sort_by_key(|area| std::ptr::from_ref(*area));
        areas.dedup_by_key(|area| std::ptr::from_ref(*area));
        let fades = item.cuts.iter().any(|cut| self.fades(*cut));
        let beside = BESIDE * self.size;
        let (mut parts, mut is_whole) = (Vec::new(), true);
        let mut shares = Vec::new();
        for line in lines {
            let extent = bounds(line.iter().copied());
            let areas: Vec<_> = areas.iter().filter(|area| area.meets(extent)).collect();
            let closed = line.len() > 3 && line[0] == line[line.len() - 1];
            let mut pieces: Vec<(Vec<[f64; 2]>, Option<Paint>)> = Vec::new();
            let mut last: Option<Option<Paint>> = None;
            for leg in line.windows(2) {
                shares.clear();
                shares.push(0.0);
                for area in &areas {
                    area.filled.crossings([leg[0], leg[1]], &mut shares);
                }
                let length = distance(leg[0], leg[1]);
                if fades {
                    let n = (length / (5.0 * beside)).ceil().min(1e3);
                    let mut k = 1.0;
                    while k < n {
                        shares.push(k / n);
                        k += 1.0;
                    }
                }
                let is_crossed = shares.len() > 1;
                shares.push(1.0);
                shares.sort_by(f64::total_cmp);
                shares.dedup_by(|a, b| (*a - *b).abs() * length <= 1e-6 * self.size);
                if let Some(end) = shares.last_mut() {
                    *end = 1.0;
                }
                if shares.len() == 1 {
                    shares.insert(0, 0.0);
                }
                if !self.budget.spend_steps(STEPS * shares.len()) {
                    return (parts, false);
                }
                let at = |share: f64| [0, 1].map(|i| leg[0][i] + share * (leg[1][i] - leg[0][i]));
                for piece in shares.windows(2) {
                    let seen = match last.filter(|_| !is_crossed) {
                        Some(seen) => seen,
                        None => {
                            let middle = at(0.5 * (piece[0] + piece[1]));
                            let off = if length > 0.0 { beside / length } else { 0.0 };
                            let (dx, dy) =
                                (off * (leg[1][0] - leg[0][0]), off * (leg[1][1] - leg[0][1]));
                            let sides = [
                                [middle[0] - dy, middle[1] + dx],
                                [middle[0] + dy, middle[1] - dx],
                            ];
                            look(middle, sides)
                        }
                    };
                    last = Some(seen);
                    match pieces.last_mut().filter(|(_, before)| *before == seen) {
                        Some((points, _)) => points.push(at(piece[1])),
                        None => pieces.push((vec![at(piece[0]), at(piece[1])], seen)),
                    }
                }
                if is_crossed {
                    last = None;
                }
            }
            let mut pieces = without_slivers(pieces, 2.0 * beside);
            if let [(_, Some(_))] = &pieces[..] {
                let (_, paint) = pieces.remove(0);
                parts.extend(paint.map(|paint| (line.clone(), paint)));
                continue;
            }
            is_whole &= pieces.is_empty();
            // A closed line that goes on over its beginning.
            if closed && pieces.len() > 2 && pieces[0].1 == pieces[pieces.len() - 1].1 {
                let (first, seen) = pieces.remove(0);
                let (points, _) = pieces.last_mut().expect("two are left");
                points.extend(&first[1..]);
                let _ = seen;
            }
            parts.extend(pieces.into_iter().filter_map(|(points, seen)| Some((points, seen?))));
        }
        let one_paint = parts.windows(2).all(|pair| pair[0].1 == pair[1].1);
        (parts, is_whole && one_paint)
    }

    /// Whether a place is within some cuts.
    fn within(&self, cuts: &[usize], place: [f64; 2]) -> bool {
        cuts.iter().all(|cut| match &self.limits[*cut] {
            Limit::Page(area) => area.holds(place),
            Limit::Clip(parts) => {
                parts.iter().any(|(area, cuts)| area.holds(place) && self.within(cuts, place))
            }
            Limit::Mask(layers, by_alpha, rectangle) => {
                let mut shown = 0.0;
                for layer in layers.iter().filter(|layer| self.lies_at(layer, place)) {
                    let [r, g, b] = self.color(layer, place).map(|channel| channel / 255.0);
                    // Luminance of sRGB as masks take it (CSS Masking, section 7.10.1).
                    let light = if *by_alpha { 1.0 } else { 0.2125 * r + 0.7154 * g + 0.0721 * b };
                    shown += layer.alpha * (light - shown);
                }
                rectangle.holds(place) && shown >= 0.5
            }
        })
    }

    fn lies_at(&self, layer: &Layer<'a>, place: [f64; 2]) -> bool {
        layer.area.holds(place) && self.within(&layer.cuts, place)
    }

    fn color(&self, layer: &Layer<'a>, place: [f64; 2]) -> [f64; 3] {
        match layer.paint {
            Paint::Plain(color) => color.map(f64::from),
            Paint::Gradient(index) => self.gradients[index].color_at(place),
        }
    }

    /// The color at a place, and the element on top of it.
    fn color_at(
        &self,
        place: [f64; 2],
        near: &[&Layer<'a>],
        of: impl Fn(&Layer<'a>) -> bool,
    ) -> ([f64; 3], Option<usize>) {
        let (mut color, mut top) = (self.paper, None);
        for layer in near.iter().filter(|layer| of(layer) && self.lies_at(layer, place)) {
            let own = self.color(layer, place);
            color = [0, 1, 2].map(|i| color[i] + layer.alpha * (own[i] - color[i]));
            top = Some(layer.element);
        }
        (color, top)
    }

    /// Whether a color over a ground cannot be told from it.
    fn blended(&self, ground: [f64; 3], color: [f64; 3], alpha: f64) -> bool {
        alike(ground, [0, 1, 2].map(|i| ground[i] + alpha * (color[i] - ground[i])))
    }

    /// Whether a cut may end something of an extent: it does not where that lies within the page.
    fn may_cut(&self, cut: usize, [left, bottom, right, top]: [f64; 4]) -> bool {
        match &self.limits[cut] {
            Limit::Page(area) => {
                let (of, slack) = (area.bounds, BESIDE * self.size);
                left < of[0] - slack
                    || bottom < of[1] - slack
                    || right > of[2] + slack
                    || top > of[3] + slack
            }
            Limit::Clip(_) | Limit::Mask(..) => true,
        }
    }

    fn areas<'b>(&'b self, cuts: &[usize], areas: &mut Vec<&'b Area<'a>>) {
        for cut in cuts {
            match &self.limits[*cut] {
                Limit::Page(area) => areas.push(area),
                Limit::Clip(parts) => {
                    for (area, cuts) in parts {
                        areas.push(area);
                        self.areas(cuts, areas);
                    }
                }
                Limit::Mask(layers, _, rectangle) => {
                    areas.push(rectangle);
                    for layer in layers {
                        areas.push(&layer.area);
                        self.areas(&layer.cuts, areas);
                    }
                }
            }
        }
    }

    /// Contours of a cut; the page's edge is none.
    fn contours(&self, cut: usize) -> Vec<&Vec<[f64; 2]>> {
        let mut areas = Vec::new();
        if !matches!(self.limits[cut], Limit::Page(_)) {
            self.areas(&[cut], &mut areas);
        }
        areas.into_iter().flat_map(|area| &area.contours).collect()
    }

    fn fades(&self, cut: usize) -> bool {
        let is_gradient = |layer: &Layer<'a>| matches!(layer.paint, Paint::Gradient(_));
        matches!(&self.limits[cut], Limit::Mask(layers, ..) if layers.iter().any(is_gradient))
    }
}

/// How a piece of a stroke looks.
enum Look {
    Seen(Paint),
    /// As what is beneath it.
    Alike,
}

fn own_color(paint: Paint) -> [f64; 3] {
    match paint {
        Paint::Plain(color) => color.map(f64::from),
        Paint::Gradient(_) => [-255.0; 3],
    }
}

fn alike(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|i| (a[i] - b[i]).abs() <= ALIKE)
}

/// Pieces of a line without those too short to be looked at: they are taken for what is around
/// them.
fn without_slivers(
    pieces: Vec<(Vec<[f64; 2]>, Option<Paint>)>,
    shortest: f64,
) -> Vec<(Vec<[f64; 2]>, Option<Paint>)> {
    let mut kept: Vec<(Vec<[f64; 2]>, Option<Paint>)> = Vec::new();
    let n = pieces.len();
    for (points, seen) in pieces {
        let along = arc_lengths(&points);
        let is_sliver = n > 1 && along[along.len() - 1] < shortest;
        match kept.last_mut() {
            Some((before, last)) if is_sliver || *last == seen => {
                before.extend(&points[1..]);
            }
            _ => kept.push((points, seen)),
        }
    }
    // The first may have been one.
    if kept.len() > 1 {
        let along = arc_lengths(&kept[0].0);
        if along[along.len() - 1] < shortest {
            let (mut points, _) = kept.remove(0);
            points.extend(&kept[0].0[1..]);
            kept[0].0 = points;
        }
    }
    kept
}
