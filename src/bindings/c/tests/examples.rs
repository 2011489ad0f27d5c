//! The examples in C and C++, compiled with all warnings as errors, run under AddressSanitizer and UndefinedBehaviorSanitizer, and
//! compared with the library. Without a C compiler they are skipped, which is said.

mod common;

use common::{HISTORY, folder, hybrid, model, simulated};
use phyture::flight::windows::windows;
use phyture::flight::{Column, Flight, PerChannel, Span, Targets, write};
use phyture::tape::Threads;
use phyture::{Error, Result};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const SANITIZERS: [&str; 2] = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

/// What the system's libraries that Rust's own stands on are called, for the static library.
const SYSTEM: [&str; 4] = ["-lm", "-lpthread", "-ldl", "-lgcc_s"];

/// Where the libraries lie: beside this test program, or above.
fn libraries() -> Result<PathBuf> {
    let program = std::env::current_exe().map_err(Error::io("test program"))?;
    let beside = program.ancestors().skip(1).take(2).find(|folder| folder.join("libphyture_c.a").is_file());
    beside.map(Path::to_path_buf).ok_or_else(|| Error::Undetermined(format!("no libphyture_c.a beside {}", program.display())))
}

/// A compiler of the environment or the usual one, and the sanitizers where a program made with them runs.
fn compiler(variable: &str, usual: &str, place: &Path) -> Result<Option<(String, &'static [&'static str])>> {
    let compiler = std::env::var(variable).unwrap_or_else(|_| usual.to_owned());
    if Command::new(&compiler).arg("--version").output().is_err() {
        eprintln!("no {compiler}: skipped");
        return Ok(None);
    }
    let (source, program) = (place.join("probe.c"), place.join("probe"));
    std::fs::write(&source, "int main(void) { return 0; }\n").map_err(Error::io(&source))?;
    let made = Command::new(&compiler).args(SANITIZERS).arg(&source).arg("-o").arg(&program).output();
    let runs = made.is_ok_and(|made| made.status.success()) && Command::new(&program).status().is_ok_and(|ran| ran.success());
    if !runs {
        eprintln!("{compiler} has no sanitizers that run here: without them");
    }
    Ok(Some((compiler, if runs { &SANITIZERS } else { &[] })))
}

fn must(output: Output, what: &str) -> String {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{what}: {}\n{said}", output.status);
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Compiles an example; `linked` are its libraries.
fn compile((compiler, sanitizers): (&str, &[&str]), standard: &str, source: &str, linked: &[String], program: &Path) -> Result<()> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut command = Command::new(compiler);
    command.args([standard, "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-pedantic"]).args(sanitizers);
    command.arg(here.join("examples").join(source)).arg("-I").arg(here.join("include"));
    must(command.args(linked).arg("-o").arg(program).output().map_err(Error::io(compiler))?, source);
    Ok(())
}

fn run(program: &Path, arguments: &[&Path]) -> Result<Output> {
    Command::new(program).args(arguments).output().map_err(Error::io(program))
}

/// The first rows of a flight, from time 0.
fn short(flight: &Flight, samples: usize) -> Result<Flight> {
    let columns = Column::ALL.map(|column| flight.column(column)[..samples].to_vec());
    Flight::new("short", "short", 0.0, flight.step_s, columns, Targets::Recorded)
}

/// The rows that the example in C prints: t, and four times six numbers.
fn rows(text: &str) -> Vec<Vec<f64>> {
    text.lines().map(|line| line.split(',').map(|word| word.parse().expect("a number")).collect()).collect()
}

#[test]
fn the_example_in_c_says_what_the_library_says() -> Result<()> {
    let place = folder()?;
    let Some((compiler, sanitizers)) = compiler("CC", "cc", place.path())? else { return Ok(()) };
    let program = place.path().join("stream");
    let library = libraries()?.join("libphyture_c.a").display().to_string();
    let linked: Vec<String> = [library].into_iter().chain(SYSTEM.map(str::to_owned)).collect();
    compile((&compiler, sanitizers), "-std=c99", "stream.c", &linked, &program)?;
    let set = simulated()?;
    let (hybrid, flight) = (hybrid(&set)?, short(&set.flights[0], 120)?);
    let files = ["network.safetensors", "model.toml", "flight.csv", "none.toml"].map(|name| place.path().join(name));
    let [network, toml, csv, none] = files.each_ref().map(PathBuf::as_path);
    hybrid.write(network)?;
    model(&set)?.write(toml)?;
    write::csv(&flight, csv)?;

    let span = [Span { flight: 0, start: 0, end: flight.len() }];
    let expected = hybrid.predict(std::slice::from_ref(&flight), &windows(&span, HISTORY, 1), Threads(1))?;
    let found = rows(&must(run(&program, &[network, csv])?, "stream.c with a hybrid"));
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!(&found[1..7], expected.values());
    }
    let physics = model(&set)?.predict(&flight)?;
    let found = rows(&must(run(&program, &[toml, csv])?, "stream.c with a model"));
    assert_eq!(found.len(), flight.len());
    for (sample, found) in found.iter().enumerate() {
        assert_eq!(&found[1..7], PerChannel::from_fn(|channel| physics[channel][sample]).values());
    }
    let refused = run(&program, &[none, csv])?;
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(2) && said.contains("none.toml: there is no such file"), "{said}");
    Ok(())
}

#[test]
fn the_example_in_cpp_says_what_the_library_says() -> Result<()> {
    let place = folder()?;
    let Some((compiler, sanitizers)) = compiler("CXX", "c++", place.path())? else { return Ok(()) };
    let program = place.path().join("stream");
    // The shared library this time.
    let folder = libraries()?.display().to_string();
    let linked = [format!("-L{folder}"), format!("-Wl,-rpath,{folder}"), "-l:libphyture_c.so".to_owned()];
    compile((&compiler, sanitizers), "-std=c++11", "stream.cpp", &linked, &program)?;
    let set = simulated()?;
    let (network, toml) = (place.path().join("network.safetensors"), place.path().join("model.toml"));
    let hybrid = hybrid(&set)?;
    hybrid.write(&network)?;
    model(&set)?.write(&toml)?;
    let mut streams = (hybrid.stream()?, model(&set)?.stream(0.01)?);
    let of_hybrid = must(run(&program, &[&network])?, "stream.cpp with a hybrid");
    let of_model = must(run(&program, &[&toml])?, "stream.cpp with a model");
    let mut expected = (String::new(), String::new());
    let state = |sample: usize, samples: usize| {
        let mut state = [0.0; 16];
        (state[Column::Z as usize], state[Column::U4 as usize]) = (-10.0, if sample < samples / 2 { 0.0 } else { 0.1 });
        state
    };
    for sample in 0..HISTORY + 100 {
        let parts = streams.0.push_parts(&state(sample, HISTORY + 100), &[])?;
        if let Some(acceleration) = parts.acceleration {
            expected.0 += &format!("{sample} {:e} {:e}\n", acceleration.values()[2], parts.physics.values()[2]);
        }
    }
    for sample in 0..101 {
        let vertical = streams.1.push(&state(sample, 101))?.values()[2];
        expected.1 += &format!("{sample} {vertical:e} {vertical:e}\n");
    }
    let numbers = |text: &str| -> Vec<f64> { text.split_whitespace().map(|word| word.parse().expect("a number")).collect() };
    assert_eq!(numbers(&of_hybrid), numbers(&expected.0));
    assert_eq!(numbers(&of_model), numbers(&expected.1));
    Ok(())
}
