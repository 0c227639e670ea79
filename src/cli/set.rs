//! Keys of a scene that are set on the command line.

use clap::Args;

/// A key of the scene with its new value.
pub(super) type Setting = (String, String);

fn setting(text: &str) -> Result<Setting, String> {
    let (key, value) = text.split_once('=').ok_or("wanted KEY=VALUE, such as camera.iso=200")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

/// Keys of a scene that are set on the command line.
#[derive(Debug, Args)]
pub(super) struct SetFlag {
    /// Set a key of the scene, such as camera.iso=200; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = setting)]
    pub(super) set: Vec<Setting>,
}

/// Settings as the scene takes them.
pub(super) fn borrowed(settings: &[Setting]) -> Vec<(&str, &str)> {
    settings.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect()
}

/// Settings that own their texts.
pub(super) fn owned<'a>(settings: impl Iterator<Item = (&'a str, &'a str)>) -> Vec<Setting> {
    settings.map(|(key, value)| (key.to_owned(), value.to_owned())).collect()
}
