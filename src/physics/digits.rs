//! How a number of a model is printed beside its interval: with fixed decimals, so that columns can be read, or with an exponent where those would
//! show next to nothing. What the numbers are, nothing here knows.

/// Significant digits of a number with an exponent, behind the first.
const FURTHER_DIGITS: usize = 2;

/// Prints numbers that belong together, such as a value and the ends of its interval, in one form.
pub(crate) fn printer(decimals: usize, together: impl IntoIterator<Item = f64>) -> impl Fn(f64) -> String {
    let largest = together.into_iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    // At most one digit of the largest would be left.
    let is_small = largest > 0.0 && largest < 10_f64.powi(1 - decimals as i32);
    move |value| if is_small { format!("{value:.FURTHER_DIGITS$e}") } else { format!("{value:.decimals$}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_keep_their_digits_and_those_that_belong_together_one_form() {
        let small = printer(5, [2.2243e-6, 1.563e-6, 2.885e-6]);
        assert_eq!([2.2243e-6, 0.0].map(&small), ["2.22e-6", "0.00e0"]);
        let mixed = printer(4, [0.0003, -0.0022, 0.0027]);
        assert_eq!([0.0003, -0.0022].map(mixed), ["0.0003", "-0.0022"]);
        assert_eq!(printer(4, [0.0])(0.0), "0.0000");
        assert_eq!(printer(4, [12.0])(12.0), "12.0000");
    }
}
