//! Jobs in a line: one place a visitor, equal wishes made once.
//!
//! A visitor's newer wish takes the place of the older one, so that whoever types fast waits no
//! longer than others. A job that nobody waits for any more is stopped.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use tempfile::TempDir;

use super::Value;
use super::said::Said;
use super::wish::Task;
use crate::shoot::Stop;

/// Most jobs that wait.
pub(super) const MAX_WAITING: usize = 64;

/// What became of a wish.
#[derive(Clone, Debug)]
pub(super) enum Outcome {
    /// What was made, and the folder with its files.
    Made(Arc<Value>, Arc<TempDir>),
    Failed(Said),
    /// The visitor asked for something newer, or went away.
    Stopped,
}

/// A visitor who waits for a job.
#[derive(Debug)]
struct Waiting {
    number: u64,
    visitor: String,
    answer: Sender<Outcome>,
}

#[derive(Debug)]
struct Job {
    number: u64,
    task: Task,
    stop: Stop,
    /// Empty: nobody any more.
    asked_by: Vec<Waiting>,
}

#[derive(Debug, Default)]
struct Line {
    waiting: VecDeque<Job>,
    doing: Vec<Job>,
    next: u64,
}

/// Jobs that wait for workers.
#[derive(Debug, Default)]
pub(super) struct Queue {
    line: Mutex<Line>,
    more: Condvar,
}

/// A place in the line: its answer comes once.
#[derive(Debug)]
pub(super) struct Ticket {
    number: u64,
    pub(super) answer: Receiver<Outcome>,
}

/// A job that a worker does.
#[derive(Clone, Debug)]
pub(super) struct Doing {
    pub(super) number: u64,
    pub(super) task: Task,
    pub(super) stop: Stop,
    /// How many wait behind it.
    pub(super) n_waiting: usize,
}

impl Queue {
    /// Asks for something, in the place of what the same visitor asked for before; `None` where the
    /// line is full.
    pub(super) fn ask(&self, visitor: &str, task: Task) -> Option<Ticket> {
        let mut line = self.line();
        let place = line.leave(|waiting| waiting.visitor == visitor);
        let (answer, receiver) = channel();
        line.next += 1;
        let number = line.next;
        let asked = Waiting { number, visitor: visitor.to_owned(), answer };
        let line = &mut *line;
        let mut jobs = line.waiting.iter_mut().chain(&mut line.doing);
        let is_same = |job: &&mut Job| job.task == task && job.stop.check().is_ok();
        if let Some(job) = jobs.find(is_same) {
            job.asked_by.push(asked);
        } else if line.waiting.len() < MAX_WAITING {
            let job = Job { number, task, stop: Stop::default(), asked_by: vec![asked] };
            line.waiting.insert(place.unwrap_or(line.waiting.len()), job);
            self.more.notify_one();
        } else {
            return None;
        }
        Some(Ticket { number, answer: receiver })
    }

    /// Ends what a visitor asked for.
    pub(super) fn end(&self, visitor: &str) {
        self.line().leave(|waiting| waiting.visitor == visitor);
    }

    pub(super) fn leave(&self, ticket: &Ticket) {
        self.line().leave(|waiting| waiting.number == ticket.number);
    }

    /// The next job, once there is one.
    pub(super) fn next(&self) -> Doing {
        let mut line = self.line();
        loop {
            if let Some(job) = line.waiting.pop_front() {
                let n_waiting = line.waiting.len();
                let (number, task, stop) = (job.number, job.task.clone(), job.stop.clone());
                line.doing.push(job);
                return Doing { number, task, stop, n_waiting };
            }
            line = self.more.wait(line).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Answers all who wait for a job.
    pub(super) fn done(&self, doing: &Doing, outcome: &Outcome) {
        let mut line = self.line();
        let done = line.doing.iter().position(|job| job.number == doing.number);
        for waiting in done.map(|at| line.doing.remove(at).asked_by).into_iter().flatten() {
            let _ = waiting.answer.send(outcome.clone());
        }
    }

    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Line {
    /// Takes those out who leave, stops jobs that nobody waits for, and returns the place of the
    /// first that becomes free.
    fn leave(&mut self, leaves: impl Fn(&Waiting) -> bool) -> Option<usize> {
        for job in self.waiting.iter_mut().chain(&mut self.doing) {
            let left = job.asked_by.extract_if(.., |waiting| leaves(waiting));
            left.for_each(|waiting| drop(waiting.answer.send(Outcome::Stopped)));
            if job.asked_by.is_empty() {
                job.stop.now();
            }
        }
        let place = self.waiting.iter().position(|job| job.asked_by.is_empty());
        self.waiting.retain(|job| !job.asked_by.is_empty());
        place
    }
}

/// Most visitors whose running numbers are known: a day's.
const MAX_VISITORS: usize = 4096;

/// The running number of each visitor's newest wish, in the order in which visitors came.
#[derive(Debug, Default)]
pub(super) struct Numbers(VecDeque<(String, u64)>);

impl Numbers {
    /// Whether a wish is the newest of its visitor; one without a number always is.
    pub(super) fn is_newest(&mut self, visitor: &str, number: Option<u64>) -> bool {
        let Some(number) = number else { return true };
        if let Some((_, newest)) = self.0.iter_mut().find(|(known, _)| known == visitor) {
            let is_newest = number >= *newest;
            *newest = number.max(*newest);
            return is_newest;
        }
        if self.0.len() == MAX_VISITORS {
            self.0.pop_front();
        }
        self.0.push_back((visitor.to_owned(), number));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn task(word: &str) -> Task {
        let wish = json!({ "visitor": "any", "word": word }).to_string();
        Task::Live(super::super::wish::Wish::parse(wish.as_bytes()).unwrap().subject)
    }

    fn made(word: &str) -> Outcome {
        Outcome::Made(Arc::new(json!(word)), Arc::new(tempfile::tempdir().unwrap()))
    }

    fn of(ticket: &Ticket) -> Value {
        match ticket.answer.try_recv() {
            Ok(Outcome::Made(value, _)) => (*value).clone(),
            Ok(Outcome::Stopped) => json!("stopped"),
            Ok(Outcome::Failed(said)) => json!(said.key),
            Err(_) => Value::Null,
        }
    }

    #[test]
    fn jobs_are_done_in_order_and_no_more_wait_than_fit() {
        let queue = Queue::default();
        let ask = |n: usize| queue.ask(&format!("v{n}"), task(&format!("W{n}")));
        let tickets: Vec<Ticket> = (0..MAX_WAITING).map(|n| ask(n).unwrap()).collect();
        assert!(ask(MAX_WAITING).is_none());
        for (n, ticket) in tickets.iter().enumerate() {
            let doing = queue.next();
            assert_eq!(doing.task, task(&format!("W{n}")));
            queue.done(&doing, &made("done"));
            assert_eq!(of(ticket), "done");
        }
    }

    #[test]
    fn a_newer_wish_takes_the_place_of_the_older_one_of_its_visitor() {
        let queue = Queue::default();
        let first = queue.ask("a", task("A")).unwrap();
        let doing = queue.next();
        let waiting = queue.ask("b", task("B")).unwrap();
        let other = queue.ask("c", task("C")).unwrap();
        let newer = queue.ask("b", task("BB")).unwrap();
        let newest = queue.ask("a", task("AA")).unwrap();
        assert_eq!([of(&waiting), of(&first)], ["stopped", "stopped"]);
        assert!(doing.stop.check().is_err(), "nobody waits for it");
        queue.done(&doing, &Outcome::Stopped);
        for (ticket, word) in [(newer, "BB"), (other, "C"), (newest, "AA")] {
            let doing = queue.next();
            assert_eq!(doing.task, task(word), "b keeps its place");
            queue.done(&doing, &made(word));
            assert_eq!(of(&ticket), word);
        }
    }

    #[test]
    fn equal_wishes_are_made_once_and_stopped_when_the_last_one_leaves() {
        let queue = Queue::default();
        let tickets = ["a", "b", "c"].map(|visitor| queue.ask(visitor, task("A")).unwrap());
        let doing = queue.next();
        assert_eq!(doing.n_waiting, 0);
        let late = queue.ask("d", task("A")).unwrap();
        queue.leave(&tickets[0]);
        queue.end("b");
        assert!(doing.stop.check().is_ok());
        queue.done(&doing, &made("A"));
        assert_eq!([of(&tickets[1]), of(&tickets[2]), of(&late)], ["stopped", "A", "A"]);
        let alone = queue.ask("a", task("A")).unwrap();
        let doing = queue.next();
        queue.leave(&alone);
        assert!(doing.stop.check().is_err());
        let again = queue.ask("a", task("A")).unwrap();
        assert_eq!(queue.next().task, task("A"), "a stopped job serves nobody: {again:?}");
    }

    #[test]
    fn a_wish_that_arrives_after_a_newer_one_is_not_the_newest() {
        let mut numbers = Numbers::default();
        let mut is_newest = |visitor: &str, number| numbers.is_newest(visitor, number);
        assert!(is_newest("a", Some(7)) && is_newest("a", Some(7)) && is_newest("a", Some(9)));
        assert!(!is_newest("a", Some(8)) && is_newest("b", Some(1)) && is_newest("a", None));
        (0..MAX_VISITORS).for_each(|n| assert!(is_newest(&format!("v{n}"), Some(1))));
        assert!(is_newest("a", Some(1)), "it was forgotten");
        assert_eq!(numbers.0.len(), MAX_VISITORS);
    }
}
