//! A headless Chromium, driven by chromedriver in plain WebDriver requests.

use crate::http::request;
use phyture::{Error, Result};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// Longest wait for something on the page.
const PATIENCE: Duration = Duration::from_secs(120);

/// Names of the driver and the browser on various systems.
const DRIVERS: [&str; 2] = ["chromedriver", "chromium.chromedriver"];
const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

pub struct Browser {
    driver: Child,
    port: u16,
    session: String,
    /// Kept open: the driver may say more.
    _said: BufReader<ChildStdout>,
}

/// The first program of these that there is.
fn found(names: &[&str]) -> Option<String> {
    let path = std::env::var_os("PATH")?;
    let files = std::env::split_paths(&path).flat_map(|folder| names.iter().map(move |name| folder.join(name)).collect::<Vec<_>>());
    files.into_iter().find(|file| file.is_file()).map(|file| file.display().to_string())
}

impl Browser {
    /// A browser of this size; `None` where there is none on this machine.
    pub fn start(width: u32, height: u32) -> Result<Option<Self>> {
        let Some((driver, browser)) = found(&DRIVERS).zip(found(&BROWSERS)) else { return Ok(None) };
        let mut driver = Command::new(driver)
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(Error::io("chromedriver"))?;
        let mut said =
            driver.stdout.take().map(BufReader::new).ok_or_else(|| Error::Undetermined("chromedriver says nothing".into()))?;
        let number = |line: String| line.split("on port ").nth(1)?.trim_end_matches('.').parse::<u16>().ok();
        let port = said.by_ref().lines().map_while(std::io::Result::ok).filter_map(number).find(|port| *port > 0);
        let port = port.ok_or_else(|| Error::Undetermined("chromedriver names no port".into()))?;
        let arguments =
            ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"];
        let mut arguments: Vec<String> = arguments.map(str::to_owned).into();
        arguments.push(format!("--window-size={width},{height}"));
        let wanted = json!({ "capabilities": { "alwaysMatch": {
            "browserName": "chrome",
            "goog:chromeOptions": { "args": arguments, "binary": browser },
            "goog:loggingPrefs": { "browser": "ALL", "performance": "ALL" },
        } } });
        let mut started = Self { driver, port, session: String::new(), _said: said };
        let session = started.call("POST", "/session", &wanted)?;
        started.session = session["sessionId"].as_str().unwrap_or("").to_owned();
        Ok(Some(started))
    }

    fn call(&self, method: &str, path: &str, body: &Value) -> Result<Value> {
        let host = format!("127.0.0.1:{}", self.port);
        let text = if method == "POST" { body.to_string() } else { String::new() };
        let reply = request(self.port, method, path, &[("host", &host), ("content-type", "application/json")], text.as_bytes())?;
        let value = reply.json()["value"].clone();
        if reply.status == 200 {
            return Ok(value);
        }
        Err(Error::Undetermined(format!("{path}: {}", value["message"].as_str().unwrap_or("no message"))))
    }

    fn post(&self, path: &str, body: &Value) -> Result<Value> {
        self.call("POST", &format!("/session/{}{path}", self.session), body)
    }

    pub fn open(&self, url: &str) -> Result<()> {
        self.post("/url", &json!({ "url": url })).map(drop)
    }

    pub fn reload(&self) -> Result<()> {
        self.post("/refresh", &json!({})).map(drop)
    }

    /// What an expression of the page gives.
    pub fn value(&self, expression: &str) -> Result<Value> {
        self.post("/execute/sync", &json!({ "script": format!("return {expression}"), "args": [] }))
    }

    /// Runs a script on the page.
    pub fn run(&self, script: &str) -> Result<()> {
        self.post("/execute/sync", &json!({ "script": script, "args": [] })).map(drop)
    }

    /// What a script hands to its last argument, a function.
    pub fn answer(&self, script: &str) -> Result<Value> {
        self.post("/execute/async", &json!({ "script": script, "args": [] }))
    }

    /// A command of the browser's own protocol.
    pub fn cdp(&self, command: &str, parameters: &Value) -> Result<Value> {
        self.post("/goog/cdp/execute", &json!({ "cmd": command, "params": parameters }))
    }

    /// Waits until an expression of the page is true.
    pub fn wait(&self, expression: &str) -> Result<()> {
        let begun = Instant::now();
        while begun.elapsed() < PATIENCE {
            if self.value(&format!("Boolean({expression})"))? == Value::Bool(true) {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        let banner = self.value("document.querySelector('#banner')?.textContent")?;
        Err(Error::Undetermined(format!("waited in vain for {expression}; the banner says {banner}")))
    }

    fn element(&self, css: &str) -> Result<String> {
        self.wait(&format!("document.querySelector({})", Value::from(css)))?;
        let found = self.post("/element", &json!({ "using": "css selector", "value": css }))?;
        let id = found.as_object().and_then(|found| found.values().next()).and_then(Value::as_str);
        id.map(str::to_owned).ok_or_else(|| Error::Undetermined(format!("no {css}")))
    }

    /// Does something with an element. The page may draw itself anew between finding it and using it: then it is looked for again.
    fn on(&self, css: &str, act: impl Fn(&str) -> Result<()>) -> Result<()> {
        let begun = Instant::now();
        loop {
            match act(&self.element(css)?) {
                Err(error) if error.to_string().contains("stale element") && begun.elapsed() < PATIENCE => {}
                done => return done,
            }
        }
    }

    /// Clicks as a person does: the element has to be there, visible and not covered.
    pub fn click(&self, css: &str) -> Result<()> {
        self.on(css, |element| self.post(&format!("/element/{element}/click"), &json!({})).map(drop))
    }

    /// Types into an element, after what is there was deleted.
    pub fn write(&self, css: &str, text: &str) -> Result<()> {
        self.on(css, |element| {
            self.post(&format!("/element/{element}/clear"), &json!({}))?;
            self.post(&format!("/element/{element}/value"), &json!({ "text": text })).map(drop)
        })
    }

    /// Presses keys on an element.
    pub fn keys(&self, css: &str, keys: &str) -> Result<()> {
        self.on(css, |element| self.post(&format!("/element/{element}/value"), &json!({ "text": keys })).map(drop))
    }

    /// Drags over an element, from and to a share of its width.
    pub fn drag(&self, css: &str, from: f64, to: f64) -> Result<()> {
        let element = self.element(css)?;
        let width = self.value(&format!("document.querySelector({}).clientWidth", Value::from(css)))?.as_f64().unwrap_or(0.0);
        let origin = json!({ "element-6066-11e4-a52e-4f735466cecf": element });
        // Places are counted from the middle.
        let at = |share: f64| json!({ "type": "pointerMove", "duration": 100, "origin": origin, "x": ((share - 0.5) * width) as i64, "y": 0 });
        let actions =
            [at(from), json!({ "type": "pointerDown", "button": 0 }), at(to), json!({ "type": "pointerUp", "button": 0 })];
        let body = json!({ "actions": [{ "type": "pointer", "id": "mouse", "parameters": { "pointerType": "mouse" }, "actions": actions }] });
        self.post("/actions", &body).map(drop)
    }

    /// Opens a further tab and goes there; the tab that was left.
    pub fn new_tab(&self) -> Result<String> {
        let path = format!("/session/{}/window", self.session);
        let before = self.call("GET", &path, &Value::Null)?;
        let opened = self.post("/window/new", &json!({ "type": "tab" }))?;
        self.post("/window", &json!({ "handle": opened["handle"] }))?;
        Ok(before.as_str().unwrap_or_default().to_owned())
    }

    /// Closes this tab and goes to another.
    pub fn close_tab(&self, other: &str) -> Result<()> {
        self.call("DELETE", &format!("/session/{}/window", self.session), &Value::Null)?;
        self.to_tab(other)
    }

    /// Goes to a tab.
    pub fn to_tab(&self, tab: &str) -> Result<()> {
        self.post("/window", &json!({ "handle": tab })).map(drop)
    }

    /// Messages of the console that are worse than a remark.
    pub fn faults(&self) -> Result<Vec<String>> {
        let log = self.post("/se/log", &json!({ "type": "browser" }))?;
        let bad = log.as_array().into_iter().flatten().filter(|entry| entry["level"] == "SEVERE" || entry["level"] == "WARNING");
        Ok(bad.map(|entry| entry["message"].to_string()).collect())
    }

    /// Addresses that the page has asked for since the last look.
    pub fn asked(&self) -> Result<Vec<String>> {
        let log = self.post("/se/log", &json!({ "type": "performance" }))?;
        let of = |entry: &Value| {
            let message: Value = serde_json::from_str(entry["message"].as_str()?).ok()?;
            let sent = &message["message"];
            let is_request = sent["method"] == "Network.requestWillBeSent" || sent["method"] == "Network.webSocketCreated";
            is_request
                .then(|| sent["params"]["request"]["url"].as_str().or(sent["params"]["url"].as_str()).unwrap_or("?").to_owned())
        };
        Ok(log.as_array().into_iter().flatten().filter_map(of).collect())
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // The browser is the driver's child: it ends with its session. A test that failed has its own message.
        if !self.session.is_empty() {
            let _ = self.call("DELETE", &format!("/session/{}", self.session), &Value::Null);
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
