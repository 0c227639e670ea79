//! Labels objects on a photo: writes a name next to each, with a line to it.

use kurbo::Point;

use super::canvas::{Pen, Pixels, Surface};
use noctograph_picture::photo::Photo;

const PEN: Pen = Pen::new([255, 232, 150], 1.3);
/// Cap height.
const CAP_PX: f64 = 11.0;
/// Radius of the ring around a labeled object.
const RING_PX: f64 = 3.5;

/// Label for an object on a photo.
#[derive(Clone, Debug)]
pub struct Label {
    /// Text of the label. Characters that the font `simplex` lacks are omitted.
    pub text: String,
    /// Lower left corner of the text, in pixels from the photo's upper left corner.
    pub text_px: [f64; 2],
    /// Center of the object, in pixels from the photo's upper left corner.
    pub named_px: [f64; 2],
}

/// Returns a photo with labels drawn on it.
pub fn labeled(photo: &Photo, labels: &[Label]) -> Photo {
    let mut pixels = Pixels::new(photo);
    for Label { text, text_px, named_px } in labels {
        let [corner, center] = [text_px, named_px].map(|[x, y]| Point::new(*x, *y));
        pixels.write(text, corner, CAP_PX, PEN.color);
        let (_, right) = pixels.letters(text, corner, CAP_PX);
        // The line begins to the left or right of the text or, if the object is within its width,
        // above or below it. `up` is a multiple of the cap height.
        let (from_x, up) = match center.x {
            x if x < corner.x => (corner.x - 0.5 * CAP_PX, 0.5),
            x if x > right => (right + 0.5 * CAP_PX, 0.5),
            x => (x, if center.y > corner.y { -0.4 } else { 1.4 }),
        };
        let away = Point::new(from_x, corner.y - up * CAP_PX) - center;
        // A line that would end within the ring is not drawn.
        let ring_part = RING_PX / libm::hypot(away.x, away.y);
        if ring_part < 1.0 {
            pixels.line([center + away, center + ring_part * away], PEN);
        }
        pixels.ring(center, RING_PX, PEN);
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
        for (what, [left, top, right, bottom], n) in [
            ("text", [20, 15, 60, 32], 60..300),
            ("ring", [145, 75, 156, 86], 15..100),
            ("named", [149, 79, 152, 82], 0..1),
            ("line between", [90, 40, 110, 70], 15..100),
            ("left", [0, 0, 19, 100], 0..1),
            ("right", [160, 0, 200, 100], 0..1),
        ] {
            let pixels = (left..right).flat_map(|x| (top..bottom).map(move |y| 200 * y + x));
            let n_lit = pixels.filter(|index| drawn.rgb8[3 * index] > 100).count();
            assert!(n.contains(&n_lit), "{what}: {n_lit}");
        }
    }
}
