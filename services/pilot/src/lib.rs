//! Pilot: takes a task and sees it through.
