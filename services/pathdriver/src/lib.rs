//! Pathdriver: geometries to movements.
