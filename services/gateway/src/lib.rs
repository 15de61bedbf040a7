//! Gateway: the pure parts of the page in a browser.
//!
//! Hears what browsers send and what is said about robots; says what a browser is sent next, what a drive is asked, and
//! who is refused. No network, no clock, no randomness: time and random bits are arguments.
//!
//! * [`door`]: which requests are listened to: from this computer or over TLS, from its own page, and from nowhere else;
//! * [`login`]: sessions of people, what they may do, and how often somebody may try;
//! * [`words`]: what a browser may ask, bounded and checked;
//! * [`board`]: the newest word of every stream, and the last events, for any number of slow readers;
//! * [`flight`]: how much a browser may still have to read;
//! * [`desk`]: who holds the stick, and what stops when a browser is lost;
//! * [`foxglove`]: what viewers that speak Foxglove's protocol are sent;
//! * [`lesson`]: the teaching view: a movement computed exactly, and by the formulas of the tutorial;
//! * [`metrics`]: the numbers of the mesh as Prometheus reads them;
//! * [`page`]: the files that a browser loads.
//!
//! When something fails: a browser that is lost, hidden or frozen no longer renews its powers, and the drive brakes, as it
//! does for everybody; a browser that reads slowly is sent the newest and no more; whoever comes from another site is
//! refused before a byte of theirs is read.

pub mod board;
pub mod desk;
pub mod door;
pub mod flight;
pub mod foxglove;
pub mod lesson;
pub mod login;
pub mod metrics;
pub mod page;
pub mod words;

use axle_schema::contract::{Bounds, Params};
use axle_schema::refusal::within;
use axle_schema::{Refusal, Seconds};
use core::net::SocketAddr;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Parameters of the gateway: `deploy/params/gateway.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GatewayParams {
    /// Where the page is: an address of this computer and a port; port 0 takes a free one.
    pub listen: SocketAddr,
    /// How many ports after it are tried when it is taken, 0 to 100.
    pub ports: u16,
    /// Whether it may listen beyond this computer although nothing is encrypted and nobody logs in.
    pub insecure_lan: bool,
    /// The certificate of the page, and of those who signed it, as PEM; with it the page is at `https://`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certificate: Option<PathBuf>,
    /// The private key of the certificate, as PEM.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub key: Option<PathBuf>,
    /// Who may log in, as `axle login` writes it; with it nobody comes in without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub logins: Option<PathBuf>,
    /// Whether Foxglove and other viewers of its protocol may watch.
    pub foxglove: bool,
    /// The port at which they do, beside the page; port 0 takes a free one.
    pub foxglove_port: u16,
    /// The sites whose pages may watch; programs that are no browsers may in any case. At most 16.
    pub foxglove_origins: Vec<String>,
    /// Where the reports lie that the page shows, at most 16 directories.
    pub reports: Vec<PathBuf>,
    /// A login lasts for so many hours, 0.01 to 168.
    pub login_hours: f64,
    /// The shortest time between two words to a browser, 0.02 to 1 s.
    pub period: Seconds,
    /// How long a power holds that a browser does not renew, 0.1 to 1 s.
    pub hold: Seconds,
    /// A power is refused when the word that it answers is older than this, 0.1 to 2 s.
    pub max_age: Seconds,
    /// A browser that answers nothing for so long is lost, 0.5 to 10 s.
    pub silence: Seconds,
    /// What a lost browser had begun is ended after this time, unless it comes back, 0 to 60 s.
    pub grace: Seconds,
    /// The most browsers at a time, 1 to 256.
    pub browsers: usize,
}

impl Default for GatewayParams {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            ports: 9,
            insecure_lan: false,
            certificate: None,
            key: None,
            logins: None,
            reports: vec!["reports".into(), "calibration".into()],
            login_hours: 12.0,
            foxglove: true,
            foxglove_port: 8765,
            foxglove_origins: vec!["https://app.foxglove.dev".to_owned()],
            period: Seconds(0.05),
            hold: Seconds(0.3),
            max_age: Seconds(0.5),
            silence: Seconds(2.0),
            grace: Seconds(3.0),
            browsers: 32,
        }
    }
}

impl Bounds for GatewayParams {
    fn check(&self) -> Result<(), Refusal> {
        if self.ports > 100 {
            return Err(Refusal::out_of_range("ports", self.ports, "0 to 100"));
        }
        within("period in s", self.period.0, 0.02, 1.0)?;
        within("hold in s", self.hold.0, 0.1, 1.0)?;
        within("max_age in s", self.max_age.0, 0.1, 2.0)?;
        within("silence in s", self.silence.0, 0.5, 10.0)?;
        within("grace in s", self.grace.0, 0.0, 60.0)?;
        if !(1..=256).contains(&self.browsers) {
            return Err(Refusal::out_of_range("browsers", self.browsers, "1 to 256"));
        }
        within("login_hours", self.login_hours, 0.01, 168.0)?;
        if self.reports.len() > 16 {
            return Err(Refusal::out_of_range("reports", self.reports.len(), "0 to 16"));
        }
        if self.foxglove_origins.len() > 16 {
            return Err(Refusal::out_of_range("foxglove_origins", self.foxglove_origins.len(), "0 to 16"));
        }
        if self.certificate.is_some() != self.key.is_some() {
            return Err(Refusal::missing("certificate or key", "a page with TLS needs both"));
        }
        door::check_listen(self.listen, self.guard())
    }
}

impl GatewayParams {
    /// What protects the page.
    #[must_use]
    pub const fn guard(&self) -> door::Guard {
        door::Guard {
            tls: self.certificate.is_some() && self.key.is_some(),
            logins: self.logins.is_some(),
            insecure_lan: self.insecure_lan,
        }
    }
}

impl Params for GatewayParams {
    const FILE: &'static str = include_str!("../../../deploy/params/gateway.toml");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_parameters_are_the_defaults() {
        let shipped: GatewayParams = toml::from_str(GatewayParams::FILE).expect("the shipped file");
        assert_eq!(shipped, GatewayParams::default());
        assert!(shipped.check().is_ok());
    }

    #[test]
    fn a_parameter_out_of_its_range_is_refused_by_name() {
        let check = |text: &str, words: &str| {
            let params: GatewayParams = toml::from_str(text).expect("the right types");
            let refusal = params.check().expect_err(text).to_string();
            assert!(refusal.contains(words), "{refusal:?} names {words:?}");
        };
        check("ports = 101", "ports");
        check("period = 0.0", "period in s");
        check("hold = 5.0", "hold in s");
        check("max_age = 3.0", "max_age");
        check("silence = 60.0", "silence");
        check("grace = -1.0", "grace");
        check("browsers = 0", "browsers");
        check("listen = \"0.0.0.0:8080\"", "login");
        check("login_hours = 0.0", "login_hours");
        check("certificate = \"cert.pem\"", "needs both");
        check("listen = \"0.0.0.0:8080\"\ncertificate = \"c\"\nkey = \"k\"", "axle login add");
    }
}
