//! Repairs times: undoes wraps, drops times that do not increase, and corrects slow clocks.

use super::ImportOptions;
use super::recording::{Block, Clock, Recording};
use noctograph_core::crazyflie::{Release, SLOW_CLOCK};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};
use noctograph_core::statistics::median;

/// Minimum backward step of a clock that counts as a restart, unless it is a wrap.
const RESTART_S: f64 = 1.0;

/// Minimum number of backward steps that count as disorder. Fewer are spikes.
const MIN_FALLS: usize = 10;

/// Latest valid time, about 30,000 years.
const LATEST_S: f64 = 1e12;

/// Repairs a log's times: they increase in every block, on one time axis in true seconds.
///
/// # Errors
///
/// Returns [`Error::Input`] if the rows are not in order of time.
pub(super) fn repaired(mut log: Recording, options: &ImportOptions) -> Result<Recording> {
    for block in &mut log.blocks {
        check_order(block, &log.file)?;
        let wrap_s = log.wrap_s.filter(|_| block.clock == Clock::Drone);
        repair_block(block, wrap_s, &mut log.warnings);
    }
    log.blocks.retain(|block| !block.time_s.is_empty());
    if let Some(wrap_s) = log.wrap_s {
        join_wraps(&mut log.blocks, wrap_s);
    }
    // The rate is measured on the steps of repaired blocks.
    let clock_ratio = options.clock_ratio.unwrap_or_else(|| clock_rate(&mut log, options.firmware));
    for block in log.blocks.iter_mut().filter(|block| block.clock == Clock::Drone) {
        block.time_s.iter_mut().for_each(|time_s| *time_s /= clock_ratio);
    }
    Ok(log)
}

/// Returns [`Error::Input`] for rows out of order, except for a few wraps, restarts or spikes.
fn check_order(block: &Block, file: &str) -> Result<()> {
    let n = block.time_s.len();
    if n > 2 && block.time_s.iter().all(|time_s| *time_s == block.time_s[0]) {
        let (same, hint) = (format!("{n} equal times"), "write the times with all digits");
        return Err(Error::input(file, same, "times that rise", hint));
    }
    let falls = block.time_s.windows(2).filter(|pair| pair[1] < pair[0]).count();
    if falls < MIN_FALLS || falls <= n / 4 {
        return Ok(());
    }
    let disorder = format_args!("{falls} of {n} times earlier than in the row above");
    Err(Error::input(file, disorder, "rows in the order of their times", "sort the rows by time"))
}

/// Undoes a block's wraps, and drops spikes, all but the longest stretch between restarts, and rows
/// whose time does not increase. Each repair adds a warning. `wrap_s` is the time after which the
/// clock begins again at zero, if it does.
fn repair_block(block: &mut Block, wrap_s: Option<f64>, warnings: &mut Vec<Diagnostic>) {
    let time_s = &mut block.time_s;
    let n = time_s.len();
    let mut repairs = Vec::new();

    // Spikes are dropped first, because a spike just before a wrap would hide the wrap.
    let finite = (0..n).filter(|&i| time_s[i].abs() < LATEST_S).collect();
    let mut kept = without_spikes(time_s, finite);
    let wraps = wrap_s.map_or(0, |wrap_s| undo_wraps(time_s, &kept, wrap_s));
    if let Some(wrap_s) = wrap_s.filter(|_| wraps > 0) {
        let text =
            format!("the clock wrapped {wraps} time(s) after {wrap_s} s, which is corrected");
        repairs.push(("clock-wrapped", text));
    }

    // The remaining backward steps are restarts. The longest stretch between them is the flight.
    let (n_stretches, longest) = longest_stretch(time_s, &kept);
    let outside = kept.len() - longest.len();
    if n_stretches > 1 {
        let text = format!(
            "the clock restarts {} time(s): only the longest stretch, samples {} to {} of {n}, \
             is kept",
            n_stretches - 1,
            longest[0] + 1,
            longest[longest.len() - 1] + 1,
        );
        repairs.push(("clock-restarted", text));
    }
    kept = only_rising(time_s, longest);
    let dropped = n - outside - kept.len();
    if dropped > 0 {
        repairs.push(("times-dropped", dropped_text(dropped, &kept, n)));
    }
    if kept.len() < n {
        let columns = block.columns.iter_mut().map(|column| &mut column.values);
        for values in columns.chain([time_s]) {
            *values = kept.iter().map(|&i| values[i]).collect();
        }
    }
    warnings.extend(
        repairs
            .into_iter()
            .map(|(code, text)| Diagnostic::warning(code, format!("block {}: {text}", block.name))),
    );
}

/// Returns the text of the warning about the number of dropped samples. `kept` contains the sorted
/// indices of those among `n` samples that are kept.
fn dropped_text(dropped: usize, kept: &[usize], n: usize) -> String {
    let start = kept.first().map_or(0, |first| *first);
    let first = (start..n).find(|i| kept.binary_search(i).is_err()).unwrap_or(0) + 1;
    format!(
        "{dropped} of {n} samples are dropped, because their timestamps do not increase (first: \
         sample {first})"
    )
}

/// Removes the indices of times that do not exceed all earlier ones.
fn only_rising(time_s: &[f64], mut indices: Vec<usize>) -> Vec<usize> {
    let mut latest_s = f64::NEG_INFINITY;
    indices.retain(|&i| {
        let rises = time_s[i] > latest_s;
        latest_s = latest_s.max(time_s[i]);
        rises
    });
    indices
}

/// Returns the number of stretches between restarts, and the indices of the longest stretch among
/// the indices `kept`. The duration of a stretch is measured to its latest time, so that repeated
/// zeros after the end of a log do not shorten it.
fn longest_stretch(time_s: &[f64], kept: &[usize]) -> (usize, Vec<usize>) {
    let stretches = kept.chunk_by(|a, b| time_s[*b] >= time_s[*a] - RESTART_S);
    let timed = stretches.clone().map(|stretch| {
        let latest_s = stretch.iter().map(|&i| time_s[i]).fold(f64::NEG_INFINITY, f64::max);
        (latest_s - time_s[stretch[0]], stretch)
    });
    let longest = timed.max_by(|(a_s, a), (b_s, b)| a_s.total_cmp(b_s).then(a.len().cmp(&b.len())));
    (stretches.count(), longest.map(|(_, stretch)| stretch.to_vec()).unwrap_or_default())
}

/// Removes the indices of isolated times that are later than the next one.
fn without_spikes(time_s: &[f64], indices: Vec<usize>) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::with_capacity(indices.len());
    for (place, &i) in indices.iter().enumerate() {
        let next_s = indices.get(place + 1).map(|&next| time_s[next]);
        let neighbors_s = kept.last().map(|&before| time_s[before]).zip(next_s);
        if !neighbors_s.is_some_and(|(before_s, next_s)| before_s < next_s && next_s < time_s[i]) {
            kept.push(i);
        }
    }
    kept
}

/// Adds `wrap_s` to the times at the indices `kept`, after each backward step of more than half of
/// it. Returns the number of wraps.
fn undo_wraps(time_s: &mut [f64], kept: &[usize], wrap_s: f64) -> u32 {
    let (mut wraps, mut last_s) = (0, f64::NEG_INFINITY);
    for &i in kept {
        let raw_s = time_s[i];
        if raw_s < last_s - 0.5 * wrap_s {
            wraps += 1;
        }
        last_s = raw_s;
        time_s[i] = raw_s + f64::from(wraps) * wrap_s;
    }
    wraps
}

/// Adds a wrap to blocks that began just after one, so that all blocks have the same clock.
fn join_wraps(blocks: &mut [Block], wrap_s: f64) {
    let mut drone = Vec::from_iter(blocks.iter_mut().filter(|block| block.clock == Clock::Drone));
    let latest_s = drone.iter().map(|block| block.time_s[0]).fold(f64::NEG_INFINITY, f64::max);
    for block in &mut drone {
        if block.time_s[0] < latest_s - 0.5 * wrap_s {
            block.time_s.iter_mut().for_each(|time_s| *time_s += wrap_s);
        }
    }
}

/// Returns the seconds of the drone's clock per true second. For a µSD log this is the rate that
/// its times indicate, otherwise that of its firmware or of `assumed`. Warns of guesses. Other logs
/// have a true clock.
fn clock_rate(log: &mut Recording, assumed: Option<Release>) -> f64 {
    if !log.is_on_card {
        return 1.0;
    }
    let named = log.firmware.as_deref().and_then(|name| Some((Release::parse(name)?, name)));
    let shown = log.blocks.iter().find_map(|block| Some((shown_rate(block)?, &block.name)));
    // A measured rate takes precedence over a named firmware's, and an assumed rate comes last.
    // A rate is odd if it is a guess or contradicts the named firmware.
    let (rate, is_odd, why) = match (shown, named) {
        (Some((rate, block)), None) => {
            (rate, false, format!("as the period of block {block} shows"))
        }
        (Some((rate, block)), Some((release, firmware))) => {
            let is_odd = rate != release.clock();
            let odd = if is_odd { ", unlike in firmware " } else { " and in firmware " };
            let why = format!("as the period of block {block} shows{odd}{firmware}, which flew");
            (rate, is_odd, why)
        }
        // In version 1 the times are the system's milliseconds, unless they indicate otherwise.
        (None, _) if log.wrap_s.is_some() => return 1.0,
        (None, Some((release, firmware))) => {
            (release.clock(), false, format!("as that of firmware {firmware}, which flew"))
        }
        (None, None) => {
            let release = assumed.unwrap_or(Release::MODELED);
            let why = format!(
                "as that of firmware {} (vehicle.firmware), which is a guess, because no period of \
                 the log shows the rate and the log names no firmware",
                release.name()
            );
            (release.clock(), true, why)
        }
    };
    let runs = match rate {
        1.0 => "is true".to_owned(),
        _ => format!("runs at 84/85 = {SLOW_CLOCK:.4} of true time"),
    };
    let mended = if rate == 1.0 { "" } else { "; stretched to true seconds" };
    if rate != 1.0 || is_odd {
        log.warn("clock-rate", format!("the drone's clock {runs}, {why}{mended}"));
    }
    rate
}

/// Returns the clock rate that a block's times indicate, or `None` if the block has no usual
/// period. The card is written at true ticks of the system, but with times of the drone's clock.
fn shown_rate(block: &Block) -> Option<f64> {
    /// Usual periods.
    const PERIODS_S: [f64; 9] = [0.001, 0.002, 0.004, 0.005, 0.01, 0.02, 0.025, 0.05, 0.1];
    /// Maximum deviation of the mean step, as a fraction of a usual period.
    const TOLERANCE: f64 = 0.004;
    /// Steps within this fraction of the median are averaged.
    const SPREAD: f64 = 0.3;
    /// With fewer steps the rate is unknown.
    const MIN_STEPS: usize = 50;
    let steps: Vec<f64> = block.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let median_s = median(steps.iter().copied())?;
    let usual = steps.iter().filter(|step| (*step / median_s - 1.0).abs() < SPREAD);
    let mean_s = usual.clone().sum::<f64>() / usual.count().max(1) as f64;
    let rate = [SLOW_CLOCK, 1.0]
        .into_iter()
        .find(|rate| PERIODS_S.iter().any(|period_s| (mean_s / period_s - rate).abs() < TOLERANCE));
    rate.filter(|_| steps.len() >= MIN_STEPS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Column;
    use crate::tests::said;

    fn settled(stamps: &[f64], wrap_s: Option<f64>) -> (Vec<f64>, Vec<f64>, usize) {
        let values = (0_u32..).map(f64::from).take(stamps.len()).collect();
        let columns = vec![Column::new("a".into(), values)];
        let block = Block { time_s: stamps.to_vec(), columns, ..Block::default() };
        let recording = Recording { blocks: vec![block], wrap_s, ..Recording::default() };
        let mut recording = repaired(recording, &ImportOptions::default()).unwrap();
        let block = recording.blocks.pop().unwrap();
        (block.time_s, block.columns[0].values.clone(), recording.warnings.len())
    }

    #[test]
    fn good_stamps_stay_as_they_are() {
        assert_eq!(settled(&[1.0, 2.0, 3.0], None), (vec![1.0, 2.0, 3.0], vec![0.0, 1.0, 2.0], 0));
    }

    #[test]
    fn a_wrap_goes_on_and_duplicates_and_spikes_are_dropped() {
        let (time_s, _, warnings) = settled(&[98.0, 99.0, 0.5, 1.5], Some(100.0));
        assert_eq!((time_s, warnings), (vec![98.0, 99.0, 100.5, 101.5], 1));
        let (time_s, values, _) = settled(&[1.0, 1.0, 1.2, 900.0, 1.4, 1.3, 1.6], None);
        assert_eq!((time_s, values), (vec![1.0, 1.2, 1.3, 1.6], vec![0.0, 2.0, 5.0, 6.0]));
    }

    #[test]
    fn rows_in_no_order_of_time_are_refused() {
        let time_s = (0..100).map(|i| f64::from(i * 37 % 100)).collect();
        let block = Block { time_s, ..Block::default() };
        let recording = Recording { blocks: vec![block], ..Recording::default() };
        let error = repaired(recording, &ImportOptions::default()).unwrap_err();
        assert!(
            error.to_string().contains("36 of 100 times earlier than in the row above"),
            "{error}"
        );
    }

    #[test]
    fn after_a_restart_the_longest_stretch_is_kept() {
        let (time_s, _, warnings) = settled(&[50.0, 51.0, 1.0, 2.0, 3.0], None);
        assert_eq!((time_s, warnings), (vec![1.0, 2.0, 3.0], 1));
    }

    #[test]
    fn zeros_after_the_end_are_no_stretch_however_many_they_are() {
        let flight = (0..100).map(|i| 40.0 + 0.02 * f64::from(i));
        let stamps: Vec<f64> = flight.chain(std::iter::repeat_n(0.0, 500)).collect();
        let (time_s, _, warnings) = settled(&stamps, None);
        assert_eq!((time_s.len(), time_s[0]), (100, 40.0));
        assert!(warnings > 0, "and they are named");
        // The stretch with fewer samples but a longer duration is the flight.
        let slow = (0..20).map(|i| 40.0 + 0.5 * f64::from(i));
        let stamps: Vec<f64> = slow.chain((0..200).map(|i| 0.01 * f64::from(i))).collect();
        assert_eq!(settled(&stamps, None).0.len(), 20);
    }

    #[test]
    fn a_block_that_starts_after_the_wrap_joins_the_others() {
        let block = |time_s: Vec<f64>| Block { time_s, ..Block::default() };
        let blocks = vec![block(vec![99.0, 1.0]), block(vec![0.5, 1.5])];
        let recording = Recording { blocks, wrap_s: Some(100.0), ..Recording::default() };
        let recording = repaired(recording, &ImportOptions::default()).unwrap();
        assert_eq!(recording.blocks[1].time_s, [100.5, 101.5]);
    }

    /// Returns the factor by which the times of a log on the card are stretched, and its warnings.
    /// `period_s` is the log's period.
    fn on_card(period_s: f64, firmware: Option<&str>, options: &ImportOptions) -> (f64, String) {
        // The times of events have no period.
        let uneven = |i: u32| if period_s == 0.0 { 0.013 * libm::sqrt(f64::from(i)) } else { 0.0 };
        let time_s = (0..200).map(|i| f64::from(i) * period_s + uneven(i)).collect();
        let blocks = vec![Block { time_s, ..Block::default() }];
        let firmware = firmware.map(str::to_owned);
        let log = Recording { blocks, is_on_card: true, firmware, ..Recording::default() };
        let stamped_s = log.blocks[0].time_s[199];
        let log = repaired(log, options).unwrap();
        (log.blocks[0].time_s[199] / stamped_s, said(&log))
    }

    #[test]
    fn the_clock_of_a_card_is_that_which_its_stamps_show() {
        let options = ImportOptions::default();
        let (stretched, said) = on_card(0.00988, None, &options);
        assert!(
            (stretched - 85.0 / 84.0).abs() < 1e-12 && said.contains("84/85 = 0.9882"),
            "{said}"
        );
        assert_eq!(on_card(0.01, None, &options), (1.0, String::new()));
        assert_eq!(on_card(0.01, Some("2027.01"), &options), (1.0, String::new()));
        let (stretched, said) = on_card(0.01, Some("2025.12"), &options);
        assert!(stretched == 1.0 && said.contains("unlike in firmware 2025.12"), "{said}");
        let told = ImportOptions { clock_ratio: Some(1.0), ..options };
        assert_eq!(on_card(0.00988, None, &told), (1.0, String::new()), "as told");
    }

    #[test]
    fn without_a_period_the_release_decides_and_a_guess_is_said() {
        let with = |firmware| ImportOptions { firmware, ..ImportOptions::default() };
        let (stretched, said) = on_card(0.0, Some("2025.12"), &with(None));
        assert!(stretched > 1.01 && said.contains("firmware 2025.12, which flew"), "{said}");
        let newest = Some(Release::After2026_08);
        let (stretched, said) = on_card(0.0, Some("2025.12"), &with(newest));
        assert!(stretched > 1.01 && said.contains("2025.12"), "the log knows better: {said}");
        let (stretched, said) = on_card(0.0, None, &with(newest));
        assert!(stretched == 1.0 && said.contains("is true") && said.contains("a guess"), "{said}");
        let (stretched, said) = on_card(0.0, None, &with(None));
        assert!(
            stretched > 1.01 && said.contains("2026.08 (vehicle.firmware), which is a guess"),
            "{said}"
        );
    }

    #[test]
    fn a_radio_log_and_an_old_card_are_stamped_by_true_ticks() {
        let block = Block { time_s: vec![84.0, 168.0], ..Block::default() };
        let firmware = Some("2025.12".to_owned());
        let log = Recording { blocks: vec![block], firmware, ..Recording::default() };
        let mut log = repaired(log, &ImportOptions::default()).unwrap();
        assert_eq!((log.blocks[0].time_s[1], log.warnings.len()), (168.0, 0));
        (log.is_on_card, log.wrap_s) = (true, Some(4e6));
        let log = repaired(log, &ImportOptions::default()).unwrap();
        assert_eq!((log.blocks[0].time_s[1], log.warnings.len()), (168.0, 0), "version 1");
        let told = ImportOptions { clock_ratio: Some(SLOW_CLOCK), ..ImportOptions::default() };
        let log = repaired(log, &told).unwrap();
        assert!((log.blocks[0].time_s[1] - 170.0).abs() < 1e-9, "{:?}", log.blocks[0].time_s);
    }
}
