//! XML: how much work a document takes to parse.
//!
//! The parser compares each attribute with all others of its tag, each prefix with all namespaces
//! around, and each reference with all entities. It ends entities that stand for each other.

use std::collections::HashSet;

use noctograph_core::error::{Error, Result};
use noctograph_core::files::Budget;

/// Steps of comparing two names, and of putting an entity in.
const STEPS: [usize; 2] = [4, 200];

/// Most bytes that a document's entities become.
const MAX_BYTES: usize = 16 << 20;

/// Most entities that the parser puts in for one reference.
const MOST_WITHIN: usize = 256;

/// Takes the entities of a document off a budget; `refuse` makes an error of what was found instead
/// of entities that stay small.
pub(super) fn check_entities(
    xml: &str,
    budget: &Budget,
    refuse: impl Fn(String) -> Error,
) -> Result<()> {
    let (mut n_values, mut longest, mut nested) = (0_usize, 0, false);
    let mut rest = xml;
    while let Some((_, declaration)) = rest.split_once("<!ENTITY") {
        rest = declaration;
        let mut parts = declaration.trim_start().splitn(2, char::is_whitespace);
        let (Some(name), Some(value)) = (parts.next(), parts.next()) else { continue };
        let value = value.trim_start();
        let Some(quote) = value.chars().next().filter(|c| matches!(c, '"' | '\'')) else {
            continue;
        };
        let Some((value, after)) = value[1..].split_once(quote) else { continue };
        if value.contains('<') {
            return Err(refuse(format!("an entity that holds elements: {name}")));
        }
        (n_values, longest, nested) =
            (n_values + 1, longest.max(value.len()), nested || value.contains('&'));
        rest = after;
    }
    if n_values == 0 {
        return Ok(());
    }
    let n = xml.matches('&').count() * if nested { MOST_WITHIN } else { 1 };
    let bytes = xml.len().saturating_add(n.saturating_mul(longest));
    if bytes > MAX_BYTES.max(2 * xml.len()) {
        return Err(refuse(format!("entities that become up to {} MiB", bytes >> 20)));
    }
    budget.steps(n.saturating_mul(STEPS[1] + STEPS[0] * n_values))
}

/// Takes the attributes and namespaces of a document off a budget.
pub(super) fn check_tags(xml: &str, budget: &Budget) -> Result<()> {
    let mut prefixes = HashSet::new();
    let (mut n_tags, mut n_declared) = (0_usize, 0_usize);
    let mut rest = xml;
    while let Some((_, from)) = rest.split_once('<') {
        let passed = [("!--", "-->"), ("![CDATA[", "]]>"), ("?", "?>")];
        if let Some((open, close)) = passed.iter().find(|(open, _)| from.starts_with(open)) {
            rest = from[open.len()..].split_once(close).map_or("", |(_, after)| after);
            continue;
        }
        // Up to the end of the tag: names between signs of equality, values in quotation marks.
        let (mut n_attributes, mut tag) = (0_usize, from);
        while let Some(at) = tag.find(['=', '"', '\'', '>', '<']) {
            let (name, sign) = tag.split_at(at);
            tag = &sign[1..];
            match &sign[..1] {
                "=" => {
                    n_attributes += 1;
                    let name = name.trim_end().rsplit(char::is_whitespace).next().unwrap_or("");
                    if name.starts_with("xmlns") {
                        n_declared += 1;
                        prefixes.insert(name);
                    }
                }
                ">" => break,
                "<" => {
                    tag = sign;
                    break;
                }
                quote => tag = tag.split_once(quote).map_or("", |(_, after)| after),
            }
        }
        rest = tag;
        n_tags += n_attributes + 1;
        budget.steps(STEPS[0] * n_attributes.saturating_mul(n_attributes))?;
    }
    let n = prefixes.len();
    budget.steps(STEPS[0] * n.saturating_mul(n_tags + n_declared.saturating_mul(n)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(xml: &str) -> std::result::Result<(), String> {
        let refuse = |found| Error::input("a.svg", found, "an SVG drawing", "none");
        check_entities(xml, &Budget::of("a.svg", "none"), refuse).map_err(|error| error.to_string())
    }

    #[test]
    fn entities_are_counted_where_they_are_put_in() {
        let small = "<!DOCTYPE svg [<!ENTITY ns 'http://ns.adobe.com/'>]><svg a='&ns;' b='&lt;'/>";
        check(small).unwrap();
        // Quadratic: 120 kB that is put in 40,000 times.
        let wide = format!(
            "<!DOCTYPE svg [<!ENTITY a '{}'>]><svg a='{}'/>",
            "x".repeat(120_000),
            "&a;".repeat(40_000)
        );
        assert!(check(&wide).unwrap_err().contains("4577 MiB"), "{:?}", check(&wide));
    }

    #[test]
    fn references_are_compared_with_all_entities() {
        let many: String = (0..30_000).map(|n| format!("<!ENTITY e{n} 'x'>")).collect();
        let used = |n| format!("<!DOCTYPE svg [{many}]><svg>{}</svg>", "&e29999;".repeat(n));
        check(&used(100)).unwrap();
        assert!(check(&used(20_000)).unwrap_err().contains("more work"));
        let markup = "<!DOCTYPE svg [<!ENTITY a '<g/>'>]><svg>&a;</svg>";
        assert!(check(markup).unwrap_err().contains("holds elements"));
    }

    #[test]
    fn attributes_of_a_tag_are_compared_with_each_other_and_prefixes_with_namespaces() {
        let tags = |xml: &str| check_tags(xml, &Budget::of("a.svg", "none")).is_ok();
        let list = |n: usize, name: &str| -> String {
            (0..n).map(|k| format!(" {name}{k}='>'")).collect()
        };
        assert!(tags(&format!("<svg{}/>", list(5000, "a"))));
        assert!(!tags(&format!("<svg{}/>", list(20_000, "a"))));
        assert!(tags(&format!("<svg>{}</svg>", "<g a='1' b='2'/>".repeat(100_000))), "many tags");
        let hidden = format!("<svg><!-- ' --><g{}/></svg>", list(20_000, "a"));
        assert!(!tags(&hidden), "an apostrophe in a comment hides nothing");
        let own = "<g xmlns:x='y'/>".repeat(50_000);
        assert!(tags(&format!("<svg>{own}</svg>")), "the same prefix again and again");
        assert!(!tags(&format!("<svg{}>{own}</svg>", list(300, "xmlns:p"))));
    }
}
