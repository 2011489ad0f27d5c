//! Which samples judge models, and with which numbers of each flight. Numbers that a flight has for itself (wind, biases, trims) and that no fit
//! has seen come from the half of it that is not judged by them. Nothing is predicted here.

use crate::critique::diagnose::met_both_ways;
use crate::error::Result;
use crate::flight::windows::windows;
use crate::flight::{Flight, Span, Window};
use crate::physics::Model;

/// The windows that are judged, in the order of flight and time, each with the models that know as much of its flight as they may.
pub(super) struct Judging {
    /// All windows.
    pub windows: Vec<Window>,
    /// Models by part, in the order in which they were given.
    pub models: Vec<Vec<Model>>,
    /// Of each window, whose numbers judge it.
    part: Vec<usize>,
}

impl Judging {
    /// Windows of `history` rows in `spans`, `stride` apart.
    ///
    /// # Errors
    /// As [`Model::predict`].
    pub fn new(flights: &[Flight], models: &[&Model], spans: &[Span], history: usize, stride: usize) -> Result<Self> {
        let mut all: Vec<(Window, usize)> = Vec::new();
        let mut by_part = Vec::new();
        for (part, met) in met_both_ways(flights, models, spans)?.into_iter().enumerate() {
            all.extend(windows(&met.judged, history, stride).into_iter().map(|window| (window, part)));
            by_part.push(met.models);
        }
        all.sort_unstable();
        let (windows, part) = all.into_iter().unzip();
        Ok(Self { windows, models: by_part, part })
    }

    /// Whether halves of flights judge numbers that come from the other halves.
    pub fn by_halves(&self) -> bool {
        self.models.len() > 1
    }

    /// Without the windows that are not `wanted`.
    pub fn filtered(mut self, wanted: impl Fn(&Window) -> bool) -> Self {
        let kept: Vec<(Window, usize)> = self.windows.into_iter().zip(self.part).filter(|(window, _)| wanted(window)).collect();
        (self.windows, self.part) = kept.into_iter().unzip();
        self
    }

    /// What `of_part` makes of the windows of each part with its models, in the order of all windows.
    ///
    /// # Errors
    /// Those of `of_part`.
    pub fn each<T>(&self, mut of_part: impl FnMut(&[Model], &[Window]) -> Result<Vec<T>>) -> Result<Vec<T>> {
        let mut parts = Vec::new();
        for (part, models) in self.models.iter().enumerate() {
            let own = self.of_part(part);
            let made = of_part(models, &own)?;
            assert_eq!(made.len(), own.len(), "one value a window");
            parts.push(made.into_iter());
        }
        Ok(self.part.iter().filter_map(|&part| parts[part].next()).collect())
    }

    /// The first part that has windows: its models, and these.
    pub fn first(&self) -> Option<(&[Model], Vec<Window>)> {
        let &part = self.part.iter().min()?;
        Some((&self.models[part], self.of_part(part)))
    }

    fn of_part(&self, part: usize) -> Vec<Window> {
        self.windows.iter().zip(&self.part).filter(|(_, of)| **of == part).map(|(window, _)| *window).collect()
    }
}
