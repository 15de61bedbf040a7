//! Pathfinder: way points to geometries.
