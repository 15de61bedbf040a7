//! Correctors: the services that keep a robot on its plan.
