//! The canonical columns of a flight log: names, units, order. The one place where the header is written down.

/// One of the 22 canonical columns after `t`, in the order of the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[rustfmt::skip]
pub enum Column {
    /// North, m.
    X,
    /// East, m.
    Y,
    /// Down, m; height above ground is `-z`.
    Z,
    /// Roll, ZYX Euler, rad.
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
    /// Lateral cyclic, about [-1, 1].
    U1,
    /// Longitudinal cyclic.
    U2,
    /// Tail.
    U3,
    /// Collective.
    U4,
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

impl Column {
    /// Number of canonical columns.
    pub const COUNT: usize = 22;

    /// All, in the order of the header.
    #[rustfmt::skip]
    pub const ALL: [Self; Self::COUNT] = [
        Self::X, Self::Y, Self::Z, Self::Roll, Self::Pitch, Self::Yaw, Self::Vx, Self::Vy, Self::Vz, Self::Wx, Self::Wy, Self::Wz,
        Self::U1, Self::U2, Self::U3, Self::U4, Self::VxDot, Self::VyDot, Self::VzDot, Self::WxDot, Self::WyDot, Self::WzDot,
    ];

    /// The 16 state and control channels of the history S (paper eq. 10): position, Euler angles, velocity, rates, controls.
    pub const STATE: &'static [Self] = Self::ALL.split_at(16).0;

    /// The six targets a = [v̇, ω̇] (paper eq. 7).
    pub const TARGETS: [Self; 6] = [Self::VxDot, Self::VyDot, Self::VzDot, Self::WxDot, Self::WyDot, Self::WzDot];

    /// Name in the header.
    #[rustfmt::skip]
    pub const fn name(self) -> &'static str {
        const NAMES: [&str; Column::COUNT] = [
            "x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "wx", "wy", "wz", "u1", "u2", "u3", "u4",
            "vx_dot", "vy_dot", "vz_dot", "wx_dot", "wy_dot", "wz_dot",
        ];
        NAMES[self as usize]
    }

    /// SI unit; `"1"` for the controls.
    #[rustfmt::skip]
    pub const fn unit(self) -> &'static str {
        const UNITS: [&str; Column::COUNT] = [
            "m", "m", "m", "rad", "rad", "rad", "m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s", "1", "1", "1", "1",
            "m/s²", "m/s²", "m/s²", "rad/s²", "rad/s²", "rad/s²",
        ];
        UNITS[self as usize]
    }

    /// The column of this name, if it is canonical.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|column| column.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_names_and_targets_agree() {
        for (index, column) in Column::ALL.into_iter().enumerate() {
            assert_eq!(column as usize, index);
            assert_eq!(Column::from_name(column.name()), Some(column));
        }
        assert_eq!(Column::STATE.len(), 16);
        assert_eq!(Column::TARGETS, Column::ALL[16..]);
    }
}
