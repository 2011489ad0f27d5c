//! Bars: an error from step to step with its intervals and its floor, and shares of a whole.

use super::scale::{Scale, ends};
use super::svg::{Area, CHARACTER, RIGHT, Ticks, WIDTH, clipped, heading, line, rectangle, words};
use super::{Datum, Figure, Key, Look, Panel};
use crate::critique::digits::significant;

/// What a bar of a [`falls`] figure stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// What others are seen against: the model as it was, a yardstick.
    Before,
    /// The model with more physics.
    Physics,
    /// The same where the physics that was added changes nothing.
    Unmoved,
    /// With a network.
    Network,
    /// With a formula that is suggested and was measured, but is in no model.
    Suggested,
    /// A region of flight, whose name takes a line of its own.
    Region,
    /// All of the flights, beside regions.
    Whole,
}

impl Kind {
    /// Class of its bar, and how it stands in the legend.
    const fn look(self) -> (&'static str, usize, Look, &'static str) {
        match self {
            Self::Before => ("f0 thin", 0, Look::Faint, "before, or a yardstick"),
            Self::Physics => ("f1", 1, Look::Bar, "with more physics"),
            Self::Unmoved => ("f1 thin", 1, Look::Faint, "added, but not in this channel"),
            Self::Network => ("f3", 3, Look::Bar, "with a network"),
            Self::Suggested => ("h2", 2, Look::Hollow, "with the suggested formula, measured"),
            Self::Region => ("f1", 1, Look::Bar, ""),
            Self::Whole => ("f0 thin", 0, Look::Faint, ""),
        }
    }
}

/// A bar of a [`falls`] figure.
#[derive(Clone, Debug)]
pub struct Fall {
    /// What it is called.
    pub name: String,
    /// What it stands for.
    pub kind: Kind,
    /// Its length.
    pub value: f64,
    /// The interval of it.
    pub ci95: Option<[f64; 2]>,
    /// A remark behind the number.
    pub remark: String,
}

/// A panel of a [`falls`] figure.
#[derive(Clone, Debug, Default)]
pub struct FallPanel {
    /// Title.
    pub title: String,
    /// Unit of the bars.
    pub unit: String,
    /// From top to bottom.
    pub bars: Vec<Fall>,
    /// What no bar can go below, where it is known.
    pub floor: Option<f64>,
}

/// Characters of a bar's name at most, beside it and above it.
const NAME: usize = 24;
const LONG_NAME: usize = 62;

/// Horizontal bars with their intervals, a panel a channel: how an error falls from step to step (a waterfall) down to its floor, or how it
/// differs from region to region. Whiskers that reach far beyond all bars are cut where the picture ends.
pub fn falls(title: &str, caption: &str, panels: &[FallPanel]) -> Figure {
    let mut keys: Vec<Key> = Vec::new();
    for bar in panels.iter().flat_map(|panel| &panel.bars) {
        let (_, series, look, name) = bar.kind.look();
        if !name.is_empty() && keys.iter().all(|key| key.name != name) {
            keys.push(Key { name: name.into(), series, look });
        }
    }
    if panels.iter().any(|panel| panel.floor.is_some()) {
        keys.push(Key { name: "floor: what gusts and noise leave".into(), series: 0, look: Look::Dashed });
    }
    let rows = panels.iter().map(|panel| panel.bars.len()).max().unwrap_or(0);
    let step = if rows > 14 { 15.0 } else { 18.0 };
    Figure {
        title: title.to_owned(),
        caption: caption.to_owned(),
        panels: panels.iter().map(|panel| fall_panel(panel, step)).collect(),
        keys,
        linked: false,
    }
}

fn fall_panel(panel: &FallPanel, step: f64) -> Panel {
    let longest = |texts: &mut dyn Iterator<Item = usize>| texts.max().unwrap_or(0) as f64;
    let stacked = panel.bars.iter().any(|bar| bar.kind == Kind::Region);
    let (step, limit) = if stacked { (2.0 * step - 4.0, LONG_NAME) } else { (step, NAME) };
    let beside = longest(&mut panel.bars.iter().map(|bar| bar.name.chars().count().min(NAME))) * CHARACTER + 8.0;
    let names = if stacked { 6.0 } else { beside };
    let text = |bar: &Fall| significant(bar.value, 3) + &bar.remark;
    let numbers = longest(&mut panel.bars.iter().map(|bar| text(bar).chars().count())) * CHARACTER + 10.0;
    let largest = ends(panel.bars.iter().map(|bar| bar.value).chain(panel.floor)).1;
    let upper = ends(panel.bars.iter().filter_map(|bar| Some(bar.ci95?[1]))).1;
    let end = if largest.is_finite() { largest.max(upper.min(1.4 * largest)) } else { 1.0 };
    let floor_room = if panel.floor.is_some() { 14.0 } else { 0.0 };
    let area = Area {
        left: names,
        top: 22.0 + floor_room,
        width: WIDTH - names - numbers - RIGHT,
        height: step * panel.bars.len() as f64,
        x: Scale::linear(0.0, end * 1.02),
        y: Scale::linear(0.0, 1.0),
    };
    let mut body = heading(&panel.title, &panel.unit);
    body += &area.axes(Ticks { x: 4, y: 0, x_title: "" });
    let mut data = Vec::new();
    for (row, bar) in panel.bars.iter().enumerate() {
        let below = if stacked { 0.45 * step } else { 0.0 };
        let top = area.top + step * row as f64 + below;
        let middle = top + 0.5 * (step - below);
        let interval =
            bar.ci95.map_or_else(String::new, |[low, high]| format!(" [{}, {}]", significant(low, 3), significant(high, 3)));
        let says = format!("{}: {}{interval} {}", bar.name, significant(bar.value, 4), panel.unit);
        let (anchor, x, y) = if stacked { ("start", names, top) } else { ("end", names - 6.0, middle + 4.0) };
        body += &words("va", anchor, x, y, &clipped(&bar.name, limit));
        if bar.value.is_finite() {
            body +=
                &rectangle(bar.kind.look().0, [area.left, top + 3.0, area.at_x(bar.value) - area.left, step - below - 6.0], &says);
            body += &words("va", "start", WIDTH - numbers - RIGHT + 8.0, middle + 4.0, &text(bar));
            data.push(Datum { series: bar.kind.look().3.into(), x: bar.name.clone(), y: bar.value, interval: bar.ci95 });
        }
        if let Some([low, high]) = bar.ci95.filter(|ends| ends.iter().all(|end| end.is_finite())) {
            let [from, to] = [low, high].map(|value| area.at_x(value.clamp(0.0, area.x.high)));
            body += &line("wh", [from, middle], [to, middle]);
            body += &line("wh", [from, middle - 3.0], [from, middle + 3.0]);
            if high <= area.x.high {
                body += &line("wh", [to, middle - 3.0], [to, middle + 3.0]);
            }
        }
    }
    if let Some(floor) = panel.floor {
        let x = area.at_x(floor);
        body += &line("fl", [x, area.top - 3.0], [x, area.bottom()]);
        body += &words("tk", "middle", x.max(names + 24.0), area.top - 6.0, &format!("floor {}", significant(floor, 3)));
        data.push(Datum { series: "floor".into(), x: "floor".into(), y: floor, interval: None });
    }
    let all: Vec<String> = panel.bars.iter().map(|bar| format!("{} {}", bar.name, significant(bar.value, 3))).collect();
    let floor = panel.floor.map_or_else(String::new, |floor| format!("; floor {}", significant(floor, 3)));
    let says = format!(
        "In {}, from top to bottom: {}{floor}.",
        if panel.unit.is_empty() { "its unit" } else { &panel.unit },
        all.join(", ")
    );
    Panel { title: panel.title.clone(), says, height: area.bottom() + 24.0, body, data }
}

/// Shares that add up to a whole, one horizontal bar a row: what physics explains, what only the network explains, what is noise.
/// `parts` are (name, share of each row, 1 being the whole). A negative share stands to the left of zero; the others then reach
/// as far beyond the whole.
pub fn shares(title: &str, caption: &str, rows: &[String], parts: &[(String, Vec<f64>)]) -> Figure {
    const STEP: f64 = 26.0;
    let names = rows.iter().map(|row| row.chars().count().min(NAME)).max().unwrap_or(0) as f64 * CHARACTER + 10.0;
    // One end of each bar: the sum of its shares of one sign.
    let end = |sign: f64| {
        let sum = |row: usize| parts.iter().filter_map(|part| part.1.get(row)).map(|value| (sign * value).max(0.0)).sum::<f64>();
        100.0 * (0..rows.len()).map(sum).filter(|sum| sum.is_finite()).fold(0.0, f64::max)
    };
    let area = Area {
        left: names,
        top: 8.0,
        width: WIDTH - names - RIGHT - 6.0,
        height: STEP * rows.len() as f64,
        x: Scale::linear(-end(-1.0), end(1.0).max(100.0)),
        y: Scale::linear(0.0, 1.0),
    };
    let mut body = area.axes(Ticks { x: 5, y: 0, x_title: "share, %" });
    let mut data = Vec::new();
    for (row, name) in rows.iter().enumerate() {
        let top = area.top + STEP * row as f64;
        body += &words("va", "end", names - 6.0, top + 0.5 * STEP + 4.0, &clipped(name, NAME));
        let mut reached = [0.0_f64; 2];
        for (part, (of, values)) in parts.iter().enumerate() {
            let Some(percent) = values.get(row).map(|value| 100.0 * value).filter(|percent| percent.is_finite()) else { continue };
            let side = usize::from(percent < 0.0);
            let (from, to) = (reached[side], reached[side] + percent);
            reached[side] = to;
            let [left, right] = [from.min(to), from.max(to)].map(|value| area.at_x(value));
            let series = SHARES[part % SHARES.len()];
            body += &rectangle(
                &format!("f{series}"),
                [left, top + 3.0, right - left, STEP - 6.0],
                &format!("{name}, {of}: {percent:.1} %"),
            );
            let text = format!("{percent:.0} %");
            if right - left > CHARACTER * text.chars().count() as f64 + 4.0 {
                body += &words("on", "middle", 0.5 * (left + right), top + 0.5 * STEP + 4.0, &text);
            }
            data.push(Datum { series: of.clone(), x: name.clone(), y: percent, interval: None });
        }
    }
    let keys = parts.iter().enumerate().map(|(part, (name, _))| Key {
        name: name.clone(),
        series: SHARES[part % SHARES.len()],
        look: Look::Bar,
    });
    let says = format!(
        "A bar for each of {}, made up of {}.",
        rows.join(", "),
        parts.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
    );
    let panel = Panel { title: title.to_owned(), says, height: area.bottom() + 38.0, body, data };
    Figure { title: title.to_owned(), caption: caption.to_owned(), panels: vec![panel], keys: keys.collect(), linked: false }
}

/// Colours of shares: as those of a waterfall, and the last what nobody explains.
const SHARES: [usize; 5] = [1, 3, 5, 6, 4];

#[cfg(test)]
mod tests {
    use super::super::tests::well_formed;
    use super::*;

    fn bar(name: &str, value: f64) -> Fall {
        Fall { name: name.into(), kind: Kind::Physics, value, ci95: Some([0.9 * value, 1.2 * value]), remark: String::new() }
    }

    #[test]
    fn bars_hold_their_numbers_intervals_and_floor() {
        let before = Fall { kind: Kind::Before, ci95: Some([1.0, 90.0]), ..bar("paper", 2.0) };
        let panel = FallPanel {
            title: "vx".into(),
            unit: "m/s²".into(),
            bars: vec![before, bar("+ drag & lift", 1.0)],
            floor: Some(0.3126),
        };
        let figure = falls("t", "c", &[panel, FallPanel::default()]);
        assert_eq!(well_formed(&figure.svg()), Ok(()));
        let [first, second] = figure.panels.as_slice() else { panic!("two panels") };
        assert!(first.body.contains("+ drag &amp; lift: 1.000 [0.900, 1.20] m/s²") && first.body.contains("floor 0.313"));
        assert_eq!(first.data.iter().map(|datum| datum.y).collect::<Vec<_>>(), [2.0, 1.0, 0.3126]);
        assert_eq!(first.data[0].interval, Some([1.0, 90.0]), "the file has the whisker that the picture cuts");
        assert!(second.data.is_empty());
        let keys: Vec<&str> = figure.keys.iter().map(|key| key.name.as_str()).collect();
        assert_eq!(keys, ["before, or a yardstick", "with more physics", "floor: what gusts and noise leave"]);
    }

    #[test]
    fn negative_shares_stand_left_of_zero() {
        let rows = ["vx_dot".to_owned(), "wx_dot".to_owned()];
        let figure = shares("t", "c", &rows, &[("network".into(), vec![-0.2, 0.1]), ("rest".into(), vec![1.2, 0.9])]);
        let panel = &figure.panels[0];
        assert_eq!(panel.data.iter().map(|datum| datum.y.round() as i64).collect::<Vec<_>>(), [-20, 120, 10, 90]);
        let x = |says: &str| {
            let at = panel.body.find(says).unwrap_or_default();
            let rect = &panel.body[panel.body[..at].rfind("<rect").unwrap_or_default()..at];
            rect.split(" x=\"").nth(1).and_then(|x| x.split('"').next()).and_then(|x| x.parse::<f64>().ok())
        };
        let (negative, other) = (x("vx_dot, network: -20.0 %"), x("vx_dot, rest: 120.0 %"));
        assert!(negative.is_some() && negative < other, "{negative:?} {other:?}");
    }
}
