//! Point sets and distributions on plain slices.
