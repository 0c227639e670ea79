//! Jobs in a line: one at a time, the newest of each visitor.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::shoot::Stop;

/// Most jobs that wait.
pub(super) const MAX_WAITING: usize = 8;

/// What a job does.
pub(super) type Work = Box<dyn FnOnce(&Stop) -> Result<Value> + Send>;

struct Job {
    visitor: String,
    stop: Stop,
    answer: Sender<Value>,
    work: Work,
}

#[derive(Default)]
struct Line {
    waiting: VecDeque<Job>,
    /// Visitor of the job that is being done.
    doing: Option<(String, Stop)>,
}

/// Jobs that wait for one worker.
#[derive(Default)]
pub(super) struct Queue {
    line: Mutex<Line>,
    more: Condvar,
}

impl Queue {
    /// Adds a job at the end; `None` where the line is full. It answers with what it made, an
    /// error, or `stopped` where the visitor asked for something newer.
    pub(super) fn push(&self, visitor: &str, work: Work) -> Option<Receiver<Value>> {
        let mut line = self.line();
        if line.waiting.len() >= MAX_WAITING {
            return None;
        }
        let (answer, receiver) = channel();
        let (visitor, stop) = (visitor.to_owned(), Stop::default());
        line.waiting.push_back(Job { visitor, stop, answer, work });
        self.more.notify_one();
        Some(receiver)
    }

    /// Ends the jobs of a visitor, who asks for something newer.
    pub(super) fn end(&self, visitor: &str) {
        let mut line = self.line();
        line.waiting.retain(|job| {
            let stays = job.visitor != visitor;
            if !stays {
                let _ = job.answer.send(stopped());
            }
            stays
        });
        if let Some((_, stop)) = line.doing.as_ref().filter(|(of, _)| of == visitor) {
            stop.now();
        }
    }

    /// Does the jobs, one after another, for ever.
    pub(super) fn work(&self) {
        loop {
            let Job { visitor, stop, answer, work } = self.next();
            self.line().doing = Some((visitor, stop.clone()));
            // A job has nothing that outlives it: what a panic leaves broken is dropped.
            let done = catch_unwind(AssertUnwindSafe(|| work(&stop)));
            self.line().doing = None;
            let _ = answer.send(match done {
                Ok(Ok(made)) => made,
                Ok(Err(Error::Stopped)) => stopped(),
                Ok(Err(error)) => failed(&error),
                Err(_) => failed(&broken()),
            });
        }
    }

    fn next(&self) -> Job {
        let mut line = self.line();
        loop {
            if let Some(job) = line.waiting.pop_front() {
                return job;
            }
            line = self.more.wait(line).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn stopped() -> Value {
    json!({ "stopped": true })
}

/// What is said of an error.
pub(super) fn failed(error: &Error) -> Value {
    json!({ "error": error.to_string(), "hint": error.hint() })
}

fn broken() -> Error {
    let (what, hint) = ("the program failed on this", "change something and try again");
    Error::Infeasible { what: what.into(), hint: hint.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    fn queue() -> Arc<Queue> {
        let queue = Arc::new(Queue::default());
        let worker = queue.clone();
        std::thread::spawn(move || worker.work());
        queue
    }

    /// A job that tells that it began, and ends once it is let go.
    fn held() -> (Work, Receiver<()>, Sender<()>) {
        let ((begin, begun), (go, gate)) = (channel(), channel::<()>());
        let work = move |stop: &Stop| {
            let _ = begin.send(());
            let _ = gate.recv();
            stop.check().map(|()| json!("done"))
        };
        (Box::new(work), begun, go)
    }

    fn at_once(made: &'static str) -> Work {
        Box::new(move |_| Ok(json!(made)))
    }

    #[test]
    fn jobs_are_done_in_order_and_no_more_wait_than_fit() {
        let queue = queue();
        let (work, begun, go) = held();
        let first = queue.push("first", work).unwrap();
        begun.recv().unwrap();
        let order = Arc::new(Mutex::new(Vec::new()));
        let wait = |n: usize| {
            let order = order.clone();
            let work = move |_: &Stop| {
                order.lock().unwrap().push(n);
                Ok(json!(n))
            };
            queue.push(&format!("{n}"), Box::new(work)).unwrap()
        };
        let waiting: Vec<_> = (0..MAX_WAITING).map(wait).collect();
        assert!(queue.push("late", at_once("never")).is_none());
        go.send(()).unwrap();
        assert_eq!(first.recv().unwrap(), json!("done"));
        for (n, answer) in waiting.iter().enumerate() {
            assert_eq!(answer.recv().unwrap(), json!(n));
        }
        assert_eq!(*order.lock().unwrap(), (0..MAX_WAITING).collect::<Vec<_>>());
    }

    #[test]
    fn a_newer_wish_ends_the_older_ones_of_the_same_visitor() {
        let queue = queue();
        let (work, begun, go) = held();
        let doing = queue.push("a", work).unwrap();
        begun.recv().unwrap();
        let waiting = queue.push("a", at_once("waited")).unwrap();
        let other = queue.push("b", at_once("other")).unwrap();
        queue.end("a");
        go.send(()).unwrap();
        assert_eq!([doing.recv().unwrap(), waiting.recv().unwrap()], [stopped(), stopped()]);
        assert_eq!(other.recv().unwrap(), json!("other"));
    }

    #[test]
    fn a_panic_in_a_job_is_said_and_the_next_job_is_done() {
        let queue = queue();
        let broken = queue.push("a", Box::new(|_| panic!("on purpose"))).unwrap();
        assert_eq!(broken.recv().unwrap()["error"], "the program failed on this");
        let next = queue.push("a", at_once("well")).unwrap();
        assert_eq!(next.recv().unwrap(), json!("well"));
    }
}
