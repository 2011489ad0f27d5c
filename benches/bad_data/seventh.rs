//! Bad data as a flight-test engineer meets it in logs of unmanned aircraft (logs of autopilots, model helicopters with RC telemetry,
//! motion capture), the most common first: signs, units, late streams, wrong frames, lost and repeated rows, sticks that are not what the
//! servos got. Written on 2026-11-28 by someone who had seen neither the checks nor the other lists, so that some
//! repeat what those have. Reported once, on seeds 85010 and 85011, and looked at since: they are for development now.

use crate::change::{ANGULAR, ATTITUDE, CONTROLS, Chance, Change, Corruption, Kind, LINEAR, Log, POSITION, Part, RATES, VELOCITY};
use phyture::flight::Column;
use phyture::flight::attitude::{cross, rotate, rotate_back, rotation_body_to_inertial};
use std::ops::Range;

/// The most common ones first. Words that are looked for stand beside each other, or they would fill the file.
#[rustfmt::skip]
pub const SEVENTH: &[Corruption] = &[
    Corruption {
        id: "rates_in_degrees",
        kind: Kind::Units,
        says: "Gyro rates are logged in degrees per second, as most consumer loggers do.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&RATES, 1.0_f64.to_degrees())),
        right: &[
            &["rates", "deg"], &["rates", "57"], &["rates", "unit"], &["rates", "scale"], &["rates", "factor"], &["wx", "deg"],
            &["wx", "57"], &["wx", "unit"], &["wx", "scale"], &["wx", "factor"], &["wy", "deg"], &["wy", "57"], &["wy", "unit"],
            &["wy", "scale"], &["wy", "factor"], &["wz", "deg"], &["wz", "57"], &["wz", "unit"], &["wz", "scale"], &["wz", "factor"],
        ],
    },
    Corruption {
        id: "pitch_stick_reversed",
        kind: Kind::Sticks,
        says: "The elevator channel is reversed in the transmitter, and the log holds the stick.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&[Column::U2], -1.0)),
        right: &[
            &["u2", "sign of"], &["u2", " sign "], &["u2", "wrong sign"], &["u2", "opposite"], &["u2", "revers"], &["u2", "invert"],
            &["u2", "negat"], &["u2", "flip"], &["u2", "mirror"], &["longitudinal cyclic", "sign of"], &["longitudinal cyclic", " sign "],
            &["longitudinal cyclic", "wrong sign"], &["longitudinal cyclic", "opposite"], &["longitudinal cyclic", "revers"],
            &["longitudinal cyclic", "invert"], &["longitudinal cyclic", "negat"], &["longitudinal cyclic", "flip"],
            &["longitudinal cyclic", "mirror"], &["pitch stick", "sign of"], &["pitch stick", " sign "], &["pitch stick", "wrong sign"],
            &["pitch stick", "opposite"], &["pitch stick", "revers"], &["pitch stick", "invert"], &["pitch stick", "negat"],
            &["pitch stick", "flip"], &["pitch stick", "mirror"], &["-u2"],
        ],
    },
    Corruption {
        id: "controls_late_80_ms",
        kind: Kind::Timing,
        says: "RC frames and the logger's queue bring the controls 80 ms after the motion that they belong to.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.late(&CONTROLS, 0.08)),
        right: &[
            &["controls", " late"], &["controls", " lag"], &["controls", "delay"], &["controls", "behind"], &["controls", "time shift"],
            &["controls", "shifted by"], &["u1", " late"], &["u1", " lag"], &["u1", "delay"], &["u1", "behind"], &["u1", "time shift"],
            &["u1", "shifted by"], &["u2", " late"], &["u2", " lag"], &["u2", "delay"], &["u2", "behind"], &["u2", "time shift"],
            &["u2", "shifted by"], &["u3", " late"], &["u3", " lag"], &["u3", "delay"], &["u3", "behind"], &["u3", "time shift"],
            &["u3", "shifted by"], &["u4", " late"], &["u4", " lag"], &["u4", "delay"], &["u4", "behind"], &["u4", "time shift"],
            &["u4", "shifted by"], &["linear accelerations", "early"], &["linear accelerations", "earlier"],
            &["linear accelerations", "ahead"], &["angular accelerations", "early"], &["angular accelerations", "earlier"],
            &["angular accelerations", "ahead"], &["targets", "early"], &["targets", "earlier"], &["targets", "ahead"], &["rates", "early"],
            &["rates", "earlier"], &["rates", "ahead"],
        ],
    },
    Corruption {
        id: "specific_force_too",
        kind: Kind::Frames,
        says: "The accelerometer's specific force stands where the derivative of the body velocity should.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| with_each_row(log, specific_force)),
        right: &[
            &["specific force"], &["linear accelerations", "accelerometer"], &["linear accelerations", "gravity"],
            &["linear accelerations", "9.8"], &["linear accelerations", "coriolis"], &["linear accelerations", "w x v"],
            &["linear targets", "accelerometer"], &["linear targets", "gravity"], &["linear targets", "9.8"],
            &["linear targets", "coriolis"], &["linear targets", "w x v"], &["vx_dot", "accelerometer"], &["vx_dot", "gravity"],
            &["vx_dot", "9.8"], &["vx_dot", "coriolis"], &["vx_dot", "w x v"], &["vy_dot", "accelerometer"], &["vy_dot", "gravity"],
            &["vy_dot", "9.8"], &["vy_dot", "coriolis"], &["vy_dot", "w x v"], &["vz_dot", "accelerometer"], &["vz_dot", "gravity"],
            &["vz_dot", "9.8"], &["vz_dot", "coriolis"], &["vz_dot", "w x v"],
        ],
    },
    Corruption {
        id: "pwm_microseconds",
        kind: Kind::Units,
        says: "Controls are servo pulses in microseconds, 1000 to 2000, and nobody normalised them.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.each(&CONTROLS, |stick| 1500.0 + 500.0 * stick)),
        right: &[
            &["controls", "pwm"], &["controls", "microsec"], &["controls", "µs"], &["controls", "pulse"], &["controls", "1500"],
            &["controls", "range"], &["controls", "normalis"], &["controls", "normaliz"], &["controls", "unit"], &["controls", "scale"],
            &["controls", "factor"], &["u1", "pwm"], &["u1", "microsec"], &["u1", "µs"], &["u1", "pulse"], &["u1", "1500"],
            &["u1", "range"], &["u1", "normalis"], &["u1", "normaliz"], &["u1", "unit"], &["u1", "scale"], &["u1", "factor"],
            &["u2", "pwm"], &["u2", "microsec"], &["u2", "µs"], &["u2", "pulse"], &["u2", "1500"], &["u2", "range"], &["u2", "normalis"],
            &["u2", "normaliz"], &["u2", "unit"], &["u2", "scale"], &["u2", "factor"], &["u3", "pwm"], &["u3", "microsec"], &["u3", "µs"],
            &["u3", "pulse"], &["u3", "1500"], &["u3", "range"], &["u3", "normalis"], &["u3", "normaliz"], &["u3", "unit"],
            &["u3", "scale"], &["u3", "factor"], &["u4", "pwm"], &["u4", "microsec"], &["u4", "µs"], &["u4", "pulse"], &["u4", "1500"],
            &["u4", "range"], &["u4", "normalis"], &["u4", "normaliz"], &["u4", "unit"], &["u4", "scale"], &["u4", "factor"],
        ],
    },
    Corruption {
        id: "attitude_in_degrees",
        kind: Kind::Units,
        says: "Roll, pitch and yaw are in degrees, as in the ATT message of a flight controller.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&ATTITUDE, 1.0_f64.to_degrees())),
        right: &[
            &["attitude", "deg"], &["attitude", "57"], &["attitude", "unit"], &["attitude", "scale"], &["attitude", "factor"],
            &["roll", "deg"], &["roll", "57"], &["roll", "unit"], &["roll", "scale"], &["roll", "factor"], &["pitch", "deg"],
            &["pitch", "57"], &["pitch", "unit"], &["pitch", "scale"], &["pitch", "factor"], &["yaw", "deg"], &["yaw", "57"],
            &["yaw", "unit"], &["yaw", "scale"], &["yaw", "factor"],
        ],
    },
    Corruption {
        id: "imu_axes_flu",
        kind: Kind::Frames,
        says: "The inertial unit reports forward, left, up: rates and accelerations have y and z the other way round.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&LEFT_UP, -1.0)),
        right: &[
            &["flu ", "frd"], &["forward", "left", "up"], &["rates", "axes"], &["y and z", "axes"], &["rates", "sign of"],
            &["rates", " sign "], &["rates", "wrong sign"], &["rates", "opposite"], &["rates", "revers"], &["rates", "invert"],
            &["rates", "negat"], &["rates", "flip"], &["rates", "mirror"], &["wy", "sign of"], &["wy", " sign "], &["wy", "wrong sign"],
            &["wy", "opposite"], &["wy", "revers"], &["wy", "invert"], &["wy", "negat"], &["wy", "flip"], &["wy", "mirror"],
            &["wz", "sign of"], &["wz", " sign "], &["wz", "wrong sign"], &["wz", "opposite"], &["wz", "revers"], &["wz", "invert"],
            &["wz", "negat"], &["wz", "flip"], &["wz", "mirror"], &["vy_dot", "sign of"], &["vy_dot", " sign "], &["vy_dot", "wrong sign"],
            &["vy_dot", "opposite"], &["vy_dot", "revers"], &["vy_dot", "invert"], &["vy_dot", "negat"], &["vy_dot", "flip"],
            &["vy_dot", "mirror"], &["vz_dot", "sign of"], &["vz_dot", " sign "], &["vz_dot", "wrong sign"], &["vz_dot", "opposite"],
            &["vz_dot", "revers"], &["vz_dot", "invert"], &["vz_dot", "negat"], &["vz_dot", "flip"], &["vz_dot", "mirror"],
            &["linear accelerations", "sign of"], &["linear accelerations", " sign "], &["linear accelerations", "wrong sign"],
            &["linear accelerations", "opposite"], &["linear accelerations", "revers"], &["linear accelerations", "invert"],
            &["linear accelerations", "negat"], &["linear accelerations", "flip"], &["linear accelerations", "mirror"],
            &["angular accelerations", "sign of"], &["angular accelerations", " sign "], &["angular accelerations", "wrong sign"],
            &["angular accelerations", "opposite"], &["angular accelerations", "revers"], &["angular accelerations", "invert"],
            &["angular accelerations", "negat"], &["angular accelerations", "flip"], &["angular accelerations", "mirror"],
        ],
    },
    Corruption {
        id: "channel_order_aetr",
        kind: Kind::Sticks,
        says: "The receiver sends aileron, elevator, throttle, rudder; throttle is read as tail and rudder as collective.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.swap(Column::U3, Column::U4)),
        right: &[
            &["u3", "u4", "swap"], &["u3", "u4", "exchang"], &["u3", "u4", "interchang"], &["u3", "u4", "wrong order"],
            &["u3", "u4", "order of the"], &["u3", "u4", "mixed up"], &["u3", "u4", "instead of"], &["tail", "collective", "swap"],
            &["tail", "collective", "exchang"], &["tail", "collective", "interchang"], &["channel order"], &["order of the channels"],
            &["channels", "swap", "u3"], &["channels", "exchang", "u3"],
        ],
    },
    Corruption {
        id: "gps_velocity_late",
        kind: Kind::Timing,
        says: "Velocities come from the GPS receiver, which reports them 0.2 s after the fact.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.late(&VELOCITY, 0.2)),
        right: &[
            &["velocities", " late"], &["velocities", " lag"], &["velocities", "delay"], &["velocities", "behind"],
            &["velocities", "time shift"], &["velocities", "shifted by"], &["vx", " late"], &["vx", " lag"], &["vx", "delay"],
            &["vx", "behind"], &["vx", "time shift"], &["vx", "shifted by"], &["vy", " late"], &["vy", " lag"], &["vy", "delay"],
            &["vy", "behind"], &["vy", "time shift"], &["vy", "shifted by"], &["vz", " late"], &["vz", " lag"], &["vz", "delay"],
            &["vz", "behind"], &["vz", "time shift"], &["vz", "shifted by"], &["linear accelerations", "early"],
            &["linear accelerations", "earlier"], &["linear accelerations", "ahead"], &["linear targets", "early"],
            &["linear targets", "earlier"], &["linear targets", "ahead"], &["vx_dot", "early"], &["vx_dot", "earlier"],
            &["vx_dot", "ahead"], &["vy_dot", "early"], &["vy_dot", "earlier"], &["vy_dot", "ahead"], &["vz_dot", "early"],
            &["vz_dot", "earlier"], &["vz_dot", "ahead"], &["position", "early"], &["position", "earlier"], &["position", "ahead"],
        ],
    },
    Corruption {
        id: "rows_dropped",
        kind: Kind::Timing,
        says: "The card could not keep up: every few seconds some rows are gone and the rest is joined up as if nothing were.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(rows_dropped),
        right: &[
            &["dropped"], &["dropout"], &["drop-out"], &["gap"], &["rows", "missing"], &["rows", "lost"], &["samples", "missing"],
            &["samples", "lost"], &["rows", "cut out"], &["rows", "gone"], &["packet", "lost"], &["packets", "missing"],
            &["jump", "time", "!times"], &["clock", "jump"], &["time", "skip"], &["rows", "skip"], &["not continuous"], &["discontinu"],
        ],
    },
    Corruption {
        id: "mocap_loss_zeros",
        kind: Kind::Cells,
        says: "Where the cameras lost the model the pose was NaN, and the export wrote zeros.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(pose_zeroed),
        right: &[
            &["position", "zero"], &["position", " 0 "], &["position", " 0,"], &["position", "dropout"], &["position", "lost"],
            &["position", "missing"], &["position", "placeholder"], &["x, y", "zero"], &["x, y", " 0 "], &["x, y", " 0,"],
            &["x, y", "dropout"], &["x, y", "lost"], &["x, y", "missing"], &["x, y", "placeholder"], &["attitude", "zero"],
            &["attitude", " 0 "], &["attitude", " 0,"], &["attitude", "dropout"], &["attitude", "lost"], &["attitude", "missing"],
            &["attitude", "placeholder"], &["roll", "zero"], &["roll", " 0 "], &["roll", " 0,"], &["roll", "dropout"], &["roll", "lost"],
            &["roll", "missing"], &["roll", "placeholder"], &["pitch", "zero"], &["pitch", " 0 "], &["pitch", " 0,"], &["pitch", "dropout"],
            &["pitch", "lost"], &["pitch", "missing"], &["pitch", "placeholder"], &["yaw", "zero"], &["yaw", " 0 "], &["yaw", " 0,"],
            &["yaw", "dropout"], &["yaw", "lost"], &["yaw", "missing"], &["yaw", "placeholder"],
        ],
    },
    Corruption {
        id: "rudder_reversed",
        kind: Kind::Sticks,
        says: "The tail channel is reversed for the gyro's sake; the log has the channel.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&[Column::U3], -1.0)),
        right: &[
            &["u3", "sign of"], &["u3", " sign "], &["u3", "wrong sign"], &["u3", "opposite"], &["u3", "revers"], &["u3", "invert"],
            &["u3", "negat"], &["u3", "flip"], &["u3", "mirror"], &["tail", "sign of"], &["tail", " sign "], &["tail", "wrong sign"],
            &["tail", "opposite"], &["tail", "revers"], &["tail", "invert"], &["tail", "negat"], &["tail", "flip"], &["tail", "mirror"],
            &["rudder", "sign of"], &["rudder", " sign "], &["rudder", "wrong sign"], &["rudder", "opposite"], &["rudder", "revers"],
            &["rudder", "invert"], &["rudder", "negat"], &["rudder", "flip"], &["rudder", "mirror"], &["-u3"],
        ],
    },
    Corruption {
        id: "velocity_of_earth",
        kind: Kind::Frames,
        says: "Velocities are north, east, down, as the estimator gives them, not along the body.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| with_each_row(log, velocity_of_earth)),
        right: &[
            &["velocities", "inertial"], &["velocities", " ned"], &["velocities", "earth"], &["velocities", "world"],
            &["velocities", "navigation"], &["velocities", "north"], &["velocities", "frame"], &["velocities", "rotated"],
            &["vx", "inertial"], &["vx", " ned"], &["vx", "earth"], &["vx", "world"], &["vx", "navigation"], &["vx", "north"],
            &["vx", "frame"], &["vx", "rotated"], &["vy", "inertial"], &["vy", " ned"], &["vy", "earth"], &["vy", "world"],
            &["vy", "navigation"], &["vy", "north"], &["vy", "frame"], &["vy", "rotated"], &["vz", "inertial"], &["vz", " ned"],
            &["vz", "earth"], &["vz", "world"], &["vz", "navigation"], &["vz", "north"], &["vz", "frame"], &["vz", "rotated"],
        ],
    },
    Corruption {
        id: "acceleration_in_g",
        kind: Kind::Units,
        says: "Linear accelerations are in g.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&LINEAR, 1.0 / GRAVITY)),
        right: &[
            &["linear accelerations", "in g"], &["linear accelerations", "of g "], &["linear accelerations", "9.8"],
            &["linear accelerations", "too small"], &["linear accelerations", "unit"], &["linear accelerations", "scale"],
            &["linear accelerations", "factor"], &["linear targets", "in g"], &["linear targets", "of g "], &["linear targets", "9.8"],
            &["linear targets", "too small"], &["linear targets", "unit"], &["linear targets", "scale"], &["linear targets", "factor"],
            &["vx_dot", "in g"], &["vx_dot", "of g "], &["vx_dot", "9.8"], &["vx_dot", "too small"], &["vx_dot", "unit"],
            &["vx_dot", "scale"], &["vx_dot", "factor"], &["vy_dot", "in g"], &["vy_dot", "of g "], &["vy_dot", "9.8"],
            &["vy_dot", "too small"], &["vy_dot", "unit"], &["vy_dot", "scale"], &["vy_dot", "factor"], &["vz_dot", "in g"],
            &["vz_dot", "of g "], &["vz_dot", "9.8"], &["vz_dot", "too small"], &["vz_dot", "unit"], &["vz_dot", "scale"],
            &["vz_dot", "factor"],
        ],
    },
    Corruption {
        id: "velocity_at_5_hz",
        kind: Kind::Noise,
        says: "Velocities come five times a second and each is repeated until the next.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.held(&VELOCITY, 0.2)),
        right: &[
            &["velocities", " held"], &["velocities", "holds "], &["velocities", "repeat"], &["velocities", " hz"],
            &["velocities", "low rate"], &["velocities", "slow"], &["velocities", "stair"], &["velocities", "sample-and-hold"],
            &["velocities", "stale"], &["velocities", "frozen"], &["vx", " held"], &["vx", "holds "], &["vx", "repeat"], &["vx", " hz"],
            &["vx", "low rate"], &["vx", "slow"], &["vx", "stair"], &["vx", "sample-and-hold"], &["vx", "stale"], &["vx", "frozen"],
            &["vy", " held"], &["vy", "holds "], &["vy", "repeat"], &["vy", " hz"], &["vy", "low rate"], &["vy", "slow"], &["vy", "stair"],
            &["vy", "sample-and-hold"], &["vy", "stale"], &["vy", "frozen"], &["vz", " held"], &["vz", "holds "], &["vz", "repeat"],
            &["vz", " hz"], &["vz", "low rate"], &["vz", "slow"], &["vz", "stair"], &["vz", "sample-and-hold"], &["vz", "stale"],
            &["vz", "frozen"],
        ],
    },
    Corruption {
        id: "cyclic_swapped",
        kind: Kind::Sticks,
        says: "Aileron and elevator are exchanged: the transmitter's mode is not that of the converter.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.swap(Column::U1, Column::U2)),
        right: &[
            &["u1", "u2", "swap"], &["u1", "u2", "exchang"], &["u1", "u2", "interchang"], &["u1", "u2", "wrong order"],
            &["u1", "u2", "order of the"], &["u1", "u2", "mixed up"], &["u1", "u2", "instead of"], &["cyclic", "swap"],
            &["cyclic", "exchang"],
        ],
    },
    Corruption {
        id: "gyro_spikes",
        kind: Kind::Cells,
        says: "Single rates are far off now and then: a bit error on the bus or a radio packet with a bad checksum.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(spikes),
        right: &[
            &["rates", "spike"], &["rates", "outlier"], &["rates", "glitch"], &["rates", "jump"], &["rates", "implausib"],
            &["rates", "single sample"], &["rates", "single cell"], &["wx", "spike"], &["wx", "outlier"], &["wx", "glitch"],
            &["wx", "jump"], &["wx", "implausib"], &["wx", "single sample"], &["wx", "single cell"], &["wy", "spike"], &["wy", "outlier"],
            &["wy", "glitch"], &["wy", "jump"], &["wy", "implausib"], &["wy", "single sample"], &["wy", "single cell"], &["wz", "spike"],
            &["wz", "outlier"], &["wz", "glitch"], &["wz", "jump"], &["wz", "implausib"], &["wz", "single sample"], &["wz", "single cell"],
        ],
    },
    Corruption {
        id: "rotor_vibration",
        kind: Kind::Noise,
        says: "The main rotor shakes the accelerometer at 23 Hz, and there was no filter.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(vibration),
        right: &[
            &["linear accelerations", "vibrat"], &["linear accelerations", " hz"], &["linear accelerations", "oscillat"],
            &["linear accelerations", "periodic"], &["linear accelerations", "sine"], &["linear accelerations", "resonan"],
            &["linear accelerations", "rotor"], &["linear accelerations", "alias"], &["linear accelerations", "noise"],
            &["linear accelerations", "noisy"], &["linear targets", "vibrat"], &["linear targets", " hz"], &["linear targets", "oscillat"],
            &["linear targets", "periodic"], &["linear targets", "sine"], &["linear targets", "resonan"], &["linear targets", "rotor"],
            &["linear targets", "alias"], &["linear targets", "noise"], &["linear targets", "noisy"], &["vx_dot", "vibrat"],
            &["vx_dot", " hz"], &["vx_dot", "oscillat"], &["vx_dot", "periodic"], &["vx_dot", "sine"], &["vx_dot", "resonan"],
            &["vx_dot", "rotor"], &["vx_dot", "alias"], &["vx_dot", "noise"], &["vx_dot", "noisy"], &["vy_dot", "vibrat"],
            &["vy_dot", " hz"], &["vy_dot", "oscillat"], &["vy_dot", "periodic"], &["vy_dot", "sine"], &["vy_dot", "resonan"],
            &["vy_dot", "rotor"], &["vy_dot", "alias"], &["vy_dot", "noise"], &["vy_dot", "noisy"], &["vz_dot", "vibrat"],
            &["vz_dot", " hz"], &["vz_dot", "oscillat"], &["vz_dot", "periodic"], &["vz_dot", "sine"], &["vz_dot", "resonan"],
            &["vz_dot", "rotor"], &["vz_dot", "alias"], &["vz_dot", "noise"], &["vz_dot", "noisy"],
        ],
    },
    Corruption {
        id: "mocap_millimetres",
        kind: Kind::Units,
        says: "The motion capture gives millimetres, and the velocities were made from them.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.scale(&[POSITION, VELOCITY].concat(), 1000.0)),
        right: &[
            &["position", " mm"], &["position", "millimet"], &["position", "1000"], &["position", "thousand"], &["position", "unit"],
            &["position", "scale"], &["position", "factor"], &["x, y", " mm"], &["x, y", "millimet"], &["x, y", "1000"],
            &["x, y", "thousand"], &["x, y", "unit"], &["x, y", "scale"], &["x, y", "factor"], &["velocities", " mm"],
            &["velocities", "millimet"], &["velocities", "1000"], &["velocities", "thousand"], &["velocities", "unit"],
            &["velocities", "scale"], &["velocities", "factor"], &["vx", " mm"], &["vx", "millimet"], &["vx", "1000"], &["vx", "thousand"],
            &["vx", "unit"], &["vx", "scale"], &["vx", "factor"], &["vy", " mm"], &["vy", "millimet"], &["vy", "1000"], &["vy", "thousand"],
            &["vy", "unit"], &["vy", "scale"], &["vy", "factor"], &["vz", " mm"], &["vz", "millimet"], &["vz", "1000"], &["vz", "thousand"],
            &["vz", "unit"], &["vz", "scale"], &["vz", "factor"],
        ],
    },
    Corruption {
        id: "position_enu",
        kind: Kind::Frames,
        says: "Position is east, north, up as in ROS.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(position_enu),
        right: &[
            &["position", "enu"], &["position", "east"], &["position", "swap"], &["position", "exchang"], &["position", "axes"],
            &["position", "upward"], &["position", " up "], &["position", "mirror"], &["position", "frame"], &["x, y", "enu"],
            &["x, y", "east"], &["x, y", "swap"], &["x, y", "exchang"], &["x, y", "axes"], &["x, y", "upward"], &["x, y", " up "],
            &["x, y", "mirror"], &["x, y", "frame"], &["x and y", "enu"], &["x and y", "east"], &["x and y", "swap"],
            &["x and y", "exchang"], &["x and y", "axes"], &["x and y", "upward"], &["x and y", " up "], &["x and y", "mirror"],
            &["x and y", "frame"], &[" z ", "sign of"], &[" z ", " sign "], &[" z ", "wrong sign"], &[" z ", "opposite"], &[" z ", "negat"],
            &[" z ", "revers"], &[" z ", "invert"], &[" z ", "upward"], &[" z ", "altitude"], &[" z ", "height"], &[" z ", "flip"],
        ],
    },
    Corruption {
        id: "mocap_pose_late",
        kind: Kind::Timing,
        says: "The motion capture's pose takes 120 ms over the network and is stamped when it arrives.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.late(&[POSITION, ATTITUDE].concat(), 0.12)),
        right: &[
            &["position", " late"], &["position", " lag"], &["position", "delay"], &["position", "behind"], &["position", "time shift"],
            &["pose", " late"], &["pose", " lag"], &["pose", "delay"], &["pose", "behind"], &["pose", "time shift"], &["attitude", " late"],
            &["attitude", " lag"], &["attitude", "delay"], &["attitude", "behind"], &["attitude", "time shift"], &["roll", " late"],
            &["roll", " lag"], &["roll", "delay"], &["roll", "behind"], &["roll", "time shift"], &["pitch", " late"], &["pitch", " lag"],
            &["pitch", "delay"], &["pitch", "behind"], &["pitch", "time shift"], &["yaw", " late"], &["yaw", " lag"], &["yaw", "delay"],
            &["yaw", "behind"], &["yaw", "time shift"], &["rates", "early"], &["rates", "earlier"], &["rates", "ahead"],
            &["velocities", "early"], &["velocities", "earlier"], &["velocities", "ahead"], &["controls", "early"],
            &["controls", "earlier"], &["controls", "ahead"], &["targets", "early"], &["targets", "earlier"], &["targets", "ahead"],
        ],
    },
    Corruption {
        id: "pitch_trim_changed",
        kind: Kind::Sticks,
        says: "Before these flights the pilot moved the elevator trim: neutral is elsewhere in the log.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(|log, _| log.each(&[Column::U2], |stick| stick + 0.15)),
        right: &[
            &["u2", "offset"], &["u2", "trim"], &["u2", "bias"], &["u2", "neutral"], &["u2", "centre"], &["u2", "center"],
            &["u2", "shifted"], &["longitudinal cyclic", "offset"], &["longitudinal cyclic", "trim"], &["longitudinal cyclic", "bias"],
            &["longitudinal cyclic", "neutral"], &["longitudinal cyclic", "centre"], &["longitudinal cyclic", "center"],
            &["longitudinal cyclic", "shifted"], &["pitch stick", "offset"], &["pitch stick", "trim"], &["pitch stick", "bias"],
            &["pitch stick", "neutral"], &["pitch stick", "centre"], &["pitch stick", "center"], &["pitch stick", "shifted"],
            &["u2", "mean", "differ"],
        ],
    },
    Corruption {
        id: "controls_seconds_off",
        kind: Kind::Timing,
        says: "The transmitter's log was joined by hand and is off by a second or so, other in each flight.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(controls_seconds_off),
        right: &[
            &["controls", " late"], &["controls", " lag"], &["controls", "delay"], &["controls", "behind"], &["controls", "early"],
            &["controls", "earlier"], &["controls", "ahead"], &["controls", "shift"], &["controls", "time offset"], &["controls", "clock"],
            &["controls", "align"], &["controls", "not belong"], &["controls", "mismatch"], &["controls", "another flight"],
            &["controls", "other flight"], &["controls", "join"], &["u1", " late"], &["u1", " lag"], &["u1", "delay"], &["u1", "behind"],
            &["u1", "early"], &["u1", "earlier"], &["u1", "ahead"], &["u1", "shift"], &["u1", "time offset"], &["u1", "clock"],
            &["u1", "align"], &["u1", "not belong"], &["u1", "mismatch"], &["u1", "another flight"], &["u1", "other flight"],
            &["u1", "join"], &["u2", " late"], &["u2", " lag"], &["u2", "delay"], &["u2", "behind"], &["u2", "early"], &["u2", "earlier"],
            &["u2", "ahead"], &["u2", "shift"], &["u2", "time offset"], &["u2", "clock"], &["u2", "align"], &["u2", "not belong"],
            &["u2", "mismatch"], &["u2", "another flight"], &["u2", "other flight"], &["u2", "join"], &["u3", " late"], &["u3", " lag"],
            &["u3", "delay"], &["u3", "behind"], &["u3", "early"], &["u3", "earlier"], &["u3", "ahead"], &["u3", "shift"],
            &["u3", "time offset"], &["u3", "clock"], &["u3", "align"], &["u3", "not belong"], &["u3", "mismatch"],
            &["u3", "another flight"], &["u3", "other flight"], &["u3", "join"], &["u4", " late"], &["u4", " lag"], &["u4", "delay"],
            &["u4", "behind"], &["u4", "early"], &["u4", "earlier"], &["u4", "ahead"], &["u4", "shift"], &["u4", "time offset"],
            &["u4", "clock"], &["u4", "align"], &["u4", "not belong"], &["u4", "mismatch"], &["u4", "another flight"],
            &["u4", "other flight"], &["u4", "join"],
        ],
    },
    Corruption {
        id: "gyro_lowpass",
        kind: Kind::Noise,
        says: "Rates went through the flight controller's low-pass filter for the display, 2 Hz wide.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.lag(&RATES, 0.08)),
        right: &[
            &["rates", " late"], &["rates", " lag"], &["rates", "delay"], &["rates", "behind"], &["rates", "filter"], &["rates", "smooth"],
            &["rates", "low-pass"], &["rates", "lowpass"], &["rates", "slow"], &["rates", "attenuat"], &["wx", " late"], &["wx", " lag"],
            &["wx", "delay"], &["wx", "behind"], &["wx", "filter"], &["wx", "smooth"], &["wx", "low-pass"], &["wx", "lowpass"],
            &["wx", "slow"], &["wx", "attenuat"], &["wy", " late"], &["wy", " lag"], &["wy", "delay"], &["wy", "behind"], &["wy", "filter"],
            &["wy", "smooth"], &["wy", "low-pass"], &["wy", "lowpass"], &["wy", "slow"], &["wy", "attenuat"], &["wz", " late"],
            &["wz", " lag"], &["wz", "delay"], &["wz", "behind"], &["wz", "filter"], &["wz", "smooth"], &["wz", "low-pass"],
            &["wz", "lowpass"], &["wz", "slow"], &["wz", "attenuat"], &["attitude", "early"], &["attitude", "earlier"],
            &["attitude", "ahead"], &["angular accelerations", "early"], &["angular accelerations", "earlier"],
            &["angular accelerations", "ahead"], &["angular targets", "early"], &["angular targets", "earlier"],
            &["angular targets", "ahead"],
        ],
    },
    Corruption {
        id: "yaw_offset",
        kind: Kind::Frames,
        says: "The rigid body was defined with its nose 20 degrees off, so all headings are.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.each(&[Column::Yaw], |yaw| wrapped(yaw + 0.35))),
        right: &[
            &["yaw", "offset"], &["yaw", "bias"], &["yaw", "rotated"], &["yaw", "turned"], &["yaw", "misalign"], &["yaw", "declination"],
            &["yaw", "heading"], &["yaw", "shifted"], &["heading", "offset"], &["heading", "bias"], &["heading", "turned"],
            &["heading", "rotated"], &["position", "rotated"], &["position", "turned"], &["position", "misalign"],
            &["velocities", "rotated"], &["velocities", "turned"], &["velocities", "misalign"],
        ],
    },
    Corruption {
        id: "collective_0_to_1",
        kind: Kind::Units,
        says: "Collective is the throttle stick from 0 to 1, not from -1 to 1.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.each(&[Column::U4], |stick| 0.5 + 0.5 * stick)),
        right: &[
            &["u4", "offset"], &["u4", "range"], &["u4", "0 to 1"], &["u4", "[0, 1]"], &["u4", "0..1"], &["u4", "0-1"], &["u4", "percent"],
            &["u4", "normalis"], &["u4", "normaliz"], &["u4", "bias"], &["u4", "gain"], &["u4", "mean"], &["u4", "unit"], &["u4", "scale"],
            &["u4", "factor"], &["collective", "offset"], &["collective", "range"], &["collective", "0 to 1"], &["collective", "[0, 1]"],
            &["collective", "0..1"], &["collective", "0-1"], &["collective", "percent"], &["collective", "normalis"],
            &["collective", "normaliz"], &["collective", "bias"], &["collective", "gain"], &["collective", "mean"], &["collective", "unit"],
            &["collective", "scale"], &["collective", "factor"],
        ],
    },
    Corruption {
        id: "low_rates_switch",
        kind: Kind::Sticks,
        says: "The pilot flew these on low rates: the log has the whole stick, the swashplate got 60 % of it.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(|log, _| log.scale(&[Column::U1, Column::U2], 1.0 / 0.6)),
        right: &[
            &["u1", "gain"], &["u1", "dual rate"], &["u1", "effectiveness"], &["u1", "sensitiv"], &["u1", "strength"], &["u1", "throw"],
            &["u1", "scale"], &["u1", "factor"], &["u2", "gain"], &["u2", "dual rate"], &["u2", "effectiveness"], &["u2", "sensitiv"],
            &["u2", "strength"], &["u2", "throw"], &["u2", "scale"], &["u2", "factor"], &["cyclic", "gain"], &["cyclic", "dual rate"],
            &["cyclic", "effectiveness"], &["cyclic", "sensitiv"], &["cyclic", "strength"], &["cyclic", "throw"], &["cyclic", "scale"],
            &["cyclic", "factor"], &["controls", "gain"], &["controls", "dual rate"], &["controls", "effectiveness"],
            &["controls", "sensitiv"], &["controls", "strength"], &["controls", "throw"], &["controls", "scale"], &["controls", "factor"],
        ],
    },
    Corruption {
        id: "mocap_frozen",
        kind: Kind::Cells,
        says: "When markers are hidden the capture repeats the last pose, for about half a second.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(pose_frozen),
        right: &[
            &["position", "frozen"], &["position", "freez"], &["position", "constant"], &["position", " held"], &["position", "holds "],
            &["position", "still"], &["position", "stuck"], &["position", "not move"], &["position", "not change"],
            &["position", "never changes"], &["position", "dead"], &["position", "repeat"], &["position", "stale"], &["pose", "frozen"],
            &["pose", "freez"], &["pose", "constant"], &["pose", " held"], &["pose", "holds "], &["pose", "still"], &["pose", "stuck"],
            &["pose", "not move"], &["pose", "not change"], &["pose", "never changes"], &["pose", "dead"], &["pose", "repeat"],
            &["pose", "stale"], &["x, y", "frozen"], &["x, y", "freez"], &["x, y", "constant"], &["x, y", " held"], &["x, y", "holds "],
            &["x, y", "still"], &["x, y", "stuck"], &["x, y", "not move"], &["x, y", "not change"], &["x, y", "never changes"],
            &["x, y", "dead"], &["x, y", "repeat"], &["x, y", "stale"], &["attitude", "frozen"], &["attitude", "freez"],
            &["attitude", "constant"], &["attitude", " held"], &["attitude", "holds "], &["attitude", "still"], &["attitude", "stuck"],
            &["attitude", "not move"], &["attitude", "not change"], &["attitude", "never changes"], &["attitude", "dead"],
            &["attitude", "repeat"], &["attitude", "stale"], &["roll", "frozen"], &["roll", "freez"], &["roll", "constant"],
            &["roll", " held"], &["roll", "holds "], &["roll", "still"], &["roll", "stuck"], &["roll", "not move"], &["roll", "not change"],
            &["roll", "never changes"], &["roll", "dead"], &["roll", "repeat"], &["roll", "stale"], &["pitch", "frozen"],
            &["pitch", "freez"], &["pitch", "constant"], &["pitch", " held"], &["pitch", "holds "], &["pitch", "still"],
            &["pitch", "stuck"], &["pitch", "not move"], &["pitch", "not change"], &["pitch", "never changes"], &["pitch", "dead"],
            &["pitch", "repeat"], &["pitch", "stale"], &["yaw", "frozen"], &["yaw", "freez"], &["yaw", "constant"], &["yaw", " held"],
            &["yaw", "holds "], &["yaw", "still"], &["yaw", "stuck"], &["yaw", "not move"], &["yaw", "not change"],
            &["yaw", "never changes"], &["yaw", "dead"], &["yaw", "repeat"], &["yaw", "stale"],
        ],
    },
    Corruption {
        id: "controls_clock_drift",
        kind: Kind::Timing,
        says: "Two boards, two quartzes: the controls' clock gains half a per cent.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.take(&CONTROLS, |sample| sample + (sample + 100) / 200)),
        right: &[
            &["controls", "drift"], &["controls", "clock"], &["controls", "stretch"], &["controls", "skew"], &["controls", "grow"],
            &["controls", "delay changes"], &["controls", "delay varies"], &["controls", "changing delay"], &["controls", "varying delay"],
            &["controls", "runs fast"], &["controls", "runs slow"], &["controls", "more and more"], &["u1", "drift"], &["u1", "clock"],
            &["u1", "stretch"], &["u1", "skew"], &["u1", "grow"], &["u1", "delay changes"], &["u1", "delay varies"],
            &["u1", "changing delay"], &["u1", "varying delay"], &["u1", "runs fast"], &["u1", "runs slow"], &["u1", "more and more"],
            &["u2", "drift"], &["u2", "clock"], &["u2", "stretch"], &["u2", "skew"], &["u2", "grow"], &["u2", "delay changes"],
            &["u2", "delay varies"], &["u2", "changing delay"], &["u2", "varying delay"], &["u2", "runs fast"], &["u2", "runs slow"],
            &["u2", "more and more"], &["u3", "drift"], &["u3", "clock"], &["u3", "stretch"], &["u3", "skew"], &["u3", "grow"],
            &["u3", "delay changes"], &["u3", "delay varies"], &["u3", "changing delay"], &["u3", "varying delay"], &["u3", "runs fast"],
            &["u3", "runs slow"], &["u3", "more and more"], &["u4", "drift"], &["u4", "clock"], &["u4", "stretch"], &["u4", "skew"],
            &["u4", "grow"], &["u4", "delay changes"], &["u4", "delay varies"], &["u4", "changing delay"], &["u4", "varying delay"],
            &["u4", "runs fast"], &["u4", "runs slow"], &["u4", "more and more"],
        ],
    },
    Corruption {
        id: "tail_channel_frozen",
        kind: Kind::Cells,
        says: "The tail channel was not recorded: it keeps its first value for the whole flight.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(|log, _| log.take(&[Column::U3], |_| 0)),
        right: &[
            &["u3", "frozen"], &["u3", "freez"], &["u3", "constant"], &["u3", " held"], &["u3", "holds "], &["u3", "still"],
            &["u3", "stuck"], &["u3", "not move"], &["u3", "not change"], &["u3", "never changes"], &["u3", "dead"],
            &["u3", "no variation"], &["u3", "no effect"], &["u3", "without effect"], &["u3", "flat"], &["tail channel", "frozen"],
            &["tail channel", "freez"], &["tail channel", "constant"], &["tail channel", " held"], &["tail channel", "holds "],
            &["tail channel", "still"], &["tail channel", "stuck"], &["tail channel", "not move"], &["tail channel", "not change"],
            &["tail channel", "never changes"], &["tail channel", "dead"], &["tail channel", "no variation"],
            &["tail channel", "no effect"], &["tail channel", "without effect"], &["tail channel", "flat"], &["tail control", "frozen"],
            &["tail control", "freez"], &["tail control", "constant"], &["tail control", " held"], &["tail control", "holds "],
            &["tail control", "still"], &["tail control", "stuck"], &["tail control", "not move"], &["tail control", "not change"],
            &["tail control", "never changes"], &["tail control", "dead"], &["tail control", "no variation"],
            &["tail control", "no effect"], &["tail control", "without effect"], &["tail control", "flat"],
        ],
    },
    Corruption {
        id: "accelerometer_saturated",
        kind: Kind::Cells,
        says: "Linear accelerations are cut off at the sensor's range.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(saturated),
        right: &[
            &["linear accelerations", "saturat"], &["linear accelerations", "clip"], &["linear accelerations", "limit"],
            &["linear accelerations", "flat"], &["linear accelerations", "rail"], &["linear accelerations", "cut off"],
            &["linear accelerations", "ceiling"], &["linear accelerations", "capped"], &["linear targets", "saturat"],
            &["linear targets", "clip"], &["linear targets", "limit"], &["linear targets", "flat"], &["linear targets", "rail"],
            &["linear targets", "cut off"], &["linear targets", "ceiling"], &["linear targets", "capped"], &["vx_dot", "saturat"],
            &["vx_dot", "clip"], &["vx_dot", "limit"], &["vx_dot", "flat"], &["vx_dot", "rail"], &["vx_dot", "cut off"],
            &["vx_dot", "ceiling"], &["vx_dot", "capped"], &["vy_dot", "saturat"], &["vy_dot", "clip"], &["vy_dot", "limit"],
            &["vy_dot", "flat"], &["vy_dot", "rail"], &["vy_dot", "cut off"], &["vy_dot", "ceiling"], &["vy_dot", "capped"],
            &["vz_dot", "saturat"], &["vz_dot", "clip"], &["vz_dot", "limit"], &["vz_dot", "flat"], &["vz_dot", "rail"],
            &["vz_dot", "cut off"], &["vz_dot", "ceiling"], &["vz_dot", "capped"],
        ],
    },
    Corruption {
        id: "step_mislabelled",
        kind: Kind::Timing,
        says: "The logger really ran at 80 Hz; the file says 100.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(at_80_hz),
        right: &[
            &["time step"], &["step_s"], &["sampling rate"], &["sample rate"], &["sampling time"], &["log rate"], &["logging rate"],
            &["80 hz"], &["12.5 ms"], &["time base"], &["time scale"], &["time axis"], &["clock", "fast"], &["clock", "slow"],
            &["clock", "factor"], &["time", "stretch"], &["time", "compress"], &["time runs"], &["time", "factor", "!times"],
            &["step", "too short"], &["step", "factor"], &["dt ", "factor"],
        ],
    },
    Corruption {
        id: "stick_expo",
        kind: Kind::Sticks,
        says: "The log has the sticks before the transmitter's 60 % exponential; the servos got what came after.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.each(&[Column::U1, Column::U2, Column::U3], before_expo)),
        right: &[
            &["controls", "expo"], &["controls", "nonlinear"], &["controls", "non-linear"], &["controls", "not linear"],
            &["controls", "curve"], &["controls", "cubic"], &["controls", "bend"], &["u1", "expo"], &["u1", "nonlinear"],
            &["u1", "non-linear"], &["u1", "not linear"], &["u1", "curve"], &["u1", "cubic"], &["u1", "bend"], &["u2", "expo"],
            &["u2", "nonlinear"], &["u2", "non-linear"], &["u2", "not linear"], &["u2", "curve"], &["u2", "cubic"], &["u2", "bend"],
            &["u3", "expo"], &["u3", "nonlinear"], &["u3", "non-linear"], &["u3", "not linear"], &["u3", "curve"], &["u3", "cubic"],
            &["u3", "bend"],
        ],
    },
    Corruption {
        id: "swashplate_servos",
        kind: Kind::Sticks,
        says: "Instead of sticks the log has the three servos of the 120 degree swashplate.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| with_each_row(log, swashplate_servos)),
        right: &[
            &["swash"], &["servo outputs"], &["servos", "stick"], &["servo", "mix"], &["ccpm"], &["controls", " mix"],
            &["controls", "mixture"], &["controls", "mixed"], &["controls", "combination"], &["u1", " mix"], &["u1", "mixture"],
            &["u1", "mixed"], &["u1", "combination"], &["u2", " mix"], &["u2", "mixture"], &["u2", "mixed"], &["u2", "combination"],
            &["u4", " mix"], &["u4", "mixture"], &["u4", "mixed"], &["u4", "combination"], &["u1", "u4", "correlat"],
            &["u2", "u4", "correlat"], &["u1", "u4", "depend"], &["controls", "correlat"], &["controls", "collinear"],
            &["u1", "u4", "couple"],
        ],
    },
    Corruption {
        id: "stick_deadband",
        kind: Kind::Sticks,
        says: "The logger takes a dead band of 0.1 from cyclic and tail; the servos did not have it.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| log.each(&[Column::U1, Column::U2, Column::U3], dead_band)),
        right: &[
            &["controls", "dead"], &["controls", "zeros"], &["controls", "exactly zero"], &["controls", "exactly 0"],
            &["controls", "zero band"], &["controls", "at zero"], &["controls", "nonlinear"], &["controls", "non-linear"], &["u1", "dead"],
            &["u1", "zeros"], &["u1", "exactly zero"], &["u1", "exactly 0"], &["u1", "zero band"], &["u1", "at zero"], &["u1", "nonlinear"],
            &["u1", "non-linear"], &["u2", "dead"], &["u2", "zeros"], &["u2", "exactly zero"], &["u2", "exactly 0"], &["u2", "zero band"],
            &["u2", "at zero"], &["u2", "nonlinear"], &["u2", "non-linear"], &["u3", "dead"], &["u3", "zeros"], &["u3", "exactly zero"],
            &["u3", "exactly 0"], &["u3", "zero band"], &["u3", "at zero"], &["u3", "nonlinear"], &["u3", "non-linear"],
        ],
    },
    Corruption {
        id: "imu_tilted",
        kind: Kind::Frames,
        says: "The inertial unit sits nose up by 10 degrees; rates and accelerations are along its own axes.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(|log, _| with_each_row(log, tilted)),
        right: &[
            &["rates", "tilt"], &["rates", "rotated"], &["rates", "turned"], &["rates", "mount"], &["rates", "misalign"],
            &["rates", "inclin"], &["rates", "leak"], &["rates", "cross-axis"], &["rates", "cross-coupl"], &["wx", "tilt"],
            &["wx", "rotated"], &["wx", "turned"], &["wx", "mount"], &["wx", "misalign"], &["wx", "inclin"], &["wx", "leak"],
            &["wx", "cross-axis"], &["wx", "cross-coupl"], &["wz", "tilt"], &["wz", "rotated"], &["wz", "turned"], &["wz", "mount"],
            &["wz", "misalign"], &["wz", "inclin"], &["wz", "leak"], &["wz", "cross-axis"], &["wz", "cross-coupl"],
            &["linear accelerations", "tilt"], &["linear accelerations", "rotated"], &["linear accelerations", "turned"],
            &["linear accelerations", "mount"], &["linear accelerations", "misalign"], &["linear accelerations", "inclin"],
            &["linear accelerations", "leak"], &["linear accelerations", "cross-axis"], &["linear accelerations", "cross-coupl"],
            &["linear targets", "tilt"], &["linear targets", "rotated"], &["linear targets", "turned"], &["linear targets", "mount"],
            &["linear targets", "misalign"], &["linear targets", "inclin"], &["linear targets", "leak"], &["linear targets", "cross-axis"],
            &["linear targets", "cross-coupl"], &["vx_dot", "tilt"], &["vx_dot", "rotated"], &["vx_dot", "turned"], &["vx_dot", "mount"],
            &["vx_dot", "misalign"], &["vx_dot", "inclin"], &["vx_dot", "leak"], &["vx_dot", "cross-axis"], &["vx_dot", "cross-coupl"],
            &["vy_dot", "tilt"], &["vy_dot", "rotated"], &["vy_dot", "turned"], &["vy_dot", "mount"], &["vy_dot", "misalign"],
            &["vy_dot", "inclin"], &["vy_dot", "leak"], &["vy_dot", "cross-axis"], &["vy_dot", "cross-coupl"], &["vz_dot", "tilt"],
            &["vz_dot", "rotated"], &["vz_dot", "turned"], &["vz_dot", "mount"], &["vz_dot", "misalign"], &["vz_dot", "inclin"],
            &["vz_dot", "leak"], &["vz_dot", "cross-axis"], &["vz_dot", "cross-coupl"], &["angular accelerations", "tilt"],
            &["angular accelerations", "rotated"], &["angular accelerations", "turned"], &["angular accelerations", "mount"],
            &["angular accelerations", "misalign"], &["angular accelerations", "inclin"], &["angular accelerations", "leak"],
            &["angular accelerations", "cross-axis"], &["angular accelerations", "cross-coupl"], &["angular targets", "tilt"],
            &["angular targets", "rotated"], &["angular targets", "turned"], &["angular targets", "mount"],
            &["angular targets", "misalign"], &["angular targets", "inclin"], &["angular targets", "leak"],
            &["angular targets", "cross-axis"], &["angular targets", "cross-coupl"], &["wx_dot", "tilt"], &["wx_dot", "rotated"],
            &["wx_dot", "turned"], &["wx_dot", "mount"], &["wx_dot", "misalign"], &["wx_dot", "inclin"], &["wx_dot", "leak"],
            &["wx_dot", "cross-axis"], &["wx_dot", "cross-coupl"], &["wy_dot", "tilt"], &["wy_dot", "rotated"], &["wy_dot", "turned"],
            &["wy_dot", "mount"], &["wy_dot", "misalign"], &["wy_dot", "inclin"], &["wy_dot", "leak"], &["wy_dot", "cross-axis"],
            &["wy_dot", "cross-coupl"], &["wz_dot", "tilt"], &["wz_dot", "rotated"], &["wz_dot", "turned"], &["wz_dot", "mount"],
            &["wz_dot", "misalign"], &["wz_dot", "inclin"], &["wz_dot", "leak"], &["wz_dot", "cross-axis"], &["wz_dot", "cross-coupl"],
        ],
    },
    Corruption {
        id: "controls_irregular",
        kind: Kind::Timing,
        says: "Telemetry brings the controls when it has room, each 20 to 140 ms after the one before, and the last one stays.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(controls_irregular),
        right: &[
            &["controls", "jitter"], &["controls", "irregular"], &["controls", " held"], &["controls", "holds "], &["controls", "repeat"],
            &["controls", "packet"], &["controls", "stale"], &["controls", "stair"], &["controls", "uneven"],
            &["controls", "sample-and-hold"], &["controls", " hz"], &["controls", " late"], &["controls", " lag"], &["controls", "delay"],
            &["controls", "behind"], &["u1", "jitter"], &["u1", "irregular"], &["u1", " held"], &["u1", "holds "], &["u1", "repeat"],
            &["u1", "packet"], &["u1", "stale"], &["u1", "stair"], &["u1", "uneven"], &["u1", "sample-and-hold"], &["u1", " hz"],
            &["u1", " late"], &["u1", " lag"], &["u1", "delay"], &["u1", "behind"], &["u2", "jitter"], &["u2", "irregular"],
            &["u2", " held"], &["u2", "holds "], &["u2", "repeat"], &["u2", "packet"], &["u2", "stale"], &["u2", "stair"],
            &["u2", "uneven"], &["u2", "sample-and-hold"], &["u2", " hz"], &["u2", " late"], &["u2", " lag"], &["u2", "delay"],
            &["u2", "behind"], &["u3", "jitter"], &["u3", "irregular"], &["u3", " held"], &["u3", "holds "], &["u3", "repeat"],
            &["u3", "packet"], &["u3", "stale"], &["u3", "stair"], &["u3", "uneven"], &["u3", "sample-and-hold"], &["u3", " hz"],
            &["u3", " late"], &["u3", " lag"], &["u3", "delay"], &["u3", "behind"], &["u4", "jitter"], &["u4", "irregular"],
            &["u4", " held"], &["u4", "holds "], &["u4", "repeat"], &["u4", "packet"], &["u4", "stale"], &["u4", "stair"],
            &["u4", "uneven"], &["u4", "sample-and-hold"], &["u4", " hz"], &["u4", " late"], &["u4", " lag"], &["u4", "delay"],
            &["u4", "behind"],
        ],
    },
    Corruption {
        id: "rows_twice",
        kind: Kind::Cells,
        says: "The logger writes some rows twice, each with a time stamp of its own.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(rows_twice),
        right: &[
            &["duplicat"], &["twice"], &["double", "rows"], &["rows", "repeat"], &["samples", "repeat"], &["identical", "rows"],
            &["same", "rows"], &["copies", "rows"], &["all columns", " held"], &["all columns", "repeat"], &["all columns", "frozen"],
            &["every column", "repeat"],
        ],
    },
    Corruption {
        id: "rates_differenced_raw",
        kind: Kind::Noise,
        says: "Angular accelerations are differences of the raw gyro from sample to sample, with its noise a hundredfold.",
        parts: [Part::All, Part::Half],
        change: Change::Columns(differenced),
        right: &[
            &["angular accelerations", "noise"], &["angular accelerations", "noisy"], &["angular accelerations", "differenced"],
            &["angular accelerations", "differences"], &["angular accelerations", "differentiat"], &["angular accelerations", "rough"],
            &["angular accelerations", "scatter"], &["angular accelerations", "jagged"], &["angular accelerations", "unfiltered"],
            &["angular accelerations", "not filtered"], &["angular targets", "noise"], &["angular targets", "noisy"],
            &["angular targets", "differenced"], &["angular targets", "differences"], &["angular targets", "differentiat"],
            &["angular targets", "rough"], &["angular targets", "scatter"], &["angular targets", "jagged"],
            &["angular targets", "unfiltered"], &["angular targets", "not filtered"], &["wx_dot", "noise"], &["wx_dot", "noisy"],
            &["wx_dot", "differenced"], &["wx_dot", "differences"], &["wx_dot", "differentiat"], &["wx_dot", "rough"],
            &["wx_dot", "scatter"], &["wx_dot", "jagged"], &["wx_dot", "unfiltered"], &["wx_dot", "not filtered"], &["wy_dot", "noise"],
            &["wy_dot", "noisy"], &["wy_dot", "differenced"], &["wy_dot", "differences"], &["wy_dot", "differentiat"], &["wy_dot", "rough"],
            &["wy_dot", "scatter"], &["wy_dot", "jagged"], &["wy_dot", "unfiltered"], &["wy_dot", "not filtered"], &["wz_dot", "noise"],
            &["wz_dot", "noisy"], &["wz_dot", "differenced"], &["wz_dot", "differences"], &["wz_dot", "differentiat"], &["wz_dot", "rough"],
            &["wz_dot", "scatter"], &["wz_dot", "jagged"], &["wz_dot", "unfiltered"], &["wz_dot", "not filtered"],
        ],
    },
    Corruption {
        id: "controls_of_another_flight",
        kind: Kind::Sticks,
        says: "The controls in these logs are those of another flight by the same pilot.",
        parts: [Part::Half, Part::One],
        change: Change::Columns(controls_of_another),
        right: &[
            &["controls", "another flight"], &["controls", "other flight"], &["controls", "different flight"], &["controls", "not belong"],
            &["controls", "not match"], &["controls", "mismatch"], &["controls", "unrelated"], &["controls", "no relation"],
            &["controls", "not explain"], &["controls", "wrong flight"], &["controls", "misjoin"], &["controls", "mis-join"],
            &["controls", "mis-match"], &["controls", "shift"], &["controls", " late"], &["controls", "early"], &["controls", "ahead"],
            &["u1", "another flight"], &["u1", "other flight"], &["u1", "different flight"], &["u1", "not belong"], &["u1", "not match"],
            &["u1", "mismatch"], &["u1", "unrelated"], &["u1", "no relation"], &["u1", "not explain"], &["u1", "wrong flight"],
            &["u1", "misjoin"], &["u1", "mis-join"], &["u1", "mis-match"], &["u1", "shift"], &["u1", " late"], &["u1", "early"],
            &["u1", "ahead"], &["u2", "another flight"], &["u2", "other flight"], &["u2", "different flight"], &["u2", "not belong"],
            &["u2", "not match"], &["u2", "mismatch"], &["u2", "unrelated"], &["u2", "no relation"], &["u2", "not explain"],
            &["u2", "wrong flight"], &["u2", "misjoin"], &["u2", "mis-join"], &["u2", "mis-match"], &["u2", "shift"], &["u2", " late"],
            &["u2", "early"], &["u2", "ahead"], &["u3", "another flight"], &["u3", "other flight"], &["u3", "different flight"],
            &["u3", "not belong"], &["u3", "not match"], &["u3", "mismatch"], &["u3", "unrelated"], &["u3", "no relation"],
            &["u3", "not explain"], &["u3", "wrong flight"], &["u3", "misjoin"], &["u3", "mis-join"], &["u3", "mis-match"],
            &["u3", "shift"], &["u3", " late"], &["u3", "early"], &["u3", "ahead"], &["u4", "another flight"], &["u4", "other flight"],
            &["u4", "different flight"], &["u4", "not belong"], &["u4", "not match"], &["u4", "mismatch"], &["u4", "unrelated"],
            &["u4", "no relation"], &["u4", "not explain"], &["u4", "wrong flight"], &["u4", "misjoin"], &["u4", "mis-join"],
            &["u4", "mis-match"], &["u4", "shift"], &["u4", " late"], &["u4", "early"], &["u4", "ahead"],
        ],
    },
];

/// m/s².
const GRAVITY: f64 = 9.80665;

/// What changes its sign from forward, right, down to forward, left, up in the stream of an inertial unit.
const LEFT_UP: [Column; 6] = [Column::Wy, Column::Wz, Column::VyDot, Column::VzDot, Column::WyDot, Column::WzDot];

fn with_each_row(log: &mut Log, change: impl Fn(&mut Log, usize)) {
    (0..log.len()).for_each(|sample| change(log, sample));
}

/// To [-π, π).
fn wrapped(angle: f64) -> f64 {
    (angle + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
}

/// Runs of rows, one in `every_s` and at least one, of about `length_s` and at most a quarter of the flight, in order.
fn spells(log: &Log, every_s: f64, length_s: f64, chance: &mut Chance) -> Vec<Range<usize>> {
    let rows = log.len();
    let count = rows / log.samples(every_s).max(1) + 1;
    let mut runs: Vec<Range<usize>> = (0..count)
        .map(|_| {
            let length = log.samples(length_s * (0.5 + chance.uniform())).clamp(1, (rows / 4).max(1));
            let start = chance.below(rows.saturating_sub(length) + 1);
            start..(start + length).min(rows)
        })
        .collect();
    runs.sort_by_key(|run| run.start);
    runs
}

/// dv/dt + w x v less gravity along the body axes.
fn specific_force(log: &mut Log, sample: usize) {
    let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
    let gravity = rotate_back(&rotation_body_to_inertial(roll, pitch, yaw), [0.0, 0.0, GRAVITY]);
    let turning = cross(log.vector(RATES, sample), log.vector(VELOCITY, sample));
    let derivative = log.vector(LINEAR, sample);
    log.set_vector(LINEAR, sample, std::array::from_fn(|axis| derivative[axis] + turning[axis] - gravity[axis]));
}

fn velocity_of_earth(log: &mut Log, sample: usize) {
    let [roll, pitch, yaw] = log.vector(ATTITUDE, sample);
    let velocity = rotate(&rotation_body_to_inertial(roll, pitch, yaw), log.vector(VELOCITY, sample));
    log.set_vector(VELOCITY, sample, velocity);
}

/// By an angle about the pitch axis.
fn tilted(log: &mut Log, sample: usize) {
    let mount = rotation_body_to_inertial(0.0, 10.0_f64.to_radians(), 0.0);
    for columns in [RATES, LINEAR, ANGULAR] {
        let along_sensor = rotate_back(&mount, log.vector(columns, sample));
        log.set_vector(columns, sample, along_sensor);
    }
}

fn position_enu(log: &mut Log, _: &mut Chance) {
    log.swap(Column::X, Column::Y);
    log.scale(&[Column::Z], -1.0);
}

/// Servos of aileron, elevator and pitch at 120 degrees from each other, in the places of the sticks.
fn swashplate_servos(log: &mut Log, sample: usize) {
    const STICKS: [Column; 3] = [Column::U1, Column::U2, Column::U4];
    let [sideways, fore, collective] = log.vector(STICKS, sample);
    let side = 0.75_f64.sqrt() * sideways;
    let servos = [collective + 0.5 * fore + side, collective - fore, collective + 0.5 * fore - side];
    log.set_vector(STICKS, sample, servos.map(|servo| 0.6 * servo));
}

/// The stick that 60 % exponential makes this of (Newton's method, from above).
fn before_expo(servo: f64) -> f64 {
    const EXPO: f64 = 0.6;
    let size = servo.abs();
    let stick = (0..40).fold(size / (1.0 - EXPO), |stick, _| {
        let excess = (1.0 - EXPO) * stick + EXPO * stick.powi(3) - size;
        stick - excess / (1.0 - EXPO + 3.0 * EXPO * stick.powi(2))
    });
    stick.copysign(servo)
}

fn dead_band(stick: f64) -> f64 {
    const WIDTH: f64 = 0.1;
    ((stick.abs() - WIDTH).max(0.0) / (1.0 - WIDTH)).copysign(stick)
}

fn rows_dropped(log: &mut Log, chance: &mut Chance) {
    let lost = spells(log, 3.0, 0.2, chance);
    let kept: Vec<usize> = (0..log.len()).filter(|sample| !lost.iter().any(|run| run.contains(sample))).collect();
    log.rows(&kept);
}

fn rows_twice(log: &mut Log, chance: &mut Chance) {
    let mut order = Vec::new();
    for sample in 0..log.len() {
        order.push(sample);
        if sample == 0 || chance.uniform() < 0.1 {
            order.push(sample);
        }
    }
    log.rows(&order);
}

fn pose_zeroed(log: &mut Log, chance: &mut Chance) {
    for run in spells(log, 6.0, 0.3, chance) {
        for column in [POSITION, ATTITUDE].concat() {
            log.of_column(column)[run.clone()].fill(0.0);
        }
    }
}

fn pose_frozen(log: &mut Log, chance: &mut Chance) {
    for run in spells(log, 5.0, 0.5, chance) {
        log.take(&[POSITION, ATTITUDE].concat(), |sample| if run.contains(&sample) { run.start } else { sample });
    }
}

fn spikes(log: &mut Log, chance: &mut Chance) {
    let count = log.len() / log.samples(3.0).max(1) + 1;
    for column in RATES {
        for _ in 0..count {
            let size = (8.0 + 12.0 * chance.uniform()).copysign(chance.uniform() - 0.5);
            let sample = chance.below(log.len());
            log.of_column(column).iter_mut().skip(sample).take(1).for_each(|rate| *rate += size);
        }
    }
}

/// At 6 m/s², or at half of the largest of a gentle flight.
fn saturated(log: &mut Log, _: &mut Chance) {
    for column in LINEAR {
        let largest = log.of_column(column).iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let limit = (0.5 * largest).min(6.0);
        log.each(&[column], |value| value.clamp(-limit, limit));
    }
}

fn vibration(log: &mut Log, chance: &mut Chance) {
    const HERTZ: f64 = 23.0;
    let turn = std::f64::consts::TAU * HERTZ * log.step_s;
    for (column, size) in LINEAR.into_iter().zip([3.0, 3.0, 5.0]) {
        let phase = std::f64::consts::TAU * chance.uniform();
        log.of_column(column)
            .iter_mut()
            .enumerate()
            .for_each(|(sample, value)| *value += size * (phase + turn * sample as f64).sin());
    }
}

/// White noise of a gyro, differenced from sample to sample.
fn differenced(log: &mut Log, chance: &mut Chance) {
    const NOISE: f64 = 0.04;
    let step_s = log.step_s;
    for column in ANGULAR {
        let mut before = NOISE * chance.normal();
        for value in log.of_column(column) {
            let noise = NOISE * chance.normal();
            *value += (noise - before) / step_s;
            before = noise;
        }
    }
}

fn controls_seconds_off(log: &mut Log, chance: &mut Chance) {
    let off_s = 0.6 + 1.2 * chance.uniform();
    if chance.uniform() < 0.5 { log.late(&CONTROLS, off_s) } else { log.early(&CONTROLS, off_s) }
}

/// Somewhere from a third to two thirds of the flight away, round the end, and back to front: sticks of the same pilot at another time.
fn controls_of_another(log: &mut Log, chance: &mut Chance) {
    let rows = log.len().max(1);
    let away = rows / 3 + chance.below(rows / 3 + 1);
    log.take(&CONTROLS, |sample| (2 * rows - 1 - sample + away) % rows);
}

fn controls_irregular(log: &mut Log, chance: &mut Chance) {
    let mut packet = 0;
    let mut next = 0;
    let mut packets = Vec::with_capacity(log.len());
    for sample in 0..log.len() {
        if sample >= next {
            packet = sample;
            next = sample + log.samples(0.02 + 0.12 * chance.uniform()).max(2);
        }
        packets.push(packet);
    }
    log.take(&CONTROLS, |sample| packets.get(sample).copied().unwrap_or(sample));
}

/// Every column at 4 rows for 5, between rows; where yaw wraps, the row before.
fn at_80_hz(log: &mut Log, _: &mut Chance) {
    let rows = log.len() * 4 / 5;
    for values in &mut log.columns {
        *values = (0..rows)
            .filter_map(|row| {
                let (sample, share) = (row * 5 / 4, (row % 4) as f64 / 4.0);
                let before = *values.get(sample)?;
                let step = values.get(sample + 1).map_or(0.0, |after| after - before);
                Some(if share > 0.0 && step.abs() > 5.0 { before } else { before + share * step })
            })
            .collect();
    }
}
