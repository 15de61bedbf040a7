//! `axle install`: what systemd needs to run one computer's share of a topology.
//!
//! Everything goes below a prefix, so that a root file system can be made elsewhere, and looked at before it is used.
//! Nothing is started; `systemctl daemon-reload` and `systemctl start axle.target` do that.

use crate::catalog;
use crate::keys::{ACCESS_FILE, Owner, make_directory, write};
use crate::out::{note, usage};
use crate::settings::Settings;
use crate::topology::{Service, Topology};
use anyhow::Context as _;
use axle_mesh::identity::{AUTHORITY_FILE, CERTIFICATE_FILE, KEY_FILE, SECURE, secured};
use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

const ROUTER: &str = include_str!("../../../../deploy/systemd/axle-router.service");
const SERVICE: &str = include_str!("../../../../deploy/systemd/axle@.service");
const TARGET: &str = include_str!("../../../../deploy/systemd/axle.target");
const IDENTITY: &str = include_str!("../../../../deploy/systemd/identity.conf");
const ROUTER_IDENTITY: &str = include_str!("../../../../deploy/systemd/router-identity.conf");
const SERIAL: &str = include_str!("../../../../deploy/systemd/serial.conf");
/// Where the units expect the program.
const PROGRAM: &str = "/usr/local/bin/axle";
/// The service that owns a board.
const OWNS_A_BOARD: &str = "robot";

#[allow(clippy::too_many_lines, reason = "one file after the other, in the order of the installation")]
pub(super) fn install(settings: &Settings, args: &crate::cli::Install) -> anyhow::Result<()> {
    let topology = Topology::read(&args.topology)?;
    let (host, described) = topology.host(settings.host.as_deref())?;
    if args.keys.is_none() && described.router.starts_with(SECURE) {
        return Err(usage(format!(
            "{} is encrypted: name the directory of `axle keys` with --keys DIR",
            described.router
        )));
    }
    let place = Place { etc: args.prefix.join("etc/axle"), units: args.prefix.join("etc/systemd/system") };
    let program = args.program.display().to_string();
    let unit = |text: &str| text.replace(PROGRAM, &program);
    place.prepare()?;
    place.unit("axle-router.service", &unit(ROUTER))?;
    place.unit("axle@.service", &unit(SERVICE))?;
    place.unit("axle.target", TARGET)?;
    place.wanted("multi-user.target", "axle.target", "axle.target")?;
    place.wanted("axle.target", "axle-router.service", "axle-router.service")?;

    let endpoint = |endpoint: &str| if args.keys.is_some() { secured(endpoint) } else { endpoint.to_owned() };
    let endpoints = |list: &[String]| list.iter().map(|each| endpoint(each)).collect::<Vec<_>>().join(",");
    let common = || {
        let mut lines = vec![("AXLE_HOST", host.to_owned())];
        lines.extend(topology.lease_ms.map(|ms| ("AXLE_LEASE", ms.to_string())));
        lines
    };
    let mut lines = common();
    lines.push(("AXLE_LISTEN", endpoint(&described.router)));
    if !described.links.is_empty() {
        lines.push(("AXLE_LINK", endpoints(&described.links)));
    }
    if described.insecure_lan {
        lines.push(("AXLE_INSECURE_LAN", "true".into()));
    }
    place.settings("router", &lines)?;
    if let Some(keys) = &args.keys {
        let owner = Owner::Router { host: host.to_owned() };
        place.identity(keys, &owner, "router", &[ACCESS_FILE])?;
        place.unit("axle-router.service.d/identity.conf", ROUTER_IDENTITY)?;
        place.unit("axle@.service.d/identity.conf", IDENTITY)?;
    } else {
        place.forget("axle-router.service.d/identity.conf")?;
        place.forget("axle@.service.d/identity.conf")?;
    }
    let mut count = 0;
    for service in topology.services_of(host) {
        let Some(entry) = catalog::find(&service.kind) else { continue };
        let instance = instance(service);
        let mut lines = common();
        lines.push(("AXLE_SERVICE", service.kind.clone()));
        lines.push(("AXLE_CONNECT", endpoint(&described.router)));
        lines.extend(service.robot.as_ref().map(|robot| ("AXLE_ROBOT", robot.to_string())));
        if !service.inputs.is_empty() {
            let inputs: Vec<_> =
                service.inputs.iter().map(|(input, from)| format!("{input}={from}")).collect();
            lines.push(("AXLE_INPUT", inputs.join(",")));
        }
        let params = topology.params_of(service)?;
        let file = format!("{instance}.toml");
        if params.is_empty() {
            place.forget_in_etc(&file)?;
        } else {
            write(&place.etc.join(&file), &toml::to_string(&params)?, 0o644)?;
            lines.push(("AXLE_PARAMS", format!("/etc/axle/{file}")));
        }
        place.settings(&instance, &lines)?;
        if let Some(keys) = &args.keys {
            let owner = Owner::Service { kind: entry.name, robot: service.robot.clone() };
            place.identity(keys, &owner, &instance, &[])?;
        }
        if service.kind == OWNS_A_BOARD {
            place.unit(&format!("axle@{instance}.service.d/serial.conf"), SERIAL)?;
        }
        place.wanted("axle.target", &format!("axle@{instance}.service"), "axle@.service")?;
        count += 1;
    }
    note(&format!(
        "wrote the router and {count} services of {host} below {}; start them there with `systemctl daemon-reload` and \
         `systemctl start axle.target`",
        args.prefix.display()
    ));
    Ok(())
}

/// The instance of the template that is this service: `d-corrector-r1`, `pathfinder`.
fn instance(service: &Service) -> String {
    service.robot.as_ref().map_or_else(|| service.kind.clone(), |robot| format!("{}-{robot}", service.kind))
}

/// Where it is written.
struct Place {
    etc: PathBuf,
    units: PathBuf,
}

impl Place {
    /// Makes the directories, and takes away what an earlier topology wanted.
    fn prepare(&self) -> anyhow::Result<()> {
        for directory in [&self.etc, &self.units] {
            fs::create_dir_all(directory)
                .with_context(|| format!("make the directory {}", directory.display()))?;
        }
        // People may list the settings; keys are in a directory of their own.
        make_directory(&self.etc.join("identity"))?;
        let wants = self.units.join("axle.target.wants");
        match fs::read_dir(&wants) {
            Ok(entries) => {
                for entry in
                    entries.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with("axle@"))
                {
                    fs::remove_file(entry.path())
                        .with_context(|| format!("remove {}", entry.path().display()))?;
                }
            }
            Err(fault) if fault.kind() == ErrorKind::NotFound => {}
            Err(fault) => return Err(fault).with_context(|| format!("read {}", wants.display())),
        }
        Ok(())
    }

    fn unit(&self, name: &str, text: &str) -> anyhow::Result<()> {
        let path = self.units.join(name);
        let directory = path.parent().unwrap_or(&self.units);
        fs::create_dir_all(directory)
            .with_context(|| format!("make the directory {}", directory.display()))?;
        write(&path, text, 0o644)
    }

    fn forget(&self, name: &str) -> anyhow::Result<()> {
        forget(&self.units.join(name))
    }

    fn forget_in_etc(&self, name: &str) -> anyhow::Result<()> {
        forget(&self.etc.join(name))
    }

    /// Makes one unit start with another, as `systemctl enable` does.
    fn wanted(&self, by: &str, name: &str, file: &str) -> anyhow::Result<()> {
        let directory = self.units.join(format!("{by}.wants"));
        fs::create_dir_all(&directory)
            .with_context(|| format!("make the directory {}", directory.display()))?;
        let link = directory.join(name);
        forget(&link)?;
        symlink(format!("../{file}"), &link).with_context(|| format!("link {}", link.display()))
    }

    /// Writes the settings of one process, as systemd reads them.
    fn settings(&self, name: &str, lines: &[(&str, String)]) -> anyhow::Result<()> {
        let mut text = String::from("# Written by `axle install`.\n");
        for (variable, value) in lines {
            anyhow::ensure!(
                !value.contains(['"', '\\', '\n', '$', '`']),
                "{variable}: {value:?} cannot stand in a file of settings"
            );
            text.push_str(&format!("{variable}=\"{value}\"\n"));
        }
        write(&self.etc.join(format!("{name}.env")), &text, 0o644)
    }

    fn identity(&self, keys: &Path, owner: &Owner, instance: &str, more: &[&str]) -> anyhow::Result<()> {
        let (from, to) = (keys.join(owner.to_string()), self.etc.join("identity").join(instance));
        make_directory(&to)?;
        for file in [AUTHORITY_FILE, CERTIFICATE_FILE, KEY_FILE].iter().chain(more) {
            let path = from.join(file);
            let text = fs::read_to_string(&path).map_err(|fault| {
                usage(format!(
                    "cannot read {}: {fault}; issue it with `axle keys issue --topology FILE`",
                    path.display()
                ))
            })?;
            write(&to.join(file), &text, 0o600)?;
        }
        Ok(())
    }
}

fn forget(path: &Path) -> anyhow::Result<()> {
    match fs::remove_file(path) {
        Err(fault) if fault.kind() != ErrorKind::NotFound => {
            Err(fault).with_context(|| format!("remove {}", path.display()))
        }
        _ => Ok(()),
    }
}
