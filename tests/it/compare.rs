//! Comparison of golden images, and the page that a failure writes.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use noctograph::photo::{self, Photo, PhotoData, flip};

/// Difference between two photos.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Difference {
    Size { wanted: (u32, u32), found: (u32, u32) },
    Pixels { differing: usize, largest: u8, first: Option<(usize, usize)> },
}

/// Compares two photos pixel by pixel with tolerance zero. Returns `None` if they are equal.
pub(crate) fn compare(wanted: &Photo, found: &Photo) -> Option<Difference> {
    let size = |photo: &Photo| (photo.width_px, photo.height_px);
    if size(wanted) != size(found) {
        return Some(Difference::Size { wanted: size(wanted), found: size(found) });
    }
    let pixels = wanted.rgb8.chunks(3).zip(found.rgb8.chunks(3));
    let gaps: Vec<u8> = pixels
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0))
        .collect();
    let width = wanted.width_px as usize;
    let first = gaps.iter().position(|gap| *gap > 0);
    first.map(|at| Difference::Pixels {
        differing: gaps.iter().filter(|gap| **gap > 0).count(),
        largest: gaps.iter().copied().max().unwrap_or(0),
        first: Some((at % width, at / width)),
    })
}

/// Writes the golden image, the photo, the amplified difference and the perceived difference (ꟻLIP)
/// into `target/golden/<name>/` with an HTML page.
pub(crate) fn leave_page(name: &str, wanted: Option<&Photo>, found: &Photo, note: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("golden").join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let size = |photo: &Photo| (photo.width_px, photo.height_px);
    let comparable = wanted.filter(|wanted| size(wanted) == size(found));
    let amplified = comparable.map(|wanted| {
        let pixels = wanted.rgb8.iter().zip(&found.rgb8);
        let rgb8 = pixels.map(|(a, b)| a.abs_diff(*b).saturating_mul(16)).collect();
        Photo::made(PhotoData { rgb8, ..found.clone().into_data() })
    });
    let seen = comparable.map(|wanted| flip::difference(wanted, found).picture());
    let mut page = format!("<!doctype html><meta charset=utf-8><title>{name}</title><p>{note}</p>");
    let pictures = [
        ("wanted", wanted),
        ("found", Some(found)),
        ("16x", amplified.as_ref()),
        ("flip", seen.as_ref()),
    ];
    for (title, photo) in pictures {
        let Some(photo) = photo else { continue };
        let file = folder.join(format!("{title}.png"));
        std::fs::write(file, photo::encode_png(photo, None, &[])).unwrap();
        write!(page, "<figure><img src={title}.png width=768 style=image-rendering:pixelated>")
            .unwrap();
        write!(page, "<figcaption>{title}</figcaption></figure>").unwrap();
    }
    let path = folder.join("index.html");
    std::fs::write(&path, page).unwrap();
    path
}

fn photo() -> Photo {
    let rgb8 = (0..12 * 8 * 3).map(|i: u32| u8::try_from(i * i % 251).unwrap()).collect();
    Photo::made(PhotoData { width_px: 12, height_px: 8, rgb8, scene_toml: None })
}

#[test]
fn the_comparison_finds_one_level_in_one_channel_of_one_pixel() {
    let mut changed = photo();
    assert_eq!(compare(&photo(), &changed), None);
    let at = 3 * (12 * 5 + 7) + 1;
    changed.edit(|changed| changed.rgb8[at] += 1);
    let seen = Difference::Pixels { differing: 1, largest: 1, first: Some((7, 5)) };
    assert_eq!(compare(&photo(), &changed), Some(seen));
}

#[test]
fn the_comparison_finds_shifts_swapped_channels_and_sizes() {
    let mut shifted = photo();
    shifted.edit(|shifted| shifted.rgb8.rotate_right(3));
    let mut swapped = photo();
    swapped.edit(|swapped| swapped.rgb8.chunks_mut(3).for_each(|pixel| pixel.swap(0, 2)));
    let resized = Photo::made(PhotoData { width_px: 8, height_px: 12, ..photo().into_data() });
    for wrong in [shifted, swapped, resized] {
        assert!(compare(&photo(), &wrong).is_some());
    }
}

#[test]
fn a_failure_leaves_a_page_with_the_perceived_difference() {
    let mut changed = photo();
    changed.edit(|changed| changed.rgb8[0] ^= 0x80);
    let page = leave_page("of-a-test", Some(&photo()), &changed, "the note");
    let text = std::fs::read_to_string(&page).unwrap();
    for title in ["wanted", "found", "16x", "flip"] {
        assert!(text.contains(&format!("src={title}.png")), "{title}: {text}");
    }
    let seen = photo::read(&page.with_file_name("flip.png")).unwrap();
    assert!(seen.rgb8[..3] > seen.rgb8[3 * 95..], "bright where the pictures differ");
}
