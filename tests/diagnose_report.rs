//! The page of `diagnose`, as a whole: the verdict and its strip first, the numbers of the JSON, nothing loaded; and the pages of diagnoses
//! that found nothing.
//!
//! The page is left in `target/tmp/diagnose.html`, to be looked at.
#![cfg(feature = "report")]

use phyture::critique::ChannelValues;
use phyture::critique::diagnose::{
    Bar, CandidateReport, Confirmation, DependsOn, Diagnosis, Kept, Locked, Method, Number, Status, Step, TriedFormula,
    UnknownChannel, Verdict, Worth,
};
use phyture::critique::shares::Share;
use phyture::flight::{Column, Flight, Span, Targets};
use phyture::physics::{Model, catalogue};
use phyture::report::diagnose::{ENDS, VIEWS};
use phyture::report::{DiagnoseReport, Page, diagnose_page, page};
use phyture::{Error, Result};

const EVIL: &str = "</script><script>alert('x')</script>";

/// A flight whose states swing and whose accelerations are those of the model.
fn flight(name: &str, seconds: usize, phase: f64, model: &Model, absent: &[Column]) -> Result<Flight> {
    let samples = seconds * 100;
    let mut columns: [Vec<f64>; Column::COUNT] = std::array::from_fn(|_| vec![0.0; samples]);
    for (place, _) in Column::STATE.iter().enumerate().filter(|(_, column)| !absent.contains(column)) {
        let (rate, size) = (0.17 + 0.13 * place as f64, if place < 3 { 4.0 } else { 0.3 });
        let wave = |sample: usize| size * (rate * sample as f64 / 100.0 + phase + place as f64).sin();
        columns[place] = (0..samples).map(wave).collect();
    }
    if !absent.contains(&Column::Z) {
        columns[Column::Z as usize] = (0..samples).map(|sample| -2.0 + 1.5 * (0.003 * sample as f64 + phase).sin()).collect();
    }
    let mut flight = Flight::new(name, "hover & <b>", 0.0, 0.01, columns.clone(), Targets::Recorded)?;
    let predicted = model.predict(&flight)?;
    for (target, values) in Column::TARGETS.into_iter().zip(predicted) {
        let noise = |(sample, value): (usize, f64)| value + 0.1 * (sample as f64 * 12.9898 + phase).sin();
        columns[target as usize] = values.into_iter().enumerate().map(noise).collect();
    }
    flight = Flight::new(name, "hover & <b>", 0.0, 0.01, columns, Targets::Recorded)?;
    flight.absent = absent.to_vec();
    Ok(flight)
}

fn diagnosis(verdict: Verdict) -> Diagnosis {
    Diagnosis {
        notes: vec!["a note <i>".into()],
        data_sha256: "4d1c".into(),
        ..Diagnosis::nothing(verdict, format!("Said in words {EVIL}."))
    }
}

fn candidate(effect: &str, status: Status, fall: f64) -> CandidateReport {
    CandidateReport {
        effect: effect.into(),
        status,
        held_out_mse_fall: [("vz_dot".to_owned(), fall)].into(),
        p_value: Some(0.0123),
        detection_limit_mse_fall: Some(0.0345),
        reason: "said why".into(),
        note: None,
    }
}

fn found() -> Diagnosis {
    let rmse = |value: f64| ChannelValues::new([Some(0.3), Some(0.3), Some(value), Some(0.3), Some(0.3), Some(0.3)].into());
    Diagnosis {
        accepted: vec!["ground_effect".into()],
        steps: vec![Step {
            effect: "ground_effect".into(),
            meaning: "near the ground".into(),
            channels: vec!["vz_dot".into()],
            held_out_mse_fall: [("vz_dot".to_owned(), 0.3172)].into(),
            p_value: 0.0001,
            selection_frequency: 0.97,
            stability: "stable".into(),
            indistinguishable: vec!["rotor_droop".into()],
            coefficients: vec![Number {
                name: "k".into(),
                value: 0.9173,
                ci95: Some([0.8614, 0.9725]),
                unit: "1".into(),
                expected: Some([0.6, 1.3]),
                sign: None,
                held: false,
                rms_over_flights: None,
                by_flight: Default::default(),
                influence: None,
            }],
            parameters: Vec::new(),
            would_tell_apart: "hover at 0.5, 1, 2 and 4 m".into(),
            fault_of_log: Some("u4 recorded late".into()),
            formula: "k * <height>".into(),
            rests_on_flight: None,
        }],
        candidates: vec![
            candidate("ground_effect", Status::Accepted, 0.3172),
            candidate("wind", Status::NotExcited, 0.0),
            candidate("my_own", Status::NotSignificant, 0.0012),
        ],
        locked: Some(Locked {
            part: "test".into(),
            kept: Kept::Flights,
            duration_s: 40.0,
            rmse_before: rmse(0.4567),
            rmse_after: rmse(0.3456),
            mse_fall: [("vz_dot".to_owned(), [0.427, 0.391, 0.463])].into(),
            waterfall: bars(&["ground_effect"], &[rmse(0.4567), rmse(0.3456)]),
            ..Locked::default()
        }),
        method: Some(Method {
            blocks: 60,
            block_s: 10.0,
            correlation_s: 0.5,
            searched_s: 200.0,
            seed: 77,
            effects_in_play: 33,
            largest_p_value: 0.0015,
            smallest_fall: 0.01,
        }),
        ..diagnosis(Verdict::EffectsMissing)
    }
}

/// The model without and with ground effect.
fn models() -> [Model; 2] {
    let before = Model::paper("n9", 4.6, [0.08, 0.25, 0.3], 0.8);
    let mut after = before.clone();
    if let Some(definition) = catalogue::definition("ground_effect") {
        let mut effect = definition.effect(after.mass_kg, after.rotor_radius_m);
        effect.coefficients.iter_mut().for_each(|coefficient| coefficient.value = 0.9173);
        after.effects.push(effect);
    }
    for effect in after.effects.iter_mut().filter(|effect| effect.name == "collective_thrust") {
        effect.coefficients.iter_mut().for_each(|coefficient| coefficient.value = -9.0);
    }
    [before, after]
}

fn html(diagnoses: &[Diagnosis], absent: &[Column], models: [&Model; 2], seconds: usize) -> Result<String> {
    html_of([diagnoses, &[]], absent, models, seconds)
}

/// The same with the rounds of a loop as one beside them.
fn html_of([diagnoses, together]: [&[Diagnosis]; 2], absent: &[Column], models: [&Model; 2], seconds: usize) -> Result<String> {
    let html = page(&page_of([diagnoses, together], absent, models, seconds)?);
    if diagnoses.len() == 1 && diagnoses[0].accepted.len() == 1 || !together.is_empty() {
        let name = if together.is_empty() { "diagnose.html" } else { "loop.html" };
        let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(&path, &html).map_err(Error::io(&path))?;
    }
    Ok(html)
}

fn page_of(
    [diagnoses, together]: [&[Diagnosis]; 2],
    absent: &[Column],
    [before, after]: [&Model; 2],
    seconds: usize,
) -> Result<Page> {
    let [_, truth] = models();
    let flights = ["a", "b", EVIL].iter().enumerate();
    let mut plain = truth.clone();
    if absent.contains(&Column::Z) {
        plain.effects.retain(|effect| effect.name != "ground_effect");
    }
    let flights: Vec<Flight> =
        flights.map(|(number, name)| flight(name, seconds, number as f64, &plain, absent)).collect::<Result<_>>()?;
    let span = |flight: usize| Span { flight, start: 0, end: flights[flight].len() };
    let provenance = [("command".to_owned(), "diagnose".to_owned())];
    let (searched, locked) = ([span(0), span(1)], [span(2)]);
    diagnose_page(&DiagnoseReport {
        title: "Missing physics",
        diagnoses,
        together: together.first(),
        flights: &flights,
        searched: &searched,
        locked: &locked,
        before,
        after,
        compared: None,
        provenance: &provenance,
    })
}

fn is_self_contained(own: &str) {
    for loads in ["http:", "https:", "src=", "<link", "@import", "url(", "<script>alert"] {
        assert!(!own.contains(loads), "the page has {loads}");
    }
}

#[test]
fn the_verdict_and_the_strip_come_first_and_the_numbers_are_those_of_the_json() -> Result<()> {
    let [before, after] = models();
    let own = html(&[found()], &[], [&before, &after], 100)?;
    is_self_contained(&own);
    let lead = "The model lacks ground_effect (near the ground); adding it removes 43 % [39, 46] of the squared error of vertical acceleration \
                (vz_dot), on 40 s of flights that no search has seen.";
    let verdict = own.find(lead).ok_or_else(|| Error::Undetermined("no verdict".into()))?;
    let strip = own.find("The error from effect to effect").ok_or_else(|| Error::Undetermined("no strip".into()))?;
    let mut last = own.find("<section").unwrap_or_default();
    assert!(verdict < strip && strip < last);
    for view in ["What was missing"].into_iter().chain(VIEWS).chain(ENDS) {
        let at = own.find(&format!("<h2>{view}</h2>")).ok_or_else(|| Error::Undetermined(format!("no section {view}")))?;
        assert!(at > last, "{view} is out of order");
        last = at;
    }
    for text in [
        "vz_dot 31.7 %",
        "k = 0.9173 [0.861, 0.973]",
        "97 % (stable)",
        "rotor_droop",
        "0.0123",
        "3.5 %",
        "0.457",
        "0.346",
        "42.7",
        "hover at 0.5, 1, 2 and 4 m",
        "k * &lt;height&gt;",
        "&quot;p_value&quot;: 0.0123",
        "Note: a note &lt;i&gt;",
        "4d1c",
        "model after",
        "&lt;/script&gt;",
        "usual: 0.6 to 1.3",
    ] {
        assert!(own.contains(text), "the page lacks {text}");
    }
    // How the prediction changed runs through the residual of its channel.
    assert!(own.contains("data-name=\"change of the whole prediction\""));
    // What was tried and not named is folded.
    let folded = own.find("Effects that were tried and not named").unwrap_or_default();
    let opened = own[..folded].rfind("<details>").unwrap_or_default();
    assert!(opened > 0 && !own[opened..folded].contains("</details>"), "it stands open");
    assert!(own.len() < 1_500_000, "{} bytes", own.len());
    Ok(())
}

/// The curve is the change of the whole prediction: it runs through the points where nothing is left, also where a number that was there moved.
#[test]
fn the_drawn_change_is_what_the_residual_lost() -> Result<()> {
    let [before, after] = models();
    let page = page_of([&[found()], &[]], &[], [&before, &after], 100)?;
    let figures = page.figures();
    let (_, figure) = figures
        .iter()
        .find(|(name, _)| name.contains("residual-of-vertical"))
        .ok_or_else(|| Error::Undetermined("no figure".into()))?;
    let panel = figure.panels.first().ok_or_else(|| Error::Undetermined("no panel".into()))?;
    let of = |series: &str| panel.data.iter().filter(|datum| datum.series == series).map(|datum| datum.y).collect::<Vec<_>>();
    let [points, change, rest] = ["before", "change of the prediction", "after"].map(of);
    assert!(!points.is_empty() && points.len() == change.len() && rest.len() == points.len());
    for ((before, change), after) in points.iter().zip(&change).zip(&rest) {
        assert!((before - change - after).abs() < 1e-9 * (1.0 + before.abs()), "{before} {change} {after}");
    }
    assert!(change.iter().any(|change| change.abs() > 0.5));
    Ok(())
}

#[test]
fn diagnoses_that_found_nothing_have_pages_too() -> Result<()> {
    let [before, _] = models();
    for verdict in [Verdict::Explained, Verdict::TooLittleData, Verdict::ConventionFault] {
        let own = html(&[diagnosis(verdict)], &[], [&before, &before], 20)?;
        is_self_contained(&own);
        let mut head = verdict.words().to_owned();
        head[..1].make_ascii_uppercase();
        assert!(own.contains(&format!("{head}. Said in words")) && !own.contains("model after"));
        assert_eq!(own.contains(VIEWS[0]), verdict != Verdict::ConventionFault);
    }
    let unknown = UnknownChannel {
        channel: "vx_dot".into(),
        r2: 0.51,
        null_r2_95: 0.01,
        depends_on: vec![DependsOn { variable: "height".into(), share: 0.89 }],
        shape: "bends once".into(),
        suggested_formula: Some("height ^ 2".into()),
        suggested_coefficient: Some(0.25),
        tried: Some(TriedFormula {
            formula: "height ^ 2".into(),
            coefficient: 0.25,
            held_out_mse_fall: 0.5,
            locked_mse_fall: Some([0.48, 0.41, 0.55]),
            locked_rmse: Some(0.2163),
        }),
    };
    let rounds =
        [found(), Diagnosis { unknown: Some(vec![unknown]), locked: found().locked, ..diagnosis(Verdict::NotInCatalogue) }];
    let own = html(&rounds, &[], [&before, &before], 20)?;
    for text in [
        "Not in the catalogue. Said in words",
        "formula = &quot;height ^ 2&quot;",
        "height (89 %)",
        "+ suggested formula",
        "0.216",
        "falls by 48 % [41, 55]",
    ] {
        assert!(own.contains(text), "the page lacks {text}");
    }
    Ok(())
}

/// Bars that add one effect after the other.
fn bars(effects: &[&str], errors: &[ChannelValues]) -> Vec<Bar> {
    let added = [Vec::new()].into_iter().chain(effects.iter().map(|effect| vec![(*effect).to_owned()]));
    added.zip(errors).map(|(added, &rmse)| Bar { added, rmse, ..Bar::default() }).collect()
}

/// Two rounds, and what is told of them as one: with a floor and with what each effect is worth.
#[test]
fn the_rounds_of_a_loop_are_one_list_with_the_floor_as_last_bar() -> Result<()> {
    let [before, after] = models();
    let rmse = |value: f64| ChannelValues::new([Some(0.3), Some(0.3), Some(value), Some(0.3), Some(0.3), Some(0.3)].into());
    let of = |effect: &str, errors: [f64; 2]| {
        let mut round = found();
        round.accepted = vec![effect.into()];
        round.steps[0].effect = effect.into();
        if let Some(locked) = &mut round.locked {
            locked.waterfall = bars(&[effect], &errors.map(rmse));
        }
        round
    };
    let rounds = [of("ground_effect", [0.8764, 0.6543]), of("wind", [0.6542, 0.4321])];
    let worth = |effect: &str, share: f64| Worth {
        effect: effect.into(),
        share: [("vz_dot".to_owned(), Share { share, ci95: Some([share - 0.04, share + 0.04]) })].into(),
        refitted: true,
        ..Worth::default()
    };
    let mut locked = Locked {
        kept: Kept::Flights,
        duration_s: 40.0,
        rmse_before: rmse(0.8764),
        rmse_after: rmse(0.4321),
        mse_fall: [("vz_dot".to_owned(), [0.757, 0.711, 0.803])].into(),
        waterfall: bars(&["ground_effect", "wind"], &[0.8764, 0.6543, 0.4321].map(rmse)),
        ..Locked::default()
    };
    locked.set_floor(ChannelValues::new([0.29, 0.29, 0.2357, 0.29, 0.29, 0.29].map(Some).into()));
    let together = Diagnosis {
        accepted: vec!["ground_effect".into(), "wind".into()],
        steps: rounds.iter().flat_map(|round| round.steps.clone()).collect(),
        worth: vec![worth("wind", 0.52), worth("ground_effect", 0.33)],
        locked: Some(locked),
        ..diagnosis(Verdict::EffectsMissing)
    };
    let own = html_of([&rounds, std::slice::from_ref(&together)], &[], [&before, &after], 60)?;
    is_self_contained(&own);
    let list = own.find("What was missing").unwrap_or_default();
    let place = |text: &str| own[list..].find(text).ok_or_else(|| Error::Undetermined(format!("no {text}")));
    assert!(list > 0 && place("vz_dot 52 % [48, 56]")? < place("vz_dot 33 % [29, 37]")?);
    assert_eq!(own[..list].matches("The model lacks").count(), 1, "one verdict for all rounds");
    // The strip goes on from round to round, down to the floor.
    for text in ["0.876", "0.654", "0.432", "floor 0.236"] {
        assert!(own[..list].contains(text), "the strip lacks {text}");
    }
    // (0.8764² − 0.4321²) / (0.8764² − 0.2357²)
    assert!(own[list..].contains("of the removable") && own[list..].contains("81.6"), "share above the floor");
    let plain = html(&rounds, &[], [&before, &after], 20)?;
    assert!(!plain.contains(">floor") && plain.contains("Round 2"));
    Ok(())
}

#[test]
fn what_unseen_flights_deny_is_no_missing_effect_and_what_fails_there_is_not_suggested() -> Result<()> {
    let [before, after] = models();
    let mut denied = Diagnosis { confirmation: Some(Confirmation::Contradicted), ..found() };
    if let Some(locked) = &mut denied.locked {
        locked.mse_fall = [("vz_dot".to_owned(), [-0.083, -0.199, -0.044])].into();
    }
    let failed =
        TriedFormula { formula: "sin(8 * roll)".into(), locked_mse_fall: Some([0.02, -0.05, 0.09]), ..TriedFormula::default() };
    denied.unknown = Some(vec![UnknownChannel {
        channel: "wx_dot".into(),
        r2: 0.4,
        null_r2_95: 0.01,
        depends_on: vec![DependsOn { variable: "roll".into(), share: 0.9 }],
        shape: "periodic".into(),
        suggested_formula: None,
        suggested_coefficient: None,
        tried: Some(failed),
    }]);
    let own = html(&[denied], &[], [&before, &after], 60)?;
    for text in ["Nothing to add", "vz_dot grows by 8.3 % [4.4, 20]", "does not hold on 40 s of flights", "tried and not named"] {
        assert!(own.contains(text), "the page lacks {text}");
    }
    for text in ["effects missing", "the interval holds zero", "To try, in the model file", "suggested_wx_dot"] {
        assert!(!own.contains(text), "the page has {text}");
    }
    Ok(())
}

#[test]
fn columns_that_were_not_recorded_do_not_matter() -> Result<()> {
    let [before, _] = models();
    let own = html(&[diagnosis(Verdict::Explained)], &[Column::X, Column::Y, Column::Z], [&before, &before], 20)?;
    assert!(VIEWS.iter().all(|view| own.contains(view)) && !own.contains("height, m"));
    Ok(())
}

#[test]
fn a_page_without_a_diagnosis_or_with_a_span_elsewhere_is_refused() {
    let [before, _] = models();
    let report = |diagnoses: &[Diagnosis], locked: &[Span]| {
        let report = DiagnoseReport {
            title: "t",
            diagnoses,
            together: None,
            flights: &[],
            searched: &[],
            locked,
            before: &before,
            after: &before,
            compared: None,
            provenance: &[],
        };
        diagnose_page(&report).map(|_| ())
    };
    assert!(matches!(report(&[], &[]), Err(Error::Shape { .. })));
    let span = [Span { flight: 3, start: 0, end: 9 }];
    assert!(matches!(report(&[diagnosis(Verdict::Explained)], &span), Err(Error::Shape { .. })));
}
