//! The truth helicopter as a whole: it repeats, it stays in the air, it is the paper's baseline when nothing is switched on, and
//! each mechanism leaves its mark.
#![cfg(feature = "sim")]

use nalgebra::{DMatrix, DVector};
use phyture::Result;
use phyture::flight::{Column, DataSet, Flight, GRAVITY_M_S2};
use phyture::sim::{
    CLASSES, COEFFICIENTS, INERTIA_KG_M2, LOG_STEP_S, Level, Like, Mechanism, Mechanisms, Simulation, simulate,
    simulate_with_explainable,
};
use phyture_kernels::Tolerance;

/// One sample of a flight: Euler angles, velocity, rates, controls, the six accelerations.
struct Row {
    angles: [f64; 3],
    v: [f64; 3],
    w: [f64; 3],
    u: [f64; 4],
    targets: [f64; 6],
}

fn rows(flight: &Flight) -> impl Iterator<Item = Row> + '_ {
    let at = |column: Column, sample: usize| flight.column(column)[sample];
    (0..flight.len()).map(move |k| Row {
        angles: [Column::Roll, Column::Pitch, Column::Yaw].map(|c| at(c, k)),
        v: [Column::Vx, Column::Vy, Column::Vz].map(|c| at(c, k)),
        w: [Column::Wx, Column::Wy, Column::Wz].map(|c| at(c, k)),
        u: [Column::U1, Column::U2, Column::U3, Column::U4].map(|c| at(c, k)),
        targets: Column::TARGETS.map(|c| at(c, k)),
    })
}

/// Body to local, ZYX.
fn rotation([roll, pitch, yaw]: [f64; 3]) -> [[f64; 3]; 3] {
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    [
        [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
        [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
        [-sp, sr * cp, cr * cp],
    ]
}

/// What eqs. 14-15 know without a coefficient: -ω × v + Rᵀ g, and the gyroscopic terms.
fn known(row: &Row) -> [f64; 6] {
    let ([vx, vy, vz], [p, q, r], [ix, iy, iz]) = (row.v, row.w, INERTIA_KG_M2);
    let [_, _, down] = rotation(row.angles);
    let g = GRAVITY_M_S2;
    [
        r * vy - q * vz + g * down[0],
        p * vz - r * vx + g * down[1],
        q * vx - p * vy + g * down[2],
        (iy - iz) / ix * q * r,
        (iz - ix) / iy * p * r,
        (ix - iy) / iz * p * q,
    ]
}

/// Regressors of a channel and the true coefficients, in the same order.
fn regressors(row: &Row, channel: usize) -> Vec<f64> {
    match channel {
        0 | 1 => vec![row.v[channel]],
        2 => vec![row.v[2], row.u[3], 1.0],
        _ => vec![row.w[channel - 3], row.u[channel - 3], 1.0],
    }
}

fn truth(channel: usize) -> Vec<f64> {
    let c = COEFFICIENTS;
    match channel {
        0 | 1 => vec![c.a[channel]],
        2 => vec![c.a[2], c.c1_z, c.d1_z],
        _ => vec![c.b[channel - 3], c.c2[channel - 3], c.d2[channel - 3]],
    }
}

/// Least squares of one channel: coefficients, standard errors for white residuals, rms of the residual.
fn fit(data: &DataSet, channel: usize) -> (Vec<f64>, Vec<f64>, f64) {
    let size = truth(channel).len();
    let (mut gram, mut moment, mut energy, mut samples) = (DMatrix::zeros(size, size), DVector::zeros(size), 0.0, 0.0);
    for row in data.flights.iter().flat_map(rows) {
        let x = DVector::from_vec(regressors(&row, channel));
        let y = row.targets[channel] - known(&row)[channel];
        gram += &x * x.transpose();
        moment += &x * y;
        energy += y * y;
        samples += 1.0;
    }
    let inverse = gram.try_inverse().unwrap_or_else(|| DMatrix::from_element(size, size, f64::NAN));
    let solution: DVector<f64> = &inverse * &moment;
    let variance = ((energy - solution.dot(&moment)) / samples).max(0.0);
    let errors = (0..size).map(|i| (inverse[(i, i)] * variance).sqrt()).collect();
    (solution.iter().copied().collect(), errors, variance.sqrt())
}

#[test]
fn least_squares_returns_the_truth_at_level_zero() -> Result<()> {
    // Scores (estimate - truth) / standard error over seeds: 95 % within 1.96 and no systematic part.
    let seeds = 8;
    let mut scores = Vec::new();
    for seed in 0..seeds {
        let data = simulate(&Simulation { minutes: 10.0, seed, ..Simulation::baseline() })?;
        for channel in 0..6 {
            let (values, errors, rms) = fit(&data, channel);
            // What is left is the gust (0.3) and a third of the instrument noise.
            assert!((0.29..0.32).contains(&rms), "channel {channel}: {rms}");
            scores.extend(values.iter().zip(&errors).zip(truth(channel)).map(|((value, error), truth)| (value - truth) / error));
        }
    }
    let inside = scores.iter().filter(|score| score.abs() < 1.96).count() as f64 / scores.len() as f64;
    let mean = scores.iter().sum::<f64>() / scores.len() as f64;
    // 112 scores: 95 % plus or minus three binomial standard errors of 2.1 %; the mean within three of 1/sqrt(112).
    assert!(inside > 0.95 - 3.0 * 0.021, "{inside}");
    assert!(mean.abs() < 3.0 / (scores.len() as f64).sqrt(), "{mean}");
    Ok(())
}

#[test]
fn without_mechanisms_gusts_and_noise_the_log_is_the_paper_s_baseline() -> Result<()> {
    let data = simulate(&Simulation { minutes: 10.0, level: Level::QUIET, ..Simulation::baseline() })?;
    assert_eq!(data.manoeuvres().len(), CLASSES.len());
    for channel in 0..6 {
        let largest = data.flights.iter().flat_map(rows).map(|row| row.targets[channel].abs()).fold(1.0, f64::max);
        for row in data.flights.iter().flat_map(rows) {
            let forced: f64 = regressors(&row, channel).iter().zip(truth(channel)).map(|(x, c)| x * c).sum();
            let error = (row.targets[channel] - known(&row)[channel] - forced).abs();
            assert!(error < Tolerance::Close.relative_f64() * largest, "channel {channel}: {error}");
        }
    }
    Ok(())
}

/// Largest difference between the central difference of a column and Simpson's mean of its claimed derivative, and the largest
/// second difference of that derivative: the former is of the order of the latter (step², jerk) if the claim is true.
fn slip(column: &[f64], derivative: &[f64], wrap: bool) -> (f64, f64) {
    let (mut worst, mut curvature) = (0.0_f64, 0.0_f64);
    for (x, f) in column.windows(3).zip(derivative.windows(3)) {
        let mut moved = x[2] - x[0];
        if wrap {
            moved -= std::f64::consts::TAU * (moved / std::f64::consts::TAU).round();
        }
        worst = worst.max((moved / (2.0 * LOG_STEP_S) - (f[0] + 4.0 * f[1] + f[2]) / 6.0).abs());
        curvature = curvature.max((f[0] - 2.0 * f[1] + f[2]).abs());
    }
    (worst, curvature)
}

#[test]
fn position_angles_velocity_and_rates_are_the_integrals_they_should_be() -> Result<()> {
    // Everything on but what makes the instruments disagree with one another, and what makes the derivatives jump.
    let mechanisms =
        [Mechanism::SensorBias, Mechanism::TiltMisalign, Mechanism::Sync, Mechanism::Turbulence, Mechanism::VortexRing]
            .into_iter()
            .fold(Mechanisms::all(), |mechanisms, mechanism| mechanisms.with(mechanism, 0.0));
    let data = simulate(&Simulation { minutes: 10.0, level: Level::QUIET, mechanisms, ..Simulation::default() })?;
    for flight in &data.flights {
        let rows: Vec<Row> = rows(flight).collect();
        let each = |f: &dyn Fn(&Row) -> f64| rows.iter().map(f).collect::<Vec<f64>>();
        let local = |axis: usize| each(&|row| rotation(row.angles)[axis].iter().zip(row.v).map(|(r, v)| r * v).sum());
        let mut pairs = vec![
            (Column::X, local(0)),
            (Column::Y, local(1)),
            (Column::Z, local(2)),
            (Column::Pitch, each(&|row| row.w[1] * row.angles[0].cos() - row.w[2] * row.angles[0].sin())),
        ];
        // Roll has a pole at the zenith and the nadir.
        if rows.iter().all(|row| row.angles[1].cos() > 0.5) {
            pairs.push((
                Column::Roll,
                each(&|row| {
                    let (sine, cosine) = row.angles[0].sin_cos();
                    row.w[0] + row.angles[1].tan() * (row.w[1] * sine + row.w[2] * cosine)
                }),
            ));
        }
        for (value, target) in
            [(Column::Vx, 0), (Column::Vy, 1), (Column::Vz, 2), (Column::Wx, 3), (Column::Wy, 4), (Column::Wz, 5)]
        {
            pairs.push((value, each(&|row| row.targets[target])));
        }
        for (column, derivative) in pairs {
            let (worst, curvature) = slip(flight.column(column), &derivative, matches!(column, Column::Roll));
            assert!(worst <= curvature, "{} in {}: {worst} against {curvature}", column.name(), flight.name);
        }
    }
    Ok(())
}

#[test]
fn each_mechanism_leaves_its_mark() -> Result<()> {
    // Without gusts a fit of the baseline is exact; with any mechanism on it is not.
    for &mechanism in Mechanism::ALL {
        let mechanisms = Mechanisms::none().with(mechanism, 1.0);
        let classes = Some(["hover_low", "chaos", "descents", "forward_sideways_flight"].map(String::from).to_vec());
        let data = simulate(&Simulation { minutes: 2.0, level: Level::QUIET, mechanisms, classes, ..Simulation::baseline() })?;
        let rms: Vec<f64> = (0..6).map(|channel| fit(&data, channel).2).collect();
        let largest = rms.iter().copied().fold(0.0, f64::max);
        // A tenth of the gusts of level zero.
        assert!(largest > 0.03, "{}: {rms:?}", mechanism.id());
    }
    Ok(())
}

/// Lowest height, largest speed and largest control of a session.
fn extremes(data: &DataSet) -> (f64, f64, f64) {
    let mut extremes = (f64::INFINITY, 0.0_f64, 0.0_f64);
    for flight in &data.flights {
        for (row, down) in rows(flight).zip(flight.column(Column::Z)) {
            let speed = row.v.iter().map(|v| v * v).sum::<f64>().sqrt();
            let stick = row.u.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
            extremes = (extremes.0.min(-down), extremes.1.max(speed), extremes.2.max(stick));
        }
    }
    extremes
}

#[test]
fn nothing_crashes_or_runs_away() -> Result<()> {
    // The aircraft is built for 30 m/s; the skids are 10 cm below the recorded point.
    let check = |name: &str, simulation: &Simulation| -> Result<()> {
        let (height, speed, stick) = extremes(&simulate(simulation)?);
        eprintln!("{name}: lowest {height:.2} m, fastest {speed:.1} m/s, largest control {stick:.2}");
        assert!(height > 0.1 && speed < 30.0 && stick <= 1.0, "{name}: {height} m, {speed} m/s, stick {stick}");
        Ok(())
    };
    for seed in 0..4 {
        check(&format!("seed {seed}, all on"), &Simulation { minutes: 10.0, seed, level: QUIET_NOISE, ..Simulation::default() })?;
        check(&format!("seed {seed}, all off"), &Simulation { minutes: 10.0, seed, level: QUIET_NOISE, ..Simulation::baseline() })?;
    }
    let classes = ["hover_low", "chaos", "freestyle_aggressive", "descents"].map(String::from).to_vec();
    for &mechanism in Mechanism::ALL {
        let mechanisms = Mechanisms::none().with(mechanism, mechanism.largest_scale());
        let classes = Some(classes.clone());
        check(mechanism.id(), &Simulation { minutes: 2.0, mechanisms, level: QUIET_NOISE, classes, ..Simulation::default() })?;
    }
    Ok(())
}

/// Gusts that last, without instrument noise: what the aircraft did, not what was recorded of it.
const QUIET_NOISE: Level = Level { noise: 0.0, ..Level::ONE };

#[test]
fn the_same_seed_gives_the_same_bits_and_another_does_not() -> Result<()> {
    let session = Simulation { minutes: 2.0, ..Simulation::default() };
    let bits = |simulation: &Simulation| -> Result<Vec<u64>> {
        let data = simulate(simulation)?;
        Ok(data.flights.iter().flat_map(|flight| flight.canonical().iter().map(|x| x.to_bits()).collect::<Vec<_>>()).collect())
    };
    let first = bits(&session)?;
    assert_eq!(first, bits(&session)?);
    assert_ne!(first, bits(&Simulation { seed: session.seed + 1, ..session.clone() })?);
    #[cfg(feature = "rayon")]
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let Ok(pool) = pool else { continue };
        assert_eq!(first, pool.install(|| bits(&session))?, "{threads} threads");
    }
    Ok(())
}

#[test]
fn a_session_like_the_stanford_set_has_20_flights_and_7376_s() -> Result<()> {
    let data = simulate(&Simulation { like: Like::Stanford, ..Simulation::baseline() })?;
    assert_eq!((data.flights.len(), data.manoeuvres().len()), (20, 20));
    assert!((data.duration_s() - 7376.0).abs() < Tolerance::Close.relative_f64() * 7376.0);
    assert!(data.flights.iter().all(|flight| (140.0..=510.0).contains(&flight.duration_s())));
    Ok(())
}

#[test]
fn wrong_requests_are_refused_with_what_is_possible() {
    let refused = |simulation: Simulation| simulate(&simulation).map(|_| ()).map_err(|error| error.to_string());
    let unknown = refused(Simulation { classes: Some(vec!["hovr".into()]), ..Simulation::default() });
    assert!(matches!(unknown, Err(text) if text.contains("`hovr`") && text.contains("hover_low")));
    for minutes in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = refused(Simulation { minutes, ..Simulation::default() });
        assert!(matches!(error, Err(text) if text.contains("minutes")), "{minutes}");
    }
    let hidden = Simulation::baseline().hide("no_such_effect", 1.0).map(|_| ()).map_err(|error| error.to_string());
    assert!(matches!(hidden, Err(text) if text.contains("ground_effect")));
}

#[test]
fn the_explainable_part_is_what_is_left_without_gusts_and_noise() -> Result<()> {
    // Nothing is left out where nothing disturbs, with every mechanism that is no chance.
    let without_chance = Mechanisms::all().with(Mechanism::Turbulence, 0.0).with(Mechanism::VortexRing, 0.0);
    let quiet = Simulation { minutes: 2.0, seed: 7500, level: Level::QUIET, mechanisms: without_chance, ..Simulation::default() };
    let (recorded, explainable) = simulate_with_explainable(&quiet)?;
    for (log, floor) in recorded.flights.iter().zip(&explainable.flights) {
        assert_eq!((&log.name, log.canonical()), (&floor.name, floor.canonical()));
    }
    // White gusts and noise of 0.3 m/s² and 0.3 rad/s²: at level zero they are the difference, and nothing else is.
    let gusty = Simulation { level: Level { noise: 0.0, ..Level::ZERO }, mechanisms: Mechanisms::all(), ..quiet };
    let gusty = Simulation {
        mechanisms: gusty.mechanisms.clone().with(Mechanism::Turbulence, 0.0).with(Mechanism::ImuLever, 0.0),
        ..gusty
    };
    let (recorded, explainable) = simulate_with_explainable(&gusty)?;
    for column in Column::TARGETS {
        let pairs = recorded.flights.iter().zip(&explainable.flights);
        let left: Vec<f64> =
            pairs.flat_map(|(log, floor)| log.column(column).iter().zip(floor.column(column)).map(|(a, b)| a - b)).collect();
        let rms = (left.iter().map(|x| x * x).sum::<f64>() / left.len() as f64).sqrt();
        // 12 000 samples of white noise; the roughness of the vortex ring adds a little along z.
        assert!((0.29..0.34).contains(&rms), "{}: {rms}", column.name());
    }
    // The log is that of the session without it.
    let alone = simulate(&gusty)?;
    assert!(alone.flights.iter().zip(&recorded.flights).all(|(a, b)| a.canonical() == b.canonical()));
    Ok(())
}
