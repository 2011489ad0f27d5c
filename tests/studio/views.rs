//! Single views in a real browser, each opened, used and looked at: what is drawn, and that the console is free of faults. The way through all of
//! them is in `browser`.

use crate::support::{Running, studio};
use crate::webdriver::Browser;
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
    assert_eq!(browser.faults()?, Vec::<String>::new(), "the console is free of faults");
    Ok(())
}
