//! The files of the app, in the program: a fixed table, so that no path leads anywhere else.

/// Content type of answers.
pub(super) const JSON: &str = "application/json";
const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";

macro_rules! file {
    ($path:literal, $kind:expr) => {
        (concat!("/", $path), $kind, include_str!(concat!("../app/", $path)))
    };
}

/// Path, content type, content.
const FILES: &[(&str, &str, &str)] = &[
    ("/", HTML, include_str!("../app/index.html")),
    file!("app.css", CSS),
    file!("views.css", CSS),
    file!("main.js", SCRIPT),
    file!("api.js", SCRIPT),
    file!("banner.js", SCRIPT),
    file!("charts.js", SCRIPT),
    file!("compare.js", SCRIPT),
    file!("curve.js", SCRIPT),
    file!("dialog.js", SCRIPT),
    file!("dom.js", SCRIPT),
    file!("editor.js", SCRIPT),
    file!("format.js", SCRIPT),
    file!("learn.js", SCRIPT),
    file!("lines.js", SCRIPT),
    file!("model.js", SCRIPT),
    file!("place.js", SCRIPT),
    file!("plots.js", SCRIPT),
    file!("remains.js", SCRIPT),
    file!("rollout.js", SCRIPT),
    file!("runs.js", SCRIPT),
    file!("train.js", SCRIPT),
    file!("where.js", SCRIPT),
    file!("vendor/uPlot.esm.js", SCRIPT),
    file!("vendor/uPlot.min.css", CSS),
    file!("vendor/LICENSE", TEXT),
];

/// The file at a path.
pub(super) fn find(path: &str) -> Option<(&'static str, &'static str)> {
    FILES.iter().find(|file| file.0 == path).map(|file| (file.1, file.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_page_and_its_modules_ask_for_is_there() {
        for (path, kind, content) in FILES {
            let here = path.rsplit_once('/').map_or("", |(folder, _)| folder);
            let quoted = content.split('"').skip(1).step_by(2).chain(content.split('\'').skip(1).step_by(2));
            let wanted = quoted.filter(|name| {
                let is_file = [".js", ".css"].iter().any(|ending| name.ends_with(ending)) && !name.contains(char::is_whitespace);
                is_file && [HTML, SCRIPT].contains(kind)
            });
            for name in wanted {
                let plain = name.trim_start_matches("./");
                let found = if name.starts_with('/') { find(name) } else { find(&format!("{here}/{plain}")) };
                assert!(found.is_some(), "{path} asks for {name}");
            }
        }
        assert!(find("/app.css/").is_none() && find("/../Cargo.toml").is_none() && find("").is_none());
    }

    /// The page's policy forbids scripts and styles in the page.
    #[test]
    fn nothing_is_inline() {
        let page = find("/").map_or("", |file| file.1);
        assert!(!page.contains("<style") && !page.contains("style=") && !page.contains("onclick"));
        assert!(page.matches("<script").count() == page.matches("<script type=\"module\" src=").count());
    }
}
