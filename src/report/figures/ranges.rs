//! Numbers beside what is usual for them.

use super::scale::{Scale, ends};
use super::svg::{Area, CHARACTER, RIGHT, WIDTH, clipped, heading, line, rectangle, words};
use super::{Datum, Figure, Key, Look, Panel};
use crate::critique::digits::significant;

/// One number of an effect.
#[derive(Clone, Debug)]
pub struct RangeRow {
    /// Name.
    pub name: String,
    /// Unit; `1` for none.
    pub unit: String,
    /// Value.
    pub value: f64,
    /// Its interval.
    pub ci95: Option<[f64; 2]>,
    /// What is usual.
    pub usual: Option<[f64; 2]>,
    /// Flights that have a value of their own.
    pub by_flight: Vec<(String, f64)>,
}

const STEP: f64 = 22.0;
const NAME: usize = 15;

/// Numbers with their intervals over a band of what is usual, each row on an axis of its own that holds zero, number and band; a panel an effect.
pub fn ranges(title: &str, caption: &str, effects: &[(String, Vec<RangeRow>)]) -> Figure {
    let own = effects.iter().flat_map(|(_, rows)| rows).any(|row| !row.by_flight.is_empty());
    let own = own.then_some(("each flight that has its own", 1, Look::Ring));
    let keys = [("found, with its 95 % interval", 1, Look::Dot), ("usual, where it is known", 0, Look::Faint)];
    Figure {
        title: title.to_owned(),
        caption: caption.to_owned(),
        panels: effects.iter().map(|(effect, rows)| panel(effect, rows)).collect(),
        keys: keys.into_iter().chain(own).map(|(name, series, look)| Key { name: name.into(), series, look }).collect(),
        linked: false,
    }
}

fn said(row: &RangeRow) -> String {
    let unit = if row.unit == "1" { String::new() } else { format!(" {}", row.unit) };
    significant(row.value, 3) + &unit
}

fn own(row: &RangeRow) -> impl Iterator<Item = f64> {
    row.by_flight.iter().map(|(_, value)| *value)
}

fn ring(x: f64, y: f64, says: &str) -> String {
    let says = crate::report::escape::escape(says);
    format!("<circle class=\"h1\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"><title>{says}</title></circle>\n")
}

fn panel(effect: &str, rows: &[RangeRow]) -> Panel {
    let names = rows.iter().map(|row| row.name.chars().count().min(NAME)).max().unwrap_or(0) as f64 * CHARACTER + 18.0;
    let numbers = rows.iter().map(|row| said(row).chars().count()).max().unwrap_or(0) as f64 * CHARACTER + 12.0;
    let mut body = heading(effect, "");
    let mut data = Vec::new();
    for (place, row) in rows.iter().enumerate() {
        let top = 24.0 + STEP * place as f64;
        let (low, high) = ends(
            [0.0, row.value]
                .into_iter()
                .chain(row.usual.into_iter().flatten())
                .chain(row.ci95.into_iter().flatten())
                .chain(own(row)),
        );
        let room = 0.06 * (high - low);
        let (x, y) = (Scale::linear(low - room, high + room), Scale::linear(0.0, 1.0));
        let area = Area { left: names, top, width: WIDTH - names - numbers - RIGHT, height: STEP - 4.0, x, y };
        let middle = top + 0.5 * area.height;
        body += &words("va", "end", names - 6.0, middle + 4.0, &clipped(&row.name, NAME));
        if let Some([from, to]) = row.usual {
            let says = format!("usual: {from} to {to}");
            body += &rectangle("band", [area.at_x(from), top + 3.0, area.at_x(to) - area.at_x(from), area.height - 6.0], &says);
        }
        body += &line("gr", [area.left, middle], [area.left + area.width, middle]);
        body += &line("zero", [area.at_x(0.0), top + 2.0], [area.at_x(0.0), top + area.height - 2.0]);
        if let Some([from, to]) = row.ci95 {
            body += &line("wh", [area.at_x(from), middle], [area.at_x(to), middle]);
        }
        for (flight, value) in &row.by_flight {
            body += &ring(area.at_x(*value), middle, &format!("{flight}: {}", significant(*value, 3)));
            data.push(Datum { series: flight.clone(), x: row.name.clone(), y: *value, interval: None });
        }
        let outside = row.usual.is_some_and(|[from, to]| row.value < from || row.value > to);
        let usual = row.usual.map_or_else(String::new, |[from, to]| format!(", usual {from} to {to}"));
        body += &format!(
            "<circle class=\"{}\" cx=\"{:.1}\" cy=\"{middle:.1}\" r=\"4\"><title>{}: {}{usual}</title></circle>\n",
            if outside { "f2" } else { "f1" },
            area.at_x(row.value),
            crate::report::escape::escape(&row.name),
            crate::report::escape::escape(&said(row))
        );
        body += &words("va", "start", WIDTH - numbers - RIGHT + 8.0, middle + 4.0, &said(row));
        data.push(Datum { series: "found".into(), x: row.name.clone(), y: row.value, interval: row.ci95 });
        let of_band = |[from, to]: [f64; 2]| Datum {
            series: "usual".into(),
            x: row.name.clone(),
            y: 0.5 * (from + to),
            interval: Some([from, to]),
        };
        data.extend(row.usual.map(of_band));
    }
    let all: Vec<String> = rows
        .iter()
        .map(|row| {
            let usual = row.usual.map_or_else(|| "no usual range known".into(), |[from, to]| format!("usual {from} to {to}"));
            format!("{} {}, {usual}", row.name, said(row))
        })
        .collect();
    Panel { title: effect.to_owned(), says: format!("{}.", all.join("; ")), height: 30.0 + STEP * rows.len() as f64, body, data }
}

#[cfg(test)]
mod tests {
    use super::super::tests::well_formed;
    use super::*;

    #[test]
    fn a_number_outside_its_usual_range_looks_different() {
        let row = |value: f64, usual: Option<[f64; 2]>| RangeRow {
            name: "k".into(),
            unit: "1/m".into(),
            value,
            ci95: Some([0.4, 0.6]),
            usual,
            by_flight: vec![("a < b".into(), 0.7), ("c".into(), -0.2)],
        };
        let figure =
            ranges("t", "c", &[("drag".into(), vec![row(0.5, Some([0.1, 1.0])), row(0.5, Some([0.6, 1.0])), row(0.5, None)])]);
        let panel = &figure.panels[0];
        assert_eq!(well_formed(&figure.svg()), Ok(()));
        assert_eq!(
            ["circle class=\"f1\"", "circle class=\"f2\"", "class=\"band\"", "circle class=\"h1\""]
                .map(|what| panel.body.matches(what).count()),
            [2, 1, 2, 6]
        );
        assert_eq!(panel.data.len(), 11);
    }
}
