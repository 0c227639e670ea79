//! Workers: processes of their own, in which photos and files are made.
//!
//! One that is too slow, too large or broken is ended and takes nothing with it. It lives as long
//! as its pipe: where the server is killed, it ends by itself, whatever it does. A worker is the
//! program once more; jobs and answers are lines of JSON.

use std::io::{BufRead, BufReader, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::queue::{Job, Outcome, Queue};
use super::render::{JobResult, Renderer};
use super::{Program, no_thread};
use noctograph_core::error::{Error, Result};
use noctograph_pipeline::shoot::Stop;
use noctograph_web::messages::{Key, Message};
use noctograph_web::request::Task;

/// Most memory of a worker, beside its code: what a large picture takes, and a little more.
const MEMORY: u64 = 1 << 30;
/// How often a worker's job is looked after.
const POLL: Duration = Duration::from_millis(20);
/// Time within which a job that is stopped ends by itself; then its worker is ended.
const STOP_TIMEOUT: Duration = Duration::from_millis(300);
/// Longest time of a photo while one types, and of a large one: a word that does not read is flown
/// some thirty times for advice. What a wish may ask for is bounded by its work; these end what
/// hangs, and are long enough for a busy machine.
const LIVE_TIMEOUT: Duration = Duration::from_secs(60);
const LARGE_TIMEOUT: Duration = Duration::from_secs(300);
/// Longest line of a worker: a photo of 2.5 megapixels in base64.
const MAX_LINE: u64 = 32 << 20;

/// A line to a worker, which has one job at a time and answers it with a line.
#[derive(Debug, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Order {
    Make {
        task: Task,
        folder: PathBuf,
        /// How many wait behind it.
        n_waiting: usize,
    },
    Stop,
}

/// A worker's place at a queue, whose process is started with its first job.
#[derive(Debug)]
pub(crate) struct WorkerSlot {
    queue: Arc<Queue>,
    program: Program,
    /// Where folders for jobs are made.
    scratch: PathBuf,
    worker: Option<Worker>,
}

impl WorkerSlot {
    /// Starts a thread that does the jobs of a queue, one after another, for ever.
    pub(crate) fn start(queue: &Arc<Queue>, program: Program, scratch: &Path) -> Result<()> {
        let (queue, scratch) = (queue.clone(), scratch.to_owned());
        let mut slot = Self { queue, program, scratch, worker: None };
        let work = move || loop {
            let (job, n_waiting) = slot.queue.next();
            let outcome = slot.make(&job, n_waiting);
            job.done(outcome);
        };
        std::thread::Builder::new().spawn(work).map_err(no_thread)?;
        Ok(())
    }

    fn make(&mut self, job: &Job, n_waiting: usize) -> Outcome {
        let folder = tempfile::Builder::new().prefix("job-").tempdir_in(&self.scratch);
        let Ok(folder) = folder else { return Outcome::Failed(Key::DiskFull.into()) };
        if self.worker.is_none() {
            self.worker = Worker::start(self.program).ok();
        }
        let Some(worker) = &mut self.worker else { return Outcome::Failed(Key::Busy.into()) };
        let result = worker.make(job, folder.path(), n_waiting).unwrap_or_else(|end| {
            self.worker = None;
            end
        });
        match result {
            JobResult::Done(value) => Outcome::Made(value, Arc::new(folder)),
            JobResult::Failed(message) => Outcome::Failed(message),
            JobResult::Stopped => Outcome::Stopped,
        }
    }
}

/// A worker that runs.
#[derive(Debug)]
struct Worker {
    child: Child,
    orders: ChildStdin,
    answers: Receiver<JobResult>,
}

impl Worker {
    fn start(program: Program) -> std::io::Result<Self> {
        let mut command = (program.worker)()?;
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
        Ok(Self { child, orders, answers })
    }

    /// Makes something; `Err` is what is answered where the worker has to be ended.
    fn make(
        &mut self,
        job: &Job,
        folder: &Path,
        n_waiting: usize,
    ) -> std::result::Result<JobResult, JobResult> {
        let (task, folder) = (job.task.clone(), folder.into());
        let timeout = if matches!(task, Task::Live(_)) { LIVE_TIMEOUT } else { LARGE_TIMEOUT };
        self.order(&Order::Make { task, folder, n_waiting })?;
        let begun = Instant::now();
        let mut stopped: Option<Instant> = None;
        loop {
            match self.answers.recv_timeout(POLL) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(JobResult::Failed(Key::TooLarge.into()));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            if job.stop.check().is_err() && stopped.is_none() {
                self.order(&Order::Stop)?;
                stopped = Some(Instant::now());
            }
            if stopped.is_some_and(|stopped| stopped.elapsed() > STOP_TIMEOUT) {
                return Err(JobResult::Stopped);
            }
            if begun.elapsed() > timeout {
                let values = json!({ "seconds": timeout.as_secs() });
                return Err(JobResult::Failed(Message::from(Key::TooSlow).with_values(values)));
            }
        }
    }

    fn order(&mut self, order: &Order) -> std::result::Result<(), JobResult> {
        let line = serde_json::to_string(order).expect("an order is plain data") + "\n";
        let sent = self.orders.write_all(line.as_bytes()).and_then(|()| self.orders.flush());
        sent.map_err(|_gone| JobResult::Failed(Key::TooLarge.into()))
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The worker's own side: makes what it is told to, until nobody tells it any more.
///
/// # Errors
///
/// [`Error::Infeasible`] without a thread.
pub fn work(program: Program) -> Result<()> {
    limit_memory();
    let running = Arc::new(Mutex::new(Stop::default()));
    let (orders, jobs) = channel();
    let newest = running.clone();
    let listening = std::thread::Builder::new().spawn(move || {
        let lines = std::io::stdin().lines().map_while(|line| line.ok());
        for order in lines.map_while(|line| serde_json::from_str(&line).ok()) {
            let mut running = newest.lock().unwrap_or_else(PoisonError::into_inner);
            match order {
                Order::Stop => running.now(),
                Order::Make { task, folder, n_waiting } => {
                    *running = Stop::default();
                    let _ = orders.send((task, folder, n_waiting, running.clone()));
                }
            }
        }
        // The server is gone, and nobody wants what is being made.
        std::process::exit(0);
    });
    listening.map_err(no_thread)?;
    let mut renderer = Renderer::new(program);
    let mut is_patient = false;
    for (task, folder, n_waiting, stop) in jobs {
        if !is_patient && !matches!(task, Task::Live(_)) {
            is_patient = true;
            let_others_go_first();
        }
        // A job has nothing that outlives it: what a panic leaves broken is dropped.
        let made = catch_unwind(AssertUnwindSafe(|| {
            std::env::set_current_dir(&folder).map_err(|source| Error::read(&folder, source))?;
            renderer.make(&task, n_waiting, &stop)
        }));
        let result = match made {
            Ok(Ok(result)) => result,
            Ok(Err(Error::Stopped)) => JobResult::Stopped,
            Ok(Err(error)) => {
                JobResult::Failed(Message::of_error(&error, task.subject().is_picture()))
            }
            Err(_) => JobResult::Failed(Key::Broken.into()),
        };
        // Its folder can be removed.
        let _ = folder.parent().map(std::env::set_current_dir);
        let line = serde_json::to_string(&result).expect("it is plain data");
        let mut out = std::io::stdout().lock();
        if writeln!(out, "{line}").and_then(|()| out.flush()).is_err() {
            break;
        }
    }
    Ok(())
}

/// Limits the memory of this process. Where a system has no such limit, the timeout is what is
/// left.
fn limit_memory() {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, setrlimit};
        let most = Some(MEMORY);
        let _ = setrlimit(Resource::Data, Rlimit { current: most, maximum: most });
    }
}

/// Lets photos of a keystroke go first on the processor.
fn let_others_go_first() {
    // Of the group: all threads, also those that run already.
    #[cfg(unix)]
    let _ = rustix::process::setpriority_pgrp(None, 5);
}
