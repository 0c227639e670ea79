//! Pen strokes, which are uninterrupted runs of light, and the ways to draw them.

use nalgebra::Vector2;

use noctograph_core::strokes::Strokes;

/// Maximum number of corners at which a closed stroke may start.
const MAX_STARTS: usize = 8;
/// Distance in m below which two points are merged.
const SAME_M: f64 = 1e-6;
/// Length in m below which a run of light is a dot, half the width of a stroke in the photograph.
pub(super) const DOT_M: f64 = 0.005;

/// Minimum cosine of the turn at the joined ends of a closed stroke for which it counts as smooth.
const SMOOTH_COS: f64 = 0.5;
/// Length in m of a stroke that receives as much light as a dot. A lamp at rest causes the exposure
/// `I t / (2π σ²)` at the center of a spot of width σ. A lamp that passes at speed `v` causes `I /
/// (√(2π) σ v)`. Both exposures are equal, and equally wide, after `t = √(2π) σ / v`. For σ = 4 mm,
/// this corresponds to a length `v t` of 10 mm. Four times that length compensates for the motion
/// of the hovering drone, and for the serifs that dots lack.
const DOT_LIGHT_M: f64 = 0.04;

/// Returns the duration in s of a dot's light at a stroke speed.
pub(super) fn dot_s(speed_m_s: f64) -> f64 {
    DOT_LIGHT_M / speed_m_s
}

/// Uninterrupted run of light.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PenStroke {
    /// Index of the stroke's letter.
    pub(super) letter: usize,
    /// Corners in the plane of the word in m, without equal neighbors. A single point is a dot.
    pub(super) points_m: Vec<Vector2<f64>>,
    /// Speeds between the corners, as fractions of the stroke speed.
    pub(super) paces: Vec<f64>,
}

/// Way to draw a stroke, given by the position and velocity at each end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    pub(super) start_m: Vector2<f64>,
    pub(super) start_m_s: Vector2<f64>,
    pub(super) end_m: Vector2<f64>,
    pub(super) end_m_s: Vector2<f64>,
}

/// Returns the strokes of a drawing in order, which are its uninterrupted runs of light. Lit moves
/// of zero length are left out, and a short run becomes a dot.
pub(super) fn pen_strokes(strokes: &Strokes) -> Vec<PenStroke> {
    let mut runs: Vec<PenStroke> = Vec::new();
    for (letter, glyph) in strokes.glyphs.iter().enumerate() {
        let mut is_down = false;
        for step in &glyph.moves {
            let [from, to] = [step.from_m, step.to_m].map(Vector2::from);
            let is_short = (to - from).norm() <= SAME_M;
            if !step.lit || is_short {
                // A dark move of zero length does not lift the pen.
                is_down &= step.lit || is_short;
                continue;
            }
            // A lit move continues a run that ends where the move begins. After a jump, a run
            // begins.
            let ends_here = |run: &PenStroke| (run.last_m() - from).norm() <= SAME_M;
            if !is_down || !runs.last().is_some_and(ends_here) {
                runs.push(PenStroke { letter, points_m: vec![from], paces: Vec::new() });
            }
            let run = runs.last_mut().expect("one was begun");
            run.points_m.push(to);
            run.paces.push(step.pace);
            is_down = true;
        }
    }
    for run in runs.iter_mut().filter(|run| run.length_m() < DOT_M) {
        let middle_m = (run.points_m[0] + run.last_m()) * 0.5;
        (run.points_m, run.paces) = (vec![middle_m], Vec::new());
    }
    runs
}

impl PenStroke {
    /// Returns the position of a dot, or `None` for a stroke.
    pub(super) fn dot_m(&self) -> Option<Vector2<f64>> {
        self.points_m.first().copied().filter(|_| self.points_m.len() == 1)
    }

    /// Returns the last point of the stroke.
    fn last_m(&self) -> Vector2<f64> {
        self.points_m[self.points_m.len() - 1]
    }

    /// True if the stroke ends at its beginning.
    fn is_closed(&self) -> bool {
        self.points_m.len() > 3 && (self.last_m() - self.points_m[0]).norm() <= SAME_M
    }

    /// True if the stroke returns to its beginning without a corner there.
    pub(super) fn is_loop(&self) -> bool {
        let along = |index: usize| (self.points_m[index + 1] - self.points_m[index]).normalize();
        self.is_closed() && along(0).dot(&along(self.points_m.len() - 2)) > SMOOTH_COS
    }

    /// Returns the stroke extended past its end along its beginning by `remaining_m`, at most once
    /// around. The stroke must be closed.
    pub(super) fn overlapped(&self, mut remaining_m: f64) -> Self {
        let mut longer = self.clone();
        for (ends, pace) in self.points_m.windows(2).zip(&self.paces) {
            if remaining_m < SAME_M {
                break;
            }
            let length_m = (ends[1] - ends[0]).norm();
            longer.points_m.push(ends[0].lerp(&ends[1], (remaining_m / length_m).min(1.0)));
            longer.paces.push(*pace);
            remaining_m -= length_m;
        }
        longer
    }

    /// Returns the number of corners at which a closed stroke may begin.
    fn n_starts(&self) -> usize {
        (self.points_m.len() - 1).min(MAX_STARTS)
    }

    /// Returns the stroke as it is drawn in one of its [`Self::ways`]. Odd ways are backward, and
    /// each pair of ways begins at another point of a closed stroke.
    pub(super) fn along(&self, way: usize) -> Self {
        let Self { letter, mut points_m, mut paces } = self.clone();
        if way >= 2 {
            // A closed stroke repeats its first point at its end, so the old end is replaced.
            let begin = way / 2 * paces.len() / self.n_starts();
            points_m.pop();
            points_m.rotate_left(begin);
            points_m.push(points_m[0]);
            paces.rotate_left(begin);
        }
        if way % 2 == 1 {
            points_m.reverse();
            paces.reverse();
        }
        Self { letter, points_m, paces }
    }

    /// Returns all ways in which the stroke can be drawn. Way 0 is as drawn, and way `2 k + 1` is
    /// way `2 k` backward.
    pub(super) fn ways(&self, speed_m_s: f64) -> Vec<Way> {
        let n_starts = if self.is_closed() { self.n_starts() } else { 1 };
        (0..2 * n_starts).map(|way| self.along(way).way(speed_m_s)).collect()
    }

    /// Returns the points (m) and velocities (m/s) at which the stroke is entered and left as
    /// drawn, at full speed. The velocities of a dot are zero.
    fn way(&self, speed_m_s: f64) -> Way {
        let along_m_s = |pair: Option<&[Vector2<f64>]>| {
            pair.map_or(Vector2::zeros(), |pair| (pair[1] - pair[0]).normalize() * speed_m_s)
        };
        let mut pairs = self.points_m.windows(2);
        Way {
            start_m: self.points_m[0],
            start_m_s: along_m_s(pairs.clone().next()),
            end_m: self.last_m(),
            end_m_s: along_m_s(pairs.next_back()),
        }
    }

    /// Returns the length of the stroke in m.
    pub(super) fn length_m(&self) -> f64 {
        self.lengths_m().sum()
    }

    /// Returns the time in s for which the stroke is lit if no corner slows the drone.
    pub(super) fn lit_s(&self, speed_m_s: f64) -> f64 {
        match self.dot_m() {
            Some(_) => dot_s(speed_m_s),
            None => self.lengths_m().zip(&self.paces).map(|(m, pace)| m / (pace * speed_m_s)).sum(),
        }
    }

    /// Returns the lengths of the stroke's segments in m.
    fn lengths_m(&self) -> impl Iterator<Item = f64> {
        self.points_m.windows(2).map(|pair| (pair[1] - pair[0]).norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::geometry::segment_distance;
    use noctograph_letters::{LetterOptions, write};

    impl PenStroke {
        /// Makes a stroke with a constant pace.
        pub(crate) fn even(letter: usize, points_m: Vec<Vector2<f64>>) -> Self {
            let paces = vec![1.0; points_m.len() - 1];
            Self { letter, points_m, paces }
        }
    }

    fn runs(word: &str) -> Vec<PenStroke> {
        pen_strokes(&write(word, &LetterOptions::default()).unwrap())
    }

    #[test]
    fn a_letter_is_split_into_runs_of_light() {
        assert_eq!(runs("NE").iter().map(|run| run.letter).collect::<Vec<_>>(), [0, 1, 1]);
        assert_eq!(runs("N")[0].points_m.len(), 4, "three legs, one stroke");
        assert_eq!(runs("I").len(), 1, "the empty first move leaves no light");
        assert!((runs("O")[0].length_m() - 1.6).abs() < 1e-12, "once around");
    }

    #[test]
    fn a_loop_goes_on_over_its_beginning() {
        let simplex = LetterOptions { font: "simplex".into(), ..LetterOptions::default() };
        let stroke_of = |word: &str| pen_strokes(&write(word, &simplex).unwrap()).remove(0);
        assert!(stroke_of("O").is_loop() && !stroke_of("C").is_loop());
        assert!(!runs("O")[0].is_loop(), "the team's O is a rectangle: it has corners");
        let o = stroke_of("O");
        for way in 0..o.ways(0.2).len() {
            let around = o.along(way);
            let over = around.overlapped(0.05);
            assert!((over.length_m() - around.length_m() - 0.05).abs() < 1e-9, "way {way}");
            let end = over.points_m[over.points_m.len() - 1];
            let distance =
                |leg: &[Vector2<f64>]| segment_distance(end.into(), [leg[0].into(), leg[1].into()]);
            let off_m = around.points_m.windows(2).take(8).map(distance).fold(1.0, f64::min);
            assert!(off_m < 1e-9 && over.paces.len() + 1 == over.points_m.len(), "{off_m} m");
        }
        assert!((o.overlapped(9.0).length_m() - 2.0 * o.length_m()).abs() < 1e-9, "once more");
    }

    #[test]
    fn all_ways_draw_the_same_line_and_odd_ones_backward() {
        let o = &runs("O")[0];
        let ways = o.ways(0.2);
        assert_eq!(ways.len(), 8, "four corners, both ways round");
        for (index, way) in ways.iter().enumerate() {
            let points = o.along(index).points_m;
            let length: f64 = points.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
            assert!((length - 1.6).abs() < 1e-12, "way {index}");
            let back = ways[index ^ 1];
            assert_eq!((way.start_m, way.end_m), (back.end_m, back.start_m), "way {index}");
            assert_eq!(way.start_m_s, -back.end_m_s, "way {index}");
        }
        assert_eq!(runs("N")[0].ways(0.2).len(), 2);
    }
}
