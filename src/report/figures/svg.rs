//! Pieces of SVG as text: a plotting area with its axes, lines, marks, words. What they show is decided elsewhere.
//!
//! Colours are classes, so that one picture is right on light and on dark paper; `page.css` and [`colour`](super::super::colour) say which.
//! What is drawn over an axis lies in an inner `<svg class="d">` in tenths of a pixel: it cuts off what lies beyond the axes, and the script
//! zooms by its `viewBox` alone.

use super::super::escape::escape;
use super::scale::Scale;
use std::fmt::Write;

/// Width of a panel, pixels at its natural size.
pub const WIDTH: f64 = 420.0;
/// Space left of an area for tick labels, and right of it.
pub const LEFT: f64 = 46.0;
/// Space right of an area.
pub const RIGHT: f64 = 10.0;
/// Mean width of a character of a label, pixels.
pub const CHARACTER: f64 = 6.3;
/// Inner units of a pixel.
const FINE: f64 = 10.0;

/// A plotting area.
#[derive(Clone, Copy, Debug)]
pub struct Area {
    /// Left edge, pixels of the panel.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
    /// Horizontal axis.
    pub x: Scale,
    /// Vertical axis, upwards.
    pub y: Scale,
}

/// Which ticks an area has.
#[derive(Clone, Copy, Debug)]
pub struct Ticks<'a> {
    /// About so many on the horizontal axis; none are labelled with 0.
    pub x: usize,
    /// About so many on the vertical axis.
    pub y: usize,
    /// What stands below the horizontal axis.
    pub x_title: &'a str,
}

/// A number of pixels, short.
pub fn px(value: f64) -> String {
    let rounded = (value * 10.0).round() / 10.0;
    if rounded == 0.0 { "0".to_owned() } else { format!("{rounded}") }
}

/// A number as it is written into attributes that the script reads.
fn number(value: f64) -> String {
    format!("{value:.9e}").parse::<f64>().map_or_else(|_| "0".into(), |value| format!("{value}"))
}

/// Words at a place; `anchor` is `start`, `middle` or `end`.
pub fn words(class: &str, anchor: &str, x: f64, y: f64, text: &str) -> String {
    format!("<text class=\"{class}\" text-anchor=\"{anchor}\" x=\"{}\" y=\"{}\">{}</text>\n", px(x), px(y), escape(text))
}

/// A title of a panel at its upper left, what it is in at its upper right.
pub fn heading(title: &str, unit: &str) -> String {
    let unit_width = CHARACTER * unit.chars().count() as f64;
    let room = ((WIDTH - LEFT - RIGHT - unit_width - 8.0) / (CHARACTER * 1.12)).max(8.0) as usize;
    words("ti", "start", LEFT, 14.0, &clipped(title, room)) + &words("tk", "end", WIDTH - RIGHT, 14.0, unit)
}

/// Text cut to so many characters, with a mark where it was.
pub fn clipped(text: &str, characters: usize) -> String {
    if text.chars().count() <= characters {
        return text.to_owned();
    }
    text.chars().take(characters.saturating_sub(1)).chain(['…']).collect()
}

/// A straight line.
pub fn line(class: &str, from: [f64; 2], to: [f64; 2]) -> String {
    let [x1, y1] = from.map(px);
    let [x2, y2] = to.map(px);
    format!("<path class=\"{class}\" d=\"M{x1} {y1}L{x2} {y2}\"/>\n")
}

/// A rectangle; with `says` it has a title of its own.
pub fn rectangle(class: &str, [x, y, width, height]: [f64; 4], says: &str) -> String {
    let place = format!("x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"", px(x), px(y), px(width.max(0.0)), px(height.max(0.0)));
    if says.is_empty() {
        return format!("<rect class=\"{class}\" {place}/>\n");
    }
    format!("<rect class=\"{class}\" {place}><title>{}</title></rect>\n", escape(says))
}

impl Area {
    /// The pixel of a horizontal value.
    pub fn at_x(&self, value: f64) -> f64 {
        self.left + self.width * self.x.place(value)
    }

    /// The pixel of a vertical value.
    pub fn at_y(&self, value: f64) -> f64 {
        self.top + self.height * (1.0 - self.y.place(value))
    }

    /// The lower edge.
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// Grid, tick labels and the line at zero.
    pub fn axes(&self, ticks: Ticks<'_>) -> String {
        let mut out = String::new();
        for (value, label) in self.y.ticks(ticks.y).into_iter().filter(|_| ticks.y > 0) {
            let y = self.at_y(value);
            let class = if value == 0.0 && !self.y.log { "zero" } else { "gr" };
            out += &line(class, [self.left, y], [self.left + self.width, y]);
            out += &words("tk", "end", self.left - 5.0, y + 4.0, &label);
        }
        out += &line("ax", [self.left, self.bottom()], [self.left + self.width, self.bottom()]);
        let labels = self.x.ticks(ticks.x);
        if ticks.x > 0 {
            out.push_str("<g class=\"xt\">\n");
            for (value, label) in labels {
                out += &words("tk", "middle", self.at_x(value), self.bottom() + 15.0, &label);
            }
            out.push_str("</g>\n");
        }
        if !ticks.x_title.is_empty() {
            out += &words("tk", "middle", self.left + 0.5 * self.width, self.bottom() + 30.0, ticks.x_title);
        }
        out
    }

    /// What is drawn over the axes: `content` in inner units, made by [`Area::path`] and [`Area::dots`].
    pub fn data(&self, content: &str) -> String {
        let log = if self.y.log { " data-log=\"1\"" } else { "" };
        format!(
            "<svg class=\"d\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {} {}\" preserveAspectRatio=\"none\" \
             data-x=\"{} {}\" data-y=\"{} {}\"{log}>\n{content}</svg>\n",
            px(self.left),
            px(self.top),
            px(self.width),
            px(self.height),
            px(self.width * FINE),
            px(self.height * FINE),
            number(self.x.low),
            number(self.x.high),
            number(self.y.low),
            number(self.y.high)
        )
    }

    fn inner(&self, x: f64, y: f64) -> Option<[i64; 2]> {
        // Far outside a number of pixels would be long and say no more.
        let of = |place: f64, length: f64| (place * length * FINE).clamp(-9e4, 9e4).round() as i64;
        (x.is_finite() && y.is_finite()).then(|| [of(self.x.place(x), self.width), of(1.0 - self.y.place(y), self.height)])
    }

    /// A line through points; a point that is not finite breaks it. `name` is what the script calls it.
    pub fn path(&self, class: &str, name: &str, points: impl Iterator<Item = (f64, f64)>) -> String {
        let mut d = String::new();
        let mut before: Option<[i64; 2]> = None;
        for (x, y) in points {
            let here = self.inner(x, y);
            match (before, here) {
                (None, Some([x, y])) => _ = write!(d, "M{x} {y}l"),
                (Some([x0, y0]), Some([x, y])) => {
                    let space = if d.ends_with('l') || x < x0 { "" } else { " " };
                    let between = if y < y0 { "" } else { " " };
                    _ = write!(d, "{space}{}{between}{}", x - x0, y - y0);
                }
                (_, None) => {}
            }
            before = here;
        }
        // A single point has no length: a round end makes it a dot.
        let d = d.replace("lM", "l0 0M");
        let d = if d.ends_with('l') { d + "0 0" } else { d };
        format!("<path class=\"l {class}\" data-name=\"{}\" d=\"{d}\"/>\n", escape(name))
    }

    /// Dots that keep their shape when the script zooms.
    pub fn dots(&self, class: &str, name: &str, points: impl Iterator<Item = (f64, f64)>) -> String {
        let mut d = String::new();
        for [x, y] in points.filter_map(|(x, y)| self.inner(x, y)) {
            _ = write!(d, "M{x} {y}l0 0");
        }
        format!("<path class=\"l dot {class}\" data-name=\"{}\" d=\"{d}\"/>\n", escape(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area() -> Area {
        let (x, y) = (Scale::linear(0.0, 10.0), Scale::linear(-1.0, 1.0));
        Area { left: 40.0, top: 20.0, width: 100.0, height: 50.0, x, y }
    }

    #[test]
    fn a_path_holds_every_point_in_tenths_and_breaks_where_there_is_no_number() {
        let points = [(0.0, 1.0), (5.0, 0.0), (10.0, -1.0), (10.0, f64::NAN), (2.0, 0.0), (1.0, 1.0)];
        let path = area().path("s1", "a & b", points.into_iter());
        assert!(path.contains("d=\"M0 0l500 250 500 250M200 250l-100-250\""), "{path}");
        assert!(path.contains("data-name=\"a &amp; b\""));
        let alone = area().path("s1", "", [(5.0, 0.0), (6.0, f64::NAN), (7.0, 0.0)].into_iter());
        assert!(alone.contains("M500 250l0 0M700 250l0 0\""), "{alone}");
    }

    #[test]
    fn words_are_escaped_and_cut_where_there_is_no_room() {
        assert!(words("tk", "end", 1.0, 2.04, "<b>").contains("y=\"2\">&lt;b&gt;</text>"));
        assert_eq!((clipped("abcdef", 6), clipped("abcdefg", 6)), ("abcdef".into(), "abcde…".into()));
    }

    #[test]
    fn places_are_pixels_with_the_vertical_axis_upwards() {
        assert_eq!([area().at_x(10.0), area().at_y(1.0), area().at_y(-1.0)].map(|value| value.round() as i64), [140, 20, 70]);
    }
}
