//! The entrance: logging in and out, and who a request is from.
//!
//! Where the gateway has no logins, whoever reaches it from this computer is let in, as the door has decided. Where it has,
//! a browser shows the cookie that it was given for a password, and a program its token. One password at a time is hashed:
//! a flood of tries costs a part of one core, and no robot waits for it.

use super::{Hall, lock};
use crate::logins::{Watched, fingerprint, token};
use axle_gateway::login::{Fingerprint, Guest, Sessions, Tries};
use axle_gateway::{GatewayParams, page};
use axum::body::{Body, to_bytes};
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use serde::Deserialize;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::{Arc, Mutex};
use tokio::sync::Semaphore;

/// The longest question of somebody who is not in yet, in bytes.
const MAX_BODY: usize = 2048;
/// How many may wait for a password to be hashed.
const WAITING: usize = 8;

/// Who may come in, and who is in.
pub(super) struct Entrance {
    logins: Option<Mutex<Watched>>,
    sessions: Mutex<Sessions>,
    tries: Mutex<Tries>,
    /// One at a time is hashed.
    hashing: Semaphore,
    waiting: Semaphore,
    cookie: String,
    attributes: String,
}

/// By what somebody is in.
#[derive(Clone, Debug)]
pub(super) struct Entered {
    pub(super) guest: Guest,
    /// The session, for those who have one: when it ends they are out.
    session: Option<Fingerprint>,
}

/// What a person types.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Form {
    name: String,
    password: String,
}

impl Entrance {
    pub(super) fn new(params: &GatewayParams, port: u16, is_secured: bool) -> anyhow::Result<Self> {
        let logins = params.logins.as_deref().map(Watched::open).transpose()?.map(Mutex::new);
        let lasts = axle_schema::Seconds(params.login_hours * 3600.0);
        // Browsers keep the cookies of a host for all its ports; this one is for the page of this port alone.
        let cookie = if is_secured { format!("__Host-axle-{port}") } else { format!("axle-{port}") };
        let secure = if is_secured { "; Secure" } else { "" };
        Ok(Self {
            logins,
            sessions: Mutex::new(Sessions::new(lasts)),
            tries: Mutex::default(),
            hashing: Semaphore::new(1),
            waiting: Semaphore::new(WAITING),
            cookie,
            attributes: format!("Path=/; HttpOnly; SameSite=Strict{secure}"),
        })
    }
    /// Who asks; nothing for somebody who is not in.
    pub(super) fn who(&self, hall: &Hall, headers: &HeaderMap) -> Option<Entered> {
        if !self.asks() {
            return Some(Entered { guest: Guest::of_this_computer(), session: None });
        }
        if let Some(bearer) = headers.get(header::AUTHORIZATION) {
            let token = bearer.to_str().ok()?.strip_prefix("Bearer ")?.trim();
            return self.by_token(token);
        }
        let id = self.shown(headers)?;
        let guest = lock(&self.sessions).find(hall.now(), &id)?;
        Some(Entered { guest, session: Some(id) })
    }
    /// The program that has this token.
    pub(super) fn by_token(&self, token: &str) -> Option<Entered> {
        let logins = lock(self.logins.as_ref()?);
        let guest = logins.logins.by_token(token)?.guest();
        Some(Entered { guest, session: None })
    }
    /// Whether nobody comes in without a login.
    pub(super) const fn asks(&self) -> bool {
        self.logins.is_some()
    }
    /// Whether somebody who came in is in still; being so is a sign of life of the session.
    pub(super) fn is_in(&self, hall: &Hall, entered: &Entered) -> bool {
        match &entered.session {
            Some(id) => lock(&self.sessions).find(hall.now(), id).is_some(),
            None if entered.guest.name.is_empty() => true,
            // A program is in for as long as it may log in.
            None => self
                .logins
                .as_ref()
                .is_some_and(|logins| lock(logins).logins.find(&entered.guest.name).is_some()),
        }
    }
    /// How many people are logged in.
    pub(super) fn count(&self) -> usize {
        lock(&self.sessions).count()
    }
    /// Reads the logins again if they have changed, and ends the sessions of those who may come in no longer.
    pub(super) fn refresh(&self) {
        let Some(logins) = &self.logins else { return };
        let mut logins = lock(logins);
        match logins.refresh() {
            Ok(false) => {}
            Ok(true) => {
                tracing::info!("the logins have changed: {} may log in", logins.logins.all().len());
                let known: Vec<_> =
                    logins.logins.all().iter().map(|login| (login.guest(), login.fingerprint())).collect();
                drop(logins);
                lock(&self.sessions).keep(|guest, by| {
                    known.iter().any(|(other, print)| other.name == guest.name && print == by)
                });
            }
            Err(fault) => tracing::warn!("the logins cannot be read again, the old ones hold: {fault:#}"),
        }
    }

    fn shown(&self, headers: &HeaderMap) -> Option<Fingerprint> {
        let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut all =
            cookies.flat_map(|value| value.split(';')).filter_map(|part| part.trim().split_once('='));
        let (_, token) = all.find(|(name, _)| *name == self.cookie)?;
        (token.len() == 64).then(|| fingerprint(token.as_bytes()))
    }
    fn set_cookie(&self, token: &str, age: f64) -> Option<HeaderValue> {
        let text = format!("{}={token}; {}; Max-Age={age:.0}", self.cookie, self.attributes);
        HeaderValue::from_str(&text).ok()
    }
}

/// What somebody who is not in is shown: the files of the login, and nothing else.
pub(super) fn outside(path: &str) -> Response {
    let is_document = path == "/";
    match page::outside(path) {
        Some(file) => {
            let status = if is_document { StatusCode::UNAUTHORIZED } else { StatusCode::OK };
            (status, [(header::CONTENT_TYPE, file.kind)], file.text).into_response()
        }
        None => answer(StatusCode::UNAUTHORIZED, "log in first, or show a token: Authorization: Bearer …\n"),
    }
}

/// Logs somebody in.
pub(super) async fn enter(hall: &Arc<Hall>, from: SocketAddr, request: Request) -> Response {
    let Ok(_place) = hall.entrance.waiting.try_acquire() else {
        return late(1.0);
    };
    let bytes = match read(request.into_body()).await {
        Ok(bytes) => bytes,
        Err(answer) => return answer,
    };
    let Ok(Form { name, password }) = serde_json::from_slice::<Form>(&bytes) else {
        return answer(StatusCode::BAD_REQUEST, "write {\"name\": …, \"password\": …}\n");
    };
    if crate::logins::check_name(&name).is_err() {
        return wrong();
    }
    let address = network(from.ip());
    let Ok(_turn) = hall.entrance.hashing.acquire().await else { return late(1.0) };
    let taken = lock(&hall.entrance.tries).take(hall.now(), &address, &name);
    if let Err(wait) = taken {
        tracing::warn!(%from, "too many tries to log in as {name}");
        return late(wait.0);
    }
    let Some(logins) = &hall.entrance.logins else {
        return answer(StatusCode::NOT_FOUND, "nobody needs to log in here\n");
    };
    let logins = lock(logins).logins.clone();
    let known = name.clone();
    let found = tokio::task::spawn_blocking(move || {
        logins.by_password(&known, &password).map(|login| (login.guest(), login.fingerprint()))
    });
    let Ok(Some((guest, by))) = found.await else {
        tracing::warn!(%from, "a wrong name or password for {name}");
        return wrong();
    };
    lock(&hall.entrance.tries).give_back(&address, &name);
    let Ok(token) = token() else {
        return answer(StatusCode::INTERNAL_SERVER_ERROR, "the system has no random numbers\n");
    };
    let id = fingerprint(token.as_bytes());
    lock(&hall.entrance.sessions).open(hall.now(), id, guest, by);
    tracing::info!(%from, "{name} has logged in");
    with_cookie(hall, &token, hall.params.login_hours * 3600.0)
}

/// Logs somebody out.
pub(super) fn leave(hall: &Hall, headers: &HeaderMap) -> Response {
    if let Some(id) = hall.entrance.shown(headers) {
        lock(&hall.entrance.sessions).close(&id);
    }
    with_cookie(hall, "", 0.0)
}

fn with_cookie(hall: &Hall, token: &str, age: f64) -> Response {
    let mut response = StatusCode::NO_CONTENT.into_response();
    if let Some(cookie) = hall.entrance.set_cookie(token, age) {
        response.headers_mut().insert(header::SET_COOKIE, cookie);
    }
    response
}

async fn read(body: Body) -> Result<Vec<u8>, Response> {
    let patience = std::time::Duration::from_secs(5);
    match tokio::time::timeout(patience, to_bytes(body, MAX_BODY)).await {
        Ok(Ok(bytes)) => Ok(bytes.to_vec()),
        _ => {
            Err(answer(StatusCode::PAYLOAD_TOO_LARGE, "a name and a password are shorter, and come sooner\n"))
        }
    }
}

/// A network at home or of a provider gives one computer 2^64 addresses: they count as one.
fn network(ip: IpAddr) -> String {
    match ip.to_canonical() {
        IpAddr::V4(ip) => ip.to_string(),
        IpAddr::V6(ip) => {
            let [a, b, c, d, ..] = ip.segments();
            Ipv6Addr::new(a, b, c, d, 0, 0, 0, 0).to_string()
        }
    }
}

fn wrong() -> Response {
    answer(StatusCode::UNAUTHORIZED, "wrong name or password\n")
}

fn late(wait: f64) -> Response {
    let mut response = answer(StatusCode::TOO_MANY_REQUESTS, "too many tries; wait a little\n");
    if let Ok(seconds) = HeaderValue::from_str(&format!("{:.0}", wait.ceil().max(1.0))) {
        response.headers_mut().insert(header::RETRY_AFTER, seconds);
    }
    response
}

fn answer(status: StatusCode, text: &'static str) -> Response {
    (status, [(header::CONTENT_TYPE, "text/plain; charset=utf-8")], text).into_response()
}
