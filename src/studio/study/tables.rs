//! Results of studies as CSV: a row for each flight, scene, level of disturbance or candidate.

use serde::Serialize;
use serde_json::{Value, json};

use super::{Endurance, Factor, Flown, Knob, Ranking, Record, Tuned};

/// A column: its name, and the path of its values in a row's JSON.
type Column = (String, String);

/// A row for each flight, in the order of the study.
#[must_use]
pub fn flights_csv(records: &[Record]) -> String {
    let verdict = "contender word seed read all_read legible probability log_odds similarity";
    let names = verdict.split(' ').chain(Flown::<f64>::NAMES).chain(["lost"]);
    let columns: Vec<Column> = names.map(|name| column(name, name)).collect();
    table(&columns, records.iter().map(value))
}

/// A row for each scene, the best first; intervals of 95 %.
#[must_use]
pub fn ranking_csv(ranking: &Ranking) -> String {
    let mut columns = vec![
        column("place", "place"),
        column("contender", "contender"),
        column("flights", "n_flights"),
        column("lost", "n_lost"),
    ];
    for name in ["legibility", "legible", "worst_decile", "all_read"] {
        columns.extend(estimate(name, name));
    }
    for name in Flown::<f64>::NAMES {
        columns.extend(estimate(name, &format!("flown/{name}")));
    }
    table(&columns, ranking.measures.iter().map(value))
}

/// A row for each factor and level.
#[must_use]
pub fn robustness_csv(endurances: &[Endurance]) -> String {
    let mut columns = vec![column("factor", "factor"), column("times", "level/times")];
    for name in ["legible", "all_read", "legibility"] {
        columns.extend(estimate(name, &format!("level/{name}")));
    }
    columns.extend([
        column("breaks_at", "breaks_at"),
        column("breaks_from", "breaks_between/0"),
        column("breaks_to", "breaks_between/1"),
        column("place", "place"),
    ]);
    let rows = endurances.iter().flat_map(|endurance| {
        let name = endurance.factor.map_or("all together", Factor::name);
        let row = move |level| {
            json!({
                "factor": name,
                "level": level,
                "breaks_at": endurance.breaks_at,
                "breaks_between": endurance.breaks_between,
                "place": endurance.place,
            })
        };
        endurance.levels.iter().map(row)
    });
    table(&columns, rows)
}

/// A row for each candidate, in the order of the search, with the scene's value of each key that a
/// knob turns.
#[must_use]
pub fn candidates_csv(tuned: &Tuned, knobs: &[Knob]) -> String {
    let mut columns = vec![
        column("number", "number"),
        column("flights", "n_flights"),
        column("given_up", "given_up"),
        column("merit", "merit"),
        column("legibility", "legibility"),
    ];
    columns.extend(estimate("legible", "legible"));
    columns.extend(["duration_s", "broken", "on_front"].map(|name| column(name, name)));
    let keys = knobs.iter().flat_map(|knob| &knob.keys);
    columns.extend(keys.map(|key| column(key, &format!("settings/{key}"))));
    let rows = tuned.candidates.iter().map(|candidate| {
        let mut row = value(candidate);
        row["on_front"] = tuned.front.contains(&candidate.number).into();
        row
    });
    table(&columns, rows)
}

fn column(name: &str, path: &str) -> Column {
    (name.to_owned(), format!("/{path}"))
}

/// The columns of an [`Estimate`](super::statistics::Estimate): its value and the ends of its
/// interval.
fn estimate(name: &str, path: &str) -> [Column; 3] {
    [("", "value"), ("_low", "low"), ("_high", "high")]
        .map(|(end, part)| column(&format!("{name}{end}"), &format!("{path}/{part}")))
}

fn value(row: &impl Serialize) -> Value {
    serde_json::to_value(row).expect("results are plain data")
}

fn table(columns: &[Column], rows: impl Iterator<Item = Value>) -> String {
    let mut out = csv::Writer::from_writer(Vec::new());
    let header: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
    let cells = |row: Value| {
        columns.iter().map(|(_, path)| row.pointer(path).map_or(String::new(), cell)).collect()
    };
    for row in std::iter::once(header).chain(rows.map(cells)) {
        out.write_record(row).expect("writing into memory");
    }
    String::from_utf8(out.into_inner().expect("in memory")).expect("text was written")
}

fn cell(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => {
            number.as_f64().map_or(String::new(), |number| number.to_string())
        }
        other => other.to_string(),
    }
}
