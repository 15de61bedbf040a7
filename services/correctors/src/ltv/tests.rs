//! The LTV-corrector, beat by beat; whole courses are in tests/closed_loop.

use super::*;

#[test]
fn the_parameter_file_holds_the_defaults() {
    let read: LtvParams = toml::from_str(LtvParams::FILE).expect("the file is valid");
    assert_eq!(read, LtvParams::default());
    let written = toml::Table::try_from(LtvParams::default()).expect("parameters are a table");
    let table: toml::Table = toml::from_str(LtvParams::FILE).expect("the file is a table");
    assert_eq!(table, written, "the file lists every field");
    for along in [0.0, -1.0, f64::NAN] {
        let wrong = LtvParams { along: Metres(along), ..LtvParams::default() };
        assert!(wrong.check().expect_err("no tolerable error").to_string().contains("along"));
    }
}
