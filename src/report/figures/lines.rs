//! Lines: measured against predicted over time in panels, and training curves.

use super::grid::{Grid, axis_name, set_x, set_y};
use super::{Figure, figure, rounded, thin};
use crate::report::colour;
use crate::report::page::escape;
use plotly::common::{DashType, Line, Marker, MarkerSymbol, Mode, Visible};
use plotly::layout::{AxisType, HoverMode, SpikeMode, SpikeSnap, TraceOrder};
use plotly::{Scatter, Traces};

/// One line of a [`lines`] figure.
#[derive(Clone, Debug)]
pub struct LineData {
    /// Name in the legend.
    pub name: String,
    /// Horizontal values.
    pub x: Vec<f64>,
    /// Vertical values of each panel, each as long as `x`.
    pub y: Vec<Vec<f64>>,
    /// Whether the line is drawn only once its name in the legend is clicked.
    pub hidden: bool,
    /// Whether points are drawn without lines between them: samples that are further apart than a line would make them look.
    pub markers: bool,
}

/// Lines in panels with linked horizontal axes and one legend: measured against predicted. The first line is what was measured,
/// thin and black on top of all; the second, wide, the model in focus. `panels` are (title, unit of the vertical axis).
pub fn lines(title: &str, caption: &str, x_title: &str, panels: &[(String, String)], data: &[LineData]) -> Figure {
    lines_on(AxisType::Linear, title, caption, x_title, panels, data)
}

/// Marker of the n-th line: shapes differ, not colours alone.
fn symbol(number: usize) -> MarkerSymbol {
    match number % 4 {
        1 => MarkerSymbol::Circle,
        2 => MarkerSymbol::Cross,
        3 => MarkerSymbol::DiamondOpen,
        _ => MarkerSymbol::SquareOpen,
    }
}

fn colour_of(number: usize) -> &'static str {
    if number == 0 { colour::MEASURED } else { colour::line(number - 1) }
}

/// As [`lines`], on logarithmic vertical axes.
pub fn log_lines(title: &str, caption: &str, x_title: &str, panels: &[(String, String)], data: &[LineData]) -> Figure {
    lines_on(AxisType::Log, title, caption, x_title, panels, data)
}

fn lines_on(
    vertical: AxisType,
    title: &str,
    caption: &str,
    x_title: &str,
    panels: &[(String, String)],
    data: &[LineData],
) -> Figure {
    let grid = Grid::new(panels.len(), 2, 150, 34).by_column();
    let mut traces = Traces::new();
    // Drawn in this order: other models, the first model, and on top what was measured.
    for (number, line) in data.iter().enumerate().rev() {
        for (panel, y) in line.y.iter().enumerate().take(grid.panels) {
            let (x, y) = thin(&line.x, y);
            let style = match number {
                0 => Line::new().color(colour::MEASURED).width(1.2),
                1 => Line::new().color(colour::line(0)).width(3.0),
                n => Line::new().color(colour::line(n - 1)).dash(colour::dash(n - 1)).width(1.6),
            };
            let shown = if line.hidden { Visible::LegendOnly } else { Visible::True };
            let trace = Scatter::new(rounded(&x), rounded(&y))
                .mode(if line.markers { Mode::Markers } else { Mode::Lines })
                .marker(Marker::new().size(if number == 1 { 6 } else { 4 }).symbol(symbol(number)).color(colour_of(number)))
                .name(escape(&line.name))
                .legend_group(number.to_string())
                .show_legend(panel == 0)
                .visible(shown)
                .line(style);
            traces.push(trace.x_axis(axis_name('x', grid.column(panel))).y_axis(axis_name('y', panel)));
        }
    }
    let layout = grid.layout().legend(grid.legend().trace_order(TraceOrder::Reversed));
    let mut layout = layout.hover_mode(HoverMode::XUnified).annotations(grid.titles(panels.iter().map(|(title, _)| title)));
    for (panel, (_, unit)) in panels.iter().enumerate().take(grid.panels) {
        let y = grid.y(panel).title(escape(unit)).anchor(axis_name('x', grid.column(panel)));
        layout = set_y(layout, panel, if matches!(vertical, AxisType::Log) { y.type_(AxisType::Log).n_ticks(5) } else { y });
    }
    for panel in (0..grid.panels).filter(|panel| grid.is_lowest(*panel)) {
        let column = grid.column(panel);
        let x = grid.x(column).anchor(axis_name('y', panel)).title(escape(x_title)).show_spikes(true).spike_mode(SpikeMode::Across);
        let x = x.spike_snap(SpikeSnap::Cursor).spike_thickness(1).spike_color("#595959").spike_dash(DashType::Dot);
        layout = set_x(layout, column, if column > 0 { x.matches("x") } else { x });
    }
    figure(title, caption, traces, layout, grid.height_px())
}

/// Loss against epoch on a logarithmic axis. `curves` are (name, one value an epoch, counted from 1).
pub fn training(title: &str, caption: &str, curves: &[(String, Vec<f64>)]) -> Figure {
    let mut traces = Traces::new();
    for (number, (name, loss)) in curves.iter().enumerate() {
        let epoch: Vec<f64> = (1..=loss.len()).map(|epoch| epoch as f64).collect();
        let (x, y) = thin(&epoch, loss);
        let style = Line::new().color(colour::line(number)).dash(colour::dash(number)).width(2.0);
        traces.push(Scatter::new(rounded(&x), rounded(&y)).mode(Mode::Lines).name(escape(name)).line(style));
    }
    let grid = Grid::new(1, 1, 220, 0);
    let layout = grid.layout().hover_mode(HoverMode::XUnified);
    let layout = set_x(layout, 0, grid.x(0).title("epoch"));
    // Labels at whole decades once there are some: those between would stand on top of each other.
    let loss = curves.iter().flat_map(|(_, loss)| loss).filter(|loss| **loss > 0.0);
    let (low, high) = loss.fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(*value), high.max(*value)));
    let y = grid.y(0).type_(AxisType::Log).title("loss");
    let layout = set_y(layout, 0, if high > 10.0 * low { y.dtick(1.0) } else { y.n_ticks(6) });
    figure(title, caption, traces, layout, grid.height_px())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{json, panels};
    use super::*;

    #[test]
    fn lines_share_their_horizontal_axes() {
        let x: Vec<f64> = (0..50).map(f64::from).collect();
        let data = ["measured", "<model>"].map(|name| LineData {
            name: name.into(),
            x: x.clone(),
            y: vec![x.clone(); 6],
            hidden: name != "measured",
            markers: name != "measured",
        });
        let found = json(&lines("t", "c", "time, s", &panels(6), &data));
        assert_eq!(found["data"].as_array().map(Vec::len), Some(12));
        assert_eq!((&found["data"][6]["line"]["color"], &found["data"][0]["name"]), (&"#000000".into(), &"&lt;model&gt;".into()));
        assert_eq!(found["layout"]["xaxis2"]["matches"], "x");
        assert_eq!((&found["data"][5]["xaxis"], &found["data"][5]["yaxis"]), (&"x2".into(), &"y6".into()));
        assert!(found["layout"]["yaxis6"]["title"]["text"] == "m/s²" && found["layout"]["xaxis"]["title"]["text"] == "time, s");
        assert_eq!((&found["data"][0]["visible"], &found["data"][6]["visible"]), (&"legendonly".into(), &true.into()));
        assert_eq!((&found["data"][0]["mode"], &found["data"][6]["mode"]), (&"markers".into(), &"lines".into()));
        assert_ne!(found["data"][0]["line"]["width"], found["data"][6]["line"]["width"], "lines differ by more than colour");
    }

    #[test]
    fn training_curves_are_logarithmic() {
        let found = json(&training("t", "c", &[("training".into(), vec![1.0, 0.5]), ("validation".into(), vec![1.5, 0.7])]));
        assert_eq!((&found["layout"]["yaxis"]["type"], &found["data"][1]["y"][1]), (&"log".into(), &0.7.into()));
    }
}
