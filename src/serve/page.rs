//! The page's files, served as they stand.

/// Files of two folders under their own names.
macro_rules! files {
    ($($name:literal)+; $($of_module:literal)+) => {
        &[
            $(($name, include_str!(concat!("page/", $name))),)+
            $(($of_module, include_str!(concat!("../photo_service/page/", $of_module))),)+
        ]
    };
}

/// Names and contents.
pub(crate) const FILES: &[(&str, &str)] = files! {
    "index.html" "wall.html" "operator.html" "entry.html" "look.css" "visitor.css" "wall.css"
    "operator.css" "entry.css" "drawer.css" "start.css" "pad.css" "picture.css" "keyboard.css"
    "ask.js" "brand.js" "dom.js" "drawer.js" "edit.js" "entry.js" "exposure.js" "files.js" "keyboard.js"
    "lights.js" "loop.js" "main.js" "operator.js" "pad.js" "picture.js" "replay.js" "save.js" "sent.js" "sketch.js" "stage.js"
    "start.js" "state-of.js" "state.js" "verdict.js" "wall.js" "wish.js" "words.js"
    "words/de.json" "words/en.json" "words/es.json" "words/fr.json";
    "here.js" "maker.js" "worker.js"
};

/// What changes with the program, so that browsers know when the page did.
pub(crate) fn mark() -> String {
    let all: Vec<u8> = FILES.iter().flat_map(|(_, text)| text.bytes()).collect();
    format!("\"{}\"", &noctograph_core::digest::sha256(&all)[..16])
}
