//! Finds the release of the drone's firmware if a log states it.
//!
//! Exported scripts write the release to their logs (`noctograph.firmware`). Other JSON may state
//! it as `firmware` or `firmware_version`, and tables in a comment before the header (`# firmware:
//! 2026.08`). Logs from the card and from cfclient do not state it.

use super::recording::Recording;
use noctograph_core::crazyflie::Release;
use noctograph_core::diagnostic::Diagnostic;

/// Number of lines that are searched, and number of bytes of each.
const LINES: usize = 100;
const BYTES: usize = 200;

/// Returns the firmware that a comment at the start of a table states, as it is written there.
pub(super) fn in_comments(text: &[u8]) -> Option<String> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let lines = text.split(|byte| matches!(byte, b'\n' | b'\r')).take(LINES);
    let comments = lines.filter(|line| matches!(line.first(), Some(b'#' | b'%' | b'/')));
    comments.into_iter().find_map(|line| {
        let line = String::from_utf8_lossy(&line[..line.len().min(BYTES)]).into_owned();
        // The version is the first release after the word firmware, otherwise a word like a commit.
        let end = line.to_ascii_lowercase().find("firmware")? + "firmware".len();
        let after = line.get(end..)?.split(|c: char| c.is_whitespace() || "=:,;\"'()".contains(c));
        let words: Vec<&str> = after.filter(|word| !word.is_empty()).collect();
        let named = words.iter().find(|word| Release::parse(word).is_some());
        named
            .or(words.iter().find(|word| word.starts_with(|c: char| c.is_ascii_hexdigit())))
            .map(|word| (*word).to_owned())
    })
}

/// Returns a warning if the recording's firmware flies differently from the scene's, `assumed`.
pub(super) fn doubt(recording: &Recording, assumed: Option<Release>) -> Option<Diagnostic> {
    let (named, release) = (recording.firmware.as_ref()?, assumed?);
    let assumed = release.name();
    let text = match Release::parse(named) {
        // Releases that fly alike do not cause a warning.
        Some(flown) if flown.is_like(release) => return None,
        Some(flown) => format!(
            "the drone flew firmware {named}, which vehicle.firmware = \"{}\" models, but the \
             scene has \"{assumed}\"",
            flown.name()
        ),
        None => {
            format!("firmware {named} is not a release: {assumed} is assumed (vehicle.firmware)")
        }
    };
    Some(Diagnostic::warning("firmware-other", text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_before_the_head_names_the_firmware() {
        for (text, firmware) in [
            ("# firmware: 2025.12\nt,x,y,z\n", Some("2025.12")),
            ("\u{feff}% drone 7\n% Firmware release = 2026.08.1\nt,x\n", Some("2026.08.1")),
            ("# firmware 2a18fc29 of mine\nt,x\n", Some("2a18fc29")),
            ("# firmware\nt,x\n", None),
            ("t,x,firmware\n0,1,2026.08\n", None),
        ] {
            assert_eq!(in_comments(text.as_bytes()).as_deref(), firmware, "{text}");
        }
    }

    #[test]
    fn another_release_than_the_scenes_and_none_at_all_are_said() {
        let doubt = |firmware: &str, assumed| {
            let firmware = Some(firmware.to_owned());
            let log = Recording { firmware, ..Recording::default() };
            doubt(&log, assumed).map(|doubt| doubt.message)
        };
        let scene = Some(Release::R2026_08);
        assert_eq!(doubt("2026.08", scene), None);
        assert_eq!(doubt("2025.12.1", Some(Release::R2026_04)), None, "they fly alike");
        assert_eq!(doubt("2025.12", None), None, "without a scene");
        assert!(doubt("2025.12", scene).unwrap().contains("vehicle.firmware = \"2025.12\""));
        assert!(doubt("2a18fc29", scene).unwrap().contains("is not a release"));
    }
}
