//! Fewer, longer segments: neighbouring intervals that run straight and even become one.
//!
//! Greedy and linear in time: an interval joins the run while the chord from the run's first
//! sample to its last, walked at constant speed, passes every sample between within the
//! tolerance, and while brightness and spot width stay even. For every sample this bounds the
//! chord's velocity from both sides, so that one comparison an interval is enough. The merged
//! segment carries the exact sum of the light.

use glam::DVec2;

use super::project::Interval;

/// A straight stretch of trail, lit evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    /// Both ends, in px.
    pub(super) ends_px: [DVec2; 2],
    /// Standard deviation of the spot.
    pub(super) sigma_px: f64,
    /// Light in each color channel, in lx s px².
    pub(super) light: [f64; 3],
    /// When the lamp is at the first end.
    pub(super) start_s: f64,
}

/// Brightness and spot width within a merged segment vary by this share of themselves for every
/// pixel of tolerance: less makes more segments where the light ramps; at 1, a ramp's error would
/// be ten times that of the place.
const UNEVENNESS: f64 = 0.2;

/// Joins the intervals of one lamp; `tolerance_px` 0 joins nothing.
///
/// Every skipped sample lies within `tolerance_px` of where the segment is at that time; brightness
/// and spot width within a segment are even to [`UNEVENNESS`].
pub(super) fn merge(
    intervals: impl Iterator<Item = Interval>,
    rgb: [f64; 3],
    tolerance_px: f64,
    segments: &mut Vec<Segment>,
) {
    let mut open: Option<Run> = None;
    for next in intervals {
        if let Some(run) = &mut open {
            if tolerance_px > 0.0 && run.takes(&next, tolerance_px) {
                continue;
            }
            segments.push(run.segment(rgb));
        }
        open = Some(Run::new(next));
    }
    segments.extend(open.map(|run| run.segment(rgb)));
}

/// Intervals that are one segment so far.
struct Run {
    start_s: f64,
    end_s: f64,
    ends_px: [DVec2; 2],
    /// Velocities that pass every sample before the last closely enough, in px/s.
    slowest: DVec2,
    fastest: DVec2,
    /// Range of the brightness, in lx px².
    dimmest: f64,
    brightest: f64,
    /// Range of the spot's width.
    narrowest_px: f64,
    widest_px: f64,
    light: f64,
    /// Sum of light times width.
    light_sigma: f64,
}

impl Run {
    fn new(first: Interval) -> Self {
        let brightness = brightness(&first);
        Self {
            start_s: first.time_s[0],
            end_s: first.time_s[1],
            ends_px: first.at_px,
            slowest: DVec2::NEG_INFINITY,
            fastest: DVec2::INFINITY,
            dimmest: brightness,
            brightest: brightness,
            narrowest_px: first.sigma_px,
            widest_px: first.sigma_px,
            light: first.light,
            light_sigma: first.light * first.sigma_px,
        }
    }

    /// Adds the interval if the run stays straight and even with it.
    fn takes(&mut self, next: &Interval, tolerance_px: f64) -> bool {
        if next.time_s[0] != self.end_s || next.at_px[0] != self.ends_px[1] {
            return false;
        }
        let even = 1.0 + UNEVENNESS * tolerance_px;
        let dimmest = self.dimmest.min(brightness(next));
        let brightest = self.brightest.max(brightness(next));
        let narrowest_px = self.narrowest_px.min(next.sigma_px);
        let widest_px = self.widest_px.max(next.sigma_px);
        if brightest > dimmest * even || widest_px > narrowest_px * even {
            return false;
        }

        // The sample where the run ended is skipped if the next interval joins: it bounds the
        // velocity on each axis by the side of the square inside the circle of the tolerance.
        let slack = DVec2::splat(tolerance_px * std::f64::consts::FRAC_1_SQRT_2);
        let start = self.ends_px[0];
        let elapsed_s = self.end_s - self.start_s;
        let slowest = self.slowest.max((self.ends_px[1] - slack - start) / elapsed_s);
        let fastest = self.fastest.min((self.ends_px[1] + slack - start) / elapsed_s);
        let velocity = (next.at_px[1] - start) / (next.time_s[1] - self.start_s);
        if !(velocity.cmpge(slowest).all() && velocity.cmple(fastest).all()) {
            return false;
        }

        self.end_s = next.time_s[1];
        self.ends_px[1] = next.at_px[1];
        (self.slowest, self.fastest) = (slowest, fastest);
        (self.dimmest, self.brightest) = (dimmest, brightest);
        (self.narrowest_px, self.widest_px) = (narrowest_px, widest_px);
        self.light += next.light;
        self.light_sigma += next.light * next.sigma_px;
        true
    }

    fn segment(&self, rgb: [f64; 3]) -> Segment {
        Segment {
            ends_px: self.ends_px,
            sigma_px: self.light_sigma / self.light,
            light: rgb.map(|share| share * self.light),
            start_s: self.start_s,
        }
    }
}

/// Mean brightness of an interval, in lx px².
fn brightness(interval: &Interval) -> f64 {
    interval.light / (interval.time_s[1] - interval.time_s[0])
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
                let light = 1.0 + 0.02 * libm::sin(time_s[0]);
                Interval { time_s, at_px: time_s.map(at), light, sigma_px: 1.5 }
            })
            .collect()
    }

    fn merged(intervals: &[Interval], tolerance_px: f64) -> Vec<Segment> {
        let mut segments = Vec::new();
        merge(intervals.iter().copied(), [1.0; 3], tolerance_px, &mut segments);
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
                while light < segment.light[0] - 1e-9 {
                    light += intervals[last].light;
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
            interval.light = if interval.time_s[0] < 1.0 { 1.0 } else { 1.01 };
        }
        assert_eq!(merged(&intervals, 0.005).len(), 2, "before and after the step");
        assert_eq!(merged(&intervals, 0.1).len(), 1, "the step is within the tolerance");
    }
}
