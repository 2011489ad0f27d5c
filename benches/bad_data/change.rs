//! What a corruption is, and the tools it is made of: one flight's columns, and random numbers of its own. What is wrong with which
//! log stands in the lists; no running here.

use phyture::Result;
use phyture::flight::{Column, Flight};
use phyture_kernels::random::Stream;

pub const POSITION: [Column; 3] = [Column::X, Column::Y, Column::Z];
pub const ATTITUDE: [Column; 3] = [Column::Roll, Column::Pitch, Column::Yaw];
pub const VELOCITY: [Column; 3] = [Column::Vx, Column::Vy, Column::Vz];
pub const RATES: [Column; 3] = [Column::Wx, Column::Wy, Column::Wz];
pub const CONTROLS: [Column; 4] = [Column::U1, Column::U2, Column::U3, Column::U4];
pub const LINEAR: [Column; 3] = [Column::VxDot, Column::VyDot, Column::VzDot];
pub const ANGULAR: [Column; 3] = [Column::WxDot, Column::WyDot, Column::WzDot];

/// What is wrong.
pub struct Corruption {
    /// Identifier.
    pub id: &'static str,
    /// What it is about: both halves have as many of each.
    pub kind: Kind,
    /// In a sentence.
    pub says: &'static str,
    /// The two parts of the flights that it is tried on.
    pub parts: [Part; 2],
    /// What it does to a flight.
    pub change: Change,
    /// What names the right cause, any of these: words that the name, the message and the `set` line of one finding hold together, or a note
    /// of the reader; case does not matter, and `!word` must not be there.
    pub right: &'static [&'static [&'static str]],
}

impl Corruption {
    /// Whether a text names the right cause.
    pub fn is_named_by(&self, text: &str) -> bool {
        // A word of another meaning that begins as `late` does.
        let text = text.to_lowercase().replace("lateral", "sideways");
        let holds = |word: &&str| word.strip_prefix('!').map_or_else(|| text.contains(*word), |not| !text.contains(not));
        self.right.iter().any(|words| words.iter().all(holds))
    }
}

/// What a corruption is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Sticks,
    Units,
    Timing,
    Cells,
    Noise,
    Frames,
}

/// Which flights it hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    All,
    Half,
    One,
}

/// How a flight becomes another.
pub enum Change {
    /// Its columns become others.
    Columns(fn(&mut Log, &mut Chance)),
    /// Two more flights stand beside it under other names, each changed so; all of them go through files and the reader.
    Copies(fn(&mut Log, &mut Chance)),
}

impl Part {
    pub const fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Half => "half",
            Self::One => "one",
        }
    }

    /// Whether it holds this flight of so many; which ones goes by the seed.
    pub fn holds(self, flight: usize, count: usize, seed: u64) -> bool {
        match self {
            Self::All => true,
            Self::Half => (flight as u64 + seed).is_multiple_of(2),
            // 7 has no divisor in common with the usual numbers of flights.
            Self::One => flight as u64 == (7 * seed) % count.max(1) as u64,
        }
    }
}

/// Random numbers of one flight of one seed.
pub struct Chance {
    stream: Stream,
    drawn: u64,
}

/// Keeps these streams apart from all others of the same seed.
const SITE: u64 = 0xbad;

impl Chance {
    pub const fn new(seed: u64, flight: usize) -> Self {
        Self { stream: Stream::new(seed, flight as u64, SITE, 0), drawn: 0 }
    }

    /// Uniform on [0, 1).
    pub const fn uniform(&mut self) -> f64 {
        self.drawn += 1;
        self.stream.uniform(self.drawn)
    }

    /// Uniform on 0 to `count`, less one; 0 of none.
    pub fn below(&mut self, count: usize) -> usize {
        ((self.uniform() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// Normal with variance 1 (Box & Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// The columns of one flight while they are changed.
pub struct Log {
    pub columns: [Vec<f64>; Column::COUNT],
    pub step_s: f64,
}

impl Log {
    pub fn of(flight: &Flight) -> Self {
        Self { columns: Column::ALL.map(|column| flight.column(column).to_vec()), step_s: flight.step_s }
    }

    /// A flight with these columns and all else as it was.
    pub fn into_flight(self, before: &Flight) -> Result<Flight> {
        Flight::new(before.name.clone(), before.manoeuvre.clone(), before.start_s, before.step_s, self.columns, before.targets)
    }

    pub fn len(&self) -> usize {
        self.columns[0].len()
    }

    pub fn of_column(&mut self, column: Column) -> &mut Vec<f64> {
        &mut self.columns[column as usize]
    }

    /// Three columns at a sample.
    pub fn vector(&self, columns: [Column; 3], sample: usize) -> [f64; 3] {
        columns.map(|column| self.columns[column as usize][sample])
    }

    pub fn set_vector(&mut self, columns: [Column; 3], sample: usize, values: [f64; 3]) {
        for (column, value) in columns.into_iter().zip(values) {
            self.columns[column as usize][sample] = value;
        }
    }

    /// A span of time in samples.
    pub fn samples(&self, time_s: f64) -> usize {
        (time_s / self.step_s).round() as usize
    }

    pub fn each(&mut self, columns: &[Column], change: impl Fn(f64) -> f64) {
        for column in columns {
            self.of_column(*column).iter_mut().for_each(|value| *value = change(*value));
        }
    }

    pub fn scale(&mut self, columns: &[Column], by: f64) {
        self.each(columns, |value| by * value);
    }

    pub fn swap(&mut self, one: Column, other: Column) {
        self.columns.swap(one as usize, other as usize);
    }

    /// To whole multiples of a step.
    pub fn round(&mut self, columns: &[Column], step: f64) {
        self.each(columns, |value| (value / step).round() * step);
    }

    /// Each sample takes the value of another one of the same columns.
    pub fn take(&mut self, columns: &[Column], from: impl Fn(usize) -> usize) {
        let last = self.len().saturating_sub(1);
        for column in columns {
            let values = self.of_column(*column);
            *values = (0..values.len()).map(|sample| values[from(sample).min(last)]).collect();
        }
    }

    /// Later than they were, by whole samples; the first value fills the gap.
    pub fn late(&mut self, columns: &[Column], delay_s: f64) {
        let delay = self.samples(delay_s);
        self.take(columns, |sample| sample.saturating_sub(delay));
    }

    /// Earlier than they were; the last value fills the gap.
    pub fn early(&mut self, columns: &[Column], lead_s: f64) {
        let lead = self.samples(lead_s);
        self.take(columns, |sample| sample + lead);
    }

    /// Each value repeated for a while, as a slow stream in a fast log.
    pub fn held(&mut self, columns: &[Column], period_s: f64) {
        let period = self.samples(period_s).max(1);
        self.take(columns, |sample| sample - sample % period);
    }

    /// All columns made anew of these samples, in this order.
    pub fn rows(&mut self, order: &[usize]) {
        for values in &mut self.columns {
            *values = order.iter().filter_map(|sample| values.get(*sample).copied()).collect();
        }
    }

    /// So many runs of cells, somewhere, become what `value` makes of them.
    pub fn cells(&mut self, column: Column, runs: usize, length: usize, chance: &mut Chance, value: impl Fn(f64) -> f64) {
        let samples = self.len();
        for _ in 0..runs {
            let start = chance.below(samples.saturating_sub(length) + 1);
            self.of_column(column).iter_mut().skip(start).take(length).for_each(|cell| *cell = value(*cell));
        }
    }

    /// White noise on top.
    pub fn noise(&mut self, columns: &[Column], size: f64, chance: &mut Chance) {
        for column in columns {
            self.of_column(*column).iter_mut().for_each(|value| *value += size * chance.normal());
        }
    }

    /// Through a filter of first order, as of a sensor that follows slowly.
    pub fn lag(&mut self, columns: &[Column], time_s: f64) {
        let share = 1.0 - (-self.step_s / time_s).exp();
        for column in columns {
            let values = self.of_column(*column);
            let mut state = values.first().copied().unwrap_or(0.0);
            for value in values {
                state += share * (*value - state);
                *value = state;
            }
        }
    }
}
