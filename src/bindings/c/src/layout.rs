//! What goes across the border as numbers: the order of the states and of the accelerations, and a prediction. The order is that of
//! `phyture::flight::Column`; here are its names in C.

/// Numbers of a state: position, Euler angles, velocity, rates, controls.
pub const PHYTURE_STATES: usize = 16;

/// Accelerations of a prediction.
pub const PHYTURE_ACCELERATIONS: usize = 6;

/// Places in a state.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhytureState {
    /// North, m.
    X,
    /// East, m.
    Y,
    /// Down, m; height above ground is -z.
    Z,
    /// Roll, rad.
    Roll,
    /// Pitch, rad.
    Pitch,
    /// Yaw, rad.
    Yaw,
    /// Inertial velocity along the nose, m/s.
    Vx,
    /// Inertial velocity to starboard, m/s.
    Vy,
    /// Inertial velocity along body down, m/s.
    Vz,
    /// Roll rate, rad/s.
    Wx,
    /// Pitch rate, rad/s.
    Wy,
    /// Yaw rate, rad/s.
    Wz,
    /// Lateral cyclic, as it was logged for calibration, about -1 to 1.
    U1,
    /// Longitudinal cyclic.
    U2,
    /// Tail.
    U3,
    /// Collective.
    U4,
}

/// Places in the arrays of a prediction.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhytureAcceleration {
    /// d(vx)/dt of the body component, m/s².
    VxDot,
    /// d(vy)/dt, m/s².
    VyDot,
    /// d(vz)/dt, m/s².
    VzDot,
    /// d(wx)/dt, rad/s².
    WxDot,
    /// d(wy)/dt, rad/s².
    WyDot,
    /// d(wz)/dt, rad/s².
    WzDot,
}

/// Where a sample lies beside what calibration and training saw.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhyturePlace {
    /// The model does not know: a model file, or a hybrid of before there were envelopes.
    Unknown,
    /// Inside: each quantity in its range, and the sample near to one that was seen.
    Inside,
    /// A quantity is beyond its range: PhyturePrediction.beyond says which.
    Beyond,
    /// Each quantity is in its range, but all together farther from everything that was seen than any sample of the training.
    Apart,
}

/// A prediction and its parts, in the order of PhytureAcceleration: m/s² and rad/s².
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhyturePrediction {
    /// The predicted accelerations: physics + linear + network; for a network that does not learn a residual, what it says alone. NaN while
    /// the prediction is not complete.
    pub acceleration: [f64; PHYTURE_ACCELERATIONS],
    /// The calibrated model alone; there from the first sample.
    pub physics: [f64; PHYTURE_ACCELERATIONS],
    /// What the linear history says; 0 where there is none.
    pub linear: [f64; PHYTURE_ACCELERATIONS],
    /// What the network says; 0 where there is none, NaN while the prediction is not complete.
    pub network: [f64; PHYTURE_ACCELERATIONS],
    /// Half of the interval around the acceleration, made to hold 90 % of the measurements of flights like those of the training; NaN where
    /// there is none.
    pub half_width: [f64; PHYTURE_ACCELERATIONS],
    /// Where the sample lies beside what calibration and training saw. Outside neither prediction nor interval is backed by data.
    pub place: PhyturePlace,
    /// For PHYTURE_PLACE_BEYOND the quantity that is farthest out, an index for phyture_stream_envelope_name; else 0.
    pub beyond: usize,
    /// Whether the network has its history: from the phyture_stream_history-th sample on. A model without a network is always complete.
    pub complete: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use phyture::flight::{Channel, Column};

    /// `VxDot` as `vx_dot`.
    fn snake(name: &str) -> String {
        let lower = |(place, letter): (usize, char)| {
            let line = (place > 0 && letter.is_uppercase()).then_some('_');
            line.into_iter().chain(letter.to_lowercase())
        };
        name.chars().enumerate().flat_map(lower).collect()
    }

    #[test]
    fn places_are_those_of_the_library() {
        use PhytureAcceleration::{VxDot, VyDot, VzDot, WxDot, WyDot, WzDot};
        use PhytureState::{Pitch, Roll, U1, U2, U3, U4, Vx, Vy, Vz, Wx, Wy, Wz, X, Y, Yaw, Z};
        let states = [X, Y, Z, Roll, Pitch, Yaw, Vx, Vy, Vz, Wx, Wy, Wz, U1, U2, U3, U4];
        assert_eq!((states.len(), Column::STATE.len()), (PHYTURE_STATES, PHYTURE_STATES));
        for (place, state) in states.into_iter().enumerate() {
            assert_eq!((state as usize, Column::STATE[place].name()), (place, snake(&format!("{state:?}")).as_str()));
        }
        let accelerations = [VxDot, VyDot, VzDot, WxDot, WyDot, WzDot];
        assert_eq!((accelerations.len(), Channel::COUNT), (PHYTURE_ACCELERATIONS, PHYTURE_ACCELERATIONS));
        for (place, acceleration) in accelerations.into_iter().enumerate() {
            assert_eq!((acceleration as usize, Channel::ALL[place].name()), (place, snake(&format!("{acceleration:?}")).as_str()));
        }
    }
}
