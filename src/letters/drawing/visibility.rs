//! Visibility: the parts of strokes and outlines that are inside their clips and masks, not covered
//! by a later shape, and different from the background.
//!
//! A picture consists of layers of fills from back to front, each inside its clips and masks. A
//! line is cut where it crosses the edges of areas, and each piece is tested near its middle,
//! slightly to the left and to the right. Strokes in the color of the paper count as areas.
//! [`once`] handles the width of all other strokes.
//!
//! [`once`]: super::once

use kurbo::{BezPath, Shape as _};

use super::super::curves::{on_grid, polylines};
use super::super::vector::{between, is_closed, segments};
use super::MAX_POINTS;
use super::layers::{Area, Color, Cut, FLATNESS, Layer, Painted, Scale};
use noctograph_core::geometry::{bounds, distance, polyline_length_m};

/// Minimum opacity of a fill that hides what is beneath it.
pub(super) const OPAQUE: f64 = 0.9;

/// Maximum difference in a channel, out of 255, between two colors that count as one.
const ALIKE: f64 = 3.0;

/// Maximum distance between crossings that count as one, relative to the page's larger side.
const ROUNDING: f64 = 1e-6;

/// Budget steps for a piece of a line.
const STEPS_PER_PIECE: usize = 20;

/// Distance between a line and its test points, relative to the page's larger side.
const BESIDE: f64 = 4e-4;

/// Minimum distance between a clip's edge and a fill's path for the edge to be an outline, relative
/// to that of the test points. A larger value would leave gaps where a clip touches the path.
const TOUCH: f64 = 0.25;

/// The layers of a page.
pub(super) struct Page<'a> {
    layers: Vec<Layer<'a>>,
    cuts: &'a [Cut<'a>],
    paper: [f64; 3],
    size: [f64; 2],
    scale: Scale<'a>,
}

/// A visible part of a line, and the color of that part.
pub(super) type Part = (Vec<[f64; 2]>, Color);

/// A piece of a line, and its color if it is visible.
type Piece = (Vec<[f64; 2]>, Option<Color>);

/// A stroke, and the layers near it.
struct Stroked<'b, 'a> {
    /// Index of the stroke's element.
    index: usize,
    item: &'b Painted,
    near: &'b [&'b Layer<'a>],
    /// The fill of the element.
    fill: Option<&'b Layer<'a>>,
    color: Color,
    alpha: f64,
}

impl Stroked<'_, '_> {
    /// True if the stroke does not stand out from the background color `ground`, given as red,
    /// green and blue from 0 to 255.
    fn blends(&self, ground: [f64; 3]) -> bool {
        let ink = self.color.map(f64::from);
        alike(ground, [0, 1, 2].map(|i| ground[i] + self.alpha * (ink[i] - ground[i])))
    }
}

/// Appearance of a stroke at a position: hidden, in the color beneath it, or in its own color.
enum Sight {
    Hidden,
    Alike,
    Shown(Color),
}

/// The visible part of an element.
pub(super) enum Visible {
    /// The element's whole stroke.
    Stroke(Color),
    /// The element's whole outline.
    Outline(Color),
    Parts(Vec<Part>),
}

impl<'a> Page<'a> {
    /// Returns the layers of painted elements from back to front: all fills, and the strokes in the
    /// color of the background. The paper is black if all ink is white, and white otherwise.
    pub(super) fn new(
        painted: &[Painted],
        cuts: &'a [Cut<'a>],
        size: [f64; 2],
        scale: Scale<'a>,
    ) -> Self {
        let fills = painted.iter().filter_map(|item| item.fill.map(|(color, _)| color));
        let strokes =
            painted.iter().filter_map(|item| item.stroke.as_ref().map(|(color, ..)| *color));
        let is_ink_white = fills.chain(strokes).all(|color| color == [255; 3]);
        let paper = [if is_ink_white { 0.0 } else { 255.0 }; 3];
        // The order is from back to front, because a fill over the whole page changes the
        // background of later elements.
        let mut page = Self { layers: Vec::new(), cuts, paper, size, scale };
        let mut ground = paper;
        for (element, item) in painted.iter().enumerate() {
            if let Some(fill) = item.fill_layer(element, scale) {
                if page.is_whole(&fill) {
                    ground = blended(ground, &fill);
                }
                page.layers.push(fill);
            }
            let stroke = item.stroke.as_ref().map(|(color, ..)| color.map(f64::from));
            if stroke.is_some_and(|color| alike(ground, color)) {
                page.layers.extend(item.stroke_layer(element, scale));
            }
        }
        page
    }

    /// True if a layer is a rectangle over the whole page, even after its clips and masks.
    fn is_whole(&self, layer: &Layer<'a>) -> bool {
        layer.area.is_page(self.size, BESIDE * self.scale.size)
            && layer.cuts.iter().all(|cut| match &self.cuts[*cut] {
                Cut::Page(_) => true,
                Cut::Clip(layers) => layers.iter().any(|layer| self.is_whole(layer)),
                Cut::Mask(layers, by_alpha, edge) => {
                    edge.is_page(self.size, BESIDE * self.scale.size)
                        && layers.iter().all(|layer| {
                            self.is_whole(layer) && layer.alpha * light(layer, *by_alpha) > 0.5
                        })
                }
            })
    }

    /// True if an element is paper, that is, a fill over the whole page.
    pub(super) fn is_paper(&self, index: usize, item: &Painted) -> bool {
        item.stroke.is_none()
            && self.layers.iter().any(|layer| layer.element == index && self.is_whole(layer))
    }

    /// Returns the visible part of an element, whose stroke including its dashes is `line`. Also
    /// returns true if part of that line is invisible because of the background's color.
    pub(super) fn visible(&self, index: usize, item: &Painted, line: &BezPath) -> (Visible, bool) {
        let extent = extent(item);
        // Only layers near the element can hide it. Comparing boxes takes an eighth of a step.
        self.scale.budget.spend_steps(self.layers.len() / 8);
        let mut near: Vec<&Layer<'a>> =
            self.layers.iter().filter(|layer| layer.area.meets(extent)).collect();
        let fill = near.iter().find(|layer| layer.element == index && !layer.is_stroke).copied();
        let Some((color, alpha, _)) = item.stroke else {
            return (self.outline(index, item, &near), false);
        };
        let is_of_ground = near.iter().any(|layer| layer.element == index && layer.is_stroke);
        let ink = color.map(f64::from);
        if fill.is_some_and(|fill| is_of_ground && !alike(fill.color.map(f64::from), ink)) {
            // A border in the color of the background leaves only the fill visible.
            near.retain(|layer| layer.element != index || !layer.is_stroke);
            return (self.outline(index, item, &near), false);
        }
        self.visible_stroke(&Stroked { index, item, near: &near, fill, color, alpha }, line)
    }

    /// Returns the visible part of a stroke along `line`, and of the outline that only its fill
    /// shows. Also returns true if a part is invisible because it has the color of the background.
    fn visible_stroke(&self, stroked: &Stroked<'_, 'a>, line: &BezPath) -> (Visible, bool) {
        let Stroked { index, item, near, fill, color, .. } = *stroked;
        // An open path is filled up to a closing side, which the stroke does not draw.
        let closing = fill.map_or(Vec::new(), |_| closing_sides(&self.lines(&item.path)));
        let (mut sides, _) = self.parts(&closing, item, near, &mut |place, sides| {
            self.outline_color(near, fill?, true, place, sides)
        });
        sides.extend(fill.map_or(Vec::new(), |fill| self.outline_at_clips(item, near, fill)));
        // Most elements have nothing near them, and are visible as a whole without further tests.
        let is_isolated = near.iter().all(|layer| layer.element == index);
        let is_cut = item.cuts.iter().any(|cut| self.may_cut(*cut, extent(item)));
        if is_isolated && !is_cut && !stroked.blends(self.paper) && sides.is_empty() {
            return (Visible::Stroke(color), false);
        }
        let mut is_alike = false;
        let mut look = |place, sides| match self.sight(stroked, place, sides) {
            Sight::Shown(color) => Some(color),
            Sight::Hidden => None,
            Sight::Alike => {
                is_alike = true;
                None
            }
        };
        let (mut parts, is_whole) = self.parts(&self.lines(line), item, near, &mut look);
        if is_whole && sides.is_empty() {
            let color = parts.first().map_or(color, |part| part.1);
            return (Visible::Stroke(color), is_alike);
        }
        parts.extend(sides);
        (Visible::Parts(parts), is_alike)
    }

    /// Determines how a stroke looks at a position, from the positions to its left and right.
    fn sight(&self, stroked: &Stroked<'_, 'a>, place: [f64; 2], sides: [[f64; 2]; 2]) -> Sight {
        let Stroked { index, item, near, fill, color, .. } = *stroked;
        // A stroke counts as hidden only if it is also hidden on both sides.
        let around = [sides[0], place, sides[1]];
        if !around.iter().any(|place| self.within(&item.cuts, *place))
            || around.iter().all(|place| self.is_covered(index, near, *place))
        {
            return Sight::Hidden;
        }
        let mut below =
            sides.iter().map(|side| self.color_at(*side, near, |layer| layer.element < index).0);
        if !below.all(|ground| stroked.blends(ground)) {
            return Sight::Shown(color);
        }
        // A stroke in the color of the background shows the edge of the fill under it.
        let outline = fill.and_then(|fill| self.outline_color(near, fill, true, place, sides));
        outline.map_or(Sight::Alike, Sight::Shown)
    }

    /// Returns the color of a fill's outline at a position on its path (`is_path`) or on a clip.
    /// Returns `None` if both sides look alike or neither shows the fill.
    fn outline_color(
        &self,
        near: &[&Layer<'a>],
        fill: &Layer<'a>,
        is_path: bool,
        place: [f64; 2],
        sides: [[f64; 2]; 2],
    ) -> Option<Color> {
        if is_path && sides.iter().all(|side| !fill.area.holds(*side)) {
            // In this case, the fill is thinner than the distance between the test points.
            let is_seen =
                !self.is_covered(fill.element, near, place) && self.within(&fill.cuts, place);
            return is_seen.then_some(fill.color);
        }
        // If a clip's edge touches the fill's path, the path is the outline.
        if !is_path && !sides.iter().all(|side| fill.area.holds(between(place, *side, TOUCH))) {
            return None;
        }
        let [left, right] = sides.map(|side| self.color_at(side, near, |_| true));
        if ![left.1, right.1].contains(&Some(fill.element)) || alike(left.0, right.0) {
            return None;
        }
        // A hole in the color of the paper is outlined as part of the shape around it.
        let is_paper = alike(fill.color.map(f64::from), self.paper);
        let other = [left.1, right.1].into_iter().flatten().find(|top| *top != fill.element);
        let other = other.filter(|_| is_paper);
        let around = other.and_then(|other| near.iter().find(|layer| layer.element == other));
        Some(around.map_or(fill.color, |layer| layer.color))
    }

    /// Returns the visible parts of the clip edges that bound an element's fill.
    fn outline_at_clips(&self, item: &Painted, near: &[&Layer<'a>], fill: &Layer<'a>) -> Vec<Part> {
        let contours = item.cuts.iter().flat_map(|cut| self.contours(*cut));
        let contours = contours.filter(|line| fill.area.meets(bounds(line.iter().copied())));
        Vec::from_iter(contours.flat_map(|line| {
            let mut look = |place, sides| self.outline_color(near, fill, false, place, sides);
            self.parts(std::slice::from_ref(line), item, near, &mut look).0
        }))
    }

    /// Returns the visible outline of an element's fill, or nothing if it has no fill.
    fn outline(&self, index: usize, item: &Painted, near: &[&Layer<'a>]) -> Visible {
        let fill = near.iter().find(|layer| layer.element == index && !layer.is_stroke);
        // A path that has no fill layer encloses no area.
        let Some(fill) = fill else { return Visible::Parts(Vec::new()) };
        let closed = self.lines(&item.closed());
        let (mut parts, is_whole) = self.parts(&closed, item, near, &mut |place, sides| {
            self.outline_color(near, fill, true, place, sides)
        });
        let n_parts = parts.len();
        parts.extend(self.outline_at_clips(item, near, fill));
        match parts.first() {
            Some((_, color)) if is_whole && parts.len() == n_parts => Visible::Outline(*color),
            _ => Visible::Parts(parts),
        }
    }

    /// Returns the polylines of a path in the page's units, flattened to within [`FLATNESS`] of the
    /// drawing's size.
    fn lines(&self, path: &BezPath) -> Vec<Vec<[f64; 2]>> {
        let tolerance = FLATNESS * self.scale.size;
        let lines = polylines(path, tolerance, MAX_POINTS).unwrap_or_default();
        on_grid(lines, path, tolerance)
    }

    /// Returns the visible parts of an element's lines, and true if each line is visible as a whole
    /// and in one color. `look` returns the color at a position on a line, given the positions
    /// beside it, or `None` if the line is hidden there.
    fn parts(
        &self,
        lines: &[Vec<[f64; 2]>],
        item: &Painted,
        near: &[&Layer<'a>],
        look: &mut dyn FnMut([f64; 2], [[f64; 2]; 2]) -> Option<Color>,
    ) -> (Vec<Part>, bool) {
        // A line's appearance can change only where the line crosses the edge of an area.
        let mut areas: Vec<&Area<'a>> = near.iter().map(|layer| &layer.area).collect();
        near.iter().for_each(|layer| self.areas(&layer.cuts, &mut areas));
        self.areas(&item.cuts, &mut areas);
        areas.sort_by_key(|area| std::ptr::from_ref(*area));
        areas.dedup_by_key(|area| std::ptr::from_ref(*area));
        let (mut parts, mut is_whole) = (Vec::new(), true);
        for line in lines {
            let Some(pieces) = self.pieces(line, &areas, look) else { return (parts, false) };
            let mut pieces = without_slivers(pieces, 2.0 * BESIDE * self.scale.size);
            if let [(_, Some(color))] = pieces[..] {
                parts.push((line.clone(), color));
                continue;
            }
            is_whole &= pieces.is_empty();
            // The ends of a closed line are joined, because its start may lie in the middle of a
            // visible part.
            let closed = line.len() > 3 && is_closed(line);
            if closed && pieces.len() > 2 && pieces[0].1 == pieces[pieces.len() - 1].1 {
                let (first, _) = pieces.remove(0);
                pieces.last_mut().expect("two are left").0.extend(&first[1..]);
            }
            parts.extend(pieces.into_iter().filter_map(|(points, color)| Some((points, color?))));
        }
        let one_color = parts.windows(2).all(|pair| pair[0].1 == pair[1].1);
        (parts, is_whole && one_color)
    }

    /// Splits a line into pieces, each with the color at its middle. Stops if the budget is spent.
    fn pieces(
        &self,
        line: &[[f64; 2]],
        areas: &[&Area<'a>],
        look: &mut dyn FnMut([f64; 2], [[f64; 2]; 2]) -> Option<Color>,
    ) -> Option<Vec<Piece>> {
        let extent = bounds(line.iter().copied());
        let areas: Vec<&Area<'a>> =
            areas.iter().copied().filter(|area| area.meets(extent)).collect();
        let mut pieces: Vec<Piece> = Vec::new();
        // The color of the previous piece is valid up to the next edge of an area.
        let mut last: Option<Option<Color>> = None;
        let mut fractions = Vec::new();
        for [from, to] in segments(line) {
            let is_crossed = self.crossings([from, to], &areas, &mut fractions);
            if !self.scale.budget.spend_steps(STEPS_PER_PIECE * fractions.len()) {
                return None;
            }
            // The color at the middle applies to the whole piece between two crossings.
            for piece in fractions.windows(2) {
                let [begin, end] = [piece[0], piece[1]].map(|fraction| between(from, to, fraction));
                let color = last.filter(|_| !is_crossed).unwrap_or_else(|| {
                    let middle = between(from, to, 0.5 * (piece[0] + piece[1]));
                    look(middle, sides(middle, [from, to], BESIDE * self.scale.size))
                });
                last = Some(color);
                match pieces.last_mut().filter(|(_, before)| *before == color) {
                    Some((points, _)) => points.push(end),
                    None => pieces.push((vec![begin, end], color)),
                }
            }
            last = last.filter(|_| !is_crossed);
        }
        Some(pieces)
    }

    /// Sets `fractions` to the positions on a segment, 0 to 1 in order, at which it crosses the
    /// edges of areas. Returns true if the segment crosses an edge. The first position is 0, and
    /// the last is 1.
    fn crossings(
        &self,
        [from, to]: [[f64; 2]; 2],
        areas: &[&Area<'a>],
        fractions: &mut Vec<f64>,
    ) -> bool {
        fractions.clear();
        fractions.push(0.0);
        areas.iter().for_each(|area| area.filled.crossings([from, to], fractions));
        let is_crossed = fractions.len() > 1;
        fractions.push(1.0);
        fractions.sort_by(f64::total_cmp);
        // Crossings that only differ by rounding count as one.
        let length = distance(from, to);
        fractions.dedup_by(|a, b| (*a - *b).abs() * length <= ROUNDING * self.scale.size);
        // Even a very short segment has two ends.
        match &mut fractions[..] {
            [_] => fractions.push(1.0),
            [.., end] => *end = 1.0,
            [] => {}
        }
        is_crossed
    }

    /// True if a position in the page's units is inside all of the given cuts.
    fn within(&self, cuts: &[usize], place: [f64; 2]) -> bool {
        cuts.iter().all(|cut| match &self.cuts[*cut] {
            Cut::Page(edge) => edge.holds(place),
            Cut::Clip(layers) => layers.iter().any(|layer| self.lies_at(layer, place)),
            Cut::Mask(layers, by_alpha, edge) => {
                let mut shown = 0.0;
                for layer in layers.iter().filter(|layer| self.lies_at(layer, place)) {
                    shown += layer.alpha * (light(layer, *by_alpha) - shown);
                }
                edge.holds(place) && shown >= 0.5
            }
        })
    }

    /// True if a layer, limited by its cuts, contains a position in the page's units.
    fn lies_at(&self, layer: &Layer<'a>, place: [f64; 2]) -> bool {
        layer.area.holds(place) && self.within(&layer.cuts, place)
    }

    /// True if a layer in front of an element hides the element at a position in the page's units.
    fn is_covered(&self, element: usize, near: &[&Layer<'a>], place: [f64; 2]) -> bool {
        let mut over = near.iter().filter(|layer| layer.element > element && layer.alpha >= OPAQUE);
        over.any(|layer| self.lies_at(layer, place))
    }

    /// Returns the color at a position, 0 to 255 in each channel, of those layers for which
    /// `counts` is true. Also returns the topmost element at that position, if any.
    fn color_at(
        &self,
        place: [f64; 2],
        near: &[&Layer<'a>],
        counts: impl Fn(&Layer<'a>) -> bool,
    ) -> ([f64; 3], Option<usize>) {
        let (mut color, mut top) = (self.paper, None);
        for layer in near.iter().filter(|layer| counts(layer) && self.lies_at(layer, place)) {
            color = blended(color, layer);
            top = Some(layer.element);
        }
        (color, top)
    }

    /// True if a cut may affect something with these bounds. The edge of a page that contains the
    /// bounds cannot.
    fn may_cut(&self, cut: usize, [left, bottom, right, top]: [f64; 4]) -> bool {
        let Cut::Page(edge) = &self.cuts[cut] else { return true };
        let (page, slack) = (edge.bounds, BESIDE * self.scale.size);
        left < page[0] - slack
            || bottom < page[1] - slack
            || right > page[2] + slack
            || top > page[3] + slack
    }

    /// Adds the areas of cuts, and those of their layers' cuts, to a list.
    fn areas<'b>(&'b self, cuts: &[usize], areas: &mut Vec<&'b Area<'a>>) {
        for cut in cuts {
            let (edge, layers) = self.cuts[*cut].parts();
            areas.extend(edge);
            for layer in layers {
                areas.push(&layer.area);
                self.areas(&layer.cuts, areas);
            }
        }
    }

    /// Returns the contours of a clip or a mask. The page's edge has no contours.
    fn contours(&self, cut: usize) -> impl Iterator<Item = &Vec<[f64; 2]>> {
        let mut areas = Vec::new();
        if !matches!(self.cuts[cut], Cut::Page(_)) {
            self.areas(&[cut], &mut areas);
        }
        areas.into_iter().flat_map(|area| &area.contours)
    }
}

/// Returns the bounds of an element's path: left, bottom, right and top.
fn extent(item: &Painted) -> [f64; 4] {
    let bounds = item.path.bounding_box();
    [bounds.x0, bounds.y0, bounds.x1, bounds.y1]
}

/// Returns the mask value of a layer, 0 to 1 (CSS Masking, section 7.10.1): its opacity if
/// `by_alpha` is true, and otherwise the luminance of its color.
fn light(layer: &Layer<'_>, by_alpha: bool) -> f64 {
    let [r, g, b] = layer.color.map(|channel| f64::from(channel) / 255.0);
    /// Fractions of the luminance in red, green and blue, as in that section.
    const LUMINANCE: [f64; 3] = [0.2125, 0.7154, 0.0721];
    let [of_r, of_g, of_b] = LUMINANCE;
    if by_alpha { 1.0 } else { of_r * r + of_g * g + of_b * b }
}

/// Returns a line from the end of each open line to its start.
fn closing_sides(lines: &[Vec<[f64; 2]>]) -> Vec<Vec<[f64; 2]>> {
    let open = lines.iter().filter(|line| line.len() > 2 && !is_closed(line));
    open.map(|line| vec![line[line.len() - 1], line[0]]).collect()
}

/// Returns the color, 0 to 255 in each channel, of a layer over the color `below`.
fn blended(below: [f64; 3], layer: &Layer<'_>) -> [f64; 3] {
    [0, 1, 2].map(|i| below[i] + layer.alpha * (f64::from(layer.color[i]) - below[i]))
}

/// True if two colors, 0 to 255 in each channel, differ by at most [`ALIKE`] in each channel.
fn alike(a: [f64; 3], b: [f64; 3]) -> bool {
    (0..3).all(|i| (a[i] - b[i]).abs() <= ALIKE)
}

/// Returns the positions to the left and to the right of a position on a segment, each at the
/// distance `beside` from it.
fn sides([x, y]: [f64; 2], [from, to]: [[f64; 2]; 2], beside: f64) -> [[f64; 2]; 2] {
    let length = distance(from, to);
    let fraction = if length > 0.0 { beside / length } else { 0.0 };
    let (dx, dy) = (fraction * (to[0] - from[0]), fraction * (to[1] - from[1]));
    [[x - dy, y + dx], [x + dy, y - dx]]
}

/// Merges pieces of a line that are shorter than `shortest` with their neighbors. The length is in
/// user units.
fn without_slivers(pieces: Vec<Piece>, shortest: f64) -> Vec<Piece> {
    let mut kept: Vec<Piece> = Vec::new();
    for (points, color) in pieces {
        match kept.last_mut() {
            Some((before, last)) if *last == color || polyline_length_m(&points) < shortest => {
                before.extend(&points[1..]);
            }
            _ => kept.push((points, color)),
        }
    }
    // The first piece may also be too short, and is then joined to the second.
    if kept.len() > 1 && polyline_length_m(&kept[0].0) < shortest {
        let (points, _) = kept.remove(0);
        kept[0].0.splice(..1, points);
    }
    kept
}
