//! `axle login`: who may log in at the page.

use crate::cli::Login as Command;
use crate::keys::make_directory;
use crate::logins::{self, Logins};
use crate::out::{data, note, table, usage};
use nix::sys::termios::{LocalFlags, SetArg, tcgetattr, tcsetattr};
use serde_json::json;
use std::io::{self, BufRead as _, IsTerminal as _, Read as _, Write as _};

/// No password is longer; the rest of a line is not even read.
const MAX_LINE: u64 = 1024;

pub(super) fn login(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Add { name, role, robots, token, file } => {
            let path = file.path();
            let mut all = Logins::read_or_none(&path)?;
            logins::check_name(name).map_err(usage)?;
            let (login, token) = if *token {
                let (login, token) = logins::program(name, *role, robots)?;
                (login, Some(token))
            } else {
                (logins::person(name, *role, robots, &password()?)?, None)
            };
            let is_new = all.find(name).is_none();
            all.put(login)?;
            if let Some(directory) = path.parent().filter(|directory| !directory.exists()) {
                make_directory(directory)?;
            }
            all.write(&path)?;
            let did = if is_new {
                "may log in"
            } else {
                "is changed; whoever was logged in by that name is logged out"
            };
            note(&format!("{name} {did}: {}", path.display()));
            // It is told once, and kept nowhere.
            token.map_or(Ok(()), |token| Ok(data(&token)?))
        }
        Command::Remove { name, file } => {
            let path = file.path();
            let mut all = Logins::read(&path)?;
            anyhow::ensure!(all.remove(name), "{name} could not log in anyway; see `axle login show`");
            all.write(&path)?;
            note(&format!("{name} may log in no longer"));
            Ok(())
        }
        Command::Show { file, json } => {
            let all = Logins::read_or_none(&file.path())?;
            let kind = |login: &logins::Login| if login.is_program() { "token" } else { "password" };
            if *json {
                let rows = all.all().iter().map(|login| {
                    json!({ "name": login.name, "role": login.role, "only": login.only, "by": kind(login) })
                });
                return Ok(data(&serde_json::Value::from(rows.collect::<Vec<_>>()).to_string())?);
            }
            let rows = all.all().iter().map(|login| {
                let only = login.only.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
                let role = serde_json::to_value(login.role).ok();
                let role = role.as_ref().and_then(|role| role.as_str()).unwrap_or_default().to_owned();
                vec![login.name.clone(), role, only, kind(login).to_owned()]
            });
            Ok(table(&["name", "role", "only", "by"], rows)?)
        }
    }
}

/// Asks a person twice, without showing what is typed; reads a line of stdin where nobody sits there.
fn password() -> anyhow::Result<String> {
    if !io::stdin().is_terminal() {
        return line();
    }
    let hidden = Hidden::new()?;
    let [first, again] = ["Password: ", "Once more: "].map(|words| -> anyhow::Result<String> {
        let mut out = io::stderr();
        out.write_all(words.as_bytes())?;
        out.flush()?;
        let line = line()?;
        out.write_all(b"\n")?;
        Ok(line)
    });
    drop(hidden);
    let (first, again) = (first?, again?);
    if first != again {
        return Err(usage("the two passwords differ".to_owned()));
    }
    Ok(first)
}

fn line() -> anyhow::Result<String> {
    let mut line = String::new();
    io::stdin().lock().take(MAX_LINE).read_line(&mut line)?;
    Ok(line.trim_end_matches(['\n', '\r']).to_owned())
}

/// A terminal that does not show what is typed, until it is dropped.
struct Hidden(nix::sys::termios::Termios);

impl Hidden {
    fn new() -> anyhow::Result<Self> {
        let before = tcgetattr(io::stdin())?;
        let mut hidden = before.clone();
        hidden.local_flags.remove(LocalFlags::ECHO);
        tcsetattr(io::stdin(), SetArg::TCSANOW, &hidden)?;
        Ok(Self(before))
    }
}

impl Drop for Hidden {
    fn drop(&mut self) {
        // A terminal that is gone shows nothing anyway.
        let _ = tcsetattr(io::stdin(), SetArg::TCSANOW, &self.0);
    }
}
