//! Labels on a photo: a name beside what it names, with a line to it.

use super::canvas::{Pen, Pixels, Surface};
use noctograph_picture::photo::Photo;

const PEN: Pen = Pen::new([255, 232, 150], 1.3);
/// Height of capitals.
const CAP_PX: f64 = 11.0;
/// Radius of the ring about what is named.
const RING_PX: f64 = 3.5;

/// A name and what it names.
#[derive(Clone, Debug)]
pub struct Label {
    /// What stands there; what the font `simplex` lacks is left out.
    pub text: String,
    /// Lower left corner of the text, in pixels from the photo's upper left corner.
    pub text_px: [f64; 2],
    /// The middle of what is named.
    pub named_px: [f64; 2],
}

/// The photo with its labels.
pub fn labeled(photo: &Photo, labels: &[Label]) -> Photo {
    let mut pixels = Pixels::new(photo);
    for Label { text, text_px, named_px } in labels {
        let ([left, baseline], [x, y]) = (*text_px, *named_px);
        pixels.write(text, *text_px, CAP_PX, PEN.color);
        let (_, right) = pixels.letters(text, *text_px, CAP_PX);
        // From the nearest place beside the text, over it or below it, to the ring.
        let [from_x, up] = match x {
            x if x < left => [left - 0.5 * CAP_PX, 0.5],
            x if x > right => [right + 0.5 * CAP_PX, 0.5],
            x => [x, if y > baseline { -0.4 } else { 1.4 }],
        };
        let from_y = baseline - up * CAP_PX;
        let part = RING_PX / libm::hypot(from_x - x, from_y - y);
        if part < 1.0 {
            let to = [x + (from_x - x) * part, y + (from_y - y) * part];
            pixels.line([[from_x, from_y], to], PEN);
        }
        pixels.ring(*named_px, RING_PX, PEN);
    }
    pixels.photo()
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::photo::PhotoData;

    #[test]
    fn a_label_is_written_and_leads_to_what_it_names() {
        let photo = Photo::made(PhotoData {
            width_px: 200,
            height_px: 100,
            rgb8: vec![0; 60_000],
            scene_toml: None,
        });
        let label = Label { text: "lamp".into(), text_px: [20.0, 30.0], named_px: [150.0, 80.0] };
        let drawn = labeled(&photo, &[label]);
        let inked = |xs: std::ops::Range<usize>, ys: std::ops::Range<usize>| {
            let is_lit = |(x, y): (usize, usize)| drawn.rgb8[3 * (200 * y + x)] > 100;
            xs.flat_map(|x| ys.clone().map(move |y| (x, y))).filter(|at_px| is_lit(*at_px)).count()
        };
        assert!(inked(20..60, 15..32) > 60, "the text");
        assert!(inked(145..156, 75..86) > 15, "the ring");
        assert_eq!(inked(149..152, 79..82), 0, "what is named stays as it is");
        assert!(inked(90..110, 40..70) > 15, "the line between");
        assert_eq!(inked(0..19, 0..100) + inked(160..200, 0..100), 0, "nothing else");
    }
}
