//! The page beyond this computer: TLS, a login, sessions that end, and a gateway with a certificate of its own.

use super::{Keys, demo};
use crate::harness::{PATIENCE, Process, World, eventually, within};
use futures_util::{SinkExt as _, StreamExt as _};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, RootCertStore, crypto};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;

const PASSWORD: &str = "correct horse battery";

/// A browser that trusts the authority of some keys.
struct Browser {
    port: u16,
    config: Arc<ClientConfig>,
    cookie: String,
}

impl Browser {
    fn new(authority: &Path, port: u16) -> Self {
        let mut roots = RootCertStore::empty();
        roots.add(CertificateDer::from_pem_file(authority).expect("the authority")).expect("a certificate");
        let provider = Arc::new(crypto::ring::default_provider());
        let config = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .expect("versions of TLS")
            .with_root_certificates(roots)
            .with_no_client_auth();
        Self { port, config: Arc::new(config), cookie: String::new() }
    }
    fn site(&self) -> String {
        format!("https://localhost:{}", self.port)
    }
    async fn link(&self) -> Result<TlsStream<TcpStream>, std::io::Error> {
        self.link_to("localhost").await
    }
    async fn link_to(&self, name: &'static str) -> Result<TlsStream<TcpStream>, std::io::Error> {
        let link = TcpStream::connect(("127.0.0.1", self.port)).await.expect("the gateway listens");
        let name = ServerName::try_from(name).expect("a name");
        TlsConnector::from(Arc::clone(&self.config)).connect(name, link).await
    }
    /// Status, head in small letters, and body of the answer.
    async fn ask(&self, request: &str, headers: &[(&str, &str)], body: &str) -> (u16, String, String) {
        let mut link = self.link().await.expect("TLS");
        let mut text = format!("{request} HTTP/1.1\r\nConnection: close\r\n");
        if !headers.iter().any(|(name, _)| *name == "Host") {
            text.push_str(&format!("Host: localhost:{}\r\n", self.port));
        }
        if !self.cookie.is_empty() {
            text.push_str(&format!("Cookie: other=1; {}\r\n", self.cookie));
        }
        for (name, value) in headers {
            text.push_str(&format!("{name}: {value}\r\n"));
        }
        if !body.is_empty() {
            text.push_str(&format!("Content-Length: {}\r\n", body.len()));
        }
        link.write_all(format!("{text}\r\n{body}").as_bytes()).await.expect("a request");
        let mut bytes = Vec::new();
        // A server that closes without a farewell of TLS has answered all the same.
        drop(within(PATIENCE, "an answer", link.read_to_end(&mut bytes)).await);
        let text = String::from_utf8(bytes).expect("a text");
        let (head, body) = text.split_once("\r\n\r\n").expect("a head");
        let status = head.split(' ').nth(1).and_then(|word| word.parse().ok()).expect("a status");
        (status, head.to_owned(), body.to_owned())
    }
    async fn status(&self, request: &str) -> u16 {
        self.ask(request, &[], "").await.0
    }
    async fn enter(&mut self, name: &str, password: &str) -> (u16, String) {
        let body = json!({ "name": name, "password": password }).to_string();
        let (status, head, _) = self.ask("POST /login", &[("Origin", &self.site())], &body).await;
        let cookie = head.lines().find_map(|line| line.strip_prefix("set-cookie: "));
        let cookie = cookie.unwrap_or_default().to_owned();
        self.cookie = cookie.split(';').next().unwrap_or_default().to_owned();
        (status, cookie)
    }
    /// Opens the live connection with some more headers.
    async fn live(&self, headers: &[(&'static str, String)]) -> Option<Live> {
        let mut request =
            format!("wss://localhost:{}/live", self.port).into_client_request().expect("a request");
        let mut all = vec![("origin", self.site())];
        all.extend((!self.cookie.is_empty()).then(|| ("cookie", self.cookie.clone())));
        all.extend(headers.iter().cloned());
        for (name, value) in all {
            request.headers_mut().insert(name, value.parse().expect("a header"));
        }
        let link = self.link().await.expect("TLS");
        let (socket, _) = tokio_tungstenite::client_async(request, link).await.ok()?;
        let mut live = Live(socket);
        live.say(json!({ "ask": { "hello": {} } })).await;
        live.say(json!({ "ask": { "watch": { "robot": "r1" } } })).await;
        Some(live)
    }
}

struct Live(WebSocketStream<TlsStream<TcpStream>>);

impl Live {
    async fn say(&mut self, word: Value) {
        self.0.send(Message::text(word.to_string())).await.expect("the link is up");
    }
    /// The next word that is wanted; nothing when the connection ends.
    async fn hears(&mut self, what: &str, is_so: impl Fn(&Value) -> bool) -> Option<Value> {
        let right = async {
            loop {
                let Some(Ok(heard)) = self.0.next().await else { return None };
                let Message::Text(text) = heard else { continue };
                let word: Value = serde_json::from_str(&text).expect("JSON");
                if let Some(tick) = word["tick"].as_u64() {
                    // It may have ended meanwhile; then the next word is missing.
                    let echo = json!({ "ask": { "echo": { "tick": tick } } });
                    drop(self.0.send(Message::text(echo.to_string())).await);
                }
                if is_so(&word) {
                    return Some(word);
                }
            }
        };
        within(PATIENCE, what, right).await
    }
    async fn asks(&mut self, ask: Value) -> Value {
        self.say(json!({ "id": 7, "ask": ask })).await;
        self.hears("an answer", |word| word["reply"] == 7).await.expect("the link is up")
    }
}

async fn port_of(process: &Process) -> u16 {
    eventually("the gateway says where the page is", || {
        let said = process.err();
        let (_, address) = said.split_once("the page is at https://")?;
        address.split_whitespace().next()?.rsplit(':').next()?.parse().ok()
    })
    .await
}

/// A person with a password, and a program with a token.
async fn logins(world: &World, keys: &str) -> String {
    let add = world.fed(&["login", "add", "ann", "--keys", keys], &format!("{PASSWORD}\n")).await;
    add.is(0, &["ann may log in"]);
    let program = ["login", "add", "prometheus", "--role", "viewer", "--token", "--keys", keys];
    let token = world.axle(&program).ended().await.is(0, &["prometheus may log in"]).out.trim().to_owned();
    assert_eq!(token.len(), 64, "{token}");
    token
}

/// Outside there is the login, and whether the page is well; by the names of the certificate, over TLS.
async fn shows_the_login_and_no_more(browser: &Browser) {
    let (status, head, body) = browser.ask("GET /", &[], "").await;
    assert!(status == 401 && body.contains("id=\"login\"") && head.contains("default-src 'none'"), "{head}");
    for (request, expected) in [
        ("GET /login.js", 200),
        ("GET /style.css", 200),
        ("GET /main.js", 401),
        ("GET /metrics", 401),
        ("GET /reports", 401),
        ("GET /live", 403),
        ("POST /login", 403),
        ("POST /", 405),
        ("GET /login", 403),
    ] {
        assert_eq!(browser.status(request).await, expected, "{request}");
    }
    for (host, expected) in [("lab.test:1", 401), ("localhost", 401), ("evil.example", 421)] {
        assert_eq!(browser.ask("GET /", &[("Host", host)], "").await.0, expected, "{host}");
    }
    assert!(browser.link_to("lab.test").await.is_ok() && browser.link_to("evil.example").await.is_err());
    assert!(browser.live(&[]).await.is_none(), "nobody is let in without a login");
    let mut plain = TcpStream::connect(("127.0.0.1", browser.port)).await.expect("the gateway listens");
    plain.write_all(b"GET / HTTP/1.1\r\n\r\n").await.expect("plain HTTP");
    let mut said = String::new();
    within(PATIENCE, "an answer", plain.read_to_string(&mut said)).await.expect("a text");
    assert!(said.contains("begin its address with https"), "{said}");
}

/// What is wrong is not let in.
async fn refuses_what_is_wrong(browser: &mut Browser, token: &str) {
    let own = browser.site();
    for (origin, body, expected) in [
        ("https://evil.example", "{}", 403),
        (&*own, "{}", 400),
        (&*own, &*"x".repeat(4000), 413),
        (&*own, "{\"name\":\"<b>\",\"password\":\"x\"}", 401),
    ] {
        assert_eq!(
            browser.ask("POST /login", &[("Origin", origin)], body).await.0,
            expected,
            "{origin} {body}"
        );
    }
    assert_eq!(browser.enter("ann", "correct horse batter").await, (401, String::new()));
    assert_eq!(browser.enter("prometheus", token).await.0, 401, "a token is no password");
    let (status, cookie) = browser.enter("ann", PASSWORD).await;
    assert_eq!(status, 204);
    for part in ["__Host-axle-", "; Path=/", "; HttpOnly", "; SameSite=Strict", "; Secure", "; Max-Age=43200"]
    {
        assert!(cookie.contains(part), "{part} is missing in {cookie}");
    }
}

/// Inside an operator drives, and a viewer looks.
async fn lets_everybody_do_what_they_may(browser: &Browser, program: &Browser, token: &str) {
    let (status, _, body) = browser.ask("GET /", &[], "").await;
    assert!(status == 200 && body.contains("<title>Axle</title>"));
    assert_eq!(browser.status("GET /metrics").await, 200);
    let bearer = format!("Bearer {token}");
    assert_eq!(program.ask("GET /metrics", &[("Authorization", &bearer)], "").await.0, 200);
    assert_eq!(program.ask("GET /metrics", &[("Authorization", "Bearer no")], "").await.0, 401);
    let mut live = browser.live(&[]).await.expect("ann is in");
    let welcome = live.hears("a welcome", |word| word["welcome"].is_object()).await.expect("a welcome");
    assert_eq!(
        (&welcome["welcome"]["name"], &welcome["welcome"]["role"]),
        (&json!("ann"), &json!("operator"))
    );
    // A viewer looks, and moves nothing.
    let mut viewer = program.live(&[("authorization", bearer)]).await.expect("a program is in");
    let go = json!({ "go": { "robot": "r1", "points": [{ "x": 1, "y": 0 }] } });
    let refused = viewer.asks(go.clone()).await.to_string();
    assert!(refused.contains("prometheus may look and stop"), "{refused}");
    let refused = viewer.asks(json!({ "enable": { "robot": "r1" } })).await.to_string();
    assert!(refused.contains("prometheus may look and stop"), "{refused}");
    let stopped = viewer.asks(json!({ "stop": { "robot": "r1" } })).await.to_string();
    assert!(stopped.contains("did not acknowledge"), "everybody may stop; here is no gate: {stopped}");
    let asked = live.asks(go).await.to_string();
    assert!(!asked.contains("may look"), "an operator may; here is no pilot: {asked}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_beyond_this_computer_speaks_tls_and_asks_who_comes() {
    let world = World::new().await;
    world.axle(&["keys", "init", "--keys", "keys"]).ended().await.is(0, &[]);
    let issue = ["keys", "issue", "page@lab", "--address", "lab.test", "--keys", "keys"];
    world.axle(&issue).ended().await.is(0, &["issued page@lab (page)"]);
    let token = logins(&world, "keys").await;
    let _router = world.router();
    let params = world.file(
        "gateway.toml",
        "listen = \"0.0.0.0:0\"\nfoxglove_port = 0\nlogins = \"keys/logins.toml\"\n\
         certificate = \"keys/page@lab/cert.pem\"\nkey = \"keys/page@lab/key.pem\"\n",
    );
    let gateway = world.tool(&["run", "gateway", "--host", "lab", "--params", &params]);
    let port = port_of(&gateway).await;
    let authority = world.path().join("keys/ca.pem");
    let mut browser = Browser::new(&authority, port);
    let mut program = Browser::new(&authority, port);
    shows_the_login_and_no_more(&browser).await;
    refuses_what_is_wrong(&mut browser, &token).await;
    lets_everybody_do_what_they_may(&browser, &program, &token).await;

    let own = browser.site();
    let mut live = browser.live(&[]).await.expect("ann is in");
    // Whoever logs out is out, with everything that was open; and so is who may come in no longer.
    assert_eq!(browser.ask("POST /logout", &[("Origin", &own)], "").await.0, 204);
    assert!(live.hears("the end", |_| false).await.is_none());
    assert_eq!(browser.status("GET /").await, 401);
    assert_eq!(browser.enter("ann", PASSWORD).await.0, 204);
    let mut live = browser.live(&[]).await.expect("ann is in again");
    world.axle(&["login", "remove", "ann", "--keys", "keys"]).ended().await.is(0, &["may log in no longer"]);
    assert!(live.hears("the end", |_| false).await.is_none());
    assert_eq!(browser.status("GET /").await, 401);
    assert_eq!(browser.enter("ann", PASSWORD).await.0, 401);
    // Whoever guesses has to wait, for any name.
    let mut last = 0;
    for _ in 0..12 {
        last = program.enter("bob", "short").await.0;
    }
    assert_eq!(last, 429);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_with_half_of_what_it_needs_is_refused_with_what_to_do() {
    let world = World::new().await;
    world.axle(&["keys", "init", "--keys", "keys"]).ended().await.is(0, &[]);
    world
        .axle(&["keys", "issue", "page@lab", "ann", "--role", "viewer", "--keys", "keys"])
        .ended()
        .await
        .is(0, &[]);
    logins(&world, "keys").await;
    let _router = world.router();
    let far = "listen = \"0.0.0.0:0\"\nfoxglove = false\n";
    let page = |of: &str| format!("certificate = \"keys/{of}/cert.pem\"\nkey = \"keys/{of}/key.pem\"\n");
    let logins = "logins = \"keys/logins.toml\"\n";
    world.file("empty.toml", "");
    std::fs::set_permissions(
        world.path().join("empty.toml"),
        std::os::unix::fs::PermissionsExt::from_mode(0o600),
    )
    .expect("a mode");
    for (text, words) in [
        (format!("{far}{}", page("page@lab")), "axle login add"),
        (format!("{far}{logins}"), "axle keys issue page@HOST"),
        (format!("{far}{logins}{}", page("page@moon")), "axle keys issue page@HOST"),
        (format!("{far}{logins}{}", page("ann")), "it holds no name of a host"),
        (format!("{far}logins = \"none.toml\"\n{}", page("page@lab")), "axle login add NAME` makes it"),
        (format!("{far}logins = \"empty.toml\"\n{}", page("page@lab")), "nobody may log in"),
        (
            format!("{far}{logins}certificate = \"keys/page@lab/cert.pem\"\nkey = \"keys/ann/key.pem\"\n"),
            "it does not fit",
        ),
    ] {
        let params = world.file("far.toml", &text);
        world.tool(&["run", "gateway", "--params", &params]).ended().await.is(2, &[words]);
    }
    world.fed(&["login", "add", "bob", "--keys", "keys"], "short\n").await.is(2, &["10 to 256 bytes"]);
    world.axle(&["login", "add", "b b", "--token", "--keys", "keys"]).ended().await.is(2, &["is no name"]);
    let shown = world.axle(&["login", "show", "--keys", "keys"]).ended().await;
    shown.is(0, &[]);
    assert!(shown.out.contains("ann") && shown.out.contains("token"), "{}", shown.out);
}

#[tokio::test(flavor = "multi_thread")]
async fn in_a_mesh_of_certificates_the_page_shows_and_drives() {
    let world = World::new().await;
    let gateway = "\n[[services]]\nkind = \"gateway\"\nparams = { listen = \"127.0.0.1:0\", foxglove = false, \
                   certificate = \"keys/page@local/cert.pem\", key = \"keys/page@local/key.pem\", logins = \"keys/logins.toml\" }\n";
    let keys = Keys::new(&world, "keys", &format!("{}{gateway}", demo(&world))).await;
    keys.issue(&["page@local"]).await;
    logins(&world, "keys").await;
    let up = world.axle(&["up", &keys.topology, "--keys", keys.name]);
    up.says("processes are alive").await;
    let mut browser = Browser::new(&keys.directory().join("ca.pem"), port_of(&up).await);
    assert_eq!(browser.enter("ann", PASSWORD).await.0, 204);
    let mut live = browser.live(&[]).await.expect("ann is in");
    for stream in ["navigator/pose", "gate/state", "services"] {
        live.hears(stream, |word| word["new"][stream].is_array()).await.expect("it is shown");
    }
    let gone = live.asks(json!({ "go": { "robot": "r1", "points": [{ "x": 0.3, "y": 0 }] } })).await;
    assert!(gone["ok"]["task"].is_u64(), "{gone}");
    let stopped = live.asks(json!({ "stop": { "robot": "r1" } })).await;
    assert!(stopped["ok"]["stop"].is_u64(), "{stopped}");
    let applied = live.asks(json!({ "calibration": { "robot": "r1" } })).await;
    assert!(applied["ok"]["calibration"]["version"].is_u64(), "{applied}");
}
