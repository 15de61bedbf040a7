//! The wires of Axle: puts services on Zenoh.
