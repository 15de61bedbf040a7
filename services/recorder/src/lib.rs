//! Recorder: MCAP out of everything that is said.
