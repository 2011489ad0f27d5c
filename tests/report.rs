//! The page of `compare`, as a whole: it holds what it should, loads nothing, and escapes what people name things.
//!
//! The page is left in `target/tmp/compare.html`, to be looked at.
#![cfg(feature = "report")]

use phyture::critique::{ChannelValues, Comparison, Row, compare};
use phyture::flight::split;
use phyture::flight::{Channel, Column, Flight, PerChannel, Targets, Window};
use phyture::report::figures::LineData;
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
            PerChannel::from_fn(|channel| {
                let lacks = match channel {
                    Channel::VxDot => 0.04 * vx * vx.abs(),
                    Channel::VzDot => 1.5 / (1.0 + above * above),
                    _ => 0.0,
                };
                flight.column(channel.column())[window.last] + missing * lacks + spread * next()
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

impl Case {
    fn page(&self, focus: usize) -> Result<Page> {
        let provenance = [("data (sha256)", "4d1c…"), ("seed", "7"), ("model", "n9.toml")];
        let provenance = provenance.map(|(what, value)| (what.to_owned(), value.to_owned()));
        compare_page(&CompareReport {
            comparison: &self.comparison,
            flights: &self.flights,
            windows: &self.windows,
            rows: &self.rows,
            focus,
            yardstick: Some(2),
            traced: &[],
            provenance: &provenance,
        })
    }
}

fn html(case: &Case, focus: usize) -> Result<String> {
    Ok(page(&case.page(focus)?))
}

/// A page may weigh so much.
const MOST_BYTES: usize = 1_500_000;

#[test]
fn the_page_is_complete_light_and_loads_nothing() -> Result<()> {
    let case = case("turn_demos1")?;
    let html = html(&case, 0)?;
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("compare.html");
    std::fs::write(&path, &html).map_err(Error::io(&path))?;
    assert!(html.len() < MOST_BYTES, "{} bytes", html.len());
    for loads in ["http:", "https:", "src=", "<link", "@import", "url(", "//cdn", "xlink"] {
        assert!(!html.contains(loads), "the page has {loads}");
    }
    assert!(html.contains("default-src 'none'"), "the page forbids itself to load");
    // The strip, worst and typical stretch, and the residual of the two channels that lack an effect; that of the others is noise.
    assert_eq!(html.matches("<figure ").count(), 5);
    for text in [
        "Worst ten seconds",
        "Typical ten seconds",
        "turn_demos1",
        "data (sha256)",
        "beats the yardstick",
        "not independent",
        "MaxAE",
    ] {
        assert!(html.contains(text), "the page lacks {text}");
    }
    // Beneath the verdict, before anything else.
    let [lead, strip, first] = ["class=\"lead\"", "Error of every model", "<section"].map(|what| html.find(what));
    assert!(lead < strip && strip < first && lead.is_some());
    Ok(())
}

#[test]
fn every_picture_has_a_name_a_description_and_a_place_for_the_keyboard() -> Result<()> {
    let html = html(&case("</script><script>alert('x')</script>")?, 1)?;
    assert!(!html.contains("<script>alert"), "a manoeuvre's name becomes markup");
    let pictures: Vec<&str> = html.split("<svg class=\"panel\"").skip(1).collect();
    assert!(pictures.len() > 20, "{}", pictures.len());
    for picture in pictures {
        let head = &picture[..picture.find('>').unwrap_or_default()];
        assert!(head.contains("role=\"img\"") && head.contains("tabindex=\"0\"") && head.contains("aria-labelledby="), "{head}");
        for tag in ["<title id=", "<desc id="] {
            let text = picture.split(tag).nth(1).and_then(|rest| rest.split_once('>')).map_or("", |(_, text)| text);
            assert!(text.find('<').is_some_and(|end| end > 3), "a picture without {tag}");
        }
    }
    let figures: Vec<&str> = html.split("<figure ").skip(1).collect();
    assert!(figures.iter().all(|figure| figure.contains("aria-labelledby=\"figure-") && figure.contains("<figcaption><b id=")));
    Ok(())
}

/// Numbers of a path in the order in which they stand.
fn numbers(d: &str) -> Vec<f64> {
    let mut out = Vec::new();
    let mut text = String::new();
    for character in d.chars().chain(['M']) {
        if character.is_ascii_digit() || character == '.' || (character == '-' && text.is_empty()) {
            text.push(character);
            continue;
        }
        out.extend(text.parse::<f64>().ok());
        text.clear();
        if character == '-' {
            text.push('-');
        }
    }
    out
}

#[test]
fn the_numbers_beside_a_figure_are_those_that_are_drawn() -> Result<()> {
    let case = case("turn_demos1")?;
    let page = case.page(0)?;
    let figures = page.figures();
    let names: Vec<&str> = figures.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names[..3], ["01_error-of-every-model", "02_worst-ten-seconds", "03_typical-ten-seconds"]);
    let (_, worst) = figures[1];
    let (svg, csv) = (worst.svg(), worst.csv());
    assert!(svg.starts_with("<svg xmlns=") && !svg.contains("var(--"), "a file stands by itself");
    // The measured line of the first panel, back from pixels to m/s².
    let panel = svg.split("<desc>").nth(2).unwrap_or_default();
    let area = panel.split("<svg class=\"d\"").nth(1).unwrap_or_default();
    let attribute = |name: &str| {
        let text = area.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next()).unwrap_or_default();
        text.split(' ').filter_map(|number| number.parse::<f64>().ok()).collect::<Vec<_>>()
    };
    let (y, height) = (attribute("data-y"), 10.0 * attribute("height")[0]);
    let path = area.split("data-name=\"measured\" d=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap_or_default();
    let steps = numbers(path);
    let mut at = 0.0;
    let drawn: Vec<f64> = steps
        .chunks_exact(2)
        .map(|step| {
            at += step[1];
            y[0] + (1.0 - at / height) * (y[1] - y[0])
        })
        .collect();
    let written: Vec<f64> = csv
        .lines()
        .filter(|line| line.contains("vx_dot\",measured,"))
        .filter_map(|line| line.split(',').nth(4)?.parse().ok())
        .collect();
    assert!(written.len() > 900 && drawn.len() == written.len(), "{} and {}", drawn.len(), written.len());
    let tenth = (y[1] - y[0]) / height;
    assert!(
        drawn.iter().zip(&written).all(|(drawn, written)| (drawn - written).abs() <= 0.51 * tenth),
        "a line is not what its numbers say"
    );
    Ok(())
}

#[test]
fn what_was_predicted_at_every_other_sample_is_drawn_as_points() -> Result<()> {
    let case = case("turn_demos1")?;
    let html = html(&case, 0)?;
    assert!(html.contains("class=\"l dot s1 wide\"") && html.contains("only these samples were predicted"));
    Ok(())
}

#[test]
fn a_page_of_every_other_figure_stands_too() -> Result<()> {
    let rows: Vec<String> = Column::TARGETS.iter().map(|column| column.name().to_owned()).collect();
    let parts =
        [("physics", 0.61), ("network", 0.29), ("noise and unknown", 0.10)].map(|(name, share)| (name.to_owned(), vec![share; 6]));
    let decay = |from: f64, to: f64| (0..80).map(|epoch| to + (from - to) * (-0.08 * f64::from(epoch)).exp()).collect::<Vec<_>>();
    let epochs: Vec<f64> = (1..=80).map(f64::from).collect();
    let curve = |name: &str, from: f64, to: f64| LineData { name: name.into(), x: epochs.clone(), y: vec![decay(from, to)] };
    let panels = [("loss".to_owned(), "1".to_owned())];
    let figures = [
        phyture::report::figures::shares(
            "What explains the error",
            "Shares of the variance of the baseline's residual.",
            &rows,
            &parts,
        ),
        phyture::report::figures::log_lines(
            "Training",
            "Mean squared error of the scaled residual.",
            "epoch",
            &panels,
            &[curve("training", 1.0, 0.02), curve("validation", 1.1, 0.05)],
        ),
    ];
    let sections = vec![Section { title: "Figures".into(), parts: figures.into_iter().map(Part::Figure).collect() }];
    let html = page(&Page { title: "Figures".into(), summary: vec![], first: vec![], sections });
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("figures.html");
    std::fs::write(&path, &html).map_err(Error::io(&path))?;
    assert_eq!(html.matches("<figure ").count(), 2);
    assert!(html.contains("noise and unknown") && html.contains("validation"));
    Ok(())
}

#[test]
fn the_verdict_finds_what_was_put_there() -> Result<()> {
    let case = case("turn_demos1")?;
    let own = html(&case, 0)?;
    let model = &case.comparison.models[0];
    assert!(own.contains("paper predicts best") && own.contains("beats the yardstick"));
    // Quadratic drag is missing: the residual of vx_dot goes with vx, in the sweeps above all.
    let share = |name: &str| model.by_manoeuvre.get(name).and_then(|part| part.rmse.vx_dot).unwrap_or(f64::NAN);
    assert!(share("forward_sweep") > 2.0 * share("hover"), "{:?}", model.by_manoeuvre);
    assert!(own.contains("The largest error of any channel lies in manoeuvre forward_sweep"));
    assert!(own.contains("Of the models here, paper + ground effect has the smallest mean RMSE"));
    assert!(own.contains("Residual of forward acceleration, vx_dot"));
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
    let without = html(&case, 0)?;
    assert!(!without.contains(">floor"));
    case.comparison.floor = Some(ChannelValues::new([0.1, 0.2, 0.3, 0.4, 0.5, 0.654_321].map(Some).into()));
    let own = html(&case, 0)?;
    let table = own.find("RMSE, root mean square error").unwrap_or_default();
    let table = &own[table..table + own[table..].find("</table>").unwrap_or_default()];
    assert_eq!((table.matches("floor").count(), table.matches("0.654").count()), (1, 1), "{table}");
    assert!(own.contains("no model can remove it") && own.contains(">floor 0.654<"), "the floor stands in the strip, too");
    let text = case.comparison.to_string();
    assert!(text.lines().any(|line| line.trim_start().starts_with("floor") && line.contains("0.654")), "{text}");
    Ok(())
}
