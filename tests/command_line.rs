//! The program as a shell sees it: exit codes, messages on standard error, JSON on standard output, Ctrl-C.
#![cfg(all(feature = "cli", unix))]

mod program;

use phyture::{Error, Result};
use program::{folder, phyture};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

#[test]
fn bad_usage_and_bad_input_exit_with_2_and_say_what_is_wrong() -> Result<()> {
    let place = folder()?;
    let wrong = [
        (&["calibrat", "data"][..], "unrecognized subcommand"),
        (&["check", "nowhere"], "nowhere"),
        (&["simulate", "data", "--hide", "ground_efect"], "ground_effect"),
        (&["simulate", "data", "--hide", "ground_effect=much"], "EFFECT=SCALE"),
        (&["parity", "nothing.safetensors"], "nothing.safetensors"),
        (&["effect", "show", "grund_effect"], "did you mean `ground_effect`?"),
        (&["effect", "add", "linear_drag", "-m", "none.toml", "-o", "out.toml"], "an effect of the catalogue"),
        (&["simulate", "data", "--like", "stanford", "--minutes", "5"], "cannot be used with '--minutes"),
        (&["effect", "add", "wind", "-m", "none.toml", "-o", "out.toml"], "none.toml"),
        (&["implant", "data", "out"], "--effect"),
    ];
    for (arguments, message) in wrong {
        let output = phyture(place.path(), arguments)?;
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {text}");
        assert!(text.contains(message), "{arguments:?}: {text}");
    }
    Ok(())
}

#[test]
fn results_go_to_standard_output_as_json_alone_when_asked() -> Result<()> {
    let place = folder()?;
    assert!(phyture(place.path(), &["simulate", "data", "--minutes", "3", "--seed", "7300"])?.status.success());
    let commands = [
        (&["init", "data", "--output", "described", "--json", "-"][..], "unknown"),
        (&["check", "data", "--json", "-"], "fault"),
        (&["calibrate", "data", "-o", "model.toml", "--lock", "chaos", "--json", "-"], "condition_number"),
        (&["compare", "data", "-m", "model.toml", "--json", "-"], "models"),
    ];
    for (arguments, key) in commands {
        let output = phyture(place.path(), arguments)?;
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        let parsed: std::result::Result<serde_json::Value, _> = serde_json::from_slice(&output.stdout);
        assert!(parsed.is_ok_and(|value| value.get(key).is_some()), "{arguments:?}");
    }
    Ok(())
}

#[test]
fn a_model_file_says_which_flights_were_left_out() -> Result<()> {
    let place = folder()?;
    let model = |name: &str| std::fs::read_to_string(place.path().join(name)).map_err(Error::io(name));
    assert!(phyture(place.path(), &["simulate", "data", "--minutes", "3", "--seed", "7300"])?.status.success());
    let run = phyture(place.path(), &["calibrate", "data", "-o", "model.toml", "--leave-out", "chaos_0000"])?;
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    assert!(model("model.toml")?.contains("left_out = [\"chaos/chaos_0000\"]"), "{}", model("model.toml")?);
    let run = phyture(place.path(), &["calibrate", "data", "-m", "model.toml", "-o", "whole.toml"])?;
    assert!(run.status.success() && !model("whole.toml")?.contains("left_out"), "{}", model("whole.toml")?);
    Ok(())
}

#[test]
fn an_effect_is_listed_shown_and_added_once() -> Result<()> {
    let place = folder()?;
    let list = phyture(place.path(), &["effect", "list"])?;
    let text = String::from_utf8_lossy(&list.stdout).into_owned();
    assert!(list.status.success() && text.lines().count() > 34, "{text}");
    assert!(text.lines().any(|line| line.starts_with("cyclic_lag") && line.contains("wx_dot wy_dot ")), "{text}");
    let show = phyture(place.path(), &["effect", "show", "ground_effect"])?;
    let text = String::from_utf8_lossy(&show.stdout).into_owned();
    for part in [
        "thrust := thrust * (1 + k * ",
        "Changes signals   thrust",
        "usually 0.6 to 1.3",
        "tried: 0, 0.2, 0.4",
        "Mistaken for      rotor_droop",
        "Cheeseman",
    ] {
        assert!(text.contains(part), "{part} in\n{text}");
    }
    // The baseline's are shown, too.
    let show = phyture(place.path(), &["effect", "show", "linear_drag"])?;
    let text = String::from_utf8_lossy(&show.stdout).into_owned();
    assert!(show.status.success() && text.contains("vx_dot += a_x * air_vx") && text.contains("any value"), "{text}");
    let json = phyture(place.path(), &["effect", "show", "wind", "--json", "-"])?;
    let value: serde_json::Value = serde_json::from_slice(&json.stdout).map_err(|error| Error::Undetermined(error.to_string()))?;
    assert_eq!(value["coefficients"][0]["by_flight"].as_f64(), Some(3.0));

    let write = |name: &str, text: &str| std::fs::write(place.path().join(name), text).map_err(Error::io("model"));
    write("n9.toml", "[model]\nbaseline = \"paper\"\n")?;
    let added = phyture(place.path(), &["effect", "add", "wind", "-m", "n9.toml", "-o", "with.toml"])?;
    assert!(added.status.success(), "{}", String::from_utf8_lossy(&added.stderr));
    let model = phyture::physics::Model::read(place.path().join("with.toml"))?;
    assert_eq!(model.effect("wind").and_then(|effect| effect.added_by.as_deref()), Some("effect add"));
    write("quad.toml", "[model]\nbaseline = \"paper\"\nvehicle = \"multirotor\"\n")?;
    write("bare.toml", "[model]\n")?;
    for (arguments, part) in [
        (["wind", "with.toml"], "already there"),
        (["wind", "bare.toml"], "nothing that reads air_vx, air_vy, air_vz, which `wind` changes"),
        (["flap_tilt", "quad.toml"], "one for which `flap_tilt` makes sense: helicopter"),
    ] {
        let refused = phyture(place.path(), &["effect", "add", arguments[0], "-m", arguments[1], "-o", "no.toml"])?;
        let text = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(refused.status.code() == Some(2) && text.contains(part), "{arguments:?}: {text}");
    }
    assert!(!place.path().join("no.toml").exists());
    Ok(())
}

#[test]
fn implanted_flights_are_read_like_any_and_carry_their_truth() -> Result<()> {
    let place = folder()?;
    assert!(phyture(place.path(), &["simulate", "data", "--minutes", "2", "--baseline", "--seed", "7302"])?.status.success());
    for (name, wanted) in [
        ("drag", &["--effect", "quad_drag", "--scale", "2"][..]),
        ("droop", &["--effect", "rotor_droop", "--size", "k=-0.2", "--size", "tau_s=0.5"]),
        ("odd", &["--formula", "wx_dot = 1.5*sin(3*height)"]),
    ] {
        let output = phyture(place.path(), &[&["implant", "data", name][..], wanted].concat())?;
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        let truth = std::fs::read(place.path().join(name).join("truth.json")).map_err(Error::io("truth.json"))?;
        let truth: serde_json::Value = serde_json::from_slice(&truth).map_err(|error| Error::Undetermined(error.to_string()))?;
        let (vx, wx) = (truth["rms"]["vx_dot"].as_f64().unwrap_or(f64::NAN), truth["rms"]["wx_dot"].as_f64().unwrap_or(f64::NAN));
        match name {
            "drag" => assert!(vx > 0.05 && wx == 0.0, "{truth}"),
            "droop" => assert!(truth["coefficients"][0]["value"].as_f64() == Some(-0.2) && wx > 0.0, "{truth}"),
            _ => assert!((0.5..1.5).contains(&wx) && truth["effect"] == "implanted", "{truth}"),
        }
        let model = format!("{name}.toml");
        assert!(phyture(place.path(), &["calibrate", name, "-o", &model])?.status.success(), "{name}");
    }
    Ok(())
}

#[test]
fn a_comparison_with_a_network_says_who_explains_what() -> Result<()> {
    let place = folder()?;
    let run = |arguments: &[&str]| -> Result<Output> {
        let output = phyture(place.path(), arguments)?;
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        Ok(output)
    };
    run(&["simulate", "data", "--minutes", "2", "--seed", "7303"])?;
    run(&["calibrate", "data", "-o", "model.toml"])?;
    let own = "[[effect]]\nkind = \"formula\"\nname = \"side_force\"\nchannel = \"vy_dot\"\nformula = \"vy * abs(vy)\"\ncoefficient = 0.0\n";
    std::fs::write(place.path().join("more.toml"), format!("[model]\nbaseline = \"paper\"\n{own}"))
        .map_err(Error::io("more.toml"))?;
    run(&["calibrate", "data", "-m", "more.toml", "-o", "amended.toml"])?;
    let config = "epochs = 2\nstride = 20\n[linear]\nlags = 3\n[network]\nhistory = 16\nd_model = 8\nheads = 2\nlevels = 2\nstacks = 1\nmoving_average = 5\n";
    std::fs::write(place.path().join("train.toml"), config).map_err(Error::io("train.toml"))?;
    run(&["train", "data", "-m", "amended.toml", "-o", "run", "--config", "train.toml"])?;
    // The first model is the reference, unless it is the network's own: the variance takes its place.
    for (models, reference) in
        [(&["-m", "model.toml", "-m", "amended.toml"][..], "model"), (&["-m", "amended.toml"], "mean of the measurements")]
    {
        let asked = ["-n", "run", "--stride", "20", "--uncertainty", "--report", "report", "--force", "--json", "-"];
        let output = run(&[&["compare", "data"], models, &asked].concat())?;
        let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        let shares = &found["shares"][0];
        assert_eq!(
            (&shares["name"], &shares["model"], &shares["reference"]),
            (&"run".into(), &"amended".into(), &reference.into())
        );
        let share = |part: &str| shares[part]["mean"]["share"].as_f64().unwrap_or(f64::NAN);
        assert!(
            (share("physics") + share("network") + share("neither") - 1.0).abs() < phyture_kernels::Tolerance::Close.relative_f64()
        );
        assert!(shares["of_network"]["linear_history"]["vx_dot"]["ci95"].is_array(), "{shares}");
        assert_eq!(found["uncertainty"][0]["coefficients"].as_array().map(Vec::len), Some(15));
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(text.contains("Who explains what") && text.contains("side_force.coefficient"), "{text}");
        let page = std::fs::read_to_string(place.path().join("report/comparison.html")).map_err(Error::io("comparison.html"))?;
        assert!(page.contains(">Who explains what</h2>") && page.contains(">What the uncertain coefficients do</h2>"));
    }
    Ok(())
}

#[test]
fn a_convention_fault_exits_with_3_after_its_report_is_written() -> Result<()> {
    let place = folder()?;
    assert!(phyture(place.path(), &["simulate", "data", "--minutes", "3", "--seed", "7301"])?.status.success());
    // The log says z is down; read it as if it were up.
    std::fs::write(place.path().join("data/dataset.toml"), "axes = \"ENU/FLU\"\n").map_err(Error::io("dataset.toml"))?;
    let output = phyture(place.path(), &["check", "data", "--json", "check.json"])?;
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stdout));
    assert!(place.path().join("check.json").exists());
    Ok(())
}

#[test]
fn an_interrupted_training_saves_and_exits_with_130() -> Result<()> {
    let place = folder()?;
    assert!(phyture(place.path(), &["simulate", "data", "--minutes", "2", "--seed", "7302"])?.status.success());
    assert!(phyture(place.path(), &["calibrate", "data", "-o", "model.toml"])?.status.success());
    let config = "epochs = 100000\nstride = 20\n[network]\nhistory = 16\nd_model = 8\nheads = 2\nlevels = 2\nstacks = 1\nmoving_average = 5\n";
    std::fs::write(place.path().join("train.toml"), config).map_err(Error::io("train.toml"))?;
    let mut command = Command::new(env!("CARGO_BIN_EXE_phyture"));
    command.args(["train", "data", "-m", "model.toml", "-o", "run", "--config", "train.toml"]).current_dir(place.path());
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().map_err(Error::io("phyture"))?;
    // The first checkpoint is written when the run begins.
    let begun = Instant::now();
    while !place.path().join("run/checkpoint.phyture").exists() && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(100));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().map_err(Error::io("kill"))?;
    assert!(sent.success());
    let output = child.wait_with_output().map_err(Error::io("phyture"))?;
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{text}");
    assert!(text.contains("saved after step"), "{text}");
    Ok(())
}

#[test]
fn completions_manual_pages_and_the_language_of_formulas_come_from_the_program_itself() -> Result<()> {
    let place = folder()?;
    let said = |arguments: &[&str]| -> Result<String> {
        let output = phyture(place.path(), arguments)?;
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    };
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = said(&["completions", shell])?;
        assert!(script.contains("phyture") && script.contains("explainable"), "{shell}");
    }
    said(&["man", "pages"])?;
    let page = |name: &str| std::fs::read_to_string(place.path().join("pages").join(name)).map_err(Error::io(name.to_owned()));
    assert!(page("phyture.1")?.contains("Exit codes") && page("phyture-train.1")?.contains("print"));
    for name in ["check", "calibrate", "compare", "diagnose", "loop", "train", "predict", "benchmark"] {
        assert!(!page(&format!("phyture-{name}.1"))?.is_empty());
    }
    assert!(page("phyture-effect-show.1")?.contains("All that is known") && page("phyture-benchmark-collect.1").is_ok());
    let grammar = said(&["help", "formula"])?;
    for form in ["slew(x, per_s)", "atan2(y, x)", "a^b", "airspeed", "g_z"] {
        assert!(grammar.contains(form), "{form} in\n{grammar}");
    }
    assert!(said(&["formula", "vy*hypot( vx,vy )+k"])?.starts_with("vy * hypot(vx, vy) + k\nreads vy, vx\nand k:"));
    Ok(())
}

#[test]
fn a_model_is_exported_to_c_for_the_rate_that_it_needs() -> Result<()> {
    let place = folder()?;
    let write = |name: &str, text: &str| std::fs::write(place.path().join(name), text).map_err(Error::io(name.to_owned()));
    let model =
        "[model]\nname = \"n9\"\nmass_kg = 4.58\ninertia = [0.18, 0.34, 0.28]\nrotor_radius_m = 0.8\nbaseline = \"paper\"\n";
    write("plain.toml", model)?;
    write("late.toml", &format!("{model}[data]\ncontrol_delay_s = 0.02\n"))?;
    let json = |arguments: &[&str]| -> Result<serde_json::Value> {
        let output = phyture(place.path(), &[arguments, &["--json", "-"]].concat())?;
        serde_json::from_slice(&output.stdout).map_err(|error| Error::Undetermined(format!("{arguments:?}: {error}")))
    };
    let plain = json(&["export-c", "plain.toml", "-o", "plain.c", "--name", "heli"])?;
    assert_eq!((plain["name"].as_str(), plain["step_s"].is_null()), (Some("heli"), true), "{plain}");
    let file = std::fs::read_to_string(place.path().join("plain.c")).map_err(Error::io("plain.c"))?;
    assert!(file.contains("void heli_step(heli_memory *memory, const heli_real state[16], heli_real acceleration[6]);"), "{file}");
    let late = json(&["export-c", "late.toml", "-o", "late.c", "--hz", "50"])?;
    assert_eq!((late["name"].as_str(), late["step_s"].as_f64()), (Some("n9"), Some(0.02)), "{late}");
    for (arguments, part) in [
        (&["late.toml", "-o", "no.c"][..], "`--hz`"),
        (&["late.toml", "-o", "no.c", "--hz", "-50"], "expected a number above 0"),
        (&["late.toml", "-o", "no.c", "--hz", "50", "--name", "9"], "a letter first"),
        (&["none.toml", "-o", "no.c"], "none.toml"),
    ] {
        let output = phyture(place.path(), &[&["export-c"], arguments].concat())?;
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && text.contains(part), "{arguments:?}: {text}");
    }
    assert!(!place.path().join("no.c").exists());
    Ok(())
}

#[test]
fn a_failure_is_json_where_json_was_asked_for() -> Result<()> {
    let place = folder()?;
    for (arguments, kind) in [
        (&["check", "nowhere", "--json", "-"][..], "io"),
        (&["check", "--json=-"], "usage"),
        (&["formula", "vx +", "--json", "-"], "formula"),
    ] {
        let output = phyture(place.path(), arguments)?;
        let found: serde_json::Value =
            serde_json::from_slice(&output.stdout).map_err(|error| Error::Undetermined(error.to_string()))?;
        assert_eq!((output.status.code(), &found["schema"], &found["exit_code"]), (Some(2), &1.into(), &2.into()), "{found}");
        assert_eq!(found["error"]["kind"], kind, "{found}");
    }
    Ok(())
}
