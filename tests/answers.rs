//! Answers that do not mislead: which model was taken, what was judged and how sure that is, what is said of effects that unseen flights
//! deny, and that output is short where nobody asked for more.
#![cfg(all(feature = "cli", unix))]

mod program;

use phyture::critique::diagnose::{Options, Status, diagnose};
use phyture::flight::split::Split;
use phyture::flight::{Channel, DataSet, Targets};
use phyture::physics::{Effect, Model, SignFinding, implant};
use phyture::sim::{INERTIA_KG_M2, MASS_KG, ROTOR_RADIUS_M, Simulation, simulate};
use phyture::{Error, Result};
use program::{folder, phyture, succeed as run};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Output;

/// Widest line of text.
const WIDTH: usize = 120;

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(folder: &Path, name: &str) -> Result<Value> {
    let text = std::fs::read(folder.join(name)).map_err(Error::io(name))?;
    serde_json::from_slice(&text).map_err(|error| Error::Undetermined(error.to_string()))
}

fn write(folder: &Path, name: &str, text: &str) -> Result<()> {
    std::fs::write(folder.join(name), text).map_err(Error::io(name))
}

fn read(folder: &Path, name: &str) -> Result<String> {
    std::fs::read_to_string(folder.join(name)).map_err(Error::io(name))
}

fn fits(text: &str) {
    let wide: Vec<&str> = text.lines().filter(|line| line.chars().count() > WIDTH).collect();
    assert!(wide.is_empty(), "wider than {WIDTH}: {wide:#?}");
}

#[test]
fn a_model_beside_the_flights_is_taken_and_said_and_a_guess_is_a_warning() -> Result<()> {
    let place = folder()?;
    run(place.path(), &["simulate", "data", "--minutes", "3", "--seed", "7401"])?;
    let own = "[model]\nname = \"mine\"\nmass_kg = 7.5\ninertia = [0.3, 0.5, 0.4]\nrotor_radius_m = 0.9\nbaseline = \"paper\"\n";
    write(place.path(), "data/model.toml", own)?;
    let said = run(place.path(), &["calibrate", "data", "-o", "out.toml"])?;
    assert!(said.contains("model: data/model.toml (`mine`, helicopter, 7.5 kg"), "{said}");
    assert_eq!(Model::read(place.path().join("out.toml"))?.mass_kg.to_bits(), 7.5_f64.to_bits());
    for command in [&["check", "data"][..], &["diagnose", "data"], &["loop", "data", "-o", "loop.toml"]] {
        let said = run(place.path(), command)?;
        assert!(said.contains("model: data/model.toml"), "{command:?}: {said}");
        fits(&said);
    }
    // The model of another folder is not taken, and with none the guess is said where it cannot be missed.
    std::fs::rename(place.path().join("data/model.toml"), place.path().join("model.toml")).map_err(Error::io("model.toml"))?;
    for quiet in [&[][..], &["--quiet"]] {
        let output = phyture(place.path(), &[&["calibrate", "data", "-o", "guess.toml", "--force"], quiet].concat())?;
        let warned = errors(&output).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(output.status.success() && warned.starts_with("warning: no model was given"), "{warned}");
        assert!(warned.contains("4.58 kg") && warned.contains("-m FILE"), "{warned}");
        assert!(quiet.is_empty() || output.stdout.is_empty());
    }
    // A guess stays one in the file that was written, and the effects that read it are named.
    let guess = read(place.path(), "guess.toml")?;
    assert!(guess.contains("# mass_kg = 4.58    # assumed"), "{guess}");
    let output = phyture(place.path(), &["calibrate", "data", "-m", "guess.toml", "-o", "again.toml"])?;
    assert!(errors(&output).contains("does not give mass_kg, inertia, rotor_radius_m"), "{}", errors(&output));
    let said = String::from_utf8_lossy(&output.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("`gyroscopic` reads the moments of inertia"), "{said}");
    Ok(())
}

#[test]
fn a_vehicle_that_cannot_be_is_refused() -> Result<()> {
    let place = folder()?;
    run(place.path(), &["simulate", "data", "--minutes", "2", "--seed", "7402"])?;
    for (lines, parts) in [
        ("mass_kg = 4580", ["0.001 to 1000 kg", "looks like grams: 4.58 kg?"]),
        ("inertia = [0.18, 0.34, 0.6]", ["the moment about z, 0.6", "about x and y together"]),
    ] {
        write(place.path(), "odd.toml", &format!("[model]\nbaseline = \"paper\"\n{lines}\n"))?;
        let output = phyture(place.path(), &["calibrate", "data", "-m", "odd.toml", "-o", "out.toml"])?;
        let said = errors(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("odd.toml, line 3") && parts.iter().all(|part| said.contains(part)), "{said}");
    }
    assert!(!place.path().join("out.toml").exists());
    Ok(())
}

/// A network that learned next to nothing beside its own model: whatever differs is chance.
#[test]
fn a_comparison_judges_every_sample_and_gives_stars_only_beyond_chance() -> Result<()> {
    let place = folder()?;
    run(place.path(), &["simulate", "data", "--minutes", "2", "--seed", "7403"])?;
    run(place.path(), &["calibrate", "data", "-o", "model.toml"])?;
    let config =
        "epochs = 1\nstride = 50\n[network]\nhistory = 16\nd_model = 8\nheads = 2\nlevels = 2\nstacks = 1\nmoving_average = 5\n";
    write(place.path(), "train.toml", config)?;
    run(place.path(), &["train", "data", "-m", "model.toml", "-o", "run", "--config", "train.toml"])?;
    let said = run(place.path(), &["compare", "data", "-m", "model.toml", "-n", "run", "--json", "all.json", "--report", "pages"])?;
    fits(&said);
    let all = json(place.path(), "all.json")?;
    assert_eq!(all["stride"], 1, "this network is quick: every sample by default");
    assert!(said.contains("every sample") && said.contains("RMSE less that of"), "{said}");
    // Stars in the text are those of the JSON, and each stands beyond its interval.
    let (models, best) = (all["models"].as_array().cloned().unwrap_or_default(), &all["best"]["rmse"]);
    let mut stars = 0;
    for channel in ["vx_dot", "vy_dot", "vz_dot", "wx_dot", "wy_dot", "wz_dot", "mean"] {
        let Some(index) = best[channel].as_u64() else { continue };
        stars += 1;
        let winner = &models[index as usize]["name"];
        let of = |model: &Value| model["difference_to_best"]["to"] == *winner;
        for apart in models.iter().filter(|model| of(model)).map(|model| &model["difference_to_best"]["ci95"][channel]) {
            assert!(apart[0].as_f64().is_some_and(|low| low > 0.0), "{channel}: {apart}");
        }
    }
    let rmse: Vec<&str> =
        said.lines().skip_while(|line| !line.starts_with("RMSE, root")).take_while(|line| !line.is_empty()).collect();
    assert_eq!(rmse.concat().matches('*').count(), stars, "{said}");
    for part in ["by_manoeuvre", "by_regime"] {
        let parts = models[0][part].as_object().cloned().unwrap_or_default();
        assert!(parts.values().all(|part| part["n"].as_u64() != Some(1) || part["rmse"]["vx_dot"].is_null()), "{parts:?}");
    }
    // Further apart: said in text and JSON. The page draws lines, so it predicts the stretches that it shows at every sample.
    let pages = [
        "compare",
        "data",
        "-m",
        "model.toml",
        "-n",
        "run",
        "--stride",
        "30",
        "--json",
        "few.json",
        "--report",
        "pages",
        "--force",
    ];
    let said = run(place.path(), &pages)?;
    let few = json(place.path(), "few.json")?;
    assert!(said.contains("every 30th sample") && few["stride"] == 30, "{said}");
    assert!(few["models"][0]["windows"].as_u64() < all["models"][0]["windows"].as_u64());
    let page = read(place.path(), "pages/comparison.html")?;
    assert!(page.contains("Worst ten seconds") && page.contains("<svg") && !page.contains("Predictions are points"));
    run(place.path(), &["diagnose", "data", "-m", "model.toml", "--report", "pages"])?;
    assert!(place.path().join("pages/comparison.html").exists() && place.path().join("pages/diagnosis.html").exists());
    assert!(!place.path().join("pages/report.html").exists());
    let output = phyture(place.path(), &["compare", "data", "-m", "model.toml", "--stride", "0"])?;
    assert!(output.status.code() == Some(2) && errors(&output).contains("not in 1..="));
    Ok(())
}

#[test]
fn the_loop_ends_with_before_and_after_and_gives_each_number_once() -> Result<()> {
    let place = folder()?;
    run(
        place.path(),
        &["simulate", "data", "--minutes", "10", "--seed", "7404", "--hide", "weathercock", "--explainable", "floor"],
    )?;
    let said = run(place.path(), &["loop", "data", "-o", "amended.toml", "--json", "loop.json", "--explainable", "floor"])?;
    fits(&said);
    // No round by itself: one verdict and one list, then the table, the model and the ledger.
    assert!(
        said.matches("Verdict: ").count() == 1 && !said.contains("Round ") && said.matches("weathercock: ").count() == 1,
        "{said}"
    );
    let table: Vec<&str> = said.lines().skip_while(|line| !line.starts_with("RMSE on ")).collect();
    assert!(table.len() > 8 && table[0].ends_with("; one effect added"), "{said}");
    let row = |name: &str| {
        let line = table.iter().find(|line| line.trim_start().starts_with(name)).copied().unwrap_or_default();
        line.trim_start().trim_start_matches(name).split_whitespace().map(str::to_owned).collect::<Vec<_>>()
    };
    for name in ["before", "after", "floor", "squared error removed, %", "removable error removed, %"] {
        assert_eq!(row(name).len(), 6, "{name}: {said}");
    }
    let ledger = said.lines().position(|line| line == "ledger: amended.ledger.jsonl, a line for weathercock");
    let table_at = said.lines().position(|line| line.starts_with("RMSE on "));
    assert!(ledger > table_at && said.contains("model written to amended.toml"), "{said}");
    assert!(!said.contains("tail_lag ") && said.contains("--verbose lists them"), "candidates are counted: {said}");
    let found = json(place.path(), "loop.json")?;
    assert_eq!(found["ledger"], "amended.ledger.jsonl");
    assert!(found["rounds"].as_array().is_some_and(|rounds| rounds.len() == 2), "the rounds stay in the JSON");
    // The table holds the numbers of the JSON, and the floor is that of `compare` on the same flights.
    let together = &found["together"]["locked"];
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    for (place, channel) in ["vx_dot", "vy_dot", "vz_dot", "wx_dot", "wy_dot", "wz_dot"].iter().enumerate() {
        let [before, after, floor] = ["rmse_before", "rmse_after", "floor"].map(|what| number(&together[what][channel]));
        for (name, value) in [("before", before), ("after", after), ("floor", floor)] {
            assert_eq!(row(name)[place], format!("{value:.4}"), "{channel}");
        }
        let share = (before * before - after * after) / (before * before - floor * floor);
        let told = &together["removable_removed"][channel];
        assert!(told.is_null() || (number(told) - share).abs() < 1e-9, "{channel}: {told} {share}");
    }
    // A fin is most of what was hidden from the yaw channel: nearly all that could be removed is, and the fin alone did it.
    assert!(number(&together["removable_removed"]["wz_dot"]) > 0.9, "{together}");
    let worth = &found["together"]["worth"][0];
    let share = number(&worth["share"]["wz_dot"]["share"]);
    let ci95 = [0, 1].map(|end| number(&worth["share"]["wz_dot"]["ci95"][end]));
    assert!(ci95[0] > share - 0.2 && ci95[1] < share + 0.2, "paired with the error before, block by block: {worth}");
    assert!(worth["effect"] == "weathercock" && (share - number(&together["mse_fall"]["wz_dot"][0])).abs() < 0.02, "{worth}");
    let amended = Model::read(place.path().join("amended.toml"))?;
    let effect = amended.effect("weathercock").ok_or_else(|| Error::Undetermined("no weathercock".into()))?;
    for steps in [&found["rounds"][0]["steps"], &found["together"]["steps"]] {
        let numbers = steps[0]["coefficients"].as_array().cloned().unwrap_or_default();
        assert_eq!(numbers.len(), effect.coefficients.len());
        for (number, coefficient) in numbers.iter().zip(&effect.coefficients) {
            assert_eq!(number["value"].as_f64().map(f64::to_bits), Some(coefficient.value.to_bits()), "{number} {coefficient:?}");
        }
        let formula = steps[0]["formula"].as_str().unwrap_or_default();
        assert_eq!(formula, effect.to_string(), "the formula has the numbers that stand beside it");
    }
    let verbose = run(place.path(), &["diagnose", "data", "--verbose"])?;
    fits(&verbose);
    assert!(verbose.lines().any(|line| line.starts_with("tail_lag ")) && verbose.contains("could be chance: p "), "{verbose}");
    Ok(())
}

/// A model that knows of wind meets flights that nobody fitted: it finds their wind in the first halves, and every model is judged on the second.
#[test]
fn wind_of_new_flights_is_found_in_the_halves_that_it_does_not_judge() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    run(at, &["simulate", "data", "--minutes", "10", "--level", "2", "--seed", "7409", "--hide", "wind"])?;
    run(at, &["effect", "add", "wind", "-m", "data/model.toml", "-o", "with.toml"])?;
    for (from, to) in [("data/model.toml", "calm.toml"), ("with.toml", "windy.toml")] {
        run(at, &["calibrate", "data", "-m", from, "-o", to, "--lock", "chaos", "--lock", "descents"])?;
    }
    let compared = |models: &[&str], json_file: &str| -> Result<(String, Value)> {
        let mut arguments = vec!["compare", "data", "--lock", "chaos", "--lock", "descents", "--json", json_file];
        models.iter().for_each(|model| arguments.extend(["-m", model]));
        let said = run(at, &arguments)?;
        fits(&said);
        Ok((said, json(at, json_file)?))
    };
    let (said, found) = compared(&["calm.toml", "windy.toml"], "both.json")?;
    let (said_calm, calm) = compared(&["calm.toml"], "calm.json")?;
    assert!(said.contains("found from its other half") && found["own_from_other_half"] == true, "{said}");
    assert!(!said_calm.contains("other half") && calm["own_from_other_half"] == false, "{said_calm}");
    let windows = |found: &Value| found["models"].as_array().and_then(|models| models.last()?["windows"].as_u64()).unwrap_or(0);
    let [halves, whole] = [&found, &calm].map(windows);
    assert!(halves > 0 && halves.abs_diff(whole) <= 8, "{halves} of {whole}");
    let rmse = |name: &str| {
        let models = found["models"].as_array().cloned().unwrap_or_default();
        let model = models.iter().find(|model| model["name"] == name).cloned().unwrap_or_default();
        model["rmse"]["vz_dot"].as_f64().unwrap_or(f64::NAN)
    };
    // Wind is most of this error; with its mean over other flights nothing of it would be gone.
    assert!(rmse("windy") < 0.6 * rmse("calm"), "{} {}", rmse("windy"), rmse("calm"));
    Ok(())
}

/// The floor is beside what is found, in text, JSON and page; and what is found does not change by it.
#[test]
fn the_explainable_part_shows_the_floor_and_is_never_searched() -> Result<()> {
    let place = folder()?;
    let at = place.path();
    run(at, &["simulate", "data", "--minutes", "10", "--seed", "7408", "--hide", "quad_drag=2", "--explainable", "floor"])?;
    let plain = run(at, &["diagnose", "data", "--json", "plain.json"])?;
    let said = run(at, &["diagnose", "data", "--json", "with.json", "--report", "pages", "--explainable", "floor"])?;
    fits(&said);
    let [plain_json, with] = [json(at, "plain.json")?, json(at, "with.json")?];
    for same in ["accepted", "steps", "candidates", "data_sha256", "worth", "unknown"] {
        assert_eq!(plain_json[same], with[same], "{same}");
    }
    assert!(plain_json["locked"].get("floor").is_none() && !plain.contains("floor"), "{plain}");
    assert_eq!(with["locked"]["removable_removed"].as_object().map(serde_json::Map::len), Some(7));
    let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("Of the removable error, the mean squared error before less that of the floor,"), "{said}");
    let floor = said.lines().find(|line| line.trim_start().starts_with("floor ")).map(|line| line.split_whitespace().count());
    assert_eq!(floor, Some(7), "{said}");
    let page = read(at, "pages/diagnosis.html")?;
    assert!(page.contains("of the removable") && page.contains("What was missing"));
    // Nothing that is searched may hold it: neither inside, nor around, nor the flights themselves.
    let copy = |from: &str, to: &str| -> Result<()> {
        for file in walk(&at.join(from))? {
            let name = file.strip_prefix(at.join(from)).unwrap_or(&file);
            let to = at.join(to).join(name);
            let above = to.parent().unwrap_or(&to);
            std::fs::create_dir_all(above).map_err(Error::io(above))?;
            std::fs::copy(&file, &to).map_err(Error::io(&to))?;
        }
        Ok(())
    };
    run(at, &["calibrate", "data", "-o", "model.toml"])?;
    copy("floor", "data/floor")?;
    let cases = [
        ("data/floor", "inside the folder of the flights"),
        ("data", "the flights themselves"),
        (".", "a folder that holds the flights"),
    ];
    for (folder, how) in cases {
        for command in [&["diagnose"][..], &["loop", "-o", "amended.toml"], &["compare"]] {
            let output = phyture(at, &[command, &["data", "-m", "model.toml", "--explainable", folder]].concat())?;
            let text = errors(&output);
            assert_eq!(output.status.code(), Some(2), "{command:?} {folder}: {text}");
            assert!(text.contains(&format!("`--explainable` is {folder}, {how}, expected a folder elsewhere")), "{text}");
        }
    }
    std::fs::remove_dir_all(at.join("data/floor")).map_err(Error::io("data/floor"))?;
    // Of other flights, it is refused before the search.
    run(at, &["simulate", "other", "--minutes", "5", "--seed", "7409", "--explainable", "other-floor"])?;
    let output = phyture(at, &["diagnose", "data", "-m", "model.toml", "--explainable", "other-floor"])?;
    assert!(output.status.code() == Some(2) && errors(&output).contains("explainable part"), "{}", errors(&output));
    let output = phyture(at, &["diagnose", "data", "--of-network", "run", "--explainable", "floor"])?;
    assert!(output.status.code() == Some(2) && errors(&output).contains("cannot be used with"), "{}", errors(&output));
    Ok(())
}

/// The opposite of a fin, added to flights that have none.
#[test]
fn an_effect_with_the_wrong_sign_is_not_named() -> Result<()> {
    let set = simulate(&Simulation { minutes: 12.0, seed: 7405, ..Simulation::baseline() })?;
    let model = Model::paper("sim", MASS_KG, INERTIA_KG_M2, ROTOR_RADIUS_M);
    let search = |set: &DataSet| {
        let split = Split::for_search(&set.flights, 1);
        diagnose(&set.flights, &model, &split.training, &split.test, "test", &Options::default())
    };
    for (size, named) in [(0.04, true), (-0.04, false)] {
        let changed = implant(&set, &model, &Effect::formula("fin", Channel::WzDot, "airspeed * vy", size)?)?;
        assert!(changed.flights.iter().all(|flight| flight.targets == Targets::Recorded));
        let found = search(&changed)?.diagnosis;
        assert_eq!(found.accepted.iter().any(|effect| effect == "weathercock"), named, "{size}: {found:#}");
        let report = found.candidates.iter().find(|candidate| candidate.effect == "weathercock");
        let report = report.ok_or_else(|| Error::Undetermined("no weathercock".into()))?;
        if named {
            let fin = found.steps[0].coefficients.iter().find(|number| number.name == "k_fin");
            assert_eq!(fin.and_then(|number| number.sign), Some(SignFinding::Physical), "{found}");
        } else {
            assert_eq!(report.status, Status::Implausible, "{found:#}");
            assert!(report.reason.contains("wrong sign of k_fin"), "{}", report.reason);
        }
    }
    Ok(())
}

#[test]
fn quiet_is_quiet_verbose_is_not_and_a_pipe_gets_no_colour() -> Result<()> {
    let place = folder()?;
    run(place.path(), &["simulate", "data", "--minutes", "2", "--seed", "7406"])?;
    // A log with a bad cell in each flight, in a column of its own.
    for entry in walk(&place.path().join("data"))? {
        let text = std::fs::read_to_string(&entry).map_err(Error::io(&entry))?;
        let line = |(row, line): (usize, &str)| match row {
            0 => format!("{line},rpm"),
            40 => format!("{line},-1"),
            _ => format!("{line},1500"),
        };
        let text: Vec<String> = text.lines().enumerate().map(line).collect();
        std::fs::write(&entry, text.join("\n")).map_err(Error::io(&entry))?;
    }
    let description = "extra = [\"rpm\"]\n[[repair]]\ncolumns = [\"rpm\"]\nvalid = [\"value >= 0\"]\nmax_gap_s = 0.1\n";
    write(place.path(), "data/dataset.toml", description)?;
    let short = run(place.path(), &["check", "data"])?;
    let long = run(place.path(), &["check", "data", "--verbose"])?;
    let count = |text: &str| text.matches("bad cells interpolated").count();
    assert!(count(&short) == 1 && short.contains("--verbose lists them by flight"), "{short}");
    assert!(count(&long) > 3 && !long.contains("--verbose lists"), "{long}");
    for text in [&short, &long] {
        assert!(!text.contains('\u{1b}'), "no colour in a pipe");
    }
    let quiet = phyture(place.path(), &["check", "data", "--quiet", "--json", "check.json"])?;
    assert!(quiet.status.success() && quiet.stdout.is_empty() && quiet.stderr.is_empty(), "{}", errors(&quiet));
    assert!(place.path().join("check.json").exists());
    // The page has every note.
    run(place.path(), &["diagnose", "data", "--quiet", "--report", "pages"])?;
    let page = read(place.path(), "pages/diagnosis.html")?;
    assert!(page.contains("Notes on the data (") && page.matches("bad cells interpolated").count() > 3);
    let list = phyture(place.path(), &["effect", "list", "--quiet"])?;
    assert!(!list.stdout.is_empty(), "what was asked for is printed all the same");
    Ok(())
}

/// Every CSV below a folder.
fn walk(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        if path.is_dir() {
            found.extend(walk(&path)?);
        } else if path.extension().is_some_and(|ending| ending == "csv") {
            found.push(path);
        }
    }
    Ok(found)
}

#[test]
fn too_little_data_is_said_in_a_sentence() -> Result<()> {
    let place = folder()?;
    run(place.path(), &["simulate", "data", "--minutes", "2", "--seed", "7407"])?;
    let said = run(place.path(), &["diagnose", "data", "--json", "diagnosis.json"])?;
    assert_eq!(json(place.path(), "diagnosis.json")?["verdict"], "too_little_data");
    assert!(said.contains("too few to tell a missing effect from chance; 30 are needed"), "{said}");
    fits(&said);
    // Six seconds of one flight: one block to judge on.
    let logs = walk(&place.path().join("data"))?;
    let text = std::fs::read_to_string(&logs[0]).map_err(Error::io(&logs[0]))?;
    let text: Vec<&str> = text.lines().take(601).collect();
    write(place.path(), "short.csv", &text.join("\n"))?;
    run(place.path(), &["calibrate", "data", "-o", "model.toml"])?;
    let said = run(place.path(), &["compare", "short.csv", "-m", "model.toml", "--split", "first 0.5"])?;
    assert!(said.contains("one block of ten seconds: nothing can be said of chance"), "{said}");
    let rows = said.lines().take_while(|line| !line.starts_with("* best"));
    assert!(rows.clone().all(|line| !line.contains('*')) && !said.contains("NaN"), "{said}");
    let output = phyture(place.path(), &["diagnose", "short.csv", "-m", "model.toml"])?;
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), errors(&output));
    assert!(said.contains("too few to tell a missing effect from chance") || said.contains("give"), "{said}");
    Ok(())
}

/// The flights of a Crazyflie, where they are at hand (beside the project, never in it), and two files of its fixtures.
fn crazyflie(dataset: &str, model: &str) -> Option<[String; 3]> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/crazyflie");
    if !data.is_dir() {
        eprintln!("skipped: the Crazyflie flights are not at {}", data.display());
        return None;
    }
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/crazyflie");
    Some([data, fixtures.join(dataset), fixtures.join(model)].map(|path| path.display().to_string()))
}

#[test]
fn real_flights_get_a_verdict_that_does_not_contradict_itself() -> Result<()> {
    let Some([data, dataset, model]) = crazyflie("dataset.toml", "model.toml") else { return Ok(()) };
    let place = folder()?;
    let common = [data.as_str(), "--dataset", &dataset, "-m", &model];
    let said = run(place.path(), &[&["calibrate"], &common[..], &["-o", "model.toml", "--json", "calibration.json"]].concat())?;
    assert!(said.contains("WRONG SIGN") && said.contains("wrong sign (anti-damping)"), "{said}");
    assert_eq!(said.matches("  note: ").count(), 10, "one line for 34 notes on single flights: {said}");
    let signs = json(place.path(), "calibration.json")?["signs"].as_array().cloned().unwrap_or_default();
    let wrong: Vec<&Value> = signs.iter().filter(|sign| sign["finding"] == "wrong").map(|sign| &sign["name"]).collect();
    assert_eq!(wrong, ["b_x", "b_y"], "{signs:?}");
    let told = run(place.path(), &[&["diagnose"], &common[..], &["--json", "diagnosis.json"]].concat())?;
    fits(&told);
    let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
    let found = json(place.path(), "diagnosis.json")?;
    for channel in ["wx_dot", "wz_dot"] {
        let fall = &found["locked"]["mse_fall"][channel];
        assert!(fall[1].as_f64().is_some_and(|low| low > 0.0), "the interval is wholly positive: {channel} {fall}");
    }
    assert_eq!(found["confirmation"], "confirmed");
    assert!(
        told.contains("Verdict: effects missing. The model lacks")
            && told.contains("then `rotor_acceleration`")
            && !told.contains("`wind`"),
        "{told}"
    );
    assert!(!told.contains("nothing to add") && told.contains("wy_dot changes by"), "{told}");
    assert!(told.contains(" is in wy_dot") && told.contains("u2"), "{told}");
    assert!(!told.contains("usual 1.5 to 4"), "a Crazyflie is no 5 kg helicopter: {told}");
    // What does not hold on unseen flights is not suggested, and what is suggested shows its measure.
    for unknown in found["unknown"].as_array().into_iter().flatten() {
        let Some(low) = unknown["tried"]["locked_mse_fall"][1].as_f64() else { continue };
        assert_eq!(unknown["suggested_formula"].is_string(), low > 0.0, "{unknown}");
    }
    let tried = found["unknown"][0]["tried"]["formula"].as_str().unwrap_or_default();
    assert!(!tried.is_empty() && told.contains(&format!("`{tried}`, does not hold on 251 s")), "{told}");
    Ok(())
}

/// What is asked of named physics on each class of these flights in turn, of which no fit has seen any: R² of roll, pitch and yaw.
#[test]
fn named_physics_explains_the_turning_of_a_quadrotor_on_every_class_that_was_kept_back() -> Result<()> {
    let Some([data, dataset, model]) = crazyflie("samples.toml", "named.toml") else { return Ok(()) };
    let place = folder()?;
    let at = place.path();
    for class in ["multisine", "random1", "random2", "square"] {
        let common = [&data, "--dataset", &dataset, "--lock", class];
        let [fitted, found] = [format!("{class}.toml"), format!("{class}.json")];
        run(at, &[&["calibrate", "-m", &model, "-o", &fitted, "--weights", "flights"], &common[..]].concat())?;
        let said = run(at, &[&["compare", "-m", &fitted, "--stride", "1", "--json", &found], &common[..]].concat())?;
        let found = json(at, &found)?;
        assert_eq!(found["own_from_other_half"], true, "each half with the trim that its other half says");
        let models = found["models"].as_array().cloned().unwrap_or_default();
        let r2 = models.last().map(|model| model["r2"].clone()).unwrap_or_default();
        for (channel, asked) in [("wx_dot", 0.40), ("wy_dot", 0.40), ("wz_dot", 0.50)] {
            assert!(r2[channel].as_f64().is_some_and(|r2| r2 >= asked), "{class}, {channel}: {r2}\n{said}");
        }
    }
    Ok(())
}

#[test]
fn a_battery_that_was_put_in_anew_is_named_and_no_wind_indoors() -> Result<()> {
    let Some([data, dataset, model]) = crazyflie("samples.toml", "bare.toml") else { return Ok(()) };
    let place = folder()?;
    let common = ["loop", &data, "--dataset", &dataset, "-m", &model, "-o", "amended.toml", "--lock", "random2"];
    let told = run(place.path(), &common)?;
    fits(&told);
    let amended = Model::read(place.path().join("amended.toml"))?;
    for kind in ["rotor_acceleration", "dihedral_speedstab", "blowback_climb"] {
        assert!(amended.effect(kind).is_some(), "{kind}: {told}");
    }
    assert!(amended.effect("wind").is_none(), "{told}");
    // Two flights on one battery and two on the next: alike within a pair, apart between them.
    let pitch = &amended.effect("trim_shift").ok_or_else(|| Error::Undetermined(told.clone()))?.coefficients[1];
    let of = |run: usize| pitch.in_flight(&format!("random1/random1_20251017_run{run}"));
    assert!((of(1) - of(2)).abs() < 0.5 && (of(3) - of(4)).abs() < 0.5 && (of(1) - of(3)).abs() > 1.5, "{told}");
    Ok(())
}
