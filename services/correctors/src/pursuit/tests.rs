//! The pursuit-corrector, beat by beat; whole courses are in tests/closed_loop.rs.

use super::*;

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: PursuitParams = toml::from_str(PursuitParams::FILE).expect("the file is valid");
    assert_eq!(read, PursuitParams::default());
    let written = toml::Table::try_from(PursuitParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(PursuitParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    assert!(toml::from_str::<PursuitParams>("lokahead = 1").is_err(), "a misspelt field is refused");
}
