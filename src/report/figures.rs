//! The figures: lines over time, binned residuals, bars by channel, training curves. Each is data in, [`Figure`] out.
//!
//! All figures are small panels under one legend, at most six, so that channels stand side by side at one scale of time. Text
//! is plain text. How a figure gets into a page is `page.rs`.

use super::colour;
use super::page::escape;
use crate::critique::locate::{Bin, Dependence};
use crate::critique::residual_views::Surface;
use plotly::common::{
    Anchor, ColorBar, ColorScale, ColorScaleElement, DashType, ErrorData, ErrorType, Font, HoverInfo, Line, Marker, MarkerSymbol,
    Mode, Orientation, TextAnchor, Visible,
};
use plotly::layout::{
    Annotation, Axis, AxisType, BarMode, HoverMode, Legend, Margin, SpikeMode, SpikeSnap, TicksDirection, TraceOrder,
};
use plotly::{Bar, HeatMap, Layout, Scatter, Traces};

/// Points of one line that a figure draws at most; more are thinned with [`thin`].
pub const POINTS: usize = 1000;

/// Panels of one figure at most.
pub const PANELS: usize = 6;

/// Intervals of bins that rest on few blocks.
const FAINT: &str = "#b5cfe0";

/// An interactive figure, ready for a page.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Title.
    pub title: String,
    /// What to see in it, in a sentence.
    pub caption: String,
    /// Height on the page, pixels.
    pub height_px: usize,
    json: String,
}

impl Figure {
    /// `{"data": …, "layout": …}` as the figure library takes it.
    pub fn json(&self) -> &str {
        &self.json
    }
}

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
}

/// Lines in panels with linked horizontal axes and one legend: measured against predicted. The first line is what was measured,
/// thin and black on top of all; the second, wide, the model in focus. `panels` are (title, unit of the vertical axis).
pub fn lines(title: &str, caption: &str, x_title: &str, panels: &[(String, String)], data: &[LineData]) -> Figure {
    lines_on(AxisType::Linear, title, caption, x_title, panels, data)
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
                .mode(Mode::Lines)
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

/// One panel of a [`binned`] figure.
#[derive(Clone, Debug)]
pub struct BinnedPanel<'a> {
    /// Name of the variable.
    pub variable: &'a str,
    /// Unit of the variable.
    pub unit: &'a str,
    /// The residual against it.
    pub dependence: &'a Dependence,
    /// A curve through the bins, such as an effect that would explain them: its name, the variable, the residual.
    pub curve: Option<(String, Vec<f64>, Vec<f64>)>,
    /// The residual of an amended model in the same bins.
    pub after: Option<&'a Dependence>,
}

/// Mean residual of one channel in bins of several variables, one panel each, with 95 % intervals. Bins on few blocks are hollow.
/// `unit` is that of the residual.
pub fn binned(title: &str, caption: &str, unit: &str, panels: &[BinnedPanel<'_>]) -> Figure {
    let grid = Grid::new(panels.len(), 3, 190, 92);
    let mut traces = Traces::new();
    let first = |thin: bool| panels.iter().position(|panel| panel.dependence.bins.iter().any(|bin| bin.is_thin() == thin));
    let amended = panels.iter().any(|panel| panel.after.is_some());
    let mut curves: Vec<&str> = Vec::new();
    for (number, panel) in panels.iter().enumerate().take(grid.panels) {
        for thin in [false, true] {
            let bins: Vec<&Bin> = panel.dependence.bins.iter().filter(|bin| bin.is_thin() == thin).collect();
            let half = |side: usize, sign: f64| {
                let of = |bin: &&Bin| bin.ci95.map_or(0.0, |ci95| sign * (ci95[side] - bin.mean));
                rounded(&bins.iter().map(of).collect::<Vec<_>>())
            };
            let error = ErrorData::new(ErrorType::Data).symmetric(false).array(half(1, 1.0)).array_minus(half(0, -1.0));
            let symbol = if thin { MarkerSymbol::CircleOpen } else { MarkerSymbol::Circle };
            let hover = bins.iter().map(|bin| format!("{} windows in {} blocks", bin.n, bin.blocks)).collect();
            let at: Vec<f64> = bins.iter().map(|bin| bin.at).collect();
            let mean: Vec<f64> = bins.iter().map(|bin| bin.mean).collect();
            let trace = Scatter::new(rounded(&at), rounded(&mean))
                .mode(Mode::Markers)
                .name(match (thin, amended) {
                    (true, _) => "on fewer than 5 blocks",
                    (false, false) => "mean residual, 95 % interval",
                    (false, true) => "before, mean residual with 95 % interval",
                })
                .legend_group(thin.to_string())
                .show_legend(first(thin) == Some(number))
                .text_array(hover)
                .marker(Marker::new().color(colour::line(0)).size(7).symbol(symbol))
                .error_y(error.color(if thin { FAINT } else { colour::line(0) }).thickness(1.4).width(3));
            traces.push(trace.x_axis(axis_name('x', number)).y_axis(axis_name('y', number)));
        }
        if let Some(after) = panel.after {
            let (at, mean): (Vec<f64>, Vec<f64>) = after.bins.iter().map(|bin| (bin.at, bin.mean)).unzip();
            let trace = Scatter::new(rounded(&at), rounded(&mean)).mode(Mode::Markers).name("after");
            let marker = Marker::new().color(colour::line(2)).size(6).symbol(MarkerSymbol::SquareOpen);
            let first = panels.iter().position(|panel| panel.after.is_some()) == Some(number);
            let trace = trace.marker(marker).legend_group("after").show_legend(first);
            traces.push(trace.x_axis(axis_name('x', number)).y_axis(axis_name('y', number)));
        }
        if let Some((name, x, y)) = &panel.curve {
            let (x, y) = thin(x, y);
            let curve = Scatter::new(rounded(&x), rounded(&y)).mode(Mode::Lines).name(escape(name));
            let known = curves.contains(&name.as_str());
            curves.push(name);
            let curve = curve.line(Line::new().color(colour::line(1)).dash(DashType::Dash).width(2.0));
            let curve = curve.legend_group(escape(name)).show_legend(!known);
            traces.push(curve.x_axis(axis_name('x', number)).y_axis(axis_name('y', number)));
        }
    }
    let titles: Vec<String> =
        panels.iter().map(|panel| format!("{} ({:.0} %)", panel.variable, 100.0 * panel.dependence.share)).collect();
    let mut layout = grid.layout().annotations(grid.titles(titles.iter()));
    let range = bin_range(panels.iter().map(|panel| panel.dependence));
    for (number, panel) in panels.iter().enumerate().take(grid.panels) {
        let x = grid.x(grid.column(number)).anchor(axis_name('y', number)).title(escape(&with_unit(panel.variable, panel.unit)));
        let mut y = grid.y(number).anchor(axis_name('x', number)).title(escape(unit)).zero_line(true).zero_line_color("#595959");
        if let Some(range) = range {
            y = y.range(range.to_vec());
        }
        layout = set_y(set_x(layout, number, x), number, y);
    }
    figure(title, caption, traces, layout, grid.height_px())
}

/// A common vertical range that holds every mean and the intervals of the bins that are not thin.
fn bin_range<'a>(found: impl Iterator<Item = &'a Dependence>) -> Option<[f64; 2]> {
    let bins = found.flat_map(|dependence| &dependence.bins);
    let ends = bins.flat_map(|bin| {
        let [low, high] = bin.ci95.filter(|_| !bin.is_thin()).unwrap_or([bin.mean; 2]);
        [low, high]
    });
    let (low, high) =
        ends.chain([0.0]).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    let margin = 0.06 * (high - low);
    (margin > 0.0).then_some([low - margin, high + margin])
}

/// The residual over two variables, one panel a model, on one colour scale: blue below zero, white at zero, orange above. Cells on
/// fewer than 5 blocks are crossed. `panels` are (title, surface); `axes` the titles of the axes; `unit` that of the residual.
pub fn surfaces(title: &str, caption: &str, unit: &str, axes: [&str; 2], panels: &[(String, &Surface)]) -> Figure {
    let grid = Grid::new(panels.len(), 2, 320, 60);
    let mut traces = Traces::new();
    // Thin cells do not set the scale.
    let cells = || panels.iter().flat_map(|(_, surface)| &surface.cells);
    let sound = cells().filter(|cell| !cell.thin).map(|cell| cell.mean.abs()).fold(0.0, f64::max);
    let largest = if sound > 0.0 { sound } else { cells().map(|cell| cell.mean.abs()).fold(f64::MIN_POSITIVE, f64::max) };
    let scale = [(0.0, colour::line(0)), (0.5, "#ffffff"), (1.0, colour::line(1))];
    let scale: Vec<ColorScaleElement> = scale.map(|(at, colour)| ColorScaleElement(at, colour.into())).into();
    for (number, (_, surface)) in panels.iter().enumerate().take(grid.panels) {
        let middle = |edges: &[f64]| rounded(&edges.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect::<Vec<_>>());
        let [x, y] = [middle(&surface.edges[0]), middle(&surface.edges[1])];
        let mut z: Vec<Vec<Option<f64>>> = vec![vec![None; x.len()]; y.len()];
        let mut words = vec![vec![String::new(); x.len()]; y.len()];
        let (mut thin_x, mut thin_y) = (Vec::new(), Vec::new());
        for cell in &surface.cells {
            let Some(place) = z.get_mut(cell.row).and_then(|row| row.get_mut(cell.column)) else { continue };
            *place = Some(round(cell.mean));
            if let Some(word) = words.get_mut(cell.row).and_then(|row| row.get_mut(cell.column)) {
                let interval = cell.ci95.map(|[low, high]| format!(" [{low:.3}, {high:.3}]")).unwrap_or_default();
                *word = format!("{:.3}{interval}, {} rows in {} blocks", cell.mean, cell.n, cell.blocks);
            }
            if let (true, Some(x), Some(y)) = (cell.thin, x.get(cell.column), y.get(cell.row)) {
                thin_x.push(*x);
                thin_y.push(*y);
            }
        }
        let bar = ColorBar::new().title(escape(unit)).thickness(14);
        let map = HeatMap::new(x, y, z)
            .zmin(-largest)
            .zmax(largest)
            .zmid(0.0)
            .auto_color_scale(false)
            .color_scale(ColorScale::Vector(scale.clone()))
            .color_bar(bar)
            .show_scale(number == 0)
            .hover_on_gaps(false)
            .hover_text_matrix(words);
        traces.push(map.x_axis(axis_name('x', number)).y_axis(axis_name('y', number)));
        let thin = Scatter::new(thin_x, thin_y).mode(Mode::Markers).name("on fewer than 5 blocks").legend_group("thin");
        let marker = Marker::new().symbol(MarkerSymbol::XThinOpen).size(7).color("#7a7a7a");
        let thin = thin.marker(marker).show_legend(number == 0).hover_info(HoverInfo::Skip);
        traces.push(thin.x_axis(axis_name('x', number)).y_axis(axis_name('y', number)));
    }
    let mut layout = grid.layout().annotations(grid.titles(panels.iter().map(|(title, _)| title)));
    for number in 0..grid.panels {
        let x = grid.x(grid.column(number)).anchor(axis_name('y', number)).title(escape(axes[0])).show_grid(false);
        let y = grid.y(number).anchor(axis_name('x', number)).title(escape(axes[1])).show_grid(false);
        layout = set_y(set_x(layout, number, x), number, y);
    }
    figure(title, caption, traces, layout, grid.height_px())
}

/// Bars of each step in panels of channels: how an error falls from step to step (a waterfall). `values[step][panel]`; a step
/// without a value has no bar.
pub fn steps(title: &str, caption: &str, panels: &[(String, String)], names: &[String], values: &[Vec<Option<f64>>]) -> Figure {
    let grid = Grid::new(panels.len(), 3, 190, 40);
    let mut traces = Traces::new();
    let labels: Vec<String> = names.iter().map(|name| escape(name)).collect();
    for panel in 0..grid.panels {
        let heights: Vec<Option<f64>> = values.iter().map(|step| step.get(panel).copied().flatten().map(round)).collect();
        let text =
            heights.iter().map(|height| height.map_or_else(String::new, |height| crate::critique::table::significant(height, 3)));
        let bar = Bar::new(labels.clone(), heights.clone()).show_legend(false).marker(Marker::new().color(colour::line(0)));
        traces.push(bar.text_array(text.collect()).x_axis(axis_name('x', panel)).y_axis(axis_name('y', panel)));
    }
    let mut layout = grid.layout().annotations(grid.titles(panels.iter().map(|(title, _)| title)));
    for (panel, (_, unit)) in panels.iter().enumerate().take(grid.panels) {
        let x = grid.x(grid.column(panel)).anchor(axis_name('y', panel)).auto_margin(true);
        let x = x.show_tick_labels(grid.is_lowest(panel));
        let y = grid.y(panel).anchor(axis_name('x', panel)).title(escape(unit));
        layout = set_y(set_x(layout, panel, x), panel, y);
    }
    figure(title, caption, traces, layout, grid.height_px() + 60)
}

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

/// Thins a line to about [`POINTS`] points: of each of equal stretches the lowest and the highest value stay, so that peaks do.
pub fn thin(x: &[f64], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let pairs: Vec<(f64, f64)> = x.iter().copied().zip(y.iter().copied()).collect();
    if pairs.len() <= POINTS {
        return pairs.into_iter().unzip();
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
    pairs.chunks(stretch).flat_map(ends).unzip()
}

/// `vx, m/s`; the name alone for a quantity without a unit.
pub(super) fn with_unit(name: &str, unit: &str) -> String {
    if unit == "1" { name.to_owned() } else { format!("{name}, {unit}") }
}

/// Five significant digits: more than a screen shows, and half the size of the page.
fn round(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = 10.0_f64.powi(4 - value.abs().log10().floor() as i32);
    let rounded = (value * scale).round() / scale;
    if rounded.is_finite() { rounded } else { value }
}

fn rounded(values: &[f64]) -> Vec<f64> {
    values.iter().map(|value| round(*value)).collect()
}

fn figure(title: &str, caption: &str, traces: Traces, layout: Layout, height_px: usize) -> Figure {
    let json = format!("{{\"data\":{},\"layout\":{}}}", traces.to_json(), layout.height(height_px).to_json());
    Figure { title: title.to_owned(), caption: caption.to_owned(), height_px, json }
}

/// Where the panels of a figure stand, in pixels and as shares of the plotting area.
struct Grid {
    panels: usize,
    columns: usize,
    rows: usize,
    /// Fill column by column (channels of v on the left, of w on the right) instead of row by row.
    by_column: bool,
    row_px: usize,
    gap_px: usize,
}

impl Grid {
    /// Above the panels: legend and title of the panel. Below: horizontal axis. Pixels.
    const TOP_PX: usize = 80;
    const BOTTOM_PX: usize = 60;
    /// Between columns, as a share of the width: tick labels and title of the vertical axis.
    const GAP: f64 = 0.085;

    fn new(panels: usize, columns: usize, row_px: usize, gap_px: usize) -> Self {
        let panels = panels.clamp(1, PANELS);
        let columns = columns.clamp(1, panels);
        Self { panels, columns, rows: panels.div_ceil(columns), by_column: false, row_px, gap_px }
    }

    const fn by_column(self) -> Self {
        Self { by_column: true, ..self }
    }

    const fn plot_px(&self) -> usize {
        self.rows * self.row_px + (self.rows - 1) * self.gap_px
    }

    const fn height_px(&self) -> usize {
        Self::TOP_PX + self.plot_px() + Self::BOTTOM_PX
    }

    const fn column(&self, panel: usize) -> usize {
        if self.by_column { panel / self.rows } else { panel % self.columns }
    }

    const fn row(&self, panel: usize) -> usize {
        if self.by_column { panel % self.rows } else { panel / self.columns }
    }

    /// Whether no panel stands below this one.
    fn is_lowest(&self, panel: usize) -> bool {
        (0..self.panels).all(|other| self.column(other) != self.column(panel) || self.row(other) <= self.row(panel))
    }

    /// Left and right end of a column.
    fn x_domain(&self, column: usize) -> [f64; 2] {
        let width = (1.0 - Self::GAP * (self.columns - 1) as f64) / self.columns as f64;
        let left = column as f64 * (width + Self::GAP);
        [left, (left + width).min(1.0)]
    }

    /// Lower and upper end of a row, the first row on top.
    fn y_domain(&self, row: usize) -> [f64; 2] {
        let plot = self.plot_px() as f64;
        let top = 1.0 - (row * (self.row_px + self.gap_px)) as f64 / plot;
        [(top - self.row_px as f64 / plot).max(0.0), top]
    }

    fn x(&self, column: usize) -> Axis {
        axis().domain(&self.x_domain(column))
    }

    fn y(&self, panel: usize) -> Axis {
        axis().domain(&self.y_domain(self.row(panel)))
    }

    /// The title of each panel, above its left end.
    fn titles<'a>(&self, titles: impl Iterator<Item = &'a String>) -> Vec<Annotation> {
        let title = |(panel, title): (usize, &String)| {
            let place = Annotation::new().show_arrow(false).x_ref("paper").y_ref("paper");
            let place = place.x(self.x_domain(self.column(panel))[0]).y(self.y_domain(self.row(panel))[1]);
            let place = place.x_anchor(Anchor::Left).y_anchor(Anchor::Bottom);
            place.text(format!("<b>{}</b>", escape(title))).font(Font::new().size(13))
        };
        titles.take(self.panels).enumerate().map(title).collect()
    }

    /// In one line above the panels.
    fn legend(&self) -> Legend {
        let legend = Legend::new().orientation(Orientation::Horizontal).x(0.0).x_anchor(Anchor::Left);
        legend.y(1.0 + 26.0 / self.plot_px() as f64).y_anchor(Anchor::Bottom)
    }

    fn layout(&self) -> Layout {
        Layout::new()
            .auto_size(true)
            .height(self.height_px())
            .margin(Margin::new().left(64).right(12).top(Self::TOP_PX).bottom(Self::BOTTOM_PX))
            .font(Font::new().family(FONT).size(12).color("#1b1b1b"))
            .paper_background_color("#ffffff")
            .plot_background_color("#ffffff")
            .legend(self.legend())
    }
}

const FONT: &str = "system-ui, -apple-system, Segoe UI, Roboto, Noto Sans, Liberation Sans, sans-serif";

fn axis() -> Axis {
    Axis::new().show_line(true).line_color("#595959").grid_color("#e6e6e6").zero_line(false).ticks(TicksDirection::Outside)
}

/// `x`, `x2`, … or `y`, `y2`, …
fn axis_name(direction: char, number: usize) -> String {
    if number == 0 { direction.to_string() } else { format!("{direction}{}", number + 1) }
}

fn set_x(layout: Layout, number: usize, axis: Axis) -> Layout {
    match number {
        0 => layout.x_axis(axis),
        1 => layout.x_axis2(axis),
        2 => layout.x_axis3(axis),
        3 => layout.x_axis4(axis),
        4 => layout.x_axis5(axis),
        _ => layout.x_axis6(axis),
    }
}

fn set_y(layout: Layout, number: usize, axis: Axis) -> Layout {
    match number {
        0 => layout.y_axis(axis),
        1 => layout.y_axis2(axis),
        2 => layout.y_axis3(axis),
        3 => layout.y_axis4(axis),
        4 => layout.y_axis5(axis),
        _ => layout.y_axis6(axis),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn json(figure: &Figure) -> serde_json::Value {
        serde_json::from_str(figure.json()).unwrap_or_default()
    }

    fn panels(count: usize) -> Vec<(String, String)> {
        (0..count).map(|panel| (format!("panel {panel}"), "m/s²".to_owned())).collect()
    }

    #[test]
    fn lines_share_their_horizontal_axes() {
        let x: Vec<f64> = (0..50).map(f64::from).collect();
        let data = ["measured", "<model>"].map(|name| LineData {
            name: name.into(),
            x: x.clone(),
            y: vec![x.clone(); 6],
            hidden: name != "measured",
        });
        let found = json(&lines("t", "c", "time, s", &panels(6), &data));
        assert_eq!(found["data"].as_array().map(Vec::len), Some(12));
        assert_eq!((&found["data"][6]["line"]["color"], &found["data"][0]["name"]), (&"#000000".into(), &"&lt;model&gt;".into()));
        assert_eq!(found["layout"]["xaxis2"]["matches"], "x");
        assert_eq!((&found["data"][5]["xaxis"], &found["data"][5]["yaxis"]), (&"x2".into(), &"y6".into()));
        assert!(found["layout"]["yaxis6"]["title"]["text"] == "m/s²" && found["layout"]["xaxis"]["title"]["text"] == "time, s");
        assert_eq!((&found["data"][0]["visible"], &found["data"][6]["visible"]), (&"legendonly".into(), &true.into()));
        assert_ne!(found["data"][0]["line"]["width"], found["data"][6]["line"]["width"], "lines differ by more than colour");
    }

    #[test]
    fn thin_bins_are_hollow_and_do_not_set_the_scale() {
        let bin = |at: f64, mean: f64, blocks: usize| Bin { at, mean, ci95: Some([mean - 1.0, mean + 2.0]), n: 10, blocks };
        let wide = Bin { ci95: Some([-900.0, 900.0]), ..bin(2.0, 0.5, 2) };
        let dependence = Dependence { bins: vec![bin(0.0, 1.0, 9), bin(1.0, -1.0, 9), wide], share: 0.25 };
        let curve = Some(("drag".to_owned(), vec![0.0, 1.0], vec![1.0, -1.0]));
        let panel = BinnedPanel { variable: "vx", unit: "m/s", dependence: &dependence, curve, after: None };
        let found = json(&binned("t", "c", "m/s²", &[panel]));
        assert_eq!(found["data"][0]["error_y"]["array"], serde_json::json!([2.0, 2.0]));
        assert_eq!(found["data"][0]["error_y"]["arrayminus"], serde_json::json!([1.0, 1.0]));
        assert_eq!(found["data"][1]["marker"]["symbol"], "circle-open");
        assert_eq!((&found["data"][2]["name"], &found["data"][2]["y"]), (&"drag".into(), &serde_json::json!([1.0, -1.0])));
        let high = found["layout"]["yaxis"]["range"][1].as_f64();
        assert!(high.is_some_and(|high| high > 3.0 && high < 4.0), "{high:?}");
        assert!(found["layout"]["annotations"][0]["text"].as_str().is_some_and(|text| text.contains("25 %")));
    }

    #[test]
    fn the_other_figures_hold_their_data() {
        let names = ["paper".to_owned(), "paper + ground effect".to_owned()];
        let found = json(&steps("t", "c", &panels(6), &names, &[vec![Some(2.0); 6], vec![Some(1.0), None]]));
        assert_eq!(found["data"][0]["y"], serde_json::json!([2.0, 1.0]));
        assert_eq!(found["data"][1]["y"], serde_json::json!([2.0, null]));
        let found = json(&shares("t", "c", &names, &[("physics".into(), vec![0.6, 0.7]), ("noise".into(), vec![0.4, 0.3])]));
        assert_eq!((&found["layout"]["barmode"], &found["data"][0]["x"]), (&"stack".into(), &serde_json::json!([70.0, 60.0])));
        assert_eq!(found["layout"]["xaxis"]["range"], serde_json::json!([0.0, 100.0]));
        let found = json(&shares("t", "c", &names, &[("network".into(), vec![-0.2, 0.1]), ("rest".into(), vec![1.2, 0.9])]));
        assert_eq!(found["layout"]["barmode"], "relative", "a negative share stands left of zero");
        assert_eq!(found["layout"]["xaxis"]["range"], serde_json::json!([-20.0, 120.0]));
        let found = json(&training("t", "c", &[("training".into(), vec![1.0, 0.5]), ("validation".into(), vec![1.5, 0.7])]));
        assert_eq!((&found["layout"]["yaxis"]["type"], &found["data"][1]["y"][1]), (&"log".into(), &0.7.into()));
    }

    #[test]
    fn panels_do_not_overlap() {
        for count in 1..=PANELS {
            for columns in 1..=3 {
                let rows = Grid::new(count, columns, 160, 40);
                for grid in [Grid::new(count, columns, 160, 40).by_column(), rows] {
                    let box_of = |panel: usize| (grid.x_domain(grid.column(panel)), grid.y_domain(grid.row(panel)));
                    let apart = |[a, b]: [f64; 2], [c, d]: [f64; 2]| b <= c || d <= a;
                    for (one, other) in (0..count).flat_map(|one| (0..one).map(move |other| (one, other))) {
                        let ((x, y), (u, v)) = (box_of(one), box_of(other));
                        assert!(apart(x, u) || apart(y, v), "{count} panels, {columns} columns: {one} and {other}");
                    }
                }
            }
        }
    }

    proptest! {
        #[test]
        fn thinning_keeps_order_and_extremes(y in prop::collection::vec(-1.0..1.0_f64, 1..5000)) {
            let x: Vec<f64> = (0..y.len()).map(|index| index as f64).collect();
            let (thin_x, thin_y) = thin(&x, &y);
            prop_assert!(thin_x.len() == thin_y.len() && thin_x.len() <= POINTS);
            prop_assert!(thin_x.windows(2).all(|pair| pair[0] < pair[1]));
            let ends = |values: &[f64]| values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
            prop_assert_eq!(ends(&y), ends(&thin_y));
        }
    }
}
