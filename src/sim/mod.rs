//! The built-in truth helicopter and its pilot: an independent code path, never imported by `physics` or `critique`.
