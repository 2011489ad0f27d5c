//! The page of `compare`, as a whole: it holds what it should, loads nothing, and escapes what people name things.
//!
//! The page is left in `target/tmp/compare.html`, to be looked at.
#![cfg(feature = "report")]

use phyture::critique::{Comparison, PerChannel, Row, compare};
use phyture::flight::split;
use phyture::flight::{Column, Flight, Targets, Window};
use phyture::report::{CompareReport, Page, Part, Section, compare_page, page};
use phyture::{Error, Result};

/// Numbers in [-1, 1) without a pattern that shows: a linear congruential generator (Numerical Recipes, 3rd ed., sec. 7.1).
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// A flight at 100 Hz whose speed, height and rates swing slowly, with a drag and a ground effect the linear model below lacks.
fn flight(name: &str, manoeuvre: &str, seconds: usize, seed: u64, speed: f64, height: f64) -> Result<Flight> {
    let samples = seconds * 100;
    let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; samples]);
    let mut next = noise(seed);
    let phase: Vec<f64> = (0..16).map(|_| 3.0 * next()).collect();
    (0..samples).for_each(|sample| {
        let time_s = sample as f64 / 100.0;
        let wave = |column: Column, rate: f64| (rate * time_s + phase[column as usize % 16]).sin();
        let mut set = |column: Column, value: f64| columns[column as usize][sample] = value;
        let (vx, vz) = (speed * wave(Column::Vx, 0.31), 0.4 * speed * wave(Column::Vz, 0.23));
        let above = height * (1.1 + wave(Column::Z, 0.17));
        set(Column::Vx, vx);
        set(Column::Vy, 0.5 * speed * wave(Column::Vy, 0.19));
        set(Column::Vz, vz);
        set(Column::Z, -above);
        for (column, size) in [(Column::Roll, 0.3), (Column::Pitch, 0.2), (Column::Wx, 0.5), (Column::Wy, 0.4), (Column::Wz, 0.7)] {
            set(column, size * wave(column, 0.9));
        }
        for column in [Column::U1, Column::U2, Column::U3, Column::U4] {
            set(column, 0.4 * wave(column, 1.3));
        }
        for (index, column) in Column::TARGETS.into_iter().enumerate() {
            let missing = match index {
                0 => -0.04 * vx * vx.abs(),
                2 => -1.5 / (1.0 + above * above),
                _ => 0.0,
            };
            set(column, wave(Column::STATE[6 + index], 0.8 + 0.3 * index as f64) + missing + 0.15 * next());
        }
    });
    Flight::new(name, manoeuvre, 0.0, 0.01, columns, Targets::Recorded)
}

struct Case {
    flights: Vec<Flight>,
    windows: Vec<Window>,
    rows: Vec<Row>,
    comparison: Comparison,
}

fn case(awkward_name: &str) -> Result<Case> {
    let flights = vec![
        flight("f01", "forward_sweep", 60, 1, 9.0, 12.0)?,
        flight("f02", "forward_sweep", 45, 2, 8.0, 15.0)?,
        flight("f03", "hover", 50, 3, 0.8, 1.5)?,
        flight("f04", awkward_name, 70, 4, 5.0, 4.0)?,
    ];
    let windows: Vec<Window> = (0..flights.len())
        .flat_map(|flight| (100..flights[flight].len()).step_by(2).map(move |last| (flight, last)))
        .map(|(flight, last)| Window { flight, last })
        .collect();
    let mut next = noise(9);
    let mut predict = |missing: f64, spread: f64| {
        let one = |window: &Window| {
            let flight = &flights[window.flight];
            let vx = flight.column(Column::Vx)[window.last];
            let above = -flight.column(Column::Z)[window.last];
            std::array::from_fn(|channel| {
                let lacks = match channel {
                    0 => 0.04 * vx * vx.abs(),
                    2 => 1.5 / (1.0 + above * above),
                    _ => 0.0,
                };
                flight.column(Column::TARGETS[channel])[window.last] + missing * lacks + spread * next()
            })
        };
        windows.iter().map(one).collect::<Vec<_>>()
    };
    let rows = vec![
        Row { name: "paper".into(), predicted: predict(1.0, 0.3) },
        Row { name: "paper + ground effect".into(), predicted: predict(0.3, 0.3) },
        Row { name: "finite difference".into(), predicted: predict(0.0, 0.9) },
    ];
    let comparison = compare(&flights, &windows, &rows, split::Part::Locked)?;
    Ok(Case { flights, windows, rows, comparison })
}

fn html(case: &Case, focus: usize) -> Result<String> {
    let provenance =
        [("data (sha256)", "4d1c…"), ("seed", "7"), ("model", "n9.toml")].map(|(what, value)| (what.to_owned(), value.to_owned()));
    let report = CompareReport {
        comparison: &case.comparison,
        flights: &case.flights,
        windows: &case.windows,
        rows: &case.rows,
        focus,
        yardstick: Some(2),
        provenance: &provenance,
    };
    Ok(page(&compare_page(&report)?))
}

/// The page without the embedded figure library, whose licence texts name addresses that are never opened.
fn without_library(html: &str) -> Result<String> {
    let missing = || Error::Undetermined("the page does not hold the figure library".into());
    let start = html.find("<script type=\"text/javascript\">").ok_or_else(missing)?;
    let end = start + html[start..].find("</script>").ok_or_else(missing)?;
    Ok(format!("{}{}", &html[..start], &html[end..]))
}

#[test]
fn the_page_is_complete_and_loads_nothing() -> Result<()> {
    let case = case("turn_demos1")?;
    let html = html(&case, 0)?;
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("compare.html");
    std::fs::write(&path, &html).map_err(Error::io(&path))?;
    assert_eq!(html.matches("plotly.js v").count(), 1, "the figure library is embedded once");
    assert!(!html.contains("MathJax.loader"), "the typesetter of formulas is left out");
    let own = without_library(&html)?;
    for loads in ["http:", "https:", "src=", "<link", "@import", "url(", "//cdn"] {
        assert!(!own.contains(loads), "the page has {loads}");
    }
    assert!(own.contains("default-src 'none'"), "the page forbids itself to load");
    // Worst and typical stretch, and the residual of the two channels that lack an effect; that of the others is noise.
    assert_eq!((own.matches("data-figure=").count(), own.matches("type=\"application/json\"").count()), (4, 4));
    assert_eq!(own.matches("there is nothing to show").count(), 4);
    for text in [
        "Worst ten seconds",
        "Typical ten seconds",
        "turn_demos1",
        "data (sha256)",
        "beats the yardstick",
        "not independent",
        "MaxAE",
    ] {
        assert!(own.contains(text), "the page lacks {text}");
    }
    // The library is 4.7 MB; what a comparison of four flights adds must stay small.
    assert!(own.len() < 1_000_000, "{} bytes", own.len());
    Ok(())
}

#[test]
fn figures_are_json_that_a_script_element_can_hold() -> Result<()> {
    let html = html(&case("</script><script>alert('x')</script>")?, 1)?;
    let own = without_library(&html)?;
    assert!(!own.contains("<script>alert"), "a manoeuvre's name becomes markup");
    let mut figures = 0;
    for part in own.split("<script type=\"application/json\"").skip(1) {
        let json = part.split_once('>').and_then(|(_, rest)| rest.split_once("</script>")).map_or("", |(json, _)| json);
        let figure: serde_json::Value = serde_json::from_str(json).map_err(|error| Error::Undetermined(error.to_string()))?;
        assert!(figure["data"].as_array().is_some_and(|traces| !traces.is_empty()) && figure["layout"]["xaxis"].is_object());
        let points = figure["data"].as_array().into_iter().flatten().filter_map(|trace| trace["y"].as_array()).map(Vec::len);
        assert!(points.max().is_some_and(|points| points <= phyture::report::figures::POINTS));
        figures += 1;
    }
    assert_eq!(figures, 4);
    Ok(())
}

#[test]
fn a_page_of_every_other_figure_stands_too() -> Result<()> {
    let channels: Vec<(String, String)> =
        Column::TARGETS.iter().map(|column| (column.name().to_owned(), column.unit().to_owned())).collect();
    let names = ["paper", "+ quadratic drag", "+ ground effect", "+ network"].map(str::to_owned);
    let fall: Vec<Vec<Option<f64>>> =
        [1.3, 0.9, 0.6, 0.4].iter().map(|error| (0..6).map(|channel| Some(error + 0.1 * f64::from(channel))).collect()).collect();
    let floor = [Some(0.31); 6];
    let rows: Vec<String> = channels.iter().map(|(name, _)| name.clone()).collect();
    let parts =
        [("physics", 0.61), ("network", 0.29), ("noise and unknown", 0.10)].map(|(name, share)| (name.to_owned(), vec![share; 6]));
    let decay = |from: f64, to: f64| (0..80).map(|epoch| to + (from - to) * (-0.08 * f64::from(epoch)).exp()).collect::<Vec<_>>();
    let curves = [("training".to_owned(), decay(1.0, 0.02)), ("validation".to_owned(), decay(1.1, 0.05))];
    let figures = [
        phyture::report::figures::steps(
            "RMSE from step to step",
            "Each bar adds one effect.",
            &channels,
            &names,
            &fall,
            Some(&floor),
        ),
        phyture::report::figures::shares(
            "What explains the error",
            "Shares of the variance of the baseline's residual.",
            &rows,
            &parts,
        ),
        phyture::report::figures::training("Training", "Mean squared error of the scaled residual.", &curves),
    ];
    let sections = vec![Section { title: "Figures".into(), parts: figures.into_iter().map(Part::Figure).collect() }];
    let html = page(&Page { title: "Figures".into(), summary: vec![], sections });
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("figures.html");
    std::fs::write(&path, &html).map_err(Error::io(&path))?;
    let own = without_library(&html)?;
    assert_eq!(own.matches("data-figure=").count(), 3);
    assert!(own.contains("+ quadratic drag") && own.contains("noise and unknown") && own.contains("validation"));
    Ok(())
}

#[test]
fn the_verdict_finds_what_was_put_there() -> Result<()> {
    let case = case("turn_demos1")?;
    let own = without_library(&html(&case, 0)?)?;
    let model = &case.comparison.models[0];
    assert!(own.contains("paper predicts") && own.contains("beats the yardstick"));
    // Quadratic drag is missing: the residual of vx_dot goes with vx, in the sweeps above all.
    let share = |name: &str| model.by_manoeuvre.get(name).and_then(|part| part.rmse.vx_dot).unwrap_or(f64::NAN);
    assert!(share("forward_sweep") > 2.0 * share("hover"), "{:?}", model.by_manoeuvre);
    assert!(own.contains("The largest error of any channel lies in manoeuvre forward_sweep"));
    assert!(own.contains("Of the models here, paper + ground effect has the smallest mean RMSE"));
    assert!(own.contains("Residual of vx_dot"));
    Ok(())
}

#[test]
fn a_focus_that_is_not_there_is_refused() -> Result<()> {
    let found = html(&case("turn_demos1")?, 3);
    assert!(matches!(found, Err(Error::Shape { message, .. }) if message.contains("no model 3")));
    Ok(())
}

#[test]
fn a_known_floor_stands_below_the_rmse_in_table_and_picture() -> Result<()> {
    let mut case = case("turn_demos1")?;
    let without = without_library(&html(&case, 0)?)?;
    assert!(!without.contains("floor"));
    case.comparison.floor = Some(PerChannel::new([0.1, 0.2, 0.3, 0.4, 0.5, 0.654_321].map(Some)));
    let own = without_library(&html(&case, 0)?)?;
    let table = own.find("RMSE, root mean square error").unwrap_or_default();
    let table = &own[table..table + own[table..].find("</table>").unwrap_or_default()];
    assert_eq!((table.matches("floor").count(), table.matches("0.654").count()), (1, 1), "{table}");
    assert!(own.contains("no model can remove it") && own.contains("RMSE above the floor"));
    assert_eq!(own.matches("data-figure=").count(), without.matches("data-figure=").count() + 1);
    let text = case.comparison.to_string();
    assert!(text.lines().any(|line| line.trim_start().starts_with("floor") && line.contains("0.654")), "{text}");
    Ok(())
}
