//! The six accelerations that models predict, and a value for each of them. Names and units are those of [`Column`].

use super::Column;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::{Index, IndexMut};

/// A predicted acceleration a = [v̇, ω̇] (paper eq. 7): three of translation, m/s², and three of rotation, rad/s². In files its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "usize", try_from = "usize")]
pub enum Channel {
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

impl Channel {
    /// Number of channels.
    pub const COUNT: usize = 6;

    /// All, in the order of [`Column::TARGETS`].
    pub const ALL: [Self; Self::COUNT] = [Self::VxDot, Self::VyDot, Self::VzDot, Self::WxDot, Self::WyDot, Self::WzDot];

    /// Position in [`Channel::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The column in which it is measured.
    pub const fn column(self) -> Column {
        Column::TARGETS[self as usize]
    }

    /// Name of its column, `vx_dot` to `wz_dot`.
    pub const fn name(self) -> &'static str {
        self.column().name()
    }

    /// `m/s²` or `rad/s²`.
    pub const fn unit(self) -> &'static str {
        self.column().unit()
    }

    /// Whether it is an angular acceleration.
    pub const fn is_angular(self) -> bool {
        self as usize >= Self::WxDot as usize
    }

    /// The channel at a position of [`Channel::ALL`].
    pub fn from_index(index: usize) -> Option<Self> {
        Self::ALL.get(index).copied()
    }

    /// The channel whose column has this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|channel| channel.name() == name)
    }

    /// The channel that a column measures, if it does.
    pub fn of_column(column: Column) -> Option<Self> {
        Self::ALL.into_iter().find(|channel| channel.column() == column)
    }
}

impl From<Channel> for usize {
    fn from(channel: Channel) -> Self {
        channel.index()
    }
}

impl TryFrom<usize> for Channel {
    type Error = String;

    fn try_from(index: usize) -> Result<Self, String> {
        Self::from_index(index).ok_or_else(|| format!("channel {index}; expected 0 to 5, an index of the six accelerations"))
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A value for each channel, in the order of [`Channel::ALL`]; in files an array of six.
///
/// # Examples
/// ```
/// use phyture::flight::{Channel, PerChannel};
/// let error = PerChannel::from_fn(|channel: Channel| if channel.is_angular() { 0.3 } else { 1.0 });
/// assert_eq!(error[Channel::WzDot], 0.3);
/// for (channel, error) in error.pairs() {
///     println!("{channel} {error} {}", channel.unit());
/// }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PerChannel<T>([T; Channel::COUNT]);

impl<T> PerChannel<T> {
    /// From values in the order of [`Channel::ALL`].
    pub const fn new(values: [T; Channel::COUNT]) -> Self {
        Self(values)
    }

    /// The value of each channel from the channel.
    pub fn from_fn(of: impl FnMut(Channel) -> T) -> Self {
        Self(Channel::ALL.map(of))
    }

    /// Each value changed.
    pub fn map<U>(self, change: impl FnMut(T) -> U) -> PerChannel<U> {
        PerChannel(self.0.map(change))
    }

    /// The values in the order of [`Channel::ALL`].
    pub fn iter(&self) -> std::slice::Iter<'_, T> {
        self.0.iter()
    }

    /// The values, to be changed.
    pub fn iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
        self.0.iter_mut()
    }

    /// Channels with their values.
    pub fn pairs(&self) -> impl DoubleEndedIterator<Item = (Channel, &T)> + ExactSizeIterator + Clone {
        Channel::ALL.into_iter().zip(&self.0)
    }

    /// Channels with their values, to be changed.
    pub fn pairs_mut(&mut self) -> impl DoubleEndedIterator<Item = (Channel, &mut T)> + ExactSizeIterator {
        Channel::ALL.into_iter().zip(&mut self.0)
    }

    /// The values as an array.
    pub const fn values(&self) -> &[T; Channel::COUNT] {
        &self.0
    }

    /// The values as an array.
    pub fn into_array(self) -> [T; Channel::COUNT] {
        self.0
    }
}

impl<T: Clone> PerChannel<T> {
    /// The same value in all channels.
    pub fn splat(value: T) -> Self {
        Self(std::array::from_fn(|_| value.clone()))
    }
}

impl<T> Index<Channel> for PerChannel<T> {
    type Output = T;

    fn index(&self, channel: Channel) -> &T {
        &self.0[channel as usize]
    }
}

impl<T> IndexMut<Channel> for PerChannel<T> {
    fn index_mut(&mut self, channel: Channel) -> &mut T {
        &mut self.0[channel as usize]
    }
}

impl<T> From<[T; Channel::COUNT]> for PerChannel<T> {
    fn from(values: [T; Channel::COUNT]) -> Self {
        Self(values)
    }
}

impl<T> From<PerChannel<T>> for [T; Channel::COUNT] {
    fn from(values: PerChannel<T>) -> Self {
        values.0
    }
}

impl<T> IntoIterator for PerChannel<T> {
    type Item = T;
    type IntoIter = std::array::IntoIter<T, { Channel::COUNT }>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl<'a, T> IntoIterator for &'a PerChannel<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl<'a, T> IntoIterator for &'a mut PerChannel<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter_mut()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_the_targets_in_their_order() {
        assert_eq!(Channel::ALL.map(Channel::column), Column::TARGETS);
        for (index, channel) in Channel::ALL.into_iter().enumerate() {
            assert_eq!(channel.index(), index);
            assert_eq!(Channel::from_index(index), Some(channel));
            assert_eq!(Channel::from_name(channel.name()), Some(channel));
            assert_eq!(Channel::of_column(channel.column()), Some(channel));
            assert_eq!(channel.is_angular(), channel.unit() == "rad/s²");
        }
        assert_eq!(Channel::from_index(6), None);
        assert!(serde_json::from_str::<Channel>("6").is_err_and(|error| error.to_string().contains("0 to 5")));
        assert_eq!(Channel::from_name("wz"), None);
        assert_eq!(Channel::of_column(Column::Wz), None);
    }

    #[test]
    fn a_value_a_channel_is_an_array_in_files() -> Result<(), Box<dyn std::error::Error>> {
        let values = PerChannel::from_fn(|channel| channel.index() as f64 + 0.5);
        let text = serde_json::to_string(&values)?;
        assert_eq!(text, "[0.5,1.5,2.5,3.5,4.5,5.5]");
        assert_eq!(serde_json::from_str::<PerChannel<f64>>(&text)?, values);
        Ok(())
    }
}
