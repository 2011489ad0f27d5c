//! Whether what is left of a channel's error leaves an effect its name. What decides whether an effect is worth while stands in `gates`; here it is held against
//! all that stays unexplained beside it.
//!
//! Two things are asked. Where most of a channel is left unexplained, something without a name is at work in it, and an effect that removes little beside that may be its
//! shadow: what an omitted variable must explain to make a coefficient vanish is about the root of what the coefficient explains (Cinelli & Hazlett 2020,
//! "Making sense of sensitivity", J. R. Stat. Soc. B 82, 39 to 67). And a stick whose record errs bends the regression on it, whatever the error is (Carroll et al.
//! 2006, "Measurement Error in Nonlinear Models", chapter 3): the mean of what was, given what was recorded, is a straight line only for
//! normal variables. The bend is then small beside the error that makes it; that of a linkage leaves none.

use super::gates::MOSTLY_UNEXPLAINED;
use super::rest::Share;
use crate::flight::{Channel, PerChannel};

/// Of a channel that is mostly unexplained an effect has to remove this share of what is left there.
const LEAST_OF_LEFT: f64 = 0.1;
/// A channel of which so much of its variance is left has an error that may be that of a stick's record …
const PARTLY_UNEXPLAINED: f64 = 0.2;
/// … and the curve of a stick has to remove this share of what is left there.
const LEAST_OF_LEFT_BY_CURVE: f64 = 0.5;
/// Effects that are a curve of a stick and nothing else.
const CURVES: [&str; 1] = ["ctrl_nonlin"];

/// Why an effect is not named in spite of what it removes; `None` where nothing speaks against it. An effect that is worth while in a channel in which it is
/// beyond doubt keeps its name.
pub(super) fn doubt(
    kind: &str,
    channels: &[Channel],
    shares: &PerChannel<Share>,
    variance: &PerChannel<f64>,
) -> Option<&'static str> {
    let bars = |channel: &Channel| {
        let Share { by_itself, left, .. } = shares[*channel];
        let unexplained = left / variance[*channel];
        let is_below = |from: f64, least: f64| unexplained > from && by_itself < least * left;
        (is_below(MOSTLY_UNEXPLAINED, LEAST_OF_LEFT), is_below(PARTLY_UNEXPLAINED, LEAST_OF_LEFT_BY_CURVE))
    };
    let all = |is_so: &dyn Fn((bool, bool)) -> bool| !channels.is_empty() && channels.iter().all(|channel| is_so(bars(channel)));
    match () {
        () if all(&|(weak, _)| weak) => Some(
            "most of the error of its channels is of nothing that has a name here, and it removes less than a tenth of that: it may be the shadow of that",
        ),
        () if CURVES.contains(&kind) && all(&|(weak, bent)| weak || bent) => Some(
            "much of the error of its channels stays, and it removes less than half of that: a stick whose record errs (noise, another gain for a while, \
             something added behind it) looks curved, too",
        ),
        () => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(kind: &str, by_itself: f64, left: f64) -> bool {
        let shares = PerChannel::splat(Share { by_all: by_itself, by_itself, left });
        doubt(kind, &[Channel::WxDot], &shares, &PerChannel::splat(1.0)).is_some()
    }

    #[test]
    fn a_little_effect_needs_a_channel_that_is_mostly_explained() {
        assert!(of("weathercock", 0.05, 0.6));
        assert!(!of("weathercock", 0.05, 0.4), "most is explained");
        assert!(!of("weathercock", 0.07, 0.6), "it removes a tenth of what is left");
        assert!(of("ctrl_nonlin", 0.05, 0.4), "a record that errs would do the same");
        assert!(!of("ctrl_nonlin", 0.05, 0.1), "nothing is left that a record could be to blame for");
        assert!(!of("ctrl_nonlin", 0.3, 0.4));
    }

    proptest! {
        #[test]
        fn one_channel_beyond_doubt_is_enough(by in 0.0..0.04_f64, left in 0.5..1.0_f64) {
            let mut shares = PerChannel::splat(Share { by_all: by, by_itself: by, left });
            let one = PerChannel::splat(1.0);
            prop_assume!(left > MOSTLY_UNEXPLAINED);
            let both = [Channel::WxDot, Channel::WyDot];
            prop_assert!(doubt("ctrl_nonlin", &both, &shares, &one).is_some());
            shares[Channel::WyDot].left = 0.01;
            prop_assert!(doubt("ctrl_nonlin", &both, &shares, &one).is_none());
            prop_assert!(doubt("ctrl_nonlin", &[], &shares, &one).is_none());
        }
    }
}
