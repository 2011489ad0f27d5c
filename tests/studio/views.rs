//! Single views in a real browser, each opened, used and looked at: what is drawn, and that the console is free of faults. The way through all of
//! them is in `browser`.

use crate::support::{HIDDEN, Running, folder, studio};
use crate::webdriver::Browser;
use phyture::studio::Edit;
use phyture::{Error, Result};

/// A browser on a studio of simulated flights; none where there is no Chromium.
fn opened(view: &str) -> Result<Option<(Browser, Running)>> {
    let Some(browser) = Browser::start(1280, 720)? else {
        println!("skipped: no chromedriver with a Chromium (Debian: chromium, chromium-driver)");
        return Ok(None);
    };
    let running = Running::new(studio(None)?)?;
    browser.open(&format!("{}&view={view}&channel=5", running.url))?;
    Ok(Some((browser, running)))
}

/// An expression of the page as text.
fn text(browser: &Browser, expression: &str) -> Result<String> {
    browser.value(expression)?.as_str().map(str::to_owned).ok_or_else(|| Error::Undetermined(format!("{expression} is no text")))
}

#[test]
fn where_it_fails_tells_regions_and_what_the_residual_is_in_time() -> Result<()> {
    let Some((browser, _running)) = opened("where")? else { return Ok(()) };
    browser.wait("document.querySelectorAll('#in-time .chart').length === 3")?;
    browser.wait("document.querySelectorAll('#regions tbody tr').length > 2")?;
    let loudest = text(&browser, "document.querySelector('#regions tbody tr:nth-child(2)').dataset.rule")?;
    assert!(loudest.contains("vy"), "{loudest}");
    let lasts = "document.querySelector('#in-time [data-lasts]').dataset.lasts";
    let yaw = text(&browser, lasts)?;
    assert!(yaw.parse::<f64>().is_ok_and(|lasts_s| lasts_s > 0.3), "{yaw}");
    // The numbers of a picture stand below it.
    browser.click("#in-time article:first-child summary")?;
    browser.wait("document.querySelector('#in-time article:first-child tbody td').getBoundingClientRect().height > 0")?;
    assert_eq!(text(&browser, "document.querySelector('#in-time article:first-child tbody td').textContent")?, "1.00");
    // Another channel, another residual. The errors stand on top of the page.
    browser.run("window.scrollTo(0, 0)")?;
    browser.click("#score [data-channel=vz_dot]")?;
    browser.wait("document.querySelector('#regions h2').textContent.includes('vz_dot')")?;
    assert_ne!(text(&browser, lasts)?, yaw);
    // From a region to the ten seconds that hold most of it.
    browser.click("#regions tbody tr:nth-child(2) .visit")?;
    browser
        .wait("location.hash.includes('view=compare') && Number(document.querySelector('#compare-plots')?.dataset.points) > 100")?;
    let width = browser
        .value("(() => { const at = new URLSearchParams(location.hash.slice(1)); return at.get('to') - at.get('from'); })()")?;
    assert!(width.as_f64().is_some_and(|width| (9.0..10.1).contains(&width)), "{width}");
    assert_eq!(browser.faults()?, Vec::<String>::new(), "the console is free of faults");
    Ok(())
}

#[test]
fn a_click_rolls_out_from_there_and_a_key_moves_on() -> Result<()> {
    let Some((browser, running)) = opened("rollout")? else { return Ok(()) };
    browser.wait("document.querySelectorAll('#rollout-one .chart').length === 16")?;
    browser.wait("Number(document.querySelector('#rollout-all')?.dataset.starts) > 100")?;
    let at = "document.querySelector('#rollout-one')?.dataset.at";
    let error = "document.querySelector('#rollout-one [data-quantity=velocity]').dataset.error";
    let (first, first_error) = (text(&browser, at)?, text(&browser, error)?);
    // In the middle of the picture.
    browser.click("#rollout-strip .u-over")?;
    browser.wait(&format!("{at} !== '{first}'"))?;
    let half: f64 = text(&browser, at)?.parse().unwrap_or(f64::NAN);
    let whole =
        browser.value("Number(document.querySelector('#flight').selectedOptions[0].textContent.match(/([0-9.]+) s/)[1])")?;
    let whole = whole.as_f64().unwrap_or(f64::NAN);
    assert!((half - 0.5 * whole).abs() < 0.05 * whole, "{half} of {whole}");
    assert_ne!(text(&browser, error)?, first_error);
    assert!(text(&browser, "location.hash")?.contains(&format!("at={half}")), "the address holds it");
    browser.keys("#main", "\u{e014}")?;
    browser.wait(&format!("Number({at}) > {half}"))?;
    browser.write("#rollout-at", "3\u{e007}")?;
    browser.wait(&format!("Math.abs(Number({at}) - 3) < 0.01"))?;
    browser.run("const ahead = document.querySelector('#ahead'); ahead.value = '2'; ahead.dispatchEvent(new Event('change'))")?;
    browser.wait("Math.abs(Number(document.querySelector('#rollout-one')?.dataset.end) - 2) < 0.01")?;
    browser.wait("document.querySelector('#rollout-all[data-starts] .quantity')")?;
    // From what is looked at in Compare.
    browser.open(&format!("{}&view=compare&flight=2&from=7&to=12", running.url))?;
    browser.click("#from-here")?;
    browser.wait(&format!("location.hash.includes('view=rollout') && Math.abs(Number({at}) - 7) < 0.01"))?;
    assert_eq!(browser.faults()?, Vec::<String>::new(), "the console is free of faults");
    Ok(())
}

#[test]
fn runs_stand_beside_each_other_and_a_file_that_does_not_read_says_why() -> Result<()> {
    let Some(browser) = Browser::start(1280, 720)? else {
        println!("skipped: no chromedriver with a Chromium (Debian: chromium, chromium-driver)");
        return Ok(());
    };
    let place = folder()?;
    let studio = studio(Some(&place.path().join("model.toml")))?;
    studio.save(&place.path().join("first.toml").display().to_string(), false)?;
    studio.edit(&Edit::Add { effect: HIDDEN.into() })?;
    studio.save(&place.path().join("second.toml").display().to_string(), false)?;
    let broken = place.path().join("broken.toml");
    std::fs::write(&broken, "[model]\nname = 3\n").map_err(Error::io(&broken))?;
    let running = Running::new(studio)?;
    browser.open(&format!("{}&view=runs&channel=5", running.url))?;
    browser.wait("document.querySelector('#runs')?.dataset.waits === '0'")?;
    let yaw = |run: &str| format!("Number(document.querySelector('[data-run=\"{run}\"] [data-channel=wz_dot]').dataset.rmse)");
    let (first, second, now) = (yaw("first.toml"), yaw("second.toml"), yaw(""));
    browser.wait(&format!("{first} > 1.2 * {second} && {second} === {now}"))?;
    browser.wait("document.querySelector('[data-run=\"second.toml\"] .tag').textContent === 'open'")?;
    let says = text(&browser, "document.querySelector('[data-run=\"broken.toml\"]').textContent")?;
    assert!(says.contains("expected") || says.contains("missing"), "{says}");
    // In the order of the errors the least comes first, behind the present state.
    browser.click("#runs [data-key=error]")?;
    browser.wait("document.querySelector('#runs tbody tr:nth-child(2)').dataset.run === 'second.toml'")?;
    browser.wait("location.hash.includes('sort=error') && document.querySelector('#runs').dataset.waits === '0'")?;
    assert_eq!(browser.faults()?, Vec::<String>::new(), "the console is free of faults");
    Ok(())
}

/// Trains a small network in the view that is open.
pub fn train(browser: &Browser) -> Result<()> {
    browser.wait("document.querySelector('#train-form')")?;
    browser.run("const history = document.querySelector('#train-history'); history.value = '64'; history.dispatchEvent(new Event('change'))")?;
    browser.run(
        "const width = document.querySelector('#train-width'); width.value = '16'; width.dispatchEvent(new Event('change'))",
    )?;
    browser.write("#train-epochs", "3")?;
    browser.click("#train")
}

/// From here on the page asks a second late how the training stands.
const LATE: &str = "const now = window.fetch; window.fetch = async (...what) => { \
    if (/\\/training$/.test(new URL(what[0], location.href).pathname)) await new Promise((go) => setTimeout(go, 1000)); return now(...what); };";

#[test]
fn a_network_is_trained_while_its_losses_are_watched_and_rolled_out() -> Result<()> {
    let Some(browser) = Browser::start(1280, 720)? else {
        println!("skipped: no chromedriver with a Chromium (Debian: chromium, chromium-driver)");
        return Ok(());
    };
    let place = folder()?;
    let running = Running::new(studio(Some(&place.path().join("model.toml")))?)?;
    browser.open(&format!("{}&view=train&channel=5", running.url))?;
    browser.write("#train-epochs", "0")?;
    browser.click("#train")?;
    browser.wait("document.querySelector('#train-told').textContent.includes('whole number')")?;
    train(&browser)?;
    browser.wait("document.querySelector('#training').dataset.progress === 'running'")?;
    browser.wait(
        "/epoch 1 of 3, step [1-9][0-9]* of [0-9]+, loss .* left/.test(document.querySelector('#training .progress').textContent)",
    )?;
    browser.wait("document.querySelector('[data-view=train] .spin')")?;
    // However late it is told that the training has stopped, what may be gone on with is shown.
    browser.run(LATE)?;
    browser.click("#train-stop")?;
    browser.wait("document.querySelector('#training').dataset.progress === 'stopped'")?;
    browser.click("[data-go-on=run]")?;
    browser.wait("document.querySelector('#training').dataset.progress === 'done'")?;
    browser.wait("document.querySelectorAll('#training .chart path').length === 2")?;
    browser.wait("document.querySelectorAll('#explained[data-network=run] tbody tr').length === 6")?;
    browser.reload()?;
    browser.wait("document.querySelector('#training')?.dataset.epochs === '3'")?;
    browser.click("#roll-network")?;
    browser
        .wait("location.hash.includes('network=run') && document.querySelectorAll('#rollout-one .legend > span').length === 5")?;
    browser.wait("document.querySelectorAll('#rollout-all tbody tr').length === 4")?;
    assert!(place.path().join("run").join("network.safetensors").is_file());
    assert_eq!(browser.faults()?, Vec::<String>::new(), "the console is free of faults");
    Ok(())
}
