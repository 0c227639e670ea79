//! Worker processes, each of which makes photos and scripts one after another.
//!
//! A worker runs the same program as the server. If a worker is too slow, uses too much memory or
//! fails, it is killed, and the server continues. A worker ends when its pipe is closed, and
//! therefore does not survive the server. A job is a line of JSON. An answer is a line of JSON
//! followed by the bytes of its files.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::json;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::process::{Child, ChildStdin, ChildStdout, Command};
use tokio::sync::{Mutex, Semaphore};
use tokio::task::JoinHandle;
use tokio::time::timeout;

use super::gallery::{Figures, REPLAY};
use super::{Program, no_thread};
use noctograph_core::error::{Error, Result};
use noctograph_export::File;
use noctograph_logs::GrowingLog;
use noctograph_photo_service::answer::{
    Answer, Asked, Facts, FlightFilm, Made, PageAnswer, Studio,
};
use noctograph_photo_service::messages::{Key, Message};
use noctograph_photo_service::request::{Product, Subject};
use noctograph_pipeline::scene::Scene;

/// Maximum number of jobs that wait for a worker.
const MAX_WAITING: usize = 64;
/// Memory limit of a worker in bytes, excluding its code. The limit is enough for a large picture.
#[cfg(unix)]
const MEMORY: u64 = 1 << 30;
/// Time limit for a photo while a visitor types, long enough for a busy machine.
const LIVE_TIMEOUT: Duration = Duration::from_secs(30);
/// Time limit for other products. The advice for a large photo takes thirty simulated flights.
const LARGE_TIMEOUT: Duration = Duration::from_secs(300);
/// Maximum number of checks whether a killed worker has ended.
const END_TRIES: usize = 100;
/// Time between these checks. A worker ends within a millisecond, unless the disk hangs.
const END_PAUSE: Duration = Duration::from_millis(1);
/// Maximum length of an answer's line, in bytes.
const MAX_LINE: u64 = 1 << 20;
/// Maximum total size of an answer's files in bytes, enough for a photo of two megapixels with its
/// files, even in base64.
const MAX_BYTES: usize = 32 << 20;

/// A job, which is sent to a worker as a line of JSON.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) struct Job {
    pub(crate) product: Product,
    pub(crate) subject: Subject,
    /// Members of the request that the page receives back in an answer of one file. Without
    /// them, the answer consists of all files.
    pub(crate) page: Option<Asked>,
    /// Log whose light so far is photographed, in which case the product is ignored.
    pub(crate) flight: Option<Followed>,
}

/// A log that grows.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) struct Followed {
    /// Absolute path of the log.
    pub(crate) path: PathBuf,
    /// Number of the flight. The path does not identify the flight, because several logs may have
    /// the same path.
    pub(crate) number: u64,
    /// True if the flight counts as over even without an end mark.
    pub(crate) is_over: bool,
}

/// Answer to a job.
#[derive(Debug)]
pub(crate) struct Parcel {
    /// Facts about a large photo for its entry.
    pub(crate) figures: Figures,
    pub(crate) files: Vec<File>,
}

/// Line of an answer, with facts for the entry, and the names and sizes of the files that follow.
type Head = std::result::Result<(Figures, Vec<(String, usize)>), Message>;

/// Queue of jobs for one worker.
#[derive(Debug)]
pub(crate) struct Maker {
    program: Program,
    /// Parent folder of the worker's folder.
    scratch: PathBuf,
    worker: Arc<Mutex<Option<Worker>>>,
    /// Semaphore that limits the number of waiting jobs.
    permits: Semaphore,
    /// True if the worker uses only one processor core.
    is_frugal: bool,
}

/// Aborts a task when it is dropped, which kills the worker that the task owns.
struct AbortOnDrop<T>(JoinHandle<T>);

impl<T> Drop for AbortOnDrop<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Maker {
    /// Creates a maker without a worker, which starts one for its first job. Jobs run in folders in
    /// `scratch`.
    pub(crate) fn new(program: Program, scratch: &Path) -> Self {
        let permits = Semaphore::new(MAX_WAITING);
        let scratch = scratch.to_owned();
        Self { program, scratch, worker: Arc::default(), permits, is_frugal: false }
    }

    /// Creates a queue whose worker uses only one processor core.
    pub(crate) fn frugal(program: Program, scratch: &Path) -> Self {
        Self { is_frugal: true, ..Self::new(program, scratch) }
    }

    /// Runs a job in the worker, which is started if there is none, and returns the answer or the
    /// message of a refusal. A worker that exceeds the time limit is killed. If the future is
    /// dropped while the job waits, the job is never started. If it is dropped later, the job is
    /// stopped, except for the photo of a keystroke.
    pub(crate) async fn make(&self, job: Job) -> std::result::Result<Parcel, Message> {
        let _permit = self.permits.try_acquire().map_err(|_full| Key::Busy)?;
        let mut slot = self.worker.clone().lock_owned().await;
        let (program, scratch, is_frugal) = (self.program, self.scratch.clone(), self.is_frugal);
        let is_live = job.product == Product::Live;
        // The worker returns to its slot only after an answer, so a failing job kills it.
        let made = tokio::spawn(async move {
            let mut worker = match slot.take() {
                Some(worker) => worker,
                None => Worker::start(program, &scratch, is_frugal).map_err(|_cause| Key::Busy)?,
            };
            let limit = if is_live { LIVE_TIMEOUT } else { LARGE_TIMEOUT };
            let answer = timeout(limit, worker.answer(&job)).await.map_err(|_late| {
                let values = json!({ "seconds": limit.as_secs() });
                Message::from(Key::TooSlow).with_values(values)
            })?;
            // A worker that ends without an answer has reached its memory limit.
            let answer = answer.map_err(|_gone| Key::TooLarge)?;
            *slot = Some(worker);
            answer
        });
        // The task that makes the photo for a keystroke continues even if its handle is dropped,
        // because finishing it takes less time than starting another worker.
        let made = if is_live { made.await } else { (&mut AbortOnDrop(made).0).await };
        made.unwrap_or(Err(Key::Broken.into()))
    }
}

/// A running worker, which is killed when this value is dropped.
#[derive(Debug)]
struct Worker {
    child: Child,
    jobs: ChildStdin,
    answers: BufReader<ChildStdout>,
    _folder: TempDir,
}

impl Worker {
    /// Starts a worker in a new folder in `scratch`. A frugal worker (`is_frugal`) uses a single
    /// thread.
    fn start(program: Program, scratch: &Path, is_frugal: bool) -> std::io::Result<Self> {
        let folder = tempfile::Builder::new().prefix("worker-").tempdir_in(scratch)?;
        let mut command = Command::from((program.worker)()?);
        // Because it has its own process group, a worker receives no Ctrl-C from the terminal. It
        // ends with the server, which closes its pipe.
        #[cfg(unix)]
        command.process_group(0);
        if is_frugal {
            command.env("RAYON_NUM_THREADS", "1");
        }
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.current_dir(folder.path()).kill_on_drop(true).spawn()?;
        let jobs = child.stdin.take().expect("it is piped");
        let answers = BufReader::new(child.stdout.take().expect("it is piped"));
        Ok(Self { child, jobs, answers, _folder: folder })
    }

    /// Sends a job to the worker, and reads the answer. Returns an error if the worker has ended or
    /// answers with more than [`MAX_BYTES`].
    async fn answer(&mut self, job: &Job) -> std::io::Result<std::result::Result<Parcel, Message>> {
        let line = serde_json::to_string(job).expect("a job is plain data") + "\n";
        self.jobs.write_all(line.as_bytes()).await?;
        let mut line = String::new();
        (&mut self.answers).take(MAX_LINE).read_line(&mut line).await?;
        // The sizes are checked, because a malicious drawing might take over the worker.
        let (figures, sizes) = match serde_json::from_str::<Head>(&line)? {
            Ok(head) => head,
            Err(message) => return Ok(Err(message)),
        };
        if sizes.iter().map(|(_, size)| size).sum::<usize>() > MAX_BYTES {
            return Err(std::io::ErrorKind::InvalidData.into());
        }
        let mut files = Vec::new();
        for (name, size) in sizes {
            let mut bytes = vec![0; size];
            self.answers.read_exact(&mut bytes).await?;
            files.push(File { name, bytes });
        }
        Ok(Ok(Parcel { figures, files }))
    }
}

impl Drop for Worker {
    /// Kills the process, and waits up to [`END_TRIES`] times [`END_PAUSE`] for its end, because
    /// Windows does not remove the current folder of a running process.
    fn drop(&mut self) {
        let _ = self.child.start_kill();
        for _ in 0..END_TRIES {
            match self.child.try_wait() {
                Ok(None) => std::thread::sleep(END_PAUSE),
                _ => break,
            }
        }
    }
}

/// Runs a worker in the current folder until its pipe is closed. `scene` is the name of the scene
/// that the page's controls show at the start.
///
/// # Errors
///
/// [`Error::Infeasible`] if no thread can be started.
pub fn work(program: Program, scene: Option<&str>) -> Result<()> {
    limit_memory();
    let (sender, jobs) = channel();
    // Another thread reads the jobs, so that the end of the server is noticed during a job.
    let reading = std::thread::Builder::new().spawn(move || {
        let lines = std::io::stdin().lines().map_while(|line| line.ok());
        for job in lines.map_while(|line| serde_json::from_str::<Job>(&line).ok()) {
            let _ = sender.send(job);
        }
        std::process::exit(0);
    });
    reading.map_err(no_thread)?;
    let folder = std::env::current_dir().map_err(|source| Error::read(".".as_ref(), source))?;
    let faces = RefCell::default();
    let maker = JobMaker { program, scene, faces, following: Cell::default() };
    for job in jobs {
        // A panic cannot corrupt the cache of typefaces, which is all that a job leaves behind.
        let made = catch_unwind(AssertUnwindSafe(|| maker.make_in(&folder, &job)));
        let made = made.unwrap_or_else(|_| Err(Key::Broken.into()));
        if write_answer(made.and_then(|answer| to_parcel(answer, job.page))).is_err() {
            break;
        }
    }
    Ok(())
}

/// Returns the part of an answer that the server receives. If a page asked (`page`), this is a file
/// with the answer for the page, or else the files with the facts for an entry, to which the path
/// of the light is added. Refuses an entry whose flight is not safe.
fn to_parcel(answer: Answer, page: Option<Asked>) -> std::result::Result<Parcel, Message> {
    if let Some(asked) = page {
        let bytes = PageAnswer::new(asked, Ok(answer)).json().into_bytes();
        let files = vec![File { name: "answer.json".into(), bytes }];
        return Ok(Parcel { figures: Figures::default(), files });
    }
    let Answer { facts, mut files } = answer;
    let Facts::Large(facts) = facts else {
        return Ok(Parcel { figures: Figures::default(), files });
    };
    if !facts.stops.is_empty() {
        return Err(Message::of_stops(&facts.stops));
    }
    // The wall uses the path of the light to expose the photo again.
    let replay = json!(facts.photo.replay).to_string().into_bytes();
    files.push(File { name: REPLAY.into(), bytes: replay });
    Ok(Parcel { figures: Figures::new(*facts), files })
}

/// Writes an answer or a refusal to the server: a line with the facts and the sizes of the files,
/// followed by the files.
fn write_answer(made: std::result::Result<Parcel, Message>) -> std::io::Result<()> {
    let (head, files): (Head, _) = match made {
        Ok(Parcel { figures, files }) => {
            let sizes = files.iter().map(|file| (file.name.clone(), file.bytes.len())).collect();
            (Ok((figures, sizes)), files)
        }
        Err(message) => (Err(message), Vec::new()),
    };
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", json!(head))?;
    for file in files {
        out.write_all(&file.bytes)?;
    }
    out.flush()
}

/// Maximum number of words whose typefaces are cached, enough for an evening's typing.
const MAX_FACES: usize = 4096;

/// Folder of a job, which is the current folder until this value is dropped.
struct JobFolder<'a> {
    _folder: TempDir,
    parent: &'a Path,
}

impl<'a> JobFolder<'a> {
    /// Creates a folder in `parent`, and makes it the current folder until the value is dropped.
    fn enter(parent: &'a Path) -> std::io::Result<Self> {
        let folder = tempfile::tempdir_in(parent)?;
        std::env::set_current_dir(folder.path())?;
        Ok(Self { _folder: folder, parent })
    }
}

impl Drop for JobFolder<'_> {
    fn drop(&mut self) {
        // Windows does not remove the current folder of a process.
        let _ = std::env::set_current_dir(self.parent);
    }
}

/// Runner of a worker's jobs.
struct JobMaker<'a> {
    program: Program,
    scene: Option<&'a str>,
    /// Cached typefaces on this machine, by the letters of the word. `None` stands for letters that
    /// no typeface contains.
    faces: RefCell<BTreeMap<BTreeSet<char>, Option<PathBuf>>>,
    /// Flight that was followed last.
    following: Cell<Option<Following>>,
}

/// A flight that is being followed, with its log and the film of its light so far.
struct Following {
    number: u64,
    log: GrowingLog,
    film: FlightFilm,
}

impl Following {
    /// Opens the log of a flight, of which no light has been drawn yet.
    fn open(Followed { path, number, .. }: &Followed) -> Result<Self> {
        let (number, log) = (*number, GrowingLog::open(path)?);
        Ok(Self { number, log, film: FlightFilm::default() })
    }
}

impl JobMaker<'_> {
    /// Runs a job in a new folder that contains all of its files, so that the answer reveals no
    /// path on this machine.
    fn make_in(&self, parent: &Path, Job { product, subject, flight, .. }: &Job) -> Made {
        let Ok(_folder) = JobFolder::enter(parent) else { return Err(Key::DiskFull.into()) };
        let studio = Studio {
            scene: &|settings| self.base(settings),
            typeface: &|word| self.face(word).map(|face| bring_here(&face)).transpose(),
            advice: &self.program.advice,
            has_audience: true,
            watch: &|_stage, _fraction| {},
        };
        match flight {
            None => studio.make(*product, subject),
            Some(flight) => self.follow(&studio, subject, flight),
        }
    }

    /// Makes the photo of the flight so far from its log. The log and the film of the last call are
    /// used again if they belong to the same flight.
    fn follow(&self, studio: &Studio<'_>, subject: &Subject, flight: &Followed) -> Made {
        let last = self.following.take().filter(|last| last.number == flight.number);
        let opened = last.map_or_else(|| Following::open(flight), Ok);
        let grown = opened.and_then(|mut opened| opened.log.grow().map(|_| opened));
        let mut following = grown.map_err(|error| Message::of_log_error(&error))?;
        let Following { log, film, .. } = &mut following;
        let is_over = flight.is_over || log.has_ended();
        let made = studio.follow(subject, log, film, is_over);
        // A log that grows after its end mark is treated as a new flight.
        self.following.set(Some(following).filter(|_| !is_over));
        made
    }

    /// Returns the page's scene with overriding settings, and brings the files that it names into
    /// the current folder.
    fn base(&self, settings: &[(&str, &str)]) -> Result<Scene> {
        let mut scene = match self.scene {
            Some(named) => Scene::find(named, settings)?.scene,
            None => Scene::parse_with("", "scene", settings)?,
        };
        for file in scene.files_mut().filter(|file| Path::new(file).is_absolute()) {
            *file = bring_here(file.as_ref())?;
        }
        Ok(scene)
    }

    /// Returns a typeface on this machine that contains all letters of a word, if there is one. The
    /// result is cached for each set of letters. A full cache is cleared before a new set is added.
    fn face(&self, word: &str) -> Option<PathBuf> {
        let letters: BTreeSet<char> = word.chars().filter(|c| !c.is_whitespace()).collect();
        let mut faces = self.faces.borrow_mut();
        if faces.len() == MAX_FACES && !faces.contains_key(&letters) {
            faces.clear();
        }
        let face = faces.entry(letters).or_insert_with_key(|letters| {
            (self.program.typeface)(&letters.iter().copied().collect::<Vec<_>>())
        });
        face.clone()
    }
}

/// Links or copies a file into the current folder, unless it is there, and returns its name there.
/// A name that is already used is preceded by underscores.
fn bring_here(path: &Path) -> Result<String> {
    let here = std::env::current_dir().map_err(|source| Error::read(path, source))?;
    let mut name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if path.parent() == Some(&here) {
        return Ok(name);
    }
    while Path::new(&name).exists() {
        name.insert(0, '_');
    }
    // A file on another disk is copied, because it cannot be linked.
    let linked = std::fs::hard_link(path, &name);
    let copied = linked.or_else(|_| std::fs::copy(path, &name).map(drop));
    copied.map_err(|source| Error::read(name.as_ref(), source))?;
    Ok(name)
}

/// Limits the data of this process to [`MEMORY`] bytes, if the system supports it.
fn limit_memory() {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, setrlimit};
        let most = Some(MEMORY);
        let _ = setrlimit(Resource::Data, Rlimit { current: most, maximum: most });
    }
}
