//! Filters over time.
