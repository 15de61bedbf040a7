//! Who may log in at the page: a file with names, roles, and what is left of their secrets.
//!
//! A password is kept as PBKDF2 makes it of SHA-256 and a salt of its own, so that whoever reads the file must guess each
//! one at length. A token of a program is 256 random bits, which nobody guesses; its SHA-256 is enough.

use crate::keys::write;
use crate::out::usage;
use axle_gateway::login::{Fingerprint, Guest, MAX_NAME, Role};
use axle_schema::RobotId;
use ring::rand::{SecureRandom as _, SystemRandom};
use ring::{digest, pbkdf2};
use serde::{Deserialize, Serialize};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

/// The file beside keys.
pub(crate) const FILE: &str = "logins.toml";
/// The most people and programs.
const MAX_LOGINS: usize = 256;
/// The largest file that is read.
const MAX_BYTES: u64 = 256 * 1024;
/// How often a password is hashed: what OWASP asks of PBKDF2 with SHA-256.
const ROUNDS: u32 = 600_000;
/// Of a file that somebody else wrote: fewer protect nobody, more would hold the gateway up.
const ROUNDS_RANGE: std::ops::RangeInclusive<u32> = 1000..=10_000_000;
/// The shortest and the longest password, in bytes.
const PASSWORD: std::ops::RangeInclusive<usize> = 10..=256;

/// One who may log in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Login {
    /// The name.
    pub(crate) name: String,
    /// What they may do.
    pub(crate) role: Role,
    /// The robots that they may act on; none are all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) only: Vec<RobotId>,
    /// `pbkdf2-sha256:ROUNDS:SALT:HASH` of a password, or `sha256:HASH` of a token, in hexadecimal digits.
    secret: String,
}

/// All who may.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Logins {
    #[serde(default)]
    logins: Vec<Login>,
}

impl Login {
    /// What they may do from the page.
    pub(crate) fn guest(&self) -> Guest {
        Guest { name: self.name.clone(), role: self.role, only: self.only.clone() }
    }
    /// Changes with the secret and with the rights: a session lives no longer than what it was opened by.
    pub(crate) fn fingerprint(&self) -> Fingerprint {
        fingerprint(format!("{:?} {:?} {}", self.role, self.only, self.secret).as_bytes())
    }
    /// Whether it is a program with a token.
    pub(crate) fn is_program(&self) -> bool {
        self.secret.starts_with("sha256:")
    }
    fn check(&self) -> Result<(), String> {
        check_name(&self.name)?;
        match self.secret.split(':').collect::<Vec<_>>()[..] {
            ["sha256", hash] if unhex(hash).is_some_and(|hash| hash.len() == 32) => Ok(()),
            ["pbkdf2-sha256", rounds, salt, hash]
                if rounds.parse().is_ok_and(|rounds: u32| ROUNDS_RANGE.contains(&rounds))
                    && unhex(salt).is_some_and(|salt| salt.len() >= 16)
                    && unhex(hash).is_some_and(|hash| hash.len() == 32) =>
            {
                Ok(())
            }
            _ => Err(format!("the secret of {} is none that `axle login` writes", self.name)),
        }
    }
    /// Whether this is the password. Takes a good part of a second.
    fn knows(&self, password: &str) -> bool {
        let ["pbkdf2-sha256", rounds, salt, hash] = self.secret.split(':').collect::<Vec<_>>()[..] else {
            return false;
        };
        let (Some(rounds), Some(salt), Some(hash)) =
            (rounds.parse().ok().and_then(NonZeroU32::new), unhex(salt), unhex(hash))
        else {
            return false;
        };
        pbkdf2::verify(pbkdf2::PBKDF2_HMAC_SHA256, rounds, &salt, password.as_bytes(), &hash).is_ok()
    }
}

impl Logins {
    /// Reads a file.
    ///
    /// # Errors
    /// A usage error that names the file and what is wrong in it.
    pub(crate) fn read(path: &Path) -> anyhow::Result<Self> {
        use std::io::Read as _;
        use std::os::unix::fs::PermissionsExt as _;
        let wrong = |why: String| usage(format!("{}: {why}", path.display()));
        let file = std::fs::File::open(path)
            .map_err(|fault| wrong(format!("{fault}; `axle login add NAME` makes it")))?;
        let mode = file.metadata().map_err(|fault| wrong(fault.to_string()))?.permissions().mode() & 0o777;
        if mode & 0o007 != 0 {
            return Err(wrong(format!(
                "everybody can read it (mode {mode:o}): chmod 600 {}",
                path.display()
            )));
        }
        let mut text = String::new();
        file.take(MAX_BYTES).read_to_string(&mut text).map_err(|fault| wrong(fault.to_string()))?;
        let logins: Self = toml::from_str(&text).map_err(|fault| wrong(fault.to_string()))?;
        if logins.logins.len() > MAX_LOGINS {
            return Err(wrong(format!("more than {MAX_LOGINS} logins")));
        }
        for (index, login) in logins.logins.iter().enumerate() {
            login.check().map_err(wrong)?;
            if logins.logins[..index].iter().any(|other| other.name == login.name) {
                return Err(wrong(format!("{} is there twice", login.name)));
            }
        }
        Ok(logins)
    }
    /// The same, but none where there is no file yet.
    pub(crate) fn read_or_none(path: &Path) -> anyhow::Result<Self> {
        if path.exists() { Self::read(path) } else { Ok(Self::default()) }
    }
    /// Writes it, for its owner alone.
    pub(crate) fn write(&self, path: &Path) -> anyhow::Result<()> {
        let text = format!(
            "# Written by `axle login`: who may log in at the page. It holds no passwords, and is no secret that opens \
             anything.\n\n{}",
            toml::to_string(self)?
        );
        write(path, &text, 0o600)
    }
    /// All of them.
    pub(crate) fn all(&self) -> &[Login] {
        &self.logins
    }
    /// The one of this name.
    pub(crate) fn find(&self, name: &str) -> Option<&Login> {
        self.logins.iter().find(|login| login.name == name)
    }
    /// Puts one in, in place of the one of the same name.
    pub(crate) fn put(&mut self, login: Login) -> anyhow::Result<()> {
        self.remove(&login.name);
        if self.logins.len() >= MAX_LOGINS {
            return Err(usage(format!("{MAX_LOGINS} may log in already; remove one first")));
        }
        self.logins.push(login);
        Ok(())
    }
    /// Takes one out; whether it was there.
    pub(crate) fn remove(&mut self, name: &str) -> bool {
        let before = self.logins.len();
        self.logins.retain(|login| login.name != name);
        self.logins.len() < before
    }
    /// Who has this name and this password. It takes as long for a name that nobody has, so that names cannot be probed.
    pub(crate) fn by_password(&self, name: &str, password: &str) -> Option<&Login> {
        if !PASSWORD.contains(&password.len()) {
            return None;
        }
        let found = self.find(name).filter(|login| !login.is_program());
        let nobody = || Login {
            name: String::new(),
            role: Role::Viewer,
            only: Vec::new(),
            secret: format!("pbkdf2-sha256:{ROUNDS}:{}:{}", "00".repeat(16), "00".repeat(32)),
        };
        match found {
            Some(login) => login.knows(password).then_some(login),
            None => {
                nobody().knows(password);
                None
            }
        }
    }
    /// Which program has this token.
    pub(crate) fn by_token(&self, token: &str) -> Option<&Login> {
        // Fingerprints are compared: how long that takes tells nothing of a token.
        let secret = format!("sha256:{}", hex(&fingerprint(token.as_bytes())));
        self.logins.iter().find(|login| login.secret == secret)
    }
}

/// Refuses what is no name.
pub(crate) fn check_name(name: &str) -> Result<(), String> {
    let is_name = (1..=MAX_NAME).contains(&name.len())
        && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.@".contains(&byte));
    if is_name {
        return Ok(());
    }
    let shown: String = name.chars().take(80).collect();
    Err(format!("{shown:?} is no name: 1 to {MAX_NAME} letters, digits, - _ . @"))
}

/// A login of a person with a password.
pub(crate) fn person(name: &str, role: Role, only: &[RobotId], password: &str) -> anyhow::Result<Login> {
    check_name(name).map_err(usage)?;
    if !PASSWORD.contains(&password.len()) {
        let (least, most) = (PASSWORD.start(), PASSWORD.end());
        return Err(usage(format!(
            "a password has {least} to {most} bytes, and this one has {}",
            password.len()
        )));
    }
    let rounds = NonZeroU32::new(ROUNDS).ok_or_else(|| anyhow::anyhow!("no rounds"))?;
    let salt = random::<16>()?;
    let mut hash = [0; 32];
    pbkdf2::derive(pbkdf2::PBKDF2_HMAC_SHA256, rounds, &salt, password.as_bytes(), &mut hash);
    let secret = format!("pbkdf2-sha256:{rounds}:{}:{}", hex(&salt), hex(&hash));
    Ok(Login { name: name.to_owned(), role, only: only.to_vec(), secret })
}

/// A login of a program, and its token, which is kept nowhere.
pub(crate) fn program(name: &str, role: Role, only: &[RobotId]) -> anyhow::Result<(Login, String)> {
    check_name(name).map_err(usage)?;
    let token = token()?;
    let secret = format!("sha256:{}", hex(&fingerprint(token.as_bytes())));
    Ok((Login { name: name.to_owned(), role, only: only.to_vec(), secret }, token))
}

/// 256 bits that nobody guesses, in hexadecimal digits.
pub(crate) fn token() -> anyhow::Result<String> {
    Ok(hex(&random::<32>()?))
}

/// What cannot be turned back.
pub(crate) fn fingerprint(bytes: &[u8]) -> Fingerprint {
    let mut print = [0; 32];
    print.copy_from_slice(digest::digest(&digest::SHA256, bytes).as_ref());
    print
}

/// A file of logins as a running gateway has it: read again when it has changed.
pub(crate) struct Watched {
    path: PathBuf,
    stamp: Option<(std::time::SystemTime, u64)>,
    pub(crate) logins: Logins,
}

impl Watched {
    /// Reads the file.
    ///
    /// # Errors
    /// As [`Logins::read`]; and where nobody may log in, since such a page would only look broken.
    pub(crate) fn open(path: &Path) -> anyhow::Result<Self> {
        let logins = Logins::read(path)?;
        if logins.all().is_empty() {
            return Err(usage(format!(
                "{}: nobody may log in; `axle login add NAME` adds one",
                path.display()
            )));
        }
        Ok(Self { path: path.to_owned(), stamp: Self::stamp(path), logins })
    }
    /// Reads it again if it has changed; whether it has.
    ///
    /// # Errors
    /// When it cannot be read any more: those who were known are known on.
    pub(crate) fn refresh(&mut self) -> anyhow::Result<bool> {
        let stamp = Self::stamp(&self.path);
        if stamp == self.stamp {
            return Ok(false);
        }
        self.stamp = stamp;
        self.logins = Logins::read(&self.path)?;
        Ok(true)
    }
    fn stamp(path: &Path) -> Option<(std::time::SystemTime, u64)> {
        let metadata = std::fs::metadata(path).ok()?;
        Some((metadata.modified().ok()?, metadata.len()))
    }
}

fn random<const N: usize>() -> anyhow::Result<[u8; N]> {
    let mut bytes = [0; N];
    SystemRandom::new().fill(&mut bytes).map_err(|_| anyhow::anyhow!("the system has no random numbers"))?;
    Ok(bytes)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unhex(text: &str) -> Option<Vec<u8>> {
    if !text.len().is_multiple_of(2) || !text.is_ascii() || text.len() > 256 {
        return None;
    }
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("axle-logins-{}-{name}.toml", std::process::id()))
    }

    #[test]
    fn a_password_opens_and_nothing_else_does() {
        let ann = person("ann", Role::Operator, &[], "correct horse").expect("a login");
        let (prometheus, token) = program("prometheus", Role::Viewer, &[]).expect("a login");
        let mut logins = Logins::default();
        logins.put(ann.clone()).expect("room");
        logins.put(prometheus.clone()).expect("room");
        let path = place("opens");
        logins.write(&path).expect("a file");
        let text = std::fs::read_to_string(&path).expect("a file");
        assert!(!text.contains("correct horse") && !text.contains(&token), "{text}");
        let read = Logins::read(&path).expect("the same");
        assert_eq!(read, logins);
        std::fs::remove_file(&path).expect("removed");
        assert_eq!(read.by_password("ann", "correct horse"), Some(&ann));
        assert_eq!(read.by_token(&token), Some(&prometheus));
        for (name, password) in
            [("ann", "correct hors"), ("ann", ""), ("bob", "correct horse"), ("prometheus", &*token)]
        {
            assert_eq!(read.by_password(name, password), None, "{name}");
        }
        for token in ["", "correct horse", &token[..63], &token.to_uppercase()] {
            assert_eq!(read.by_token(token), None);
        }
        // The same password of another person leaves something else.
        let bob = person("bob", Role::Operator, &[], "correct horse").expect("a login");
        assert_ne!(bob.secret.rsplit(':').next(), ann.secret.rsplit(':').next());
        assert_ne!(bob.fingerprint(), ann.fingerprint());
    }

    #[test]
    fn what_is_wrong_in_a_file_is_told_by_name() {
        let path = place("wrong");
        let hash = "ab".repeat(32);
        let login = |name: &str, secret: &str| {
            format!("[[logins]]\nname = \"{name}\"\nrole = \"viewer\"\nsecret = \"{secret}\"\n")
        };
        let good = login("ann", &format!("sha256:{hash}"));
        for (text, words) in [
            (login("ann", "secret"), "the secret of ann"),
            (login("ann", "sha256:abc"), "the secret of ann"),
            (login("ann", &format!("pbkdf2-sha256:1:{hash}:{hash}")), "the secret of ann"),
            (login("a b", &format!("sha256:{hash}")), "is no name"),
            (format!("{good}{good}"), "ann is there twice"),
            (good.replace("viewer", "king"), "king"),
            (format!("{good}more = 1\n"), "more"),
        ] {
            write(&path, &text, 0o600).expect("a file");
            let fault = format!("{:#}", Logins::read(&path).expect_err(words));
            assert!(fault.contains(words), "{fault:?} says {words:?}");
        }
        write(&path, &good, 0o644).expect("a file");
        let fault = Logins::read(&path).expect_err("everybody reads it").to_string();
        assert!(fault.contains("chmod 600"), "{fault}");
        std::fs::remove_file(&path).expect("removed");
        let fault = Logins::read(&path).expect_err("no file").to_string();
        assert!(fault.contains("axle login add"), "{fault}");
        for password in ["", "too short", &"x".repeat(257)] {
            assert!(person("ann", Role::Viewer, &[], password).is_err());
        }
    }

    #[test]
    fn a_file_that_changes_is_read_again_and_a_broken_one_changes_nothing() {
        let path = place("watched");
        let mut logins = Logins::default();
        logins.put(program("a", Role::Viewer, &[]).expect("a login").0).expect("room");
        logins.write(&path).expect("a file");
        let mut watched = Watched::open(&path).expect("a file");
        assert!(!watched.refresh().expect("the same"));
        logins.put(program("b", Role::Viewer, &[]).expect("a login").0).expect("room");
        logins.write(&path).expect("a file");
        assert!(watched.refresh().expect("read") && watched.logins.find("b").is_some());
        write(&path, "nonsense", 0o600).expect("a file");
        assert!(watched.refresh().is_err() && watched.logins.find("b").is_some());
        std::fs::remove_file(&path).expect("removed");
        write(&path, "", 0o600).expect("a file");
        assert!(Watched::open(&path).is_err(), "nobody could come in");
        std::fs::remove_file(&path).expect("removed");
    }
}
