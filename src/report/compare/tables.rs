//! A comparison as tables, and the strip of errors that comes first. No measuring: every number is one of [`Comparison`].

use super::super::figures::{self, Fall, FallPanel, Figure, Kind as Bar};
use super::super::names::{channel_panels, spoken};
use super::super::page::{Cell, Map, MapCell, Part, Table};
use crate::critique::channels::Intervals;
use crate::critique::digits::{Kind, significant};
use crate::critique::shares::bars;
use crate::critique::table::{FLOOR, LEGEND, MEASURES};
use crate::critique::{ChannelValues, Comparison, Coverage, ModelError, Shares, Uncertainty};
use crate::flight::{Channel, Column};

/// Heads of the columns: what `first` says, the channels in words with symbol and unit below, and the mean.
pub fn channel_columns(first: &str, share: bool, mean: bool) -> Vec<(String, String)> {
    let below = |column: &Column| if share { column.name().to_owned() } else { format!("{}, {}", column.name(), column.unit()) };
    let channels = Column::TARGETS.iter().map(|column| (spoken(column.name()).unwrap_or_default().to_owned(), below(column)));
    let last = mean.then(|| ("mean".to_owned(), String::new()));
    [(first.to_owned(), String::new())].into_iter().chain(channels).chain(last).collect()
}

/// The error of every model in each channel with its interval and the floor.
pub fn strip(comparison: &Comparison, yardstick: Option<usize>) -> Figure {
    let kind = |index: usize| if yardstick == Some(index) { Bar::Before } else { Bar::Physics };
    let panel = |(channel, (title, unit)): (Channel, (String, String))| FallPanel {
        title,
        unit,
        bars: (0..comparison.models.len()).filter_map(|index| bar_of(comparison, index, channel, kind(index))).collect(),
        floor: comparison.floor.and_then(|floor| floor.channels()[channel]),
    };
    let panels: Vec<FallPanel> = Channel::ALL.into_iter().zip(channel_panels()).map(panel).collect();
    let caption = format!("Root mean square error with its 95 % interval: {}.", comparison.basis());
    figures::falls("Error of every model", &caption, &panels)
}

/// The bar of one model in one channel, of the kind given unless it has a network.
pub fn bar_of(comparison: &Comparison, index: usize, channel: Channel, kind: Bar) -> Option<Fall> {
    let model = comparison.models.get(index)?;
    let network = comparison.shares.iter().any(|shares| shares.name == model.name);
    let value = model.rmse.channels()[channel];
    Some(Fall {
        name: model.name.clone(),
        kind: if network { Bar::Network } else { kind },
        value: value?,
        ci95: model.rmse_ci95.channels()[channel],
        remark: String::new(),
    })
}

/// The RMSE as a table with intervals; the other measures under a line that opens them.
pub fn error_tables(comparison: &Comparison) -> Vec<Part> {
    let between = |interval: Option<[f64; 2]>| {
        interval.map(|[low, high]| format!(" [{}, {}]", significant(low, 2), significant(high, 2))).unwrap_or_default()
    };
    let table = |(title, words, kind, measure): (&str, &str, Kind, fn(&ModelError) -> ChannelValues)| {
        let key = match title {
            "RMSE" => "rmse",
            "MAE" => "mae",
            "R²" => "r2",
            _ => "",
        };
        let columns = channel_columns("model", kind == Kind::Share, true);
        let rows = comparison.models.iter().enumerate().map(|(row, model)| {
            let intervals = if title == "RMSE" { with_mean_of(&model.rmse_ci95) } else { vec![None; 7] };
            let names = Column::TARGETS.iter().map(|column| column.name()).chain(["mean"]);
            let cells = with_mean(&measure(model)).into_iter().zip(intervals).zip(names);
            let cells = cells.map(|((value, interval), name)| Cell {
                text: format!("{}{}", kind.text(value), between(interval)),
                best: comparison.is_best(key, name, row),
            });
            [Cell::from(model.name.clone())].into_iter().chain(cells).collect()
        });
        let floor = comparison.floor.filter(|_| title == "RMSE").map(|floor| {
            let cells = with_mean(&floor).into_iter().map(|value| Cell::from(kind.text(value)));
            [Cell::from("floor".to_owned())].into_iter().chain(cells).collect()
        });
        let rows = rows.chain(floor).collect();
        Part::Table(Table { caption: format!("{title}, {words}"), rows, columns: columns.clone() })
    };
    let note = format!(
        "{} The mean of the six mixes m/s² and rad/s²: it ranks models on the same data and means nothing else.",
        LEGEND.replace("below each", "behind each")
    );
    let mut parts: Vec<Part> = comparison.caution().map(Part::Text).into_iter().collect();
    let mut all = MEASURES.into_iter().map(table);
    parts.extend(all.next());
    parts.push(Part::Text(note));
    parts.extend(comparison.floor.map(|_| Part::Text(FLOOR.into())));
    parts.push(Part::Details("MAE, MaxAE, R², and differences to the best".into(), all.chain(differences(comparison)).collect()));
    parts
}

/// How far each model is from the one with the smallest mean RMSE.
fn differences(comparison: &Comparison) -> Option<Part> {
    let apart = || comparison.models.iter().filter_map(|model| Some((model, model.difference_to_best.as_ref()?)));
    let (_, first) = apart().next()?;
    let rows = apart().map(|(model, apart)| {
        let cells = with_mean(&apart.rmse).into_iter().zip(with_mean_of(&apart.ci95)).map(|(value, interval)| {
            let interval = interval.map(|[low, high]| format!(" [{}, {}]", significant(low, 2), significant(high, 2)));
            let sign = if value.is_some_and(|value| value > 0.0) { "+" } else { "" };
            Cell::from(format!("{sign}{}{}", Kind::Error.text(value), interval.unwrap_or_default()))
        });
        [Cell::from(model.name.clone())].into_iter().chain(cells).collect()
    });
    let caption = format!("RMSE less that of {}, paired over {} blocks of ten seconds", first.to, comparison.blocks);
    Some(Part::Table(Table { caption, columns: channel_columns("model", false, true), rows: rows.collect() }))
}

fn with_mean_of(intervals: &Intervals) -> Vec<Option<[f64; 2]>> {
    intervals.channels().into_iter().chain([intervals.mean]).collect()
}

/// A bar and a table with intervals for one network.
pub fn share_parts(shares: &Shares) -> Vec<Part> {
    let (physics, neither) = (("named physics", shares.physics), ("neither", shares.neither));
    let learned = match shares.of_network {
        None => vec![("network", shares.network)],
        Some(parts) => vec![("linear history", parts.linear_history), ("network itself", parts.network_itself)],
    };
    let stacked: Vec<_> = [physics].into_iter().chain(learned).chain([neither]).collect();
    let bars = bars(&stacked.iter().map(|(_, share)| *share).collect::<Vec<_>>());
    let rows: Vec<String> = bars.iter().map(|(name, _)| name.clone()).collect();
    let values = |part: usize| bars.iter().filter_map(|(_, values)| values.get(part).copied()).collect();
    let of_parts: Vec<(String, Vec<f64>)> =
        stacked.iter().enumerate().map(|(part, (name, _))| ((*name).to_owned(), values(part))).collect();
    let mut basis = shares.basis();
    basis.replace_range(..1, "S");
    let caption = format!("{basis}. A part left of zero makes the error larger.");
    let lines = shares.lines().into_iter().map(|(name, of)| {
        let cell = |share: &Option<crate::critique::shares::Share>| {
            let Some(share) = share else { return Cell::from("–") };
            let interval = share.interval_text();
            Cell::from(if interval.is_empty() { share.text() } else { format!("{} ({interval})", share.text()) })
        };
        // Without the blanks that set off a part in plain text.
        let name = if name.starts_with(' ') { format!("of it: {}", name.trim()) } else { name.to_owned() };
        [Cell::from(name)].into_iter().chain(of.all().iter().map(cell)).collect()
    });
    let note = "Neither holds sensor noise, gusts, and physics that the network did not learn: it bounds the noise from above. The \
                intervals say how far a share would move on other flights of this kind, not with another training of the network.";
    let table = Table {
        caption: format!("Shares in percent, 95 % interval from {} blocks of ten seconds in brackets", shares.blocks),
        columns: channel_columns("part", true, true),
        rows: lines.collect(),
    };
    let figure = figures::shares(&format!("Who explains what, {}", shares.name), &caption, &rows, &of_parts);
    vec![Part::Figure(figure), Part::Table(table), Part::Text(note.into())]
}

/// The share of measurements that a network's intervals hold, and where the network was not trained.
pub fn coverage_parts(coverage: &Coverage) -> Vec<Part> {
    let row =
        |(name, cells): (String, Vec<String>)| [Cell::from(name)].into_iter().chain(cells.into_iter().map(Cell::from)).collect();
    let table = Table {
        caption: format!("Prediction intervals of {}", coverage.name),
        columns: channel_columns("", false, false),
        rows: coverage.rows().into_iter().map(row).collect(),
    };
    vec![Part::Table(table), Part::Text(coverage.note())]
}

/// Coefficient × channel, shaded by the share of the error, and the totals.
pub fn uncertainty_parts(uncertainty: &Uncertainty) -> Vec<Part> {
    let (sd, share) = (uncertainty.sd.channels(), uncertainty.share_of_rmse.channels());
    let cell = |channel: Channel, value: Option<f64>| MapCell {
        text: Kind::Error.text(value),
        // sd / share is the RMSE of the channel.
        value: value
            .zip(share[channel])
            .zip(sd[channel])
            .filter(|(_, sd)| *sd > 0.0)
            .map(|((value, share), sd)| value * share / sd),
        ..MapCell::default()
    };
    let rows = uncertainty.coefficients.iter().map(|one| {
        let [low, high] = one.ci95;
        let interval = format!("{} … {} {}", significant(low, 3), significant(high, 3), one.unit);
        let cells = one.movement.channels().pairs().map(|(channel, value)| cell(channel, *value)).collect();
        (format!("{} {}", one.effect, one.name), interval, cells)
    });
    let map = Map {
        caption: format!("Movement of {} when a coefficient moves by half its 95 % interval, root mean square", uncertainty.name),
        shade: "movement over the RMSE of the channel".into(),
        full: None,
        columns: channel_columns("coefficient", false, false),
        rows: rows.collect(),
    };
    let totals = uncertainty.totals().into_iter().map(|(name, of, kind)| {
        [Cell::from(name)].into_iter().chain(of.channels().map(|value| Cell::from(kind.text(value)))).collect()
    });
    let table =
        Table { caption: "All coefficients together".into(), columns: channel_columns("", false, false), rows: totals.collect() };
    vec![Part::Map(map), Part::Table(table), Part::Text(uncertainty.note())]
}

fn with_mean(values: &ChannelValues) -> Vec<Option<f64>> {
    values.channels().into_iter().chain([values.mean]).collect()
}
