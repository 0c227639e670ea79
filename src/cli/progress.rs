//! Progress bars for long computations, shown only if stderr is a terminal.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

use crate::shoot::Stage;

/// Progress bar for work that takes longer than [`PATIENCE`].
#[derive(Debug)]
pub(super) struct Progress {
    what: &'static str,
    start: Instant,
    bar: Option<ProgressBar>,
}

/// Number of steps of a full bar.
const STEPS: u64 = 1000;
/// Time after which the bar appears.
const PATIENCE: Duration = Duration::from_secs(1);

impl Progress {
    pub(super) fn new(what: &'static str) -> Self {
        Self { what, start: Instant::now(), bar: None }
    }

    /// Sets the text before the bar, such as the best result so far.
    pub(super) fn note(&self, text: String) {
        if let Some(bar) = &self.bar {
            bar.set_message(text);
        }
    }

    /// Shows the fraction of the work that is done, from 0 to 1.
    pub(super) fn update(&mut self, done_frac: f64) {
        // The bar appears only after a delay, so that it does not flash during short work.
        if self.bar.is_none() && self.start.elapsed() > PATIENCE {
            let style = ProgressStyle::with_template("{msg:10} {bar:50} {percent:>3} % {eta:>5}");
            let bar = ProgressBar::new(STEPS).with_message(self.what);
            let bar = bar.with_style(style.expect("the template is fixed"));
            self.bar = Some(bar.with_finish(ProgressFinish::AndClear));
        }
        if let Some(bar) = &self.bar {
            #[expect(clippy::cast_possible_truncation, reason = "0..=STEPS")]
            bar.set_position((done_frac.clamp(0.0, 1.0) * STEPS as f64) as u64);
        }
    }
}

/// Returns a callback that shows the progress of a shoot, given a stage and its finished fraction
/// from 0 to 1. An exposure is shown by a spinner without its fraction. A finished exposure removes
/// the spinner.
pub(super) fn watch() -> impl Fn(Stage, f64) + Sync {
    let shown: Mutex<(Option<Progress>, Option<ProgressBar>)> = Mutex::default();
    move |stage, done| {
        let Ok(mut shown) = shown.lock() else { return };
        match stage {
            Stage::Flying => shown.0.get_or_insert_with(|| Progress::new("flying")).update(done),
            Stage::Exposing if done < 1.0 => {
                let spinner = ProgressBar::new_spinner().with_message("exposing");
                // The spinner is drawn once here, because the system may refuse the thread that
                // animates it.
                spinner.tick();
                *shown = (None, Some(spinner.with_finish(ProgressFinish::AndClear)));
            }
            Stage::Exposing => *shown = (None, None),
        }
    }
}
