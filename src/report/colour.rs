//! Colours that people with a colour vision deficiency tell apart, on light and on dark paper.
//!
//! Colour never carries a meaning alone: lines also differ in dash and width, bars in outline and name, and cells of a map also hold their number.

use std::fmt::Write;

/// Colours of series of a [`Theme`].
pub const SERIES: usize = 7;

/// The colours of a page or picture.
#[derive(Clone, Copy, Debug)]
pub struct Theme {
    /// Background.
    pub paper: &'static str,
    /// Words.
    pub ink: &'static str,
    /// Words and lines of less weight.
    pub soft: &'static str,
    /// Grid, rules, bands.
    pub rule: &'static str,
    /// Links and marks.
    pub link: &'static str,
    /// What was measured, then lines and bars in their order.
    pub series: [&'static str; SERIES],
}

impl Theme {
    /// Okabe and Ito's palette without yellow (too faint on white): M. Okabe, K. Ito, *Color Universal Design*, 2008.
    pub const LIGHT: Self = Self {
        paper: "#ffffff",
        ink: "#1b1b1b",
        soft: "#595959",
        rule: "#d9d9d9",
        link: "#005a8c",
        series: ["#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"],
    };
    /// The same hues, lighter where the dark ones would drown.
    pub const DARK: Self = Self {
        paper: "#16181b",
        ink: "#ececec",
        soft: "#a9adb3",
        rule: "#3a3e44",
        link: "#7cc0ee",
        series: ["#ffffff", "#4AA8E0", "#F0803C", "#2CC499", "#DE9CC0", "#9AD4F5", "#F2BC4B"],
    };

    fn names(&self) -> impl Iterator<Item = (String, &'static str)> {
        let own = [("paper", self.paper), ("ink", self.ink), ("soft", self.soft), ("rule", self.rule), ("link", self.link)];
        let series = self.series.into_iter().enumerate().map(|(number, colour)| (format!("s{number}"), colour));
        own.into_iter().map(|(name, colour)| (name.to_owned(), colour)).chain(series)
    }

    /// The colours as variables of a style sheet.
    pub fn variables(&self) -> String {
        let mut out = String::new();
        for (name, colour) in self.names() {
            _ = write!(out, "--{name}:{colour};");
        }
        out
    }

    /// A style sheet with the colours in the place of the variables, for programs that know none.
    pub fn resolve(&self, style: &str) -> String {
        self.names().fold(style.to_owned(), |style, (name, colour)| style.replace(&format!("var(--{name})"), colour))
    }
}

/// Ten equidistant colours of cividis (J. R. Nuñez, C. R. Anderton, R. S. Renslow, PLoS ONE 13(7), 2018), dark to light.
const CIVIDIS: [[u8; 3]; 10] = [
    [0x00, 0x22, 0x4e],
    [0x12, 0x35, 0x70],
    [0x3b, 0x49, 0x6c],
    [0x57, 0x5d, 0x6d],
    [0x70, 0x71, 0x73],
    [0x8a, 0x86, 0x78],
    [0xa5, 0x9c, 0x74],
    [0xc3, 0xb3, 0x69],
    [0xe1, 0xcc, 0x55],
    [0xfe, 0xe8, 0x38],
];

/// Background and text colour of a map cell, `#rrggbb`: light for 0, dark for 1 (values beyond are cut), as on a light page more
/// ink is more.
pub fn shade(share: f64) -> (String, &'static str) {
    let last = CIVIDIS.len() - 1;
    let place = (1.0 - share.clamp(0.0, 1.0)) * last as f64;
    // NaN becomes 0 in the cast, the darkest colour: not silently light.
    let index = (place.floor() as usize).min(last - 1);
    let part = place - index as f64;
    let [red, green, blue]: [f64; 3] = std::array::from_fn(|channel| {
        let [low, high] = [CIVIDIS[index][channel], CIVIDIS[index + 1][channel]].map(f64::from);
        low + part * (high - low)
    });
    let text = if luminance([red, green, blue]) > 0.179 { "#000000" } else { "#ffffff" };
    (format!("#{:02x}{:02x}{:02x}", red.round() as u8, green.round() as u8, blue.round() as u8), text)
}

/// Relative luminance of an sRGB colour (WCAG 2.1). Above 0.179 black text has the greater contrast, below it white.
fn luminance(rgb: [f64; 3]) -> f64 {
    let linear = |value: f64| {
        let value = value / 255.0;
        if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    };
    let [red, green, blue] = rgb.map(linear);
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rgb(hex: &str) -> [f64; 3] {
        let of = u32::from_str_radix(hex.trim_start_matches('#'), 16).unwrap_or(0).to_be_bytes();
        std::array::from_fn(|channel| f64::from(of[channel + 1]))
    }

    #[test]
    fn words_and_lines_stand_out_from_the_paper_in_both_themes() {
        for theme in [Theme::LIGHT, Theme::DARK] {
            let contrast = |colour: &str| {
                let [a, b] = [theme.paper, colour].map(|colour| luminance(rgb(colour)) + 0.05);
                a.max(b) / a.min(b)
            };
            // WCAG 2.1 asks for 4.5 for text, 3 for what pictures need; the last two series are in use for sticks alone, with their names.
            assert!([theme.ink, theme.soft, theme.link].into_iter().all(|colour| contrast(colour) >= 4.5));
            assert!(theme.series[..4].iter().all(|colour| contrast(colour) >= 3.0), "{theme:?}");
            assert!(!theme.resolve("a { fill: var(--s3); color: var(--ink) }").contains("var("));
        }
    }

    #[test]
    fn shades_run_from_light_to_dark_with_legible_text() {
        assert_eq!(shade(0.0), ("#fee838".to_owned(), "#000000"));
        assert_eq!(shade(1.0), ("#00224e".to_owned(), "#ffffff"));
        assert_eq!(shade(7.0), shade(1.0));
        let of = |hex: &str| u32::from_str_radix(hex.trim_start_matches('#'), 16).unwrap_or(0).to_be_bytes();
        let brightness = |step: u32| luminance(std::array::from_fn(|i| f64::from(of(&shade(f64::from(step) / 20.0).0)[i + 1])));
        assert!((0..20).all(|step| brightness(step) > brightness(step + 1)));
        // WCAG asks for a contrast of 4.5 for body text.
        let contrast = |step: u32| {
            let (paper, ink) = (brightness(step) + 0.05, if shade(f64::from(step) / 20.0).1 == "#000000" { 0.05 } else { 1.05 });
            paper.max(ink) / paper.min(ink)
        };
        assert!((0..=20).all(|step| contrast(step) >= 4.5));
    }
}
