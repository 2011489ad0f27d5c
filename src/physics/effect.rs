//! An effect: one named piece of physics, as terms and changes of signals in the formula grammar. Data only; how effects are put together is
//! in `compose`.

use crate::error::{Error, Result};
use crate::flight::Channel;
use crate::flight::names::matching;
use crate::formula::{Formula, Shared, shared};
use std::collections::BTreeMap;
use std::fmt;

/// Kind of the effects that a user writes as a formula.
pub const FORMULA_KIND: &str = "formula";

/// Name of the coefficient of a [`FORMULA_KIND`] effect.
pub const FORMULA_COEFFICIENT: &str = "coefficient";

/// One summand of one predicted acceleration: `coefficient * regressor`.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Term {
    /// The acceleration it adds to.
    pub channel: Channel,
    /// Name of the coefficient; `None` stands for a fixed 1, known from first principles. Terms that name the same coefficient
    /// of an effect share it, also across channels.
    pub coefficient: Option<String>,
    /// What is multiplied.
    pub regressor: Formula,
}

/// A number that calibration finds.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Coefficient {
    /// Name, unique in its effect.
    pub name: String,
    /// Value, in [`Coefficient::unit`].
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// 95 % confidence interval of the last calibration.
    pub ci95: Option<[f64; 2]>,
    /// What it stands for, in a few words.
    pub meaning: String,
    /// For a property of each flight (wind, bias): its value by name of the flight, or the last part of that where only one flight has it;
    /// `value` is then what other flights get.
    pub by_flight: Option<BTreeMap<String, f64>>,
}

impl Coefficient {
    /// The value in a flight. [`Model::check_flights`](super::Model::check_flights) refuses names that could mean several.
    pub fn in_flight(&self, flight: &str) -> f64 {
        self.own_in_flight(flight).unwrap_or(self.value)
    }

    /// The value that a flight has for itself, if the coefficient knows it.
    pub fn own_in_flight(&self, flight: &str) -> Option<f64> {
        let values = self.by_flight.as_ref()?;
        let of_one = || match matching(flight, values.keys().map(String::as_str)).as_slice() {
            [name] => values.get(*name),
            _ => None,
        };
        values.get(flight).or_else(of_one).copied()
    }
}

/// A number inside a formula: geometry, which is known, or a time constant, which calibration finds.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Parameter {
    /// Name under which the formulas of the effect use it.
    pub name: String,
    /// Value, in [`Parameter::unit`].
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Known beforehand (geometry), as against found by a search or a calibration.
    pub fixed: bool,
    /// 95 % confidence interval of the last calibration.
    #[serde(default)]
    pub ci95: Option<[f64; 2]>,
}

impl Parameter {
    /// As a number that calibration finds.
    pub(super) fn as_coefficient(&self) -> Coefficient {
        Coefficient {
            name: self.name.clone(),
            value: self.value,
            unit: self.unit.clone(),
            ci95: self.ci95,
            meaning: String::new(),
            by_flight: None,
        }
    }
}

/// A change to a [signal](super::SIGNALS) that the other effects read: a servo lag makes `lag(u1, tau_s)` of `u1`, a ground effect
/// `thrust * (1 + k * …)` of `thrust`. The formula may read the coefficients of its effect.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Swap {
    /// The signal or quantity that is changed.
    pub name: String,
    /// What it becomes; all changes of one effect are made from what was before.
    pub with: Formula,
    /// Names of the effects it changes; empty means all.
    pub within: Vec<String>,
}

/// One named piece of physics.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Effect {
    /// What it is: a built-in kind, or [`FORMULA_KIND`].
    pub kind: String,
    /// Name, unique in its model; the kind, unless given.
    pub name: String,
    /// The physics in one sentence.
    pub meaning: String,
    /// Summands.
    pub terms: Vec<Term>,
    /// Numbers that calibration finds.
    pub coefficients: Vec<Coefficient>,
    /// Numbers inside the formulas: geometry, which is known, and shapes and times, which calibration finds.
    pub parameters: Vec<Parameter>,
    /// Changes to the signals that other effects read.
    pub swaps: Vec<Swap>,
    /// Whether it takes part.
    pub enabled: bool,
    /// What put it into the model, if not a person.
    pub added_by: Option<String>,
}

impl Effect {
    /// A user's own effect: one term `coefficient * formula` on one acceleration.
    ///
    /// # Errors
    /// [`Error::Formula`] if the text is no formula.
    pub fn formula(name: impl Into<String>, channel: Channel, formula: &str, value: f64) -> Result<Self> {
        let unit = channel.unit();
        let term = Term { channel, coefficient: Some(FORMULA_COEFFICIENT.into()), regressor: Formula::parse(formula)? };
        Ok(Self { terms: vec![term], ..Self::own(name.into(), unit, value) })
    }

    /// A user's own effect that adds `coefficient * formula` to a [signal](super::SIGNALS): whatever reads the signal sees it.
    ///
    /// ```
    /// use phyture::physics::Effect;
    /// let gusty_head = Effect::change("blade_twist", "thrust", "thrust * hypot(air_vx, air_vy)", 0.01)?;
    /// assert_eq!(gusty_head.to_string(), "thrust := thrust + 0.01 * (thrust * hypot(air_vx, air_vy))");
    /// # Ok::<(), phyture::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Formula`] if the text is no formula.
    pub fn change(name: impl Into<String>, signal: &str, formula: &str, value: f64) -> Result<Self> {
        let unit = super::signal_named(signal).map_or("1", |signal| signal.unit);
        let formula = Formula::parse(formula)?;
        let with = Formula::parse(&format!("{signal} + {FORMULA_COEFFICIENT} * ({formula})"))?;
        Ok(Self { swaps: vec![Swap { name: signal.into(), with, within: Vec::new() }], ..Self::own(name.into(), unit, value) })
    }

    /// A user's own effect without a formula yet.
    fn own(name: String, unit: &str, value: f64) -> Self {
        Self {
            kind: FORMULA_KIND.into(),
            name,
            meaning: "a formula of the user".into(),
            terms: Vec::new(),
            coefficients: vec![Coefficient {
                name: FORMULA_COEFFICIENT.into(),
                value,
                unit: format!("{unit} per unit"),
                ci95: None,
                meaning: "factor of the formula".into(),
                by_flight: None,
            }],
            parameters: Vec::new(),
            swaps: Vec::new(),
            enabled: true,
            added_by: None,
        }
    }

    /// What a user's own effect adds to the signal that it changes: the signal's name and the formula.
    #[cfg(feature = "files")]
    pub(super) fn own_change(&self) -> Option<(&str, String)> {
        let swap = self.swaps.first().filter(|_| self.kind == FORMULA_KIND)?;
        let text = swap.with.to_string();
        let formula = text.strip_prefix(&format!("{} + {FORMULA_COEFFICIENT} * ", swap.name))?;
        let inner = formula.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
        let whole = inner.filter(|inner| Formula::parse(inner).is_ok()).unwrap_or(formula);
        Some((&swap.name, whole.to_owned()))
    }

    /// All formulas: of its terms, then of what it changes.
    pub fn formulas(&self) -> impl Iterator<Item = &Formula> {
        self.terms.iter().map(|term| &term.regressor).chain(self.swaps.iter().map(|swap| &swap.with))
    }

    /// Index of a number by name: coefficients first, then parameters.
    pub(super) fn number_named(&self, name: &str) -> Option<usize> {
        let names = self.coefficients.iter().map(|coefficient| &coefficient.name);
        names.chain(self.parameters.iter().map(|parameter| &parameter.name)).position(|known| known == name)
    }

    /// A number by index, as a coefficient.
    pub(crate) fn number(&self, index: usize) -> Option<Coefficient> {
        let parameter = || self.parameters.get(index - self.coefficients.len()).map(Parameter::as_coefficient);
        self.coefficients.get(index).cloned().or_else(parameter)
    }

    /// Value and interval of a number by index, to change them.
    pub(crate) fn number_mut(&mut self, index: usize) -> Option<(&mut f64, &mut Option<[f64; 2]>)> {
        let coefficients = self.coefficients.len();
        if let Some(coefficient) = self.coefficients.get_mut(index) {
            return Some((&mut coefficient.value, &mut coefficient.ci95));
        }
        self.parameters.get_mut(index - coefficients).map(|parameter| (&mut parameter.value, &mut parameter.ci95))
    }

    /// A coefficient by name.
    pub fn coefficient(&self, name: &str) -> Option<&Coefficient> {
        self.coefficients.iter().find(|coefficient| coefficient.name == name)
    }

    /// A coefficient by name, to change it.
    pub fn coefficient_mut(&mut self, name: &str) -> Option<&mut Coefficient> {
        self.coefficients.iter_mut().find(|coefficient| coefficient.name == name)
    }

    /// What a person should know of a user's own formula that looks back: it has a coefficient of its own, and in closed loop what a pilot
    /// or a controller did and felt a moment ago tells of the gust that still blows. The catalogue's lags and delays have none.
    pub fn caution(&self) -> Option<String> {
        let looks_back = self.kind == FORMULA_KIND && self.formulas().any(Formula::remembers);
        looks_back.then(|| {
            format!(
                "the formula of `{}` reads earlier samples and has a free coefficient: in closed loop such a term can explain gusts, whatever \
                 the aircraft does; the effects of the catalogue that lag or delay a signal have no coefficient",
                self.name
            )
        })
    }

    /// Puts the effect's name before a formula error.
    pub(super) fn name_error(&self, error: Error) -> Error {
        match error {
            Error::Formula { message, formula, at } => {
                Error::Formula { message: format!("effect `{}`: {message}", self.name), formula, at }
            }
            other => other,
        }
    }
}

/// One line a term and a change, with the numbers in place: `vz_dot += -20.1 m/s² * u4`; what several lines share is said once, after them.
impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |name: &str| {
            let value = self.number_named(name).and_then(|index| self.number(index)).map(|number| number.value)?;
            Formula::parse(&if value < 0.0 { format!("({value:?})") } else { format!("{value:?}") }).ok()
        };
        let formulas: Vec<Formula> =
            self.formulas().map(|formula| formula.substitute(&number).unwrap_or_else(|_| formula.clone())).collect();
        let Shared { formulas, parts } = shared(&formulas);
        let (terms, swaps) = formulas.split_at(self.terms.len());
        let mut gap = "";
        for (term, regressor) in self.terms.iter().zip(terms) {
            let channel = term.channel.name();
            write!(f, "{gap}{channel} += ")?;
            match term.coefficient.as_deref().and_then(|name| self.coefficient(name)) {
                Some(Coefficient { value, unit, .. }) => write!(f, "{value} {unit} * ({regressor})")?,
                None => write!(f, "{regressor}")?,
            }
            gap = "\n";
        }
        for (swap, with) in self.swaps.iter().zip(swaps) {
            write!(f, "{gap}{} := {with}", swap.name)?;
            gap = "\n";
        }
        parts.iter().try_for_each(|(name, part)| write!(f, "\n  where {name} = {part}"))
    }
}
