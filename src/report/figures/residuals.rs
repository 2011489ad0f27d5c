//! What is left over: mean residuals in bins of one variable, and over two.

use super::scale::{Scale, ends};
use super::svg::{Area, LEFT, RIGHT, Ticks, WIDTH, heading, line, rectangle, words};
use super::{Datum, Figure, Key, Look, Panel, with_unit};
use crate::critique::digits::significant;
use crate::critique::locate::{Bin, Dependence};
use crate::critique::residual_views::Surface;

/// One panel of a [`binned`] figure.
#[derive(Clone, Debug)]
pub struct BinnedPanel<'a> {
    /// What the variable is called on the axis.
    pub variable: &'a str,
    /// Unit of the variable.
    pub unit: &'a str,
    /// The residual against it.
    pub dependence: &'a Dependence,
    /// How the prediction changed from the model before to the model after, binned as the residual: where the points should lie.
    pub change: Option<&'a Dependence>,
    /// The residual of an amended model in the same bins.
    pub after: Option<&'a Dependence>,
}

/// Mean residual of one channel in bins of several variables, one panel each, with 95 % intervals. Bins on few blocks are hollow.
/// `unit` is that of the residual.
pub fn binned(title: &str, caption: &str, unit: &str, panels: &[BinnedPanel<'_>]) -> Figure {
    let changed = panels.iter().any(|panel| panel.after.is_some());
    let first = if changed { "before, with its 95 % interval" } else { "mean residual, with its 95 % interval" };
    let mut keys = vec![Key { name: first.into(), series: 1, look: Look::Dot }];
    if changed {
        keys.push(Key { name: "after".into(), series: 2, look: Look::Hollow });
    }
    if panels.iter().any(|panel| panel.change.is_some()) {
        keys.push(Key { name: "change of the whole prediction".into(), series: 3, look: Look::Dashed });
    }
    let y = bin_scale(panels);
    let panels = panels.iter().map(|panel| binned_panel(panel, unit, y)).collect();
    Figure { title: title.to_owned(), caption: caption.to_owned(), panels, keys, linked: false }
}

fn binned_panel(panel: &BinnedPanel<'_>, unit: &str, y: Scale) -> Panel {
    let (low, high) = ends(panel.dependence.bins.iter().map(|bin| bin.at));
    let room = 0.04 * (high - low);
    let area =
        Area { left: LEFT, top: 24.0, width: WIDTH - LEFT - RIGHT, height: 150.0, x: Scale::linear(low - room, high + room), y };
    let title = with_unit(panel.variable, panel.unit);
    let mut body = heading(&format!("{:.0} % goes with {}", 100.0 * panel.dependence.share, panel.variable), unit);
    body += &area.axes(Ticks { x: 6, y: 6, x_title: &title });
    let mut data = Vec::new();
    let mut number = |series: &str, bin: &Bin, interval: Option<[f64; 2]>| {
        data.push(Datum { series: series.into(), x: bin.at.to_string(), y: bin.mean, interval });
    };
    if let Some(change) = panel.change {
        body +=
            &area.data(&area.path("s3 dash", "change of the whole prediction", change.bins.iter().map(|bin| (bin.at, bin.mean))));
        change.bins.iter().for_each(|bin| number("change of the prediction", bin, None));
    }
    for bin in panel.after.into_iter().flat_map(|after| &after.bins).filter(|bin| inside(&area, bin.mean)) {
        let place = [area.at_x(bin.at) - 3.0, area.at_y(bin.mean) - 3.0, 6.0, 6.0];
        body += &rectangle("h2", place, &format!("after: {} {unit}", significant(bin.mean, 3)));
        number("after", bin, bin.ci95);
    }
    for bin in &panel.dependence.bins {
        let [x, middle] = [area.at_x(bin.at), area.at_y(bin.mean)];
        if let Some([low, high]) = bin.ci95 {
            let [from, to] = [low, high].map(|value| area.at_y(value.clamp(y.low, y.high)));
            body += &line(if bin.is_thin() { "wh thin" } else { "wh" }, [x, from], [x, to]);
        }
        if inside(&area, bin.mean) {
            body += &format!(
                "<circle class=\"{}\" cx=\"{x:.1}\" cy=\"{middle:.1}\" r=\"3.5\"><title>{}: {} {unit}, {} windows in {} blocks</title></circle>\n",
                if bin.is_thin() { "h1" } else { "f1" },
                significant(bin.at, 3),
                significant(bin.mean, 3),
                bin.n,
                bin.blocks
            );
        }
        number("before", bin, bin.ci95);
    }
    let (least, most) = ends(panel.dependence.bins.iter().map(|bin| bin.mean));
    let after = panel.after.map(|after| ends(after.bins.iter().map(|bin| bin.mean)));
    let after =
        after.map_or_else(String::new, |(low, high)| format!("; after from {} to {}", significant(low, 2), significant(high, 2)));
    let says = format!(
        "Mean of measured minus predicted, {unit}, in bins of {}: from {} to {}{after}.",
        panel.variable,
        significant(least, 2),
        significant(most, 2)
    );
    Panel { title: format!("Residual against {title}"), says, height: 210.0, body, data }
}

fn inside(area: &Area, value: f64) -> bool {
    (area.y.low..=area.y.high).contains(&value)
}

/// A common vertical range that holds every mean, every change, and the intervals of the bins that are not thin.
fn bin_scale(panels: &[BinnedPanel<'_>]) -> Scale {
    let means = |of: Option<&'_ Dependence>| of.map_or_else(Vec::new, |of| of.bins.iter().map(|bin| bin.mean).collect());
    let of_panel = |panel: &BinnedPanel<'_>| {
        let intervals = panel.dependence.bins.iter().flat_map(|bin| bin.ci95.filter(|_| !bin.is_thin()).unwrap_or([bin.mean; 2]));
        intervals.chain(means(panel.change)).chain(means(panel.after)).collect::<Vec<f64>>()
    };
    Scale::around(panels.iter().flat_map(of_panel).chain([0.0]))
}

/// The residual over two variables, one panel a model, on one colour scale: blue below zero, nothing at zero, orange above. Cells on
/// fewer than 5 blocks are crossed. `panels` are (title, surface); `axes` the titles of the axes; `unit` that of the residual.
pub fn surfaces(title: &str, caption: &str, unit: &str, axes: [&str; 2], panels: &[(String, &Surface)]) -> Figure {
    // Thin cells do not set the scale.
    let cells = || panels.iter().flat_map(|(_, surface)| &surface.cells);
    let sound = cells().filter(|cell| !cell.thin).map(|cell| cell.mean.abs()).fold(0.0, f64::max);
    let largest = if sound > 0.0 { sound } else { cells().map(|cell| cell.mean.abs()).fold(f64::MIN_POSITIVE, f64::max) };
    let keys = vec![
        Key { name: format!("measured below predicted, to −{} {unit}", significant(largest, 2)), series: 1, look: Look::Bar },
        Key { name: format!("above, to +{} {unit}", significant(largest, 2)), series: 2, look: Look::Bar },
    ];
    let panels = panels.iter().map(|(title, surface)| surface_panel(title, surface, axes, unit, largest)).collect();
    Figure { title: title.to_owned(), caption: caption.to_owned(), panels, keys, linked: false }
}

fn surface_panel(title: &str, surface: &Surface, axes: [&str; 2], unit: &str, largest: f64) -> Panel {
    let side = |edges: &[f64]| {
        let (low, high) = ends(edges.iter().copied());
        Scale::linear(low, high)
    };
    let [x, y] = [side(&surface.edges[0]), side(&surface.edges[1])];
    let area = Area { left: LEFT, top: 40.0, width: WIDTH - LEFT - RIGHT, height: 260.0, x, y };
    let mut body = heading(title, "") + &words("tk", "start", LEFT, 32.0, &format!("↑ {}", axes[1]));
    let mut data = Vec::new();
    for cell in &surface.cells {
        let edge = |axis: usize, place: usize| Some([*surface.edges[axis].get(place)?, *surface.edges[axis].get(place + 1)?]);
        let (Some([left, right]), Some([low, high])) = (edge(0, cell.column), edge(1, cell.row)) else { continue };
        let [x0, x1] = [left, right].map(|value| area.at_x(value));
        let [y0, y1] = [high, low].map(|value| area.at_y(value));
        let interval = cell.ci95.map_or_else(String::new, |[low, high]| format!(" [{low:.3}, {high:.3}]"));
        body += &format!(
            "<rect class=\"f{}\" fill-opacity=\"{:.2}\" x=\"{x0:.1}\" y=\"{y0:.1}\" width=\"{:.1}\" height=\"{:.1}\"><title>{:.3}{interval} {unit}, \
             {} rows in {} blocks</title></rect>\n",
            if cell.mean < 0.0 { 1 } else { 2 },
            (cell.mean.abs() / largest).min(1.0),
            x1 - x0,
            y1 - y0,
            cell.mean,
            cell.n,
            cell.blocks
        );
        let [x, y] = [0.5 * (x0 + x1), 0.5 * (y0 + y1)];
        if cell.thin {
            body += &format!("<path class=\"ax\" d=\"M{:.1} {:.1}l5 5m-5 0l5-5\"/>\n", x - 2.5, y - 2.5);
        }
        let [x, y] = [0.5 * (left + right), 0.5 * (low + high)];
        data.push(Datum { series: format!("{} = {y}", surface.variables[1]), x: x.to_string(), y: cell.mean, interval: cell.ci95 });
    }
    body += &area.axes(Ticks { x: 6, y: 5, x_title: axes[0] });
    let (low, high) = ends(surface.cells.iter().map(|cell| cell.mean));
    let says = format!(
        "Mean of measured minus predicted over {} and {}: from {} to {} {unit} in {} cells.",
        axes[0],
        axes[1],
        significant(low, 2),
        significant(high, 2),
        surface.cells.len()
    );
    Panel { title: title.to_owned(), says, height: area.bottom() + 36.0, body, data }
}

#[cfg(test)]
mod tests {
    use super::super::tests::well_formed;
    use super::*;

    #[test]
    fn thin_bins_are_hollow_and_do_not_set_the_scale() {
        let bin = |at: f64, mean: f64, blocks: usize| Bin { at, mean, ci95: Some([mean - 1.0, mean + 2.0]), n: 10, blocks };
        let wide = Bin { ci95: Some([-900.0, 900.0]), ..bin(2.0, 0.5, 2) };
        let dependence = Dependence { bins: vec![bin(0.0, 1.0, 9), bin(1.0, -1.0, 9), wide], share: 0.25 };
        let change = Dependence { bins: vec![bin(0.0, 0.9, 9), bin(1.0, -0.8, 9)], share: 0.2 };
        let panel = BinnedPanel { variable: "vx", unit: "m/s", dependence: &dependence, after: None, change: Some(&change) };
        let scale = bin_scale(std::slice::from_ref(&panel));
        assert!(scale.high > 3.0 && scale.high < 4.0, "{scale:?}");
        let figure = binned("t", "c", "m/s²", &[panel]);
        assert_eq!(well_formed(&figure.svg()), Ok(()));
        let body = &figure.panels[0].body;
        assert_eq!(["circle class=\"f1\"", "circle class=\"h1\"", "wh thin"].map(|what| body.matches(what).count()), [2, 1, 1]);
        assert!(body.contains("25 % goes with vx") && body.contains("change of the whole prediction"));
        let changes = figure.panels[0].data.iter().filter(|datum| datum.series == "change of the prediction");
        assert_eq!(changes.map(|datum| datum.y).collect::<Vec<_>>(), [0.9, -0.8]);
    }
}
