//! The page's files, and the page that is shown at an outdated address.

use hyper::http::request::Parts;
use serde_json::Value;

use super::access::language;
use super::http::{Reply, etag_of, uncached, with_field, with_status};

/// Lists the names and contents of files in two folders.
macro_rules! files {
    ($($name:literal)+; $($of_module:literal)+) => {
        &[
            $(($name, include_str!(concat!("page/", $name))),)+
            $(($of_module, include_str!(concat!("../photo_service/page/", $of_module))),)+
        ]
    };
}

/// Names and contents of the page's files.
pub(crate) const FILES: &[(&str, &str)] = files! {
    "index.html" "wall.html" "operator.html" "entry.html" "look.css" "visitor.css" "wall.css"
    "operator.css" "entry.css" "drawer.css" "start.css" "pad.css" "picture.css" "keyboard.css"
    "amiss.js" "ask.js" "brand.js" "dom.js" "drawer.js" "edit.js" "entry.js" "exposure.js" "files.js" "keyboard.js"
    "lights.js" "loop.js" "main.js" "operator.js" "pad.js" "picture.js" "replay.js" "samples.js" "save.js" "sent.js" "sketch.js" "stage.js"
    "start.js" "state-of.js" "state.js" "verdict.js" "wall.js" "wish.js" "words.js"
    "words/de.json" "words/en.json" "words/es.json" "words/fr.json"
    "words/de-more.json" "words/en-more.json" "words/es-more.json" "words/fr-more.json";
    "here.js" "maker.js" "worker.js"
};

/// Returns the common `ETag` of all files, which changes with the program.
pub(crate) fn etag() -> String {
    let bytes: Vec<u8> = FILES.iter().flat_map(|(_, text)| text.bytes()).collect();
    etag_of(&bytes)
}

/// Languages of the page. The first one is the default.
const LANGUAGES: [&str; 4] = ["en", "de", "fr", "es"];

/// Returns the page for an address without a valid secret: a sentence in the browser's language, or
/// in English, with the status 403.
pub(crate) fn old_address_reply(head: &Parts) -> Reply {
    let code = language(head, &LANGUAGES).unwrap_or(LANGUAGES[0]);
    let name = format!("words/{code}.json");
    let words = FILES.iter().find(|(file, _)| *file == name).map_or("", |(_, text)| text);
    // The page loads no scripts or other files, because nothing else is served at this address.
    let words: Value = serde_json::from_str(words).expect("a table of words");
    let sentence = words["moved"].as_str().expect("it is in every table");
    let page = format!(
        "<!doctype html>\n<html lang=\"{code}\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>Noctograph</title>\n\
         <style>body {{ margin: 0; min-height: 100vh; display: grid; place-items: center; \
         background: #0c0b09; color: #f5efe4; font: 1.4rem/1.5 system-ui, sans-serif; \
         text-align: center }} p {{ max-width: 22em; padding: 1em }}</style>\n\
         <main><p>{sentence}</p></main>\n"
    );
    let policy = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'";
    let reply = with_status(uncached("text/html; charset=utf-8", page), 403);
    with_field(reply, "Content-Security-Policy", policy)
}
