//! What is left over: mean residuals in bins of one variable, and over two.

use super::grid::{Grid, axis_name, set_x, set_y};
use super::{Figure, figure, round, rounded, thin, with_unit};
use crate::critique::locate::{Bin, Dependence};
use crate::critique::residual_views::Surface;
use crate::report::colour;
use crate::report::page::escape;
use plotly::common::{
    ColorBar, ColorScale, ColorScaleElement, DashType, ErrorData, ErrorType, HoverInfo, Line, Marker, MarkerSymbol, Mode,
};
use plotly::{HeatMap, Scatter, Traces};

/// Intervals of bins that rest on few blocks.
const FAINT: &str = "#b5cfe0";

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

#[cfg(test)]
mod tests {
    use super::super::tests::json;
    use super::*;

    #[test]
    fn thin_bins_are_hollow_and_do_not_set_the_scale() {
        let bin = |at: f64, mean: f64, blocks: usize| Bin { at, mean, ci95: Some([mean - 1.0, mean + 2.0]), n: 10, blocks };
        let wide = Bin { ci95: Some([-900.0, 900.0]), ..bin(2.0, 0.5, 2) };
        let dependence = Dependence { bins: vec![bin(0.0, 1.0, 9), bin(1.0, -1.0, 9), wide], share: 0.25 };
        let curve = Some(("drag".to_owned(), vec![0.0, 1.0], vec![1.0, -1.0]));
        let panel = BinnedPanel { variable: "vx", unit: "m/s", dependence: &dependence, after: None, curve };
        let found = json(&binned("t", "c", "m/s²", &[panel]));
        assert_eq!(found["data"][0]["error_y"]["array"], serde_json::json!([2.0, 2.0]));
        assert_eq!(found["data"][0]["error_y"]["arrayminus"], serde_json::json!([1.0, 1.0]));
        assert_eq!(found["data"][1]["marker"]["symbol"], "circle-open");
        assert_eq!((&found["data"][2]["name"], &found["data"][2]["y"]), (&"drag".into(), &serde_json::json!([1.0, -1.0])));
        let high = found["layout"]["yaxis"]["range"][1].as_f64();
        assert!(high.is_some_and(|high| high > 3.0 && high < 4.0), "{high:?}");
        assert!(found["layout"]["annotations"][0]["text"].as_str().is_some_and(|text| text.contains("25 %")));
    }
}
