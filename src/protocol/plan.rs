//! The plan: which runs the tables need. A run is named by a hash of everything its outcome depends on, so that rows which are one
//! network (Residual Correction and Without PAF, w = 25 and Phy-Ture) are one run, and a file of another plan is never taken for one
//! of this.

use super::method::{Method, Predictor, method};
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::flight::Column;
use crate::hybrid::linear::LinearConfig;
use crate::train::TrainConfig;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;

/// Version of outcomes: raised whenever the same run would end in other numbers.
const OUTCOME_VERSION: u32 = 2;

/// Which part trains and which tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Division {
    /// The model file's division: the paper's random segments, unless the file locks flights or divides otherwise.
    Benchmark,
    /// One fold of the manoeuvre-class protocol, from 0.
    Fold(usize),
}

/// What is made worse on purpose, in the flights that train and in those that judge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Treatment {
    /// Nothing.
    Plain,
    /// Every calibrated coefficient is so many per cent too large.
    CoefficientsOff(u8),
    /// So many per cent of the training part's ten-second segments train.
    TrainingShare(u8),
    /// White noise on all state columns of all flights.
    StateNoise,
    /// White noise on the four controls of all flights.
    ControlNoise,
}

/// White noise on a column of the flights: that of a good attitude filter with satellite navigation, one standard deviation. Of a control: a
/// hundredth of its full deflection.
pub(super) const fn noise(column: Column) -> f64 {
    match column {
        Column::X | Column::Y | Column::Z | Column::Vx | Column::Vy | Column::Vz => 0.02,
        Column::Roll | Column::Pitch | Column::Yaw => 0.003,
        Column::U1 | Column::U2 | Column::U3 | Column::U4 | Column::Wx | Column::Wy | Column::Wz => 0.01,
        _ => 0.0,
    }
}

/// A table of the paper, or of ours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum TableId {
    /// Tables 1 to 6 of the paper.
    Paper(u8),
    /// Noise on the controls, wrong coefficients, less data.
    Robustness,
    /// Table 1 on flights with white noise on all states.
    Noise,
}

impl TableId {
    /// All tables.
    pub const ALL: [Self; 8] = [
        Self::Paper(1),
        Self::Paper(2),
        Self::Paper(3),
        Self::Paper(4),
        Self::Paper(5),
        Self::Paper(6),
        Self::Robustness,
        Self::Noise,
    ];
}

impl fmt::Display for TableId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Paper(number) => write!(f, "{number}"),
            Self::Robustness => f.write_str("robustness"),
            Self::Noise => f.write_str("noise"),
        }
    }
}

impl From<TableId> for String {
    fn from(table: TableId) -> Self {
        table.to_string()
    }
}

impl TryFrom<String> for TableId {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl FromStr for TableId {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|table| table.to_string() == text).ok_or_else(|| Error::Config {
            place: "benchmark".into(),
            field: "table".into(),
            found: format!("`{text}`"),
            expected: "1 to 6, `robustness` or `noise`".into(),
        })
    }
}

/// Rows of Tables 1 and 3: the paper's, then ours.
pub(super) const COMPARISON: &[&str] = &[
    "physical_baseline",
    "cnn",
    "cnn_lstm",
    "tcn",
    "timesnet",
    "timemixer",
    "dlinear",
    "informer",
    "phyture",
    "phyture_without_dropout",
    "phyture_linear",
    "backward_difference",
    "centred_difference",
    "ridge",
    "ridge_windows",
    "amended_physics",
    "phyture_amended",
    "floor",
];

/// Rows of the table on noisy flights: the networks that learned most where it was quiet, and what they have to beat.
pub(super) const NOISY: &[&str] = &[
    "physical_baseline",
    "cnn",
    "cnn_lstm",
    "timemixer",
    "dlinear",
    "phyture",
    "phyture_without_dropout",
    "phyture_linear",
    "backward_difference",
    "centred_difference",
    "ridge",
    "ridge_windows",
    "amended_physics",
    "floor",
];

/// Runs that come first, seed by seed: what trains nothing, then what the comparison is about.
const FIRST: [&str; 2] = ["phyture", "dlinear"];

/// Rows of Table 4.
pub(super) const ABLATION: &[&str] = &["without_paf", "without_mstfe", "without_tsdp_linear", "without_tsdp_last", "phyture"];

/// Rows of Table 5.
pub(super) const SWEEP: &[&str] = &["average_5", "average_15", "average_25", "average_35", "average_45"];

/// Rows of Table 6; the third is the paper's Residual Correction.
pub(super) const FUSION: &[&str] = &["state_control_only", "direct_concatenation", "without_paf", "phyture"];

/// Methods of the robustness table.
pub(super) const ROBUST: &[&str] = &["physical_baseline", "cnn_lstm", "phyture"];

/// Treatments of the robustness table. Noise on the states has a table of its own, with every yardstick in it.
pub(super) const TREATMENTS: &[Treatment] = &[
    Treatment::Plain,
    Treatment::ControlNoise,
    Treatment::CoefficientsOff(10),
    Treatment::CoefficientsOff(30),
    Treatment::TrainingShare(50),
    Treatment::TrainingShare(10),
];

/// One run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// Identifier of the method.
    pub method: String,
    /// Which part trains and which tests.
    pub division: Division,
    /// What is made worse.
    pub treatment: Treatment,
    /// Seed of weights, order and dropout; 0 for a method without any.
    pub seed: u64,
}

impl Run {
    /// The method.
    ///
    /// # Errors
    /// [`Error::Config`] if a file names one that there is not.
    pub fn method(&self) -> Result<&'static Method> {
        method(&self.method).ok_or_else(|| Error::Config {
            place: "plan".into(),
            field: "method".into(),
            found: format!("`{}`", self.method),
            expected: "a method of this version".into(),
        })
    }
}

impl fmt::Display for Run {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = method(&self.method).map_or(self.method.as_str(), |method| method.name);
        f.write_str(name)?;
        if let Division::Fold(fold) = self.division {
            write!(f, ", fold {}", fold + 1)?;
        }
        match self.treatment {
            Treatment::Plain => {}
            Treatment::CoefficientsOff(percent) => write!(f, ", coefficients {percent} % off")?,
            Treatment::TrainingShare(percent) => write!(f, ", {percent} % of the training data")?,
            Treatment::StateNoise => f.write_str(", noise on the states")?,
            Treatment::ControlNoise => f.write_str(", noise on the controls")?,
        }
        if self.seed > 0 { write!(f, ", seed {}", self.seed) } else { Ok(()) }
    }
}

/// Everything a set of tables depends on, but for the flights themselves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// SHA-256 of the data.
    pub data_sha256: String,
    /// Path of the data as it was given.
    pub data: String,
    /// The model file's text, not calibrated or calibrated: every division calibrates anew.
    pub model: String,
    /// Sampling step, s.
    pub step_s: f64,
    /// Manoeuvre classes held out in each fold; empty where there are fewer than two classes.
    pub folds: Vec<Vec<String>>,
    /// SHA-256 of the explainable part of the flights, where it is known, as of simulated ones: then there is a floor.
    pub explainable_sha256: Option<String>,
    /// What is wanted.
    pub tables: Vec<TableId>,
    /// Rows that are wanted, by method; all if empty.
    pub methods: Vec<String>,
    /// Sizes and budget.
    pub settings: Settings,
    /// Version of the program.
    pub version: String,
}

impl Plan {
    /// Runs of one method, one a seed; one alone where nothing is random.
    pub fn runs_of(&self, id: &str, division: Division, treatment: Treatment) -> Vec<Run> {
        let random = method(id).is_some_and(|method| matches!(method.predictor, Predictor::Network { .. }));
        let run = |seed: usize| Run { method: id.to_owned(), division, treatment, seed: seed as u64 };
        let seeds = if self.settings.one_seed.iter().any(|one| one == id) { 1 } else { self.settings.seeds };
        if random { (1..=seeds).map(run).collect() } else { vec![run(0)] }
    }

    /// Whether outcomes of the other plan are of use here: everything is the same but which tables, rows and how many seeds are wanted,
    /// and where the flights lie.
    pub fn continues(&self, other: &Self) -> bool {
        let Self { tables, methods, data, .. } = self.clone();
        let settings = Settings { seeds: self.settings.seeds, ..other.settings.clone() };
        *self == Self { tables, methods, data, settings, ..other.clone() }
    }

    /// What has been asked for in this plan or in another that it continues: tables and rows of both, and the larger number of seeds.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Self {
        let mut joined = self.clone();
        joined.tables =
            TableId::ALL.into_iter().filter(|table| self.tables.contains(table) || other.tables.contains(table)).collect();
        // No rows named is all rows.
        let all = self.methods.is_empty() || other.methods.is_empty();
        let more = other.methods.iter().filter(|method| !self.methods.contains(method));
        joined.methods = if all { Vec::new() } else { self.methods.iter().chain(more).cloned().collect() };
        joined.settings.seeds = self.settings.seeds.max(other.settings.seeds);
        joined
    }

    /// Checks that the rows wanted are rows.
    ///
    /// # Errors
    /// [`Error::Config`] with the identifiers there are.
    pub fn check(&self) -> Result<()> {
        if self.methods.iter().any(|id| id == "floor") && self.explainable_sha256.is_none() {
            return Err(Error::Config {
                place: "benchmark".into(),
                field: "method".into(),
                found: "`floor`".into(),
                expected: "the explainable part of the flights with it: --explainable DIR".into(),
            });
        }
        let unknown = self.methods.iter().find(|id| method(id).is_none());
        unknown.map_or(Ok(()), |id| {
            let known: Vec<&str> = super::METHODS.iter().map(|method| method.id).collect();
            let suggestion = crate::suggest::did_you_mean(id, known.iter().copied());
            Err(Error::Config {
                place: "benchmark".into(),
                field: "method".into(),
                found: format!("`{id}`"),
                expected: format!("one of {}{suggestion}", known.join(", ")),
            })
        })
    }

    /// Rows of a table that are wanted.
    pub(super) fn wanted<'i>(&self, ids: &'i [&'static str]) -> impl Iterator<Item = &'static str> + use<'i, '_> {
        let is_wanted = |id: &&str| self.methods.is_empty() || self.methods.iter().any(|method| method == id);
        let is_known = |id: &&str| *id != "floor" || self.explainable_sha256.is_some();
        ids.iter().copied().filter(move |id| is_wanted(id) && is_known(id))
    }

    /// Every run that the tables need, each once, seed by seed: what is there early is a whole comparison at few seeds.
    ///
    /// # Errors
    /// As [`Plan::key`].
    pub fn runs(&self) -> Result<Vec<Run>> {
        let mut all = Vec::new();
        for table in &self.tables {
            let plain = |ids: &'static [&'static str], division: Division| -> Vec<Run> {
                self.wanted(ids).flat_map(|id| self.runs_of(id, division, Treatment::Plain)).collect()
            };
            let noisy = |id| self.runs_of(id, Division::Benchmark, Treatment::StateNoise);
            all.extend(match table {
                TableId::Paper(1 | 2) => plain(COMPARISON, Division::Benchmark),
                TableId::Paper(3) => (0..self.folds.len()).flat_map(|fold| plain(COMPARISON, Division::Fold(fold))).collect(),
                TableId::Paper(4) => plain(ABLATION, Division::Benchmark),
                TableId::Paper(5) => plain(SWEEP, Division::Benchmark),
                TableId::Paper(_) => plain(FUSION, Division::Benchmark),
                TableId::Robustness => {
                    let treated = TREATMENTS.iter().flat_map(|&treatment| {
                        self.wanted(ROBUST).flat_map(move |id| self.runs_of(id, Division::Benchmark, treatment))
                    });
                    treated.collect()
                }
                TableId::Noise => self.wanted(NOISY).flat_map(noisy).collect(),
            });
        }
        // Stable: within a seed, what comes first and then the order of the tables.
        let place = |run: &Run| FIRST.iter().position(|id| *id == run.method).unwrap_or(FIRST.len());
        all.sort_by_key(|run| (run.seed, place(run)));
        let mut known = BTreeSet::new();
        let mut unique = Vec::new();
        for run in all {
            if known.insert(self.key(&run)?) {
                unique.push(run);
            }
        }
        Ok(unique)
    }

    /// The training configuration of a run at the plan's own learning rate; `None` for a method that trains nothing.
    ///
    /// # Errors
    /// [`Error::Config`] for an unknown method.
    pub fn training(&self, run: &Run) -> Result<Option<TrainConfig>> {
        let predictor = run.method()?.predictor;
        let network = predictor.network(self.settings.phyture()?);
        let plain = &self.settings.training;
        let linear = if predictor.has_linear_history() { Some(LinearConfig::default()) } else { plain.linear.clone() };
        Ok(network.map(|network| TrainConfig { network, linear, seed: run.seed, ..plain.clone() }))
    }

    /// Name of a run's outcome: the first 16 digits of the SHA-256 of data, model, division, treatment, configuration, seed and version.
    ///
    /// # Errors
    /// As [`Plan::training`].
    pub fn key(&self, run: &Run) -> Result<String> {
        #[derive(Serialize)]
        struct Everything<'a> {
            outcome_version: u32,
            version: &'a str,
            data_sha256: &'a str,
            model: &'a str,
            split_seed: u64,
            test_stride: usize,
            held_out: Option<&'a Vec<String>>,
            explainable_sha256: Option<&'a String>,
            rates: Option<(&'a [f64], usize)>,
            treatment: Treatment,
            history: usize,
            /// The predictor but for its network: what tells methods without one apart, and whether the loop comes first.
            predictor: String,
            training: Option<TrainConfig>,
        }
        let training = self.training(run)?;
        let predictor = run.method()?.predictor;
        let everything = Everything {
            outcome_version: OUTCOME_VERSION,
            version: &self.version,
            data_sha256: &self.data_sha256,
            model: &self.model,
            split_seed: self.settings.split_seed,
            test_stride: self.settings.test_stride,
            held_out: self.held_out(run.division),
            explainable_sha256: self.explainable_sha256.as_ref().filter(|_| run.method == "floor"),
            rates: training.as_ref().filter(|_| !self.settings.rates.is_empty()).map(|_| self.settings.rate_budget()),
            treatment: run.treatment,
            history: self.settings.phyture()?.history,
            predictor: if training.is_some() { format!("network, amended {}", predictor.amended()) } else { run.method.clone() },
            training,
        };
        hash(&everything)
    }

    /// Name of what the loop makes of the model for a run: the hash of what that depends on.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if a number of it is none.
    pub fn amended_key(&self, run: &Run) -> Result<String> {
        hash(&(
            "amended",
            OUTCOME_VERSION,
            &self.version,
            &self.data_sha256,
            &self.model,
            self.settings.split_seed,
            self.settings.chooses_on_validation(),
            self.held_out(run.division),
            run.treatment,
        ))
    }

    fn held_out(&self, division: Division) -> Option<&Vec<String>> {
        match division {
            Division::Benchmark => None,
            Division::Fold(fold) => self.folds.get(fold),
        }
    }

    /// The runs of shard `shard` of `shards`, from 1: every `shards`-th in the order of their keys, which is a random one. In the order
    /// of the plan the same method would fall to the same shard again and again.
    ///
    /// # Errors
    /// As [`Plan::runs`].
    pub fn shard(&self, shard: usize, shards: usize) -> Result<Vec<Run>> {
        let runs = self.runs()?;
        let mut keyed = runs.iter().map(|run| Ok((self.key(run)?, run))).collect::<Result<Vec<_>>>()?;
        keyed.sort_unstable_by(|left, right| left.0.cmp(&right.0));
        let mine: BTreeSet<&str> =
            keyed.iter().skip(shard.saturating_sub(1)).step_by(shards.max(1)).map(|(key, _)| key.as_str()).collect();
        let mut chosen = Vec::new();
        for run in &runs {
            if mine.contains(self.key(run)?.as_str()) {
                chosen.push(run.clone());
            }
        }
        Ok(chosen)
    }
}

/// The first 16 digits of the SHA-256 of something as compact JSON.
fn hash(everything: &impl Serialize) -> Result<String> {
    let text = serde_json::to_vec(everything).map_err(|error| Error::Undetermined(error.to_string()))?;
    Ok(Sha256::digest(text).iter().take(8).map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    pub(in crate::protocol) fn plan(tables: &[TableId]) -> Plan {
        Plan {
            data_sha256: "0".into(),
            data: "flights".into(),
            model: String::new(),
            step_s: 0.01,
            folds: vec![vec!["a".into()], vec!["b".into()]],
            explainable_sha256: Some("1".into()),
            tables: tables.into(),
            methods: Vec::new(),
            settings: Settings { seeds: 3, ..Settings::quick() },
            version: "test".into(),
        }
    }

    #[test]
    fn rows_that_are_one_network_are_one_run() -> Result<()> {
        let plan = plan(&TableId::ALL);
        let key =
            |id: &str| plan.key(&Run { method: id.into(), division: Division::Benchmark, treatment: Treatment::Plain, seed: 1 });
        assert_eq!(key("average_25")?, key("phyture")?);
        assert_ne!(key("average_15")?, key("phyture")?);
        assert_ne!(key("phyture_amended")?, key("phyture")?);
        let runs = plan.runs()?;
        let benchmark = |id: &str| {
            runs.iter()
                .filter(|run| run.method == id && run.division == Division::Benchmark && run.treatment == Treatment::Plain)
                .count()
        };
        assert_eq!((benchmark("without_paf"), benchmark("average_25"), benchmark("physical_baseline")), (3, 0, 1));
        Ok(())
    }

    #[test]
    fn every_input_of_a_run_changes_its_key() -> Result<()> {
        let (plan, run) =
            (plan(&TableId::ALL), Run { method: "tcn".into(), division: Division::Fold(0), treatment: Treatment::Plain, seed: 1 });
        let mut keys = BTreeSet::from([plan.key(&run)?]);
        let other_runs = [
            Run { seed: 2, ..run.clone() },
            Run { division: Division::Fold(1), ..run.clone() },
            Run { division: Division::Benchmark, ..run.clone() },
            Run { treatment: Treatment::TrainingShare(50), ..run.clone() },
            Run { treatment: Treatment::CoefficientsOff(10), ..run.clone() },
            Run { method: "dlinear".into(), ..run.clone() },
        ];
        for other in other_runs {
            assert!(keys.insert(plan.key(&other)?), "{other}");
        }
        let longer = TrainConfig { epochs: 3, ..plan.settings.training.clone() };
        let settings = &plan.settings;
        let other_plans = [
            Plan { data_sha256: "1".into(), ..plan.clone() },
            Plan { model: "m".into(), ..plan.clone() },
            Plan { version: "other".into(), ..plan.clone() },
            Plan { settings: Settings { test_stride: 7, ..settings.clone() }, ..plan.clone() },
            Plan { settings: Settings { split_seed: 7, ..settings.clone() }, ..plan.clone() },
            Plan { settings: Settings { training: longer, ..settings.clone() }, ..plan.clone() },
        ];
        for other in other_plans {
            assert!(keys.insert(other.key(&run)?));
        }
        let more_seeds = Plan { settings: Settings { seeds: 9, ..settings.clone() }, ..plan.clone() };
        assert!(!keys.insert(more_seeds.key(&run)?), "more seeds repeat no run");
        Ok(())
    }

    #[test]
    fn more_seeds_tables_and_rows_continue_a_plan_and_nothing_else_does() -> Result<()> {
        let first = Plan { methods: vec!["tcn".into()], ..plan(&[TableId::Paper(1)]) };
        let mut more = Plan { data: "elsewhere".into(), methods: Vec::new(), ..plan(&TableId::ALL) };
        more.settings.seeds = 10;
        assert!(more.continues(&first) && first.continues(&more));
        let keys = |plan: &Plan| plan.runs()?.iter().map(|run| plan.key(run)).collect::<Result<BTreeSet<_>>>();
        assert!(keys(&first)?.is_subset(&keys(&more)?));
        assert_eq!(first.runs()?.len(), 3, "one row, three seeds");
        assert_eq!(first.joined(&more).tables, more.tables);
        assert_eq!(keys(&first.joined(&more))?, keys(&more)?, "nothing that was asked for before is forgotten");
        let other = Plan { methods: vec!["cnn".into()], ..first.clone() };
        assert_eq!(other.joined(&first).methods, ["cnn", "tcn"]);
        more.settings.training.epochs += 1;
        assert!(!more.continues(&first));
        assert!(
            Plan { methods: vec!["timenet".into()], ..first }.check().is_err_and(|error| error.to_string().contains("`timesnet`?"))
        );
        Ok(())
    }

    proptest! {
        #[test]
        fn shards_are_a_partition(shards in 1_usize..9, tables in prop::sample::subsequence(TableId::ALL.to_vec(), 1..=8)) {
            let plan = plan(&tables);
            let mut found = Vec::new();
            for shard in 1..=shards {
                for run in plan.shard(shard, shards)? {
                    found.push(plan.key(&run)?);
                }
            }
            let mut all = plan.runs()?.iter().map(|run| plan.key(run)).collect::<Result<Vec<_>>>()?;
            found.sort_unstable();
            all.sort_unstable();
            prop_assert_eq!(found, all);
        }
    }

    #[test]
    fn no_shard_gets_one_method_alone() -> Result<()> {
        let plan = plan(&TableId::ALL);
        for shards in 2..=9 {
            for shard in 1..=shards {
                let methods: BTreeSet<String> = plan.shard(shard, shards)?.into_iter().map(|run| run.method).collect();
                assert!(methods.len() > 5, "shard {shard}/{shards} has {methods:?}");
            }
        }
        Ok(())
    }

    #[test]
    fn tables_are_named_as_on_the_command_line() -> Result<()> {
        for table in TableId::ALL {
            assert_eq!(table.to_string().parse::<TableId>()?, table);
        }
        assert!("7".parse::<TableId>().is_err_and(|error| error.to_string().contains("robustness")));
        Ok(())
    }
}
