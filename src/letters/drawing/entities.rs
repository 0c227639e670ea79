//! Entities of an XML document: how much text they become.

use std::collections::HashMap;

/// Most bytes that a document's entities become.
const MAX_BYTES: usize = 16 << 20;

/// Most entities within entities.
const MAX_DEPTH: usize = 16;

/// Checks that a document's entities stay small where they are put in.
///
/// # Errors
///
/// What was found instead.
pub(super) fn check(xml: &str) -> Result<(), String> {
    let mut values = HashMap::new();
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
        // The first declaration of a name holds.
        values.entry(name).or_insert(value);
        rest = after;
    }
    if values.is_empty() {
        return Ok(());
    }
    let mut known = HashMap::new();
    match size(xml, &values, &mut known, 0) {
        Some(bytes) if bytes <= MAX_BYTES.max(2 * xml.len()) => Ok(()),
        Some(bytes) => Err(format!("entities that become {} MiB", bytes >> 20)),
        None => Err("entities without end".into()),
    }
}

/// Bytes of a text with its entities put in; `None` where they hold each other too deeply.
fn size<'a>(
    text: &'a str,
    values: &HashMap<&'a str, &'a str>,
    known: &mut HashMap<&'a str, usize>,
    depth: usize,
) -> Option<usize> {
    let mut bytes = text.len();
    for reference in text.split('&').skip(1) {
        let Some((name, _)) = reference.split_once(';') else { continue };
        let Some((name, value)) = values.get_key_value(name) else { continue };
        let inner = match known.get(name) {
            Some(bytes) => *bytes,
            None if depth == MAX_DEPTH => return None,
            None => {
                let bytes = size(value, values, known, depth + 1)?;
                known.insert(name, bytes);
                bytes
            }
        };
        bytes = bytes.saturating_add(inner);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let nested: String = (1..12)
            .map(|n| format!("<!ENTITY e{n} '{}'>", format!("&e{};", n - 1).repeat(10)))
            .collect();
        let nested = format!("<!DOCTYPE svg [<!ENTITY e0 'x'>{nested}]><svg a='&e11;'/>");
        assert!(check(&nested).is_err(), "a billion laughs");
        let circle = "<!DOCTYPE svg [<!ENTITY a '&b;'><!ENTITY b '&a;'>]><svg a='&a;'/>";
        assert!(check(circle).unwrap_err().contains("without end"));
    }
}
