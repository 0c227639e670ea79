//! The entry points of the WebAssembly module. A request and its answer are JSON in the memory of
//! the module.
//!
//! The browser's worker reserves memory for a request, writes the request there, and calls a
//! function. The function returns the length of the answer in bytes. The answer is stored at
//! [`output`].

#![allow(unsafe_code, reason = "functions are exported by their names")]

use std::sync::{Mutex, PoisonError};

use super::about::{About, Brand, Host, Limits, Role, WallRule, colors};
use super::answer::{Asked, PageAnswer, Studio};
use super::request::{Asker, MAX_WORD, PhotoRequest, Product};
use noctograph_pipeline::scene::{Preset, Scene};
use noctograph_pipeline::shoot::Stage;
use serde_json::json;

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Reports the completed fraction of a stage, which is the flight (0) or the exposure (1).
    safe fn progress(stage: u32, fraction: f64);
}

/// Request, which the page writes.
static INPUT: Mutex<Vec<u8>> = Mutex::new(Vec::new());
/// Answer, which the page reads.
static OUTPUT: Mutex<Vec<u8>> = Mutex::new(Vec::new());
/// Text of the scene that the page's controls show at the start.
static BASE: Mutex<String> = Mutex::new(String::new());

/// Reserves memory for a request of `bytes` bytes, and returns its address. The page writes the
/// request there. The address is valid until the request is answered.
#[unsafe(no_mangle)]
extern "C" fn reserve(bytes: usize) -> *mut u8 {
    let mut input = INPUT.lock().unwrap_or_else(PoisonError::into_inner);
    *input = vec![0; bytes];
    input.as_mut_ptr()
}

/// Returns the address of the answer, which is valid until the next request.
#[unsafe(no_mangle)]
extern "C" fn output() -> *const u8 {
    OUTPUT.lock().unwrap_or_else(PoisonError::into_inner).as_ptr()
}

/// Stores the scene that the page's controls show at the start, from the text of its file in the
/// reserved memory. Returns the length of the answer in bytes.
#[unsafe(no_mangle)]
extern "C" fn base() -> usize {
    let text = String::from_utf8(input()).unwrap_or_default();
    *BASE.lock().unwrap_or_else(PoisonError::into_inner) = text;
    put("{}".to_owned())
}

/// Answers with the facts for a page without a server: colors, limits, and the scene that its
/// controls show at the start. Returns the length of the answer in bytes.
#[unsafe(no_mangle)]
extern "C" fn about() -> usize {
    let scene = Scene::preset(Preset::default());
    // Without a server, the page's user is both host and visitor.
    let about = About {
        host: Host { role: Role::Visitor, boot: "", brand: &Brand::default(), network: false },
        alone: true,
        home: true,
        kiosk: false,
        paused: false,
        wall: WallRule::Approved,
        limits: Limits { letters: MAX_WORD, body_bytes: 256 << 10 },
        colors: colors(),
        deck: scene.light.deck,
        base: None,
        scene: Some(&scene),
    };
    put(json!(about).to_string())
}

/// Makes the photo that is shown while a visitor types. Returns the length of the answer in bytes.
#[unsafe(no_mangle)]
extern "C" fn live() -> usize {
    answered(|_| Product::Live)
}

/// Makes the large photo. Returns the length of the answer in bytes.
#[unsafe(no_mangle)]
extern "C" fn photos() -> usize {
    answered(|photo| Product::Large { advice: false, files: photo.files })
}

/// Makes an archive of the scripts that fly the subject. Returns the length of the answer in bytes.
#[unsafe(no_mangle)]
extern "C" fn script() -> usize {
    answered(|_| Product::Script)
}

/// Reads the request, makes its product, and stores the answer. Returns its length in bytes.
fn answered(product: fn(&PhotoRequest) -> Product) -> usize {
    let photo = match PhotoRequest::parse(&input(), Asker::Alone) {
        Ok(photo) => photo,
        Err(message) => return put(message.json().to_string()),
    };
    let base = BASE.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let studio = Studio {
        scene: &|settings| Scene::parse_with(&base, "scene", settings),
        typeface: &|_word| Ok(None),
        advice: &|_shot| Ok(Vec::new()),
        has_audience: !base.is_empty(),
        watch: &|stage, fraction| progress(u32::from(stage == Stage::Exposing), fraction),
    };
    let made = studio.make(product(&photo), &photo.subject);
    put(PageAnswer::new(Asked { id: None, number: photo.number }, made).json())
}

/// Returns the bytes of the request, and frees their memory.
fn input() -> Vec<u8> {
    std::mem::take(&mut *INPUT.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Stores an answer, which the page reads at [`output`]. Returns its length in bytes.
fn put(answer: String) -> usize {
    let bytes = answer.len();
    *OUTPUT.lock().unwrap_or_else(PoisonError::into_inner) = answer.into_bytes();
    bytes
}
