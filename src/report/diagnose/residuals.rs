//! What is left against recorded variables, one and two at a time, before and after.

use super::super::compare::{VARIABLES, shares_map};
use super::super::figures::{self, BinnedPanel, with_unit};
use super::super::names::{named, said};
use super::super::page::Part;
use super::views::{NO_TABLE, Seen, text};
use crate::critique::change::{Dependences, change, telling};
use crate::critique::locate::{Dependence, Variable, dependences};
use crate::critique::residual_views::{informative_pair, surface};
use crate::error::Result;
use crate::flight::{Channel, Window};
use crate::physics::Effect;

/// Share of a residual that the darkest shade stands for at least: below it all is noise.
const LEAST_DARKEST: f64 = 0.1;
impl Seen<'_> {
    /// Against each variable.
    pub fn binned(&self) -> Result<Vec<Part>> {
        let report = self.report;
        let (windows, _) = self.windows(report.searched);
        let of_side = |side| dependences(report.flights, &windows, &self.row(side, &windows), &Variable::ALL);
        let found: Vec<Dependences> = self.sides.iter().map(of_side).collect::<Result<_>>()?;
        let Some(before) = found.first().filter(|found| !found.is_empty()) else {
            return Ok(vec![text("No recorded variable varies in these flights.")]);
        };
        let after = found.get(1);
        let change = self.change(&windows)?;
        let mut parts = vec![text(
            "The residual is measured − predicted, on the searched flights. With all the physics in the model it goes with nothing: \
             every interval holds zero. Hollow points rest on fewer than five blocks of ten seconds and say little.",
        )];
        if after.is_some() {
            parts.push(text(
                "The dashed line is the change of the whole prediction from the model before to the model after: what was added, and how the \
                 numbers that were there moved with it. Where it runs through the points, nothing is left.",
            ));
        }
        let full = found.iter().flatten().flat_map(|(_, of)| of.iter().map(|one| one.share)).fold(LEAST_DARKEST, f64::max);
        let (whose, now) = match after {
            Some(after) => ("model before (left) and after (right)", after),
            None => ("model", before),
        };
        let caption = format!("Share of the residual of the {whose} that goes with one variable alone");
        parts.push(shares_map(&caption, now, after.map(|_| before.as_slice()), Some(full)));
        let mut quiet = Vec::new();
        for channel in Channel::ALL {
            let shown = telling(before, channel, &self.added(channel).collect::<Vec<_>>(), VARIABLES);
            if shown.is_empty() {
                quiet.push(said(channel.name()));
                continue;
            }
            let of = |found: &'_ Dependences, variable: Variable| {
                found.iter().find(|(other, _)| *other == variable).map(|(_, of)| of[channel].clone())
            };
            let names: Vec<String> = shown.iter().map(|variable| named(variable.name())).collect();
            let drawn: Vec<_> =
                shown.iter().map(|variable| [Some(before), after, change.as_ref()].map(|found| of(found?, *variable))).collect();
            let panel = |((variable, name), [before, after, change]): ((&Variable, &'_ String), &'_ [Option<Dependence>; 3])| {
                Some((name.clone(), variable.unit(), before.clone()?, after.clone(), change.clone()))
            };
            let drawn: Vec<_> = shown.iter().zip(&names).zip(&drawn).filter_map(panel).collect();
            let panels: Vec<BinnedPanel<'_>> = drawn
                .iter()
                .map(|(variable, unit, dependence, after, change)| BinnedPanel {
                    variable,
                    unit,
                    dependence,
                    change: change.as_ref(),
                    after: after.as_ref(),
                })
                .collect();
            let title = format!("Residual of {}", named(channel.name()));
            parts.push(Part::Figure(figures::binned(&title, "", channel.unit(), &panels)));
        }
        if !quiet.is_empty() {
            parts.push(Part::Text(format!("No variable accounts for 1 % of the residual of {}.", quiet.join(", "))));
        }
        Ok(parts)
    }

    /// How the prediction changes from the model before to the model after, binned as a residual is.
    fn change(&self, windows: &[Window]) -> Result<Option<Dependences>> {
        let [before, after] = self.sides.as_slice() else { return Ok(None) };
        let rows = [&self.row(before, windows), &self.row(after, windows)];
        change(self.report.flights, windows, rows, &Variable::ALL).map(Some)
    }

    /// Added effects that act in a channel.
    fn added(&self, channel: Channel) -> impl Iterator<Item = &Effect> {
        let acts = move |index: usize| self.report.after.acts(index).is_ok_and(|acts| acts[channel]);
        self.report.added().filter(move |(index, _)| acts(*index)).map(|(_, effect)| effect)
    }

    /// Over two variables.
    pub fn surface(&self) -> Result<Vec<Part>> {
        let Some(table) = self.table() else { return Ok(vec![text(NO_TABLE)]) };
        let mut best = None;
        for channel in Channel::ALL {
            let Some(pair) = informative_pair(table, channel)? else { continue };
            let Some(found) = surface(table, channel, [&pair[0], &pair[1]])? else { continue };
            if best.as_ref().is_none_or(|(_, share, _)| found.share > *share) {
                best = Some((channel, found.share, pair));
            }
        }
        let Some((channel, _, pair)) = best else { return Ok(vec![text("Fewer than two recorded variables vary.")]) };
        let mut found = Vec::new();
        for side in &self.sides {
            let of = side.table.as_ref().map(|table| surface(table, channel, [&pair[0], &pair[1]])).transpose()?.flatten();
            found.extend(of.map(|of| (format!("{} (η² {:.0} %)", side.name, 100.0 * of.share), of)));
        }
        let axis = |name: &String| {
            let unit = table.names.iter().position(|known| known == name).and_then(|index| table.units.get(index));
            with_unit(&named(name), unit.map_or("1", String::as_str))
        };
        let [x, y] = [axis(&pair[0]), axis(&pair[1])];
        let panels: Vec<_> = found.iter().map(|(title, of)| (title.clone(), of)).collect();
        let title = format!("Residual of {} over {} and {}", named(channel.name()), pair[0], pair[1]);
        let caption = "The channel and the two variables with which the residual goes most. Stripes along one axis: one variable is \
                       enough; a checked pattern: their product matters. Both panels have one colour scale.";
        let note = "A choice of axes, not a finding: in pure noise these are the two that go with it by chance, and so many cells take \
                    some per cent of any noise.";
        Ok(vec![Part::Figure(figures::surfaces(&title, caption, channel.unit(), [&x, &y], &panels)), text(note)])
    }
}
