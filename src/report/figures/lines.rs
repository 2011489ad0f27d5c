//! Lines over a common horizontal axis: errors by step, spectra, training curves; and measured against predicted over time, with what is left
//! and the sticks below.

use super::scale::{Scale, ends};
use super::svg::{Area, LEFT, RIGHT, Ticks, WIDTH, heading, line, words};
use super::{Datum, Figure, Key, Look, Panel, series, thin};
use crate::critique::digits::significant;

/// One line of a [`lines`] figure.
#[derive(Clone, Debug)]
pub struct LineData {
    /// Name in the legend.
    pub name: String,
    /// Horizontal values.
    pub x: Vec<f64>,
    /// Vertical values of each panel, each as long as `x`; what is not finite breaks the line.
    pub y: Vec<Vec<f64>>,
}

/// Lines in panels with one horizontal axis and one legend. The first line is what the others are seen against, in the colour of the words; the
/// second, wide, the one in focus. `panels` are (title, unit of the vertical axis).
pub fn lines(title: &str, caption: &str, x_title: &str, panels: &[(String, String)], data: &[LineData]) -> Figure {
    lines_on(false, title, caption, x_title, panels, data)
}

/// As [`lines`], on logarithmic vertical axes.
pub fn log_lines(title: &str, caption: &str, x_title: &str, panels: &[(String, String)], data: &[LineData]) -> Figure {
    lines_on(true, title, caption, x_title, panels, data)
}

fn lines_on(log: bool, title: &str, caption: &str, x_title: &str, panels: &[(String, String)], data: &[LineData]) -> Figure {
    let (low, high) = ends(data.iter().flat_map(|line| line.x.iter().copied()));
    let x = Scale::linear(low, high);
    let draw = |(number, (title, unit)): (usize, &(String, String))| {
        let of = |line: &LineData| line.y.get(number).map_or_else(Vec::new, |y| thin(&line.x, y));
        let drawn: Vec<Vec<(f64, f64)>> = data.iter().map(of).collect();
        let values = || drawn.iter().flatten().map(|(_, y)| *y);
        let y = if log { Scale::decades(values()) } else { Scale::around(values()) };
        let area = Area { left: LEFT, top: 24.0, width: WIDTH - LEFT - RIGHT, height: 150.0, x, y };
        let content: Vec<String> = data
            .iter()
            .zip(&drawn)
            .enumerate()
            .map(|(number, (line, points))| area.path(&class(number), &line.name, points.iter().copied()))
            .collect();
        // What the others are seen against lies on top.
        let content: String = content.into_iter().rev().collect();
        let body = heading(title, unit)
            + &area.axes(Ticks { x: 6, y: 4, x_title })
            + &area.data(&content)
            + &cross(area.top, area.bottom());
        Panel { title: title.clone(), says: says(data, &drawn, unit), height: 210.0, body, data: numbers(data, &drawn) }
    };
    Figure {
        title: title.to_owned(),
        caption: caption.to_owned(),
        panels: panels.iter().enumerate().map(draw).collect(),
        keys: keys(data.iter().map(|line| line.name.as_str())),
        linked: true,
    }
}

/// The class of the n-th line: lines differ in more than colour.
fn class(number: usize) -> String {
    let dash = match number {
        0 => " fine",
        1 => " wide",
        n if n % 2 == 0 => " dash",
        _ => " dots",
    };
    format!("s{}{dash}", series(number))
}

fn keys<'a>(names: impl Iterator<Item = &'a str>) -> Vec<Key> {
    let look = |number: usize| if number < 2 { Look::Line } else { Look::Dashed };
    names.enumerate().map(|(number, name)| Key { name: name.into(), series: series(number), look: look(number) }).collect()
}

/// Where the script puts the cross-hair.
fn cross(top: f64, bottom: f64) -> String {
    format!("<path class=\"cross\" data-from=\"{top:.0}\" data-to=\"{bottom:.0}\" d=\"\"/>\n")
}

/// The range of each line in words.
fn says(data: &[LineData], drawn: &[Vec<(f64, f64)>], unit: &str) -> String {
    let one = |(line, points): (&LineData, &Vec<(f64, f64)>)| {
        let (low, high) = ends(points.iter().map(|(_, y)| *y));
        (low <= high).then(|| format!("{} from {} to {} {unit}", line.name, significant(low, 2), significant(high, 2)))
    };
    let said: Vec<String> = data.iter().zip(drawn).filter_map(one).collect();
    if said.is_empty() { "Nothing to draw.".into() } else { format!("Lines: {}.", said.join("; ")) }
}

fn numbers(data: &[LineData], drawn: &[Vec<(f64, f64)>]) -> Vec<Datum> {
    let of = |(line, points): (&LineData, &Vec<(f64, f64)>)| {
        let finite = points.iter().filter(|(x, y)| x.is_finite() && y.is_finite());
        finite.map(|(x, y)| Datum { series: line.name.clone(), x: x.to_string(), y: *y, interval: None }).collect::<Vec<_>>()
    };
    data.iter().zip(drawn).flat_map(of).collect()
}

/// Measured and predicted over one stretch of a flight.
#[derive(Clone, Debug)]
pub struct Trace {
    /// Time of the measurements, s.
    pub time_s: Vec<f64>,
    /// What was measured, a panel each.
    pub measured: Vec<Vec<f64>>,
    /// Time of the predictions, s; every sample, or only some.
    pub predicted_s: Vec<f64>,
    /// Whether predictions are further apart than the samples, and so are drawn as dots.
    pub sparse: bool,
    /// Name of each model and what it predicts, a panel each.
    pub models: Vec<(String, Vec<Vec<f64>>)>,
    /// Measured − predicted of each model at the times of the predictions, a panel each; of as many models as are to be seen.
    pub residuals: Vec<Vec<Vec<f64>>>,
    /// Name and course of each stick at the times of the measurements; none where none was recorded.
    pub sticks: Vec<(String, Vec<f64>)>,
}

/// Measured against predicted in panels of channels; under each what is left, and the sticks, which are the same in all. The first model is in
/// focus. `panels` are (title, unit).
pub fn traces(title: &str, caption: &str, panels: &[(String, String)], trace: &Trace) -> Figure {
    let (low, high) = ends(trace.time_s.iter().copied());
    let x = Scale::linear(low, high);
    let draw = |(number, (title, unit)): (usize, &(String, String))| trace_panel(number, title, unit, trace, x);
    let mut names = vec!["measured"];
    names.extend(trace.models.iter().map(|(name, _)| name.as_str()));
    Figure {
        title: title.to_owned(),
        caption: caption.to_owned(),
        panels: panels.iter().enumerate().map(draw).collect(),
        keys: keys(names.into_iter()),
        linked: true,
    }
}

fn trace_panel(number: usize, title: &str, unit: &str, trace: &Trace, x: Scale) -> Panel {
    let empty = Vec::new();
    let measured = trace.measured.get(number).unwrap_or(&empty);
    let models: Vec<(&String, &Vec<f64>)> = trace.models.iter().filter_map(|(name, y)| Some((name, y.get(number)?))).collect();
    let predicted = models.iter().flat_map(|(_, y)| y.iter().copied());
    let area = |top: f64, height: f64, y: Scale| Area { left: LEFT, top, width: WIDTH - LEFT - RIGHT, height, x, y };
    let above = area(24.0, 130.0, Scale::around(measured.iter().copied().chain(predicted)));
    let points = |y: &[f64]| trace.predicted_s.iter().copied().zip(y.iter().copied()).collect::<Vec<_>>();
    let mut data = Vec::new();
    let mut draw = |area: &Area, class: &str, name: &str, series: &str, points: Vec<(f64, f64)>, dots: bool| {
        let finite = points.iter().filter(|(_, y)| y.is_finite());
        data.extend(finite.map(|(x, y)| Datum { series: series.into(), x: x.to_string(), y: *y, interval: None }));
        if dots { area.dots(class, name, points.into_iter()) } else { area.path(class, name, points.into_iter()) }
    };
    let mut content = Vec::new();
    content.push(draw(&above, "s0 fine", "measured", "measured", thin(&trace.time_s, measured), false));
    for (place, (name, y)) in models.iter().enumerate() {
        content.push(draw(&above, &class(place + 1), name, name, points(y), trace.sparse));
    }
    let content: String = content.into_iter().rev().collect();
    let mut body = heading(title, unit) + &above.axes(Ticks { x: 0, y: 5, x_title: "" }) + &above.data(&content);
    let residuals: Vec<&Vec<f64>> = trace.residuals.iter().filter_map(|of| of.get(number)).collect();
    let largest = ends(residuals.iter().flat_map(|of| of.iter().map(|value| value.abs()))).1.max(f64::MIN_POSITIVE);
    let below = area(172.0, 44.0, Scale::linear(-1.05 * largest, 1.05 * largest));
    let mut rest = String::new();
    for (place, y) in residuals.iter().enumerate().rev() {
        let name = models.get(place).map_or("", |(name, _)| name.as_str());
        rest +=
            &draw(&below, &class(place + 1), &format!("left of {name}"), &format!("measured − {name}"), points(y), trace.sparse);
    }
    body += &words("tk", "start", LEFT + 3.0, 169.0, "measured − predicted");
    body += &(below.axes(Ticks { x: 0, y: 3, x_title: "" }) + &below.data(&rest));
    let sticks = area(234.0, 34.0, Scale::around(trace.sticks.iter().flat_map(|(_, y)| y.iter().copied()).chain([0.0])));
    let mut moved = String::new();
    for (place, (name, y)) in trace.sticks.iter().enumerate() {
        moved += &draw(&sticks, &format!("s{} fine", 3 + place), name, name, thin(&trace.time_s, y), false);
    }
    if !moved.is_empty() {
        let mut at = LEFT + 3.0;
        body += &words("tk", "start", at, 231.0, "sticks");
        at += 38.0;
        for (place, (name, _)) in trace.sticks.iter().enumerate() {
            body += &line(&format!("l s{}", 3 + place), [at, 227.0], [at + 12.0, 227.0]);
            body += &words("tk", "start", at + 15.0, 231.0, name);
            at += 22.0 + 7.0 * name.chars().count() as f64;
        }
    }
    let last = if moved.is_empty() { below } else { sticks };
    if !moved.is_empty() {
        body += &sticks.data(&moved);
    }
    body += &last.axes(Ticks { x: 6, y: 2, x_title: "time, s" });
    body += &cross(above.top, last.bottom());
    let left: Vec<String> = residuals
        .iter()
        .zip(&models)
        .map(|(of, (name, _))| {
            let (low, high) = ends(of.iter().copied());
            format!("{name} is off by {} to {} {unit}", significant(low, 2), significant(high, 2))
        })
        .collect();
    let says =
        format!("Measured acceleration over time with the predictions, what is left below, and the sticks. {}.", left.join("; "));
    Panel { title: title.to_owned(), says, height: last.bottom() + 36.0, body, data }
}

#[cfg(test)]
mod tests {
    use super::super::tests::panels;
    use super::*;

    /// Points of a path: numbers are parted by blanks, signs and commands; two make a point.
    fn points_of(path: &str) -> usize {
        let d = path.split(" d=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap_or_default();
        let (mut count, mut inside) = (0, false);
        for digit in d.chars().map(|character| character.is_ascii_digit()) {
            count += usize::from(digit && !inside);
            inside = digit;
        }
        count / 2
    }

    #[test]
    fn every_sample_is_drawn_and_said_in_the_numbers() {
        let time: Vec<f64> = (0..1000).map(|sample| 0.01 * f64::from(sample)).collect();
        let wave: Vec<f64> = time.iter().map(|t| (3.0 * t).sin()).collect();
        let model = ("model".to_owned(), vec![wave.iter().map(|y| 0.9 * y).collect::<Vec<_>>()]);
        let trace = Trace {
            time_s: time.clone(),
            measured: vec![wave.clone()],
            predicted_s: time.clone(),
            sparse: false,
            models: vec![model],
            residuals: vec![vec![wave.iter().map(|y| 0.1 * y).collect()]],
            sticks: vec![("u1".into(), wave.clone())],
        };
        let figure = traces("t", "c", &panels(1), &trace);
        let panel = &figure.panels[0];
        let paths: Vec<&str> = panel.body.split("<path class=\"l ").filter(|part| part.contains("data-name")).collect();
        assert_eq!(paths.len(), 4, "measured, model, what is left, one stick");
        assert!(
            paths.iter().all(|path| points_of(path) == 1000),
            "{:?}",
            paths.iter().map(|path| points_of(path)).collect::<Vec<_>>()
        );
        assert_eq!(panel.data.len(), 4000);
        assert!(panel.data.iter().any(|datum| datum.series == "measured − model" && (datum.y - 0.1 * wave[500]).abs() < 1e-12));
        let dots = traces("t", "c", &panels(1), &Trace { sparse: true, ..trace });
        assert!(dots.panels[0].body.contains("class=\"l dot s1 wide\""), "predictions far apart are no line");
    }

    #[test]
    fn a_logarithmic_figure_says_so_and_zero_lies_at_its_end() {
        let line = |name: &str, y: Vec<f64>| LineData { name: name.into(), x: vec![1.0, 2.0, 3.0], y: vec![y] };
        let figure = log_lines("t", "c", "f", &panels(1), &[line("a", vec![1.0, 0.1, 0.01]), line("b", vec![1.0, 0.0, 10.0])]);
        assert!(figure.panels[0].body.contains("data-log=\"1\""));
        assert_eq!(figure.panels[0].data.len(), 6);
    }
}
