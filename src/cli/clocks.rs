//! The clocks of range logs and references: kept where they are one, estimated where they are not.

use std::path::PathBuf;

use clap::ValueEnum;
use nalgebra::Vector3;
use serde::Serialize;

use super::{Error, Result, warn};
use crate::flight::Flight;
use crate::locate::{
    Link, LocateOptions, Located, RangeSample, Reference, locate, log_offset_s, position_error,
    reference_offset_s,
};
use crate::logs::OnClock;

/// A reference that fits this much better at another offset is on another clock.
const BETTER: f64 = 0.5;
/// Offsets nearer than this are the same.
const SAME_S: f64 = 0.02;

/// The clocks that logs are stamped with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Clocks {
    /// One clock, where the stamps are dates, times of day or numbers of a CSV file, and the logs
    /// have time in common; otherwise as separate
    Common,
    /// A clock each: the offset is estimated from the ranges between the drones
    Separate,
}

/// A file with its clock.
pub(super) struct Dated<'a> {
    pub(super) path: &'a PathBuf,
    pub(super) flight: Flight,
    /// Stamp of its time zero, on a clock that other files may share.
    zero_stamp_s: Option<f64>,
    /// Seconds to add to its times.
    pub(super) offset_s: f64,
}

/// What was done with a clock.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Alignment {
    /// File whose clock it is.
    file: PathBuf,
    how: How,
    /// Seconds that were added to the times of the file, which begin at zero in a log.
    offset_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum How {
    Common,
    Estimated,
    Told,
    Alone,
}

impl<'a> Dated<'a> {
    pub(super) fn new(path: &'a PathBuf, found: OnClock) -> Self {
        let OnClock { flight, zero_stamp_s, .. } = found;
        Self { path, flight, zero_stamp_s, offset_s: 0.0 }
    }

    /// First and last stamp.
    fn stamps_s(&self) -> Option<[f64; 2]> {
        let zero_s = self.zero_stamp_s?;
        let (first, last) = self.flight.samples.first().zip(self.flight.samples.last())?;
        Some([zero_s + first.time_s, zero_s + last.time_s])
    }

    /// Seconds from the zero of another file to the zero of this one, where both are stamped by one
    /// clock: their stamps have time in common.
    fn after_s(&self, other: &Self) -> Option<f64> {
        let ([from_s, to_s], [other_from_s, other_to_s]) = (self.stamps_s()?, other.stamps_s()?);
        let overlap = from_s.max(other_from_s) < to_s.min(other_to_s);
        Some(self.zero_stamp_s? - other.zero_stamp_s?).filter(|_| overlap)
    }
}

/// A line on a clock.
pub(super) fn statement(Alignment { file, how, offset_s }: &Alignment) -> String {
    let what = match how {
        How::Common => format!("the clock of the first log, offset {offset_s:+.3} s"),
        How::Estimated => format!("a clock of its own, offset estimated: {offset_s:+.3} s"),
        How::Told => format!("offset {offset_s:+.3} s, with that of --offset"),
        How::Alone => "no range to another drone: the offset of its clock has no effect".to_owned(),
    };
    format!("{}: {what}", file.display())
}

/// Puts the logs and their ranges on one clock: that of the first, its zero at the first sample of
/// all.
pub(super) fn align_logs(
    logs: &mut [Dated<'_>],
    samples: &mut [Vec<RangeSample>],
    clocks: Clocks,
    anchors_m: &[Vector3<f64>],
    options: &LocateOptions,
) -> Result<Vec<Alignment>> {
    let mut alignments = Vec::new();
    for k in 1..logs.len() {
        let (before, rest) = logs.split_at_mut(k);
        let common_s = rest[0].after_s(&before[0]).filter(|_| clocks == Clocks::Common);
        let has_peers = (0..k).any(|j| !between(samples, j, k).is_empty());
        let (how, offset_s) = match common_s {
            Some(after_s) => (How::Common, after_s),
            None if has_peers => {
                (How::Estimated, estimated_s(before, samples, anchors_m, options)?)
            }
            None => (How::Alone, 0.0),
        };
        rest[0].offset_s = offset_s;
        alignments.push(Alignment { file: rest[0].path.clone(), how, offset_s });
    }
    // No time before zero.
    let begin_s = |log: &Dated<'_>| log.flight.samples.first().map_or(0.0, |s| s.time_s);
    let earliest_s = logs.iter().map(|log| begin_s(log) + log.offset_s).fold(0.0, f64::min);
    for (log, samples) in logs.iter_mut().zip(samples.iter_mut()) {
        log.offset_s -= earliest_s;
        samples.iter_mut().for_each(|sample| sample.time_s += log.offset_s);
    }
    for (alignment, log) in alignments.iter_mut().zip(&logs[1..]) {
        alignment.offset_s = log.offset_s;
    }
    if let Some(first) = logs.first().filter(|first| first.offset_s > 0.0) {
        let (file, offset_s) = (first.path.clone(), first.offset_s);
        alignments.insert(0, Alignment { file, how: How::Common, offset_s });
    }
    Ok(alignments)
}

/// Ranges between two drones: whether the log of the second holds it, when and how far.
fn between(samples: &[Vec<RangeSample>], one: usize, other: usize) -> Vec<(bool, f64, f64)> {
    let links = [Link::Drones(one, other), Link::Drones(other, one)];
    let of = |log: usize| {
        let ranges = samples[log].iter().filter(|sample| links.contains(&sample.link));
        ranges.map(move |sample| (log == other, sample.time_s, sample.distance_m))
    };
    of(one).chain(of(other)).collect()
}

/// Seconds from the clock of the first log to that of the log after `before`, from its ranges to
/// the drone to which it has most.
fn estimated_s(
    before: &[Dated<'_>],
    samples: &[Vec<RangeSample>],
    anchors_m: &[Vector3<f64>],
    options: &LocateOptions,
) -> Result<f64> {
    let k = before.len();
    let peers = (0..k).map(|j| (j, between(samples, j, k)));
    let (j, ranges) = peers.max_by_key(|(_, ranges)| ranges.len()).unwrap_or_default();
    let unknown = |why: String| Error::Infeasible {
        what: format!(
            "logs {} and {} have no clock in common, and their ranges do not tell the seconds \
             between their clocks: {why}",
            j + 1,
            k + 1
        ),
        hint: "stamp the logs with one clock, or log three anchors or more for each drone".into(),
    };
    let alone = |log: usize| {
        let to_anchor = |sample: &RangeSample| match sample.link {
            Link::Anchor { anchor, .. } => {
                Some(RangeSample { link: Link::Anchor { drone: 0, anchor }, ..*sample })
            }
            Link::Drones(..) => None,
        };
        let own: Vec<RangeSample> = samples[log].iter().filter_map(to_anchor).collect();
        locate(anchors_m, 1, &own, options).map_err(|error| unknown(error.to_string()))
    };
    let after_s = log_offset_s(&alone(j)?, &alone(k)?, &ranges)
        .ok_or_else(|| unknown("the range between the drones changes too little".into()))?;
    Ok(before[j].offset_s + after_s)
}

/// Puts the references, one for each log, on the clock of the located positions.
pub(super) fn align_references(
    references: &mut [Dated<'_>],
    logs: &[Dated<'_>],
    located: &Located,
    told_s: &[f64],
) -> Result<Vec<Alignment>> {
    let mut alignments = Vec::new();
    for (drone, (reference, log)) in references.iter_mut().zip(logs).enumerate() {
        let common_s = reference.after_s(log).map(|after_s| after_s + log.offset_s);
        let at_zero = Reference { flight: &reference.flight, offset_s: 0.0 };
        let best_s = reference_offset_s(located, drone, at_zero);
        let (how, offset_s) = match (told_s.get(drone), common_s, best_s) {
            (Some(told_s), common_s, _) => (How::Told, common_s.unwrap_or(log.offset_s) + told_s),
            (None, Some(common_s), _) => (How::Common, common_s),
            (None, None, Some(best_s)) => (How::Estimated, best_s),
            (None, None, None) => {
                let hint = "give the seconds between the two clocks with --offset";
                let wanted = "stamps in common with the log, or positions like the located ones";
                let place = reference.path.display().to_string();
                return Err(Error::input(place, "neither", wanted, hint));
            }
        };
        reference.offset_s = offset_s;
        if let Some(best_s) = best_s.filter(|_| how != How::Estimated) {
            warn_of_better_offset(reference, drone, located, best_s)?;
        }
        alignments.push(Alignment { file: reference.path.clone(), how, offset_s });
    }
    Ok(alignments)
}

/// Warns of a reference that fits far better at another offset.
fn warn_of_better_offset(
    reference: &Dated<'_>,
    drone: usize,
    located: &Located,
    best_s: f64,
) -> Result<()> {
    let rmse_m = |offset_s: f64| {
        let reference = Reference { flight: &reference.flight, offset_s };
        position_error(located, drone, reference).map(|error| error.rmse_3d_m)
    };
    let more_s = best_s - reference.offset_s;
    let (here_m, best_m) = (rmse_m(reference.offset_s)?, rmse_m(best_s)?);
    if more_s.abs() >= SAME_S && best_m <= BETTER * here_m {
        warn([format!(
            "{}: {:.1} cm from the located positions, {:.1} cm with {more_s:+.3} s more: its clock is \
             not that of the log",
            reference.path.display(),
            100.0 * here_m,
            100.0 * best_m
        )]);
    }
    Ok(())
}
