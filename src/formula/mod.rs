//! Formulas of the closed grammar: parsed, printed, evaluated on columns or one sample at a time. No code runs.
