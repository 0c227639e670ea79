//! Tree of a JSON log: its values as they are read, each taken off the log's budget.
//!
//! A list of numbers is kept as such, and a list of objects becomes columns item by item, so that a
//! value takes a few bytes and not the hundreds of an object.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use noctograph_core::error::Result;
use noctograph_core::files::{Budget, push};

/// Steps of reading a number, and a name besides its bytes.
const STEPS: [usize; 2] = [60, 200];

/// Memory of a name besides its bytes, in bytes.
const NAMED: usize = 160;
/// Memory of an object with its first name, whose node has room for eleven, and of a list with its
/// first number ([`push`]).
const BEGUN: [usize; 2] = [12 * 120, 64 * size_of::<f64>()];

/// A value.
#[derive(Debug)]
pub(super) enum Node {
    /// `null`, an empty text.
    Missing,
    /// The beginning of a text.
    Text(String),
    /// A number, a truth value.
    Number(f64),
    List(List),
    Object(BTreeMap<String, Self>),
}

/// A list of numbers, or of objects, each a row of cells.
#[derive(Debug, Default)]
pub(super) struct List {
    /// Its numbers up to the first item that is none; missing values are not a number.
    pub(super) numbers: Vec<f64>,
    /// The place and the value of the first item that is not a number.
    pub(super) odd: Option<(usize, String)>,
    /// The numbers of its objects by their names: the row, and the cell.
    pub(super) cells: BTreeMap<String, Vec<(usize, f64)>>,
    /// The first different texts: of the list itself under no name, of its objects by theirs.
    pub(super) texts: BTreeMap<String, Vec<String>>,
}

/// How many different texts are kept under a name.
const TEXTS: usize = 4;

/// Reads a value; what is beyond the budget is an error, which the budget keeps.
pub(super) fn read(text: &[u8], budget: &Budget) -> serde_json::Result<Node> {
    let mut json = serde_json::Deserializer::from_slice(text);
    let node = Tree(budget).deserialize(&mut json)?;
    json.end()?;
    Ok(node)
}

/// A name within an object; it costs its bytes.
pub(super) fn joined(prefix: &str, key: &str, budget: &Budget) -> Result<String> {
    budget.steps(STEPS[1] + prefix.len() + key.len())?;
    Ok(if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") })
}

impl Node {
    /// Its beginning, for messages.
    pub(super) fn text(&self) -> String {
        match self {
            Self::Missing => "no value".into(),
            Self::Text(text) => format!("{text:?}"),
            Self::Number(number) => number.to_string(),
            Self::List(_) => "a list".into(),
            Self::Object(_) => "an object".into(),
        }
    }
}

#[derive(Clone, Copy)]
struct Tree<'a>(&'a Budget);

impl<'de> DeserializeSeed<'de> for Tree<'_> {
    type Value = Node;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> std::result::Result<Node, D::Error> {
        json.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Tree<'_> {
    type Value = Node;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("a value")
    }

    fn visit_unit<E>(self) -> std::result::Result<Node, E> {
        Ok(Node::Missing)
    }

    fn visit_bool<E>(self, on: bool) -> std::result::Result<Node, E> {
        Ok(Node::Number(f64::from(u8::from(on))))
    }

    fn visit_i64<E>(self, number: i64) -> std::result::Result<Node, E> {
        Ok(Node::Number(number as f64))
    }

    fn visit_u64<E>(self, number: u64) -> std::result::Result<Node, E> {
        Ok(Node::Number(number as f64))
    }

    fn visit_f64<E>(self, number: f64) -> std::result::Result<Node, E> {
        Ok(Node::Number(number))
    }

    fn visit_str<E>(self, text: &str) -> std::result::Result<Node, E> {
        Ok(match text {
            "" => Node::Missing,
            text => Node::Text(text.chars().take(40).collect()),
        })
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> std::result::Result<Node, A::Error> {
        let Self(budget) = self;
        let mut list = List::default();
        let mut index = 0;
        loop {
            let left = budget.bytes_left();
            let Some(item) = items.next_element_seed(self)? else { return Ok(Node::List(list)) };
            budget.steps(STEPS[0]).map_err(A::Error::custom)?;
            match item {
                Node::Number(_) | Node::Missing if list.odd.is_some() => {}
                Node::Number(number) => push(&mut list.numbers, number),
                Node::Missing => push(&mut list.numbers, f64::NAN),
                item => {
                    list.odd.get_or_insert_with(|| (index, item.text()));
                    let held = left - budget.bytes_left();
                    if let Node::Text(text) = &item {
                        list.text("", text, budget).map_err(A::Error::custom)?;
                    }
                    if let Node::Object(members) = item {
                        list.row(&members, "", index, budget).map_err(A::Error::custom)?;
                    }
                    // The item goes, its numbers stay.
                    budget.free(held);
                }
            }
            let begun = if index == 0 { BEGUN[1] } else { 0 };
            budget.bytes(size_of::<f64>() + begun).map_err(A::Error::custom)?;
            index += 1;
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> std::result::Result<Node, A::Error> {
        let Self(budget) = self;
        let mut object = BTreeMap::new();
        while let Some(key) = members.next_key::<String>()? {
            budget.steps(STEPS[1] + key.len()).map_err(A::Error::custom)?;
            let begun = if object.is_empty() { BEGUN[0] } else { 0 };
            budget.bytes(NAMED + key.len() + begun).map_err(A::Error::custom)?;
            object.insert(key, members.next_value_seed(self)?);
        }
        Ok(Node::Object(object))
    }
}

impl List {
    /// Keeps the numbers of an object and of those in it, by their names with dots; the names in an
    /// object `data` stand alone.
    fn row(
        &mut self,
        members: &BTreeMap<String, Node>,
        prefix: &str,
        row: usize,
        budget: &Budget,
    ) -> Result<()> {
        for (key, value) in members {
            let name = joined(prefix, key, budget)?;
            match value {
                Node::Object(inner) if key == "data" => self.row(inner, prefix, row, budget)?,
                Node::Object(inner) => self.row(inner, &name, row, budget)?,
                Node::Number(number) => {
                    // A list that grows may hold twice its cells.
                    budget.bytes(2 * size_of::<(usize, f64)>())?;
                    if !self.cells.contains_key(&name) {
                        budget.bytes(NAMED + name.len())?;
                    }
                    self.cells.entry(name).or_default().push((row, *number));
                }
                Node::Text(text) => self.text(&name, text, budget)?,
                Node::Missing | Node::List(_) => {}
            }
        }
        Ok(())
    }

    /// Keeps a text, if it is one of the first different ones.
    fn text(&mut self, name: &str, text: &str, budget: &Budget) -> Result<()> {
        if !self.texts.contains_key(name) {
            budget.bytes(NAMED + name.len())?;
            self.texts.insert(name.to_owned(), Vec::new());
        }
        let texts = self.texts.entry(name.to_owned()).or_default();
        if texts.len() < TEXTS && !texts.iter().any(|known| known == text) {
            budget.bytes(NAMED + text.len())?;
            texts.push(text.to_owned());
        }
        Ok(())
    }

    /// The list of an object whose names are indices, as pandas writes a column, with its indices.
    pub(super) fn by_index(
        members: &BTreeMap<String, Node>,
        budget: &Budget,
    ) -> Result<Option<(Self, Vec<u64>)>> {
        let Some(items) = indexed(members) else { return Ok(None) };
        let (mut list, mut indices) = (Self::default(), Vec::new());
        for (place, (index, value)) in items.into_iter().enumerate() {
            indices.push(index);
            match value {
                Node::Number(number) => list.numbers.push(*number),
                Node::Missing => list.numbers.push(f64::NAN),
                Node::Text(text) => {
                    list.odd.get_or_insert_with(|| (place, value.text()));
                    list.text("", text, budget)?;
                }
                Node::List(_) | Node::Object(_) => return Ok(None),
            }
        }
        Ok(Some((list, indices)))
    }

    /// The rows of an object whose names are indices.
    pub(super) fn of_rows(
        members: &BTreeMap<String, Node>,
        budget: &Budget,
    ) -> Result<Option<Self>> {
        let Some(rows) = indexed(members) else { return Ok(None) };
        let mut list = Self::default();
        for (place, (_, row)) in rows.into_iter().enumerate() {
            let Node::Object(row) = row else { return Ok(None) };
            list.row(row, "", place, budget)?;
        }
        Ok(Some(list))
    }
}

/// The members of an object whose names are indices, in their order; `None` of any other.
fn indexed(members: &BTreeMap<String, Node>) -> Option<Vec<(u64, &Node)>> {
    let indices = members.iter().map(|(key, value)| Some((key.parse().ok()?, value)));
    let mut items: Vec<(u64, &Node)> = indices.collect::<Option<_>>()?;
    items.sort_by_key(|(index, _)| *index);
    Some(items).filter(|items| !items.is_empty())
}
