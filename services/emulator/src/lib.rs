//! Emulator: a robot in software.
