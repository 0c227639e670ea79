//! Writes the scene file as commented text, and finds unknown keys and the line numbers of errors.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use super::{LIMIT, Preset, Scene, implied};
use noctograph_core::crazyflie::Release;
use noctograph_core::error::{Error, Place, Result, Segment};
use noctograph_core::settings::{
    Described, Setting, Shape, Variant, joined, of_kind, similar, unknown_name,
};

/// Maximum line width of the printed file.
const WIDTH: usize = 80;
/// Name of the table (not a setting) that contains the SHA-256 of the files written with a scene.
const DIGESTS: &str = "sha256";
/// Advice for an invalid scene file.
pub(super) const HINT: &str = "`noctograph scene` prints every key with its meaning and range";

/// Returns the complete scene as a TOML file, in which each key has a comment.
pub(super) fn document(scene: &Scene) -> String {
    let values = scene.to_table();
    let mut text = "# A noctograph scene: everything that the photo depends on, in SI units,\n\
                    # with angles in radians. Omitted keys keep the values of the preset, except for\n\
                    # those that follow from a key that is set:\n"
        .to_owned();
    // The rules explain why some values differ from the preset although the file does not set them.
    for (when, then) in implied::RULES {
        wrap(&mut text, "#   ", "#     ", &format!("{when}: {then}"));
    }
    text.push('\n');
    write_settings(&mut text, "", Scene::SHAPE.settings(), &values);
    if scene.light.fixtures.is_none() {
        text += &lamps_of_deck(scene);
    }
    text
}

/// Returns true if a value is printed as a table or as a list of tables.
fn is_table(value: &Value) -> bool {
    value.is_table() || value.as_array().is_some_and(|rows| rows.iter().any(Value::is_table))
}

/// Appends the settings of a table whose dotted key is `path`, each with a comment, and its tables
/// after them.
fn write_settings(text: &mut String, path: &str, settings: &[Setting], values: &Table) {
    // In TOML, all keys after a table's header belong to that table, so tables must come last.
    let (tables, plain): (Vec<&Setting>, Vec<&Setting>) =
        settings.iter().partition(|setting| values.get(setting.key).is_some_and(is_table));
    // A setting without a value is printed as a comment.
    for setting in plain {
        write_comment(text, setting.doc, setting.range);
        if let Shape::Names(variants) = setting.shape {
            variants.iter().for_each(|variant| write_name(text, variant));
        }
        match values.get(setting.key) {
            Some(value) => write_entry(text, setting.key, value),
            None => *text += &format!("# {} =\n", setting.key),
        }
    }
    for setting in tables {
        let table_path = joined(path, setting.key);
        text.push('\n');
        write_comment(text, setting.doc, None);
        let Some(table) = values[setting.key].as_table() else {
            write_rows(text, &table_path, &values[setting.key]);
            continue;
        };
        *text += &format!("[{table_path}]\n");
        match setting.shape {
            Shape::Group(members) => write_settings(text, &table_path, members, table),
            Shape::Tagged(variants) => {
                variants.iter().for_each(|variant| write_name(text, variant));
                let kind = table.get("kind").and_then(Value::as_str).unwrap_or_default();
                *text += &format!("kind = \"{kind}\"\n");
                write_settings(text, &table_path, of_kind(variants, table), table);
            }
            Shape::Plain | Shape::Names(_) => {
                table.iter().for_each(|(key, value)| write_entry(text, key, value));
            }
        }
    }
}

/// Returns, for a scene without a list of lamps, the deck's lamps as comments that can be copied.
fn lamps_of_deck(scene: &Scene) -> String {
    let rows = Value::try_from(scene.light.fixtures()).expect("lamps are tables");
    let mut text = String::new();
    write_rows(&mut text, "light.fixtures", &rows);
    let lines = text.lines().map(|line| format!("# {line}").trim_end().to_owned() + "\n");
    "\n# The lamps of deck and board in the form of light.fixtures.\n".to_owned()
        + &lines.collect::<String>()
}

/// Appends a list of tables, whose dotted key is `path`, to the text.
fn write_rows(text: &mut String, path: &str, rows: &Value) {
    for (index, row) in rows.as_array().into_iter().flatten().enumerate() {
        let gap = if index > 0 { "\n" } else { "" };
        *text += &format!("{gap}[[{path}]]\n");
        row.as_table().into_iter().flatten().for_each(|(key, value)| write_entry(text, key, value));
    }
}

/// Appends a key with its value. A list that is longer than a line is split into several lines.
fn write_entry(text: &mut String, key: &str, value: &Value) {
    // Numbers are wrapped like words. Every other item is written on a separate line.
    let line = format!("{key} = {value}\n");
    match value.as_array() {
        Some(items) if line.chars().count() > WIDTH + 1 => {
            *text += &format!("{key} = [\n");
            if items.iter().all(|item| item.is_float() || item.is_integer()) {
                let items: Vec<String> = items.iter().map(Value::to_string).collect();
                wrap(text, "    ", "    ", &(items.join(", ") + ","));
            } else {
                items.iter().for_each(|item| *text += &format!("    {item},\n"));
            }
            *text += "]\n";
        }
        _ => *text += &line,
    }
}

/// Appends the first paragraph of a setting's documentation and its range as a comment.
fn write_comment(text: &mut String, doc: &[&str], range: Option<[f64; 2]>) {
    let mut words = first_paragraph(doc);
    if let Some([min, max]) = range {
        words += &format!(" ({min} to {max})");
    }
    wrap(text, "# ", "# ", &words);
}

/// Appends one name of a choice and its meaning as a comment.
fn write_name(text: &mut String, variant: &Variant) {
    let first = format!("#   {}: ", variant.name);
    wrap(text, &first, "#     ", &first_paragraph(variant.doc));
}

/// Returns the first paragraph of a documentation text, without markup for code and links.
fn first_paragraph(doc: &[&str]) -> String {
    let lines = doc.iter().map(|line| line.trim()).take_while(|line| !line.is_empty());
    lines.collect::<Vec<_>>().join(" ").replace("[`", "").replace("`]", "").replace('`', "")
}

/// Appends words in lines of at most [`WIDTH`] columns. The first line begins with `first`, and the
/// others begin with `next`.
fn wrap(text: &mut String, first: &str, next: &str, words: &str) {
    let mut line = first.to_owned();
    for word in words.split_whitespace() {
        // The prefix of the line may already end with a space.
        let space = if line.ends_with(' ') { "" } else { " " };
        if line.chars().count() + space.len() + word.chars().count() > WIDTH {
            *text += line.trim_end();
            text.push('\n');
            line = next.to_owned();
        } else {
            line += space;
        }
        line += word;
    }
    *text += line.trim_end();
    text.push('\n');
}

/// Parses the text of a scene file into a table of known keys, without digests. Errors contain the
/// file's name and the line number.
pub(super) fn read(toml: &str, file: &str) -> Result<Table> {
    let mut table: Table = toml.parse().map_err(|error: toml::de::Error| {
        let line = error.span().map_or(1, |span| line_at(toml, span.start));
        let actual = error.message().replace('\n', "; ");
        Error::input("", actual, "keys and values of a scene", HINT).in_file(file, line)
    })?;
    name_release(&mut table);
    take_digests(&mut table)
        .and_then(|_digests| check_keys(&table))
        .map_err(|error| with_line(error, toml, file))?;
    Ok(table)
}

/// Reads the text of a scene file. Returns an error if the file is empty.
pub(super) fn read_file(path: &Path) -> Result<String> {
    let text = LIMIT.read_text(path)?;
    if text.trim().is_empty() {
        let hint = "print the scene again, because the command that printed it may have failed";
        return Err(Error::input(path.display(), "an empty file", "a scene", hint));
    }
    Ok(text)
}

/// Returns the digests in the text of a scene file. The result is empty if the text is not TOML, an
/// error that is reported when the scene is read later.
pub(super) fn digests(toml: &str, file: &str) -> Result<BTreeMap<String, String>> {
    let mut table = toml.parse().unwrap_or_default();
    take_digests(&mut table).map_err(|error| with_line(error, toml, file))
}

/// Removes the digests from a scene file's table, so that only settings remain, and returns them by
/// the name of their file. Returns [`Error::Input`] if they are not digests.
fn take_digests(table: &mut Table) -> Result<BTreeMap<String, String>> {
    let Some(value) = table.remove(DIGESTS) else { return Ok(BTreeMap::new()) };
    let named = value.try_into::<BTreeMap<String, String>>().ok();
    let digests = named.filter(|digests| {
        // A SHA-256 has 64 hexadecimal digits.
        digests.values().all(|hex| hex.len() == 64 && hex.bytes().all(|b| b.is_ascii_hexdigit()))
    });
    digests.ok_or_else(|| {
        let wanted = "names of files, each with 64 hexadecimal digits";
        let hint = "leave the table as it was written, because it contains no settings";
        Error::input(DIGESTS, "something else", wanted, hint)
    })
}

/// Returns the text of a table of digests by the name of their file, which is written after a
/// scene's settings.
pub(super) fn digest_table(digests: BTreeMap<String, String>) -> String {
    let digests = Value::try_from(digests).expect("texts are a table");
    let table = Table::from_iter([(DIGESTS.to_owned(), digests)]);
    format!(
        "\n# SHA-256 of the files that this scene was written with. This is not a setting. The\n\
         # scene is refused if it is next to other files.\n{table}"
    )
}

/// Replaces a patch version of the firmware (`2025.12.1`) with the name of its release.
fn name_release(table: &mut Table) {
    let vehicle = table.get_mut("vehicle").and_then(Value::as_table_mut);
    let firmware = vehicle.and_then(|vehicle| vehicle.get_mut("firmware"));
    if let Some(Value::String(name)) = firmware
        && let Some(release) = Release::named(name)
    {
        release.name().clone_into(name);
    }
}

/// Checks that all keys and names in a scene's table exist.
pub(super) fn check_keys(table: &Table) -> Result<()> {
    check_settings("", Scene::SHAPE.settings(), table)
}

/// Checks that all keys and names in a table exist. `path` is the dotted key of the table, and is
/// empty for the whole scene.
fn check_settings(path: &str, settings: &[Setting], table: &Table) -> Result<()> {
    for (key, value) in table {
        let place = joined(path, key);
        let Some(setting) = settings.iter().find(|setting| setting.key == key) else {
            return Err(unknown_key(&place, key));
        };
        // Values of the wrong type are reported later, when the scene is read from the table.
        match (setting.shape, value) {
            (Shape::Group(settings), Value::Table(table)) => {
                check_settings(&place, settings, table)?;
            }
            (Shape::Names(_), Value::String(name)) => check_name(&place, name, setting.shape)?,
            (Shape::Tagged(_), Value::String(name)) => check_name(&place, name, setting.shape)?,
            (Shape::Tagged(variants), Value::Table(table)) => {
                check_choice(&place, setting.shape, variants, table)?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// Checks that the keys in a choice's table belong to its kind, or to any kind if none is given.
fn check_choice(path: &str, shape: Shape, variants: &[Variant], table: &Table) -> Result<()> {
    let kind = table.get("kind").and_then(Value::as_str);
    if let Some(kind) = kind {
        check_name(&format!("{path}.kind"), kind, shape)?;
    }
    for key in table.keys().filter(|key| *key != "kind") {
        let mut owners =
            variants.iter().filter(|variant| variant.settings.iter().any(|s| s.key == key));
        if owners.clone().any(|owner| kind.is_none_or(|kind| owner.name == kind)) {
            continue;
        }
        // If the key belongs to a different kind, the advice names that kind.
        let place = format!("{path}.{key}");
        let (Some(owner), Some(kind)) = (owners.next(), kind) else {
            return Err(unknown_key(&place, key));
        };
        let hint = format!("leave the key out, or set {path}.kind = \"{}\"", owner.name);
        return Err(Error::input(place, key, format!("a key of kind {kind}"), hint));
    }
    Ok(())
}

/// Checks that a name is one of a choice's names. `place` is the choice's dotted key.
fn check_name(place: &str, name: &str, shape: Shape) -> Result<()> {
    if noctograph_core::settings::names(shape).any(|variant| variant == name) {
        Ok(())
    } else {
        Err(unknown_name(place, name, shape))
    }
}

/// Returns the error for an unknown key, with the key that was probably intended.
fn unknown_key(place: &str, key: &str) -> Error {
    let paths = noctograph_core::settings::paths(Scene::SHAPE.settings());
    let same_name: Vec<&String> =
        paths.iter().filter(|path| path.rsplit('.').next() == Some(key)).collect();
    // The first suggestion is a key of this name in the same table, then a similar key, then the
    // only key of this name in any table.
    let table = place.split_inclusive('.').next().unwrap_or_default();
    let in_table: Vec<&String> =
        same_name.iter().copied().filter(|path| path.starts_with(table)).collect();
    let hint = match (&*in_table, similar(place, paths.iter().map(String::as_str)), &*same_name) {
        ([path], ..) | (_, None, [path]) => format!("the key is {path}"),
        (_, Some(path), _) => format!("did you mean {path}?"),
        _ => HINT.to_owned(),
    };
    Error::input(place, format!("the unknown key {key}"), "a key of a scene", hint)
}

/// Merges the table `over` into the table `base`, recursively. If the value of a choice is just a
/// name, the name sets the `kind`, and a new kind removes the choice's settings from `base`. In a
/// group that contains a `kind` among other keys, a new kind removes nothing.
pub(super) fn overlay(base: &mut Table, over: Table, settings: &[Setting]) {
    for (key, value) in over {
        let setting = settings.iter().find(|setting| setting.key == key);
        let shape = setting.map_or(Shape::Plain, |setting| setting.shape);
        // A plain name in `base` is first replaced by a table, so only tables have to be merged.
        if let (Shape::Tagged(_) | Shape::Group(_), Some(name @ Value::String(_))) =
            (shape, base.get_mut(&key))
        {
            let kind = name.as_str().unwrap_or_default().to_owned();
            *name = Value::Table(kind_table(kind));
        }
        match (shape, base.get_mut(&key), value) {
            (Shape::Tagged(variants), Some(Value::Table(base)), Value::Table(over)) => {
                overlay_choice(base, over, variants);
            }
            (Shape::Tagged(variants), Some(Value::Table(base)), Value::String(kind)) => {
                overlay_choice(base, kind_table(kind), variants);
            }
            (Shape::Group(settings), Some(Value::Table(base)), Value::Table(over)) => {
                overlay(base, over, settings);
            }
            (Shape::Group(settings), Some(Value::Table(base)), Value::String(kind))
                if settings.iter().any(|setting| setting.key == "kind") =>
            {
                overlay(base, kind_table(kind), settings);
            }
            (_, _, value) => {
                base.insert(key, value);
            }
        }
    }
}

/// Returns a table that contains only a `kind`.
fn kind_table(kind: String) -> Table {
    [("kind".to_owned(), Value::String(kind))].into_iter().collect()
}

/// Merges the table of a choice into `base`, or replaces `base` if the `kind` differs.
fn overlay_choice(base: &mut Table, over: Table, variants: &[Variant]) {
    match (over.get("kind"), base.get("kind")) {
        (Some(kind), Some(base_kind)) if kind != base_kind => *base = over,
        _ => {
            let settings = of_kind(variants, base);
            overlay(base, over, settings);
        }
    }
}

/// Returns the table for a single setting, given a dotted key and a value as TOML or plain text.
pub(super) fn single_setting(key: &str, value: &str) -> Result<Table> {
    let table = format!("value = {value}").parse::<Table>().ok();
    let parsed = table.filter(|table| table.len() == 1).and_then(|mut t| t.remove("value"));
    // If the key's value is text, digits are read as text, because a word may be 7.
    let defaults = Scene::preset(Preset::default()).to_table();
    let is_text = implied::value_at(&defaults, key).is_some_and(Value::is_str);
    let mut nested = match parsed {
        Some(parsed) if parsed.is_str() || !is_text => parsed,
        _ => Value::String(value.to_owned()),
    };
    // Each part of the key, from the last to the first, is a table around the value.
    for part in key.rsplit('.') {
        nested = Value::Table([(part.to_owned(), nested)].into_iter().collect());
    }
    let Value::Table(mut table) = nested else { unreachable!("a key has at least one part") };
    name_release(&mut table);
    check_keys(&table)?;
    Ok(table)
}

/// Returns the keys whose values differ from another scene's, each with this scene's and the other
/// scene's value, or `-` for none.
pub(super) fn changes(scene: &Scene, other: &Scene) -> Vec<[String; 3]> {
    let mut changes = Vec::new();
    compare(&mut changes, "", &scene.to_table(), &other.to_table());
    changes
}

/// Appends to `changes` the keys whose values differ between two tables, with both values. `path`
/// is the dotted key of the tables.
fn compare(changes: &mut Vec<[String; 3]>, path: &str, values: &Table, others: &Table) {
    // Choices of different kinds have different keys, so the keys of both tables are compared.
    let keys: BTreeSet<&String> = values.keys().chain(others.keys()).collect();
    for key in keys {
        let (key_path, pair) = (joined(path, key), [values.get(key), others.get(key)]);
        match pair {
            [Some(Value::Table(value)), Some(Value::Table(other))] => {
                compare(changes, &key_path, value, other);
            }
            [value, other] if value == other => {}
            _ => {
                let [value, other] =
                    pair.map(|value| value.map_or("-".to_owned(), Value::to_string));
                changes.push([key_path, value, other]);
            }
        }
    }
}

/// Adds the file to an error's place, and the line number if the place begins with a key of the
/// text `toml`.
pub(super) fn with_line(error: Error, toml: &str, file: &str) -> Error {
    let line = match &error {
        Error::Input { place, .. } => line_of(toml, place),
        _ => None,
    };
    error.in_file(file, line)
}

/// Returns the line number of a key, or that of the innermost table or list around it in the file.
/// Returns `None` if the file has none of them.
fn line_of(toml: &str, place: &Place) -> Option<u64> {
    let parsed = DeTable::parse(toml).ok()?;
    // The loop descends from table to table. A missing key has the preset's value.
    let mut value = &Spanned::new(0..0, DeValue::Table(parsed.into_inner()));
    let mut line = None;
    for segment in &place.0 {
        match segment {
            Segment::Key(keys) => {
                for key in keys.split('.') {
                    let Some((key, inner)) = value.get_ref().as_table()?.get_key_value(key) else {
                        return line;
                    };
                    line = Some(line_at(toml, key.span().start));
                    value = inner;
                }
            }
            Segment::Index(index) => {
                let Some(item) = value.get_ref().as_array().and_then(|list| list.get(*index))
                else {
                    return line;
                };
                line = Some(line_at(toml, item.span().start));
                value = item;
            }
            Segment::File(_) | Segment::Line(_) | Segment::Drone(_) => return line,
        }
    }
    line
}

/// Returns the line number, counted from 1, of a byte in the text.
fn line_at(text: &str, byte: usize) -> u64 {
    1 + text.bytes().take(byte).filter(|b| *b == b'\n').count() as u64
}

/// Reads a scene from a table of settings. For a value of the wrong type, the error names the key,
/// the value, and the type that is wanted.
pub(super) fn to_scene(values: Table) -> Result<Scene> {
    values.clone().try_into().map_err(|error| {
        let place = place_of(values, &error);
        let actual = error.message().replace('\n', "; ");
        // Values of the wrong type are the most common mistake, so serde's message is reworded.
        let mismatch =
            actual.strip_prefix("invalid type: ").and_then(|rest| rest.split_once(", expected "));
        match mismatch {
            Some((value, expected)) => {
                Error::input(place, in_words(value), in_words(expected), HINT)
            }
            None => Error::input(place, actual, "a value that matches the type of the key", HINT),
        }
    })
}

/// Returns the place of the value that a scene cannot have.
///
/// serde's message names the keys, without the indices of lists. A list is read in order, and no
/// setting accepts a date. A date therefore changes the message if it replaces the wrong element or
/// an earlier one. Bisection finds the last such element, which is the wrong one.
fn place_of(values: Table, error: &toml::de::Error) -> Place {
    let date = toml::value::Datetime { date: None, time: None, offset: None };
    let message = error.to_string();
    let dotted = message.trim_end().rsplit_once("in `").map_or("", |(_, keys)| keys);
    let mut values = Value::Table(values);
    let mut place = Vec::new();
    let mut keys = dotted.trim_end_matches('`').split('.').filter(|key| !key.is_empty()).peekable();
    while let Some(key) = keys.next() {
        place.push(Segment::Key(key.to_owned()));
        while let Some(Value::Array(list)) = value_at(&mut values, &place) {
            let indices: Vec<usize> = (0..list.len()).collect();
            let n_changing = indices.partition_point(|index| {
                let mut changed = values.clone();
                if let Some(Value::Array(list)) = value_at(&mut changed, &place) {
                    list[*index] = date.into();
                }
                let answer = changed.try_into::<Scene>();
                answer.err().is_none_or(|error| error.to_string() != message)
            });
            // An error about the list as a whole is at none of its elements.
            let is_whole = keys.peek().is_none() && message.starts_with("invalid length");
            if n_changing == 0 || is_whole {
                break;
            }
            place.push(Segment::Index(n_changing - 1));
        }
    }
    Place(place)
}

/// Returns the value at the keys and indices of a place.
fn value_at<'a>(values: &'a mut Value, place: &[Segment]) -> Option<&'a mut Value> {
    place.iter().try_fold(values, |value, segment| match segment {
        Segment::Key(key) => value.get_mut(key.as_str()),
        Segment::Index(index) => value.get_mut(*index),
        Segment::File(_) | Segment::Line(_) | Segment::Drone(_) => None,
    })
}

/// Returns the user-facing name of a type or value in a message of serde.
fn in_words(text: &str) -> String {
    const WORDS: [(&str, &str); 12] = [
        ("f64", "a number"),
        ("u8", "a whole number"),
        ("u32", "a whole number"),
        ("u64", "a whole number"),
        ("usize", "a whole number"),
        ("floating point ", "the number "),
        ("integer ", "the number "),
        ("a boolean", "true or false"),
        ("string ", "the text "),
        ("a sequence", "a list"),
        ("sequence", "a list"),
        ("map", "a table"),
    ];
    let word = WORDS.iter().find(|(serde, _)| text.starts_with(serde));
    word.map_or(text.to_owned(), |(serde, plain)| text.replacen(serde, plain, 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(toml: &str) -> (String, String) {
        let error = Scene::parse(toml, "my.toml").unwrap_err();
        (error.to_string(), error.hint().to_owned())
    }

    #[test]
    fn a_wrong_key_or_name_is_answered_with_the_right_one() {
        let hint = |toml| refused(toml).1;
        assert_eq!(hint("[plan]\nstroke_sped_m_s = 1.0"), "did you mean plan.stroke_speed_m_s?");
        assert_eq!(hint("[plan]\njerk_m_s3 = 20.0"), "the key is plan.style.jerk_m_s3");
        assert_eq!(hint("[observer]\nq = [1.0, 1.0, 1.0]"), "the key is observer.luenberger.q");
        assert_eq!(hint("[air]\ngust_time_s = 1.0"), "did you mean air.gusts.time_s?");
        assert_eq!(hint("[sensors]\nstations = []"), "the key is sensors.lighthouse.stations");
        assert_eq!(hint("[plan]\nstyle = \"evn\""), "did you mean even?");
        assert!(!hint("[sensors]\nnoise_m = 0.1").starts_with("the key is"), "several have it");
        assert_eq!(hint("preset = \"cf-21\""), "did you mean cf21?");
        let other = "[plan.style]\nkind = \"team\"\njerk_m_s3 = 20.0";
        assert!(hint(other).contains("plan.style.kind = \"even\""), "{}", hint(other));
        let (error, _) = refused("[plan]\nstroke_speed_m_s = \"fast\"");
        let wanted = "plan.stroke_speed_m_s: found the text \"fast\", wanted a number";
        assert_eq!(error, format!("my.toml:2: {wanted}"));
        let (error, _) = refused("plan.lights = 3");
        assert!(error.ends_with("found the number `3`, wanted a list"), "{error}");
    }

    #[test]
    fn a_wrong_element_of_a_list_is_named_by_its_index() {
        let lamp = "[[light.fixtures]]\naxis_body = [0.0, -1.0, 0.0]\n";
        for (toml, place) in [
            ("plan.lights = [\"ring\", \"ring\", 3, 4]", "my.toml:1: plan.lights[2]: "),
            ("plan.lights = [[], \"ring\"]", "my.toml:1: plan.lights[0]: "),
            (&format!("{lamp}{lamp}name = 0.5"), "my.toml:5: light.fixtures[1].name: "),
            (
                "light.fixtures = [{}, { axis_body = [0.0, 1.0] }]",
                "my.toml:1: light.fixtures[1].axis_body: ",
            ),
            (
                "light.fixtures = [{}, { axis_body = [0.0, 1.0, true] }]",
                "my.toml:1: light.fixtures[1].axis_body[2]: ",
            ),
        ] {
            let (error, _) = refused(toml);
            assert!(error.starts_with(place), "{error}");
        }
    }

    #[test]
    fn printed_lines_are_at_most_eighty_columns_of_comment() {
        let text = document(&Scene::preset(Preset::default()));
        let comments = text.lines().filter(|line| line.starts_with('#'));
        for line in comments {
            assert!(line.chars().count() <= WIDTH, "{line}");
        }
        assert!(text.contains("(0.001 to 100)\nstroke_speed_m_s = 0.2\n"), "{text}");
        assert!(text.contains("\n[plan.style]\n#   team: "), "{text}");
    }
}
