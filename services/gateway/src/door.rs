//! The door: which requests are listened to at all.
//!
//! The page commands robots. On this computer what keeps others out is where it listens, and what the browser itself says
//! of a request: `Host` names the server that the browser believes to talk to, and `Origin` the site whose page asks. Both
//! are set by the browser, and no page can forge them. So a foreign site that is open in another tab is refused
//! (cross-site WebSocket hijacking), and so is one that had its own name resolved to this computer (DNS rebinding).
//! Beyond this computer the page listens only with a certificate, by whose names alone it answers, and with logins.

use axle_schema::Refusal;
use core::net::{IpAddr, SocketAddr};

/// The headers that every answer carries: no script, style or connection but the page's own, and no frame around it.
pub const HEADERS: &[(&str, &str)] = &[
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("permissions-policy", "camera=(), microphone=(), geolocation=()"),
    ("cache-control", "no-cache"),
];

/// What a request asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wants {
    /// Something to read.
    Page,
    /// The connection over which robots are watched and commanded.
    Live,
}

/// Why a request is not listened to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turned {
    /// It is for a server of another name (421).
    Host,
    /// It comes from the page of another site, or does not say from which (403).
    Origin,
}

impl Turned {
    /// What the person at the browser reads.
    #[must_use]
    pub const fn why(self) -> &'static str {
        match self {
            Self::Host => {
                "this page answers at localhost, 127.0.0.1, [::1] and the names of its certificate only; open it by one of \
                 these names"
            }
            Self::Origin => "refused: the request comes from the page of another site",
        }
    }
}

/// What protects a page beyond this computer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guard {
    /// It has a certificate and its key.
    pub tls: bool,
    /// It asks who comes.
    pub logins: bool,
    /// Somebody insists that it needs neither.
    pub insecure_lan: bool,
}

/// Refuses addresses beyond this computer, unless everybody there must log in over TLS, or somebody insists.
///
/// # Errors
/// [`Refusal::OutOfRange`] with what to do.
pub fn check_listen(listen: SocketAddr, guard: Guard) -> Result<(), Refusal> {
    if guard.insecure_lan || (guard.tls && guard.logins) || is_loopback(listen.ip()) {
        return Ok(());
    }
    let limit = "127.0.0.1 or [::1]: beyond this computer the page needs TLS and a login: name certificate and key \
                 (`axle keys issue page@HOST` makes them) and logins (`axle login add NAME`); or reach it from elsewhere \
                 through `ssh -L 8080:127.0.0.1:8080`, or say insecure_lan = true where the network is private to a \
                 container";
    Err(Refusal::out_of_range("listen", listen, limit))
}

fn is_loopback(ip: IpAddr) -> bool {
    match ip {
        IpAddr::V4(ip) => ip.is_loopback(),
        IpAddr::V6(ip) => ip.is_loopback() || ip.to_ipv4_mapped().is_some_and(|ip| ip.is_loopback()),
    }
}

/// The site that a page is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Site {
    scheme: &'static str,
    /// The names of its certificate, beside those that every computer gives itself.
    names: Vec<String>,
}

impl Site {
    /// A page without TLS.
    pub const PLAIN: Self = Self { scheme: "http://", names: Vec::new() };

    /// A page with TLS: the host names and addresses of its certificate, as `robot.local`, `*.lab.example`, `10.0.0.7`,
    /// `fd00::7`.
    #[must_use]
    pub fn secured(names: &[String]) -> Self {
        let bracketed = |name: &String| match name.parse::<IpAddr>() {
            Ok(IpAddr::V6(address)) => format!("[{address}]"),
            _ => name.clone(),
        };
        Self { scheme: "https://", names: names.iter().map(bracketed).collect() }
    }
    /// How its addresses begin: `http://` or `https://`.
    #[must_use]
    pub const fn scheme(&self) -> &'static str {
        self.scheme
    }
    /// Whether it is a page with TLS.
    #[must_use]
    pub fn is_secured(&self) -> bool {
        self.scheme == "https://"
    }
    /// Whether a request is listened to, by its headers `Host` and `Origin`.
    ///
    /// # Errors
    /// [`Turned`] says why not.
    pub fn admit(&self, wants: Wants, host: Option<&str>, origin: Option<&str>) -> Result<(), Turned> {
        let host = host.filter(|host| self.is_own_name(host)).ok_or(Turned::Host)?;
        match origin {
            // A browser opens a WebSocket with its origin always, and reads from its own site without.
            None if wants == Wants::Page => Ok(()),
            None => Err(Turned::Origin),
            Some(origin) => {
                let site = origin.strip_prefix(self.scheme);
                let is_own = site.is_some_and(|site| site.eq_ignore_ascii_case(host));
                if is_own { Ok(()) } else { Err(Turned::Origin) }
            }
        }
    }

    /// Whether `host`, with or without a port, is a name that every computer gives itself, or one of the certificate.
    fn is_own_name(&self, host: &str) -> bool {
        let name = match host.rsplit_once(':') {
            Some((name, port)) if !port.is_empty() && port.bytes().all(|byte| byte.is_ascii_digit()) => name,
            _ => host,
        };
        let is_named = |own: &str| match own.strip_prefix("*.") {
            // A star stands for one part of a name.
            Some(below) => name
                .split_once('.')
                .is_some_and(|(part, rest)| !part.is_empty() && rest.eq_ignore_ascii_case(below)),
            None => name.eq_ignore_ascii_case(own),
        };
        ["localhost", "127.0.0.1", "[::1]"]
            .into_iter()
            .chain(self.names.iter().map(String::as_str))
            .any(is_named)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_of_this_computer_is_let_in() {
        for host in ["localhost:8080", "127.0.0.1:8080", "[::1]:8080", "LocalHost:1", "localhost"] {
            let origin = format!("http://{host}");
            assert_eq!(Site::PLAIN.admit(Wants::Live, Some(host), Some(&origin)), Ok(()), "{host}");
            assert_eq!(Site::PLAIN.admit(Wants::Page, Some(host), None), Ok(()), "{host}");
        }
    }

    #[test]
    fn other_sites_and_other_names_are_turned_away() {
        let host = Some("localhost:8080");
        for origin in [
            "http://evil.example",
            "http://localhost:8081",
            "http://localhost",
            "https://localhost:8080",
            "http://localhost:8080.evil.example",
            "http://evil.example/http://localhost:8080",
            "http://127.0.0.1:8080",
            "null",
            "",
        ] {
            for wants in [Wants::Live, Wants::Page] {
                assert_eq!(Site::PLAIN.admit(wants, host, Some(origin)), Err(Turned::Origin), "{origin}");
            }
        }
        assert_eq!(Site::PLAIN.admit(Wants::Live, host, None), Err(Turned::Origin));
        // A name of the attacker's that leads to this computer.
        for host in
            ["evil.example:8080", "localhost.evil.example", "192.168.1.5:8080", "", ":8080", "[::1]x:1"]
        {
            let origin = format!("http://{host}");
            assert_eq!(
                Site::PLAIN.admit(Wants::Live, Some(host), Some(&origin)),
                Err(Turned::Host),
                "{host}"
            );
            assert_eq!(Site::PLAIN.admit(Wants::Page, Some(host), None), Err(Turned::Host), "{host}");
        }
        assert_eq!(Site::PLAIN.admit(Wants::Page, None, None), Err(Turned::Host));
    }

    #[test]
    fn a_page_with_a_certificate_answers_by_its_names_and_over_tls() {
        let names = ["robot.local", "*.lab.example", "10.0.0.7", "fd00::7"].map(str::to_owned);
        let site = Site::secured(&names);
        for host in [
            "robot.local:8443",
            "Robot.Local",
            "r1.lab.example:1",
            "10.0.0.7:8443",
            "[fd00::7]:8443",
            "localhost:8443",
        ] {
            let origin = format!("https://{host}");
            assert_eq!(site.admit(Wants::Live, Some(host), Some(&origin)), Ok(()), "{host}");
            let plain = format!("http://{host}");
            assert_eq!(site.admit(Wants::Live, Some(host), Some(&plain)), Err(Turned::Origin), "{host}");
        }
        for host in [
            "evil.example",
            "lab.example",
            ".lab.example",
            "a.b.lab.example",
            "robot.local.evil.example",
            "10.0.0.8",
        ] {
            assert_eq!(site.admit(Wants::Page, Some(host), None), Err(Turned::Host), "{host}");
        }
    }

    #[test]
    fn an_address_beyond_this_computer_needs_tls_and_logins_or_somebody_to_insist() {
        let guard = |tls, logins, insecure_lan| Guard { tls, logins, insecure_lan };
        for (listen, is_near) in [
            ("127.0.0.1:8080", true),
            ("127.9.9.9:0", true),
            ("[::1]:8080", true),
            ("[::ffff:127.0.0.1]:80", true),
            ("0.0.0.0:8080", false),
            ("[::]:8080", false),
            ("192.168.1.5:8080", false),
        ] {
            let address: SocketAddr = listen.parse().expect("an address");
            for half in [guard(false, false, false), guard(true, false, false), guard(false, true, false)] {
                assert_eq!(check_listen(address, half).is_ok(), is_near, "{listen} {half:?}");
            }
            for whole in [guard(true, true, false), guard(false, false, true)] {
                assert!(check_listen(address, whole).is_ok());
            }
        }
        let far = SocketAddr::from(([0, 0, 0, 0], 80));
        let text = check_listen(far, guard(true, false, false)).expect_err("far").to_string();
        for words in ["TLS and a login", "ssh -L", "axle login add", "axle keys issue"] {
            assert!(text.contains(words), "{text}");
        }
    }
}
