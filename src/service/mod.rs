//! The graph of stages and its supervisor.
