//! The door and what stands behind it: files of the page, `/login`, `/metrics`, `/healthz`, and `/live`.

use super::entrance::{self, Entered};
use super::{Hall, live, lock, reports, tls};
use axle_gateway::door::{self, Turned, Wants};
use axle_gateway::metrics::{self, Own};
use axle_gateway::{page, words};
use axum::Router;
use axum::body::Body;
use axum::extract::connect_info::Connected;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{ConnectInfo, Extension, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse as _, Response};
use axum::routing::{get, post};
use axum::serve::IncomingStream;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use tokio::net::TcpListener;
use tokio_rustls::TlsAcceptor;

/// A mesh that was seen no longer ago than this is well, in seconds.
const WELL: f64 = 4.0;

/// Who is at the other end of a connection.
#[derive(Clone, Copy, Debug)]
struct Peer(SocketAddr);

impl Connected<IncomingStream<'_, TcpListener>> for Peer {
    fn connect_info(stream: IncomingStream<'_, TcpListener>) -> Self {
        Self(*stream.remote_addr())
    }
}
impl Connected<IncomingStream<'_, tls::Secured>> for Peer {
    fn connect_info(stream: IncomingStream<'_, tls::Secured>) -> Self {
        Self(*stream.remote_addr())
    }
}

/// Serves until it is dropped.
pub(super) async fn serve(
    hall: Arc<Hall>,
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
) -> std::io::Result<()> {
    let app = Router::new()
        .route("/live", get(upgrade))
        .route("/metrics", get(numbers))
        .route("/healthz", get(health))
        .route("/reports", get(reports::list))
        .route("/reports/{directory}/{name}", get(reports::one))
        .route("/login", post(login))
        .route("/logout", post(logout))
        .fallback(file)
        .layer(middleware::from_fn_with_state(Arc::clone(&hall), identify))
        .layer(middleware::from_fn_with_state(Arc::clone(&hall), guard))
        .with_state(hall)
        .into_make_service_with_connect_info::<Peer>();
    match tls {
        Some(acceptor) => axum::serve(tls::Secured::new(listener, acceptor)?, app).await,
        None => axum::serve(listener, app).await,
    }
}

/// What anybody may ask for: whether the page is well, and to log in or out.
const OPEN: [&str; 3] = ["/healthz", "/login", "/logout"];

/// Finds out who asks; whoever is not in gets no further.
async fn identify(State(hall): State<Arc<Hall>>, mut request: Request, next: Next) -> Response {
    match hall.entrance.who(&hall, request.headers()) {
        Some(entered) => {
            request.extensions_mut().insert(entered);
            next.run(request).await
        }
        None if OPEN.contains(&request.uri().path()) => next.run(request).await,
        None => entrance::outside(request.uri().path()),
    }
}

/// Turns away what is not from the page itself, and puts the headers on every answer.
async fn guard(State(hall): State<Arc<Hall>>, request: Request, next: Next) -> Response {
    let text = |headers: &HeaderMap, name: HeaderName| -> Option<String> {
        // Two of them are none: nobody knows which one the browser meant.
        let mut values = headers.get_all(name).iter();
        let value = values.next()?.to_str().ok()?.to_owned();
        values.next().is_none().then_some(value)
    };
    let headers = request.headers();
    let (host, origin) = (text(headers, header::HOST), text(headers, header::ORIGIN));
    let origin = if headers.contains_key(header::ORIGIN) { Some(origin.unwrap_or_default()) } else { None };
    let path = request.uri().path();
    let acts = matches!(path, "/live" | "/login" | "/logout");
    let wants = if acts { Wants::Live } else { Wants::Page };
    let is_read = matches!(*request.method(), Method::GET | Method::HEAD);
    let is_entering = matches!(path, "/login" | "/logout") && *request.method() == Method::POST;
    let mut response = match hall.site.admit(wants, host.as_deref(), origin.as_deref()) {
        Ok(()) if !is_read && !is_entering => {
            plain(StatusCode::METHOD_NOT_ALLOWED, "only GET and HEAD are answered\n")
        }
        Ok(()) => next.run(request).await,
        Err(turned) => {
            hall.counts.turned.fetch_add(1, Relaxed);
            tracing::debug!(?host, ?origin, "turned away: {}", turned.why());
            let status = match turned {
                Turned::Host => StatusCode::MISDIRECTED_REQUEST,
                Turned::Origin => StatusCode::FORBIDDEN,
            };
            plain(status, turned.why())
        }
    };
    for (name, value) in door::HEADERS {
        response.headers_mut().insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    response
}

fn plain(status: StatusCode, text: &'static str) -> Response {
    (status, [(header::CONTENT_TYPE, "text/plain; charset=utf-8")], text).into_response()
}

async fn file(request: Request<Body>) -> Response {
    match page::find(request.uri().path()) {
        Some(file) => ([(header::CONTENT_TYPE, file.kind)], file.text).into_response(),
        None => plain(StatusCode::NOT_FOUND, "there is no such page; the page is at /\n"),
    }
}

async fn login(
    State(hall): State<Arc<Hall>>,
    ConnectInfo(Peer(from)): ConnectInfo<Peer>,
    request: Request,
) -> Response {
    entrance::enter(&hall, from, request).await
}

async fn logout(State(hall): State<Arc<Hall>>, headers: HeaderMap) -> Response {
    entrance::leave(&hall, &headers)
}

async fn upgrade(
    State(hall): State<Arc<Hall>>,
    Extension(entered): Extension<Entered>,
    upgrade: WebSocketUpgrade,
) -> Response {
    upgrade
        .max_message_size(words::MAX_QUESTION)
        .max_frame_size(words::MAX_QUESTION)
        .on_upgrade(move |socket| live::live(hall, entered, socket))
}

async fn numbers(State(hall): State<Arc<Hall>>) -> Response {
    let counts = &hall.counts;
    let own = Own {
        browsers: hall.desk().sessions(),
        sessions: hall.entrance.count(),
        asked: counts.asked.load(Relaxed),
        refused: counts.refused.load(Relaxed),
        turned: counts.turned.load(Relaxed),
        told: counts.told.load(Relaxed),
        dropped: counts.dropped.load(Relaxed),
        missed: counts.missed.load(Relaxed),
    };
    let gates: Vec<_> =
        lock(&hall.gates).iter().map(|(robot, gate)| (robot.to_string(), gate.state.clone())).collect();
    let text = metrics::text(&own, &lock(&hall.processes), &gates);
    ([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], text).into_response()
}

async fn health(State(hall): State<Arc<Hall>>) -> Response {
    let seen = *lock(&hall.looked);
    match seen {
        Some(seen) if (hall.now() - seen).0 <= WELL => plain(StatusCode::OK, "ok\n"),
        _ => plain(StatusCode::SERVICE_UNAVAILABLE, "the router does not answer\n"),
    }
}
