//! Navigator: where the robot is.
