//! Flags and tables that the verbs of studies share.

use crate::photo;
use std::collections::HashSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::{
    Args, Error, OutputFolder, Progress, Report, Result, SetFlag, find_scene, json, message, table,
    warn_of_idle_keys, wrapped,
};
use crate::report::study_sheet;
use crate::scene::{NamedScene, Scene};
use crate::studies::statistics::Estimate;
use crate::studies::{
    Conditions, Measures, Prepared, Ranking, Record, Store, Study, Unranked, flights_csv,
    marks_csv, ranking_csv,
};
use noctograph_core::files::Limit;

/// Words, seeds and conditions of a study.
#[derive(Debug, Args)]
pub(super) struct StudyFlags {
    #[command(flatten)]
    set: SetFlag,
    /// Words, with their numbers of seeds where these differ: NOOR:200,LOG,WAX; or a file with one
    /// on each line
    #[arg(long, value_name = "WORD[:N],...", value_delimiter = ',', default_value = "NOOR")]
    words: Vec<String>,
    /// Seeds of each word [default: rank 50, or 20 with --task and more for over 229 submissions;
    /// tune 6]
    #[arg(long, value_name = "N")]
    seeds: Option<u32>,
    /// Seed that all seeds are drawn from
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// How flights differ from their scene: room (the scene's drone, another room and evening),
    /// drone (any drone of its make as well), evening (the room, with faults of radio, heading,
    /// propeller and battery), still (noise alone), or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "room")]
    conditions: String,
}

impl StudyFlags {
    /// A scene with the keys that were set.
    pub(super) fn scene(&self, named: &str, conditions: &Conditions) -> Result<NamedScene> {
        let named = find_scene(named, &self.set.set)?;
        // Conditions may bring a radio that loses packets.
        let radio = conditions.draw(&named.scene, 0, 0).sim.radio;
        warn_of_idle_keys(&Scene { radio, ..named.scene.clone() }, &[]);
        Ok(named)
    }

    pub(super) fn conditions(&self) -> Result<Conditions> {
        Conditions::find(&self.conditions)
    }

    /// The words with their numbers of seeds, where none is given a usual one.
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

    fn word(&self, text: &str, usual: u32) -> Result<(String, u32)> {
        let Some((word, n)) = text.rsplit_once(':') else {
            return Ok((text.to_owned(), self.seeds.unwrap_or(usual)));
        };
        let n = n.parse().map_err(|_not_a_number| {
            let wanted = "WORD:N with a whole number of seeds";
            Error::input("words", text, wanted, "for example NOOR:200,LOG:20")
        })?;
        Ok((word.to_owned(), n))
    }
}

/// Whether a word looks like the name of a file.
fn is_path(named: &str) -> bool {
    let lower = named.to_lowercase();
    named.contains(['/', '\\'])
        || [".txt", ".csv", ".tsv", ".lst"].iter().any(|end| lower.ends_with(end))
}

const LIST: Limit = Limit {
    bytes: 1 << 20,
    what: "a list of words or conditions",
    hint: "split it, or shorten it",
};

/// Opens a study's folder of flights, and says how many are there already.
pub(super) fn open_store(folder: &Path) -> Result<Store> {
    let store = Store::open(folder)?;
    if store.n_known() > 0 {
        let text = format!("{}: {} flights are there already", folder.display(), store.n_known());
        message("note: ", &text);
    }
    Ok(store)
}

/// Opens the folder of a study for the files that are written at its end.
pub(super) fn open_results(folder: &Path, names: &[impl AsRef<Path>]) -> Result<OutputFolder> {
    let results = OutputFolder::create(folder)?;
    results.expects(names).map(|()| results)
}

/// A progress bar that any thread may call with the number of `total` that are done.
pub(super) fn counter(what: &'static str, total: usize) -> impl Fn(usize) + Sync {
    let progress = Mutex::new(Progress::new(what));
    move |done| {
        if let Ok(mut progress) = progress.lock() {
            progress.update(done as f64 / total.max(1) as f64);
        }
    }
}

/// Files of a ranking: both tables, the ranking as JSON, and a sheet of photos.
pub(super) const RANKING: [&str; 4] = ["ranking.csv", "ranking.json", "flights.csv", "photos.png"];
/// The same, and the marks of submissions.
pub(super) const GRADED: [&str; 5] =
    ["marks.csv", "ranking.csv", "ranking.json", "flights.csv", "photos.png"];

pub(super) fn write_ranking(
    folder: OutputFolder,
    names: &[&str],
    study: &Study,
    ready: &[Prepared],
    ranking: &Ranking,
    records: &[Record],
) -> Result<Vec<PathBuf>> {
    let sheet = study_sheet(study, ready, ranking, records)?;
    let [csv, json, flights, photos] = RANKING;
    folder.write(csv, |out| out.write_all(ranking_csv(ranking).as_bytes()))?;
    folder.write(json, |out| {
        serde_json::to_writer_pretty(&mut *out, ranking)?;
        writeln!(out)
    })?;
    folder.write(flights, |out| out.write_all(flights_csv(records).as_bytes()))?;
    folder.write(photos, |out| photo::write_png(&sheet, out, None, &[]))?;
    if names == GRADED {
        folder.write(GRADED[0], |out| out.write_all(marks_csv(ranking).as_bytes()))?;
    }
    folder.keep(names)
}

/// A ranking for people and for programs.
pub fn ranking_report(study: &Study, ranking: &Ranking, flights: usize) -> Report {
    let json = json!({
        "flights": flights, "measures": ranking.measures, "pairs": ranking.pairs,
        "least_flights": ranking.least_flights, "unranked": ranking.unranked,
    });
    Report::new(ranking_table(study, ranking) + "\n", json)
}

pub(super) fn ranking_table(study: &Study, ranking: &Ranking) -> String {
    let words = match study.words.as_slice() {
        [(word, n)] => format!("{word}, {n} seeds"),
        words => {
            let flights: usize = words.iter().map(|(_, n)| *n as usize).sum();
            format!("{} words, {flights} flights each scene", words.len())
        }
    };
    wrapped("", &format!("{words}; the same seeds for all; intervals of 95 %"))
        + &legibility_table(&ranking.measures)
        + &unranked_lines(&ranking.unranked)
        + &wrapped("\n", P_READ)
        + &tracking_table(&ranking.measures)
        + &pairs_table(ranking)
}

fn legibility_table(measures: &[Measures]) -> String {
    let row = |(m, name): (&Measures, String)| {
        let (p, worst) = (m.legibility, m.worst_decile.value);
        let [legible, interval] = share(&m.legible);
        format!(
            "{:>2}\t{name}\t{:.3}\t  {:.3} to {:.3}\t{legible}\t{interval}\t{worst:.3}\t{}",
            m.place.map_or("-".into(), |place| place.to_string()),
            p.value,
            p.low,
            p.high,
            m.n_lost
        )
    };
    let head = "<4|scene<16|P(read)>7|  interval<16|legible>9|interval>12|worst 10 %>11|lost>5";
    "\n".to_owned() + &table(head, measures.iter().zip(labels(measures, 16)).map(row))
}

fn unranked_lines(unranked: &[Unranked]) -> String {
    unranked.iter().map(|it| wrapped(" -  ", &format!("{} {}", it.contender, it.note))).collect()
}

/// What P(read) is.
const P_READ: &str = "P(read): mean readability of the photos; where another word is likelier than \
                      the right one, a photo counts no more than the right one's share";

/// A share and its interval in percent.
pub(super) fn share(share: &Estimate) -> [String; 2] {
    let [value, low, high] = [share.value, share.low, share.high].map(|share| 100.0 * share);
    [format!("{value:.1} %"), format!("{low:.0} to {high:.0} %")]
}

fn tracking_table(measures: &[Measures]) -> String {
    let units = "\tmm\ts\tmm\tmm\tmm\tmm\t%\ts\tJ".to_owned();
    let row = |(m, name): (&Measures, String)| {
        let Some(f) = &m.flown else { return format!("{name}\tlost on every flight") };
        let mm = |e: Estimate| 1e3 * e.value;
        format!(
            "{name}\t{:.1}\t{:.2}\t{:.1}\t{:.1}\t{:.1}\t{:.1}\t{:.1}\t{:.1}\t{:.0}",
            mm(f.contour_m),
            f.lag_s.value,
            mm(f.rmse_x_m),
            mm(f.rmse_y_m),
            mm(f.rmse_z_m),
            mm(f.drift_y_m),
            100.0 * f.saturated_frac.value,
            f.duration_s.value,
            f.energy_j.value
        )
    };
    let rows = measures.iter().zip(labels(measures, 16)).map(row);
    let head = "scene<16|contour>7|lag>7|rms x>7|y>6|z>6|y max>8|sat.>7|time>7|energy>8";
    "\n".to_owned() + &table(head, std::iter::once(units).chain(rows))
}

/// Most pairs that a table names: thirty scenes have 435.
const MOST_PAIRS: usize = 30;

/// Which scenes cannot be told apart, and from how many flights they could.
fn pairs_table(ranking: &Ranking) -> String {
    let (mut text, pairs) = (String::new(), &ranking.pairs);
    let names = labels(&ranking.measures, 20);
    let name = |contender: &str| {
        let measured = ranking.measures.iter().zip(&names).find(|(m, _)| m.contender == contender);
        measured.map_or("", |(_, name)| name.as_str()).to_owned()
    };
    let n_flights = ranking.measures.first().map_or(0, |measures| measures.n_flights);
    if !pairs.is_empty() && n_flights < ranking.least_flights as usize {
        let few = format!(
            "too few flights: with {n_flights} each, {} scenes cannot be told apart; at least {} are \
             needed",
            ranking.measures.len(),
            ranking.least_flights
        );
        text += &wrapped("\n", &few);
    }
    let alike: Vec<_> = pairs.iter().filter(|pair| !pair.distinguishable).collect();
    text += match (pairs.len(), alike.len()) {
        (0, _) => "",
        (_, 0) => "\nall scenes are distinguishable from each other\n",
        _ => "\nNOT distinguishable (difference in P(read), interval for all pairs together):\n",
    };
    for pair in alike.iter().take(MOST_PAIRS) {
        let d = pair.difference;
        text += &format!(
            "  {} and {}: {:+.4}, {:+.4} to {:+.4}\n",
            name(&pair.better),
            name(&pair.worse),
            d.value,
            d.low,
            d.high
        );
    }
    if let Some(n @ 1..) = alike.len().checked_sub(MOST_PAIRS) {
        text += &format!("  and {n} pairs more: ranking.json\n");
    }
    text
}

/// Names of scenes in columns of `width`, no two alike.
fn labels(measures: &[Measures], width: usize) -> Vec<String> {
    let names: Vec<&str> = measures.iter().map(|m| m.contender.as_str()).collect();
    shortened(&names, width - 1)
}

/// Distinct names with at most `n` characters each: of those that are longer the beginning; where
/// two would then be alike, the end; where these are alike as well, the beginning and a number.
fn shortened(names: &[&str], n: usize) -> Vec<String> {
    let cut = |name: &str, keep: &dyn Fn(&[char]) -> String| {
        let all: Vec<char> = name.chars().collect();
        if all.len() <= n { name.to_owned() } else { keep(&all) }
    };
    let beginning = |name: &str, n: usize| name.chars().take(n - 1).collect::<String>() + "…";
    let end = |all: &[char]| "…".chars().chain(all[all.len() + 1 - n..].iter().copied()).collect();
    let heads = names.iter().map(|name| cut(name, &|_| beginning(name, n)));
    let tails = names.iter().map(|name| cut(name, &end));
    let ways: [Vec<String>; 2] = [heads.collect(), tails.collect()];
    let is_distinct = |way: &&Vec<String>| way.iter().collect::<HashSet<_>>().len() == way.len();
    ways.iter().find(is_distinct).cloned().unwrap_or_else(|| {
        let numbered = |(index, name): (usize, &&str)| {
            let number = (index + 1).to_string();
            cut(name, &|_| beginning(name, n - number.len()) + &number)
        };
        names.iter().enumerate().map(numbered).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortened_names_stay_apart() {
        let long = |end: &str| format!("a-scene-with-a-long-name{end}");
        let of = |names: &[String]| {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let found = shortened(&names, 12);
            assert!(found.iter().all(|name| name.chars().count() <= 12), "{found:?}");
            found
        };
        assert_eq!(of(&["team".into(), long("")]), ["team", "a-scene-wit…"]);
        assert_eq!(of(&[long("-1"), long("-2")]), ["…long-name-1", "…long-name-2"]);
        let both = [long("-x-and-the-end"), long("-y-and-the-end"), "team".into()];
        assert_eq!(of(&both), ["a-scene-wi…1", "a-scene-wi…2", "team"]);
        assert_eq!(of(&["zażółć-gęślą-jaźń".into()]), ["zażółć-gęśl…"]);
    }
}
