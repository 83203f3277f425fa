//! Filters of lists by user options: taps for a frame rate, and a filter that adapts to the rate of its
//! lists.

mod low_pass;
mod rate_filter;

pub use low_pass::{FilterOptions, low_pass};
pub use rate_filter::RateFilter;
