//! Integrates the known motion of drones.

use nalgebra::Vector3;

/// Motion of a drone, as the displacement since the beginning of its log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    time_s: Vec<f64>,
    moved_m: Vec<Vector3<f64>>,
}

impl Track {
    /// Integrates velocities by the trapezoidal rule, from zero. Each is given as an increasing
    /// time in s and a velocity in the world frame in m/s.
    pub fn new(velocities_m_s: impl IntoIterator<Item = (f64, Vector3<f64>)>) -> Self {
        let (mut track, mut before) = (Self::default(), None);
        for (time_s, velocity_m_s) in velocities_m_s {
            let step_m = before.map_or(Vector3::zeros(), |(then_s, then_m_s)| {
                (velocity_m_s + then_m_s) * (0.5 * (time_s - then_s))
            });
            let last_m = track.moved_m.last().copied().unwrap_or_default();
            track.time_s.push(time_s);
            track.moved_m.push(last_m + step_m);
            before = Some((time_s, velocity_m_s));
        }
        track
    }

    /// Returns the displacement from the start of the track to `time_s`, interpolated linearly
    /// between samples. It is zero before the first sample and constant after the last one.
    pub(super) fn moved_m(&self, time_s: f64) -> Vector3<f64> {
        let after = self.time_s.partition_point(|t| *t <= time_s);
        let Some(before) = after.checked_sub(1) else { return Vector3::zeros() };
        let (a_m, a_s) = (self.moved_m[before], self.time_s[before]);
        let Some((b_m, b_s)) = self.moved_m.get(after).zip(self.time_s.get(after)) else {
            return a_m;
        };
        a_m + (b_m - a_m) * ((time_s - a_s) / (b_s - a_s))
    }
}

/// Returns the displacement of each drone between two times.
pub(super) fn moved_m(tracks: &[Track], from_s: f64, to_s: f64) -> Vec<Vector3<f64>> {
    tracks.iter().map(|track| track.moved_m(to_s) - track.moved_m(from_s)).collect()
}
