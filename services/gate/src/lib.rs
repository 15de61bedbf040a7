//! Gate: the one door to the wheels.
