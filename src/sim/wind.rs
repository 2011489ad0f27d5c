//! The air and other disturbances of one flight: mean wind, turbulence, and the force and moment gusts of a level. How the
//! aircraft answers is in `body.rs`.

use super::Level;
use super::mechanisms::{Mechanism, Mechanisms};
use super::random::{GaussMarkov, Random};
use std::f64::consts::TAU;

/// Mean wind at scale 1, m/s.
pub(super) const WIND_M_S: f64 = 3.0;
/// Turbulence at scale 1, m/s rms, horizontal components; the vertical one is 60 % of it near the ground (MIL-F-8785C shape).
const TURBULENCE_M_S: f64 = 0.7;
/// Its correlation time, s: a scale length of 20 m passed at 8 m/s.
const TURBULENCE_TIME_S: f64 = 2.5;
/// Correlation time of the roughness in the vortex ring state, s.
const ROUGHNESS_TIME_S: f64 = 0.15;

/// What acts on the aircraft from a log sample to the next, held in between.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Disturbance {
    /// Velocity of the air, north-east-down, m/s.
    pub(super) air: [f64; 3],
    /// Specific force in body axes, m/s².
    pub(super) force: [f64; 3],
    /// Angular acceleration in body axes, rad/s².
    pub(super) moment: [f64; 3],
    /// Unit-rms roughness of the vortex ring state.
    pub(super) roughness: f64,
}

impl Disturbance {
    /// What is left of it for a model to explain: the mean wind. Gusts, turbulence and roughness are chance.
    pub(super) fn explainable(air: &Atmosphere) -> Self {
        Self { air: air.mean, ..Self::default() }
    }
}

/// Its generator.
#[derive(Clone, Debug)]
pub(super) struct Atmosphere {
    mean: [f64; 3],
    turbulence: [GaussMarkov; 3],
    force: [GaussMarkov; 3],
    moment: [GaussMarkov; 3],
    roughness: GaussMarkov,
    random: Random,
}

impl Atmosphere {
    pub(super) fn new(level: &Level, mechanisms: &Mechanisms, step_s: f64, mut random: Random) -> Self {
        let from = TAU * random.uniform();
        let speed = WIND_M_S * mechanisms.scale(Mechanism::Wind);
        let turbulence = TURBULENCE_M_S * mechanisms.scale(Mechanism::Turbulence);
        let process = |rms, time_s, random: &mut Random| GaussMarkov::new(rms, time_s, step_s, random);
        Self {
            mean: [speed * from.cos(), speed * from.sin(), 0.0],
            turbulence: [1.0, 1.0, 0.6].map(|share| process(share * turbulence, TURBULENCE_TIME_S, &mut random)),
            force: [(); 3].map(|()| process(level.gust_force_m_s2, level.gust_force_time_s, &mut random)),
            moment: [(); 3].map(|()| process(level.gust_moment_rad_s2, level.gust_moment_time_s, &mut random)),
            roughness: process(1.0, ROUGHNESS_TIME_S, &mut random),
            random,
        }
    }

    /// The disturbance of the next log sample.
    pub(super) fn next(&mut self) -> Disturbance {
        let random = &mut self.random;
        let turbulence = self.turbulence.each_mut().map(|process| process.next(random));
        Disturbance {
            air: std::array::from_fn(|axis| self.mean[axis] + turbulence[axis]),
            force: self.force.each_mut().map(|process| process.next(random)),
            moment: self.moment.each_mut().map(|process| process.next(random)),
            roughness: self.roughness.next(random),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quiet_level_without_mechanisms_disturbs_nothing() {
        let mut still = Atmosphere::new(&Level::QUIET, &Mechanisms::none(), 0.01, Random::new(1, 0, 0));
        for _ in 0..100 {
            let now = still.next();
            assert_eq!((now.air, now.force, now.moment), ([0.0; 3], [0.0; 3], [0.0; 3]));
        }
    }

    #[test]
    fn switching_turbulence_on_leaves_the_gusts_as_they_were() {
        let fly = |mechanisms: &Mechanisms| {
            let mut air = Atmosphere::new(&Level::ONE, mechanisms, 0.01, Random::new(1, 0, 0));
            (0..50).map(|_| air.next()).collect::<Vec<_>>()
        };
        let (off, on) = (fly(&Mechanisms::none()), fly(&Mechanisms::none().with(Mechanism::Turbulence, 1.0)));
        assert!(off.iter().zip(&on).all(|(off, on)| off.force == on.force && off.moment == on.moment));
        assert!(on.iter().all(|on| on.air != [0.0; 3]));
    }
}
