//! The critique: where a model fails against the measurements, and by how much.
