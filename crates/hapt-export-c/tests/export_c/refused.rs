//! Worlds and names that C does not take.
