//! A number for each of the six accelerations, as results and pages hold it. No computing here.

use crate::flight::PerChannel;
use serde::{Deserialize, Serialize};

/// A number for each channel, and their arithmetic mean. `None` (JSON `null`) where there is nothing to compute it from.
///
/// The mean mixes m/s² and rad/s² as the paper's tables do: it ranks models on one data set and means nothing else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelValues {
    /// d(vx)/dt, m/s² for an error.
    pub vx_dot: Option<f64>,
    /// d(vy)/dt, m/s².
    pub vy_dot: Option<f64>,
    /// d(vz)/dt, m/s².
    pub vz_dot: Option<f64>,
    /// d(wx)/dt, rad/s².
    pub wx_dot: Option<f64>,
    /// d(wy)/dt, rad/s².
    pub wy_dot: Option<f64>,
    /// d(wz)/dt, rad/s².
    pub wz_dot: Option<f64>,
    /// Arithmetic mean of the six, absent if one of them is.
    pub mean: Option<f64>,
}

impl ChannelValues {
    /// From values in the order of [`Column::TARGETS`](crate::flight::Column::TARGETS). Values that are not finite become `None`.
    pub fn new(values: PerChannel<Option<f64>>) -> Self {
        let [vx_dot, vy_dot, vz_dot, wx_dot, wy_dot, wz_dot] =
            values.map(|value| value.filter(|value| value.is_finite())).into_array();
        let all: Option<Vec<f64>> = [vx_dot, vy_dot, vz_dot, wx_dot, wy_dot, wz_dot].into_iter().collect();
        let mean = all.map(|values| values.iter().sum::<f64>() / values.len() as f64);
        Self { vx_dot, vy_dot, vz_dot, wx_dot, wy_dot, wz_dot, mean }
    }

    /// The six values in the order of [`Column::TARGETS`](crate::flight::Column::TARGETS).
    pub const fn channels(&self) -> PerChannel<Option<f64>> {
        PerChannel::new([self.vx_dot, self.vy_dot, self.vz_dot, self.wx_dot, self.wy_dot, self.wz_dot])
    }
}

/// A 95 % interval for each channel, from the scatter between blocks of ten seconds; `None` with fewer than two blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Intervals {
    /// d(vx)/dt, m/s².
    pub vx_dot: Option<[f64; 2]>,
    /// d(vy)/dt, m/s².
    pub vy_dot: Option<[f64; 2]>,
    /// d(vz)/dt, m/s².
    pub vz_dot: Option<[f64; 2]>,
    /// d(wx)/dt, rad/s².
    pub wx_dot: Option<[f64; 2]>,
    /// d(wy)/dt, rad/s².
    pub wy_dot: Option<[f64; 2]>,
    /// d(wz)/dt, rad/s².
    pub wz_dot: Option<[f64; 2]>,
    /// Of the mean of the six, where it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<[f64; 2]>,
}

impl Intervals {
    pub(super) fn new(values: PerChannel<Option<[f64; 2]>>) -> Self {
        let finite = |interval: &[f64; 2]| interval.iter().all(|bound| bound.is_finite());
        let [vx_dot, vy_dot, vz_dot, wx_dot, wy_dot, wz_dot] = values.map(|value| value.filter(finite)).into_array();
        Self { vx_dot, vy_dot, vz_dot, wx_dot, wy_dot, wz_dot, mean: None }
    }

    /// The same with an interval of the mean.
    pub(super) fn with_mean(mut self, mean: Option<[f64; 2]>) -> Self {
        self.mean = mean.filter(|bounds| bounds.iter().all(|bound| bound.is_finite()));
        self
    }

    /// The six intervals in the order of [`Column::TARGETS`](crate::flight::Column::TARGETS).
    pub const fn channels(&self) -> PerChannel<Option<[f64; 2]>> {
        PerChannel::new([self.vx_dot, self.vy_dot, self.vz_dot, self.wx_dot, self.wy_dot, self.wz_dot])
    }
}
