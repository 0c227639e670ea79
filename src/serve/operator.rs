//! What the operator sees and does.

use serde::Serialize;
use serde_json::json;

use super::access::Request;
use super::address::Address;
use super::gallery::{JPEG, PNG, REPLAY};
use super::http::{self, Reply};
use super::routes::{Posted, Server, ZIP, code_of, sent};
use super::worker::Job;
use noctograph_export::{File, stem, zip::zip};
use noctograph_photo_service::messages::{Key, KeyResult, Message};
use noctograph_photo_service::request::Product;

/// Longest text of a code, bytes: name and password of a WLAN have 32 and 63, each escaped at most.
const MAX_TEXT: usize = 256;

impl Server {
    pub(crate) fn look(&self, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["queue.json"] => Ok(http::whole("application/json", self.entries.queue())),
            ["entries", id, name @ (PNG | JPEG | REPLAY)] => sent(self.entries.file(id, name)),
            ["visitors.svg"] => self.code(Address::of_visitors),
            ["kiosk.svg"] => self.code(Address::of_kiosk),
            ["wall.svg"] => self.code(Address::of_wall),
            // The code of the hall's WLAN, whose text only this page knows.
            ["text.svg"] => Ok(code_of(&text_of(&request.query).ok_or(Key::PageOld)?)),
            ["address.json"] => {
                let address = &self.access.address;
                let ip = self.ip();
                Ok(http::json(&json!({
                    "visitors": address.of_visitors(ip),
                    "kiosk": address.of_kiosk(ip),
                    "wall": address.of_wall(ip),
                    "network": self.outside.is_some(),
                })))
            }
            _ => self.common(parts, request),
        }
    }

    pub(crate) fn operate(&self, parts: &[&str], body: &[u8]) -> KeyResult<Reply> {
        let revision = match *parts {
            ["entries", id] => {
                let posted = Posted::parse(body, &["do", "was"])?;
                let (act, was) = (posted.member("do")?, posted.member("was")?);
                return Ok(http::whole("application/json", self.entries.act(id, act, was)?));
            }
            ["order"] => {
                let posted = Posted::parse(body, &["ids"])?;
                self.entries.reorder(&posted.member::<Vec<String>>("ids")?)?
            }
            ["pause"] => self.entries.pause(Posted::parse(body, &["paused"])?.member("paused")?)?,
            _ => return Err(Key::Closed),
        };
        Ok(http::json(&json!({ "revision": revision })))
    }

    /// The script of one entry.
    pub(crate) async fn script(&self, id: &str) -> KeyResult<Reply> {
        let (told, archive) = self.export(Some(id)).await?;
        match told.into_iter().flat_map(|exported| exported.refused).next() {
            Some(refused) => Ok(http::refused(refused)),
            None => Ok(http::whole(ZIP, archive)),
        }
    }

    /// What became of one entry, or of those that are to be flown in their order, and the archive
    /// of their scripts.
    pub(crate) async fn export(&self, id: Option<&str>) -> KeyResult<(Vec<Exported>, Vec<u8>)> {
        let entries = self.entries.to_fly(id);
        if id.is_some() && entries.is_empty() {
            return Err(Key::Closed);
        }
        let (mut told, mut files) = (Vec::new(), Vec::new());
        for (index, (number, title, subject)) in entries.into_iter().enumerate() {
            let name = format!("{:02}-{}", index + 1, stem(&title));
            let job = subject.map(|subject| Job { product: Product::Script, subject, page: None });
            let made = match job {
                None => Err(Key::Broken.into()),
                Some(job) => self.operator.make(job).await,
            };
            let (folder, refused) = match made {
                Ok(parcel) => {
                    let within =
                        |file: File| File { name: format!("{name}/{}", file.name), ..file };
                    files.extend(parcel.files.into_iter().map(within));
                    (Some(name), Vec::new())
                }
                Err(message) => (None, vec![message]),
            };
            told.push(Exported { folder, number, refused, title });
        }
        let bytes = format!("{:#}\n", json!(told)).into_bytes();
        files.push(File { name: "export.json".into(), bytes });
        Ok((told, zip(&files)))
    }
}

/// A text whose bytes stand in hexadecimal, as long as a code may have it.
fn text_of(query: &str) -> Option<String> {
    let is_short = query.len() <= 2 * MAX_TEXT && query.len().is_multiple_of(2);
    let digits =
        Some(query).filter(|it| is_short && it.bytes().all(|it| it.is_ascii_hexdigit()))?;
    let byte = |index| u8::from_str_radix(&digits[index..index + 2], 16).ok();
    String::from_utf8((0..digits.len()).step_by(2).map(byte).collect::<Option<_>>()?).ok()
}

/// What became of the scripts of an entry.
#[derive(Debug, Serialize)]
pub(crate) struct Exported {
    /// Folder of its scripts in the archive.
    folder: Option<String>,
    number: u32,
    /// Why it has none: one message.
    refused: Vec<Message>,
    title: String,
}
