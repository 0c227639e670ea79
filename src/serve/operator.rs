//! Answers requests to the operator's address.

use serde::Serialize;
use serde_json::json;

use super::access::Request;
use super::address::Address;
use super::entries::ToFly;
use super::gallery::{JPEG, PNG, REPLAY};
use super::http::{self, Reply};
use super::routes::{Posted, Server, ZIP, file_reply, qr_code};
use super::worker::Job;
use noctograph_export::{File, stem, zip::zip};
use noctograph_photo_service::messages::{Key, KeyResult, Message};
use noctograph_photo_service::request::Product;

/// Maximum size of a code's text in bytes, enough for a WLAN's name of 32 and password of 63
/// characters, with escapes.
const MAX_TEXT: usize = 256;

impl Server {
    /// Answers a GET of the operator's address by its route: the queue, the photos of entries, the
    /// codes of addresses, or a file of the page.
    pub(crate) fn operator_get(&self, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["queue.json"] => Ok(http::uncached("application/json", self.entries.queue())),
            ["entries", id, name @ (PNG | JPEG | REPLAY)] => {
                file_reply(self.entries.file(id, name))
            }
            ["visitors.svg"] => self.code(Address::visitors_url),
            ["kiosk.svg"] => self.code(Address::kiosk_url),
            ["wall.svg"] => self.code(Address::wall_url),
            // This is the QR code of the hall's WLAN, whose text only the operator's page contains.
            ["text.svg"] => Ok(qr_code(&hex_text(&request.query).ok_or(Key::PageOld)?)),
            ["address.json"] => {
                let address = &self.access.address;
                let ip = self.ip();
                Ok(http::json(&json!({
                    "visitors": address.visitors_url(ip),
                    "kiosk": address.kiosk_url(ip),
                    "wall": address.wall_url(ip),
                    "network": self.network_ip.is_some(),
                })))
            }
            _ => self.common(parts, request),
        }
    }

    /// Answers a POST to the operator's address. Each action increases the revision.
    pub(crate) fn operator_post(&self, parts: &[&str], body: &[u8]) -> KeyResult<Reply> {
        // The page compares the returned revision with its own to determine whether it is up to
        // date.
        let revision = match *parts {
            ["entries", id] => {
                let posted = Posted::parse(body, &["do", "was"])?;
                let (act, seen) = (posted.member("do")?, posted.member("was")?);
                return Ok(http::uncached("application/json", self.entries.act(id, act, seen)?));
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

    /// Returns the answer with the archive of an entry's scripts, or the reason why it has none.
    pub(crate) async fn script(&self, id: &str) -> KeyResult<Reply> {
        let Export { results, archive } = self.export(Some(id)).await?;
        match results.into_iter().flat_map(|exported| exported.refused).next() {
            Some(refused) => Ok(http::refused(refused)),
            None => Ok(http::uncached(ZIP, archive)),
        }
    }

    /// Makes the scripts of one entry or, if `id` is `None`, of all entries to be flown, in order.
    /// Entries that are refused are listed with the reason. Returns [`Key::Closed`] for an unknown
    /// entry.
    pub(crate) async fn export(&self, id: Option<&str>) -> KeyResult<Export> {
        let entries = self.entries.to_fly(id);
        if id.is_some() && entries.is_empty() {
            return Err(Key::Closed);
        }
        let (mut results, mut files) = (Vec::new(), Vec::new());
        for (index, ToFly { number, title, subject }) in entries.into_iter().enumerate() {
            let name = format!("{:02}-{}", index + 1, stem(&title));
            let made = match subject {
                None => Err(Key::Broken.into()),
                Some(subject) => {
                    let product = Product::Script;
                    self.operator.make(Job { product, subject, page: None, flight: None }).await
                }
            };
            // If an entry is refused, the others are still exported.
            let (folder, refused) = match made {
                Ok(parcel) => {
                    for File { name: file, bytes } in parcel.files {
                        files.push(File { name: format!("{name}/{file}"), bytes });
                    }
                    (Some(name), Vec::new())
                }
                Err(message) => (None, vec![message]),
            };
            results.push(Exported { folder, number, refused, title });
        }
        let bytes = format!("{:#}\n", json!(results)).into_bytes();
        files.push(File { name: "export.json".into(), bytes });
        Ok(Export { results, archive: zip(&files) })
    }
}

/// Returns the text whose bytes a query gives as hexadecimal digits. Returns `None` if the digits
/// are invalid or the text is too long.
fn hex_text(query: &str) -> Option<String> {
    let (pairs, rest) = query.as_bytes().as_chunks::<2>();
    if pairs.len() > MAX_TEXT || !rest.is_empty() {
        return None;
    }
    let bytes = pairs.iter().map(|[high, low]| {
        const HEXADECIMAL: u32 = 16;
        let digits = [high, low].map(|digit| char::from(*digit).to_digit(HEXADECIMAL));
        u8::try_from(digits[0]? << 4 | digits[1]?).ok()
    });
    String::from_utf8(bytes.collect::<Option<_>>()?).ok()
}

/// Result of exporting entries.
pub(crate) struct Export {
    /// Result for each entry.
    pub(crate) results: Vec<Exported>,
    /// Archive (ZIP) of the scripts, in a folder for each entry, and of the results.
    pub(crate) archive: Vec<u8>,
}

/// Result of exporting an entry.
#[derive(Debug, Serialize)]
pub(crate) struct Exported {
    /// Folder of the entry's scripts in the archive.
    folder: Option<String>,
    number: u32,
    /// Messages that give the reason if there are no scripts.
    refused: Vec<Message>,
    title: String,
}
