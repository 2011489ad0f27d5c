//! Sums of the squares of blocks, all at once or without one fold after the other, with the numbers of each flight eliminated. What is
//! done with them is the business of `joint`.

use super::Point;
use crate::critique::diagnose::engine::Engine;
use nalgebra::{Cholesky, DMatrix};
use std::collections::BTreeMap;
use std::ops::Range;

/// Parts into which flights are divided where they are worked on side by side.
const PARTS: usize = 8;

/// Sums of squares over some blocks, after what belongs to each flight has been eliminated.
pub(super) struct Normal {
    pub matrix: DMatrix<f64>,
    /// By flight: what the flight's own numbers are made of.
    pub by_flight: BTreeMap<usize, DMatrix<f64>>,
}

impl Normal {
    fn empty(size: usize) -> Self {
        Self { matrix: DMatrix::zeros(size, size), by_flight: BTreeMap::new() }
    }

    fn add_eliminated(&mut self, (matrix, made_of): &(DMatrix<f64>, Option<DMatrix<f64>>), flight: usize) {
        self.matrix += matrix;
        self.by_flight.extend(made_of.iter().map(|made_of| (flight, made_of.clone())));
    }

    fn add(&mut self, other: Self) {
        self.matrix += other.matrix;
        self.by_flight.extend(other.by_flight);
    }
}

impl Point {
    /// The squares of all blocks, with the numbers of each flight eliminated.
    pub(super) fn normal(&self, engine: &Engine<'_>, locals: &[usize]) -> Option<Normal> {
        self.normals(engine, locals, &[None])?.pop()
    }

    /// The squares of the blocks of all folds but one, for each of the `held` folds, with the numbers of each flight eliminated. Flights are
    /// worked off in parts, always the same ones, so that no sum depends on the number of threads.
    pub(super) fn normals(&self, engine: &Engine<'_>, locals: &[usize], held: &[Option<usize>]) -> Option<Vec<Normal>> {
        let flights: Vec<Range<usize>> = engine.runs().collect();
        let parts: Vec<&[Range<usize>]> = flights.chunks(flights.len().div_ceil(PARTS).max(1)).collect();
        let one = |part: &&[Range<usize>]| {
            let mut sums: Vec<Normal> = held.iter().map(|_| Normal::empty(self.size())).collect();
            part.iter().try_for_each(|run| self.add_flight(engine, locals, held, run, &mut sums))?;
            Some(sums)
        };
        #[cfg(feature = "rayon")]
        let found: Vec<Vec<Normal>> = {
            use rayon::prelude::*;
            parts.par_iter().map(one).collect::<Option<_>>()?
        };
        #[cfg(not(feature = "rayon"))]
        let found: Vec<Vec<Normal>> = parts.iter().map(one).collect::<Option<_>>()?;
        found.into_iter().reduce(|mut sums, part| {
            sums.iter_mut().zip(part).for_each(|(sum, part)| sum.add(part));
            sums
        })
    }

    /// The squares of the blocks of all flights but one, for each flight if there are several, with the numbers of each flight eliminated.
    pub(super) fn without_each_flight(&self, engine: &Engine<'_>, locals: &[usize]) -> Option<Vec<(usize, Normal)>> {
        if engine.runs().nth(1).is_none() {
            return Some(Vec::new());
        }
        let whole = self.normal(engine, locals)?.matrix;
        let without = |run: Range<usize>| {
            let flight = engine.blocks[run.start].flight;
            let mut own = DMatrix::zeros(self.size(), self.size());
            run.for_each(|block| self.add(block, &mut own));
            Some((flight, Normal { matrix: &whole - self.eliminated(own, locals)?.0, by_flight: BTreeMap::new() }))
        };
        engine.runs().map(without).collect()
    }

    /// Adds the blocks of one flight to the sums of [`Point::normals`].
    fn add_flight(
        &self,
        engine: &Engine<'_>,
        locals: &[usize],
        held: &[Option<usize>],
        run: &Range<usize>,
        sums: &mut [Normal],
    ) -> Option<()> {
        let mut folds: BTreeMap<usize, DMatrix<f64>> = BTreeMap::new();
        for block in run.clone() {
            let square = folds.entry(engine.fold[block]).or_insert_with(|| DMatrix::zeros(self.size(), self.size()));
            self.add(block, square);
        }
        let flight = engine.blocks[run.start].flight;
        let without = |fold: Option<usize>| {
            let squares = folds.iter().filter(|entry| Some(*entry.0) != fold).map(|entry| entry.1);
            squares.fold(DMatrix::zeros(self.size(), self.size()), |sum, square| sum + square)
        };
        // Most folds have no block of a short flight: what is left without them is the whole.
        let mut whole = None;
        for (&fold, sum) in held.iter().zip(sums) {
            if fold.is_some_and(|fold| folds.contains_key(&fold)) {
                if folds.len() > 1 {
                    sum.add_eliminated(&self.eliminated(without(fold), locals)?, flight);
                }
                continue;
            }
            if whole.is_none() {
                whole = Some(self.eliminated(without(None), locals)?);
            }
            whole.iter().for_each(|whole| sum.add_eliminated(whole, flight));
        }
        Some(())
    }

    /// The squares of a flight without its own numbers, and what those are made of.
    fn eliminated(&self, square: DMatrix<f64>, locals: &[usize]) -> Option<(DMatrix<f64>, Option<DMatrix<f64>>)> {
        if locals.is_empty() {
            return Some((square, None));
        }
        let mut own = DMatrix::from_fn(locals.len(), locals.len(), |i, j| square[(locals[i], locals[j])]);
        for (index, &local) in locals.iter().enumerate() {
            own[(index, index)] += self.correlation * self.known[local].precision(0.0, 0.0);
        }
        let mut others = DMatrix::from_fn(locals.len(), self.size(), |i, j| square[(locals[i], j)]);
        locals.iter().for_each(|&local| others.column_mut(local).fill(0.0));
        let made_of = Cholesky::new(own)?.solve(&others);
        let mut left = square;
        left.gemm_tr(-1.0, &others, &made_of, 1.0);
        Some((left, Some(made_of)))
    }

    /// Adds the weighted squares of a block to those of all columns.
    fn add(&self, block: usize, sum: &mut DMatrix<f64>) {
        let target = self.size() - 1;
        for (reduced, mse) in self.reduced.iter().zip(&self.mse) {
            let square = &reduced.blocks[block];
            let places: Vec<usize> = reduced.free.iter().copied().chain([target]).collect();
            for (column, &to) in square.column_iter().zip(&places) {
                let mut sum = sum.column_mut(to);
                column.iter().zip(&places).for_each(|(value, &place)| sum[place] += value / mse);
            }
        }
    }
}
