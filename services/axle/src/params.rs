//! Parameters of a service: its TOML file, checked when it is read.

use crate::out::usage;
use axle_schema::contract::Params;
use std::path::Path;
use toml::{Table, Value};

/// Reads the parameters from a file, or takes the defaults. What the file leaves out is as in the shipped file.
///
/// # Errors
/// A usage error that names the file, the line and the field.
pub(crate) fn load<P: Params>(file: Option<&Path>) -> anyhow::Result<P> {
    let Some(path) = file else { return Ok(P::default()) };
    let wrong = |fault: &dyn std::fmt::Display| usage(format!("{}: {fault}", path.display()));
    let text = std::fs::read_to_string(path)
        .map_err(|fault| usage(format!("cannot read the parameters {}: {fault}", path.display())))?;
    // The text is read by itself first, since only so a fault can be told with its line.
    let _: P = toml::from_str(&text).map_err(|fault| wrong(&fault))?;
    let mut merged: Table = toml::from_str(P::FILE)?;
    merge(&mut merged, toml::from_str(&text)?);
    let params: P = merged.try_into().map_err(|fault| wrong(&fault))?;
    params.check().map_err(|refusal| wrong(&refusal))?;
    Ok(params)
}

/// Whether a service can begin with this file: said before it waits for a router.
///
/// # Errors
/// As [`load`].
pub(crate) fn check<P: Params>(file: Option<&Path>) -> anyhow::Result<()> {
    load::<P>(file).map(drop)
}

/// Puts `over` on `base`, table by table.
fn merge(base: &mut Table, over: Table) {
    for (name, value) in over {
        match (base.get_mut(&name), value) {
            (Some(Value::Table(base)), Value::Table(over)) => merge(base, over),
            (_, value) => drop(base.insert(name, value)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_emulator::EmulatorParams;

    fn load_text(text: &str) -> anyhow::Result<EmulatorParams> {
        let file =
            std::env::temp_dir().join(format!("axle-params-{}-{}.toml", std::process::id(), text.len()));
        std::fs::write(&file, text).expect("a temporary file");
        let params = load(Some(&file));
        std::fs::remove_file(&file).expect("the temporary file");
        params
    }

    #[test]
    fn what_a_file_leaves_out_is_as_shipped() {
        let params = load_text("seed = 5\n[gate]\ngrace = 0.02\n").expect("right parameters");
        assert_eq!(params.seed, 5);
        assert_eq!(params.gate.grace, axle_schema::Seconds(0.02));
        assert!(params.gate.starts_enabled, "the shipped file of the emulator enables the drive");
    }

    #[test]
    fn a_wrong_file_is_refused_with_its_line() {
        let check = |text: &str, words: &[&str]| {
            let fault = format!("{:#}", load_text(text).expect_err(text));
            for word in words {
                assert!(fault.contains(word), "{fault:?} does not say {word:?}");
            }
        };
        check("\n[gate]\nmax_agee = 0.2\n", &["line 3", "max_agee"]);
        check("[gate]\nmax_age = 0.0\n", &["gate.max_age", "0.05 to 1"]);
        check("[robot]\ntrack = nan\n", &["track"]);
        let missing = load::<EmulatorParams>(Some(Path::new("no/such.toml"))).expect_err("no such file");
        assert!(missing.to_string().contains("no/such.toml"));
    }
}
