//! How the errors of a model's numbers go together: thrust and its bias at a nearly constant collective are each known badly and their sum well.
//! Beside the intervals of the numbers these give the covariances; here they are kept, not found (calibration, bootstrap and jackknife find them).

use super::effect::Effect;
use nalgebra::DMatrix;

/// Correlations are kept to so many decimals: a file stays readable, and no estimate of one is better.
const DECIMALS: f64 = 1e4;

/// Correlations between the estimates of some numbers of a model; those of different groups are zero.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Correlation {
    /// The numbers, as `effect.name`.
    pub numbers: Vec<String>,
    /// Below the diagonal, row by row: of the second with the first, of the third with the first and the second, and so on.
    pub below: Vec<f64>,
}

impl Correlation {
    /// How a number is called here.
    pub fn label(effect: &Effect, name: &str) -> String {
        format!("{}.{name}", effect.name)
    }

    /// From deviations of the numbers in equally likely worlds, one row a world: r_ij = Σ d_i d_j / √(Σ d_i² Σ d_j²). `None` for fewer than two
    /// numbers. One that never deviates has no correlation.
    pub fn of_deviations(numbers: Vec<String>, deviations: &[Vec<f64>]) -> Option<Self> {
        if numbers.len() < 2 {
            return None;
        }
        let product = |i: usize, j: usize| deviations.iter().map(|world| world[i] * world[j]).sum::<f64>();
        let pairs = (1..numbers.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let below = pairs.map(|(i, j)| {
            let found = product(i, j) / (product(i, i) * product(j, j)).sqrt();
            if found.is_finite() { (found * DECIMALS).round() / DECIMALS } else { 0.0 }
        });
        Some(Self { below: below.collect(), numbers })
    }

    /// Why it is none, if it is none.
    pub fn fault(&self) -> Option<&'static str> {
        let count = self.numbers.len();
        match () {
            () if self.below.len() != count * count.saturating_sub(1) / 2 => {
                Some("one number for each pair, row by row below the diagonal")
            }
            () if self.below.iter().any(|value| !(-1.0..=1.0).contains(value)) => Some("correlations from -1 to 1"),
            () => None,
        }
    }

    fn between(&self, one: &str, other: &str) -> Option<f64> {
        let place = |wanted: &str| self.numbers.iter().position(|number| number == wanted);
        let (one, other) = (place(one)?, place(other)?);
        let (row, column) = (one.max(other), one.min(other));
        if row == column { Some(1.0) } else { self.below.get(row * (row - 1) / 2 + column).copied() }
    }
}

/// The correlations of some numbers as a matrix: 1 on the diagonal, 0 for pairs of which nothing is known.
pub fn correlation_matrix(groups: &[Correlation], numbers: &[String]) -> DMatrix<f64> {
    DMatrix::from_fn(numbers.len(), numbers.len(), |row, column| {
        let known = || groups.iter().find_map(|group| group.between(&numbers[row], &numbers[column]));
        if row == column { 1.0 } else { known().unwrap_or(0.0) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_moves_together_is_correlated_and_groups_are_not() {
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let worlds = [vec![1.0, 2.0, 0.0, 1.0], vec![-1.0, -2.0, 0.0, 1.0], vec![2.0, 4.0, 0.0, -2.0], vec![-2.0, -4.0, 0.0, 0.0]];
        let group = Correlation::of_deviations(names(&["a.x", "a.y", "b.z", "b.w"]), &worlds).expect("four numbers");
        let other = Correlation::of_deviations(names(&["c.x", "c.y"]), &[vec![1.0, -1.0]]).expect("two numbers");
        let matrix = correlation_matrix(&[group, other], &names(&["c.y", "a.y", "a.x", "b.z", "c.x", "new"]));
        assert_eq!((matrix[(1, 2)], matrix[(2, 1)], matrix[(0, 4)]), (1.0, 1.0, -1.0));
        // What never moves, other groups, and what no fit knew.
        assert!([(1, 3), (0, 1), (2, 4), (5, 0)].iter().all(|at| matrix[*at] == 0.0) && matrix[(5, 5)] == 1.0);
        assert_eq!(Correlation::of_deviations(names(&["a.x"]), &worlds), None);
        assert!(Correlation { numbers: names(&["a", "b"]), below: vec![] }.fault().is_some());
        assert!(Correlation { numbers: names(&["a", "b"]), below: vec![1.5] }.fault().is_some());
    }

    proptest! {
        #[test]
        fn correlations_are_symmetric_and_within_one(worlds in prop::collection::vec(prop::collection::vec(-1e3..1e3_f64, 5), 1..20)) {
            let numbers: Vec<String> = (0..5).map(|number| format!("e.{number}")).collect();
            let group = Correlation::of_deviations(numbers.clone(), &worlds).expect("five numbers");
            prop_assert_eq!(group.fault(), None);
            let matrix = correlation_matrix(&[group], &numbers);
            prop_assert_eq!(matrix.transpose(), matrix);
        }
    }
}
