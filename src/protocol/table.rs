//! Tables from outcomes: means and deviations over seeds. Arithmetic alone; how they are written is in `text`, what a run does in
//! `experiment`.

use super::cell::Cell;
use super::folder::Folder;
use super::lead::{Lead, lead};
use super::method::{Method, method};
use super::outcome::{Outcome, Segment, Sums, Trace};
use super::paper;
use super::plan::{ABLATION, COMPARISON, Division, FUSION, NOISY, Plan, ROBUST, Run, SWEEP, TREATMENTS, TableId, Treatment, noise};
use crate::critique::ChannelValues;
use crate::error::Result;
use crate::flight::{Channel, Column, PerChannel};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

impl TableRow {
    /// Name and, where it is not the RMSE, measure.
    pub fn title(&self) -> String {
        if self.measure == RMSE.0 { self.name.clone() } else { format!("{}, {}", self.name, self.measure) }
    }
}

impl Table {
    /// What a reader has to know of the rows, a sentence each.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> =
            self.rows.iter().filter_map(|row| Some(format!("{}: {}.", row.name, row.note.as_ref()?))).collect();
        notes.dedup();
        notes
    }
}

/// A row: six channels in the order of the targets, then their mean. The mean is taken seed by seed, so that its deviation is that of a
/// mean over channels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableRow {
    /// Identifier of the method.
    pub method: String,
    /// As it stands in the table.
    pub name: String,
    /// What is measured: `RMSE`, `MAE`, `MaxAE`.
    pub measure: &'static str,
    /// What the reader has to know.
    pub note: Option<String>,
    /// The figures; `None` while no seed is done.
    pub cells: [Option<Cell>; 7],
    /// Seeds that are done.
    pub seeds: usize,
    /// Seeds of the plan; 1 for a method without randomness.
    pub planned: usize,
    /// Whether it predicts at all.
    pub competes: bool,
    /// What the paper prints, with its deviations where it prints any.
    pub paper: Option<[Cell; 7]>,
}

/// A table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// Name of its files.
    pub id: String,
    /// Title.
    pub title: String,
    /// Rows in order.
    pub rows: Vec<TableRow>,
    /// Phy-Ture held against each other row.
    pub leads: Vec<Lead>,
}

/// The finished runs of a plan.
pub struct Finished {
    /// The plan.
    pub plan: Plan,
    /// Runs that are done, by key.
    outcomes: BTreeMap<String, Outcome>,
    /// Runs that are not.
    pub missing: Vec<Run>,
    /// Instruction sets that made them.
    pub instruction_sets: BTreeSet<String>,
}

/// The method that the others are held against.
const FRONT: &str = "phyture";

/// The networks that the paper compares it with.
const PEERS: &[&str] = &["cnn", "cnn_lstm", "tcn", "timesnet", "timemixer", "dlinear", "informer"];

/// Whether a method predicts at all: the zero-phase difference looks ahead, and the floor knows the truth.
fn competes(id: &str) -> bool {
    !["centred_difference", "floor"].contains(&id)
}

/// One measure of the sums of errors.
type Measure = (&'static str, fn(&Sums) -> ChannelValues);
const RMSE: Measure = ("RMSE", Sums::rmse);

impl Finished {
    /// Reads what is done of a folder's plan.
    ///
    /// # Errors
    /// What reading gives.
    pub fn read(folder: &Folder) -> Result<Self> {
        let plan = folder.plan()?;
        let (mut outcomes, mut missing, mut instruction_sets) = (BTreeMap::new(), Vec::new(), BTreeSet::new());
        for run in plan.runs()? {
            match folder.outcome(&plan, &run)? {
                Some((outcome, instruction_set)) => {
                    instruction_sets.insert(instruction_set);
                    outcomes.insert(plan.key(&run)?, outcome);
                }
                None => missing.push(run),
            }
        }
        Ok(Self { plan, outcomes, missing, instruction_sets })
    }

    /// The outcome of a run, if it is done.
    pub fn outcome(&self, run: &Run) -> Option<&Outcome> {
        self.outcomes.get(&self.plan.key(run).ok()?)
    }

    /// Runs that are done.
    pub fn done(&self) -> usize {
        self.outcomes.len()
    }

    /// Finished outcomes of a method on the benchmark division, one a seed.
    pub fn seeds(&self, id: &str, treatment: Treatment) -> Vec<&Outcome> {
        let runs = self.plan.runs_of(id, Division::Benchmark, treatment);
        runs.iter().filter_map(|run| self.outcome(run)).collect()
    }

    /// Every network that was trained on the benchmark division as it is, with its outcomes, one a seed.
    pub fn trained(&self) -> Vec<(&'static Method, Vec<&Outcome>)> {
        let one = |method: &'static Method| {
            let outcomes = self.seeds(method.id, Treatment::Plain);
            (outcomes.first().is_some_and(|outcome| outcome.epoch > 0)).then_some((method, outcomes))
        };
        self.plan.wanted(COMPARISON).filter_map(method).filter_map(one).collect()
    }

    /// The stretch of test flight that every method of Table 1 was drawn on; of a network with several seeds, the first.
    pub fn traces(&self) -> impl Iterator<Item = (&'static Method, &Trace)> {
        let trace = move |id: &&'static str| {
            let outcome = self.seeds(id, Treatment::Plain).into_iter().next()?;
            Some((method(id)?, outcome.trace.as_ref()?))
        };
        COMPARISON.iter().filter_map(trace)
    }

    /// Every table of the plan.
    pub fn tables(&self) -> Vec<Table> {
        let mut tables = Vec::new();
        for table in &self.plan.tables {
            match table {
                TableId::Paper(1) => tables.push(self.plain(1, "RMSE of every method, benchmark division", COMPARISON)),
                TableId::Noise => tables.push(self.noisy()),
                TableId::Paper(2) => tables.extend(self.worst_case()),
                TableId::Paper(3) => tables.extend(self.folds()),
                TableId::Paper(4) => tables.push(self.plain(4, "RMSE without one module each", ABLATION)),
                TableId::Paper(5) => tables.push(self.plain(5, "RMSE by width w of the moving average", SWEEP)),
                TableId::Paper(number) => tables.push(self.fusion(*number)),
                TableId::Robustness => tables.push(self.robustness()),
            }
        }
        tables
    }

    fn plain(&self, number: u8, title: &str, ids: &[&'static str]) -> Table {
        let rows = self.plan.wanted(ids).filter_map(method).map(|method| {
            let mut row = self.row(method, Treatment::Plain, RMSE);
            row.paper = paper::printed(number, method.id);
            row
        });
        let leads = self.leads(ids, Treatment::Plain);
        Table { id: format!("table{number}"), title: title.into(), rows: rows.collect(), leads }
    }

    /// Table 1 where white noise is on the states that train and on those that are judged.
    fn noisy(&self) -> Table {
        let rows = self.plan.wanted(NOISY).filter_map(method).map(|method| self.row(method, Treatment::StateNoise, RMSE));
        let sizes = [Column::X, Column::Vx, Column::Roll, Column::Wx].map(|column| format!("{} {}", noise(column), column.unit()));
        let title = format!("RMSE with white noise on the states of all flights, training and test: {}", sizes.join(", "));
        Table { id: "noise".into(), title, rows: rows.collect(), leads: self.leads(NOISY, Treatment::StateNoise) }
    }

    /// Phy-Ture held against each other method that has a run, under one treatment.
    fn leads(&self, ids: &[&'static str], treatment: Treatment) -> Vec<Lead> {
        let of = self.seeds(FRONT, treatment);
        let others = self.plan.wanted(ids).filter_map(method).filter(|method| method.id != FRONT && competes(method.id));
        let one = |method: &Method| {
            let over = self.seeds(method.id, treatment);
            let is_same = of.first().zip(over.first()).is_some_and(|(one, other)| std::ptr::eq(*one, *other));
            let (percent, percent_ci95) = lead(&of, &over).filter(|_| !is_same)?;
            Some(Lead { of: FRONT.into(), over: method.id.into(), over_name: method.name.into(), percent, percent_ci95 })
        };
        others.filter_map(one).collect()
    }

    /// A method on the benchmark division.
    fn row(&self, method: &Method, treatment: Treatment, measure: Measure) -> TableRow {
        let outcomes = self.seeds(method.id, treatment);
        let found: Vec<ChannelValues> = outcomes.iter().map(|outcome| measure.1(&Sums::of(&outcome.segments))).collect();
        let planned = self.plan.runs_of(method.id, Division::Benchmark, treatment).len();
        let effects = outcomes.first().filter(|_| method.predictor.amended()).map(|outcome| &outcome.effects);
        row(method, measure.0, &found, planned, effects)
    }

    /// Phy-Ture held against another method.
    pub fn lead_over(&self, id: &'static str, treatment: Treatment) -> Option<Lead> {
        self.leads(&[id], treatment).pop()
    }

    /// Phy-Ture held against the best of the peer networks, by mean error, as the flights are and with noise on the states.
    pub fn over_best_peer(&self, treatment: Treatment) -> Option<Lead> {
        let peers = self.leads(PEERS, treatment).into_iter();
        peers.min_by(|one, other| one.percent.total_cmp(&other.percent))
    }

    /// Table 6: its third row is a row of Table 4 under another name.
    fn fusion(&self, number: u8) -> Table {
        let mut table = self.plain(number, "RMSE by the way physics enters", FUSION);
        for row in table.rows.iter_mut().filter(|row| row.method == "without_paf") {
            "Residual Correction".clone_into(&mut row.name);
            row.note = Some("the same run as Without PAF".into());
        }
        table
    }

    /// Table 2: the paper's two methods, and the best of the others in our Table 1 where that is another. `None` until Phy-Ture and one other have a
    /// run.
    fn worst_case(&self) -> Option<Table> {
        let rivals = self.plan.wanted(COMPARISON).filter(|id| *id != FRONT && paper::printed(1, id).is_some());
        let mean = |id: &'static str| Some((id, self.row(method(id)?, Treatment::Plain, RMSE).cells[6]?.mean));
        let (strongest, _) = rivals.filter_map(mean).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let measures: [Measure; 2] = [("MAE", Sums::mae), ("MaxAE", Sums::max_abs)];
        let papers = self.plan.wanted(COMPARISON).filter(|id| *id != strongest && paper::printed_worst(id, "MAE").is_some());
        let mut rows: Vec<TableRow> = Vec::new();
        for method in [strongest].into_iter().chain(papers).filter_map(method) {
            for measure in measures {
                let mut row = self.row(method, Treatment::Plain, measure);
                row.paper = paper::printed_worst(method.id, measure.0);
                rows.push(row);
            }
        }
        let title = "MAE and MaxAE of the paper's two methods and of the strongest peer of Table 1".into();
        Some(Table { id: "table2".into(), title, rows, leads: Vec::new() })
    }

    /// Table 3 twice: squared errors pooled over the folds, and the mean of the folds' errors.
    fn folds(&self) -> [Table; 2] {
        let pooled = |segments: &[Vec<Segment>]| Sums::of(segments.iter().flatten()).rmse();
        let averaged = |segments: &[Vec<Segment>]| {
            let errors: Vec<ChannelValues> = segments.iter().map(|fold| Sums::of(fold).rmse()).collect();
            let mean = |channel: Channel| {
                let values: Option<Vec<f64>> = errors.iter().map(|error| error.channels()[channel]).collect();
                values.filter(|values| !values.is_empty()).map(|values| values.iter().sum::<f64>() / values.len() as f64)
            };
            ChannelValues::new(PerChannel::from_fn(mean))
        };
        let table = |id: &str, title: &str, combine: &dyn Fn(&[Vec<Segment>]) -> ChannelValues, printed: bool| {
            let rows = self.plan.wanted(COMPARISON).filter_map(method).map(|method| {
                let (found, planned) = self.over_folds(method, combine);
                let mut row = row(method, "RMSE", &found, planned, None);
                row.paper = paper::printed(3, method.id).filter(|_| printed);
                row
            });
            Table { id: id.into(), title: title.into(), rows: rows.collect(), leads: Vec::new() }
        };
        let count = self.plan.folds.len();
        [
            table("table3", &format!("RMSE on manoeuvre classes held out, {count} folds, squared errors pooled"), &pooled, true),
            table("table3_fold_mean", &format!("RMSE on manoeuvre classes held out, mean of {count} folds"), &averaged, false),
        ]
    }

    /// One figure a seed of which all folds are done, and the seeds planned.
    fn over_folds(&self, method: &Method, combine: &dyn Fn(&[Vec<Segment>]) -> ChannelValues) -> (Vec<ChannelValues>, usize) {
        let folds: Vec<Vec<Run>> =
            (0..self.plan.folds.len()).map(|fold| self.plan.runs_of(method.id, Division::Fold(fold), Treatment::Plain)).collect();
        let planned = folds.first().map_or(0, Vec::len);
        let of_seed = |seed: usize| {
            let of_fold = |runs: &Vec<Run>| Some(self.outcome(runs.get(seed)?)?.segments.clone());
            let folds: Option<Vec<Vec<Segment>>> = folds.iter().map(of_fold).collect();
            folds.map(|folds| combine(&folds))
        };
        ((0..planned).filter_map(of_seed).collect(), planned)
    }

    fn robustness(&self) -> Table {
        let mut rows = Vec::new();
        for method in self.plan.wanted(ROBUST).filter_map(method) {
            for &treatment in TREATMENTS {
                let words = match treatment {
                    Treatment::Plain => "as recorded".into(),
                    Treatment::CoefficientsOff(percent) => format!("coefficients {percent} % too large"),
                    Treatment::TrainingShare(percent) => format!("{percent} % of the training data"),
                    Treatment::StateNoise => "noise on the states".into(),
                    Treatment::ControlNoise => "noise on the controls".into(),
                };
                let mut row = self.row(method, treatment, RMSE);
                row.name = format!("{}, {words}", method.name);
                rows.push(row);
            }
        }
        let title =
            format!("RMSE with white noise of {} on the controls of all flights, wrong coefficients, less data", noise(Column::U1));
        Table { id: "robustness".into(), title, rows, leads: Vec::new() }
    }

    /// Mean RMSE over the seeds of every method of Table 1 on every part of the test flights that `part` names (Figure 6 and the errors by
    /// manoeuvre). Parts are in the order of their names, methods in the order of the table.
    pub fn by_part(&self, part: impl Fn(&Segment) -> String) -> BTreeMap<String, Vec<(&'static Method, ChannelValues)>> {
        let mut parts: BTreeMap<String, Vec<(&'static Method, ChannelValues)>> = BTreeMap::new();
        for method in self.plan.wanted(COMPARISON).filter_map(method) {
            let mut errors: BTreeMap<String, Vec<ChannelValues>> = BTreeMap::new();
            for outcome in self.seeds(method.id, Treatment::Plain) {
                let mut groups: BTreeMap<String, Vec<&Segment>> = BTreeMap::new();
                for segment in &outcome.segments {
                    groups.entry(part(segment)).or_default().push(segment);
                }
                for (name, group) in groups {
                    errors.entry(name).or_default().push(Sums::of(group).rmse());
                }
            }
            for (name, errors) in errors {
                let [channels @ .., _] = cells(&errors).map(|cell| cell.map(|cell| cell.mean));
                parts.entry(name).or_default().push((method, ChannelValues::new(channels.into())));
            }
        }
        parts
    }
}

/// Six channels and their mean, over seeds.
fn cells(found: &[ChannelValues]) -> [Option<Cell>; 7] {
    std::array::from_fn(|column| {
        let value = |errors: &ChannelValues| Channel::from_index(column).map_or(errors.mean, |channel| errors.channels()[channel]);
        let values: Option<Vec<f64>> = found.iter().map(value).collect();
        Cell::of(&values?)
    })
}

fn row(method: &Method, measure: &'static str, found: &[ChannelValues], planned: usize, effects: Option<&Vec<String>>) -> TableRow {
    let added =
        effects.map(|effects| if effects.is_empty() { "added: nothing".into() } else { format!("added: {}", effects.join(", ")) });
    let note = [method.note.map(str::to_owned), added].into_iter().flatten().collect::<Vec<_>>().join("; ");
    TableRow {
        method: method.id.into(),
        name: method.name.into(),
        measure,
        note: (!note.is_empty()).then_some(note),
        cells: cells(found),
        seeds: found.len(),
        planned,
        competes: competes(method.id),
        paper: None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::plan::tests::plan;
    use super::*;
    use phyture_kernels::Tolerance;

    /// Errors that are known: `scale` times the seed in flight a, twice that in flight b, which has three windows.
    fn outcome(run: &Run, scale: f64) -> Outcome {
        let error = scale * (run.seed.max(1) as f64);
        let segment = |flight: &str, windows: usize, error: f64| Segment {
            flight: flight.into(),
            manoeuvre: flight.into(),
            start_s: 0.0,
            windows,
            squares: PerChannel::splat(error * error * windows as f64),
            absolutes: PerChannel::splat(error * windows as f64),
            largest: PerChannel::splat(error),
        };
        let segments = vec![segment("a", 1, error), segment("b", 3, 2.0 * error)];
        Outcome {
            run: run.clone(),
            parameters: 0,
            training_windows: 0,
            steps: 0,
            effects: vec!["drag".into()],
            peak_rate: None,
            curve: Vec::new(),
            epoch: 0,
            segments,
            trace: None,
        }
    }

    fn finished(tables: &[TableId], scale: impl Fn(&Run) -> Option<f64>) -> Result<Finished> {
        let plan = plan(tables);
        let (mut outcomes, mut missing) = (BTreeMap::new(), Vec::new());
        for run in plan.runs()? {
            match scale(&run) {
                Some(scale) => {
                    outcomes.insert(plan.key(&run)?, outcome(&run, scale));
                }
                None => missing.push(run),
            }
        }
        Ok(Finished { plan, outcomes, missing, instruction_sets: BTreeSet::new() })
    }

    fn close(found: Option<Cell>, mean: f64, deviation: Option<f64>) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() <= Tolerance::Close.relative_f64() * b.abs();
        found.is_some_and(|cell| {
            near(cell.mean, mean)
                && cell.deviation.is_some() == deviation.is_some()
                && near(cell.deviation.unwrap_or(0.0), deviation.unwrap_or(0.0))
        })
    }

    #[test]
    fn a_row_is_the_mean_over_seeds_of_the_error_of_each() -> Result<()> {
        let finished = finished(&[TableId::Paper(1)], |_| Some(1.0))?;
        let table = &finished.tables()[0];
        // √((1 + 3·4)/4) for seed 1, twice and three times that for the others.
        let one = (13.0_f64 / 4.0).sqrt();
        let phyture = table.rows.iter().find(|row| row.method == "phyture");
        assert!(phyture.is_some_and(|row| row.seeds == 3 && row.cells.iter().all(|cell| close(*cell, 2.0 * one, Some(one)))));
        let physics = table.rows.iter().find(|row| row.method == "physical_baseline");
        assert!(physics.is_some_and(|row| row.planned == 1 && close(row.cells[0], one, None) && row.paper.is_some()));
        let amended = table.rows.iter().find(|row| row.method == "amended_physics");
        assert!(amended.and_then(|row| row.note.clone()).is_some_and(|note| note.ends_with("added: drag")));
        Ok(())
    }

    #[test]
    fn table_2_has_the_papers_rows_and_the_strongest_of_its_methods() -> Result<()> {
        let finished = finished(&[TableId::Paper(2)], |run| {
            Some(match run.method.as_str() {
                "tcn" => 0.25,
                "ridge" | "phyture_amended" => 0.1,
                _ => 1.0,
            })
        })?;
        let rows = &finished.tables()[0].rows;
        assert_eq!(
            rows.iter().map(|row| (row.method.as_str(), row.measure)).collect::<Vec<_>>(),
            ["tcn", "cnn_lstm", "phyture"].map(|id| [(id, "MAE"), (id, "MaxAE")]).as_flattened()
        );
        assert!(close(rows[1].cells[0], 1.0, Some(0.5)), "largest errors are 2·0.25·seed");
        Ok(())
    }

    #[test]
    fn folds_are_pooled_and_averaged_and_a_seed_with_a_fold_missing_does_not_count() -> Result<()> {
        let finished = finished(&[TableId::Paper(3)], |run| match run.division {
            Division::Fold(1) if run.seed == 3 => None,
            Division::Fold(1) => Some(3.0),
            _ => Some(1.0),
        })?;
        let [pooled, averaged] = finished.folds();
        let find = |table: &Table| table.rows.iter().find(|row| row.method == "tcn").cloned();
        let (Some(pooled), Some(averaged)) = (find(&pooled), find(&averaged)) else { panic!("no row of the TCN") };
        assert_eq!((pooled.seeds, pooled.planned, finished.missing.is_empty()), (2, 3, false));
        let one = (13.0_f64 / 4.0).sqrt();
        let (both, mean) = (one * 5.0_f64.sqrt(), 2.0 * one);
        assert!(close(pooled.cells[6], 1.5 * both, Some(both * 0.5_f64.sqrt())));
        assert!(close(averaged.cells[6], 1.5 * mean, Some(mean * 0.5_f64.sqrt())));
        Ok(())
    }

    #[test]
    fn what_is_not_done_is_empty_and_every_table_has_its_rows() -> Result<()> {
        let nothing = finished(&TableId::ALL, |_| None)?;
        assert!(nothing.tables().iter().flat_map(|table| &table.rows).all(|row| row.seeds == 0 && row.cells == [None; 7]));
        let all = finished(&TableId::ALL, |_| Some(1.0))?;
        let names: Vec<String> = all.tables().into_iter().map(|table| table.id).collect();
        assert_eq!(names, ["table1", "table2", "table3", "table3_fold_mean", "table4", "table5", "table6", "robustness", "noise"]);
        let tables = all.tables();
        let residual = tables[6].rows.iter().find(|row| row.name == "Residual Correction");
        let without = tables[4].rows.iter().find(|row| row.name == "Without PAF");
        assert_eq!(residual.map(|row| row.cells), without.map(|row| row.cells));
        let over: Vec<&str> = tables[0].leads.iter().map(|lead| lead.over.as_str()).collect();
        assert!(over.contains(&"ridge") && !over.contains(&"floor") && !over.contains(&"phyture"), "{over:?}");
        assert!(tables[5].leads.iter().all(|lead| lead.over != "average_25"), "it is the same run");
        Ok(())
    }

    #[test]
    fn errors_by_manoeuvre_are_means_over_seeds() -> Result<()> {
        let finished = finished(&[TableId::Paper(1)], |_| Some(1.0))?;
        let parts = finished.by_part(|segment| segment.manoeuvre.clone());
        assert_eq!(parts.keys().collect::<Vec<_>>(), ["a", "b"]);
        assert!(parts.values().all(|methods| methods.len() == COMPARISON.len()));
        let tcn = parts["b"].iter().find(|(method, _)| method.id == "tcn");
        assert!(tcn.is_some_and(|(_, error)| close(Cell::of(&[error.vx_dot.unwrap_or_default()]), 4.0, None)));
        Ok(())
    }
}
