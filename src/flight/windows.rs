//! Overlapping histories inside the spans of one partition.

use super::{Flight, Span, Window};

/// Default distance between training windows, samples. A history of 1000 samples holds one window a 10-s segment; overlapping
/// ones make the data that a network needs.
pub const TRAINING_STRIDE: usize = 50;

/// Default distance between test windows, samples.
pub const TEST_STRIDE: usize = 100;

/// Every window of `history` rows at `stride` that lies wholly inside a span.
pub fn windows(spans: &[Span], history: usize, stride: usize) -> Vec<Window> {
    let (history, stride) = (history.max(1), stride.max(1));
    let of_span = |span: &Span| {
        let flight = span.flight;
        (span.start + history - 1..span.end).step_by(stride).map(move |last| Window { flight, last })
    };
    spans.iter().flat_map(of_span).collect()
}

/// Whether a window ends in a row whose acceleration is fitted and judged; see [`Flight::set_aside`].
pub fn counts(flights: &[Flight], window: &Window) -> bool {
    flights.get(window.flight).is_some_and(|flight| flight.count(window.last..window.last + 1) == 1)
}

/// The windows that [count](counts).
pub fn counted(flights: &[Flight], mut windows: Vec<Window>) -> Vec<Window> {
    windows.retain(|window| counts(flights, window));
    windows
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn windows_stay_inside_their_span_and_are_counted(
            start in 0usize..500, length in 0usize..5000, history in 1usize..1200, stride in 1usize..200
        ) {
            let span = Span { flight: 3, start, end: start + length };
            let all = windows(&[span], history, stride);
            let expected = if length < history { 0 } else { (length - history) / stride + 1 };
            prop_assert_eq!(all.len(), expected);
            prop_assert!(all.iter().all(|window| window.last + 1 >= start + history && window.last < span.end && window.flight == 3));
        }
    }

    #[test]
    fn half_overlapping_windows_of_ten_seconds() {
        let run = Span { flight: 0, start: 0, end: 3000 };
        assert_eq!(windows(&[run], 1000, 500).len(), 5);
    }
}
