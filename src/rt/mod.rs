//! Clock, shutdown, links, metrics and the one loop that runs every stage.
