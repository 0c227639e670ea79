//! Labels on a photo: a name beside what it names, with a line to it.

use super::canvas::{Anchor, Canvas, Pen, right_end};
use noctograph_picture::photo::Photo;

const PEN: Pen = Pen { color: [255, 232, 150], width_px: 1.3, dashed: false };
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
#[must_use]
pub fn labeled(photo: &Photo, labels: &[Label]) -> Photo {
    let mut canvas = Canvas::over(photo);
    for label in labels {
        let [left, baseline] = label.text_px;
        canvas.text(&*label.text, label.text_px, Anchor::Start, CAP_PX, PEN.color);
        let right = right_end(&label.text, left, CAP_PX);
        let [x, y] = label.named_px;
        // From the nearest place beside the text, over it or below it, to the ring.
        let above = y > baseline;
        let foot = if above { baseline + 0.4 * CAP_PX } else { baseline - 1.4 * CAP_PX };
        let from = if (left..=right).contains(&x) {
            [x, foot]
        } else {
            let end = if x < left { left - 0.5 * CAP_PX } else { right + 0.5 * CAP_PX };
            [end, baseline - 0.5 * CAP_PX]
        };
        let away = [from[0] - x, from[1] - y];
        let far = libm::hypot(away[0], away[1]);
        if far > RING_PX {
            canvas.line([from, [x + away[0] * RING_PX / far, y + away[1] * RING_PX / far]], PEN);
        }
        canvas.ring(label.named_px, RING_PX, PEN);
    }
    canvas.pixels()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_written_and_leads_to_what_it_names() {
        let photo =
            Photo { width_px: 200, height_px: 100, rgb8: vec![0; 60_000], scene_toml: None };
        let label = Label { text: "lamp".into(), text_px: [20.0, 30.0], named_px: [150.0, 80.0] };
        let drawn = labeled(&photo, &[label]);
        let inked = |xs: std::ops::Range<usize>, ys: std::ops::Range<usize>| {
            let at = |(x, y): (usize, usize)| drawn.rgb8[3 * (200 * y + x)] > 100;
            xs.flat_map(|x| ys.clone().map(move |y| (x, y))).filter(|at_px| at(*at_px)).count()
        };
        assert!(inked(20..60, 15..32) > 60, "the text");
        assert!(inked(145..156, 75..86) > 15, "the ring");
        assert_eq!(inked(149..152, 79..82), 0, "what is named stays as it is");
        assert!(inked(90..110, 40..70) > 15, "the line between");
        assert_eq!(inked(0..19, 0..100) + inked(160..200, 0..100), 0, "nothing else");
    }
}
