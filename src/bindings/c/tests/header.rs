//! The committed header is what cbindgen makes of the sources. `PHYTURE_WRITE_HEADER=1 cargo test -p phyture-c --test header` writes it.

use std::path::Path;

#[test]
fn the_header_is_that_of_the_sources() -> Result<(), Box<dyn std::error::Error>> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(here.join("cbindgen.toml"))?;
    let mut builder = cbindgen::Builder::new().with_config(config);
    // In the order of the header: what others are made of first.
    for file in ["status", "layout", "model", "stream"] {
        builder = builder.with_src(here.join("src").join(file).with_extension("rs"));
    }
    let mut made = Vec::new();
    builder.generate()?.write(&mut made);
    let made = String::from_utf8(made)?;
    let header = here.join("include/phyture.h");
    if std::env::var_os("PHYTURE_WRITE_HEADER").is_some() {
        std::fs::write(&header, &made)?;
    }
    let committed = std::fs::read_to_string(&header)?;
    assert!(committed == made, "include/phyture.h is not that of the sources; write it with PHYTURE_WRITE_HEADER=1");
    for function in ["phyture_hybrid_read", "phyture_stream_push", "phyture_status_text"] {
        assert!(made.contains(&format!("{function}(")), "{function}");
    }
    Ok(())
}
