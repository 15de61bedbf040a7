//! Charts of lines.
