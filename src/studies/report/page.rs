//! Builds a page: one self-contained HTML file that can be opened, printed or handed in.
//!
//! The page is readable without scripts, prints on A4, and follows the viewer's choice of a light
//! or dark color scheme. Scripts only add motion: a row of pictures plays as a film, and a path in
//! space rotates under the pointer.

use base64::prelude::{BASE64_STANDARD, Engine};

use super::canvas::escaped;

/// A page that is built section by section.
#[must_use]
#[derive(Clone, Debug, Default)]
pub struct Page {
    title: String,
    lead: String,
    body: String,
}

impl Page {
    /// Creates a page with a title and a lead sentence, which may be empty.
    pub fn new(title: &str, lead: &str) -> Self {
        Self { title: escaped(title), lead: escaped(lead), body: String::new() }
    }

    /// Appends HTML to the body.
    fn with(mut self, html: &str) -> Self {
        self.body += html;
        self
    }

    /// Begins a section with a title.
    pub fn section(self, title: &str) -> Self {
        self.with(&format!("<h2>{}</h2>\n", escaped(title)))
    }

    /// Appends a paragraph.
    pub fn text(self, text: &str) -> Self {
        self.with(&format!("<p>{}</p>\n", escaped(text)))
    }

    /// Appends text formatted as in the terminal.
    pub fn printed(self, text: &str) -> Self {
        self.with(&format!("<pre>{}</pre>\n", escaped(text)))
    }

    /// Appends a table with a header of column names. Appends nothing without rows.
    pub fn table<const N: usize>(
        self,
        names: [&str; N],
        rows: impl IntoIterator<Item = [String; N]>,
    ) -> Self {
        let rows: Vec<Vec<String>> = rows.into_iter().map(Vec::from).collect();
        self.rows(&names.map(str::to_owned), &rows)
    }

    /// Appends a table of any width with a header of column names. Appends nothing without rows.
    pub fn rows(self, names: &[String], rows: &[Vec<String>]) -> Self {
        fn row(tag: &str, cells: &[String]) -> String {
            let cells = cells.iter().map(|text| format!("<{tag}>{}</{tag}>", escaped(text)));
            format!("<tr>{}</tr>\n", cells.collect::<String>())
        }
        if rows.is_empty() {
            return self;
        }
        // Text from users is escaped whenever it is added to a page.
        let rows: String = rows.iter().map(|cells| row("td", cells)).collect();
        let names = row("th", names);
        self.with(&format!("<div class=\"wide\"><table>\n{names}{rows}</table></div>\n"))
    }

    /// Appends a drawing from an SVG file, with alternative text. Scripts inside it do not run.
    pub fn drawing(self, svg: &[u8], alt: &str) -> Self {
        let image = image("svg+xml", svg, alt);
        self.with(&format!("<figure class=\"drawn\">{image}</figure>\n"))
    }

    /// Appends SVG drawings, side by side if space permits.
    pub fn drawings<T: AsRef<str>>(self, drawings: &[T]) -> Self {
        let figures = drawings.iter().map(|svg| {
            // An XML declaration is not allowed inside an HTML page.
            let svg = svg.as_ref();
            format!("<figure>{}</figure>\n", svg.find("<svg").map_or("", |begin| &svg[begin..]))
        });
        let figures: String = figures.collect();
        self.with(&format!("<div class=\"drawings\">\n{figures}</div>\n"))
    }

    /// Appends a photo (JPEG) with alternative text, and an optional SVG overlay of the same size.
    pub fn photo(self, jpeg: &[u8], alt: &str, overlay: Option<&str>) -> Self {
        let image = image("jpeg", jpeg, alt);
        self.with(&match overlay {
            None => format!("<figure class=\"photo\">{image}</figure>\n"),
            Some(svg) => format!(
                "<figure class=\"photo\"><input type=\"checkbox\" id=\"over\">\
                 <label for=\"over\">what the reader sees</label>\
                 <div>{image}{svg}</div></figure>\n"
            ),
        })
    }

    /// Appends a row of photos (JPEG) with captions. If scripts are enabled, they play as a film.
    pub fn film(self, pictures: &[(Vec<u8>, String)]) -> Self {
        self.figures("film", pictures.iter().map(|(jpeg, caption)| (&**jpeg, &**caption)))
    }

    /// Appends two photos (JPEG) with captions side by side.
    pub fn pair(self, pictures: [(&[u8], String); 2]) -> Self {
        self.figures("pair", pictures.iter().map(|(jpeg, caption)| (*jpeg, &**caption)))
    }

    /// Appends photos side by side, each a JPEG with its caption, in a block of the style `class`.
    /// The caption is also the text for readers that show no images.
    fn figures<'a>(self, class: &str, photos: impl Iterator<Item = (&'a [u8], &'a str)>) -> Self {
        let figures = photos.map(|(jpeg, caption)| {
            let caption = escaped(caption);
            let image = image("jpeg", jpeg, &caption);
            format!("<figure>{image}<figcaption>{caption}</figcaption></figure>\n")
        });
        let figures: String = figures.collect();
        self.with(&format!("<div class=\"{class}\">\n{figures}</div>\n"))
    }

    /// Appends paths in space that rotate under the pointer. Each point is in millimeters, with
    /// true if the point is lit.
    pub fn paths(self, paths_mm: &[Vec<([i32; 3], bool)>]) -> Self {
        let paths = paths_mm.iter().map(|path| {
            path.iter().map(|([x, y, z], lit)| [*x, *y, *z, i32::from(*lit)]).collect()
        });
        let paths = serde_json::json!(paths.collect::<Vec<Vec<[i32; 4]>>>());
        self.with(&format!(
            "<canvas class=\"path\" width=\"960\" height=\"480\" tabindex=\"0\" role=\"img\" \
             aria-label=\"the path in space, rotated by dragging or with the arrow keys\" \
             data-paths=\"{paths}\"></canvas>\n"
        ))
    }

    /// Returns the complete HTML file.
    pub fn html(&self) -> String {
        let Self { title, lead, body } = self;
        let lead = match lead.as_str() {
            "" => String::new(),
            lead => format!("<p class=\"lead\">{lead}</p>\n"),
        };
        let (css, js) = (include_str!("page.css"), include_str!("page.js"));
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width\">\n\
             <link rel=\"icon\" href=\"data:,\">\n\
             <title>{title}</title>\n<style>\n{css}</style>\n</head>\n<body>\n<h1>{title}</h1>\n\
             {lead}{body}<script>\n{js}</script>\n</body>\n</html>\n"
        )
    }
}

/// Returns an embedded image with alternative text. `kind` is the subtype of its media type.
fn image(kind: &str, bytes: &[u8], alt: &str) -> String {
    let (alt, base64) = (alt.replace('"', "&quot;"), BASE64_STANDARD.encode(bytes));
    format!("<img alt=\"{alt}\" src=\"data:image/{kind};base64,{base64}\">")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_user_wrote_is_text() {
        let page = Page::new("<script>", "a & b")
            .section("<b>")
            .text("<i>")
            .printed("</pre>")
            .table(["<th>"], [["<td>".to_owned()]])
            .photo(&[], "\"><x", None);
        let html = page.html();
        assert_eq!(html.matches("<script>").count(), 1, "our own");
        for bad in ["<b>", "<i>", "</pre></pre>", "\"><x"] {
            assert!(!html.contains(bad), "{bad}");
        }
        assert!(html.contains("a &amp; b") && html.contains("&lt;td>"));
        assert!(!html.contains("http://") && !html.contains("https://"), "no request leaves it");
    }
}
