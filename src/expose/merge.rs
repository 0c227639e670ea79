//! Fewer, longer segments: neighbouring intervals that run straight and even become one.
//!
//! Greedy and linear in time: an interval joins the run while the chord from the run's first
//! sample to its last, walked at constant speed, passes every sample between within the
//! tolerance, while brightness does the same on its own axis (a fade is one segment), and while
//! the spot's width stays even. For every sample this bounds the chord's slope from both sides, so
//! that one comparison an interval is enough. The merged segment carries the exact sum of the
//! light.

use glam::DVec2;

use super::project::Interval;

/// A straight stretch of trail, walked at constant speed, whose brightness changes evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    /// Both ends, in px.
    pub(super) ends_px: [DVec2; 2],
    /// Standard deviation of the spot.
    pub(super) sigma_px: f64,
    /// Light of the brightest channel, summed over the pixels.
    pub(super) light_lx_s: f64,
    /// Brightness changes from `1 - ramp` times its mean to `1 + ramp` times; -1 to 1.
    pub(super) ramp: f64,
    /// When the lamp is at the first end.
    pub(super) start_s: f64,
    /// How long it takes to the other.
    pub(super) duration_s: f64,
}

impl Segment {
    /// The part between two shares of the way, 0 to 1.
    pub(super) fn part(&self, [from, to]: [f64; 2]) -> Self {
        let [start, end] = self.ends_px;
        let mean = 1.0 + self.ramp * (from + to - 1.0);
        Self {
            ends_px: [start.lerp(end, from), start.lerp(end, to)],
            light_lx_s: self.light_lx_s * (to - from) * mean,
            ramp: if mean > 0.0 { self.ramp * (to - from) / mean } else { 0.0 },
            ..*self
        }
    }
}

/// How far brightness may lie from the segment's ramp, and how much the spot's width may vary, as
/// a share of itself for every pixel of tolerance: less makes more segments where the light
/// changes; at 1, a ramp's error would be ten times that of the place.
const UNEVENNESS: f64 = 0.2;

/// Joins the intervals of one lamp, whose brightest channel has a share of its light;
/// `tolerance_px` 0 joins nothing.
///
/// Every skipped sample lies within `tolerance_px` of where the segment is at that time, and its
/// brightness and spot width within [`UNEVENNESS`] of the segment's.
pub(super) fn merge(
    intervals: impl Iterator<Item = Interval>,
    share: f64,
    tolerance_px: f64,
    segments: &mut Vec<Segment>,
) {
    let mut open: Option<Run> = None;
    for next in intervals {
        if let Some(run) = &mut open {
            if tolerance_px > 0.0 && run.takes(&next, tolerance_px) {
                continue;
            }
            segments.push(run.segment(share));
        }
        open = Some(Run::new(next));
    }
    segments.extend(open.map(|run| run.segment(share)));
}

/// Intervals that are one segment so far.
struct Run {
    start_s: f64,
    end_s: f64,
    ends_px: [DVec2; 2],
    /// At the ends, in lx px².
    brightness: [f64; 2],
    /// Velocities that pass every sample before the last closely enough, in px/s.
    velocity: Cone<DVec2>,
    /// Changes of brightness that do, in lx px²/s.
    fading: Cone<f64>,
    /// Range of the spot's width.
    narrowest_px: f64,
    widest_px: f64,
    light: f64,
    /// Sum of light times width.
    light_sigma: f64,
}

/// Slopes from the least to the greatest.
#[derive(Clone, Copy)]
struct Cone<T> {
    least: T,
    greatest: T,
}

impl Run {
    fn new(first: Interval) -> Self {
        Self {
            start_s: first.time_s[0],
            end_s: first.time_s[1],
            ends_px: first.at_px,
            brightness: first.light_lx_px2,
            velocity: Cone { least: DVec2::NEG_INFINITY, greatest: DVec2::INFINITY },
            fading: Cone { least: f64::NEG_INFINITY, greatest: f64::INFINITY },
            narrowest_px: first.sigma_px,
            widest_px: first.sigma_px,
            light: first.light(),
            light_sigma: first.light() * first.sigma_px,
        }
    }

    /// Adds the interval if the run stays straight and even with it.
    fn takes(&mut self, next: &Interval, tolerance_px: f64) -> bool {
        let [first, here] = self.brightness;
        let slack = UNEVENNESS * tolerance_px * first.max(here);
        let follows = next.time_s[0] == self.end_s && next.at_px[0] == self.ends_px[1];
        if !follows || (next.light_lx_px2[0] - here).abs() > slack {
            return false;
        }
        let narrowest_px = self.narrowest_px.min(next.sigma_px);
        let widest_px = self.widest_px.max(next.sigma_px);
        if widest_px > narrowest_px * (1.0 + UNEVENNESS * tolerance_px) {
            return false;
        }

        // The sample where the run ended is skipped if the next interval joins: it bounds the
        // slopes from the first sample. The place on each axis is bounded by the side of the square
        // inside the circle of the tolerance.
        let (elapsed_s, whole_s) = (self.end_s - self.start_s, next.time_s[1] - self.start_s);
        let fading = Cone {
            least: self.fading.least.max((here - slack - first) / elapsed_s),
            greatest: self.fading.greatest.min((here + slack - first) / elapsed_s),
        };
        let fades = (next.light_lx_px2[1] - first) / whole_s;
        let off = DVec2::splat(tolerance_px * std::f64::consts::FRAC_1_SQRT_2);
        let moved = self.ends_px[1] - self.ends_px[0];
        let velocity = Cone {
            least: self.velocity.least.max((moved - off) / elapsed_s),
            greatest: self.velocity.greatest.min((moved + off) / elapsed_s),
        };
        let moves = (next.at_px[1] - self.ends_px[0]) / whole_s;
        let straight = moves.cmpge(velocity.least).all() && moves.cmple(velocity.greatest).all();
        if !straight || !(fading.least..=fading.greatest).contains(&fades) {
            return false;
        }

        (self.velocity, self.fading) = (velocity, fading);
        self.end_s = next.time_s[1];
        self.ends_px[1] = next.at_px[1];
        self.brightness[1] = next.light_lx_px2[1];
        (self.narrowest_px, self.widest_px) = (narrowest_px, widest_px);
        self.light += next.light();
        self.light_sigma += next.light() * next.sigma_px;
        true
    }

    fn segment(&self, share: f64) -> Segment {
        let [first, last] = self.brightness;
        Segment {
            ends_px: self.ends_px,
            sigma_px: self.light_sigma / self.light,
            light_lx_s: share * self.light,
            ramp: (last - first) / (last + first),
            start_s: self.start_s,
            duration_s: self.end_s - self.start_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wobbling way with a pause in the middle.
    fn way() -> Vec<Interval> {
        let at = |t: f64| {
            let pause = t.clamp(1.0, 1.5);
            DVec2::new(80.0 * (t - pause) + 3.0, 5.0 * libm::sin(7.0 * (t - pause)) + 9.0)
        };
        (0..1000)
            .map(|i| {
                let time_s = [f64::from(i) / 400.0, f64::from(i + 1) / 400.0];
                let light_lx_px2 = time_s.map(|t| 400.0 + 8.0 * libm::sin(t));
                Interval { time_s, at_px: time_s.map(at), light_lx_px2, sigma_px: 1.5 }
            })
            .collect()
    }

    fn merged(intervals: &[Interval], tolerance_px: f64) -> Vec<Segment> {
        let mut segments = Vec::new();
        merge(intervals.iter().copied(), 1.0, tolerance_px, &mut segments);
        segments
    }

    #[test]
    fn no_skipped_sample_is_farther_from_its_segment_than_the_tolerance() {
        let intervals = way();
        for tolerance_px in [0.002, 0.005, 0.1] {
            let segments = merged(&intervals, tolerance_px);
            assert!(segments.len() < intervals.len() / 2, "{} segments", segments.len());

            // Walks the intervals along the segments; a segment ends on a sample.
            let mut first = 0;
            for segment in &segments {
                let [start, end] = segment.ends_px;
                assert_eq!(intervals[first].at_px[0], start, "segments follow each other");
                // The pause ends where it begins: take the last interval that fits the light.
                let mut light = 0.0;
                let mut last = first;
                while light < segment.light_lx_s - 1e-9 {
                    light += intervals[last].light();
                    last += 1;
                }
                assert_eq!(intervals[last - 1].at_px[1], end, "segments end on a sample");
                let (t0, t1) = (intervals[first].time_s[0], intervals[last - 1].time_s[1]);
                for skipped in &intervals[first..last] {
                    let share = (skipped.time_s[0] - t0) / (t1 - t0);
                    let off = (skipped.at_px[0] - start.lerp(end, share)).length();
                    assert!(off <= tolerance_px * (1.0 + 1e-9), "{off} px off");
                }
                first = last;
            }
            assert_eq!(first, intervals.len(), "all intervals are in a segment");
        }
    }

    #[test]
    fn tolerance_zero_merges_nothing() {
        assert_eq!(merged(&way(), 0.0).len(), 1000, "one segment an interval");
    }

    #[test]
    fn a_step_in_brightness_ends_a_segment() {
        let mut intervals = way();
        for interval in &mut intervals {
            interval.at_px = [DVec2::ZERO; 2];
            interval.light_lx_px2 = if interval.time_s[0] < 1.0 { [1.0; 2] } else { [1.01; 2] };
        }
        assert_eq!(merged(&intervals, 0.005).len(), 2, "before and after the step");
        assert_eq!(merged(&intervals, 0.1).len(), 1, "the step is within the tolerance");
    }

    #[test]
    fn a_fade_is_one_segment_and_its_parts_add_up() {
        let mut intervals = way();
        for interval in &mut intervals {
            interval.at_px = [DVec2::ZERO; 2];
            interval.light_lx_px2 = interval.time_s.map(|t| 3.0 - t);
        }
        let segments = merged(&intervals, 0.005);
        assert_eq!(segments.len(), 1, "3 to 0.5 lx px2 in 2.5 s");
        assert!((segments[0].light_lx_s - 4.375).abs() < 1e-9, "{:?}", segments[0]);
        assert!((segments[0].ramp + 2.5 / 3.5).abs() < 1e-12, "{:?}", segments[0]);

        let halves = [[0.0, 0.5], [0.5, 1.0]].map(|part| segments[0].part(part));
        assert!((halves[0].light_lx_s - 1.25 * 2.375).abs() < 1e-9, "{halves:?}");
        assert!((halves[1].light_lx_s - 1.25 * 1.125).abs() < 1e-9, "{halves:?}");
        assert!((halves[1].ramp + 1.25 / 2.25).abs() < 1e-9, "{halves:?}");
    }
}
