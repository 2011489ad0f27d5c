//! What we claim to know: effects, models, calibration. Nothing here knows of windows, networks or critique.
//!
//! A [`Model`] is a list of [`Effect`]s; an effect adds [`Term`]s `coefficient * formula` to accelerations and changes [signals](SIGNALS) that others
//! read. Baseline, later additions and a user's own formulas are therefore one type: they evaluate on whole flights or one sample at a time,
//! and print as formulas.

mod assumptions;
mod baseline;
mod by_flight;
mod calibrate;
mod calibration;
pub mod catalogue;
mod columns;
mod compose;
mod correlation;
mod definition;
pub(crate) mod digits;
mod effect;
mod effect_check;
mod evaluate;
#[cfg(feature = "files")]
mod export_c;
mod implant;
mod layout;
mod least_squares;
mod model;
#[cfg(feature = "files")]
mod model_file;
mod output_error;
pub mod rollout;
#[cfg(feature = "files")]
mod rotor_file;
mod rotors;
mod rows;
mod sign;
mod sign_doubt;
mod signal;
#[cfg(feature = "files")]
mod toml_section;
mod vehicle;
mod weights;

pub use baseline::PAPER;
pub(crate) use calibrate::off_zero;
pub use calibrate::{calibrate, calibrate_weighed};
pub use calibration::{Calibration, Estimate};
pub use columns::{Columns, Regressor, Wanted, evaluate_blocks, missing_input};
pub use correlation::{Correlation, correlation_matrix};
pub use definition::{
    AIR_DENSITY_KG_M3, CoefficientDefinition, Definition, Notes, Origin, ParameterDefinition, SPREAD, SwapDefinition, Vehicle,
    change, coefficient, parameter,
};
pub use effect::{Coefficient, Effect, FORMULA_COEFFICIENT, FORMULA_KIND, Parameter, Swap, Term};
pub use evaluate::{Block, StreamingModel, Visit, columns_behind, evaluate, quantity, quantity_at, standard_names};
#[cfg(feature = "files")]
pub use export_c::CFile;
pub use implant::{implant, spread_over_flights, typical};
pub use model::{Entry, Model, ModelData};
pub use output_error::{OutputError, output_error};
pub use rollout::Rollout;
pub use rotors::{MOST_ROTORS, Part, Rotor, Total, Turning};
pub use sign::Sign;
pub use sign_doubt::{SignDoubt, SignFinding, doubt, physical_sign};
pub use signal::{Plain, SIGNALS, Signal, Stage, signal_named};
pub use vehicle::{Assumed, MASS_KG, ROTOR_RADIUS_M};
pub use weights::Weights;
