//! Workers: processes of their own, in which photos and files are made.
//!
//! One that is too slow, too large or broken is ended and takes nothing with it. It lives as long
//! as its pipe: where the server is killed, it ends by itself, whatever it does. A worker is this
//! program once more (`serve --worker`); jobs and answers are lines of JSON.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::queue::{Doing, Outcome, Queue};
use super::said::{Key, Made, Said};
use super::studio::Studio;
use super::wish::Task;
use super::{Error, Result, json, no_thread, print};
use crate::shoot::Stop;

/// Most memory of a worker, beside its code: what a large picture takes, and a little more.
const MEMORY: u64 = 1 << 30;
/// How often a worker's job is looked after.
const LOOK: Duration = Duration::from_millis(20);
/// Time within which a job that is stopped ends by itself; then its worker is ended.
const STOP_PATIENCE: Duration = Duration::from_millis(300);
/// Longest line of a worker: a photo of 2.5 megapixels in base64.
const MAX_LINE: u64 = 32 << 20;

/// A line to a worker.
#[derive(Debug, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Order {
    Make {
        number: u64,
        task: Task,
        folder: PathBuf,
        /// How many wait behind it.
        n_waiting: usize,
    },
    Stop {
        number: u64,
    },
}

/// A line of a worker.
#[derive(Debug, Deserialize, Serialize)]
struct Answer {
    number: u64,
    made: Made,
}

/// How workers of one kind are started and waited for.
#[derive(Clone, Debug)]
pub(super) struct Lane {
    pub(super) queue: Arc<Queue>,
    /// Arguments of every verb: the scene that the page begins with.
    pub(super) base: Vec<OsString>,
    /// Where folders for jobs are made.
    pub(super) scratch: PathBuf,
    pub(super) patience: Duration,
    /// Whether others go first on the processor.
    pub(super) is_patient: bool,
}

impl Lane {
    /// Does jobs with a worker of its own, one after another, for ever.
    pub(super) fn work(&self) {
        let mut worker = None;
        loop {
            let doing = self.queue.next();
            let outcome = match doing.stop.check() {
                Ok(()) => self.make(&mut worker, &doing),
                Err(_) => Outcome::Stopped,
            };
            self.queue.done(&doing, &outcome);
        }
    }

    fn make(&self, worker: &mut Option<Worker>, doing: &Doing) -> Outcome {
        let folder = tempfile::Builder::new().prefix("job-").tempdir_in(&self.scratch);
        let Ok(folder) = folder else { return Outcome::Failed(Key::DiskFull.into()) };
        if worker.is_none() {
            *worker = self.start().ok();
        }
        let Some(running) = worker else { return Outcome::Failed(Key::Busy.into()) };
        let made = running.make(doing, folder.path(), self.patience).unwrap_or_else(|ended| {
            *worker = None;
            ended
        });
        match made {
            Made::Done(value) => Outcome::Made(Arc::new(value), Arc::new(folder)),
            Made::Failed(said) => Outcome::Failed(said),
            Made::Stopped => Outcome::Stopped,
        }
    }

    fn start(&self) -> std::io::Result<Worker> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["serve", "--worker"]).args(&self.base);
        if self.is_patient {
            command.arg("--patient");
        }
        // A group of its own: the terminal's Ctrl-C is the server's, with which its workers end.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = piped.spawn()?;
        let (sender, answers) = channel();
        let mut lines = BufReader::new(child.stdout.take().expect("it is piped"));
        std::thread::Builder::new().spawn(move || {
            let mut line = Vec::new();
            while (&mut lines).take(MAX_LINE).read_until(b'\n', &mut line).is_ok()
                && let Ok(answer) = serde_json::from_slice(&line)
                && sender.send(answer).is_ok()
            {
                line.clear();
            }
        })?;
        let orders = child.stdin.take().expect("it is piped");
        Ok(Worker { child, orders, answers })
    }
}

/// A worker that runs.
#[derive(Debug)]
struct Worker {
    child: Child,
    orders: ChildStdin,
    answers: Receiver<Answer>,
}

impl Worker {
    /// Makes something; `Err` is what is answered where the worker has to be ended.
    fn make(
        &mut self,
        doing: &Doing,
        folder: &Path,
        patience: Duration,
    ) -> std::result::Result<Made, Made> {
        let Doing { number, n_waiting, ref task, ref stop } = *doing;
        let (task, folder) = (task.clone(), folder.into());
        self.order(&Order::Make { number, task, folder, n_waiting })?;
        let begun = Instant::now();
        let mut told: Option<Instant> = None;
        loop {
            match self.answers.recv_timeout(LOOK) {
                Ok(answer) if answer.number == number => return Ok(answer.made),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(Made::Failed(Key::TooLarge.into()));
                }
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
            }
            if stop.check().is_err() && told.is_none() {
                self.order(&Order::Stop { number })?;
                told = Some(Instant::now());
            }
            if told.is_some_and(|told| told.elapsed() > STOP_PATIENCE) {
                return Err(Made::Stopped);
            }
            if begun.elapsed() > patience {
                let values = json!({ "seconds": patience.as_secs() });
                return Err(Made::Failed(Said::from(Key::TooSlow).with_values(values)));
            }
        }
    }

    fn order(&mut self, order: &Order) -> std::result::Result<(), Made> {
        let line = serde_json::to_string(order).expect("an order is plain data") + "\n";
        let sent = self.orders.write_all(line.as_bytes()).and_then(|()| self.orders.flush());
        sent.map_err(|_gone| Made::Failed(Key::TooLarge.into()))
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The worker's own side: makes what it is told to, until nobody tells it any more.
pub(super) fn run(base: Vec<OsString>, is_patient: bool) -> Result<()> {
    limit(is_patient);
    let doing = Arc::new(Mutex::new((0, Stop::default())));
    let (orders, jobs) = channel();
    let told = doing.clone();
    let listening = std::thread::Builder::new().spawn(move || {
        let lines = std::io::stdin().lines().map_while(|line| line.ok());
        for order in lines.map_while(|line| serde_json::from_str(&line).ok()) {
            let mut doing = told.lock().unwrap_or_else(PoisonError::into_inner);
            match order {
                Order::Stop { number } if number == doing.0 => doing.1.now(),
                Order::Stop { .. } => {}
                Order::Make { number, task, folder, n_waiting } => {
                    *doing = (number, Stop::default());
                    let _ = orders.send((number, task, folder, n_waiting, doing.1.clone()));
                }
            }
        }
        // The server is gone, and nobody wants what is being made.
        std::process::exit(0);
    });
    listening.map_err(no_thread)?;
    let studio = Studio::new(base);
    for (number, task, folder, n_waiting, stop) in jobs {
        // A job has nothing that outlives it: what a panic leaves broken is dropped.
        let done = catch_unwind(AssertUnwindSafe(|| studio.make(&task, &folder, n_waiting, &stop)));
        let made = match done {
            Ok(Ok(made)) => made,
            Ok(Err(Error::Stopped)) => Made::Stopped,
            Ok(Err(error)) => Made::Failed(Said::of_error(&error, task.subject().is_picture())),
            Err(_) => Made::Failed(Key::Broken.into()),
        };
        let line = serde_json::to_string(&Answer { number, made }).expect("it is plain data");
        print(&(line + "\n"))?;
    }
    Ok(())
}

/// Limits the memory of this process, and lets others go first.
#[cfg(unix)]
fn limit(is_patient: bool) {
    use rustix::process::{Resource, Rlimit, setpriority_pgrp, setrlimit};
    let most = Some(MEMORY);
    // Where a system has no such limit, the time limit is what is left.
    let _ = setrlimit(Resource::Data, Rlimit { current: most, maximum: most });
    if is_patient {
        // Of the group: all threads, also those that run already.
        let _ = setpriority_pgrp(None, 5);
    }
}

#[cfg(not(unix))]
fn limit(_: bool) {}
