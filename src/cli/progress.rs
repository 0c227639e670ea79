//! Progress of work that takes longer than a second, where stderr is a terminal.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::shoot::Stage;

/// A bar for work that reports its progress.
#[derive(Debug)]
pub(super) struct Progress {
    what: &'static str,
    start: Instant,
    bar: Option<ProgressBar>,
}

const STEPS: u64 = 1000;

/// Work up to this long shows no progress.
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

    /// Shows the fraction of the work that is done, 0 to 1.
    pub(super) fn update(&mut self, done_frac: f64) {
        if self.bar.is_none() {
            let late = self.start.elapsed() > PATIENCE;
            if !late || !std::io::stderr().is_terminal() {
                return;
            }
            let style = ProgressStyle::with_template("{msg:10} {bar:50} {percent:>3} % {eta:>5}");
            let bar = ProgressBar::new(STEPS).with_message(self.what);
            self.bar = Some(bar.with_style(style.expect("the template is fixed")));
        }
        if let Some(bar) = &self.bar {
            #[expect(clippy::cast_possible_truncation, reason = "0..=STEPS")]
            bar.set_position((done_frac.clamp(0.0, 1.0) * 1000.0) as u64);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// A spinner for work that does not report its progress.
#[derive(Debug)]
pub(super) struct Busy {
    /// Closed when the work is done.
    work: Option<Sender<()>>,
    spinner: Option<JoinHandle<()>>,
}

impl Busy {
    pub(super) fn new(what: &'static str) -> Self {
        if !std::io::stderr().is_terminal() {
            return Self { work: None, spinner: None };
        }
        let (work, done) = channel();
        let spin = move || {
            if done.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                let spinner = ProgressBar::new_spinner().with_message(what);
                spinner.enable_steady_tick(Duration::from_millis(100));
                let _ = done.recv();
                spinner.finish_and_clear();
            }
        };
        // Without a thread there is no spinner.
        Self { work: Some(work), spinner: std::thread::Builder::new().spawn(spin).ok() }
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        self.work = None;
        if let Some(spinner) = self.spinner.take() {
            let _ = spinner.join();
        }
    }
}

/// Shows the progress of a shoot.
pub(super) fn watch() -> impl Fn(Stage, f64) + Sync {
    let shown: Mutex<(Option<Progress>, Option<Busy>)> = Mutex::new((None, None));
    move |stage, done| {
        let Ok(mut shown) = shown.lock() else { return };
        match stage {
            Stage::Flying => shown.0.get_or_insert_with(|| Progress::new("flying")).update(done),
            Stage::Exposing if done < 1.0 => *shown = (None, Some(Busy::new("exposing"))),
            Stage::Exposing => *shown = (None, None),
        }
    }
}
