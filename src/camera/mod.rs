//! Response, lens, and the matrix from frame to polar map.
