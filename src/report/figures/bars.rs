//! Bars: an error from step to step, and shares of a whole.

use super::grid::{Grid, axis_name, set_x, set_y};
use super::{Figure, figure, round};
use crate::critique::digits::significant;
use crate::report::colour;
use crate::report::page::escape;
use plotly::common::{DashType, Line, Marker, Mode, Orientation, TextAnchor};
use plotly::layout::{BarMode, TraceOrder};
use plotly::{Bar, Scatter, Traces};

/// Bars of each step in panels of channels: how an error falls from step to step (a waterfall). `values[step][panel]`; a step
/// without a value has no bar. With a `floor`, one value a panel, the last bar is that, in another colour, and a dashed line at its height
/// runs below the others.
pub fn steps(
    title: &str,
    caption: &str,
    panels: &[(String, String)],
    names: &[String],
    values: &[Vec<Option<f64>>],
    floor: Option<&[Option<f64>]>,
) -> Figure {
    let grid = Grid::new(panels.len(), 3, 190, 40);
    let mut traces = Traces::new();
    let labels: Vec<String> = names.iter().map(|name| escape(name)).collect();
    let text = |heights: &[Option<f64>]| -> Vec<String> {
        heights.iter().map(|height| height.map_or_else(String::new, |height| significant(height, 3))).collect()
    };
    for panel in 0..grid.panels {
        let of = |step: &[Option<f64>]| step.get(panel).copied().flatten().map(round);
        let [x, y] = ['x', 'y'].map(|axis| axis_name(axis, panel));
        let bar = |labels: Vec<String>, heights: Vec<Option<f64>>, colour: &'static str| {
            let bar = Bar::new(labels, heights.clone()).show_legend(false).marker(Marker::new().color(colour));
            bar.text_array(text(&heights)).x_axis(x.clone()).y_axis(y.clone())
        };
        traces.push(bar(labels.clone(), values.iter().map(|step| of(step)).collect(), colour::line(0)));
        if let Some(height) = floor.and_then(of) {
            let all: Vec<String> = labels.iter().cloned().chain([FLOOR.to_owned()]).collect();
            let line = Scatter::new(all.clone(), vec![height; all.len()]).mode(Mode::Lines).name(FLOOR).show_legend(false);
            let line = line.line(Line::new().color(colour::MEASURED).dash(DashType::Dash).width(1.2));
            traces.push(bar(vec![FLOOR.to_owned()], vec![Some(height)], colour::line(1)));
            traces.push(line.x_axis(x.clone()).y_axis(y.clone()));
        }
    }
    let mut layout = grid.layout().annotations(grid.titles(panels.iter().map(|(title, _)| title)));
    for (panel, (_, unit)) in panels.iter().enumerate().take(grid.panels) {
        let x = grid.x(grid.column(panel)).anchor(axis_name('y', panel)).auto_margin(true);
        let x = x.show_tick_labels(grid.is_lowest(panel));
        let y = grid.y(panel).anchor(axis_name('x', panel)).title(escape(unit));
        layout = set_y(set_x(layout, panel, x), panel, y);
    }
    // Bars that stand at different places of one axis, not beside each other.
    let layout = if floor.is_some() { layout.bar_mode(BarMode::Overlay) } else { layout };
    figure(title, caption, traces, layout, grid.height_px() + 60)
}

/// Label of the bar that no model can go below.
const FLOOR: &str = "floor";

/// Shares that add up to a whole, one horizontal bar a row: what physics explains, what only the network explains, what is noise.
/// `parts` are (name, share of each row, 1 being the whole). A negative share stands to the left of zero; the others then reach
/// as far beyond the whole.
pub fn shares(title: &str, caption: &str, rows: &[String], parts: &[(String, Vec<f64>)]) -> Figure {
    let mut traces = Traces::new();
    let labels: Vec<String> = rows.iter().rev().map(|row| escape(row)).collect();
    for (number, (name, values)) in parts.iter().enumerate() {
        let percent: Vec<f64> = values.iter().rev().map(|value| round(100.0 * value)).collect();
        let text = percent.iter().map(|value| if value.abs() >= 3.0 { format!("{value:.0} %") } else { String::new() }).collect();
        let bar = Bar::new(percent, labels.clone()).orientation(Orientation::Horizontal).name(escape(name)).text_array(text);
        traces.push(bar.marker(Marker::new().color(colour::line(number))).inside_text_anchor(TextAnchor::Middle));
    }
    let grid = Grid::new(1, 1, 34 * rows.len().max(1), 0);
    // One end of each bar: the sum of its shares of one sign.
    let end = |sign: f64| {
        let sum = |row: usize| parts.iter().filter_map(|part| part.1.get(row)).map(|value| (sign * value).max(0.0)).sum::<f64>();
        round(100.0 * (0..rows.len()).map(sum).filter(|sum| sum.is_finite()).fold(0.0, f64::max))
    };
    let (left, right) = (end(-1.0), end(1.0));
    let mode = if left > 0.0 { BarMode::Relative } else { BarMode::Stack };
    let layout = grid.layout().legend(grid.legend().trace_order(TraceOrder::Normal)).bar_mode(mode);
    let layout = set_x(layout, 0, grid.x(0).title("share, %").range(vec![-left, right.max(100.0)]));
    let layout = set_y(layout, 0, grid.y(0).auto_margin(true));
    figure(title, caption, traces, layout, grid.height_px())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{json, panels};
    use super::*;

    #[test]
    fn bars_hold_their_data_and_negative_shares_stand_left_of_zero() {
        let names = ["paper".to_owned(), "paper + ground effect".to_owned()];
        let found = json(&steps("t", "c", &panels(6), &names, &[vec![Some(2.0); 6], vec![Some(1.0), None]], None));
        assert_eq!(found["data"][0]["y"], serde_json::json!([2.0, 1.0]));
        assert_eq!(found["data"][1]["y"], serde_json::json!([2.0, null]));
        assert!(found["layout"].get("barmode").is_none() && !found.to_string().contains("floor"));
        let floor = [Some(0.3126), None];
        let found = json(&steps("t", "c", &panels(2), &names, &[vec![Some(2.0); 2], vec![Some(1.0); 2]], Some(&floor)));
        let [bar, line] = [1, 2].map(|trace| &found["data"][trace]);
        assert_eq!((&bar["x"], &bar["y"], &bar["text"]), (&["floor"].into(), &[0.3126].into(), &["0.313"].into()), "{bar}");
        assert_eq!(line["y"], serde_json::json!([0.3126, 0.3126, 0.3126]), "a line below all bars: {line}");
        assert_eq!(line["line"]["dash"], "dash");
        assert_eq!(found["data"].as_array().map(Vec::len), Some(4), "the second panel has no floor");
        let found = json(&shares("t", "c", &names, &[("physics".into(), vec![0.6, 0.7]), ("noise".into(), vec![0.4, 0.3])]));
        assert_eq!((&found["layout"]["barmode"], &found["data"][0]["x"]), (&"stack".into(), &serde_json::json!([70.0, 60.0])));
        assert_eq!(found["layout"]["xaxis"]["range"], serde_json::json!([0.0, 100.0]));
        let found = json(&shares("t", "c", &names, &[("network".into(), vec![-0.2, 0.1]), ("rest".into(), vec![1.2, 0.9])]));
        assert_eq!(found["layout"]["barmode"], "relative", "a negative share stands left of zero");
        assert_eq!(found["layout"]["xaxis"]["range"], serde_json::json!([-20.0, 120.0]));
    }
}
