//! Real protocols on real serial lines: boards in software on pseudo-terminals, driven as those of metal are.

mod calibrated;
mod drives;
mod faults;
mod line;
