//! The examples of `docs/adding.md` are from the sources: each block stands, line for line, in the file that is named above it.

use std::path::Path;

/// (file, block) of every example, the indentation of the page taken away.
fn examples(text: &str) -> Vec<(&str, Vec<&str>)> {
    let mut found: Vec<(&str, Vec<&str>)> = Vec::new();
    let mut from = None;
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("From `") {
            from = rest.split('`').next();
            if let Some(file) = from {
                found.push((file, Vec::new()));
            }
        } else if let (Some(_), Some(code)) = (from, line.strip_prefix("    ")) {
            found.last_mut().expect("a file is named above").1.push(code);
        } else if !line.is_empty() {
            from = None;
        }
    }
    found
}

#[test]
fn every_example_stands_in_the_file_that_it_is_from() -> std::io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/adding.md"))?;
    let examples = examples(&page);
    assert_eq!(examples.len(), 10);
    for (file, block) in examples {
        let source = std::fs::read_to_string(root.join(file))?;
        let lines = |text: &str| text.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n");
        let (source, block) = (lines(&source), lines(&block.join("\n")));
        assert!(!block.is_empty() && source.contains(&block), "this example is not in {file}:\n{block}");
    }
    Ok(())
}
