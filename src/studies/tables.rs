//! Writes study results as CSV, with a row for each flight, scene or candidate.

use serde::Serialize;
use serde_json::Value;

use super::{Flown, Knob, Measures, Ranking, Record, Tuned};

/// A column: its name, and the JSON pointer to its value in a row.
type Column = (String, String);

/// Returns CSV with a row for each flight, in the order of the study.
pub fn flights_csv(records: &[Record]) -> String {
    let verdict =
        columns("contender word seed read all_read legible probability log_odds similarity");
    let flown = Flown::<f64>::NAMES.map(|name| column(name, name));
    table(verdict.chain(flown).chain(columns("lost")), records.iter().map(value))
}

/// Returns CSV with a row for each scene, best first, with 95 % intervals.
pub fn ranking_csv(ranking: &Ranking) -> String {
    let read = ["legibility", "legible", "worst_decile", "all_read"];
    let flown = Flown::<f64>::NAMES.map(|name| estimate(name, &format!("flown/{name}")));
    let columns = columns("place contender flights=n_flights lost=n_lost note")
        .chain(read.into_iter().flat_map(|name| estimate(name, name)))
        .chain(flown.into_iter().flatten())
        .chain(acuity_columns(ranking));
    let ranked = ranking.measures.iter().map(|measures| with_acuity(measures, ranking));
    table(columns, ranked.chain(ranking.unranked.iter().map(value)))
}

/// Returns CSV with a row for each submission. The mark is 100 times P(read), or 0 if the
/// submission is not ranked.
pub fn marks_csv(ranking: &Ranking) -> String {
    let ranked = ranking.measures.iter().map(|measures| {
        let Measures { n_lost, n_flights, .. } = measures;
        // Lost flights and identical submissions are noted for review by a person.
        let lost = (*n_lost > 0).then(|| format!("lost on {n_lost} of {n_flights} flights"));
        let equal = measures.equal_to.as_ref().map(|other| format!("flies exactly as {other}"));
        let mut row = with_acuity(measures, ranking);
        row["marks"] = ((1000.0 * measures.legibility.value).round() / 10.0).into();
        row["note"] = lost.into_iter().chain(equal).collect::<Vec<_>>().join("; ").into();
        row
    });
    let unranked = ranking.unranked.iter().map(|unranked| {
        let mut row = value(unranked);
        row["marks"] = 0.into();
        row
    });
    let names = "name=contender place p_read=legibility/value low=legibility/low \
                 high=legibility/high marks note";
    table(columns(names).chain(acuity_columns(ranking)), ranked.chain(unranked))
}

/// Returns the columns of the smallest legible letters, or none if they were not measured.
fn acuity_columns(ranking: &Ranking) -> impl Iterator<Item = Column> {
    ranking.acuity.iter().flat_map(|_| estimate("acuity_m", "acuity"))
}

/// Returns a contender's row with its acuity.
fn with_acuity(measures: &Measures, ranking: &Ranking) -> Value {
    let mut limits = ranking.acuity.iter().flat_map(|acuity| &acuity.limits);
    let limit = limits.find(|limit| limit.contender == measures.contender);
    let mut row = value(measures);
    row["acuity"] = value(&limit.map(|limit| limit.cap_height_m));
    row
}

/// Returns CSV with a row for each candidate in search order, with the values of varied keys.
pub fn candidates_csv(tuned: &Tuned, knobs: &[Knob]) -> String {
    let keys = knobs.iter().flat_map(|knob| &knob.keys);
    let columns = columns("number flights=n_flights given_up merit legibility")
        .chain(estimate("legible", "legible"))
        .chain(columns("duration_s broken on_front"))
        .chain(keys.map(|key| column(key, &format!("settings/{key}"))));
    let rows = tuned.candidates.iter().map(|candidate| {
        let mut row = value(candidate);
        row["on_front"] = tuned.front.contains(&candidate.number).into();
        row
    });
    table(columns, rows)
}

/// Returns a column, given the path of its value without the leading slash.
fn column(name: &str, path: &str) -> Column {
    (name.to_owned(), format!("/{path}"))
}

/// Returns columns from names separated by spaces. A path that differs from its name follows after
/// `=`.
fn columns(names: &str) -> impl Iterator<Item = Column> {
    names.split(' ').map(|name| {
        let (name, path) = name.split_once('=').unwrap_or((name, name));
        column(name, path)
    })
}

/// Returns the columns of an [`Estimate`](super::statistics::Estimate): value and interval.
fn estimate(name: &str, path: &str) -> [Column; 3] {
    [("", "value"), ("_low", "low"), ("_high", "high")]
        .map(|(end, part)| column(&format!("{name}{end}"), &format!("{path}/{part}")))
}

/// Returns a row as a JSON value.
fn value(row: &impl Serialize) -> Value {
    serde_json::to_value(row).expect("results are plain data")
}

/// Returns CSV with a header of column names. A value that a row lacks becomes an empty cell.
fn table(columns: impl Iterator<Item = Column>, rows: impl Iterator<Item = Value>) -> String {
    let (names, paths): (Vec<String>, Vec<String>) = columns.unzip();
    let mut out = csv::Writer::from_writer(Vec::new());
    out.write_record(names).expect("writing into memory");
    for row in rows {
        let cells = paths.iter().map(|path| row.pointer(path).map_or(String::new(), cell));
        out.write_record(cells).expect("writing into memory");
    }
    String::from_utf8(out.into_inner().expect("in memory")).expect("text was written")
}

/// Returns a JSON value as a CSV cell. Students choose the names of submissions, so their text is
/// made harmless: an apostrophe before `=+-@` prevents a spreadsheet from interpreting it as a
/// formula (OWASP, CSV injection), and control characters, which terminals execute, become U+FFFD.
fn cell(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => {
            let apostrophe = if text.starts_with(['=', '+', '-', '@']) { "'" } else { "" };
            let is_control = |c: char| c.is_control() && c != '\n' && c != '\t';
            apostrophe.to_owned() + &text.replace(is_control, "\u{fffd}")
        }
        // Rust prints numbers without an exponent.
        Value::Number(number) if number.is_f64() => number.as_f64().unwrap_or(0.0).to_string(),
        other => other.to_string(),
    }
}
