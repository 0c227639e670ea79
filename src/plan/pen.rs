//! Pen strokes: uninterrupted runs of light, and their possible directions.

use nalgebra::Vector2;

use noctograph_core::strokes::Strokes;

/// Greatest number of starting corners of a closed stroke.
const MAX_STARTS: usize = 8;
/// Points nearer to each other than this are one.
const SAME_M: f64 = 1e-6;
/// A run of light shorter than this is a dot: half as long as a stroke is wide in the photograph.
pub(super) const DOT_M: f64 = 0.005;

/// Cosine of the largest turn at its ends for a closed stroke to count as smooth.
const SMOOTH_COS: f64 = 0.5;
/// Length of a stroke whose light a dot gets. A lamp at rest leaves `I t / (2π σ²)` in the middle
/// of a spot of width σ, one that passes at `v` leaves `I / (√(2π) σ v)`: both are alike after
/// `t = √(2π) σ / v`, and as wide. For σ = 4 mm that is a length `v t` of 10 mm; four times that
/// make up for the hovering drone's own motion, and for serifs that dots do not have.
const DOT_LIGHT_M: f64 = 0.04;

/// Duration of a dot's light, for strokes of a given speed.
pub(super) fn dot_s(speed_m_s: f64) -> f64 {
    DOT_LIGHT_M / speed_m_s
}

/// One run of light.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PenStroke {
    /// Index of its letter.
    pub(super) letter: usize,
    /// Its corners in the plane of the word, neighbors apart; one alone is a dot.
    pub(super) points_m: Vec<Vector2<f64>>,
    /// The legs between them.
    pub(super) legs: Vec<Leg>,
}

/// A leg of a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leg {
    /// Speed along it, as a share of the stroke speed.
    pub(super) pace: f64,
}

/// A way to draw a stroke: how it is entered and left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    pub(super) start_m: Vector2<f64>,
    pub(super) start_m_s: Vector2<f64>,
    pub(super) end_m: Vector2<f64>,
    pub(super) end_m_s: Vector2<f64>,
}

/// The runs of light of a drawing, in its order. A lit move without length counts as none.
pub(super) fn pen_strokes(strokes: &Strokes) -> Vec<PenStroke> {
    let mut runs: Vec<PenStroke> = Vec::new();
    for (letter, glyph) in strokes.glyphs.iter().enumerate() {
        let mut open = false;
        for leg in &glyph.moves {
            let [from, to] = [Vector2::from(leg.from_m), Vector2::from(leg.to_m)];
            if !leg.lit {
                // A dark move of no length does not lift the pen.
                open &= (to - from).norm() <= SAME_M;
                continue;
            }
            if (to - from).norm() <= SAME_M {
                continue;
            }
            let drawn = Leg { pace: leg.pace };
            let ends_here = |run: &PenStroke| (run.last_m() - from).norm() <= SAME_M;
            match runs.last_mut().filter(|run| open && ends_here(run)) {
                Some(run) => {
                    run.points_m.push(to);
                    run.legs.push(drawn);
                }
                None => {
                    runs.push(PenStroke { letter, points_m: vec![from, to], legs: vec![drawn] });
                }
            }
            open = true;
        }
    }
    for run in runs.iter_mut().filter(|run| run.length_m() < DOT_M) {
        let middle_m = (run.points_m[0] + run.last_m()) * 0.5;
        (run.points_m, run.legs) = (vec![middle_m], Vec::new());
    }
    runs
}

impl PenStroke {
    /// The place of a dot; `None` of a stroke.
    pub(super) fn dot_m(&self) -> Option<Vector2<f64>> {
        match self.points_m[..] {
            [at_m] => Some(at_m),
            _ => None,
        }
    }

    fn last_m(&self) -> Vector2<f64> {
        self.points_m[self.points_m.len() - 1]
    }

    /// Whether it ends where it began.
    fn closed(&self) -> bool {
        self.points_m.len() > 3 && (self.last_m() - self.points_m[0]).norm() <= SAME_M
    }

    /// Whether it comes back to its beginning without a corner.
    pub(super) fn is_loop(&self) -> bool {
        let along = |index: usize| (self.points_m[index + 1] - self.points_m[index]).normalize();
        self.closed() && along(0).dot(&along(self.points_m.len() - 2)) > SMOOTH_COS
    }

    /// The same loop, drawn on over its beginning for a length, or once more at most.
    pub(super) fn overlapped(&self, mut left_m: f64) -> Self {
        let mut out = self.clone();
        for (ends, leg) in self.points_m.windows(2).zip(&self.legs) {
            if left_m < SAME_M {
                break;
            }
            let length_m = (ends[1] - ends[0]).norm();
            out.points_m.push(ends[0].lerp(&ends[1], (left_m / length_m).min(1.0)));
            out.legs.push(*leg);
            left_m -= length_m;
        }
        out
    }

    fn starts(&self) -> usize {
        (self.points_m.len() - 1).min(MAX_STARTS)
    }

    /// The same stroke, drawn a way.
    pub(super) fn along(&self, way: usize) -> Self {
        let Self { letter, mut points_m, mut legs } = self.clone();
        if way >= 2 {
            let begin = way / 2 * legs.len() / self.starts();
            points_m.pop();
            points_m.rotate_left(begin);
            points_m.push(points_m[0]);
            legs.rotate_left(begin);
        }
        if way % 2 == 1 {
            points_m.reverse();
            legs.reverse();
        }
        Self { letter, points_m, legs }
    }

    /// All ways to draw it, entered and left at the speed of strokes, a dot at rest. Way `2 k + 1`
    /// is way `2 k` backward; way 0 is as drawn.
    pub(super) fn ways(&self, speed_m_s: f64) -> Vec<Way> {
        let way = |way: usize| {
            let points = self.along(way).points_m;
            let along_m_s = |legs: Option<&[Vector2<f64>]>| {
                legs.map_or(Vector2::zeros(), |leg| (leg[1] - leg[0]).normalize() * speed_m_s)
            };
            Way {
                start_m: points[0],
                start_m_s: along_m_s(points.windows(2).next()),
                end_m: points[points.len() - 1],
                end_m_s: along_m_s(points.windows(2).next_back()),
            }
        };
        let starts = if self.closed() { self.starts() } else { 1 };
        (0..2 * starts).map(way).collect()
    }

    pub(super) fn length_m(&self) -> f64 {
        self.lengths_m().sum()
    }

    /// Time along it, corners not counted.
    pub(super) fn duration_s(&self, speed_m_s: f64) -> f64 {
        self.lengths_m().zip(&self.legs).map(|(leg_m, leg)| leg_m / (leg.pace * speed_m_s)).sum()
    }

    fn lengths_m(&self) -> impl Iterator<Item = f64> {
        self.points_m.windows(2).map(|leg| (leg[1] - leg[0]).norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::geometry::segment_distance;
    use noctograph_letters::{LetterOptions, write};

    impl PenStroke {
        /// A stroke in an even pace.
        pub(crate) fn even(letter: usize, points_m: Vec<Vector2<f64>>) -> Self {
            let legs = vec![Leg { pace: 1.0 }; points_m.len() - 1];
            Self { letter, points_m, legs }
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
            assert!(off_m < 1e-9 && over.legs.len() + 1 == over.points_m.len(), "{off_m} m");
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
