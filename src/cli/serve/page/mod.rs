//! The page's files, served as they stand.

/// A file of this folder under its own name.
macro_rules! file {
    ($name:literal) => {
        ($name, include_str!($name))
    };
}

/// Names and contents.
pub(super) const FILES: &[(&str, &str)] = &[
    file!("index.html"),
    file!("wall.html"),
    file!("operator.html"),
    file!("entry.html"),
    file!("look.css"),
    file!("visitor.css"),
    file!("wall.css"),
    file!("operator.css"),
    file!("entry.css"),
    file!("drawer.css"),
    file!("start.css"),
    file!("picture.css"),
    file!("ask.js"),
    file!("brand.js"),
    file!("dom.js"),
    file!("drawer.js"),
    file!("edit.js"),
    file!("entry.js"),
    file!("exposure.js"),
    file!("files.js"),
    file!("lights.js"),
    file!("loop.js"),
    file!("main.js"),
    file!("operator.js"),
    file!("pad.js"),
    file!("picture.js"),
    file!("replay.js"),
    file!("save.js"),
    file!("sent.js"),
    file!("sketch.js"),
    file!("stage.js"),
    file!("start.js"),
    file!("state-of.js"),
    file!("state.js"),
    file!("verdict.js"),
    file!("wall.js"),
    file!("wish.js"),
    file!("words.js"),
    file!("words/de.json"),
    file!("words/en.json"),
    file!("words/es.json"),
    file!("words/fr.json"),
];
