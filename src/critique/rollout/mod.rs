//! Errors of open-loop prediction by step: how far predicted states are from measured ones, over all starts, by manoeuvre, and beside
//! yardsticks that predict no change.
//!
//! The error of a start at a step is one size a quantity: the Euclidean norm of the difference in position (m), in velocity in the
//! north-east-down frame (m/s) and in body rates (rad/s), and the angle of the rotation from one attitude to the other (rad). Means are over
//! starts, sums over the steps 1 … H of these means. Who predicts is in `physics::rollout` and `hybrid::rollout`; the text is in `text`.

mod text;

pub use text::POSITION_FROM_VELOCITY;

use crate::blocks::{BlockMean, BlockSum, Blocks};
use crate::error::Result;
use crate::flight::attitude::{dot, rotation_vector};
use crate::flight::split::Part;
use crate::flight::{Flight, Window};
use crate::physics::rollout::{MOST_RATE_RAD_S, MOST_SPEED_M_S, Rolled, State, has_position, recorded_states};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What is judged of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Position, m.
    Position,
    /// Velocity in north-east-down axes, m/s.
    Velocity,
    /// Attitude, rad.
    Attitude,
    /// Body rates, rad/s.
    Rates,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Position, Self::Velocity, Self::Attitude, Self::Rates];

    /// Name in tables and files.
    pub const fn name(self) -> &'static str {
        ["position", "velocity", "attitude", "rates"][self as usize]
    }

    /// Letter in narrow tables.
    pub const fn letter(self) -> &'static str {
        ["p", "v", "R", "ω"][self as usize]
    }

    /// Unit of its errors.
    pub const fn unit(self) -> &'static str {
        ["m", "m/s", "rad", "rad/s"][self as usize]
    }
}

/// One value a quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PerQuantity<T> {
    /// Of position.
    pub position: T,
    /// Of velocity.
    pub velocity: T,
    /// Of attitude.
    pub attitude: T,
    /// Of rates.
    pub rates: T,
}

impl<T> PerQuantity<T> {
    /// From a function of the quantity.
    pub fn new(mut of: impl FnMut(Quantity) -> T) -> Self {
        Self {
            position: of(Quantity::Position),
            velocity: of(Quantity::Velocity),
            attitude: of(Quantity::Attitude),
            rates: of(Quantity::Rates),
        }
    }

    /// With a function of each value.
    pub fn map<U>(self, mut of: impl FnMut(T) -> U) -> PerQuantity<U> {
        PerQuantity { position: of(self.position), velocity: of(self.velocity), attitude: of(self.attitude), rates: of(self.rates) }
    }

    /// The value of one quantity.
    pub const fn of(&self, quantity: Quantity) -> &T {
        match quantity {
            Quantity::Position => &self.position,
            Quantity::Velocity => &self.velocity,
            Quantity::Attitude => &self.attitude,
            Quantity::Rates => &self.rates,
        }
    }
}

/// Errors of one predictor over some starts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RolloutError {
    /// Starts.
    pub n: usize,
    /// Blocks of ten seconds that the starts lie in.
    pub blocks: usize,
    /// Starts that ran out of bounds; from there on their state stays as it was last within them.
    pub diverged: usize,
    /// Σ over the steps 1 … H of the mean error.
    pub sum: PerQuantity<f64>,
    /// 95 % interval of the sum, from blocks of ten seconds.
    pub sum_ci95: PerQuantity<Option<[f64; 2]>>,
    /// Theil's inequality coefficient over all steps, √mean|e|² / (√mean|y|² + √mean|ŷ|²), 0 to 1. Position and attitude count from the
    /// start, velocity and rates as they are.
    pub theil: PerQuantity<Option<f64>>,
    /// How much larger the sum is than that of [`Rollouts::relative_to`], %.
    pub difference_percent: PerQuantity<Option<f64>>,
    /// 95 % interval of that, paired over blocks of ten seconds.
    pub difference_percent_ci95: PerQuantity<Option<[f64; 2]>>,
}

/// Errors of one predictor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RolloutRow {
    /// Name of the predictor.
    pub name: String,
    /// Mean error after 1 … H steps.
    pub error: PerQuantity<Vec<f64>>,
    /// Over all starts.
    #[serde(flatten)]
    pub whole: RolloutError,
    /// Every manoeuvre class that has a start.
    pub by_manoeuvre: BTreeMap<String, RolloutError>,
}

/// Predictors side by side from the same starts: the result of `rollout`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rollouts {
    /// Steps H.
    pub horizon: usize,
    /// Length of a step, s.
    pub step_s: f64,
    /// Samples from one start to the next.
    pub stride: usize,
    /// Where the starts come from.
    pub split: Part,
    /// Whether flights that no fit has seen are judged on their second halves, as some model has numbers of each flight.
    pub own_from_first_half: bool,
    /// Whether some flight has no position, and the way that the recorded velocity makes stands for it.
    #[serde(default)]
    pub position_from_velocity: bool,
    /// A start is stopped when its speed is above this, m/s …
    pub most_speed_m_s: f64,
    /// … or its body rate above this, rad/s, or one of its numbers is not finite.
    pub most_rate_rad_s: f64,
    /// The row that differences are relative to.
    pub relative_to: String,
    /// The yardsticks, then models, then networks.
    pub rows: Vec<RolloutRow>,
}

/// Sums over the starts of one block.
#[derive(Clone, Debug)]
pub struct Sums {
    block: usize,
    starts: usize,
    diverged: usize,
    /// Σ |e| by quantity and step.
    sizes: [Vec<f64>; 4],
    /// Σ |e|², Σ |y|², Σ |ŷ|² by quantity, over all steps.
    squares: [[f64; 3]; 4],
}

/// What judges.
pub struct Judge<'a> {
    flights: &'a [Flight],
    starts: &'a [Window],
    horizon: usize,
    blocks: Blocks,
    /// By flight and sample.
    measured: Vec<Vec<State>>,
}

impl<'a> Judge<'a> {
    /// For rollouts of so many steps from these starts, all of which have room for them.
    pub fn new(flights: &'a [Flight], starts: &'a [Window], horizon: usize) -> Self {
        let used = |flight: usize| starts.iter().any(|start| start.flight == flight);
        let states = |(index, flight): (usize, &Flight)| if used(index) { recorded_states(flight) } else { Vec::new() };
        let measured = flights.iter().enumerate().map(states).collect();
        Self { flights, starts, horizon, blocks: Blocks::new(flights, starts), measured }
    }

    /// The measured state of a flight that has a start.
    pub fn measured(&self, flight: usize, sample: usize) -> State {
        self.measured[flight][sample]
    }

    /// The errors of some lanes, block by block.
    pub fn sums(&self, rolled: &Rolled) -> Vec<Sums> {
        let mut sums = Vec::new();
        for (lane, &start) in rolled.starts.iter().enumerate() {
            let of_block = self.of_block(&mut sums, rolled.flight, start);
            of_block.diverged += usize::from(rolled.stopped[lane].is_some());
            self.add(of_block, rolled.flight, start, &|step| rolled.state(lane, step));
        }
        sums
    }

    /// The errors of a state that does not change.
    pub fn state_held(&self) -> Vec<Sums> {
        let mut sums = Vec::new();
        for start in self.starts {
            let state = self.measured[start.flight][start.last];
            self.add(self.of_block(&mut sums, start.flight, start.last), start.flight, start.last, &|_| state);
        }
        sums
    }

    /// The sums of the block that a start lies in; starts come in order.
    fn of_block<'s>(&self, sums: &'s mut Vec<Sums>, flight: usize, start: usize) -> &'s mut Sums {
        let block = Blocks::new(self.flights, &[Window { flight, last: start }]).keys[0];
        let block = self.blocks.keys.partition_point(|key| *key < block);
        if sums.last().is_none_or(|last: &Sums| last.block != block) {
            let sizes = std::array::from_fn(|_| vec![0.0; self.horizon]);
            sums.push(Sums { block, starts: 0, diverged: 0, sizes, squares: [[0.0; 3]; 4] });
        }
        sums.last_mut().expect("one was just put there")
    }

    fn add(&self, sums: &mut Sums, flight: usize, start: usize, predicted: &dyn Fn(usize) -> State) {
        let measured = &self.measured[flight];
        sums.starts += 1;
        let begun = predicted(0);
        for step in 1..=self.horizon {
            let there = at_place_of(&measured[start], &begun, predicted(step));
            let sizes = sizes(&measured[start], &measured[start + step], &there);
            for (quantity, [error, of_measured, of_predicted]) in sizes.into_iter().enumerate() {
                sums.sizes[quantity][step - 1] += error;
                let squares = [error, of_measured, of_predicted].map(|size| size * size);
                sums.squares[quantity].iter_mut().zip(squares).for_each(|(sum, square)| *sum += square);
            }
        }
    }

    /// The errors of predictors, each with its name, its sums block by block, and the index of the row that differences are relative to.
    pub fn rows(&self, predictors: Vec<(String, Vec<Sums>)>, relative_to: usize) -> Vec<RolloutRow> {
        let predictors: Vec<(String, Vec<Sums>)> = predictors.into_iter().map(|(name, sums)| (name, self.by_block(sums))).collect();
        let mut manoeuvres: Vec<&str> = self.starts.iter().map(|start| self.flights[start.flight].manoeuvre.as_str()).collect();
        manoeuvres.sort_unstable();
        manoeuvres.dedup();
        let reference = predictors.get(relative_to).map(|(_, sums)| sums.as_slice());
        let row = |(name, sums): &(String, Vec<Sums>)| {
            let is_in = |class: &str, block: usize| self.flights[self.blocks.keys[block].0].manoeuvre == class;
            let by_class = |class: &&str| ((*class).to_owned(), self.error(sums, reference, &|block| is_in(class, block)));
            let starts: usize = sums.iter().map(|sums| sums.starts).sum();
            let mean = |quantity: Quantity, step: usize| {
                sums.iter().map(|sums| sums.sizes[quantity as usize][step]).sum::<f64>() / starts.max(1) as f64
            };
            RolloutRow {
                name: name.clone(),
                error: PerQuantity::new(|quantity| (0..self.horizon).map(|step| mean(quantity, step)).collect()),
                whole: self.error(sums, reference, &|_| true),
                by_manoeuvre: manoeuvres.iter().map(by_class).collect(),
            }
        };
        predictors.iter().map(row).collect()
    }

    /// One entry a block: a block may lie in two batches.
    fn by_block(&self, sums: Vec<Sums>) -> Vec<Sums> {
        let blank = |block| Sums {
            block,
            starts: 0,
            diverged: 0,
            sizes: std::array::from_fn(|_| vec![0.0; self.horizon]),
            squares: [[0.0; 3]; 4],
        };
        let mut all: Vec<Sums> = (0..self.blocks.len()).map(blank).collect();
        for part in sums {
            let whole = &mut all[part.block];
            whole.starts += part.starts;
            whole.diverged += part.diverged;
            for (to, from) in whole.sizes.iter_mut().flatten().zip(part.sizes.iter().flatten()) {
                *to += from;
            }
            for (to, from) in whole.squares.iter_mut().flatten().zip(part.squares.iter().flatten()) {
                *to += from;
            }
        }
        all
    }

    /// Over the blocks that are in.
    fn error(&self, sums: &[Sums], reference: Option<&[Sums]>, is_in: &dyn Fn(usize) -> bool) -> RolloutError {
        let own: Vec<&Sums> = sums.iter().filter(|sums| is_in(sums.block)).collect();
        let other: Vec<&Sums> = reference.unwrap_or_default().iter().filter(|sums| is_in(sums.block)).collect();
        let total = |sums: &Sums, quantity: Quantity| sums.sizes[quantity as usize].iter().sum::<f64>();
        let mean = |quantity: Quantity| {
            BlockMean::new(own.iter().map(|sums| BlockSum { samples: sums.starts as f64, sum: total(sums, quantity) }))
        };
        let ratio = |quantity: Quantity| {
            let pair = |(own, other): (&&Sums, &&Sums)| BlockSum { samples: total(other, quantity), sum: total(own, quantity) };
            BlockMean::ratio(own.iter().zip(&other).map(pair))
        };
        let percent = |value: f64| 100.0 * (value - 1.0);
        RolloutError {
            n: own.iter().map(|sums| sums.starts).sum(),
            blocks: own.iter().filter(|sums| sums.starts > 0).count(),
            diverged: own.iter().map(|sums| sums.diverged).sum(),
            sum: PerQuantity::new(|quantity| mean(quantity).map_or(0.0, |mean| mean.mean)),
            sum_ci95: PerQuantity::new(|quantity| mean(quantity)?.positive_interval()),
            theil: PerQuantity::new(|quantity| {
                let root = |which: usize| own.iter().map(|sums| sums.squares[quantity as usize][which]).sum::<f64>().sqrt();
                Some(root(0) / (root(1) + root(2))).filter(|coefficient| coefficient.is_finite())
            }),
            difference_percent: PerQuantity::new(|quantity| Some(percent(ratio(quantity)?.mean))),
            difference_percent_ci95: PerQuantity::new(|quantity| Some(ratio(quantity)?.interval()?.map(percent))),
        }
    }

    /// The result: rows that were judged, and what is to be said of the whole.
    pub fn result(&self, rows: Vec<RolloutRow>, relative_to: usize, stride: usize, split: Part) -> Rollouts {
        Rollouts {
            horizon: self.horizon,
            step_s: self.starts.first().map_or(f64::NAN, |start| self.flights[start.flight].step_s),
            stride,
            split,
            own_from_first_half: false,
            position_from_velocity: self.starts.iter().any(|start| !has_position(&self.flights[start.flight])),
            most_speed_m_s: MOST_SPEED_M_S,
            most_rate_rad_s: MOST_RATE_RAD_S,
            relative_to: rows.get(relative_to).map_or_else(String::new, |row| row.name.clone()),
            rows,
        }
    }
}

/// A predicted state as if its rollout, which began at `begun`, had begun at the measured place `from`: without a position in the log a rollout
/// starts anywhere.
pub fn at_place_of(from: &State, begun: &State, mut there: State) -> State {
    there.position = std::array::from_fn(|axis| there.position[axis] + (from.position[axis] - begun.position[axis]));
    there
}

/// Sizes of error, measured and predicted value by quantity; position and attitude count from `start`.
fn sizes(start: &State, measured: &State, predicted: &State) -> [[f64; 3]; 4] {
    let apart = |a: [f64; 3], b: [f64; 3]| {
        let d: [f64; 3] = std::array::from_fn(|axis| a[axis] - b[axis]);
        dot(d, d).sqrt()
    };
    let size = |a: [f64; 3]| dot(a, a).sqrt();
    [
        [
            apart(measured.position, predicted.position),
            apart(measured.position, start.position),
            apart(predicted.position, start.position),
        ],
        [apart(measured.velocity, predicted.velocity), size(measured.velocity), size(predicted.velocity)],
        [
            angle(measured.attitude, predicted.attitude),
            angle(measured.attitude, start.attitude),
            angle(predicted.attitude, start.attitude),
        ],
        [apart(measured.rates, predicted.rates), size(measured.rates), size(predicted.rates)],
    ]
}

/// The angle of the rotation from one attitude (unit quaternion, scalar last) to another, rad, 0 to π.
pub fn angle(a: [f64; 4], b: [f64; 4]) -> f64 {
    let vector = rotation_vector(a, b);
    dot(vector, vector).sqrt()
}

/// Rows of several predictors, from what each gave batch by batch.
///
/// # Errors
/// Those of the predictors.
pub fn collected(batches: Result<Vec<Vec<Sums>>>) -> Result<Vec<Sums>> {
    Ok(batches?.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::{Column, Targets};
    use crate::physics::{Model, Rollout};
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    const CLOSE: f64 = Tolerance::Close.relative_f64();

    /// Level flights of 20 s north-east at (3, 4) m/s, the second of them at the double speed and of another class.
    fn flights() -> Result<Vec<Flight>> {
        let flight = |name: &str, class: &str, factor: f64| {
            let columns = Column::ALL.map(|column| {
                let of = |sample: usize| match column {
                    Column::X => 3.0 * factor * 0.1 * sample as f64,
                    Column::Y => 4.0 * factor * 0.1 * sample as f64,
                    Column::Vx => 3.0 * factor,
                    Column::Vy => 4.0 * factor,
                    // So slow that the method's truncation is below rounding.
                    Column::Wz => 0.05,
                    _ => 0.0,
                };
                (0..200).map(of).collect()
            });
            Flight::new(name, class, 0.0, 0.1, columns, Targets::Recorded)
        };
        Ok(vec![flight("a", "slow", 1.0)?, flight("b", "fast", 2.0)?])
    }

    #[test]
    fn errors_sums_coefficients_and_differences_are_what_they_are_by_hand() -> Result<()> {
        let flights = flights()?;
        let starts: Vec<Window> = (0..2).flat_map(|flight| (1..180).step_by(2).map(move |last| Window { flight, last })).collect();
        let judge = Judge::new(&flights, &starts, 10);
        // A body without weight that flies on, but turns by its recorded rate.
        let model = Model { effects: Vec::new(), ..Model::paper("nothing", 1.0, [1.0; 3], 0.5) };
        let rolled = collected(Rollout::new(&model, &flights, 10)?.roll(&starts, None, &|rolled| judge.sums(rolled)))?;
        let rows = judge.rows(vec![("held".into(), judge.state_held()), ("nothing".into(), rolled)], 0);
        let (held, turning) = (&rows[0], &rows[1]);
        let close = |found: f64, expected: f64| (found - expected).abs() <= CLOSE * expected.abs().max(1.0);
        // Speeds of 5 and 10 m/s: 7.5 m/s in the mean, 0.1 s a step.
        assert!((0..10).all(|step| close(held.error.position[step], 0.75 * (step + 1) as f64)), "{held:?}");
        assert!(close(held.whole.sum.position, 0.75 * 55.0) && close(held.whole.theil.position.unwrap_or(0.0), 1.0));
        assert_eq!((held.whole.n, held.whole.blocks, held.whole.diverged), (180, 4, 0));
        assert!(
            held.whole.sum.velocity == 0.0
                && held.whole.theil.velocity == Some(0.0)
                && held.whole.difference_percent.velocity.is_none()
        );
        assert!(close(held.by_manoeuvre["slow"].sum.position, 0.5 * 55.0) && close(held.by_manoeuvre["fast"].sum.position, 55.0));
        // The scatter within a class is none, between the classes it is known: two blocks at 5, two at 10, nearly as many starts in each.
        assert!(held.by_manoeuvre["slow"].sum_ci95.position.is_some_and(|[low, high]| close(low, high)));
        assert!(held.whole.sum_ci95.position.is_some_and(|[low, high]| low < 0.6 * 55.0 && high > 0.9 * 55.0));
        // The recorded attitude stays, so a prediction that turns errs by the angle.
        assert!((0..10).all(|step| close(turning.error.attitude[step], 0.005 * (step + 1) as f64)), "{turning:?}");
        assert!(close(turning.whole.theil.attitude.unwrap_or(0.0), 1.0) && turning.whole.sum.rates <= CLOSE);
        // Velocity turns with the body axes, as no Coriolis term keeps it: 2 sin(angle / 2) of the speed.
        assert!(close(turning.error.velocity[9], 7.5 * 2.0 * 0.025_f64.sin()), "{turning:?}");
        let percent = turning.whole.difference_percent.position.unwrap_or(0.0);
        assert!(close(percent, 100.0 * (turning.whole.sum.position / held.whole.sum.position - 1.0)) && percent < -50.0);
        Ok(())
    }

    proptest! {
        #[test]
        fn the_angle_between_attitudes_is_that_of_the_turn(
            q in prop::array::uniform4(-1.0..1.0_f64), axis in prop::array::uniform3(-1.0..1.0_f64), turn in 1e-9..3.1_f64,
        ) {
            let unit = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
            prop_assume!(unit(&q) > 0.1 && unit(&axis) > 0.1);
            let [a, b, c, w] = q.map(|part| part / unit(&q));
            let [x, y, z] = axis.map(|part| part / unit(&axis) * (0.5 * turn).sin());
            let s = (0.5 * turn).cos();
            let turned = [w * x + a * s + b * z - c * y, w * y + b * s + c * x - a * z, w * z + c * s + a * y - b * x, w * s - a * x - b * y - c * z];
            let found = angle([a, b, c, w], turned);
            prop_assert!((found - turn).abs() <= CLOSE, "{} {}", found, turn);
            prop_assert!((angle(turned.map(|part| -part), [a, b, c, w]) - turn).abs() <= CLOSE, "a quaternion and its negative are one attitude");
        }
    }
}
