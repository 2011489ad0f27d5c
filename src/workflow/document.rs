//! A machine-readable result as text: the same document whoever asked for it, so that programs that read one read all.

use serde::Serialize;

/// Of the form of all machine-readable results. It grows when a program that reads them would have to change.
const SCHEMA: u32 = 1;

/// A machine-readable result, which is an object.
#[derive(Serialize)]
struct Document<'a, T> {
    schema: u32,
    #[serde(flatten)]
    content: &'a T,
}

/// A result, which serialises as an object, as a JSON document with the number of its form before its own fields. Numbers read back to the
/// same bits.
///
/// # Errors
/// What `serde_json` says of content that is no object.
pub fn document(content: &impl Serialize) -> Result<String, serde_json::Error> {
    let mut text = serde_json::to_string_pretty(&Document { schema: SCHEMA, content })?;
    text.push('\n');
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_form_comes_first_and_a_bare_number_is_no_document() {
        #[derive(Serialize)]
        struct Content {
            rmse: f64,
        }
        let text = document(&Content { rmse: 0.1 }).map_err(|error| error.to_string());
        assert_eq!(text.as_deref(), Ok("{\n  \"schema\": 1,\n  \"rmse\": 0.1\n}\n"));
        assert!(document(&3.0).is_err());
    }
}
