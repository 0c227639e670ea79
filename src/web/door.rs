//! The door of the WebAssembly module: a request and its answer are JSON in the module's memory.
//!
//! The worker reserves as many bytes as a request has, writes them there, and calls a function,
//! which returns how many bytes the answer has; these begin at [`output`].

#![allow(unsafe_code, reason = "functions are exported by their names")]

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use base64::prelude::{BASE64_STANDARD, Engine};
use noctograph_core::digest::sha256;
use noctograph_core::error::Result;
use noctograph_export::zip::zip;
use noctograph_pipeline::scene::{Preset, Scene};
use noctograph_pipeline::shoot::{Judging, Stage, Stop};
use serde_json::{Value, json};

use super::answer::{self, LARGE, LIVE, Large, Take};
use super::colors;
use super::messages::Message;
use super::request::{MAX_WORD, PhotoRequest};

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Tells the page how far a photo is: in the flight (0) or in the exposure (1).
    safe fn progress(stage: u32, share: f64);
}

static INPUT: Mutex<Vec<u8>> = Mutex::new(Vec::new());
static OUTPUT: Mutex<Vec<u8>> = Mutex::new(Vec::new());

/// Reserves place for a request, and returns where it is.
#[unsafe(no_mangle)]
extern "C" fn reserve(bytes: usize) -> *mut u8 {
    let mut input = INPUT.lock().unwrap_or_else(PoisonError::into_inner);
    *input = vec![0; bytes];
    input.as_mut_ptr()
}

/// Where the answer is.
#[unsafe(no_mangle)]
extern "C" fn output() -> *const u8 {
    OUTPUT.lock().unwrap_or_else(PoisonError::into_inner).as_ptr()
}

/// What the page has to know: colors, limits, and the scene that its controls begin with.
#[unsafe(no_mangle)]
extern "C" fn about() -> usize {
    let scene = Scene::preset(Preset::default());
    told(&json!({
        "role": "visitor", "boot": "", "brand": { "title": null, "logo": false }, "home": true,
        "alone": true, "kiosk": false, "network": false, "wall": "approved", "paused": false,
        "limits": { "letters": MAX_WORD, "body_bytes": 256 << 10 }, "colors": colors(),
        "deck": scene.light.deck, "scene": scene,
    }))
}

/// The photo while one types, with its verdict.
#[unsafe(no_mangle)]
extern "C" fn live() -> usize {
    answered(|photo| {
        let prepared = photo.subject.prepared(LIVE)?;
        let strokes = prepared.scene.strokes()?;
        answer::live(prepared, strokes, photo.subject.is_picture(), &take(Judging::Scored))
    })
}

/// The large photo with its verdict explained, what stops its flight, and its files.
#[unsafe(no_mangle)]
extern "C" fn photos() -> usize {
    answered(|photo| {
        let prepared = photo.subject.prepared(LARGE)?;
        let strokes = prepared.scene.strokes()?;
        let large = answer::large(prepared, strokes, &take(Judging::Explained))?;
        let files = files(&large)?;
        let digest = |(name, bytes): (&String, &Vec<u8>)| (name.clone(), sha256(bytes));
        let digests: BTreeMap<String, String> = files.iter().map(digest).collect();
        let Large { mut json, jpeg, shot, .. } = large;
        json["id"] = sha256(&jpeg)[..16].into();
        json["photo"] = answer::data_url(&jpeg).into();
        json["digests"] = json!(digests);
        json["flight_sha256"] = shot.flight_sha256().into();
        json["files"] = encoded(files);
        Ok(Ok(json))
    })
}

/// The scripts that fly it, in an archive.
#[unsafe(no_mangle)]
extern "C" fn script() -> usize {
    answered(|photo| {
        let prepared = photo.subject.prepared(LARGE)?;
        let strokes = prepared.scene.strokes()?;
        Ok(answer::script(prepared, strokes)?.map(|files| {
            let files: Vec<_> = files.into_iter().map(|file| (file.name, file.bytes)).collect();
            json!({ "files": encoded([("flight.zip".to_owned(), zip(&files))]) })
        }))
    })
}

/// The photo's files as `preview` names them.
fn files(large: &Large) -> Result<BTreeMap<String, Vec<u8>>> {
    let shot = &large.shot;
    let mut files = BTreeMap::from([
        ("photo.png".to_owned(), shot.file.clone().expect("a format was asked for")),
        ("scene.toml".to_owned(), shot.shoot.scene.to_toml().into_bytes()),
    ]);
    for (index, planned) in shot.shoot.plans.iter().enumerate() {
        let number =
            if shot.shoot.plans.len() > 1 { format!("-{}", index + 1) } else { String::new() };
        let mut csv = Vec::new();
        planned.plan.write_csv(&mut csv).expect("memory takes it");
        files.insert(format!("plan{number}.csv"), csv);
    }
    Ok(files)
}

/// Files as they are sent to the page.
fn encoded(files: impl IntoIterator<Item = (String, Vec<u8>)>) -> Value {
    let encoded = files.into_iter().map(|(name, bytes)| (name, BASE64_STANDARD.encode(bytes)));
    json!(encoded.collect::<BTreeMap<_, _>>())
}

fn take(judging: Judging) -> Take<'static> {
    let watch = &|stage: Stage, share: f64| progress(u32::from(stage == Stage::Exposing), share);
    Take { judging, stop: Stop::default(), watch }
}

/// Reads the request, and answers it with its number.
fn answered(
    make: impl FnOnce(&PhotoRequest) -> Result<std::result::Result<Value, Message>>,
) -> usize {
    let body = std::mem::take(&mut *INPUT.lock().unwrap_or_else(PoisonError::into_inner));
    let photo = match PhotoRequest::parse(&body, false) {
        Ok(photo) => photo,
        Err(message) => return told(&message.json()),
    };
    let made = make(&photo)
        .unwrap_or_else(|error| Err(Message::of_error(&error, photo.subject.is_picture())));
    let mut answer = made.unwrap_or_else(|message| message.json());
    answer["number"] = photo.number.into();
    told(&answer)
}

/// Puts an answer where the page reads it; returns its bytes.
fn told(answer: &Value) -> usize {
    let text = answer.to_string().into_bytes();
    let bytes = text.len();
    *OUTPUT.lock().unwrap_or_else(PoisonError::into_inner) = text;
    bytes
}
