//! Foxglove's WebSocket: robots live in Foxglove, Lichtblick and what else speaks its protocol, read only.
//!
//! The channels are those of a recording: the derived ones as Foxglove shows them by itself, and beside them every stream
//! that the gateway hears, as JSON, for plots. The latter are decoded only while somebody watches them. It listens at the
//! address of the page, with the same certificate; where the page wants a login, a viewer shows a token in its address.

use super::{Hall, lock, tls};
use axle_gateway::door::Wants;
use axle_gateway::foxglove::{Frame, MAX_WORD, PROTOCOLS, Shelf, Viewer, greeting};
use axle_mesh::{Raw, random_bits};
use axle_recorder::{Derived, Sample};
use axle_schema::key;
use axum::Router;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use axum::routing::get;
use futures_util::{SinkExt as _, StreamExt as _};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::time::{MissedTickBehavior, interval, timeout};
use tokio_rustls::TlsAcceptor;

/// The most viewers at a time.
const VIEWERS: usize = 16;
/// A viewer that takes nothing for so long is gone.
const STUCK: Duration = Duration::from_secs(10);
/// How often a viewer is given what is new.
const PACE: Duration = Duration::from_millis(50);

/// What viewers are shown.
pub(super) struct Show {
    derived: Mutex<Derived>,
    shelf: Mutex<Shelf>,
    places: Arc<Semaphore>,
}

impl Default for Show {
    fn default() -> Self {
        Self { derived: Mutex::default(), shelf: Mutex::default(), places: Arc::new(Semaphore::new(VIEWERS)) }
    }
}

impl Show {
    /// Puts what was said on the shelf.
    pub(super) fn take(&self, raw: &Raw) {
        let sample = Sample {
            key: &raw.key,
            encoding: &raw.encoding,
            payload: &raw.payload,
            attachment: None,
            received: raw.received,
        };
        let derived = lock(&self.derived).of(&sample);
        let mut shelf = lock(&self.shelf);
        for shown in derived {
            shelf.open(&shown.topic, shown.view.name(), || shown.view.schema());
            shelf.put(&shown.topic, raw.received, shown.json.to_string().into());
        }
        let name = raw.encoding.rsplit(';').next().unwrap_or_default();
        let schema = || serde_json::json!({ "type": "object", "title": name }).to_string();
        // Decoding it is for whoever watches.
        if shelf.open(&raw.key, name, schema)
            && let Ok(json) = key::to_json(&raw.key, &raw.encoding, &raw.payload)
        {
            shelf.put(&raw.key, raw.received, json.into());
        }
    }
}

/// Listens beside the page; where the port is taken the page goes on without.
pub(super) async fn bind(page: SocketAddr, port: u16) -> Option<TcpListener> {
    let address = SocketAddr::new(page.ip(), port);
    match TcpListener::bind(address).await {
        Ok(listener) => Some(listener),
        Err(fault) => {
            tracing::warn!("Foxglove cannot watch: {address}: {fault}; choose another foxglove_port");
            None
        }
    }
}

/// Serves viewers until it is dropped.
pub(super) async fn serve(
    hall: Arc<Hall>,
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
) -> std::io::Result<()> {
    let app = Router::new().fallback(get(upgrade)).with_state(hall);
    match tls {
        Some(acceptor) => axum::serve(tls::Secured::new(listener, acceptor)?, app).await,
        None => axum::serve(listener, app).await,
    }
}

/// Whether a viewer is let in: from this computer or by a name of the certificate, from no page of a strange site, and
/// with a token where a login is wanted.
fn admit(hall: &Hall, headers: &HeaderMap, query: &str) -> Result<(), (StatusCode, &'static str)> {
    let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
    let (host, origin) = (text(header::HOST), text(header::ORIGIN));
    // A program is no browser and has no origin; a header that is no text is some other site.
    let origin = if headers.contains_key(header::ORIGIN) { Some(origin.unwrap_or("null")) } else { None };
    let known = |origin: &str| hall.params.foxglove_origins.iter().any(|known| known == origin);
    if let Err(turned) = hall.site.admit(Wants::Page, host, origin.filter(|origin| !known(origin))) {
        hall.counts.turned.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        tracing::debug!(?host, ?origin, "turned away from Foxglove's door: {}", turned.why());
        return Err((StatusCode::FORBIDDEN, "refused; foxglove_origins lists the sites that may watch\n"));
    }
    if hall.entrance.asks() {
        let token = query.split('&').find_map(|part| part.strip_prefix("token="));
        if token.and_then(|token| hall.entrance.by_token(token)).is_none() {
            let why = "add ?token=… to the address; `axle login add NAME --role viewer --token` makes one\n";
            return Err((StatusCode::UNAUTHORIZED, why));
        }
    }
    Ok(())
}

async fn upgrade(
    State(hall): State<Arc<Hall>>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
    request: Request,
) -> Response {
    let query = request.uri().query().unwrap_or_default();
    if let Err((status, why)) = admit(&hall, request.headers(), query) {
        return (status, why).into_response();
    }
    let Ok(upgrade) = upgrade else {
        let why = "open this address in Foxglove or Lichtblick, as a Foxglove WebSocket\n";
        return (StatusCode::UPGRADE_REQUIRED, why).into_response();
    };
    let Ok(place) = Arc::clone(&hall.show.places).try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many viewers\n").into_response();
    };
    let upgrade = upgrade.protocols(PROTOCOLS).max_message_size(MAX_WORD).max_frame_size(MAX_WORD);
    if upgrade.selected_protocol().is_none() {
        return (StatusCode::BAD_REQUEST, "this address speaks foxglove.websocket.v1\n").into_response();
    }
    upgrade.on_upgrade(move |socket| async move {
        let mut viewer = Viewer::default();
        watch(&hall, &mut viewer, socket).await;
        viewer.leave(&mut lock(&hall.show.shelf));
        drop(place);
    })
}

/// Shows a viewer what it asks for until it goes, or takes nothing more.
async fn watch(hall: &Hall, viewer: &mut Viewer, socket: WebSocket) {
    let (mut sink, mut stream) = socket.split();
    let mut pace = interval(PACE);
    pace.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut next = vec![greeting(env!("CARGO_PKG_VERSION"), random_bits())];
    loop {
        for frame in next {
            let message = match frame {
                Frame::Text(text) => Message::text(text),
                Frame::Binary(bytes) => Message::binary(bytes),
            };
            if !matches!(timeout(STUCK, sink.send(message)).await, Ok(Ok(()))) {
                return;
            }
        }
        tokio::select! {
            heard = stream.next() => match heard {
                Some(Ok(Message::Text(text))) => viewer.hear(&mut lock(&hall.show.shelf), &text),
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                // What is published here is not taken.
                Some(Ok(_)) => {}
            },
            _ = pace.tick() => {}
        }
        next = viewer.next(&lock(&hall.show.shelf));
    }
}
