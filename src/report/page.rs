//! One self-contained HTML page: text, tables, maps and figures in sections, with style and script inside.
//!
//! The page loads nothing: a content security policy forbids it to, so it opens the same without a network. The figure
//! library is embedded once. What a section says is decided by whoever builds the [`Page`]; what a figure shows, in `figures.rs`.

use super::colour;
use super::figures::Figure;
use std::fmt::Write;

/// A page.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Title, also of the browser window.
    pub title: String,
    /// What the page found, in words; shown first. One entry a paragraph.
    pub summary: Vec<String>,
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
    /// An interactive figure.
    Figure(Figure),
    /// Lines to be copied: a formula, a piece of a file.
    Code(String),
    /// A long text under a line that opens it.
    Details(String, String),
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

/// Writes text so that HTML shows it as it is, in elements and in quoted attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            other => out.push(other),
        }
    }
    out
}

/// What a line of provenance is called that is a note of the reader on the data; pages fold these into one part.
pub const DATA_NOTE: &str = "note on the data";

/// Every note on the data, folded until it is asked for; nothing where there is none.
pub fn data_notes(provenance: &[(String, String)]) -> Option<Part> {
    let notes: Vec<&str> = provenance.iter().filter(|(what, _)| what == DATA_NOTE).map(|(_, note)| note.as_str()).collect();
    (!notes.is_empty()).then(|| Part::Details(format!("Notes on the data ({})", notes.len()), notes.join("\n")))
}

/// The page as HTML, ready to be written to a file.
pub fn page(page: &Page) -> String {
    let mut body = String::new();
    let mut figures = 0;
    let mut summary: String = page.summary.iter().map(|text| format!("<p>{}</p>\n", escape(text))).collect();
    if !summary.is_empty() {
        summary = format!("<div class=\"summary\">\n{summary}</div>\n");
    }
    let mut contents = String::new();
    for (number, section) in page.sections.iter().enumerate() {
        let title = escape(&section.title);
        _ = writeln!(contents, "<li><a href=\"#section-{number}\">{title}</a></li>");
        _ = writeln!(body, "<section id=\"section-{number}\">\n<h2>{title}</h2>");
        for part in &section.parts {
            match part {
                Part::Text(text) => _ = writeln!(body, "<p>{}</p>", escape(text)),
                Part::Table(table) => body.push_str(&table_html(table)),
                Part::Map(map) => body.push_str(&map_html(map)),
                Part::Code(text) => _ = writeln!(body, "<pre>{}</pre>", escape(text)),
                Part::Details(line, text) => {
                    _ = writeln!(body, "<details><summary>{}</summary><pre>{}</pre></details>", escape(line), escape(text));
                }
                Part::Figure(figure) => {
                    body.push_str(&figure_html(figure, figures));
                    figures += 1;
                }
            }
        }
        body.push_str("</section>\n");
    }
    let title = escape(&page.title);
    let scripts = if figures > 0 { format!("{}\n<script>{DRAW}</script>\n", library()) } else { String::new() };
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n<style>{STYLE}</style>\n\
         </head>\n<body>\n<header>\n<h1>{title}</h1>\n{summary}<nav aria-label=\"Sections\"><ol>\n{contents}</ol></nav>\n\
         <noscript><p>The figures need JavaScript; text, tables and maps do not.</p></noscript>\n</header>\n<main>\n{body}</main>\n{scripts}</body>\n</html>\n"
    )
}

/// Longest text of a cell that stays on one line. A column with a longer one is set as prose: wrapped and to the left.
const ONE_LINE: usize = 30;

fn table_html(table: &Table) -> String {
    let mut out = format!("<div class=\"wide\"><table>\n<caption>{}</caption>\n", escape(&table.caption));
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
    let values = map.rows.iter().flat_map(|(.., cells)| cells).filter_map(|cell| cell.value).filter(|value| value.is_finite());
    let largest = values.chain(map.full).fold(0.0, f64::max);
    let mut out = format!("<div class=\"wide\"><table class=\"map\">\n<caption>{}</caption>\n", escape(&map.caption));
    out.push_str(&head_html(&map.columns, &[]));
    for (name, detail, cells) in &map.rows {
        _ = write!(out, "<tr><th scope=\"row\">{}<small>{}</small></th>", escape(name), escape(detail));
        for cell in cells {
            let style = cell.value.filter(|_| largest > 0.0).map(|value| {
                let (paper, ink) = colour::shade(value / largest);
                format!(" style=\"background:{paper};color:{ink}\"")
            });
            let hint = cell.value.map(|value| format!(" title=\"{value:.3}\"")).unwrap_or_default();
            let (text, detail) = (escape(&cell.text), escape(&cell.detail));
            _ = write!(out, "<td{}{hint}>{text}<small>{detail}</small></td>", style.unwrap_or_default());
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

fn figure_html(figure: &Figure, number: usize) -> String {
    // Inside a script element only `<` could end it early; JSON allows to write it as an escape.
    let data = figure.json().replace('<', "\\u003c");
    format!(
        "<figure>\n<figcaption><b>{}</b> {}</figcaption>\n<div class=\"figure\" data-figure=\"figure-{number}\" style=\"height:{}px\"></div>\n\
         <script type=\"application/json\" id=\"figure-{number}\">{data}</script>\n</figure>\n",
        escape(&figure.title),
        escape(&figure.caption),
        figure.height_px
    )
}

/// The figure library as one script element. The crate hands out a formula typesetter after it, which the page does not need.
fn library() -> String {
    const END: &str = "</script>";
    let all = plotly::Plot::offline_js_sources();
    let end = all.find(END).map_or(all.len(), |at| at + END.len());
    all[..end].to_owned()
}

/// Nothing may be loaded; scripts and styles stand in the page; figures can be saved as images.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:";

const DRAW: &str = r#"
for (const place of document.querySelectorAll("[data-figure]")) {
  const figure = JSON.parse(document.getElementById(place.dataset.figure).textContent);
  Plotly.newPlot(place, figure.data, figure.layout, {
    responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
  });
}
for (const event of ["beforeprint", "afterprint"]) {
  addEventListener(event, () => document.querySelectorAll("[data-figure]").forEach((place) => Plotly.Plots.resize(place)));
}
"#;

const STYLE: &str = r#"
:root { color-scheme: light; font-size: 16px; --ink: #1b1b1b; --soft: #595959; --rule: #d4d4d4; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2rem 1.5rem 4rem; max-width: 80rem; background: #fff; color: var(--ink);
  font: 1rem/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "Liberation Sans", sans-serif; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 1rem; }
h2 { font-size: 1.35rem; margin: 2.8rem 0 .6rem; padding-top: .8rem; border-top: 2px solid var(--ink); }
p { max-width: 46rem; margin: .6rem 0; }
.summary { border-left: 4px solid #0072B2; padding: .1rem 0 .1rem 1rem; font-size: 1.08rem; }
nav ol { display: flex; flex-wrap: wrap; gap: .2rem 1.6rem; padding: 0; margin: 1.2rem 0 0; list-style: none; }
nav a { color: #005a8c; }
.wide { overflow-x: auto; margin: 1.2rem 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .95rem; }
caption { text-align: left; font-weight: 600; padding-bottom: .4rem; }
th, td { padding: .3rem .7rem; text-align: right; vertical-align: top; border-bottom: 1px solid var(--rule); white-space: nowrap; }
thead th { border-bottom: 2px solid var(--ink); font-weight: 600; }
th:first-child { text-align: left; }
tbody th { font-weight: 500; }
small { display: block; color: var(--soft); font-weight: 400; font-size: .78rem; line-height: 1.25; }
.star { display: inline-block; width: .6em; text-align: left; font-weight: 700; }
td.prose, thead th.prose { white-space: normal; text-align: left; min-width: 9.5rem; overflow-wrap: anywhere; }
pre { background: #f4f4f4; padding: .6rem .9rem; overflow-x: auto; font-size: .85rem; line-height: 1.4; }
summary { cursor: pointer; color: #005a8c; }
.map td { min-width: 6.2rem; border: 2px solid #fff; }
.map td small { color: inherit; }
.map tbody th { border-bottom-color: #fff; }
.ramp { display: flex; flex-wrap: wrap; align-items: center; gap: .5rem; font-size: .88rem; color: var(--soft); max-width: none; }
.ramp i { width: 12rem; height: .8rem; }
figure { margin: 1.6rem 0; }
figcaption { max-width: 46rem; }
.figure { width: 100%; }
@page { margin: 14mm 12mm; }
@media print {
  :root { font-size: 10.5px; }
  body { padding: 0; max-width: none; }
  p, figcaption { max-width: none; }
  .wide { overflow: visible; break-inside: avoid; }
  h2, h2 + p, caption, figcaption { break-after: avoid; } tr, figure { break-inside: avoid; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  nav, .modebar { display: none !important; }
}
"#;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn with(parts: Vec<Part>) -> Page {
        Page {
            title: "A <b> & \"c\"".into(),
            summary: vec!["x < y".into()],
            sections: vec![Section { title: "<i>s</i>".into(), parts }],
        }
    }

    #[test]
    fn all_text_is_escaped() {
        let evil = "</script><script>alert(1)</script>";
        let table =
            Table { caption: evil.into(), columns: vec![(evil.into(), evil.into())], rows: vec![vec![evil.into(), evil.into()]] };
        let map_cell = MapCell { text: evil.into(), detail: evil.into(), value: Some(1.0) };
        let map = Map {
            caption: evil.into(),
            shade: evil.into(),
            full: None,
            columns: vec![(evil.into(), evil.into())],
            rows: vec![(evil.into(), evil.into(), vec![map_cell])],
        };
        let html = page(&with(vec![Part::Text(evil.into()), Part::Table(table), Part::Map(map)]));
        assert!(!html.contains("<script"), "no figure, no script");
        assert!(html.contains("<title>A &lt;b&gt; &amp; &quot;c&quot;</title>") && html.contains("<h2>&lt;i&gt;s&lt;/i&gt;</h2>"));
        assert_eq!(html.matches("&lt;/script&gt;&lt;script&gt;alert(1)").count(), 14);
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
