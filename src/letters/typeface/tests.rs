use super::super::face_tests::{self, Contours};
use super::*;

const ROBOTO: &[u8] = include_bytes!("../../../fonts/Roboto-Thin.ttf");

fn roboto(trace: Trace) -> Typeface {
    Typeface::read(ROBOTO.to_vec(), trace, "Roboto-Thin.ttf").unwrap()
}

/// Returns the numbers of strokes and of closed strokes of a character.
fn strokes(face: &Typeface, character: char) -> (usize, usize) {
    let shape = face.shape(character).unwrap();
    let closed = shape.runs.iter().filter(|run| run.points[0] == run.points[run.points.len() - 1]);
    (shape.runs.len(), closed.count())
}

#[test]
fn center_lines_are_the_strokes_of_handwriting() {
    let face = roboto(Trace::CenterLine);
    let open = [("CGIJLMNSUVWZ", 1), ("BDPTXQ", 2), ("AEFHRY", 3), ("1257", 1)];
    let mut wrong = String::new();
    for (characters, most) in open {
        for character in characters.chars() {
            if strokes(&face, character).0 > most {
                wrong.push(character);
            }
        }
    }
    assert_eq!(wrong, "", "more strokes than a hand would need");
    assert_eq!([strokes(&face, 'O'), strokes(&face, '0'), strokes(&face, 'o')], [(1, 1); 3]);
    assert_eq!(strokes(&face, 'i').0, 2, "a stem and a dot");
}

#[test]
fn capitals_are_a_cap_height_high_on_the_baseline() {
    let face = roboto(Trace::CenterLine);
    for character in ('A'..='Z').chain('0'..='9') {
        let [_, bottom, _, top] = face.shape(character).unwrap().ink_bounds();
        let tail = if character == 'Q' { 0.2 } else { 0.03 };
        assert!((top - 1.0).abs() < 0.03, "{character}: top at {top}");
        assert!(bottom.abs() < tail, "{character}: bottom at {bottom}");
    }
    let shape = face.shape('L').unwrap();
    assert_eq!(shape.runs.len(), 1);
    let corner = shape.runs[0].points.iter().min_by(|a, b| (a.x + a.y).total_cmp(&(b.x + b.y)));
    assert_eq!(shape.runs[0].points.len(), 3, "two straight strokes and a sharp corner");
    assert!(corner.unwrap().y.abs() < 0.005, "{corner:?}");
}

#[test]
fn center_lines_stay_in_the_ink() {
    let face = roboto(Trace::CenterLine);
    for character in ('A'..='Z').chain('a'..='z').chain('0'..='9').chain("äßØ&@".chars()) {
        let budget = Budget::new("Roboto-Thin.ttf", "none");
        let ink = super::super::outline::Filled::new(
            &face.contours(&[(face.glyph(character).unwrap(), [0; 2])], &budget).unwrap(),
            &budget,
        );
        let shape = face.shape(character).unwrap();
        let (mut inside, mut all) = (0, 0);
        for run in shape.runs.iter().filter(|run| run.points[0] != run.points[run.points.len() - 1])
        {
            for [x, y] in super::super::smooth::evenly(&pairs(vec![run.points.clone()])[0], 0.01) {
                let scale = 1.0 - 2.0 * face.half_width;
                all += 1;
                inside += usize::from(ink.holds([x * scale, y * scale + face.half_width]));
            }
        }
        assert!(inside as f64 >= 0.93 * f64::from(all), "{character}: {inside} of {all}");
    }
}

#[test]
fn flat_tips_are_not_extended_and_stems_stay_upright() {
    let face = roboto(Trace::CenterLine);
    for character in "MN".chars() {
        let shape = face.shape(character).unwrap();
        let points = &shape.runs[0].points;
        let n = points.len();
        for (foot, tip) in [(0, 1), (n - 1, n - 2)] {
            let lean = (points[foot].x - points[tip].x).abs();
            assert!(lean < 0.01, "{character}: {points:?}");
        }
    }
    for character in "AMNVW4".chars() {
        let [_, bottom, _, top] = face.shape(character).unwrap().ink_bounds();
        assert!(top < 1.02 && bottom > -0.02, "{character}: {bottom} to {top}");
    }
}

#[test]
fn an_outline_goes_around_the_ink() {
    let face = roboto(Trace::Outline);
    assert_eq!(strokes(&face, 'I'), (1, 1));
    assert_eq!(strokes(&face, 'O'), (2, 2), "within and without");
    assert_eq!(face.shape('I').unwrap().runs[0].points.len(), 5, "four corners");
}

/// Returns a face with these glyphs, in units of 1/700 of a capital.
fn face(glyphs: &[(char, Contours<'_>)]) -> Typeface {
    let glyphs: Vec<_> = glyphs.iter().map(|(c, contours)| (Some(*c), *contours)).collect();
    Typeface::read(face_tests::face(&glyphs, 500, &[]), Trace::CenterLine, "face.ttf").unwrap()
}

/// Returns the points of a character's strokes, in units of 1/700 of a capital.
fn drawn(face: &Typeface, character: char) -> Vec<Vec<[i64; 2]>> {
    #[expect(clippy::cast_possible_truncation, reason = "small numbers")]
    let round = |point: &Point| [point.x, point.y].map(|x| (700.0 * x).round() as i64);
    let shape = face.shape(character).unwrap();
    shape.runs.iter().map(|run| run.points.iter().map(round).collect()).collect()
}

#[test]
fn a_face_of_open_contours_is_drawn_as_it_is_stored() {
    let face = face(&[
        ('L', &[&[[0, 700], [0, 0], [400, 0]]]),
        ('E', &[&[[400, 0], [0, 0], [0, 700], [400, 700]], &[[0, 350], [350, 350]]]),
        ('H', &[&[[0, 700], [0, 0]], &[[0, 350], [400, 350]], &[[400, 700], [400, 0]]]),
        ('T', &[&[[0, 700], [400, 700]], &[[200, 700], [200, 0]]]),
        ('D', &[&[[0, 0], [0, 700], [400, 500], [400, 200], [0, 0]]]),
    ]);
    assert_eq!(drawn(&face, 'L'), [[[0, 700], [0, 0], [400, 0]]], "one, and not closed");
    assert_eq!("EHTD".chars().map(|c| drawn(&face, c).len()).collect::<Vec<_>>(), [2, 3, 2, 1]);
    assert_eq!(drawn(&face, 'E')[0][0], [400, 0]);
    let d = drawn(&face, 'D');
    assert_eq!((d[0][0], d[0].len()), (d[0][4], 5), "closed where it is stored so");
}

#[test]
fn a_face_of_lines_there_and_back_is_drawn_once() {
    let face = face(&[
        ('V', &[&[[0, 700], [200, 0], [400, 700], [200, 0]]]),
        ('H', &[&[[0, 700], [0, 0]], &[[0, 350], [400, 350]], &[[400, 700], [400, 0]]]),
        ('L', &[&[[0, 700], [0, 0], [400, 0], [0, 0]]]),
    ]);
    assert_eq!(drawn(&face, 'V'), [[[0, 700], [200, 0], [400, 700]]]);
    assert_eq!(drawn(&face, 'L'), [[[0, 700], [0, 0], [400, 0]]]);
    assert_eq!(drawn(&face, 'H').len(), 3);
}

#[test]
fn a_solid_glyph_is_its_outline_and_a_stroke_its_center_line() {
    let star: Vec<[i16; 2]> = (0..10)
        .map(|k| {
            let r = if k % 2 == 0 { 350.0 } else { 140.0 };
            let (sin, cos) = libm::sincos(f64::from(k) * std::f64::consts::PI / 5.0);
            #[expect(clippy::cast_possible_truncation, reason = "font units")]
            [350.0 + r * sin, 350.0 + r * cos].map(|x| x.round() as i16)
        })
        .collect();
    let h: &[[i16; 2]] = &[
        [0, 0],
        [0, 700],
        [70, 700],
        [70, 385],
        [400, 385],
        [400, 700],
        [470, 700],
        [470, 0],
        [400, 0],
        [400, 315],
        [70, 315],
        [70, 0],
    ];
    let face = face(&[
        ('H', &[h]),
        ('I', &[&[[0, 0], [0, 700], [80, 700], [80, 0]]]),
        ('.', &[&[[0, 0], [0, 90], [90, 90], [90, 0]]]),
        ('\u{2665}', &[&[[350, 0], [0, 420], [100, 650], [350, 500], [600, 650], [700, 420]]]),
        ('\u{2605}', &[&star]),
        ('\u{25a0}', &[&[[0, 0], [0, 600], [600, 600], [600, 0]]]),
    ]);
    let is_closed = |c: char| {
        let shape = face.shape(c).unwrap();
        shape.runs.len() == 1 && shape.runs[0].points.first() == shape.runs[0].points.last()
    };
    assert!("\u{2665}\u{2605}\u{25a0}".chars().all(is_closed), "areas");
    assert!(!"HI.".chars().any(is_closed), "lines and a dot");
    assert_eq!(face.shape('\u{2605}').unwrap().runs[0].points.len(), 11, "ten corners");
    // Like a face of emoji, this face has no letters to compare with.
    let alone = self::face(&[('\u{2605}', &[&star])]);
    assert_eq!(alone.shape('\u{2605}').unwrap().runs[0].points.len(), 11);
}
