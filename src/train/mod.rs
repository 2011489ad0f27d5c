//! Training: Adam, schedule, trainer, checkpoint.
