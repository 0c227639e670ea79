//! Flags and tables of both `rank` and `tune`.

use crate::photo;
use std::collections::HashSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::flags::{SetFlag, find_scene, warn_of_unused_keys};
use super::outcome::Report;
use super::output::OutputFolder;
use super::progress::Progress;
use super::show::LEAD_S;
use super::terminal::message;
use crate::error::{Error, Result};
use crate::report::study_sheet;
use crate::scene::{NamedScene, Scene};
use crate::studies::{
    Conditions, HeightLimit, Prepared, Ranking, Record, Store, Study, flights_csv, marks_csv,
    ranking_csv,
};
use clap::Args;
use noctograph_core::files::{Limit, is_file_name};
use serde_json::{Value, json};

/// Flags for the words, seeds and conditions of a study.
#[derive(Debug, Args)]
pub(super) struct StudyFlags {
    #[command(flatten)]
    set: SetFlag,
    /// Words, optionally with a number of seeds, such as NOOR:200,LOG,WAX, or a file with one word
    /// per line
    #[arg(long, value_name = "WORD[:N],...", value_delimiter = ',', default_value = "NOOR")]
    words: Vec<String>,
    /// Number of seeds per word [default: rank 50, or 100 with --task, tune 6]
    #[arg(long, value_name = "N")]
    seeds: Option<u32>,
    /// Seed from which the seeds of all flights are derived. A seed of 2^32 or above cannot be
    /// found by trial
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// Conditions under which flights vary: room (the scene's drone in varied rooms and evenings),
    /// drone (also varied drones of the same model), evening (like room, with faults of radio,
    /// heading, propeller and battery), still (only noise), or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "room")]
    conditions: String,
}

impl StudyFlags {
    /// Returns the scene with this name and the settings of `--set`, and warns of keys without
    /// effect.
    pub(super) fn scene(&self, named: &str, conditions: &Conditions) -> Result<NamedScene> {
        let named = find_scene(named, &self.set.set)?;
        // If the conditions add packet loss, radio keys have an effect.
        let radio = conditions.draw(&named.scene, 0, 0).sim.radio;
        warn_of_unused_keys(&Scene { radio, ..named.scene.clone() }, &[]);
        Ok(named)
    }

    /// Reads the conditions of `--conditions`.
    pub(super) fn conditions(&self) -> Result<Conditions> {
        Conditions::find(&self.conditions)
    }

    /// Returns the words, each with its number of seeds, which is `usual` by default. The name of
    /// an existing file stands for the words in its lines, except for empty lines and those that
    /// begin with `#`. The name of a missing file is an error.
    pub(super) fn words(&self, usual: u32) -> Result<Vec<(String, u32)>> {
        let mut words = Vec::new();
        for named in &self.words {
            if Path::new(named).is_file() {
                let text = LIST.read_text(named.as_ref())?;
                let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
                for line in lines.filter(|line| !line.starts_with('#')) {
                    words.push(self.word(line, usual)?);
                }
            } else if is_path(named) {
                return Err(Error::read(named.as_ref(), std::io::ErrorKind::NotFound.into()));
            } else {
                words.push(self.word(named, usual)?);
            }
        }
        Ok(words)
    }

    /// Returns a word and its number of seeds from an argument such as `NOOR:200`. Without a
    /// number, it is that of `--seeds` or `usual`.
    fn word(&self, text: &str, usual: u32) -> Result<(String, u32)> {
        let Some((word, n)) = text.rsplit_once(':') else {
            return Ok((text.to_owned(), self.seeds.unwrap_or(usual)));
        };
        let n = n.parse().map_err(|_not_a_number| {
            let wanted = "WORD:N, where N is a whole number of seeds";
            Error::input("words", text, wanted, "for example NOOR:200,LOG:20")
        })?;
        Ok((word.to_owned(), n))
    }
}

/// True if a word looks like the name of a file.
fn is_path(named: &str) -> bool {
    named.contains(['/', '\\']) || is_file_name(named)
}

const LIST: Limit = Limit {
    bytes: 1 << 20,
    what: "a list of words or conditions",
    hint: "split the list, or shorten it",
};

/// Opens the store of flights in a folder, and prints a note if it already contains flights.
pub(super) fn open_store(folder: &Path) -> Result<Store> {
    let store = Store::open(folder)?;
    if store.n_known() > 0 {
        let text = format!(
            "{}: the folder already contains {} flights",
            folder.display(),
            store.n_known()
        );
        message("note: ", &text);
    }
    Ok(store)
}

/// Opens the folder of a study for the files that are written at the end of the study.
pub(super) fn open_results(folder: &Path, names: &[impl AsRef<Path>]) -> Result<OutputFolder> {
    let results = OutputFolder::create(folder)?;
    results.check_writable(names).map(|()| results)
}

/// Returns a progress bar as a function, which any thread may call with the number of finished
/// items.
pub(super) fn counter(what: &'static str, total: usize) -> impl Fn(usize) + Sync {
    let progress = Mutex::new(Progress::new(what));
    move |done| {
        if let Ok(mut progress) = progress.lock() {
            progress.update(done as f64 / total.max(1) as f64);
        }
    }
}

/// Names of a ranking's files: the ranking as a table and as JSON, the table of flights, and a
/// sheet of photos.
pub(super) const RANKING: [&str; 4] = ["ranking.csv", "ranking.json", "flights.csv", "photos.png"];
/// Names of the files of a ranking of submissions, which include the marks.
pub(super) const GRADED: [&str; 5] =
    ["marks.csv", "ranking.csv", "ranking.json", "flights.csv", "photos.png"];

/// Writes the tables and the photos of a ranking into a folder, and the table of marks if the
/// scenes are submissions to be graded. Returns the paths.
pub(super) fn write_ranking(
    mut folder: OutputFolder,
    is_graded: bool,
    study: &Study,
    ready: &[Prepared],
    ranking: &Ranking,
    records: &[Record],
) -> Result<Vec<PathBuf>> {
    let sheet = study_sheet(study, ready, ranking, records)?;
    let [csv, json, flights, photos] = RANKING;
    folder.write(csv, ranking_csv(ranking))?;
    folder.write_with(json, |out| {
        serde_json::to_writer_pretty(&mut *out, ranking)?;
        writeln!(out)
    })?;
    folder.write(flights, flights_csv(records))?;
    folder.write(photos, photo::encode_png(&sheet, None, &[]))?;
    if is_graded {
        folder.write(GRADED[0], marks_csv(ranking))?;
    }
    folder.keep()
}

/// Returns the report on a ranking. `flights` is the number of flights that were flown.
pub fn ranking_report(study: &Study, ranking: &Ranking, flights: usize) -> Report {
    let product = json!({
        "flights": flights, "measures": ranking.measures, "pairs": ranking.pairs,
        "least_flights": ranking.least_flights, "unranked": ranking.unranked,
        "acuity": ranking.acuity,
    });
    // The text lists the first pairs that cannot be distinguished.
    let pairs = &ranking.pairs;
    let alike: Vec<_> = pairs.iter().filter(|pair| !pair.distinguishable).collect();
    let shown = &alike[..alike.len().min(MOST_PAIRS)];
    let names = shown.iter().map(|pair| [&pair.better, &pair.worse].map(|n| label(ranking, n)));
    let places = ranking.measures.iter().map(|m| place(m.place));
    let mut flown = ranking.measures.iter().filter_map(|measures| measures.flown);
    let has_lead = flown.any(|flown| flown.lag_s.value < LEAD_S);
    let n_words = study.words.len();
    let n_flights: usize = study.words.iter().map(|(_, n)| *n as usize).sum();
    let n_each = ranking.measures.first().map_or(0, |measures| measures.n_flights);
    let is_few = !pairs.is_empty() && n_each < ranking.least_flights as usize;
    let acuity = ranking.acuity.as_ref();
    let limits = acuity.map(|acuity| {
        acuity.limits.iter().map(|limit| limit_row(ranking, limit)).collect::<Vec<_>>()
    });
    let words = json!({
        "limits": limits,
        "n_ladder": acuity.and_then(|acuity| acuity.limits.first()).map(|limit| limit.n_flights),
        "word": study.words.first().filter(|_| n_words == 1).map(|(word, _)| word),
        "n_words": Some(n_words).filter(|n| *n > 1), "n_flights": n_flights,
        "names": labels(ranking, 16), "places": places.collect::<Vec<_>>(),
        "lead": has_lead.then_some("ahead of it (a lead)"),
        "equal": ranking.measures.iter().filter(|it| it.equal_to.is_some()).collect::<Vec<_>>(),
        "few": is_few.then_some(n_each),
        "n_scenes": ranking.measures.len(), "pairs": names.collect::<Vec<_>>(),
        "all": (alike.is_empty() && !pairs.is_empty()).then_some("all scenes"),
        "differ": alike.first().map(|_| "difference"), "alike": shown,
        "n_more": Some(alike.len() - shown.len()).filter(|n| *n > 0),
    });
    Report::with_words(product, &words, RANKED)
}

/// Returns a scene's row in the table of `--acuity`: the smallest legible height beside the mean
/// contour error, which is null if no flight was flown.
fn limit_row(ranking: &Ranking, limit: &HeightLimit) -> Value {
    let measures = ranking.measures.iter().find(|it| it.contender == limit.contender);
    let contour_m = measures.and_then(|it| it.flown).map(|flown| flown.contour_m.value);
    json!({
        "name": label(ranking, &limit.contender), "contour_m": contour_m,
        "place": place(limit.place), "height": limit.cap_height_m,
    })
}

/// Returns a scene's place in a ranking as text, or a dash if the scene is not ranked.
fn place(place: Option<usize>) -> String {
    place.map_or("-".into(), |place| place.to_string())
}

/// Returns the shortened name of a scene in a list of pairs, or `None` for a scene that is not
/// ranked.
fn label(ranking: &Ranking, contender: &str) -> Option<String> {
    let index = ranking.measures.iter().position(|it| it.contender == contender)?;
    labels(ranking, 20).into_iter().nth(index)
}

const RANKED: &str = "\
{word}, {n_flights} seeds; the same seeds for all; intervals of 95 %
{n_words} words, {n_flights} flights each scene; the same seeds for all; intervals of 95 %

|measures|<4|scene<16|P(read)>7|  interval<16|legible/%>9|interval/%>12|worst 10 %>11|lost>5
 {places.#}|{names.#}|{legibility.value:.3}|  {legibility.low:.3} to {legibility.high:.3}|{legible.value*100:.1}|{legible.low*100:.0} to {legible.high*100:.0}|{worst_decile.value:.3}|{n_lost}
*unranked  -  {contender} {note}

P(read): mean readability of the photos. If another word is likelier, a photo counts at most the right word's relative probability

|measures|scene<16|contour/mm>7|lag/s>7|rms x/mm>7|y/mm>6|z/mm>6|y max/mm>8|sat./%>7|time/s>7|energy/J>8
{names.#}|{flown.contour_m.value*1e3:.1}|{flown.lag_s.value:.2}|{flown.rmse_x_m.value*1e3:.1}|{flown.rmse_y_m.value*1e3:.1}|{flown.rmse_z_m.value*1e3:.1}|{flown.drift_y_m.value*1e3:.1}|{flown.saturated_frac.value*100:.1}|{flown.duration_s.value:.1}|{flown.energy_j.value:.0}
lag: behind the design; negative: {lead}

*equal {contender} flies exactly as {equal_to}, to the last bit

acuity: cap height at which half of the letters are read, by {n_ladder} flights of each scene at seven heights

|limits|<4|scene<16|acuity/mm>9|  interval<16|contour/mm>11
 {place}|{name}|{height.value*1e3:.1}|  {height.low*1e3:.1} to {height.high*1e3:.1}|{contour_m*1e3:.1}

too few flights: with {few} each, {n_scenes} scenes cannot be distinguished; at least {least_flights} are needed

{all} are distinguishable from each other
NOT distinguishable ({differ} in P(read), interval for all pairs together):
*alike   {pairs.#.0} and {pairs.#.1}: {difference.value:+.4}, {difference.low:+.4} to {difference.high:+.4}
  and {n_more} more pairs in ranking.json

";

/// Maximum number of pairs in the text. Thirty scenes form 435 pairs.
const MOST_PAIRS: usize = 30;

/// Returns the names of scenes, shortened to a column of `width` characters, and distinct.
fn labels(ranking: &Ranking, width: usize) -> Vec<String> {
    // One character of the column is left free as a gap.
    let names: Vec<&str> = ranking.measures.iter().map(|m| m.contender.as_str()).collect();
    shortened(&names, width - 1)
}

/// Returns names shortened to their last `n` characters, including a leading `…`. If two shortened
/// names are equal, all names are numbered instead, as in `1…`.
pub(super) fn shortened(names: &[&str], n: usize) -> Vec<String> {
    let ends: Vec<String> = names.iter().map(|name| end_of(name, "…", n)).collect();
    if ends.iter().collect::<HashSet<_>>().len() == ends.len() {
        return ends;
    }
    (1..).zip(names).map(|(number, name)| end_of(name, &format!("{number}…"), n)).collect()
}

/// Returns a name of up to `n` characters unchanged. For a longer name, returns `head` followed by
/// the end of the name.
fn end_of(name: &str, head: &str, n: usize) -> String {
    let n_characters = name.chars().count();
    if n_characters <= n {
        return name.to_owned();
    }
    head.chars().chain(name.chars().skip(n_characters + head.chars().count() - n)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortened_names_stay_apart() {
        fn long(end: &str) -> String {
            format!("a-scene-with-a-long-name{end}")
        }
        fn lines(names: &[String]) -> Vec<String> {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let actual = shortened(&names, 12);
            assert!(actual.iter().all(|name| name.chars().count() <= 12), "{actual:?}");
            actual
        }
        assert_eq!(lines(&["team".into(), long("")]), ["team", "…a-long-name"]);
        assert_eq!(lines(&[long("-1"), long("-2")]), ["…long-name-1", "…long-name-2"]);
        let both = [long("-x-and-the-end"), long("-y-and-the-end"), "team".into()];
        assert_eq!(lines(&both), ["1…nd-the-end", "2…nd-the-end", "team"]);
        assert_eq!(lines(&["zażółć-gęślą-jaźń".into()]), ["…-gęślą-jaźń"]);
    }
}
