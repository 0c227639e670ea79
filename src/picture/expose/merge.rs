//! Merges neighboring intervals that lie on a straight line at constant speed into segments.
//!
//! The algorithm is swinging-door thinning (Bristol 1990), which is greedy and runs in linear time.
//! An interval is added to the run if three quantities stay within tolerance of the chord from the
//! run's first sample to its last: the position at constant speed, the brightness (so that a fade
//! is one segment), and the width of the spot. The light of a segment is the exact sum of the
//! intervals' light.

use super::project::{Interval, Px};
use noctograph_core::geometry::Chords;

/// A straight part of a trail at constant speed, along which the brightness changes evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) ends_px: [Px; 2],
    pub(super) sigma_px: f64,
    /// Half the width and half the height of the blurred rectangle, or 0 for a Gaussian spot.
    pub(super) half_px: Px,
    /// Light of the brightest channel, summed over the pixels.
    pub(super) light_lx_s: f64,
    /// Relative change of the brightness, -1 to 1: from `1 - ramp` to `1 + ramp` times the mean.
    pub(super) ramp: f64,
    pub(super) start_s: f64,
    pub(super) duration_s: f64,
}

impl Segment {
    /// Returns the part between two fractions of the length, 0 to 1, with its part of the light.
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

    /// Returns the length in px.
    pub(super) fn length_px(&self) -> f64 {
        (self.ends_px[1] - self.ends_px[0]).length()
    }

    /// Returns the point halfway along the segment.
    pub(super) fn middle_px(&self) -> Px {
        (self.ends_px[0] + self.ends_px[1]) * 0.5
    }
}

/// Relative error of brightness and spot width per pixel of tolerance. With a smaller value,
/// changing light takes more segments. At 1, ramps would err ten times as much as positions.
const UNEVENNESS: f64 = 0.2;

/// Maximum change of half the width or height of a rectangle per pixel of tolerance. Such a change
/// is due to the camera's height above the lamp, and is visible only at the edge of a stroke.
const HALF_SLACK: f64 = 4.0;

/// Merges the intervals of one lamp and appends the segments. The segments have the light of the
/// brightest channel, which is `fraction` times the lamp's. A `tolerance_px` of 0 merges nothing.
///
/// Each skipped sample is within `tolerance_px` of the position of its segment at that time, and
/// its brightness and spot width are within [`UNEVENNESS`] of the segment's.
pub(super) fn merge(
    intervals: impl Iterator<Item = Interval>,
    fraction: f64,
    tolerance_px: f64,
    segments: &mut Vec<Segment>,
) {
    let mut current: Option<Merged> = None;
    for next in intervals {
        if let Some(run) = &mut current {
            if tolerance_px > 0.0 && run.extend(&next, tolerance_px) {
                continue;
            }
            segments.push(run.segment(fraction));
        }
        current = Some(Merged::new(next));
    }
    segments.extend(current.map(|run| run.segment(fraction)));
}

/// A run of intervals that one segment replaces.
struct Merged {
    /// Interval from the start of the first to the end of the last one, with the values at both.
    span: Interval,
    /// The chords in x, y and brightness that stay within tolerance.
    chords: Chords<3>,
    /// Minimum and maximum of the spot's width, and of the half size of its rectangle.
    sigmas_px: [f64; 2],
    halves_px: [Px; 2],
    light: f64,
    /// Sums of the products of light and width, and of light and half size.
    light_sigma: f64,
    light_half: Px,
}

impl Merged {
    /// Starts a run that consists of one interval.
    fn new(first: Interval) -> Self {
        let light = first.light();
        Self {
            span: first,
            chords: Chords::ALL,
            sigmas_px: [first.sigma_px; 2],
            halves_px: [first.half_px; 2],
            light,
            light_sigma: light * first.sigma_px,
            light_half: light * first.half_px,
        }
    }

    /// Adds the interval if the run stays straight and even with it, within `tolerance_px`. Returns
    /// false if it would not, in which case the run is complete.
    fn extend(&mut self, next: &Interval, tolerance_px: f64) -> bool {
        let [first_light, last_light] = self.span.light_lx_px2;
        let slack = UNEVENNESS * tolerance_px * first_light.max(last_light);
        // A gap, a step in the brightness, or a spot of another size ends the run.
        let is_adjacent =
            next.time_s[0] == self.span.time_s[1] && next.at_px[0] == self.span.at_px[1];
        if !is_adjacent || (next.light_lx_px2[0] - last_light).abs() > slack {
            return false;
        }
        let sigmas_px =
            [self.sigmas_px[0].min(next.sigma_px), self.sigmas_px[1].max(next.sigma_px)];
        if sigmas_px[1] > sigmas_px[0] * (1.0 + UNEVENNESS * tolerance_px) {
            return false;
        }
        let halves_px = [self.halves_px[0].min(next.half_px), self.halves_px[1].max(next.half_px)];
        if (halves_px[1] - halves_px[0]).max_element() > HALF_SLACK * tolerance_px {
            return false;
        }
        if !self.swing_doors(next, slack, tolerance_px) {
            return false;
        }
        self.span.time_s[1] = next.time_s[1];
        self.span.at_px[1] = next.at_px[1];
        self.span.light_lx_px2[1] = next.light_lx_px2[1];
        (self.sigmas_px, self.halves_px) = (sigmas_px, halves_px);
        self.light += next.light();
        self.light_sigma += next.light() * next.sigma_px;
        self.light_half += next.light() * next.half_px;
        true
    }

    /// Narrows the chords to those that pass the last sample, which is skipped if `next` joins the
    /// run. Returns true if the chord to the end of `next` is among them. `slack_light` is the
    /// tolerance of the light, in lx px².
    fn swing_doors(&mut self, next: &Interval, slack_light: f64, tolerance_px: f64) -> bool {
        let [start_s, end_s] = self.span.time_s;
        let [first_light, last_light] = self.span.light_lx_px2;
        // Half the side of a square in the tolerance circle, so that each axis has its own test.
        let slack_px = tolerance_px * std::f64::consts::FRAC_1_SQRT_2;
        let skipped = self.span.at_px[1] - self.span.at_px[0];
        let low =
            [skipped.x - slack_px, skipped.y - slack_px, last_light - slack_light - first_light];
        let high =
            [skipped.x + slack_px, skipped.y + slack_px, last_light + slack_light - first_light];
        self.chords.keep_between(low, high, end_s - start_s);
        let moved = next.at_px[1] - self.span.at_px[0];
        let chord = [moved.x, moved.y, next.light_lx_px2[1] - first_light];
        self.chords.contain(chord, next.time_s[1] - start_s)
    }

    /// Returns the segment of the run, with the light-weighted mean size and the total light.
    fn segment(&self, fraction: f64) -> Segment {
        let [first, last] = self.span.light_lx_px2;
        Segment {
            ends_px: self.span.at_px,
            sigma_px: self.light_sigma / self.light,
            half_px: self.light_half / self.light,
            light_lx_s: fraction * self.light,
            ramp: (last - first) / (last + first),
            start_s: self.span.time_s[0],
            duration_s: self.span.time_s[1] - self.span.time_s[0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a winding path with a pause in the middle.
    fn path() -> Vec<Interval> {
        fn position(t: f64) -> Px {
            let pause = t.clamp(1.0, 1.5);
            Px::new(80.0 * (t - pause) + 3.0, 5.0 * libm::sin(7.0 * (t - pause)) + 9.0)
        }
        (0..1000)
            .map(|i| {
                let time_s = [f64::from(i) / 400.0, f64::from(i + 1) / 400.0];
                let light_lx_px2 = time_s.map(|t| 400.0 + 8.0 * libm::sin(t));
                Interval {
                    time_s,
                    at_px: time_s.map(position),
                    light_lx_px2,
                    sigma_px: 1.5,
                    half_px: Px::ZERO,
                }
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
        let intervals = path();
        for tolerance_px in [0.002, 0.005, 0.1] {
            let segments = merged(&intervals, tolerance_px);
            assert!(segments.len() < intervals.len() / 2, "{} segments", segments.len());

            let mut first = 0;
            for segment in &segments {
                let [start, end] = segment.ends_px;
                assert_eq!(intervals[first].at_px[0], start, "segments follow each other");
                // The pause ends at the position where it starts, so the last interval with the
                // right light is the end.
                let mut light = 0.0;
                let mut last = first;
                while light < segment.light_lx_s - 1e-9 {
                    light += intervals[last].light();
                    last += 1;
                }
                assert_eq!(intervals[last - 1].at_px[1], end, "segments end on a sample");
                let (t0, t1) = (intervals[first].time_s[0], intervals[last - 1].time_s[1]);
                for skipped in &intervals[first..last] {
                    let part = (skipped.time_s[0] - t0) / (t1 - t0);
                    let error_px = (skipped.at_px[0] - start.lerp(end, part)).length();
                    assert!(error_px <= tolerance_px * (1.0 + 1e-9), "{error_px} px off");
                }
                first = last;
            }
            assert_eq!(first, intervals.len(), "all intervals are in a segment");
        }
    }

    #[test]
    fn tolerance_zero_merges_nothing() {
        assert_eq!(merged(&path(), 0.0).len(), 1000, "one segment an interval");
    }

    #[test]
    fn a_step_in_brightness_ends_a_segment() {
        let mut intervals = path();
        for interval in &mut intervals {
            interval.at_px = [Px::ZERO; 2];
            interval.light_lx_px2 = if interval.time_s[0] < 1.0 { [1.0; 2] } else { [1.01; 2] };
        }
        assert_eq!(merged(&intervals, 0.005).len(), 2, "before and after the step");
        assert_eq!(merged(&intervals, 0.1).len(), 1, "the step is within the tolerance");
    }

    #[test]
    fn a_fade_is_one_segment_and_its_parts_add_up() {
        let mut intervals = path();
        for interval in &mut intervals {
            interval.at_px = [Px::ZERO; 2];
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
