//! The switches of the truth helicopter: which mechanisms it has beyond the paper's baseline, and how strong. No physics here.

use crate::error::{Error, Result};
use crate::suggest::did_you_mean;
use serde::ser::{Serialize, SerializeMap, Serializer};

macro_rules! mechanisms {
    ($($variant:ident = $id:literal, $doc:literal;)*) => {
        /// One physical mechanism beyond eqs. 14-15, off (scale 0) or on at a scale. At scale 1 it has the size given here.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Mechanism { $(#[doc = $doc] $variant,)* }

        impl Mechanism {
            /// All, in the order of declaration.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// Identifier, as on the command line; those of the effect catalogue where it knows the mechanism.
            pub const fn id(self) -> &'static str {
                match self { $(Self::$variant => $id,)* }
            }

            /// One sentence on what it does and how large it is at scale 1.
            pub const fn summary(self) -> &'static str {
                match self { $(Self::$variant => $doc,)* }
            }
        }
    };
}

mechanisms! {
    QuadDrag = "quad_drag", "Fuselage drag -½ρ S V v / m with S = 0.06, 0.15, 0.10 m².";
    VelCross = "vel_cross", "Off-diagonal A: 0.04 to 0.10 1/s.";
    InertiaCross = "inertia_cross", "Product of inertia Ixz = 0.025 kg m².";
    CtrlCross = "ctrl_cross", "Swash plate phase error of 6 degrees, collective into roll and pitch, cyclic into yaw.";
    FlapTilt = "flap_tilt", "The thrust tilts with the rotor disc, 0.08 rad per unit of cyclic.";
    TailSideForce = "tail_side_force", "The tail rotor pushes sideways: C2z Izz / (m l) = 3.4 m/s² per unit.";
    CollectiveTorque = "collective_torque", "Rotor torque on the fuselage, 1.2 N m in hover, as the thrust to the power 3/2.";
    HeaveTorque = "heave_torque", "Rotor torque changes with climb, T vz / Ω: 0.9 rad/s² per m/s in hover.";
    ThrustCurve = "thrust_curve", "Thrust is not linear in collective: blade element and momentum theory in hover.";
    TranslLift = "transl_lift", "Thrust grows with forward speed: blade element and momentum theory.";
    ClimbInflow = "climb_inflow", "Heave damping depends on speed and climb: blade element and momentum theory.";
    InflowLag = "inflow_lag", "The induced velocity takes about 30 ms to settle: apparent mass (8/3) ρ R³ of Pitt and Peters.";
    VortexRing = "vortex_ring", "Thrust loss of up to 25 % and roughness in descent at about the induced velocity.";
    GroundEffect = "ground_effect", "Cheeseman and Bennett's thrust ratio near the ground.";
    RateCross = "rate_cross", "Roll rate into pitch (-1.8 1/s) and pitch rate into roll (2.2 1/s) through the flapping rotor.";
    CyclicLag = "cyclic_lag", "First-order flapping states, 50 ms: the cyclic and most of the rate damping act through them.";
    CtrlDelay = "ctrl_delay", "Transport delay of 40 ms on all controls.";
    ServoRateLimit = "servo_rate_limit", "Servos slew at 4 units a second; a scale divides the rate.";
    TailLag = "tail_lag", "First-order tail servo and gyro, 60 ms.";
    CollectiveLag = "collective_lag", "First-order collective servo, 60 ms.";
    RotorDroop = "rotor_droop", "The governor lets the rotor speed droop by 5 % of itself per hover power, in 0.4 s.";
    StallSaturation = "stall_saturation", "Blade stall: the thrust bends over above 1.3 g towards 2.3 g; a scale divides the knee.";
    CtrlNonlin = "ctrl_nonlin", "Linkage: u becomes 0.8 u + 0.2 u³.";
    Weathercock = "weathercock", "Fin of 0.012 m² on the tail boom.";
    DihedralSpeedstab = "dihedral_speedstab", "Rotor blow-back: -0.5 vy in roll and 0.4 vx in pitch, rad/s² per m/s.";
    SpeedDamping = "speed_damping", "Rate damping grows by 2.5 % per m/s of airspeed.";
    TailRotorInflow = "tail_rotor_inflow", "Tail thrust gains 2 % per m/s and loses with yaw rate, -0.25 r|r|.";
    Wind = "wind", "A constant wind of 3 m/s for each flight, from anywhere.";
    Turbulence = "turbulence", "Turbulent wind of first order, 0.7 m/s rms, scale length 20 m at 8 m/s.";
    ImuLever = "imu_lever", "The recorded point is not the centre of mass: 0.08, 0.00, -0.06 m.";
    CgOffset = "cg_offset", "The thrust misses the centre of mass by 8 mm forward and 5 mm to starboard.";
    TiltMisalign = "tilt_misalign", "The recorded attitude is off by 1.5 and -1.0 degrees in roll and pitch.";
    SensorBias = "sensor_bias", "Gyro bias of 0.02 rad/s and velocity bias of 0.2 m/s rms, drawn for each flight.";
    MassDrift = "mass_drift", "Fuel: the mass falls by 10 % over a flight.";
    Sync = "sync", "The recorded attitude is 20 ms late.";
    FuselageWake = "fuselage_wake", "Download and drag of the fuselage in the rotor wake; in no catalogue.";
    TailWake = "tail_wake", "Pitch-up of 4 rad/s² as the main rotor wake sweeps over the tail at 7 m/s; in no catalogue.";
}

impl Mechanism {
    /// Largest scale: beyond it the pilot is not shown to keep the aircraft in the air, in any of the classes.
    pub const fn largest_scale(self) -> f64 {
        match self {
            Self::VortexRing => 1.2,
            Self::StallSaturation | Self::Turbulence => 1.5,
            _ => 3.0,
        }
    }

    /// The mechanism of this identifier.
    ///
    /// # Errors
    /// [`Error::Config`] naming the nearest identifier, or all, if there is none.
    pub fn from_id(id: &str) -> Result<Self> {
        Self::ALL.iter().copied().find(|mechanism| mechanism.id() == id).ok_or_else(|| {
            let ids = || Self::ALL.iter().map(|mechanism| mechanism.id());
            let hint = did_you_mean(id, ids());
            let all = || format!("one of {}", ids().collect::<Vec<_>>().join(", "));
            Error::Config {
                place: "simulation".into(),
                field: "mechanism".into(),
                expected: if hint.is_empty() { all() } else { "a mechanism of the built-in helicopter".into() },
                found: format!("`{id}`{hint}"),
            }
        })
    }
}

/// The scale of every mechanism; 0 is off.
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanisms {
    scales: [f64; Mechanism::ALL.len()],
}

impl Mechanisms {
    /// All off: exactly the paper's baseline.
    pub const fn none() -> Self {
        Self { scales: [0.0; Mechanism::ALL.len()] }
    }

    /// All on at scale 1.
    pub const fn all() -> Self {
        Self { scales: [1.0; Mechanism::ALL.len()] }
    }

    /// The same with one mechanism at this scale.
    #[must_use]
    pub fn with(mut self, mechanism: Mechanism, scale: f64) -> Self {
        self.scales[mechanism as usize] = scale;
        self
    }

    /// Scale of one mechanism.
    pub const fn scale(&self, mechanism: Mechanism) -> f64 {
        self.scales[mechanism as usize]
    }

    /// Whether a mechanism is on.
    pub fn has(&self, mechanism: Mechanism) -> bool {
        self.scale(mechanism) != 0.0
    }

    /// The mechanisms that are on, with their scales.
    pub fn active(&self) -> impl Iterator<Item = (Mechanism, f64)> + '_ {
        Mechanism::ALL.iter().map(|&mechanism| (mechanism, self.scale(mechanism))).filter(|(_, scale)| *scale != 0.0)
    }

    /// Refuses scales that are negative, not finite or beyond [`Mechanism::largest_scale`].
    ///
    /// # Errors
    /// [`Error::Config`] naming the mechanism.
    pub fn check(&self) -> Result<()> {
        match self.active().find(|(mechanism, scale)| !(0.0..=mechanism.largest_scale()).contains(scale)) {
            None => Ok(()),
            Some((mechanism, scale)) => Err(Error::Config {
                place: "simulation".into(),
                field: mechanism.id().into(),
                found: format!("scale {scale}"),
                expected: format!("a number from 0 to {}; 1 is: {}", mechanism.largest_scale(), mechanism.summary()),
            }),
        }
    }
}

impl Serialize for Mechanisms {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (mechanism, scale) in self.active() {
            map.serialize_entry(mechanism.id(), &scale)?;
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_unique_and_found() -> Result<()> {
        for (index, &mechanism) in Mechanism::ALL.iter().enumerate() {
            assert_eq!(Mechanism::from_id(mechanism.id())?, mechanism);
            assert_eq!(mechanism as usize, index);
        }
        let message = Mechanism::from_id("ground_efect").map_err(|error| error.to_string());
        assert!(matches!(message, Err(text) if text.contains("ground_effect")));
        Ok(())
    }

    #[test]
    fn wild_scales_are_refused_by_name() {
        for scale in [-1.0, f64::NAN, 10.0] {
            let message = Mechanisms::none().with(Mechanism::QuadDrag, scale).check().map_err(|error| error.to_string());
            assert!(matches!(message, Err(text) if text.contains("quad_drag")), "{scale}");
        }
        assert!(Mechanisms::all().check().is_ok());
    }

    #[test]
    fn only_what_is_on_is_written() -> std::result::Result<(), serde_json::Error> {
        let text = serde_json::to_string(&Mechanisms::none().with(Mechanism::Wind, 2.0))?;
        assert_eq!(text, r#"{"wind":2.0}"#);
        Ok(())
    }
}
