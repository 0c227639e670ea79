use super::*;
#[test]
fn dump() {
    let Ok(list) = std::env::var("DUMP") else { return };
    let out = std::env::var("DUMP_OUT").unwrap();
    for path in list.split(':') {
        let path = Path::new(path);
        let name = path.file_name().unwrap().to_str().unwrap();
        let begin = std::time::Instant::now();
        match draw(path, &LetterOptions::default(), Ink::ByColor) {
            Err(error) => println!("{name}: ERROR {error}"),
            Ok(strokes) => {
                let [l, b, r, t] =
                    bounds(strokes.source.strokes.iter().flat_map(|s| s.points.iter().copied()));
                let mut text = format!(
                    "<svg xmlns='http://www.w3.org/2000/svg' viewBox='{l} {b} {} {}'><rect x='{l}' y='{b}' width='100%' height='100%' fill='#fff'/>",
                    r - l,
                    t - b
                );
                let w = (r - l).max(t - b) / 200.0;
                for (k, stroke) in strokes.source.strokes.iter().enumerate() {
                    let points: Vec<String> =
                        stroke.points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
                    let color = ["#c00", "#06c", "#080", "#a0a", "#c80"][k % 5];
                    text += &format!(
                        "<polyline points='{}' fill='none' stroke='{color}' stroke-width='{w}' stroke-linecap='round'/>",
                        points.join(" ")
                    );
                }
                text += "</svg>";
                std::fs::write(format!("{out}/{name}.svg"), text).unwrap();
                let colors: Vec<_> = strokes
                    .source
                    .strokes
                    .iter()
                    .map(|s| s.color.unwrap_or("-"))
                    .collect::<std::collections::BTreeSet<_>>()
                    .into_iter()
                    .collect();
                println!(
                    "{name}: {} strokes, {:.2} m, {:?} {:.2} s",
                    strokes.source.strokes.len(),
                    strokes.length_m(),
                    colors,
                    begin.elapsed().as_secs_f64()
                );
                for w in &strokes.warnings {
                    println!("      {} {w}", w.code);
                }
            }
        }
    }
}
