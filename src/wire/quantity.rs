//! Numbers in 16 bits.
