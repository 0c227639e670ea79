//! Tree of a JSON log: its values as they are read, each taken off the log's budget.
//!
//! A list of numbers is kept as such, and a list of objects becomes columns item by item, so that a
//! value takes a few bytes and not the hundreds of an object.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::cells::seconds_from_date;
use super::titles::meaning;
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
    /// Its numbers up to the first item of another kind; missing values are NaN.
    pub(super) numbers: Vec<f64>,
    /// The place and the value of the first item that is not a number.
    pub(super) odd: Option<(usize, String)>,
    /// The numbers of its objects by their names: the row, and the cell.
    pub(super) cells: BTreeMap<String, Vec<(usize, f64)>>,
    /// The first different texts: of the list itself under no name, of its objects by theirs.
    pub(super) texts: BTreeMap<String, Vec<String>>,
    /// The indices of its items, where they were written.
    pub(super) indices: Vec<f64>,
}

/// How many different texts are kept under a name.
const TEXTS: usize = 4;

/// Reads a value; beyond the budget it is an error, which the budget keeps.
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
            text => match seconds_from_date(text).filter(|_| text.contains(':')) {
                Some(stamp_s) => Node::Number(stamp_s),
                None => Node::Text(text.chars().take(40).collect()),
            },
        })
    }

    /// Reads a JSON array; of each item only the numbers stay in memory and budget.
    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> std::result::Result<Node, A::Error> {
        let Self(budget) = self;
        let mut list = List::default();
        for index in 0.. {
            let left = budget.bytes_left();
            let Some(item) = items.next_element_seed(self)? else { break };
            let held = left - budget.bytes_left();
            list.add(index, item, budget).map_err(A::Error::custom)?;
            // The item goes, its numbers stay.
            budget.free(held);
        }
        Ok(Node::List(list))
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
    /// The list of an object whose names are indices, as pandas writes a column or a table.
    pub(super) fn by_index(members: BTreeMap<String, Node>, budget: &Budget) -> Result<Self> {
        let mut list = Self::default();
        let items = members.into_iter().filter_map(|(key, item)| Some((index(&key)?, item)));
        let mut items: Vec<(f64, Node)> = items.collect();
        items.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        for (place, (index, item)) in items.into_iter().enumerate() {
            list.add(place, item, budget)?;
            list.indices.push(index);
        }
        // Rows without a time have that of their index.
        let has_time = list.cells.keys().any(|name| meaning(name).0 == "t");
        if !(list.is_counted() || list.cells.is_empty() || has_time) {
            budget.bytes(size_of::<(usize, f64)>() * list.indices.len())?;
            let stamps = list.indices.iter().copied().enumerate().collect();
            list.cells.insert("timestamp".to_owned(), stamps);
        }
        Ok(list)
    }

    /// Whether its indices count from zero.
    pub(super) fn is_counted(&self) -> bool {
        (0_u32..).zip(&self.indices).all(|(n, index)| f64::from(n) == *index)
    }

    /// Adds an item, or its numbers.
    fn add(&mut self, index: usize, item: Node, budget: &Budget) -> Result<()> {
        let begun = if index == 0 { BEGUN[1] } else { 0 };
        budget.steps(STEPS[0])?;
        budget.bytes(size_of::<f64>() + begun)?;
        match item {
            Node::Number(_) | Node::Missing if self.odd.is_some() => {}
            Node::Number(number) => push(&mut self.numbers, number),
            Node::Missing => push(&mut self.numbers, f64::NAN),
            item => {
                self.odd.get_or_insert_with(|| (index, item.text()));
                match item {
                    Node::Text(text) => self.text("", &text, budget)?,
                    Node::Object(members) => self.row(&members, "", index, budget)?,
                    _ => {}
                }
            }
        }
        Ok(())
    }

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
                Node::List(_) => self.text(&name, "a list", budget)?,
                Node::Missing => {}
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
}

/// Whether the names of an object are indices.
pub(super) fn is_indexed(members: &BTreeMap<String, Node>) -> bool {
    !members.is_empty() && members.keys().all(|key| index(key).is_some())
}

/// The number or the date that a name is.
fn index(name: &str) -> Option<f64> {
    name.parse().ok().filter(|index: &f64| index.is_finite()).or_else(|| seconds_from_date(name))
}
