//! What columns are called in words: `yaw acceleration, wz_dot`.

use crate::flight::Column;

/// A channel or variable in words; nothing for a name that is not one.
pub fn spoken(name: &str) -> Option<&'static str> {
    Some(match name {
        "vx_dot" => "forward acceleration",
        "vy_dot" => "sideways acceleration",
        "vz_dot" => "vertical acceleration",
        "wx_dot" => "roll acceleration",
        "wy_dot" => "pitch acceleration",
        "wz_dot" => "yaw acceleration",
        "vx" | "air_vx" => "forward speed",
        "vy" | "air_vy" => "sideways speed",
        "vz" | "air_vz" => "vertical speed",
        "wx" => "roll rate",
        "wy" => "pitch rate",
        "wz" => "yaw rate",
        "roll" => "roll angle",
        "pitch" => "pitch angle",
        "u1" | "u2" | "u3" | "u4" => "stick",
        _ => return None,
    })
}

/// `yaw acceleration, wz_dot`; the name alone where there are no words for it.
pub fn named(name: &str) -> String {
    spoken(name).map_or_else(|| name.to_owned(), |words| format!("{words}, {name}"))
}

/// `yaw acceleration (wz_dot)`, for sentences.
pub fn said(name: &str) -> String {
    spoken(name).map_or_else(|| name.to_owned(), |words| format!("{words} ({name})"))
}

/// Title and unit of a panel for each of the six channels.
pub fn channel_panels() -> Vec<(String, String)> {
    Column::TARGETS.iter().map(|column| (named(column.name()), column.unit().to_owned())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_has_words_and_keeps_its_symbol() {
        for column in Column::TARGETS {
            assert!(
                spoken(column.name()).is_some_and(|words| words.ends_with("acceleration"))
                    && named(column.name()).ends_with(column.name())
            );
        }
        assert_eq!((named("load"), said("vx")), ("load".into(), "forward speed (vx)".into()));
    }
}
