//! Figures as SVG: what the critique found, as pictures that need no script. How one is put on a page is `page.rs`.
//!
//! A figure is a row of panels that wraps where the screen is narrow, each a picture of its own with a name for those who do not see it. Under
//! it lies what it shows as numbers ([`Figure::csv`]).

mod bars;
mod lines;
mod ranges;
mod residuals;
mod scale;
mod svg;

pub use bars::{Fall, FallPanel, Kind, falls, shares};
pub use lines::{LineData, Trace, lines, log_lines, traces};
pub use ranges::{RangeRow, ranges};
pub use residuals::{BinnedPanel, binned, surfaces};

use super::colour::{self, Theme};
use super::escape::escape;
use std::fmt::Write;

/// Panels of one figure at most.
pub const PANELS: usize = 6;

/// How a name of the legend looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// A line.
    Line,
    /// A dashed line.
    Dashed,
    /// A filled area or bar.
    Bar,
    /// The same, less strong.
    Faint,
    /// An outline.
    Hollow,
    /// A dot.
    Dot,
    /// The outline of a dot.
    Ring,
}

/// A name of the legend.
#[derive(Clone, Debug)]
pub struct Key {
    /// What it names.
    pub name: String,
    /// Number of its colour; see [`Theme::series`].
    pub series: usize,
    /// How it looks.
    pub look: Look,
}

/// A row of the numbers behind a figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Datum {
    /// Which line or bar.
    pub series: String,
    /// The horizontal value, or the name of what a bar stands for.
    pub x: String,
    /// The value.
    pub y: f64,
    /// Its interval.
    pub interval: Option<[f64; 2]>,
}

/// One picture.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Its name.
    pub title: String,
    /// What it shows, for those who do not see it.
    pub says: String,
    /// Height at the natural width, pixels.
    height: f64,
    /// SVG.
    body: String,
    /// The numbers.
    pub data: Vec<Datum>,
}

/// A figure, ready for a page or a file.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Title.
    pub title: String,
    /// What to see in it, in a sentence.
    pub caption: String,
    /// The pictures.
    pub panels: Vec<Panel>,
    keys: Vec<Key>,
    /// Whether the horizontal axes are one and the script may zoom.
    linked: bool,
}

impl Figure {
    /// Its title as the name of a file or of a place on the page: `rmse-from-effect-to-effect`.
    pub fn slug(&self) -> String {
        let mut out = String::new();
        for character in self.title.chars().flat_map(char::to_lowercase) {
            match character {
                'a'..='z' | '0'..='9' | '_' => out.push(character),
                _ if out.ends_with('-') || out.is_empty() => {}
                _ => out.push('-'),
            }
        }
        out.trim_end_matches('-').to_owned()
    }

    /// As part of a page; `id` is not used elsewhere on it.
    pub fn html(&self, id: &str) -> String {
        let class = if self.linked { "fig linked" } else { "fig" };
        let mut out = format!(
            "<figure class=\"{class}\" id=\"{id}\" aria-labelledby=\"{id}-name\">\n<figcaption><b id=\"{id}-name\">{}</b> {}</figcaption>\n",
            escape(&self.title),
            escape(&self.caption)
        );
        if !self.keys.is_empty() {
            out.push_str("<ul class=\"keys\">\n");
            for key in &self.keys {
                let (series, name) = (key.series, escape(&key.name));
                _ = writeln!(
                    out,
                    "<li data-series=\"{series}\"><svg viewBox=\"0 0 26 12\" aria-hidden=\"true\">{}</svg>{name}</li>",
                    key.sign()
                );
            }
            out.push_str("</ul>\n");
        }
        out.push_str("<div class=\"panels\">\n");
        for (number, panel) in self.panels.iter().enumerate() {
            let name = format!("{id}-{number}");
            _ = write!(
                out,
                "<svg class=\"panel\" viewBox=\"0 0 {} {}\" role=\"img\" tabindex=\"0\" aria-labelledby=\"{name}t {name}d\">\n<title \
                 id=\"{name}t\">{}</title>\n<desc id=\"{name}d\">{}</desc>\n{}</svg>\n",
                svg::px(svg::WIDTH),
                svg::px(panel.height),
                escape(&panel.title),
                escape(&panel.says),
                panel.body
            );
        }
        out.push_str("</div>\n</figure>\n");
        out
    }

    /// As an SVG file of its own: title, legend and all panels, three beside each other, in colours for light and dark paper.
    pub fn svg(&self) -> String {
        const GAP: f64 = 16.0;
        let columns = self.panels.len().clamp(1, 3);
        let heights: Vec<f64> =
            self.panels.chunks(columns).map(|row| row.iter().map(|panel| panel.height).fold(0.0, f64::max)).collect();
        let width = columns as f64 * (svg::WIDTH + GAP) + GAP;
        let mut head = svg::words("ti", "start", GAP, 22.0, &self.title);
        let (mut x, mut y) = (GAP, 44.0);
        for key in &self.keys {
            let long = 44.0 + svg::CHARACTER * key.name.chars().count() as f64;
            if x + long > width && x > GAP {
                (x, y) = (GAP, y + 20.0);
            }
            _ = writeln!(
                head,
                "<svg x=\"{}\" y=\"{}\" width=\"26\" height=\"12\" viewBox=\"0 0 26 12\">{}</svg>",
                svg::px(x),
                svg::px(y - 10.0),
                key.sign()
            );
            head += &svg::words("tk", "start", x + 32.0, y, &key.name);
            x += long;
        }
        let mut top = if self.keys.is_empty() { 36.0 } else { y + 16.0 };
        for (row, height) in self.panels.chunks(columns).zip(&heights) {
            for (column, panel) in row.iter().enumerate() {
                let left = GAP + column as f64 * (svg::WIDTH + GAP);
                _ = write!(
                    head,
                    "<svg x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" role=\"img\">\n<title>{}</title>\n<desc>{}</desc>\n{}</svg>\n",
                    svg::px(left),
                    svg::px(top),
                    svg::px(svg::WIDTH),
                    svg::px(panel.height),
                    escape(&panel.title),
                    escape(&panel.says),
                    panel.body
                );
            }
            top += height + GAP;
        }
        let (light, dark) = (Theme::LIGHT.resolve(STYLE), Theme::DARK.resolve(STYLE));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" role=\"img\">\n<title>{2}</title>\n\
             <desc>{3}</desc>\n<style>\n{light}@media (prefers-color-scheme: dark) {{\n{dark}}}\n</style>\n\
             <rect class=\"paper\" width=\"{0}\" height=\"{1}\"/>\n{head}</svg>\n",
            svg::px(width),
            svg::px(top),
            escape(&self.title),
            escape(&self.caption),
        )
    }

    /// The numbers that are drawn, all of them: `panel,series,x,y,low,high`, an empty field where there is none.
    pub fn csv(&self) -> String {
        let quoted = |text: &str| {
            if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
        };
        let number = |value: f64| if value.is_finite() { format!("{value}") } else { String::new() };
        let mut out = "panel,series,x,y,low,high\n".to_owned();
        for panel in &self.panels {
            for datum in &panel.data {
                let [low, high] = datum.interval.map_or_else(Default::default, |ends| ends.map(number));
                let [title, series, x] = [&panel.title, &datum.series, &datum.x].map(|text| quoted(text));
                _ = writeln!(out, "{title},{series},{x},{},{low},{high}", number(datum.y));
            }
        }
        out
    }
}

impl Key {
    fn sign(&self) -> String {
        let series = self.series;
        match self.look {
            Look::Line => format!("<path class=\"l s{series}\" d=\"M1 6h24\"/>"),
            Look::Dashed => format!("<path class=\"l dash s{series}\" d=\"M1 6h24\"/>"),
            Look::Bar => format!("<rect class=\"f{series}\" x=\"4\" y=\"1\" width=\"18\" height=\"10\"/>"),
            Look::Faint => format!("<rect class=\"f{series} thin\" x=\"4\" y=\"1\" width=\"18\" height=\"10\"/>"),
            Look::Hollow => format!("<rect class=\"h{series}\" x=\"4\" y=\"1\" width=\"18\" height=\"10\"/>"),
            Look::Dot => format!("<circle class=\"f{series}\" cx=\"13\" cy=\"6\" r=\"4\"/>"),
            Look::Ring => format!("<circle class=\"h{series}\" cx=\"13\" cy=\"6\" r=\"3\"/>"),
        }
    }
}

/// What the classes of a picture mean, on a page and in a file alike; colours are those of a [`Theme`].
pub const STYLE: &str = include_str!("figure.css");

/// `vx, m/s`; the name alone for a quantity without a unit.
pub(super) fn with_unit(name: &str, unit: &str) -> String {
    if unit == "1" { name.to_owned() } else { format!("{name}, {unit}") }
}

/// Series of the n-th line: the first is what was measured, the others repeat.
pub(super) const fn series(number: usize) -> usize {
    if number == 0 { 0 } else { 1 + (number - 1) % (colour::SERIES - 1) }
}

/// Points of a line that a panel draws at most: more than it has pixels.
pub const POINTS: usize = 2400;

/// Thins a line to about [`POINTS`] points: of each of equal stretches the lowest and the highest value stay, so that peaks do.
pub fn thin(x: &[f64], y: &[f64]) -> Vec<(f64, f64)> {
    let pairs: Vec<(f64, f64)> = x.iter().copied().zip(y.iter().copied()).collect();
    if pairs.len() <= POINTS {
        return pairs;
    }
    let stretch = pairs.len().div_ceil(POINTS / 2);
    let ends = |stretch: &[(f64, f64)]| {
        let by = |a: &(usize, &(f64, f64)), b: &(usize, &(f64, f64))| a.1.1.total_cmp(&b.1.1);
        let lowest = stretch.iter().enumerate().min_by(by).map_or(0, |(index, _)| index);
        let highest = stretch.iter().enumerate().max_by(by).map_or(0, |(index, _)| index);
        let mut kept = vec![lowest.min(highest), lowest.max(highest)];
        kept.dedup();
        kept.into_iter().filter_map(|index| stretch.get(index).copied()).collect::<Vec<_>>()
    };
    pairs.chunks(stretch).flat_map(ends).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(super) fn panels(count: usize) -> Vec<(String, String)> {
        (0..count).map(|panel| (format!("panel {panel}"), "m/s²".to_owned())).collect()
    }

    /// Tags that are opened are closed, in order, and nothing stands where XML has no place for it.
    pub(super) fn well_formed(xml: &str) -> Result<(), String> {
        let mut open: Vec<&str> = Vec::new();
        for piece in xml.split('<').skip(1) {
            let (tag, text) = piece.split_once('>').ok_or_else(|| format!("no end: {piece}"))?;
            let name = tag.trim_start_matches('/').split([' ', '/']).next().unwrap_or_default();
            match (tag.starts_with('/'), tag.ends_with('/')) {
                (true, _) if open.pop() != Some(name) => return Err(format!("</{name}> closes nothing")),
                (false, false) => open.push(name),
                _ => {}
            }
            if tag.matches('"').count() % 2 == 1 || text.split('&').skip(1).any(|after| !after.contains(';')) {
                return Err(format!("a loose quote or ampersand: {piece}"));
            }
        }
        if open.is_empty() { Ok(()) } else { Err(format!("left open: {open:?}")) }
    }

    #[test]
    fn a_figure_is_a_well_formed_file_with_names_and_its_numbers() {
        let time: Vec<f64> = (0..50).map(f64::from).collect();
        let line = |name: &str| LineData { name: name.into(), x: time.clone(), y: vec![time.clone(); 2] };
        let figure = lines("A <b> & c", "says \"it\"", "time, s", &panels(2), &[line("measured"), line("m, <1>")]);
        for picture in [figure.svg(), figure.html("fig-1")] {
            assert_eq!(well_formed(&picture), Ok(()), "{picture}");
            assert_eq!(picture.matches("role=\"img\"").count(), if picture.contains("xmlns") { 3 } else { 2 });
            assert!(
                picture.contains("A &lt;b&gt; &amp; c") && picture.contains("<desc") && !picture.contains("var(--")
                    || picture.starts_with("<figure")
            );
        }
        assert_eq!(figure.slug(), "a-b-c");
        let csv = figure.csv();
        assert_eq!(csv.lines().count(), 1 + 2 * 2 * 50);
        assert!(
            csv.starts_with("panel,series,x,y,low,high\npanel 0,measured,0,0,,\n") && csv.contains("panel 1,\"m, <1>\",49,49,,\n"),
            "{csv}"
        );
    }

    proptest! {
        #[test]
        fn thinning_keeps_order_and_extremes(y in prop::collection::vec(-1.0..1.0_f64, 1..5000)) {
            let x: Vec<f64> = (0..y.len()).map(|index| index as f64).collect();
            let thinned = thin(&x, &y);
            prop_assert!(thinned.len() <= POINTS);
            prop_assert!(thinned.windows(2).all(|pair| pair[0].0 < pair[1].0));
            prop_assert_eq!(scale::ends(y.into_iter()), scale::ends(thinned.into_iter().map(|(_, y)| y)));
        }
    }
}
