//! The app in a real browser, from the error to the effect and back, as a person goes: skipped where there is no Chromium.

use crate::support::{HIDDEN, Running, folder, studio};
use crate::webdriver::Browser;
use phyture::physics::Model;
use phyture::{Error, Result};

/// The error of the yaw acceleration as the page shows it.
const YAW: &str = "Number(document.querySelector('#waterfall [data-channel=wz_dot]').dataset.rmse)";

/// A key as WebDriver writes it.
const PAGE_UP: &str = "\u{e00e}";

fn number(browser: &Browser, expression: &str) -> Result<f64> {
    browser.value(expression)?.as_f64().ok_or_else(|| Error::Undetermined(format!("{expression} is no number")))
}

/// Waits until nothing is under way.
fn settled(browser: &Browser) -> Result<()> {
    browser.wait("!document.body.classList.contains('busy')")
}

/// From the map to the worst ten seconds of the yaw acceleration, and closer.
fn look(browser: &Browser, url: &str) -> Result<()> {
    // The yaw acceleration is the one that is predicted worst.
    browser.open(&format!("{url}&view=where"))?;
    browser.wait("location.hash.includes('channel=5')")?;
    browser.wait("document.querySelectorAll('#map tbody tr').length === 5")?;
    browser.click("#map tbody tr:nth-child(2) button[data-channel=wz_dot]")?;
    browser
        .wait("location.hash.includes('view=compare') && Number(document.querySelector('#compare-plots')?.dataset.points) > 100")?;
    settled(browser)?;
    let width = "(() => { const at = new URLSearchParams(location.hash.slice(1)); return Number(at.get('to')) - Number(at.get('from')); })()";
    let before = number(browser, width)?;
    assert!((5.0..=10.0).contains(&before), "{before} s");
    browser.drag("#compare-plots .u-over", 0.25, 0.75)?;
    browser.wait(&format!("{width} < {}", 0.6 * before))?;
    settled(browser)?;
    browser.click("#whole")?;
    browser.wait("!location.hash.includes('from=')")?;
    settled(browser)
}

/// Finds what is hidden, looks at its curve, saves the page, and adds it.
fn learn(browser: &Browser, page: &str) -> Result<()> {
    browser.click("[data-view=learn]")?;
    browser.click("#diagnose")?;
    browser.wait("document.querySelector('#findings')")?;
    browser.wait(&format!("document.querySelector('[data-curve={HIDDEN}][data-drawn] [data-variable=vy] .curve')"))?;
    browser.click("#save-diagnosis")?;
    browser.write("#save_diagnosis-path", page)?;
    browser.click("#save_diagnosis-do")?;
    browser.wait("document.querySelector('#save_diagnosis-told').textContent.startsWith('Written')")?;
    browser.click("dialog .plain")?;
    browser.click(&format!("[data-add={HIDDEN}]"))?;
    browser.wait(&format!("document.querySelector('[data-add={HIDDEN}]').disabled"))?;
    browser.click("[data-view=model]")?;
    browser.wait("document.querySelectorAll('#history li').length === 2")?;
    settled(browser)
}

/// Moves a number, and takes that back.
fn slide(browser: &Browser) -> Result<()> {
    let added = number(browser, YAW)?;
    browser.click(&format!(".effect[data-effect={HIDDEN}] summary"))?;
    browser.keys("[data-number='weathercock.k_fin']", PAGE_UP)?;
    browser.wait("document.querySelectorAll('#history li').length === 3")?;
    browser.wait(&format!("{YAW} > {added}"))?;
    browser.click("#undo")?;
    browser.wait(&format!("{YAW} === {added}"))?;
    settled(browser)
}

/// A formula that is wrong, then right.
fn formula(browser: &Browser) -> Result<()> {
    browser.write("#formula", "vx * vq")?;
    browser.wait("document.querySelector('#formula-told').dataset.state === 'wrong'")?;
    let told = browser.value("document.querySelector('#formula-told').textContent")?.to_string();
    assert!(told.contains("unknown name `vq`") && told.contains("character 6"), "{told}");
    assert_eq!(browser.value("document.querySelector('#formula-add').disabled")?, true);
    browser.write("#formula", "vx * abs(vx)")?;
    browser.wait("document.querySelector('#formula-told').dataset.state === 'right'")?;
    browser.click("#formula-add")?;
    browser.wait("document.querySelector('.effect[data-effect=my_effect]')")?;
    browser.wait("document.querySelectorAll('#history li').length === 3")?;
    settled(browser)
}

/// Saves, is told that the file is there, and overwrites it.
fn save(browser: &Browser, path: &str) -> Result<()> {
    browser.click("#save")?;
    browser.write("#save-path", path)?;
    browser.click("#save-do")?;
    browser.click("#save-overwrite")?;
    browser.wait("document.querySelector('#save-told').textContent.startsWith('Written')")?;
    browser.click("dialog .plain")?;
    browser.wait("document.querySelector('.tools .state small').textContent === 'saved'")
}

#[test]
fn the_way_from_the_error_to_the_effect_in_a_browser() -> Result<()> {
    let Some(browser) = Browser::start(1280, 720)? else {
        println!("skipped: no chromedriver with a Chromium (Debian: chromium, chromium-driver)");
        return Ok(());
    };
    let place = folder()?;
    let file = place.path().join("model.toml");
    let mut server = Running::new(studio(Some(&file))?)?;
    look(&browser, &server.url)?;
    browser.click("[data-view=model]")?;
    browser.wait("document.querySelector('#waterfall')")?;
    let first = number(&browser, YAW)?;
    let page = place.path().join("diagnosis.html");
    learn(&browser, &page.display().to_string())?;
    assert!(page.is_file());
    let added = number(&browser, YAW)?;
    assert!(added < 0.8 * first, "the waterfall falls: {first} to {added}");
    slide(&browser)?;
    formula(&browser)?;
    save(&browser, &file.display().to_string())?;
    assert!(Model::read(&file)?.effect(HIDDEN).is_some_and(|effect| effect.enabled));
    let (address, shown) = (browser.value("location.href")?, number(&browser, YAW)?);
    browser.reload()?;
    browser.wait("document.querySelector('#waterfall')")?;
    assert_eq!((browser.value("location.href")?, number(&browser, YAW)?), (address, shown), "the same after a reload");
    // A browser notes every refusal: that the file was there is the one of this test.
    let mut faults = browser.faults()?;
    faults.retain(|fault| !(fault.contains("/api/save ") && fault.contains("status of 409")));
    assert_eq!(faults, Vec::<String>::new(), "the console is free of faults");
    let own = format!("http://127.0.0.1:{}/", server.port);
    let asked = browser.asked()?;
    let strange: Vec<&String> = asked.iter().filter(|url| !url.starts_with(&own) && !url.starts_with("data:")).collect();
    assert!(asked.len() > 20 && strange.is_empty(), "{} requests, {strange:?}", asked.len());
    // The program ends: the page says so.
    server.end()?;
    browser.click("#undo")?;
    browser.wait("document.querySelector('#banner').textContent.includes('has ended')")
}
