//! The built-in truth helicopter and its pilot: logs whose causes are known.
//!
//! An independent code path: it shares with the rest of the crate the types of [`crate::flight`] and nothing else, so that a
//! model fitted to its logs is never fitted to its own equations. `physics` and `critique` do not import it.
//!
//! The truth starts from the paper's baseline (eqs. 14-15) with [`COEFFICIENTS`] and, for each [`Mechanism`] that is on, departs
//! from it. A mechanism that is on and that a model file does not list is a *hidden effect*.

mod actuators;
mod body;
mod manoeuvres;
mod mechanisms;
mod pilot;
mod random;
mod rotor;
mod sensors;
mod vehicle;
mod wind;

pub use manoeuvres::CLASSES;
pub use mechanisms::{Mechanism, Mechanisms};
pub use vehicle::{COEFFICIENTS, Coefficients, INERTIA_KG_M2, MASS_KG, ROTOR_RADIUS_M};

use crate::error::{Error, Result};
use crate::flight::{DataSet, Flight};
use actuators::Actuators;
use body::{Body, State};
use pilot::Pilot;
use random::Random;
use sensors::Instant;
use wind::{Atmosphere, Disturbance};

/// Logging step, s.
pub const LOG_STEP_S: f64 = 0.01;
/// Integration steps in a logging step: 500 Hz.
const SUBSTEPS: usize = 5;
/// Flown before the log starts, s: the pilot settles in the wind and finds the trim.
const SETTLING_S: f64 = 5.0;
/// Length of a flight of [`Like::Even`], s.
const FLIGHT_S: f64 = 30.0;

/// How a session is cut into flights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Like {
    /// Flights of 30 s, dealt evenly to the classes, for [`Simulation::minutes`] in all.
    Even,
    /// One flight for each of the 20 classes, 140 s to 510 s long, 7376 s in all (paper section 4.1).
    Stanford,
}

/// Disturbances, instrument noise and smoothing.
///
/// What least squares of eqs. 14-15 can be held to depends on these. A gust that lasts moves the aircraft, and through the
/// pilot the sticks, while it still acts: then regressors and disturbance correlate and a regression of the acceleration on the
/// state is biased, however long the log. At level one B and C₂ come out about 1 % small, which is some eight standard errors of
/// 30 min. So is it with noise in a rate that is itself a regressor (0.01 rad/s: three standard errors at level zero). At level
/// zero the gusts are white from log sample to log sample, so that the state and the sticks at a sample are decided before its
/// gust, and the states are as clean as a good smoother leaves them: least squares is unbiased to a fraction of a standard error.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Level {
    /// Specific force of the gusts, m/s² rms for each axis.
    pub gust_force_m_s2: f64,
    /// Its correlation time, s; 0 is white from log sample to log sample.
    pub gust_force_time_s: f64,
    /// Angular acceleration of the gusts, rad/s² rms.
    pub gust_moment_rad_s2: f64,
    /// Its correlation time, s.
    pub gust_moment_time_s: f64,
    /// Scale of the white instrument noise; 1 is 0.02 m, 0.003 rad, 0.02 m/s, 0.01 rad/s, 0.05 m/s², 0.1 rad/s² rms.
    pub noise: f64,
    /// Corner of the zero-phase smoothing of every column, Hz.
    pub smoothing_hz: Option<f64>,
}

impl Level {
    /// Nothing disturbs, nothing is noisy: the log is the truth.
    pub const QUIET: Self = Self {
        gust_force_m_s2: 0.0,
        gust_force_time_s: 0.0,
        gust_moment_rad_s2: 0.0,
        gust_moment_time_s: 0.0,
        noise: 0.0,
        smoothing_hz: None,
    };
    /// White gusts of 0.3 m/s² and 0.3 rad/s² rms, a third of the instrument noise: least squares is unbiased.
    pub const ZERO: Self = Self { gust_force_m_s2: 0.3, gust_moment_rad_s2: 0.3, noise: 0.3, ..Self::QUIET };
    /// The same gusts with correlation times of 0.5 s and 0.2 s, and all the noise.
    pub const ONE: Self = Self { gust_force_time_s: 0.5, gust_moment_time_s: 0.2, noise: 1.0, ..Self::ZERO };
    /// Level one, smoothed without phase as a Kalman smoother does.
    pub const TWO: Self = Self { smoothing_hz: Some(10.0), ..Self::ONE };
}

/// A session to simulate.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// Length of all flights together, min, for [`Like::Even`].
    pub minutes: f64,
    /// Seed: the same seed gives the same bits, on any number of threads.
    pub seed: u64,
    /// How the session is cut into flights.
    pub like: Like,
    /// Disturbances, noise, smoothing.
    pub level: Level,
    /// What the truth has beyond the baseline.
    pub mechanisms: Mechanisms,
    /// Only these classes.
    pub classes: Option<Vec<String>>,
}

impl Default for Simulation {
    /// The full truth: 30 min, every mechanism at scale 1, level two.
    fn default() -> Self {
        Self { minutes: 30.0, seed: 2030, like: Like::Even, level: Level::TWO, mechanisms: Mechanisms::all(), classes: None }
    }
}

impl Simulation {
    /// Exactly the paper's baseline, at level zero: the ground to hide effects in.
    pub fn baseline() -> Self {
        Self { mechanisms: Mechanisms::none(), level: Level::ZERO, ..Self::default() }
    }

    /// Switches one mechanism on, by its identifier, at a scale.
    ///
    /// # Errors
    /// [`Error::Config`] for an unknown identifier or a scale outside 0 to [`Mechanism::largest_scale`].
    pub fn hide(mut self, id: &str, scale: f64) -> Result<Self> {
        self.mechanisms = self.mechanisms.with(Mechanism::from_id(id)?, scale);
        self.mechanisms.check()?;
        Ok(self)
    }

    /// Sets the mean wind of every flight, m/s; it comes from anywhere.
    ///
    /// # Errors
    /// [`Error::Config`] for a wind that the mechanism does not reach.
    pub fn with_wind(mut self, wind_m_s: f64) -> Result<Self> {
        self.mechanisms = self.mechanisms.with(Mechanism::Wind, wind_m_s / wind::WIND_M_S);
        self.mechanisms.check()?;
        Ok(self)
    }

    /// What these logs hide.
    pub fn truth(&self) -> Truth {
        Truth {
            seed: self.seed,
            version: env!("CARGO_PKG_VERSION"),
            mass_kg: MASS_KG,
            inertia: INERTIA_KG_M2,
            rotor_radius_m: ROTOR_RADIUS_M,
            control_delay_s: 0.0,
            level: self.level,
            coefficients: COEFFICIENTS,
            mechanisms: self.mechanisms.clone(),
        }
    }

    /// Class and length (s) of every flight.
    fn plan(&self) -> Result<Vec<(&'static str, f64)>> {
        let fault = |field: &str, found: String, expected: String| Error::Config {
            place: "simulation".into(),
            field: field.into(),
            found,
            expected,
        };
        self.mechanisms.check()?;
        let mut classes = CLASSES.to_vec();
        if let Some(names) = &self.classes {
            let all = || CLASSES.map(|(class, _)| class).join(", ");
            if let Some(name) = names.iter().find(|name| !CLASSES.iter().any(|(class, _)| class == name)) {
                return Err(fault("classes", format!("`{name}`"), format!("some of {}", all())));
            }
            if names.is_empty() {
                return Err(fault("classes", "an empty list".into(), format!("some of {}", all())));
            }
            classes.retain(|(class, _)| names.iter().any(|name| name == class));
        }
        match self.like {
            Like::Stanford => Ok(classes.into_iter().map(|(class, seconds)| (class, f64::from(seconds))).collect()),
            Like::Even => {
                let total = self.minutes * 60.0;
                if !(10.0..=360_000.0).contains(&total) {
                    return Err(fault("minutes", self.minutes.to_string(), "0.17 (10 s) to 6000".into()));
                }
                let flights = (total / FLIGHT_S).round().max(1.0) as usize;
                let last = total - FLIGHT_S * (flights - 1) as f64;
                let length = |flight| if flight + 1 == flights { last } else { FLIGHT_S };
                // 7 has no divisor in common with 20: a short session is spread over unlike classes.
                let class = |flight: usize| classes[flight * if classes.len() == CLASSES.len() { 7 } else { 1 } % classes.len()].0;
                Ok((0..flights).map(|flight| (class(flight), length(flight))).collect())
            }
        }
    }
}

/// What a simulation hides in its logs: everything somebody needs to judge a calibration or a diagnosis against.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Truth {
    /// Seed of the session.
    pub seed: u64,
    /// Version of this crate.
    pub version: &'static str,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Diagonal of the inertia tensor, kg m².
    pub inertia: [f64; 3],
    /// Rotor radius, m.
    pub rotor_radius_m: f64,
    /// Delay between a logged control and the acceleration logged beside it, s, that a model of these logs should state.
    pub control_delay_s: f64,
    /// Disturbances, noise and smoothing.
    pub level: Level,
    /// Coefficients of eqs. 14-15.
    pub coefficients: Coefficients,
    /// Mechanisms beyond the baseline that are on, and their scales.
    pub mechanisms: Mechanisms,
}

/// Flies and records a session. Flights are sorted by class and name.
///
/// # Errors
/// [`Error::Config`] for a scale, class or length out of range.
pub fn simulate(simulation: &Simulation) -> Result<DataSet> {
    Ok(flown(simulation, false)?.0)
}

/// As [`simulate()`], and beside each flight its explainable part: the same instruments without noise on the same motion, the
/// accelerations being those that the aircraft would have had at each moment without gusts, turbulence and roughness, then and before. A mean
/// wind blows in both. What a model leaves of the recorded accelerations beyond their difference from these, it could have explained.
///
/// # Errors
/// As [`simulate()`].
pub fn simulate_with_explainable(simulation: &Simulation) -> Result<(DataSet, DataSet)> {
    flown(simulation, true)
}

/// The flights, and their explainable parts if these are asked for; else the flights again.
fn flown(simulation: &Simulation, with_explainable: bool) -> Result<(DataSet, DataSet)> {
    let plan: Vec<_> = simulation.plan()?.into_iter().enumerate().collect();
    let body = Body::new(&simulation.mechanisms);
    let one = |&(number, (class, seconds)): &(usize, (&'static str, f64))| {
        fly(simulation, &body, &Task { number, class, seconds, with_explainable })
    };
    #[cfg(feature = "rayon")]
    let flights: Result<Vec<(Flight, Flight)>> = {
        use rayon::prelude::*;
        plan.par_iter().map(one).collect()
    };
    #[cfg(not(feature = "rayon"))]
    let flights: Result<Vec<(Flight, Flight)>> = plan.iter().map(one).collect();
    let mut flights = flights?;
    flights.sort_by(|(a, _), (b, _)| (&a.manoeuvre, &a.name).cmp(&(&b.manoeuvre, &b.name)));
    let (recorded, explainable) = flights.into_iter().unzip();
    let note = format!("simulated by phyture {}, seed {}", env!("CARGO_PKG_VERSION"), simulation.seed);
    let set = |flights, note| DataSet { flights, notes: vec![note], ..DataSet::default() };
    Ok((set(recorded, note.clone()), set(explainable, format!("{note}: explainable part"))))
}

/// Numbers of the state that say where the aircraft is and how it moves; the others are what rotor and servos remember.
const RIGID: usize = 13;

/// One flight to be flown.
struct Task {
    number: usize,
    class: &'static str,
    seconds: f64,
    with_explainable: bool,
}

/// One flight from its first trim to its log, and the explainable part of that.
fn fly(simulation: &Simulation, body: &Body, task: &Task) -> Result<(Flight, Flight)> {
    let Task { number, class, seconds, with_explainable } = *task;
    let random = |purpose| Random::new(simulation.seed, number as u64, purpose);
    let (level, mechanisms) = (&simulation.level, &simulation.mechanisms);
    let mut chance = random(0);
    let heading = std::f64::consts::TAU * chance.uniform();
    let segments = manoeuvres::script(class, seconds, &mut chance);
    let settling = (SETTLING_S / LOG_STEP_S).round() as usize;
    let samples = (seconds / LOG_STEP_S).round() as usize;
    let mut air = Atmosphere::new(level, mechanisms, LOG_STEP_S, random(1));
    let state = body.hover(manoeuvres::start_height(class), heading);
    let trim = [0.0, 0.0, 0.0, state.servo[1]];
    let mut pilot = Pilot::new(manoeuvres::start_height(class), segments, heading, trim, LOG_STEP_S, random(2));
    let mut actuators = Actuators::new(mechanisms, trim, LOG_STEP_S);
    let mut flat = state.flat();
    // The same motion in calm air: what rotor and servos remember is then theirs, not that of the gusts before.
    let mut calm_flat = flat;
    let mut motion = Vec::with_capacity(samples);
    let mut calm = Vec::with_capacity(samples);
    for sample in 0..settling + samples {
        let burnt = sample.saturating_sub(settling) as f64 / samples as f64;
        let disturbance = air.next();
        let state = State::from_flat(&flat);
        let mut controls = actuators.output();
        let accelerations = |flat, disturbance| {
            let [_, _, _, _, _, _, _, ax, ay, az, ap, aq, ar, ..] = body.derivative(flat, controls, disturbance, burnt);
            ([ax, ay, az], [ap, aq, ar])
        };
        let (acceleration, angular) = accelerations(&flat, &disturbance);
        calm_flat[..RIGID].copy_from_slice(&flat[..RIGID]);
        let calm_air = Disturbance::explainable(&air);
        let without = accelerations(&calm_flat, &calm_air);
        actuators.push(pilot.fly(&state, sample >= settling));
        if sample >= settling {
            let now = Instant {
                position: state.position,
                attitude: state.attitude,
                velocity: state.velocity,
                rate: state.rate,
                controls: actuators.logged(),
                acceleration,
                angular,
            };
            motion.push(now);
            calm.push(Instant { acceleration: without.0, angular: without.1, ..now });
        }
        let part = 1.0 / SUBSTEPS as f64;
        for substep in 1..=SUBSTEPS {
            let end = actuators.advance(substep as f64 * part, part);
            let middle = std::array::from_fn(|channel| 0.5 * (controls[channel] + end[channel]));
            body.step(&mut flat, [controls, middle, end], &disturbance, burnt, LOG_STEP_S * part);
            if with_explainable {
                body.step(&mut calm_flat, [controls, middle, end], &calm_air, burnt, LOG_STEP_S * part);
            }
            controls = end;
        }
    }
    let name = format!("{class}_{number:04}");
    let record = |motion: &[Instant], level| sensors::record(&name, class, LOG_STEP_S, motion, level, mechanisms, random(3));
    let recorded = record(&motion, level)?;
    let explainable = if with_explainable { record(&calm, &Level { noise: 0.0, ..*level })? } else { recorded.clone() };
    Ok((recorded, explainable))
}
