//! The numbers that decide, each with its reason. Chosen on development data (docs/results.md, "Tested on data with a hidden effect"), never on data that are
//! reported.

/// Length of a block, s: ten times the time over which gusts and manoeuvres of a small helicopter keep a residual correlated.
pub(super) const BLOCK_S: f64 = 10.0;
/// Where a data set is short, blocks may be as short as this, s.
pub(super) const SHORTEST_BLOCK_S: f64 = 5.0;
/// Fewer blocks than this give no verdict.
pub(super) const FEWEST_BLOCKS: usize = 30;
/// With fewer blocks than this they are made shorter.
pub(super) const ENOUGH_BLOCKS: usize = 60;
/// Time over which a residual is taken to be correlated, s: only for weighing the prior of a property of each flight.
pub(super) const CORRELATION_S: f64 = 0.5;
/// With more blocks than this they are made longer: what is kept of a block are squares of all columns, and so many are scatter enough.
pub(super) const MOST_BLOCKS: usize = 2000;
/// Probability of naming any effect at all where none is missing, before the worth gate.
pub(super) const FAMILY_WISE: f64 = 0.05;
/// An effect has to remove this share of a channel's held-out mean squared error.
pub(super) const SMALLEST_FALL: f64 = 0.01;
/// A block's gain is half the logarithm of its errors' ratio and at most this: heavy-tailed blocks must not decide.
pub(super) const LARGEST_GAIN: f64 = 1.0;
/// An effect is excited if at its largest usual size it moves the residual by this share of its root mean square …
pub(super) const SMALLEST_MOVEMENT: f64 = 0.1;
/// … and if so many blocks carry …
pub(super) const FEWEST_CARRYING: usize = 5;
/// … this share of the movement.
pub(super) const CARRIED_SHARE: f64 = 0.8;
/// Standard errors at which an effect is found in four of five data sets: 3.1 for the corrected p-value and 0.84 for the power.
pub(super) const DETECTION: f64 = 4.0;
/// One effect shadows another if that one's gain beside it is less than this share of its gain alone.
pub(super) const SHADOW: f64 = 0.2;
/// What an effect removes beside an accepted one has to be this share of what that one removed in the same channel: less may be a
/// flaw in the form of the first, in other words …
pub(super) const SMALLEST_SHARE_OF_ACCEPTED: f64 = 0.05;
/// … and this share, if the two are known to be mistaken for each other.
pub(super) const SMALLEST_SHARE_OF_RIVAL: f64 = 0.2;
/// Effects with this share of the largest gain on the grid may win once their parameters are refined …
pub(super) const CONTENDER: f64 = 0.7;
/// … and of those the best so many are refined.
pub(super) const MOST_CONTENDERS: usize = 3;
/// An effect of which no number is known better than to this share of its usual size is not shown by the flights.
pub(super) const LOOSE: f64 = 0.5;
/// With so many effects missing a search that adds one after the other is held against one that begins with all: forms interact, and each
/// that is missing hides the others.
pub(super) const MANY: usize = 3;
/// A textbook form is right to about this share of the amplitude of what its effect does: what another removes in the same channel, as a root,
/// has to be more, or it may only mend the form …
pub(super) const SMALLEST_AMPLITUDE: f64 = 0.05;
/// … and more than this where the two are known to be mistaken for each other.
pub(super) const SMALLEST_AMPLITUDE_OF_RIVAL: f64 = 0.15;
/// Standard errors by which one of two that are mistaken for each other has to be better to take the other's place; within them they are told as a tie.
pub(super) const CLEARLY: f64 = 2.0;
/// A channel of which more than this part of its variance is left is mostly unexplained: it is not called explained, and what removes little of it is not named.
pub(super) const MOSTLY_UNEXPLAINED: f64 = 0.5;
