//! Models as C: compiled with all warnings as errors, in double and in float, under the sanitizers where they run, and fed the rows of
//! flights. They say what the library's stream says. Without a C compiler these tests are skipped, which is said.
#![cfg(feature = "files")]

mod flights;

use flights::random;
use phyture::flight::{Channel, Column, Flight, GRAVITY_M_S2, PerChannel};
use phyture::formula::Formula;
use phyture::physics::{Effect, Model, Rotor, Swap, Turning, catalogue, typical};
use phyture::{Error, Result};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// Largest difference from the library, as a share of the largest acceleration of the channel or of gravity.
const DOUBLE: f64 = 1e-12;
const SINGLE: f64 = 1e-6;

/// Samples of a flight: more than the longest delay.
const SAMPLES: usize = 1500;

/// Reads rows of numbers as text and prints what the model says.
const MAIN: &str = r#"
#define @^_DECLARATIONS
#include "@.c"
#include <stdio.h>

int main(void)
{
    static @_memory memory;
    @_real state[16], acceleration[6]OWN_DECLARED;
    double number;
    int round, sample, place;
    /* The second round starts anew on the same rows. */
    for (round = 0; round < 2; round++) {
        rewind(stdin);
        @_reset(&memorySTART);
        for (sample = 0; sample < SAMPLES; sample++) {
            for (place = 0; place < 16 + OWN; place++) {
                if (scanf("%lf", &number) != 1) {
                    return 1;
                }
                if (place < 16) {
                    state[place] = (@_real)number;
                }OWN_READ
            }
            @_step(&memory, stateOWN_GIVEN, acceleration);
            for (place = 0; place < 6; place++) {
                printf("%.17g\n", (double)acceleration[place]);
            }
        }
    }
    return 0;
}
"#;

fn compiler() -> Option<String> {
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    if Command::new(&compiler).arg("--version").output().is_err() {
        eprintln!("no {compiler}: skipped");
        return None;
    }
    Some(compiler)
}

/// The paper's model with numbers of a helicopter's size.
fn helicopter() -> Model {
    let mut model = Model::paper("n9", 4.58, [0.18, 0.34, 0.28], 0.8);
    let values = [-0.35, -0.4, -1.42, -20.0, -0.51, -9.0, -8.0, -5.5, 70.0, 60.0, 50.0, -1.23, -0.21, 0.14];
    let coefficients = model.effects.iter_mut().flat_map(|effect| &mut effect.coefficients);
    coefficients.zip(values).for_each(|(coefficient, value)| coefficient.value = value);
    model.rotors = rotors();
    model
}

/// Two rotors whose speeds follow the controls, one behind a lag, one tilted: what sums over rotors has something to sum.
fn rotors() -> Vec<Rotor> {
    let rotor = |speed: &str, y: f64, axis: [f64; 3], turns: Turning| Rotor {
        speed: Formula::parse(speed).expect("a formula"),
        position_m: [0.02, y, -0.05],
        axis,
        turns,
    };
    vec![
        rotor("lag(400 + 100*u4, 0.03)", 0.2, [0.0, 0.0, -1.0], Turning::Clockwise),
        rotor("400 + 90*u4 - 10*u1", -0.2, [0.1, 0.0, -1.0], Turning::Counterclockwise),
    ]
}

/// One number a sample and channel.
fn streamed(model: &Model, flight: &Flight) -> Result<Vec<PerChannel<f64>>> {
    let mut stream = model.stream(flight.step_s)?;
    stream.reset(flight.start_s);
    let own: Vec<&[f64]> = stream.extra_inputs().iter().map(|name| flight.extra[name].as_slice()).collect();
    (0..flight.len())
        .map(|sample| {
            let state = flight.state(sample);
            stream.push_with(&state, &own.iter().map(|column| column[sample]).collect::<Vec<_>>())
        })
        .collect()
}

/// What the exported file says in both rounds, one after the other.
fn in_c(compiler: &str, model: &Model, flight: &Flight, flags: &[&str]) -> Result<Vec<PerChannel<f64>>> {
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    let file = model.export_c(Some("exported"), Some(flight.step_s))?;
    let reads_time = file.text.contains("start_s");
    let count = file.own_columns.len();
    let if_own = |text: &str| if count == 0 { String::new() } else { text.to_owned() };
    let main = MAIN
        .replace("OWN_DECLARED", &if_own(&format!(", own[{count}]")))
        .replace("OWN_READ", &if_own(" else {\n                    own[place - 16] = (@_real)number;\n                }"))
        .replace("OWN_GIVEN", &if_own(", own"))
        .replace("OWN", &count.to_string())
        .replace("START", &if reads_time { format!(", (@_real){:?}", flight.start_s) } else { String::new() })
        .replace("SAMPLES", &flight.len().to_string())
        .replace("@^", "EXPORTED")
        .replace('@', "exported");
    let path = |name: &str| place.path().join(name);
    let write = |name: &str, text: &str| std::fs::write(path(name), text).map_err(Error::io(path(name)));
    write("exported.c", &file.text)?;
    write("main.c", &main)?;
    let mut rows = String::new();
    for sample in 0..flight.len() {
        let state = Column::STATE.iter().map(|column| flight.column(*column)[sample]);
        let own = file.own_columns.iter().map(|name| flight.extra[name][sample]);
        state.chain(own).for_each(|value| rows += &format!("{value:e} "));
        rows.push('\n');
    }
    write("rows", &rows)?;
    let made = Command::new(compiler)
        .args(["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wshadow"])
        .args(flags)
        .args([path("main.c"), path("exported.c")])
        .args(["-lm", "-o"])
        .arg(path("program"))
        .output()
        .map_err(Error::io(compiler))?;
    assert!(made.status.success(), "{}\n{}", String::from_utf8_lossy(&made.stderr), file.text);
    let rows = std::fs::File::open(path("rows")).map_err(Error::io("rows"))?;
    let ran = Command::new(path("program")).stdin(Stdio::from(rows)).output().map_err(Error::io("program"))?;
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let numbers: Vec<f64> = String::from_utf8_lossy(&ran.stdout).lines().map(|line| line.parse().expect("a number")).collect();
    let rows = numbers.chunks_exact(6).map(|row| PerChannel::from_fn(|channel| row[channel.index()]));
    Ok(rows.collect())
}

/// Compares in both precisions; gives the largest differences.
fn compared(compiler: &str, name: &str, model: &Model, flight: &Flight) -> Result<[f64; 2]> {
    let expected = streamed(model, flight)?;
    let size = PerChannel::from_fn(|channel| expected.iter().fold(GRAVITY_M_S2, |most, row| most.max(row[channel].abs())));
    let mut worst = [0.0_f64; 2];
    for (worst, (flags, bound)) in worst.iter_mut().zip([(&[][..], DOUBLE), (&["-DPHYTURE_SINGLE", "-Wdouble-promotion"], SINGLE)])
    {
        let found = in_c(compiler, model, flight, flags)?;
        assert_eq!(found.len(), 2 * expected.len(), "{name}");
        for (sample, (found, expected)) in found.iter().zip(expected.iter().chain(&expected)).enumerate() {
            for channel in Channel::ALL {
                let difference = (found[channel] - expected[channel]).abs() / size[channel];
                // A difference that is no number is too large.
                assert!(
                    difference <= bound,
                    "{name}, {flags:?}, sample {sample}, {channel}: {} for {}",
                    found[channel],
                    expected[channel]
                );
                *worst = worst.max(difference);
            }
        }
    }
    Ok(worst)
}

#[test]
fn the_baseline_and_every_effect_of_the_catalogue_say_the_same_in_c() -> Result<()> {
    let Some(compiler) = compiler() else { return Ok(()) };
    let mut flight = random(11, SAMPLES)?;
    flight.start_s = 3.0;
    let mut worst = compared(&compiler, "baseline", &helicopter(), &flight)?;
    let mut everything = helicopter();
    everything.data.control_delay_s = 0.013;
    for definition in catalogue::definitions() {
        let mut model = helicopter();
        let effect = typical(definition, 1.0, &model);
        everything.effects.push(effect.clone());
        model.effects.push(effect);
        let found = compared(&compiler, definition.kind, &model, &flight)?;
        worst = std::array::from_fn(|precision| worst[precision].max(found[precision]));
    }
    let found = compared(&compiler, "everything", &everything, &flight)?;
    println!("largest difference in double and float: {worst:?}, everything at once {found:?}");
    Ok(())
}

/// Every operator and function of the grammar, what varies, what remembers, and columns of the log's own.
fn with_everything() -> Result<Model> {
    let mut model = helicopter();
    let formulas = [
        ("vx_dot", "abs(vx) + sqrt(height) - exp(-airspeed / 5) + log(height) * hypot(vy, vz, 1)"),
        ("vy_dot", "sin(roll) * cos(pitch) + tan(0.3 * yaw) + tanh(vx) + atan2(vy, vx) + beta - alpha"),
        (
            "vz_dot",
            "min(vx, vy, 0.5) + max(u1, u2) + sign(u3) + clamp(vz, -1, 2) + (vx < vy) + (vx <= 1) + (u1 > u2) + (u4 >= 0.5)",
        ),
        ("wx_dot", "wx^2 - wy^3 + wz^4 + (2 + u1^2)^-1 + height^-2 + u2^5 + (1 + airspeed)^0.5 - -u1 - (u2 - u3) / (4 - (u4 - 1))"),
        (
            "wy_dot",
            "lag(u1, 0.05) + lag(u2, 0.02 * airspeed) + delay(u3, 0.037) + delay(vx, 0.5) + 0.01 * rate(vx) + slew(u4, 1.5)",
        ),
        ("wz_dot", "sin(0.3 * t) + rotor_rpm / 1000 + lag(rotor_rpm, 0.3) * battery_V"),
    ];
    for (index, (channel, formula)) in formulas.into_iter().enumerate() {
        let channel = Channel::from_name(channel).ok_or_else(|| Error::Undetermined("a channel".into()))?;
        model.effects.push(Effect::formula(format!("formula_{index}"), channel, formula, 0.7)?);
    }
    // One that changes what others read.
    let mut effect = Effect::formula("late_thrust", Channel::VzDot, "0 * vx", 0.0)?;
    effect.swaps.push(Swap { name: "thrust".into(), with: Formula::parse("lag(thrust, 0.1)")?, within: Vec::new() });
    model.effects.push(effect);
    Ok(model)
}

#[test]
fn every_operation_and_columns_of_the_logs_own_say_the_same_in_c() -> Result<()> {
    let Some(compiler) = compiler() else { return Ok(()) };
    let mut flight = random(5, SAMPLES)?;
    flight.start_s = 2.5;
    let wave = |sample: usize, speed: f64| (speed * sample as f64).sin();
    flight.extra.insert("rotor_rpm".into(), (0..flight.len()).map(|sample| 1500.0 + 100.0 * wave(sample, 0.05)).collect());
    flight.extra.insert("battery_V".into(), (0..flight.len()).map(|sample| 12.0 + wave(sample, 0.01)).collect());
    let worst = compared(&compiler, "every operation", &with_everything()?, &flight)?;
    println!("largest difference in double and float: {worst:?}");
    Ok(())
}

#[test]
fn the_file_touches_nothing_that_is_not_its_own() -> Result<()> {
    let Some(compiler) = compiler() else { return Ok(()) };
    let sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    let place = tempfile::tempdir().map_err(Error::io("temporary folder"))?;
    if !sanitizers_run(&compiler, &sanitizers, place.path())? {
        eprintln!("{compiler} has no sanitizers that run here: skipped");
        return Ok(());
    }
    let mut flight = random(5, 300)?;
    flight.extra = ["rotor_rpm", "battery_V"].map(|name| (name.to_owned(), vec![12.0; flight.len()])).into();
    let found = in_c(&compiler, &with_everything()?, &flight, &sanitizers)?;
    assert_eq!(found.len(), 2 * flight.len());
    Ok(())
}

fn sanitizers_run(compiler: &str, sanitizers: &[&str], place: &Path) -> Result<bool> {
    let program = place.join("probe");
    let mut child = Command::new(compiler)
        .args(sanitizers)
        .args(["-x", "c", "-", "-o"])
        .arg(&program)
        .stdin(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(Error::io(compiler))?;
    if let Some(input) = &mut child.stdin {
        input.write_all(b"int main(void) { return 0; }\n").map_err(Error::io(compiler))?;
    }
    let made = child.wait_with_output().is_ok_and(|made| made.status.success());
    Ok(made && Command::new(&program).status().is_ok_and(|ran| ran.success()))
}

#[test]
fn a_name_that_would_end_a_comment_does_not() -> Result<()> {
    let Some(compiler) = compiler() else { return Ok(()) };
    let mut model = helicopter();
    model.name = "*/ #error ??/ \\ @^ \"heli\"\n²".into();
    compared(&compiler, "name", &model, &random(2, 50)?)?;
    // Four signs and blanks before the word.
    assert!(model.export_c(None, None)?.prefix.starts_with("model_____error"));
    Ok(())
}
