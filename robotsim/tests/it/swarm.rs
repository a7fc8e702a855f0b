//! Orders, saving, and what every swarm must keep.
