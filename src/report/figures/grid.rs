//! Where the panels of a figure stand, and their axes. What is drawn in them is elsewhere.

use super::PANELS;
use crate::report::page::escape;
use plotly::Layout;
use plotly::common::{Anchor, Font, Orientation};
use plotly::layout::{Annotation, Axis, Legend, Margin, TicksDirection};

/// Where the panels of a figure stand, in pixels and as shares of the plotting area.
pub(super) struct Grid {
    pub panels: usize,
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

    pub fn new(panels: usize, columns: usize, row_px: usize, gap_px: usize) -> Self {
        let panels = panels.clamp(1, PANELS);
        let columns = columns.clamp(1, panels);
        Self { panels, columns, rows: panels.div_ceil(columns), by_column: false, row_px, gap_px }
    }

    pub const fn by_column(self) -> Self {
        Self { by_column: true, ..self }
    }

    const fn plot_px(&self) -> usize {
        self.rows * self.row_px + (self.rows - 1) * self.gap_px
    }

    pub const fn height_px(&self) -> usize {
        Self::TOP_PX + self.plot_px() + Self::BOTTOM_PX
    }

    pub const fn column(&self, panel: usize) -> usize {
        if self.by_column { panel / self.rows } else { panel % self.columns }
    }

    const fn row(&self, panel: usize) -> usize {
        if self.by_column { panel % self.rows } else { panel / self.columns }
    }

    /// Whether no panel stands below this one.
    pub fn is_lowest(&self, panel: usize) -> bool {
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

    pub fn x(&self, column: usize) -> Axis {
        axis().domain(&self.x_domain(column))
    }

    pub fn y(&self, panel: usize) -> Axis {
        axis().domain(&self.y_domain(self.row(panel)))
    }

    /// The title of each panel, above its left end.
    pub fn titles<'a>(&self, titles: impl Iterator<Item = &'a String>) -> Vec<Annotation> {
        let title = |(panel, title): (usize, &String)| {
            let place = Annotation::new().show_arrow(false).x_ref("paper").y_ref("paper");
            let place = place.x(self.x_domain(self.column(panel))[0]).y(self.y_domain(self.row(panel))[1]);
            let place = place.x_anchor(Anchor::Left).y_anchor(Anchor::Bottom);
            place.text(format!("<b>{}</b>", escape(title))).font(Font::new().size(13))
        };
        titles.take(self.panels).enumerate().map(title).collect()
    }

    /// In one line above the panels.
    pub fn legend(&self) -> Legend {
        let legend = Legend::new().orientation(Orientation::Horizontal).x(0.0).x_anchor(Anchor::Left);
        legend.y(1.0 + 26.0 / self.plot_px() as f64).y_anchor(Anchor::Bottom)
    }

    pub fn layout(&self) -> Layout {
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
pub(super) fn axis_name(direction: char, number: usize) -> String {
    if number == 0 { direction.to_string() } else { format!("{direction}{}", number + 1) }
}

pub(super) fn set_x(layout: Layout, number: usize, axis: Axis) -> Layout {
    match number {
        0 => layout.x_axis(axis),
        1 => layout.x_axis2(axis),
        2 => layout.x_axis3(axis),
        3 => layout.x_axis4(axis),
        4 => layout.x_axis5(axis),
        _ => layout.x_axis6(axis),
    }
}

pub(super) fn set_y(layout: Layout, number: usize, axis: Axis) -> Layout {
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
}
