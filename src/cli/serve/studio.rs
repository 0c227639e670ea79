//! What is made for a visitor: the photo while one types, the large one with advice, and files.
//!
//! The first is made within this process, so that it stands on the page at once. All others are the
//! verbs of the command line in processes of their own: these can be ended at any moment, and take
//! their memory with them.

use crate::photo;
use std::collections::VecDeque;
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use base64::prelude::{BASE64_STANDARD, Engine};
use rayon::ThreadPool;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::super::advice::mentioned;
use super::super::preview::PreviewArgs;
use super::super::show;
use super::wish::{Wish, preview_args};
use crate::error::{Error, Result};
use crate::export::zip::zip;
use crate::expose::BackendChoice;
use crate::plan::Plan;
use crate::report::plan_view;
use crate::score::{Reader, View, is_judged};
use crate::shoot::{Judging, Problem, Shoot, Stop};
use noctograph_core::files::{Limit, files_in};

/// Size of the photo while one types, and of the large one.
const LIVE: &str = "--size=960x540";
const LARGE: &str = "--size=1920x1080";
/// Arguments of the verb that takes a large photo.
const PREVIEW: [&str; 2] = [LARGE, "--backend=cpu"];
/// Output folder of a verb, inside its temporary folder.
const OUT: &str = "out";
const JPEG_QUALITY: u8 = 85;
/// Longest time that a verb may take. A word that does not read is flown some thirty times for
/// advice.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often a verb is asked whether it is done.
const PAUSE: Duration = Duration::from_millis(2);
/// Most large photos that are kept for downloads: 0.4 MB each.
const MAX_KEPT: usize = 64;

/// Files that a verb wrote.
const WRITTEN: Limit =
    Limit { bytes: 64 << 20, what: "a file of a photo", hint: "choose a smaller picture" };

/// A large photo, and what made it.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    id: u64,
    pub(super) wish: Wish,
    pub(super) png: Arc<[u8]>,
}

/// Makes photos and files.
#[derive(Debug)]
pub(super) struct Studio {
    /// Arguments of every verb: the scene that the page begins with.
    base: Vec<OsString>,
    pool: ThreadPool,
    kept: Mutex<VecDeque<Kept>>,
}

impl Studio {
    pub(super) fn new(base: Vec<OsString>, pool: ThreadPool) -> Self {
        Self { base, pool, kept: Mutex::default() }
    }

    fn args(&self, wish: &Wish, folder: &Path, more: &str) -> Result<PreviewArgs> {
        preview_args([self.base.clone(), wish.arguments(folder)?, vec![more.into()]].concat())
    }

    /// The photo while one types, with its verdict: both read and encode it side by side.
    pub(super) fn live(&self, wish: &Wish, stop: &Stop) -> Result<Value> {
        let folder = folder()?;
        let args = self.args(wish, folder.path(), LIVE)?;
        self.pool.install(|| {
            let (judging, backend) = (Judging::Skipped, BackendChoice::Cpu);
            let shoot = Shoot { judging, backend, stop: stop.clone(), ..args.shoot()? };
            stop.check()?;
            let shot = shoot.clone().take(&|_, _| {})?;
            stop.check()?;
            let judge = || match shoot.strokes.as_ref().filter(|strokes| is_judged(strokes)) {
                None => Ok(None),
                Some(strokes) => {
                    let reader = Reader::new(strokes, &shoot.scene.score)?;
                    reader.score(&shot.photo, &View::from(&shot.camera)).map(Some)
                }
            };
            let (verdict, jpeg) = rayon::join(judge, || photo::jpeg(&shot.photo, JPEG_QUALITY));
            let is_said = |it: &&Problem| it.is_obstacle() || matches!(it, Problem::Drawing(_));
            let obstacles = shot.problems.iter().filter(is_said);
            let obstacles: Vec<String> = obstacles.map(|it| it.sentence(mentioned)).collect();
            let flight_s = shoot.plans.iter().map(|it| it.plan.duration_s()).fold(0.0, f64::max);
            Ok(json!({
                "photo": format!("data:image/jpeg;base64,{}", BASE64_STANDARD.encode(jpeg)),
                "verdict": verdict?.as_ref().map(|verdict| show::verdict_json(Some(verdict), None)),
                "flight_s": flight_s,
                "obstacles": obstacles,
            }))
        })
    }

    /// The large photo with advice: what `preview --json` says, and the number under which it is
    /// kept.
    pub(super) fn large(&self, wish: &Wish, stop: &Stop) -> Result<Value> {
        let (mut said, folder) = self.verb("preview", wish, &PREVIEW, stop)?;
        let png = WRITTEN.read(&folder.path().join(OUT).join("photo.png"))?.into();
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let id = kept.back().map_or(1, |kept| kept.id + 1);
        if kept.len() == MAX_KEPT {
            kept.pop_front();
        }
        kept.push_back(Kept { id, wish: wish.clone(), png });
        said["id"] = id.into();
        Ok(said)
    }

    /// A large photo that is kept.
    pub(super) fn kept(&self, id: u64) -> Option<Kept> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.iter().find(|kept| kept.id == id).cloned()
    }

    /// The drawing of a plan (SVG).
    pub(super) fn plan(&self, kept: &Kept) -> Result<Vec<u8>> {
        let folder = folder()?;
        let shoot = self.pool.install(|| self.args(&kept.wish, folder.path(), LARGE)?.shoot())?;
        let plans: Vec<Plan> = shoot.plans.into_iter().map(|planned| planned.plan).collect();
        Ok(plan_view(&plans, kept.wish.title()).into_bytes())
    }

    /// The report (HTML).
    pub(super) fn report(&self, kept: &Kept) -> Result<Vec<u8>> {
        let more = [&PREVIEW[..], &["--report"]].concat();
        let (_, folder) = self.verb("preview", &kept.wish, &more, &Stop::default())?;
        WRITTEN.read(&folder.path().join(OUT).join("report.html"))
    }

    /// The script that flies it, with what it needs (ZIP).
    pub(super) fn script(&self, kept: &Kept) -> Result<Vec<u8>> {
        let more = ["--to", "cflib"];
        let (said, folder) = self.verb("export", &kept.wish, &more, &Stop::default())?;
        if let Some(stops) = said["stops"].as_str() {
            let hint = "mend it first: the report says how";
            return Err(Error::Infeasible {
                what: format!("not safe to fly: {stops}"),
                hint: hint.into(),
            });
        }
        let read = |path: std::path::PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            Ok((name, WRITTEN.read(&path)?))
        };
        let files = files_in(&folder.path().join(OUT))?
            .into_iter()
            .map(read)
            .collect::<Result<Vec<_>>>()?;
        Ok(zip(&files))
    }

    /// Runs a verb in a child process. Returns its JSON, and the temporary folder that holds its
    /// output in [`OUT`].
    fn verb(
        &self,
        verb: &str,
        wish: &Wish,
        more: &[&str],
        stop: &Stop,
    ) -> Result<(Value, TempDir)> {
        let folder = folder()?;
        let out = folder.path().join(OUT);
        std::fs::create_dir(&out).map_err(|source| Error::write(&out, source))?;
        let [said, complained] = ["stdout", "stderr"].map(|name| folder.path().join(name));
        let file =
            |path: &Path| std::fs::File::create(path).map_err(|source| Error::write(path, source));
        let lost = |what: String| Error::Infeasible {
            what,
            hint: "change something and try again".into(),
        };
        let program = std::env::current_exe().map_err(|error| lost(error.to_string()))?;
        let mut command = Command::new(program);
        command.arg(verb).args(&self.base).args(wish.arguments(folder.path())?).args(more);
        command.arg("-o").arg(out).arg("--json").stdin(Stdio::null());
        command.stdout(file(&said)?).stderr(file(&complained)?);
        let mut child = command.spawn().map_err(|error| lost(error.to_string()))?;
        let begun = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().map_err(|error| lost(error.to_string()))? {
                break status;
            }
            let late = begun.elapsed() > PATIENCE;
            if late || stop.check().is_err() {
                let _ = child.kill();
                let _ = child.wait();
                stop.check()?;
                return Err(lost(format!("it took more than {} s", PATIENCE.as_secs())));
            }
            std::thread::sleep(PAUSE);
        };
        if !matches!(status.code(), Some(0 | 1)) {
            let text = WRITTEN.read_text(&complained)?;
            let error = text.lines().find_map(|line| line.strip_prefix("error: "));
            return Err(lost(error.unwrap_or("the program failed on this").to_owned()));
        }
        let said = serde_json::from_str(&WRITTEN.read_text(&said)?);
        Ok((said.map_err(|error| lost(error.to_string()))?, folder))
    }
}

fn folder() -> Result<TempDir> {
    let builder = tempfile::Builder::new().prefix("noctograph-").tempdir();
    builder.map_err(|source| Error::write(&std::env::temp_dir(), source))
}
