//! One self-contained HTML page: a verdict with its picture, then text, tables, maps and figures in sections, with style and script inside.
//!
//! The page loads nothing: a content security policy forbids it to, so it opens the same without a network. All of it is there without
//! scripts; where they run, `page.js` adds zoom, a cross-hair that reads values, and sorting. What a section says is decided by whoever builds
//! the [`Page`]; what a figure shows, in `figures/`.

use super::colour::{self, Theme};
use super::escape::escape;
use super::figures::{self, Figure};
use std::fmt::Write;

/// A page.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Title, also of the browser window.
    pub title: String,
    /// What the page found, in plain words; shown first. The first entry is the verdict, the others say what it rests on; one a paragraph.
    pub summary: Vec<String>,
    /// What stands beneath the verdict, on the first screen.
    pub first: Vec<Part>,
    /// The rest, in order.
    pub sections: Vec<Section>,
}

/// A headed part of a page.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// What stands under it, in order.
    pub parts: Vec<Part>,
}

/// One piece of a section. All text is plain text: it is escaped, never read as HTML.
#[derive(Clone, Debug)]
pub enum Part {
    /// A paragraph.
    Text(String),
    /// A table of texts.
    Table(Table),
    /// A table of shaded numbers.
    Map(Map),
    /// A figure.
    Figure(Figure),
    /// Lines to be copied: a formula, a piece of a file.
    Code(String),
    /// More, under a line that opens it.
    Details(String, Vec<Part>),
}

impl Part {
    fn figures(&self) -> Vec<&Figure> {
        match self {
            Self::Figure(figure) => vec![figure],
            Self::Details(_, parts) => parts.iter().flat_map(Self::figures).collect(),
            _ => Vec::new(),
        }
    }
}

impl Page {
    /// Every figure in order, with a name that no other has: for files.
    pub fn figures(&self) -> Vec<(String, &Figure)> {
        let parts = self.first.iter().chain(self.sections.iter().flat_map(|section| &section.parts));
        let mut known: Vec<(String, &Figure)> = Vec::new();
        for figure in parts.flat_map(Part::figures) {
            let slug = figure.slug();
            let same = known.iter().filter(|(name, _)| name.split_once('_').is_some_and(|(_, name)| name == slug)).count();
            let again = if same > 0 { format!("-{}", same + 1) } else { String::new() };
            known.push((format!("{:02}_{slug}{again}", known.len() + 1), figure));
        }
        known
    }
}

/// A cell of a [`Table`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cell {
    /// What it says.
    pub text: String,
    /// Whether it is the best of its column; set in bold with a star.
    pub best: bool,
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self { text: text.into(), best: false }
    }
}

/// A table. The first column is a heading of its row.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// What the table shows.
    pub caption: String,
    /// Column headings with their units in a second line.
    pub columns: Vec<(String, String)>,
    /// Rows, as long as `columns`.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell of a [`Map`].
#[derive(Clone, Debug, Default)]
pub struct MapCell {
    /// The number as text.
    pub text: String,
    /// A second, smaller line: the interval.
    pub detail: String,
    /// How dark the cell is, on the scale of the map; unshaded if absent.
    pub value: Option<f64>,
    /// What it was before: number and shade, which stand beside those of now.
    pub before: Option<(String, Option<f64>)>,
}

/// A table of numbers shaded by size. Shade and number may be different quantities: numbers in their units, shade comparable.
#[derive(Clone, Debug, Default)]
pub struct Map {
    /// What the map shows.
    pub caption: String,
    /// What the shade means.
    pub shade: String,
    /// The value of the darkest shade, so that maps can be compared; the largest value of the map if absent or smaller.
    pub full: Option<f64>,
    /// Column headings with their units.
    pub columns: Vec<(String, String)>,
    /// Row headings, each with a second, smaller line, and the cells.
    pub rows: Vec<(String, String, Vec<MapCell>)>,
}

/// What a line of provenance is called that is a note of the reader on the data; pages fold these into one part.
pub const DATA_NOTE: &str = "note on the data";

/// Every note on the data, folded until it is asked for; nothing where there is none.
pub fn data_notes(provenance: &[(String, String)]) -> Option<Part> {
    let notes: Vec<&str> = provenance.iter().filter(|(what, _)| what == DATA_NOTE).map(|(_, note)| note.as_str()).collect();
    (!notes.is_empty()).then(|| Part::Details(format!("Notes on the data ({})", notes.len()), vec![Part::Code(notes.join("\n"))]))
}

/// The page as HTML, ready to be written to a file.
pub fn page(page: &Page) -> String {
    let mut body = Body::default();
    let mut first = String::new();
    for (number, text) in page.summary.iter().enumerate() {
        let class = if number == 0 { " class=\"lead\"" } else { "" };
        _ = writeln!(first, "<p{class}>{}</p>", escape(text));
    }
    page.first.iter().for_each(|part| body.part(part));
    first += &std::mem::take(&mut body.html);
    let mut contents = String::new();
    for (number, section) in page.sections.iter().enumerate() {
        let title = escape(&section.title);
        _ = writeln!(contents, "<li><a href=\"#section-{number}\">{title}</a></li>");
        _ = writeln!(body.html, "<section id=\"section-{number}\">\n<h2>{title}</h2>");
        section.parts.iter().for_each(|part| body.part(part));
        body.html.push_str("</section>\n");
    }
    let (title, main) = (escape(&page.title), body.html);
    let (light, dark) = (Theme::LIGHT.variables(), Theme::DARK.variables());
    let figure = figures::STYLE;
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n<style>\n\
         :root {{ color-scheme: light dark; {light} }}\n\
         @media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n{figure}{STYLE}</style>\n\
         </head>\n<body>\n<header>\n<h1>{title}</h1>\n{first}<nav aria-label=\"Sections\"><ol>\n{contents}</ol></nav>\n</header>\n\
         <main>\n{main}</main>\n<script>{SCRIPT}</script>\n</body>\n</html>\n"
    )
}

/// What has been written, and how many figures are in it.
#[derive(Default)]
struct Body {
    html: String,
    figures: usize,
}

impl Body {
    fn part(&mut self, part: &Part) {
        match part {
            Part::Text(text) => _ = writeln!(self.html, "<p>{}</p>", escape(text)),
            Part::Table(table) => self.html.push_str(&table_html(table)),
            Part::Map(map) => self.html.push_str(&map_html(map)),
            Part::Code(text) => _ = writeln!(self.html, "<pre tabindex=\"0\">{}</pre>", escape(text)),
            Part::Details(line, parts) => {
                _ = writeln!(self.html, "<details><summary>{}</summary>", escape(line));
                parts.iter().for_each(|part| self.part(part));
                self.html.push_str("</details>\n");
            }
            Part::Figure(figure) => {
                self.html.push_str(&figure.html(&format!("figure-{}", self.figures)));
                self.figures += 1;
            }
        }
    }
}

/// Longest text of a cell that stays on one line. A column with a longer one is set as prose: wrapped and to the left.
const ONE_LINE: usize = 30;

fn table_html(table: &Table) -> String {
    let mut out = opened("", &table.caption);
    let long = |row: &Vec<Cell>, column: usize| row.get(column).is_some_and(|cell| cell.text.chars().count() > ONE_LINE);
    let prose: Vec<bool> = (0..table.columns.len()).map(|column| table.rows.iter().any(|row| long(row, column))).collect();
    out.push_str(&head_html(&table.columns, &prose));
    for row in &table.rows {
        out.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let text = escape(&cell.text);
            _ = match (column, cell.best) {
                (0, _) => write!(out, "<th scope=\"row\">{text}</th>"),
                (_, true) => write!(out, "<td><b title=\"best of the column\">{text}</b><span class=\"star\">*</span></td>"),
                (_, false) if prose.get(column) == Some(&true) => write!(out, "<td class=\"prose\">{text}</td>"),
                (_, false) => write!(out, "<td>{text}<span class=\"star\"></span></td>"),
            };
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table></div>\n");
    out
}

fn head_html(columns: &[(String, String)], prose: &[bool]) -> String {
    let mut out = "<thead><tr>".to_owned();
    for (column, (name, unit)) in columns.iter().enumerate() {
        let class = if column > 0 && prose.get(column) == Some(&true) { " class=\"prose\"" } else { "" };
        _ = write!(out, "<th scope=\"col\"{class}>{}<small>{}</small></th>", escape(name), escape(unit));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    out
}

fn map_html(map: &Map) -> String {
    let values = map.rows.iter().flat_map(|(.., cells)| cells);
    let values = values.flat_map(|cell| [cell.value, cell.before.as_ref().and_then(|before| before.1)]).flatten();
    let largest = values.filter(|value| value.is_finite()).chain(map.full).fold(0.0, f64::max);
    let mut out = opened(" class=\"map\"", &map.caption);
    out.push_str(&head_html(&map.columns, &[]));
    for (name, detail, cells) in &map.rows {
        _ = write!(out, "<tr><th scope=\"row\">{}<small>{}</small></th>", escape(name), escape(detail));
        for cell in cells {
            let shade = |value: Option<f64>| value.filter(|_| largest > 0.0).map(|value| colour::shade(value / largest));
            let style =
                shade(cell.value).map_or_else(String::new, |(paper, ink)| format!(" style=\"background:{paper};color:{ink}\""));
            let hint = cell.value.map(|value| format!(" title=\"{value:.3}\"")).unwrap_or_default();
            let (text, detail) = (escape(&cell.text), escape(&cell.detail));
            let Some((before, old)) = &cell.before else {
                _ = write!(out, "<td{style}{hint}>{text}<small>{detail}</small></td>");
                continue;
            };
            // Two shades in one cell, each as high as the row.
            let blank = || ("transparent".to_owned(), "inherit");
            let [(left, left_ink), (right, right_ink)] = [*old, cell.value].map(|value| shade(value).unwrap_or_else(blank));
            _ = write!(
                out,
                "<td class=\"pair\" style=\"background:linear-gradient(to right,{left} 50%,{right} 50%)\" title=\"before {0}, after {text} {detail}\">\
                 <span style=\"color:{left_ink}\">{0}</span><span style=\"color:{right_ink}\">{text}</span></td>",
                escape(before)
            );
        }
        out.push_str("</tr>\n");
    }
    let ramp: Vec<String> = (0..=8).map(|step| colour::shade(f64::from(step) / 8.0).0).collect();
    _ = writeln!(
        out,
        "</tbody></table>\n<p class=\"ramp\"><span>0</span><i style=\"background:linear-gradient(to right,{})\"></i><span>{largest:.2}</span> {}</p></div>",
        ramp.join(","),
        escape(&map.shade)
    );
    out
}

/// A table that scrolls by itself where it is too wide or too long, also by the keyboard.
fn opened(class: &str, caption: &str) -> String {
    let (name, line) = match caption {
        "" => ("table".to_owned(), String::new()),
        caption => (escape(caption), format!("<caption>{}</caption>\n", escape(caption))),
    };
    format!("<div class=\"wide\" role=\"region\" tabindex=\"0\" aria-label=\"{name}\"><table{class}>\n{line}")
}

/// Nothing may be loaded; scripts and styles stand in the page.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'";

const SCRIPT: &str = include_str!("page.js");

const STYLE: &str = include_str!("page.css");

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn with(parts: Vec<Part>) -> Page {
        Page {
            title: "A <b> & \"c\"".into(),
            summary: vec!["x < y".into()],
            first: Vec::new(),
            sections: vec![Section { title: "<i>s</i>".into(), parts }],
        }
    }

    #[test]
    fn all_text_is_escaped() {
        let evil = "</script><script>alert(1)</script>";
        let table =
            Table { caption: evil.into(), columns: vec![(evil.into(), evil.into())], rows: vec![vec![evil.into(), evil.into()]] };
        let map_cell = MapCell { text: evil.into(), detail: evil.into(), value: Some(1.0), before: Some((evil.into(), None)) };
        let map = Map {
            caption: evil.into(),
            shade: evil.into(),
            full: None,
            columns: vec![(evil.into(), evil.into())],
            rows: vec![(evil.into(), evil.into(), vec![map_cell])],
        };
        let html = page(&with(vec![
            Part::Text(evil.into()),
            Part::Table(table),
            Part::Map(map),
            Part::Details(evil.into(), vec![Part::Code(evil.into())]),
        ]));
        assert_eq!(html.matches("<script").count(), 1, "the page's own");
        assert!(html.contains("<title>A &lt;b&gt; &amp; &quot;c&quot;</title>") && html.contains("<h2>&lt;i&gt;s&lt;/i&gt;</h2>"));
        assert_eq!(html.matches("&lt;/script&gt;&lt;script&gt;alert(1)").count(), 21);
    }

    #[test]
    fn the_best_is_marked_without_colour() {
        let best = Cell { text: "0.5".into(), best: true };
        let columns = vec![("model".into(), String::new()), ("vx_dot".into(), "m/s²".into())];
        let table = Table { caption: "c".into(), columns, rows: vec![vec!["m".into(), best]] };
        let html = page(&with(vec![Part::Table(table)]));
        assert!(html.contains("0.5</b><span class=\"star\">*</span>") && html.contains("vx_dot<small>m/s²</small>"));
    }

    proptest! {
        #[test]
        fn escaped_text_has_no_markup_and_comes_back(text in "\\PC{0,40}") {
            let escaped = escape(&text);
            prop_assert!(!escaped.contains(['<', '>', '"', '\'']));
            let back = escaped.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&#39;", "'").replace("&amp;", "&");
            prop_assert_eq!(back, text);
        }
    }
}
