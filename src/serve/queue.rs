//! Jobs in a line: one place a visitor, so that whoever types fast waits no longer than others.
//!
//! A visitor's newer job takes the place of the older one. A job whose ticket is dropped, since the
//! visitor hung up, is stopped.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use serde_json::value::RawValue;
use tempfile::TempDir;
use tokio::sync::oneshot;

use noctograph_pipeline::shoot::Stop;
use noctograph_web::messages::Message;
use noctograph_web::request::Task;

/// Most jobs that wait.
pub(crate) const MAX_WAITING: usize = 64;

/// What became of a job.
#[derive(Debug)]
pub(crate) enum Outcome {
    /// What was made, and the folder with its files.
    Made(Box<RawValue>, Arc<TempDir>),
    Failed(Message),
    /// The visitor asked for something newer, or went away.
    Stopped,
}

/// A job of a visitor.
#[derive(Debug)]
pub(crate) struct Job {
    visitor: String,
    pub(crate) task: Task,
    pub(crate) stop: Stop,
    answer: oneshot::Sender<Outcome>,
}

impl Job {
    /// Whether nobody waits for it.
    fn is_over(&self) -> bool {
        self.answer.is_closed() || self.stop.check().is_err()
    }

    pub(crate) fn done(self, outcome: Outcome) {
        // Who hung up gets no answer.
        let _ = self.answer.send(outcome);
    }
}

/// A place in the line, whose answer comes once. Dropped, it stops the job.
#[derive(Debug)]
pub(crate) struct Ticket {
    answer: oneshot::Receiver<Outcome>,
    stop: Stop,
}

impl Ticket {
    pub(crate) async fn outcome(&mut self) -> Outcome {
        (&mut self.answer).await.unwrap_or(Outcome::Stopped)
    }
}

impl Drop for Ticket {
    fn drop(&mut self) {
        self.stop.now();
    }
}

#[derive(Debug, Default)]
struct Line {
    waiting: VecDeque<Job>,
    /// Visitors of the jobs that workers have, and the jobs' switches.
    running: Vec<(String, Stop)>,
}

/// Jobs that wait for workers.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    line: Mutex<Line>,
    more: Condvar,
}

impl Queue {
    /// Asks for something, in the place of what the same visitor asked for before; `None` where the
    /// line is full.
    pub(crate) fn ask(&self, visitor: &str, task: Task) -> Option<Ticket> {
        let mut line = self.line();
        let place = line.end(visitor);
        if line.waiting.len() == MAX_WAITING {
            return None;
        }
        let (sender, answer) = oneshot::channel();
        let stop = Stop::default();
        let job = Job { visitor: visitor.to_owned(), task, stop: stop.clone(), answer: sender };
        let place = place.unwrap_or(line.waiting.len());
        line.waiting.insert(place, job);
        self.more.notify_one();
        Some(Ticket { answer, stop })
    }

    /// Ends what a visitor asked for.
    pub(crate) fn end(&self, visitor: &str) {
        self.line().end(visitor);
    }

    /// The next job, once there is one, and how many wait behind it.
    pub(crate) fn next(&self) -> (Job, usize) {
        let mut line = self.line();
        loop {
            while let Some(job) = line.waiting.pop_front() {
                if !job.is_over() {
                    line.running.retain(|(_, stop)| stop.check().is_ok());
                    line.running.push((job.visitor.clone(), job.stop.clone()));
                    return (job, line.waiting.len());
                }
            }
            line = self.more.wait(line).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Line {
    /// Ends the jobs of a visitor, and returns the place of the one that waited.
    fn end(&mut self, visitor: &str) -> Option<usize> {
        let of_visitor = self.running.iter().filter(|(other, _)| other == visitor);
        of_visitor.for_each(|(_, stop)| stop.now());
        self.waiting.retain(|job| job.visitor == visitor || !job.is_over());
        let place = self.waiting.iter().position(|job| job.visitor == visitor);
        // There is one place a visitor.
        if let Some(job) = place.and_then(|place| self.waiting.remove(place)) {
            job.done(Outcome::Stopped);
        }
        place
    }
}

/// Most visitors whose running numbers are known: a day's.
const MAX_VISITORS: usize = 4096;

/// The running number of each visitor's newest request.
#[derive(Debug, Default)]
pub(crate) struct RequestNumbers(HashMap<String, u64>);

impl RequestNumbers {
    /// Whether a request is the newest of its visitor; one without a number always is.
    pub(crate) fn is_newest(&mut self, visitor: &str, number: Option<u64>) -> bool {
        let Some(number) = number else { return true };
        if self.0.len() == MAX_VISITORS && !self.0.contains_key(visitor) {
            // A late request of these is taken for a new one, once.
            self.0.clear();
        }
        let newest = self.0.entry(visitor.to_owned()).or_default();
        *newest = number.max(*newest);
        *newest == number
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_web::request::PhotoRequest;
    use serde_json::json;

    fn task(word: &str) -> Task {
        let request = json!({ "visitor": "any", "word": word }).to_string();
        Task::Live(PhotoRequest::parse(request.as_bytes(), false).unwrap().subject)
    }

    /// What a ticket was answered: a word, `stopped`, or nothing yet.
    fn told(ticket: &mut Ticket) -> String {
        match ticket.answer.try_recv() {
            Ok(Outcome::Made(value, _)) => value.get().to_owned(),
            Ok(Outcome::Stopped) => "stopped".to_owned(),
            Ok(Outcome::Failed(message)) => message.key,
            Err(_) => String::new(),
        }
    }

    fn make_next(queue: &Queue) -> Task {
        let (job, _) = queue.next();
        let task = job.task.clone();
        let word = RawValue::from_string(json!(task.subject().word).to_string()).unwrap();
        job.done(Outcome::Made(word, Arc::new(tempfile::tempdir().unwrap())));
        task
    }

    #[test]
    fn jobs_are_done_in_order_and_no_more_wait_than_fit() {
        let queue = Queue::default();
        let ask = |n: usize| queue.ask(&format!("v{n}"), task(&format!("W{n}")));
        let mut tickets: Vec<Ticket> = (0..MAX_WAITING).map(|n| ask(n).unwrap()).collect();
        assert!(ask(MAX_WAITING).is_none());
        assert_eq!(queue.line().waiting.len(), MAX_WAITING);
        for (n, ticket) in tickets.iter_mut().enumerate() {
            assert_eq!(make_next(&queue), task(&format!("W{n}")));
            assert_eq!(told(ticket), format!("\"W{n}\""));
        }
    }

    #[test]
    fn a_newer_job_takes_the_place_of_the_older_one_of_its_visitor() {
        let queue = Queue::default();
        let ask = |visitor: &str, word: &str| queue.ask(visitor, task(word)).unwrap();
        let _first = ask("a", "A");
        let (running, _) = queue.next();
        let (mut waiting, _other) = (ask("b", "B"), ask("c", "C"));
        let (mut newer, _newest) = (ask("b", "BB"), ask("a", "AA"));
        assert_eq!(told(&mut waiting), "stopped");
        assert!(running.stop.check().is_err(), "its visitor asks for another");
        let words = ["BB", "C", "AA"];
        assert_eq!(words.map(|_| make_next(&queue)), words.map(task), "b keeps its place");
        assert_eq!(told(&mut newer), "\"BB\"");
    }

    #[test]
    fn a_job_of_someone_who_hung_up_is_not_done() {
        let queue = Queue::default();
        let gone = queue.ask("a", task("A")).unwrap();
        let (running, _) = queue.next();
        drop(gone);
        assert!(running.stop.check().is_err());
        let all: Vec<_> = (0..MAX_WAITING).map(|n| queue.ask(&format!("{n}"), task("B"))).collect();
        drop(all);
        let _kept = queue.ask("c", task("C")).expect("their places are free");
        assert_eq!(make_next(&queue), task("C"));
    }

    #[test]
    fn a_request_that_arrives_after_a_newer_one_is_not_the_newest() {
        let mut numbers = RequestNumbers::default();
        let mut is_newest = |visitor: &str, number| numbers.is_newest(visitor, number);
        assert!(is_newest("a", Some(7)) && is_newest("a", Some(7)) && is_newest("a", Some(9)));
        assert!(!is_newest("a", Some(8)) && is_newest("b", Some(1)) && is_newest("a", None));
        (0..MAX_VISITORS).for_each(|n| assert!(is_newest(&format!("v{n}"), Some(1))));
        assert!(is_newest("a", Some(1)), "it was forgotten");
        assert!(numbers.0.len() <= MAX_VISITORS);
    }
}
