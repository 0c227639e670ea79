//! What the operator sees and does.

use serde::Serialize;
use serde_json::json;

use super::access::Request;
use super::gallery::{JPEG, PNG, REPLAY};
use super::http::{self, Reply};
use super::routes::{Posted, Server, ZIP, sent};
use super::worker::Job;
use noctograph_export::{File, stem, zip::zip};
use noctograph_photo_service::messages::{Key, KeyResult, Message};
use noctograph_photo_service::request::Product;

impl Server {
    pub(crate) fn look(&self, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["queue.json"] => Ok(http::whole("application/json", self.entries.queue())),
            ["entries", id, name @ (PNG | JPEG | REPLAY)] => sent(self.entries.file(id, name)),
            ["qr.svg"] => Ok(self.code()),
            ["address.json"] => {
                let address = &self.access.address;
                let (visitors, kiosk) = (address.of_visitors(self.ip), address.of_kiosk(self.ip));
                let wall = format!("{visitors}wall.html");
                Ok(http::json(&json!({ "visitors": visitors, "wall": wall, "kiosk": kiosk })))
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
