use super::ink::*;
#[test]
#[allow(clippy::all)]
fn probe() {
    let Ok(folder) = std::env::var("PROBE") else { return };
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
    files.sort();
    for file in files {
        let mut picture = image::open(&file).unwrap();
        if picture.width().max(picture.height()) > 1200 {
            picture = picture.thumbnail(1200, 1200);
        }
        let picture = super::bitmap::on_ground(&picture.into_rgba8());
        let even = even_paper(&picture).is_some();
        let Some(f) = Field::of(&picture) else {
            println!("{file:?} none");
            continue;
        };
        let g = grain(&f.contrast, f.width);
        let n = f.contrast.len() as f64;
        let least = 0.1;
        let inked = || f.contrast.iter().filter(|ink| **ink > least);
        let strong = super::levels::quantile(inked().map(|ink| 255.0 * ink), 0.97) / 255.0;
        let share = |from: f64, to: f64| {
            f.contrast.iter().filter(|c| (from..to).contains(*c)).count() as f64 / n
        };
        let w = f.width;
        let tones = (2 * w..f.contrast.len() - 2 * w)
            .filter(|at| {
                let s = f.contrast[*at] / strong;
                (0.2..0.8).contains(&s)
                    && libm::hypot(
                        f.contrast[at + 2] - f.contrast[at - 2],
                        f.contrast[at + 2 * w] - f.contrast[at - 2 * w],
                    ) < 0.12 * strong
            })
            .count() as f64
            / n;
        let ink = f.ink.iter().filter(|i| **i > 0.5).count() as f64 / n;
        println!(
            "{:28} even {} grain {:.4} strong {:.2} texture {:.3} tones {:.3} ink {:.3} weak {:.3} mid {:.3} hi {:.3}",
            file.file_name().unwrap().to_str().unwrap(),
            even as u8,
            g,
            strong,
            f.shades,
            tones,
            ink,
            share(0.03, 0.1),
            share(0.1, 0.4 * strong),
            share(0.4 * strong, 2.0)
        );
        let mut out = image::GrayImage::new(f.width as u32, (f.height) as u32);
        for (p, i) in out.pixels_mut().zip(&f.ink) {
            p.0[0] = 255 - (255.0 * i) as u8;
        }
        out.save(format!("/tmp/paper/probe/{}.png", file.file_name().unwrap().to_str().unwrap()))
            .unwrap();
    }
}
