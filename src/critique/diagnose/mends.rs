//! What mending a log leaves, which looks like an effect: sticks that were moved in time are in step to a sample, and an attitude that was levelled to a
//! fraction of a degree. What was found is held against that; how a log is mended is `check`'s business.

use crate::flight::Source;
use crate::physics::Effect;

/// Times of sticks within so many samples are what moving them leaves.
const LEFT_OF_TIMES: f64 = 1.0;
/// Angles within this, rad, are what levelling leaves.
const LEFT_OF_ANGLES_RAD: f64 = 0.005;
/// Effects that are sticks which act late and nothing else; all of their numbers are times, s.
const LATE_STICKS: [&str; 4] = ["ctrl_delay", "cyclic_lag", "tail_lag", "collective_lag"];
/// The effect of an attitude that is askew; its numbers are angles, rad.
const ASKEW: &str = "tilt_misalign";

/// What the description of the flights mends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mends {
    /// It moves the sticks in time.
    pub sticks_in_time: bool,
    /// It takes angles off the attitude.
    pub levels: bool,
}

impl Mends {
    /// Of flights that were read so.
    ///
    /// # Examples
    /// ```
    /// use phyture::critique::diagnose::Mends;
    /// use phyture::flight::Source;
    ///
    /// let stated = [("drift.controls".to_owned(), "0.004".to_owned())].into();
    /// assert!(Mends::of(&Source { stated, ..Source::default() }).sticks_in_time);
    /// ```
    pub fn of(source: &Source) -> Self {
        Self { sticks_in_time: source.moves_controls(), levels: source.shifts_attitude() }
    }

    /// Why an effect with these numbers is not named: it is within what mending left.
    pub(super) fn doubt(self, effect: &Effect, step_s: f64) -> Option<&'static str> {
        let times = effect.parameters.iter().map(|parameter| parameter.value.abs());
        let angles = effect.coefficients.iter().map(|coefficient| coefficient.value.abs());
        let is_late = || LATE_STICKS.contains(&effect.kind.as_str()) && times.fold(0.0, f64::max) <= LEFT_OF_TIMES * step_s;
        let is_askew = || effect.kind == ASKEW && angles.fold(0.0, f64::max) <= LEFT_OF_ANGLES_RAD;
        match () {
            () if self.sticks_in_time && is_late() => {
                Some("the description moves the sticks in time, and what that leaves, up to a sample, looks the same")
            }
            () if self.levels && is_askew() => {
                Some("the description levels the attitude, and what that leaves, up to a third of a degree, looks the same")
            }
            () => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::catalogue;

    fn effect(kind: &str, value: f64) -> Effect {
        let mut effect = catalogue::definition(kind).expect("of the catalogue").effect(4.0, 0.8);
        effect.parameters.iter_mut().for_each(|parameter| parameter.value = value);
        effect.coefficients.iter_mut().for_each(|coefficient| coefficient.value = value);
        effect
    }

    #[test]
    fn what_mending_leaves_is_no_effect_and_what_is_larger_is() {
        let (time, level) = (Mends { sticks_in_time: true, levels: false }, Mends { sticks_in_time: false, levels: true });
        for kind in LATE_STICKS {
            assert!(time.doubt(&effect(kind, 0.009), 0.01).is_some(), "{kind}");
            assert!(time.doubt(&effect(kind, 0.03), 0.01).is_none(), "{kind}");
            assert!(level.doubt(&effect(kind, 0.009), 0.01).is_none(), "{kind}");
        }
        assert!(level.doubt(&effect(ASKEW, 0.004), 0.01).is_some());
        assert!(level.doubt(&effect(ASKEW, 0.02), 0.01).is_none());
        assert!(time.doubt(&effect(ASKEW, 0.004), 0.01).is_none());
        assert!(time.doubt(&effect("weathercock", 0.0), 0.01).is_none());
    }
}
