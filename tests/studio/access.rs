//! What everybody can read: axe-core finds no serious fault in any view, dialog or page that is saved, in light and dark, wide and narrow, and a print of
//! a view loses no word.
//!
//! axe-core comes through npm when the test runs, and `pdftotext` is of poppler-utils; where one is not found, the test says so and leaves that out.

use crate::support::{Running, folder, studio};
use crate::views::train;
use crate::webdriver::Browser;
use phyture::{Error, Result};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

const AXE: &str = "axe-core@4.14.1";

/// Serious and critical faults, one text each.
const FAULTS: &str = "const done = arguments[0]; \
    axe.run(document, { resultTypes: ['violations'] }).then(found => done(found.passes.length === 0 ? ['nothing was judged'] : found.violations \
    .filter(fault => ['serious', 'critical'].includes(fault.impact)) \
    .map(fault => fault.id + ': ' + fault.nodes.map(node => node.target.join(' ') + ' ' + node.failureSummary).join('; '))), \
    error => done([String(error)]))";

/// The script of axe-core, fetched once; `None` where npm or the network is absent.
fn axe() -> Option<String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("axe-core-4.14.1");
    let script = folder.join("package").join("axe.min.js");
    if !script.is_file() {
        std::fs::create_dir_all(&folder).ok()?;
        let ran = |program: &str, arguments: &[&str]| {
            Command::new(program).args(arguments).current_dir(&folder).output().is_ok_and(|out| out.status.success())
        };
        if !(ran("npm", &["pack", AXE]) && ran("tar", &["xzf", "axe-core-4.14.1.tgz"])) {
            return None;
        }
    }
    std::fs::read_to_string(script).ok()
}

/// What axe-core finds on the page as it is, in each theme and at each width.
fn faults(browser: &Browser, axe: &str, name: &str) -> Result<Vec<String>> {
    let mut all = Vec::new();
    for width in [1280, 420] {
        let size = json!({ "width": width, "height": 900, "deviceScaleFactor": 1, "mobile": false });
        browser.cdp("Emulation.setDeviceMetricsOverride", &size)?;
        for theme in ["light", "dark"] {
            let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": theme }] });
            browser.cdp("Emulation.setEmulatedMedia", &media)?;
            browser.wait(&format!("innerWidth === {width} && matchMedia('(prefers-color-scheme: {theme})').matches"))?;
            browser.wait("!document.body.classList.contains('busy')")?;
            let wide = browser.value("document.documentElement.scrollWidth")?;
            if wide.as_i64().is_none_or(|wide| wide > width) {
                all.push(format!("{name}: {wide} px wide on {width} px"));
            }
            browser.run(axe)?;
            let found = browser.answer(FAULTS)?;
            let found = found.as_array().ok_or_else(|| Error::Undetermined(format!("{name}: {found}")))?;
            all.extend(found.iter().map(|fault| format!("{name}, {width} px, {theme}: {fault}")));
        }
    }
    browser.cdp("Emulation.clearDeviceMetricsOverride", &json!({}))?;
    Ok(all)
}

/// The words of a view's print that lie outside their sheet.
fn print_faults(browser: &Browser, folder: &Path, name: &str) -> Result<Vec<String>> {
    let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": "light" }] });
    browser.cdp("Emulation.setEmulatedMedia", &media)?;
    let print = browser.cdp("Page.printToPDF", &json!({ "preferCSSPageSize": true, "printBackground": true }))?;
    let (coded, pdf) = (folder.join(format!("{name}.txt")), folder.join(format!("{name}.pdf")));
    std::fs::write(&coded, print["data"].as_str().unwrap_or_default()).map_err(Error::io(&coded))?;
    let decoded = Command::new("base64").arg("-d").arg(&coded).output().map_err(Error::io("base64"))?;
    std::fs::write(&pdf, decoded.stdout).map_err(Error::io(&pdf))?;
    let Ok(out) = Command::new("pdftotext").arg("-bbox").arg(&pdf).arg("-").output() else {
        println!("skipped the print: no pdftotext (Debian: poppler-utils)");
        return Ok(Vec::new());
    };
    let boxes = String::from_utf8_lossy(&out.stdout).into_owned();
    let number = |line: &str, key: &str| line.split(&format!("{key}=\"")).nth(1)?.split('"').next()?.parse::<f64>().ok();
    let (mut sheet, mut words, mut bad) = ((0.0, 0.0), 0, Vec::new());
    for line in boxes.lines() {
        if line.contains("<page ") {
            sheet = (number(line, "width").unwrap_or(0.0), number(line, "height").unwrap_or(0.0));
        }
        let Some((right, foot)) = number(line, "xMax").zip(number(line, "yMax")) else { continue };
        let (left, head) = (number(line, "xMin").unwrap_or(-1.0), number(line, "yMin").unwrap_or(-1.0));
        words += 1;
        if left < 0.0 || head < 0.0 || right > sheet.0 || foot > sheet.1 {
            bad.push(format!("{name}, printed: {} lies outside its sheet of {sheet:?}", line.trim()));
        }
    }
    // Words of the main part as they are seen; pictures and the frame only add to the print.
    if words == 0 {
        bad.push(format!("{name}, printed: no words"));
    }
    Ok(bad)
}

/// Whether the pictures of Compare hold the ink of the light theme, which is nearly black.
const INKED: &str = "[...document.querySelectorAll('#compare-plots canvas')].some(canvas => { \
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height); \
    for (let at = 0; at < data.length; at += 4) if (data[at + 3] > 250 && Math.max(data[at], data[at + 1], data[at + 2]) < 38) return true; \
    return false; })";

/// Compare in the dark theme, printed: light on paper, pictures too, and dark again afterwards.
fn print_is_light(browser: &Browser) -> Result<()> {
    browser.cdp("Emulation.setEmulatedMedia", &json!({ "features": [{ "name": "prefers-color-scheme", "value": "dark" }] }))?;
    browser.wait(&format!("!document.body.classList.contains('busy') && !({INKED})"))?;
    let note = format!("window.paper = [document.documentElement.dataset.theme, {INKED}]");
    browser.run(&format!("window.addEventListener('beforeprint', () => {{ {note} }}, {{ once: true }})"))?;
    browser.cdp("Page.printToPDF", &json!({ "preferCSSPageSize": true, "printBackground": true }))?;
    assert_eq!(browser.value("window.paper")?, json!(["light", true]));
    browser.wait(&format!("!document.documentElement.dataset.theme && !({INKED})"))
}

#[test]
fn every_view_can_be_read_by_everybody_and_printed() -> Result<()> {
    let Some(browser) = Browser::start(1280, 900)? else {
        println!("skipped: no chromedriver with a Chromium (Debian: chromium, chromium-driver)");
        return Ok(());
    };
    let axe = axe();
    if axe.is_none() {
        println!("skipped axe-core: npm could not fetch {AXE}");
    }
    let place = folder()?;
    let studio = studio(Some(&place.path().join("model.toml")))?;
    let running = Running::new(Arc::clone(&studio))?;
    let settled = "!document.body.classList.contains('busy')";
    let mut found = Vec::new();
    for (view, ready) in [
        ("compare", "Number(document.querySelector('#compare-plots')?.dataset.points) > 100"),
        (
            "where",
            "document.querySelectorAll('#map tbody tr').length === 5 && document.querySelectorAll('#in-time .chart').length === 3",
        ),
        ("rollout", "document.querySelector('#rollout-all[data-starts]')"),
        ("model", "document.querySelectorAll('#history li').length === 1"),
        ("runs", "document.querySelector('#runs')?.dataset.waits === '0'"),
        ("learn", "document.querySelector('#findings [data-curve][data-drawn]')"),
        ("train", "document.querySelector('#explained[data-network] tbody tr') && document.querySelector('#training .chart')"),
    ] {
        browser.open(&format!("{}&view={view}", running.url))?;
        if view == "learn" {
            browser.click("#diagnose")?;
        }
        if view == "train" {
            train(&browser)?;
        }
        browser.wait(ready)?;
        browser.wait(settled)?;
        if view == "compare" {
            print_is_light(&browser)?;
        }
        if let Some(axe) = &axe {
            found.extend(faults(&browser, axe, view)?);
        }
        found.extend(print_faults(&browser, place.path(), view)?);
    }
    if let Some(axe) = &axe {
        for (key, name) in [("s", "save"), ("?", "keys")] {
            browser.keys("#main", key)?;
            browser.wait("document.querySelector('dialog[open]')")?;
            found.extend(faults(&browser, axe, name)?);
            browser.click("dialog .plain")?;
        }
        let pages = ["comparison.html", "diagnosis.html"].map(|name| place.path().join(name).display().to_string());
        studio.save_page(&pages[0], false)?;
        studio.save_diagnosis(&pages[1], false)?;
        for page in pages {
            browser.open(&format!("file://{page}"))?;
            browser.wait("document.querySelector('svg')")?;
            found.extend(faults(&browser, axe, &page)?);
        }
    }
    assert_eq!(found, Vec::<String>::new(), "{}", Value::from(found.join("\n")));
    Ok(())
}
