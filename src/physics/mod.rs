//! What we claim to know: effects, models, calibration.
