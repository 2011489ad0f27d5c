//! Many evaluations of the same formulas side by side: a lane is one of them, and where formulas remember each lane has its own past. One
//! call takes the next sample of every lane, or looks a part of a step ahead of it. What the lanes are, nothing here knows.

use super::machine::{Machine, Recalled};
use super::memory::Memory;
use crate::error::{Error, Result};

/// What a machine remembers at one moment.
#[derive(Clone, Debug, Default)]
pub struct Remembered(Vec<Memory>);

/// What a machine remembers in each of many lanes.
#[derive(Clone, Debug, Default)]
pub struct Lanes {
    /// By operator that remembers, then by lane.
    memory: Vec<Vec<Memory>>,
}

impl Machine {
    /// Whether its values depend on earlier samples.
    pub fn remembers(&self) -> bool {
        !self.memory.is_empty()
    }

    /// What it remembers now.
    pub fn remembered(&self) -> Remembered {
        Remembered(self.memory.iter().map(Memory::slim).collect())
    }

    /// Goes on from what it, or an equal machine, once remembered.
    pub fn recall(&mut self, past: &Remembered) {
        self.memory.clone_from(&past.0);
    }

    /// Room for lanes of this machine, none yet.
    ///
    /// # Errors
    /// [`Error::Shape`] for derivatives of what remembers, which have no lanes.
    pub fn lanes(&self) -> Result<Lanes> {
        if self.memory.iter().all(Memory::looks_ahead) {
            return Ok(Lanes { memory: vec![Vec::new(); self.memory.len()] });
        }
        let message = "derivatives of `lag`, `delay` or `slew` are worked out on whole flights only".into();
        Err(Error::Shape { operation: "lanes of formulas", message })
    }

    /// A further lane that has seen what this machine has.
    pub fn add_lane(&self, lanes: &mut Lanes) {
        lanes.memory.iter_mut().zip(&self.memory).for_each(|(lanes, memory)| lanes.push(memory.slim()));
    }

    /// Takes the next sample of each of so many lanes, at most [`Machine::block`]; `input` gives one number a lane, in the order of
    /// [`Machine::inputs`].
    pub fn advance_lanes<'a>(&mut self, lanes: &mut Lanes, count: usize, input: &dyn Fn(usize) -> &'a [f64]) {
        self.evaluate(count, input, &mut |index, recalled| {
            let Recalled { isa, signal, number, tangents, out } = recalled;
            for (lane, memory) in lanes.memory[index].iter_mut().enumerate().take(count) {
                let one = lane..lane + 1;
                let tangents = tangents.map(|tangent| &tangent[one.clone()]);
                memory.run(isa, &signal[one.clone()], &number[one.clone()], tangents, &mut out[one]);
            }
        });
    }

    /// The values a part of a step (above 0, at most 1) after the last sample of each lane; no lane moves on. What remembers takes its signal
    /// to have gone there in a straight line.
    pub fn look_ahead<'a>(&mut self, lanes: &Lanes, part: f64, count: usize, input: &dyn Fn(usize) -> &'a [f64]) {
        let step_s = self.step_s;
        self.evaluate(count, input, &mut |index, recalled| {
            let columns = recalled.out.iter_mut().zip(recalled.signal).zip(recalled.number);
            for (memory, ((out, x), number)) in lanes.memory[index].iter().zip(columns) {
                *out = memory.ahead(part, step_s, *x, *number);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formula::{Formula, Graph};
    use phyture_kernels::Tolerance;
    use proptest::prelude::*;

    const STEP_S: f64 = 0.01;
    const CLOSE: f64 = Tolerance::Close.relative_f64();

    /// A machine for one formula of the column `x`.
    fn machine(text: &str) -> Result<Machine> {
        let mut graph = Graph::new();
        let root = graph.add(&Formula::parse(text)?, &mut |_, _| Ok(None))?;
        Machine::new(&graph, &[root], STEP_S, &|_| None)
    }

    fn remembering() -> impl Strategy<Value = String> {
        let texts = [
            "lag(x, 0.05)",
            "delay(x, 0.033)",
            "delay(x, 0.004)",
            "rate(x)",
            "slew(x, 20)",
            "lag(x, 0.02 + 0.01 * x^2)",
            "lag(delay(x, 0.02), 0.03) + rate(x) * slew(x, 5)",
        ];
        prop::sample::select(texts.to_vec()).prop_map(str::to_owned)
    }

    proptest! {
        #[test]
        fn lanes_go_on_as_the_one_machine_does_and_looking_a_whole_step_ahead_is_the_next_sample(
            text in remembering(),
            x in prop::collection::vec(-2.0..2.0_f64, 12..700),
            starts in prop::collection::vec(1_usize..9, 1..6),
        ) {
            let mut one = machine(&text)?;
            let mut whole = Vec::new();
            for value in &x {
                one.advance(1, &|_| std::slice::from_ref(value));
                whole.push(one.root(0)[0]);
            }
            // Each lane has seen as many samples as its start says.
            let mut many = machine(&text)?;
            let mut lanes = many.lanes()?;
            for &start in &starts {
                many.reset();
                many.advance(start, &|_| &x[..start]);
                many.add_lane(&mut lanes);
            }
            for step in 0..x.len() - 9 {
                let now: Vec<f64> = starts.iter().map(|start| x[start + step]).collect();
                if step > 0 {
                    many.look_ahead(&lanes, 1.0, starts.len(), &|_| &now);
                    for (lane, start) in starts.iter().enumerate() {
                        let (found, expected) = (many.root(0)[lane], whole[start + step]);
                        prop_assert!((found - expected).abs() <= CLOSE * expected.abs().max(1.0 / STEP_S), "{} {}", found, expected);
                    }
                }
                many.advance_lanes(&mut lanes, starts.len(), &|_| &now);
                for (lane, start) in starts.iter().enumerate() {
                    prop_assert_eq!(many.root(0)[lane].to_bits(), whole[start + step].to_bits());
                }
            }
        }

        #[test]
        fn half_a_step_ahead_a_straight_signal_is_where_half_a_step_takes_it(
            slope in -3.0..3.0_f64, tau in 0.001..0.2_f64, delay in 0.0..0.05_f64,
        ) {
            // A lag or a delay of a signal that is straight between samples does not know the step.
            for text in [format!("lag(x, {tau})"), format!("delay(x, {delay})")] {
                let x = |time_s: f64| if time_s < 0.0 { 0.0 } else { slope * time_s };
                let mut coarse = machine(&text)?;
                let mut lanes = coarse.lanes()?;
                coarse.add_lane(&mut lanes);
                let mut graph = Graph::new();
                let root = graph.add(&Formula::parse(&text)?, &mut |_, _| Ok(None))?;
                let mut fine = Machine::new(&graph, &[root], STEP_S / 2.0, &|_| None)?;
                for step in 0..20 {
                    let (now, half) = (x(STEP_S * f64::from(step)), x(STEP_S * (f64::from(step) + 0.5)));
                    coarse.advance_lanes(&mut lanes, 1, &|_| std::slice::from_ref(&now));
                    coarse.look_ahead(&lanes, 0.5, 1, &|_| std::slice::from_ref(&half));
                    fine.advance(1, &|_| std::slice::from_ref(&now));
                    fine.advance(1, &|_| std::slice::from_ref(&half));
                    prop_assert!((coarse.root(0)[0] - fine.root(0)[0]).abs() <= CLOSE, "{} {}", text, step);
                }
            }
        }
    }

    #[test]
    fn what_is_given_is_taken_and_the_rest_worked_out() -> Result<()> {
        let mut graph = Graph::new();
        let root = graph.add(&Formula::parse("lag(u, 0.1) * x + 2 * (u + 1)")?, &mut |_, _| Ok(None))?;
        let apart = graph.apart_from(&[root], &|name| name == "x");
        assert_eq!(apart.len(), 2, "the lag and the other product");
        let whole = |roots: &[_], given: &[_]| Machine::with_given(&graph, roots, given, STEP_S, &|_| None);
        let (u, x) = ([0.3, 0.5, -1.0], [2.0, 3.0, 5.0]);
        let column = |name: usize| if graph.inputs()[name] == "u" { &u[..] } else { &x[..] };
        let mut plain = whole(&[root], &[])?;
        let order = plain.inputs().to_vec();
        plain.advance(3, &|input| column(order[input]));
        let mut parts = whole(&apart, &[])?;
        let order = parts.inputs().to_vec();
        parts.advance(3, &|input| column(order[input]));
        let mut rest = whole(&[root], &apart)?;
        assert!(!rest.remembers());
        let order = rest.inputs().to_vec();
        let given = |input: usize| match order[input].checked_sub(graph.inputs().len()) {
            Some(place) => &parts.root(place)[..3],
            None => column(order[input]),
        };
        rest.advance(3, &given);
        assert_eq!(rest.root(0)[..3], plain.root(0)[..3]);
        Ok(())
    }

    #[test]
    fn a_symbol_may_be_given_no_time_that_cannot_be() -> Result<()> {
        let mut graph = Graph::new();
        let tau = graph.symbol(0.1, false);
        graph.let_vary(tau);
        let root = graph.add(&Formula::parse("lag(x, tau)")?, &mut |_, name| Ok((name == "tau").then_some(tau)))?;
        assert!(Machine::new(&graph, &[root], STEP_S, &|_| Some(0.2)).is_ok());
        for wrong in [-0.1, f64::NAN] {
            let refused = Machine::new(&graph, &[root], STEP_S, &|_| Some(wrong)).map_err(|error| error.to_string());
            assert!(matches!(refused, Err(text) if text.contains("`lag`") && text.contains("at least 0 s")));
        }
        Ok(())
    }
}
