//! What goes wrong around the page, in a real browser: a second tab, a tab closed during a search, a program killed and started anew, a model file
//! that another program writes. Nothing is lost, and the page says what happened.

use crate::support::{HIDDEN, folder};
use crate::webdriver::Browser;
use phyture::physics::Model;
use phyture::{Error, Result};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The error of the yaw acceleration as the page shows it.
const YAW: &str = "Number(document.querySelector('#waterfall [data-channel=wz_dot]').dataset.rmse)";

/// The program as a process, which may be killed.
struct Program {
    child: Child,
    url: String,
}

impl Program {
    fn start(program: &str, folder: &Path) -> Result<Self> {
        let told = folder.join("studio.json");
        let _ = std::fs::remove_file(&told);
        let child = Command::new(program)
            .args(["studio", "flights", "--json", "studio.json"])
            .current_dir(folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(Error::io(program))?;
        let mut started = Self { child, url: String::new() };
        let begun = Instant::now();
        while started.url.is_empty() {
            assert!(begun.elapsed() < Duration::from_secs(120), "the studio did not start");
            std::thread::sleep(Duration::from_millis(50));
            let text = std::fs::read_to_string(&told).unwrap_or_default();
            let json: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
            started.url = json["url"].as_str().unwrap_or_default().to_owned();
        }
        Ok(started)
    }

    /// Without any chance to tidy up.
    fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A tab is closed while a search runs; another finds the search, or what it found.
fn closed_while_it_searches(browser: &Browser, url: &str) -> Result<()> {
    browser.open(&format!("{url}&view=learn"))?;
    let first = browser.new_tab()?;
    browser.open(&format!("{url}&view=learn"))?;
    browser.click("#diagnose")?;
    browser.wait("document.querySelector('#stop') || document.querySelector('#findings')")?;
    browser.close_tab(&first)?;
    // The tab that stayed is brought up to date, and so is one that is opened now.
    browser.reload()?;
    browser.wait("document.querySelector('#stop') || document.querySelector('#findings')")?;
    browser.wait("document.querySelector('#findings')")
}

/// An effect is added in one tab; the other shows it.
fn seen_in_two_tabs(browser: &Browser, url: &str) -> Result<f64> {
    let first = browser.new_tab()?;
    browser.open(&format!("{url}&view=model"))?;
    browser.wait("document.querySelectorAll('#history li').length === 1")?;
    browser.close_tab(&first)?;
    let second = {
        browser.click(&format!("[data-add={HIDDEN}]"))?;
        browser.wait(&format!("document.querySelector('[data-add={HIDDEN}]').disabled"))?;
        browser.new_tab()?
    };
    browser.open(&format!("{url}&view=model"))?;
    browser.wait("document.querySelectorAll('#history li').length === 2")?;
    let added = browser.value(YAW)?.as_f64().unwrap_or(f64::NAN);
    browser.click("#undo")?;
    browser.wait(&format!("{YAW} > {added}"))?;
    let here = browser.new_tab()?;
    browser.close_tab(&second)?;
    browser.wait("document.querySelector('#undo').disabled")?;
    browser.to_tab(&here)?;
    browser.click("#redo")?;
    browser.wait(&format!("{YAW} === {added}"))?;
    Ok(added)
}

#[test]
fn nothing_is_lost_and_the_page_says_what_happened() -> Result<()> {
    let (Some(program), Some(browser)) = (option_env!("CARGO_BIN_EXE_phyture"), Browser::start(1280, 720)?) else {
        println!("skipped: no program, or no chromedriver with a Chromium (Debian: chromium, chromium-driver)");
        return Ok(());
    };
    let place = folder()?;
    let simulate =
        ["simulate", "flights", "--minutes", "10", "--baseline", "--level", "0", "--hide", HIDDEN, "--seed", "7", "--quiet"];
    let status = Command::new(program).args(simulate).current_dir(place.path()).status().map_err(Error::io(program))?;
    assert!(status.success());
    let file = place.path().join("flights").join("model.toml");
    let mut running = Program::start(program, place.path())?;
    closed_while_it_searches(&browser, &running.url)?;
    let added = seen_in_two_tabs(&browser, &running.url)?;

    // Killed: the page says so unasked, and keeps what it shows.
    running.kill();
    browser.wait("document.querySelector('#banner [data-gone]')?.textContent.includes('has ended')")?;
    let told = browser.value("document.querySelector('#banner').textContent")?.to_string();
    assert!(told.contains("model.unsaved.json"), "{told}");
    assert_eq!(browser.value(YAW)?.as_f64(), Some(added), "what was shown is shown");
    browser.click("[data-view=compare]")?;
    assert_eq!(browser.value(YAW)?.as_f64(), Some(added));

    // Started anew: the steps are offered, and are the same.
    let next = Program::start(program, place.path())?;
    browser.open(&format!("{}&view=model", next.url))?;
    browser.wait("document.querySelectorAll('#history li').length === 1")?;
    browser.click("[data-take-up]")?;
    browser.wait("document.querySelectorAll('#history li').length === 2")?;
    browser.wait(&format!("{YAW} === {added}"))?;
    browser.wait("!document.querySelector('[data-take-up]')")?;

    // Another program writes the model file: the page says so unasked, and a save keeps that file.
    let other = std::fs::read_to_string(&file).map_err(Error::io(&file))? + "\n# by hand\n";
    std::fs::write(&file, &other).map_err(Error::io(&file))?;
    browser.wait("document.querySelector('#banner').textContent.includes('changed by another program')")?;
    browser.click("#save")?;
    browser.write("#save-path", &file.display().to_string())?;
    browser.click("#save-do")?;
    browser.click("#save-overwrite")?;
    browser.wait("document.querySelector('#save-told').textContent.startsWith('Written')")?;
    assert!(Model::read(&file)?.effect(HIDDEN).is_some());
    let beside = std::fs::read_dir(place.path().join("flights")).map_err(Error::io(place.path()))?;
    let texts: Vec<String> = beside.flatten().filter_map(|entry| std::fs::read_to_string(entry.path()).ok()).collect();
    assert!(texts.contains(&other), "the other program's file is kept");
    assert!(
        !place.path().join("flights/model.unsaved.json").exists() && !place.path().join("flights/model.unsaved-2.json").exists()
    );
    browser.click("dialog .plain")?;
    browser.wait("!document.querySelector('#banner').textContent.includes('changed by another program')")
}
