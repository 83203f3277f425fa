//! Speed against error.
