//! Source: bounded buffers of measurements.
