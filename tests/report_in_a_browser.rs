//! The pages in a browser: nothing is wider than a narrow screen, and nothing is cut when a page is printed to PDF.
//!
//! Needs Chromium, and for the print `pdftotext` (Debian: chromium, poppler-utils); where one is not found, the test says so and passes.
#![cfg(feature = "report")]

use phyture::report::figures::{Fall, FallPanel, Kind, LineData, falls, lines};
use phyture::report::{Map, MapCell, Page, Part, Section, Table, page};
use phyture::{Error, Result};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The browser, if there is one.
fn browser() -> Option<&'static str> {
    let runs = |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|out| out.status.success());
    let found = ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| runs(name));
    if found.is_none() {
        eprintln!("skipped: no Chromium was found");
    }
    found
}

/// A page with one of everything, each wider than a narrow screen.
fn wide_page() -> Page {
    let channels: Vec<(String, String)> =
        (0..6).map(|channel| (format!("channel number {channel}, cx_dot"), "m/s²".into())).collect();
    let heads: Vec<(String, String)> = (0..9).map(|column| (format!("column {column}"), "m/s²".into())).collect();
    let row = |row: usize| (0..9).map(|column| format!("{row}.{column} [0.123, 0.456]").into()).collect();
    let table = Table { caption: "table".into(), columns: heads.clone(), rows: (0..6).map(row).collect() };
    let cell = |column: usize| MapCell {
        text: format!("M{column}"),
        value: Some(column as f64),
        before: Some(("9.99".into(), Some(1.0))),
        ..MapCell::default()
    };
    let map = Map {
        caption: "map".into(),
        columns: heads,
        rows: (0..6).map(|row| (format!("manoeuvre {row}"), "n = 1000 in 10 blocks".into(), (0..8).map(cell).collect())).collect(),
        ..Map::default()
    };
    let bar = |name: &str, value: f64| Fall {
        name: name.into(),
        kind: Kind::Physics,
        value,
        ci95: Some([0.8 * value, 3.0 * value]),
        remark: String::new(),
    };
    let panel = |(title, unit): &(String, String)| FallPanel {
        title: title.clone(),
        unit: unit.clone(),
        bars: vec![bar("a bar with a name that is too long for it", 1.0), bar("b", 0.2)],
        floor: Some(0.1),
    };
    let time: Vec<f64> = (0..1000).map(|sample| 0.01 * f64::from(sample)).collect();
    let line = LineData { name: "measured".into(), x: time.clone(), y: vec![time.iter().map(|t| t.sin()).collect(); 6] };
    let parts = vec![
        Part::Figure(lines("Lines", "c", "time, s", &channels, &[line])),
        Part::Table(table),
        Part::Map(map),
        Part::Code("a_long_word_without_any_place_to_break ".repeat(8).replace(' ', "_")),
    ];
    Page {
        title: "Everything".into(),
        summary: vec!["The verdict in a sentence that is long enough to be broken into several lines on a narrow screen.".into()],
        first: vec![Part::Figure(falls("Falls", "c", &channels.iter().map(panel).collect::<Vec<_>>()))],
        sections: vec![Section { title: "All".into(), parts }],
    }
}

fn folder(name: &str) -> Result<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    Ok(folder)
}

fn chromium(name: &str, folder: &Path, more: &[String]) -> Result<String> {
    let mut command = Command::new(name);
    command.args(["--headless=new", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=4000"]);
    command.arg(format!("--user-data-dir={}", folder.join("profile").display())).args(more);
    let out = command.output().map_err(Error::io(folder))?;
    Ok(String::from_utf8_lossy(&out.stdout).into_owned())
}

#[test]
fn nothing_is_wider_than_a_narrow_screen() -> Result<()> {
    let Some(name) = browser() else { return Ok(()) };
    let folder = folder("narrow")?;
    let inner = folder.join("page.html");
    std::fs::write(&inner, page(&wide_page())).map_err(Error::io(&inner))?;
    // A frame is as narrow as it is told to be, which the window of a browser need not be. What is seen through is the scripted page.
    let probe = "const d = f.contentDocument; const w = d.documentElement; \
                 document.title = [w.scrollWidth, w.clientWidth, d.querySelectorAll('svg.panel').length, d.querySelectorAll('.keys [role=button]').length].join(' ');";
    let outer = folder.join("frame.html");
    let html = format!(
        "<!doctype html><title>not yet</title><iframe id=f src=\"page.html\" style=\"width:420px;height:900px;border:0\" onload=\"{probe}\"></iframe>"
    );
    std::fs::write(&outer, html).map_err(Error::io(&outer))?;
    let address = format!("file://{}", outer.display());
    let found = chromium(name, &folder, &["--allow-file-access-from-files".into(), "--dump-dom".into(), address])?;
    let title = found.split("<title>").nth(1).and_then(|rest| rest.split('<').next()).unwrap_or_default();
    let numbers: Vec<usize> = title.split(' ').filter_map(|number| number.parse().ok()).collect();
    let [scroll, client, panels, buttons] = numbers[..] else { return Err(Error::Undetermined(format!("no answer: {title}"))) };
    // A scroll bar may take some of the width.
    assert!((400..=420).contains(&client) && (panels, buttons) == (12, 1), "the page and its script ran: {title}");
    assert!(scroll <= client, "the page is {scroll} pixels wide on {client}");
    Ok(())
}

#[test]
fn the_print_holds_every_column() -> Result<()> {
    let Some(name) = browser() else { return Ok(()) };
    if Command::new("pdftotext").arg("-v").output().is_err() {
        eprintln!("skipped: no pdftotext was found");
        return Ok(());
    }
    let folder = folder("print")?;
    let (html, pdf) = (folder.join("page.html"), folder.join("page.pdf"));
    std::fs::write(&html, page(&wide_page())).map_err(Error::io(&html))?;
    let print =
        [format!("--print-to-pdf={}", pdf.display()), "--no-pdf-header-footer".into(), format!("file://{}", html.display())];
    chromium(name, &folder, &print)?;
    let out = Command::new("pdftotext").args(["-bbox", &pdf.display().to_string(), "-"]).output().map_err(Error::io(&pdf))?;
    let boxes = String::from_utf8_lossy(&out.stdout).into_owned();
    let attribute = |line: &str, name: &str| {
        line.split(&format!("{name}=\""))
            .nth(1)
            .and_then(|rest| rest.split('"').next())
            .and_then(|number| number.parse::<f64>().ok())
    };
    let (mut width, mut words, mut last) = (0.0, 0, 0);
    for line in boxes.lines() {
        if line.contains("<page ") {
            width = attribute(line, "width").unwrap_or_default();
        }
        if let Some(right) = attribute(line, "xMax") {
            words += 1;
            assert!(right <= width, "{line} is cut: the page is {width} wide");
        }
        last += usize::from(line.contains(">5.8<")) + usize::from(line.contains(">M7<"));
    }
    // The last cell of the table, and the last of each row of the map.
    assert!(words > 200 && last == 7, "{words} words, {last} of 7 last cells");
    Ok(())
}
