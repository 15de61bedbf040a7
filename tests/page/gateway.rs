//! The gateway as a process: who gets in, and what a page that is lost stops.

use crate::harness::{Eyes, PATIENCE, Process, World, all_alive, eventually, r1, within};
use axle_schema::key;
use futures_util::{SinkExt as _, StreamExt as _};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;

/// Starts a gateway on a free port, and finds out which.
async fn gateway(world: &World) -> (Process, String) {
    let params = world.file("gateway.toml", "listen = \"127.0.0.1:0\"\n");
    let gateway = world.tool(&["run", "gateway", "--host", "lab", "--params", &params]);
    let site = eventually("the gateway says where the page is", || {
        let said = gateway.err();
        let (_, address) = said.split_once("the page is at http://")?;
        Some(address.split_whitespace().next()?.to_owned())
    })
    .await;
    (gateway, site)
}

/// The answer to a request with these headers: its head and its body.
async fn answer(site: &str, request: &str, headers: &[(&str, &str)]) -> (String, String) {
    let mut link = TcpStream::connect(site).await.expect("the gateway listens");
    let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let text = format!("{request} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n");
    link.write_all(text.as_bytes()).await.expect("a request");
    let mut bytes = Vec::new();
    within(PATIENCE, "an answer", link.read_to_end(&mut bytes)).await.expect("an answer");
    let text = String::from_utf8(bytes).expect("a text");
    let (head, body) = text.split_once("\r\n\r\n").expect("a head");
    (head.to_lowercase(), body.to_owned())
}

/// A page without a browser.
struct Page(WebSocketStream<TcpStream>);

impl Page {
    async fn open(site: &str) -> Self {
        let mut request = format!("ws://{site}/live").into_client_request().expect("a request");
        request.headers_mut().insert("origin", format!("http://{site}").parse().expect("an origin"));
        let link = TcpStream::connect(site).await.expect("the gateway listens");
        let (socket, _) = tokio_tungstenite::client_async(request, link).await.expect("it lets us in");
        let mut page = Self(socket);
        page.say(json!({ "ask": { "hello": {} } })).await;
        page.say(json!({ "ask": { "watch": { "robot": "r1" } } })).await;
        page.hears("a welcome", |word| word["welcome"]["session"].is_u64()).await;
        page
    }
    async fn say(&mut self, word: Value) {
        self.0.send(Message::text(word.to_string())).await.expect("the link is up");
    }
    /// The next word; each is echoed, as a page does.
    async fn next(&mut self) -> Value {
        loop {
            let heard =
                within(PATIENCE, "a word", self.0.next()).await.expect("the link is up").expect("a frame");
            let Message::Text(text) = heard else { continue };
            let word: Value = serde_json::from_str(&text).expect("JSON");
            if let Some(tick) = word["tick"].as_u64() {
                self.say(json!({ "ask": { "echo": { "tick": tick } } })).await;
            }
            return word;
        }
    }
    async fn hears(&mut self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let right = async {
            loop {
                let word = self.next().await;
                if is_so(&word) {
                    return word;
                }
            }
        };
        within(PATIENCE, what, right).await
    }
    /// The newest stamp of the gateway.
    async fn tick(&mut self) -> u64 {
        let word = self.hears("a stamp", |word| word["tick"].is_u64()).await;
        word["tick"].as_u64().expect("a stamp")
    }
    async fn asks(&mut self, ask: Value) -> Value {
        self.say(json!({ "id": 7, "ask": ask })).await;
        self.hears("an answer", |word| word["reply"] == 7).await
    }
    async fn holds(&mut self, power: f64) -> Value {
        let tick = self.tick().await;
        let set = json!({ "left": power, "right": power });
        self.asks(json!({ "power": { "robot": "r1", "set": set, "echo": tick } })).await
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_is_told_the_map_of_the_floor_also_when_the_map_comes_later() {
    let world = World::new().await;
    let _router = world.router();
    let (_gateway, site) = gateway(&world).await;
    let mut page = Page::open(&site).await;
    world.file("hall.pgm", "P2\n2 2\n255\n0 254 254 254\n");
    let yaml = world.file("hall.yaml", "image: hall.pgm\nresolution: 0.5\norigin: [1, 2, 0]\n");
    let params = world.file("map.toml", &format!("file = {yaml:?}\n"));
    let _map = world.tool(&["run", "map", "--host", "lab", "--params", &params]);
    let told = page.hears("the map", |word| word["new"]["map"].is_array()).await;
    let floor = &told["new"]["map"][1];
    assert_eq!(floor["name"], "hall");
    assert_eq!(floor["walls"], json!([[[1.0, 2.5], [1.5, 2.5], [1.5, 3.0], [1.0, 3.0]]]));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_door_lets_the_page_in_and_nobody_else() {
    let world = World::new().await;
    let _router = world.router();
    let (_gateway, site) = gateway(&world).await;
    let own = format!("http://{site}");
    let host = ("Host", &*site);
    let page = answer(&site, "GET /", &[host]).await;
    assert!(page.0.starts_with("http/1.1 200") && page.1.contains("<title>Axle</title>"), "{page:?}");
    for header in ["content-security-policy: default-src 'none'", "x-content-type-options: nosniff"] {
        assert!(page.0.contains(header), "{header} is missing in {}", page.0);
    }
    let evil = ("Origin", "http://evil.example");
    for (request, headers, status) in [
        ("GET /main.js", vec![host], "200"),
        ("GET /metrics", vec![host, ("Origin", &own)], "200"),
        ("GET /../../etc/passwd", vec![host], "404"),
        ("GET /metrics", vec![host, evil], "403"),
        ("GET /live", vec![host, evil], "403"),
        ("GET /live", vec![host], "403"),
        ("GET /", vec![("Host", "evil.example")], "421"),
        ("GET /", vec![host, ("Host", "evil.example")], "4"),
        ("POST /", vec![host], "405"),
        ("DELETE /live", vec![host, ("Origin", &own)], "405"),
    ] {
        let (head, _) = answer(&site, request, &headers).await;
        assert!(head.starts_with(&format!("http/1.1 {status}")), "{request} {headers:?}: {head}");
    }
    let health = eventually_well(&site).await;
    assert_eq!(health, "ok\n");
}

/// Waits until the gateway has seen its mesh.
async fn eventually_well(site: &str) -> String {
    let well = async {
        loop {
            let (head, body) = answer(site, "GET /healthz", &[("Host", site)]).await;
            if head.starts_with("http/1.1 200") {
                return body;
            }
        }
    };
    within(PATIENCE, "the gateway is well", well).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gateway_for_everybody_is_refused_with_what_to_do() {
    let world = World::new().await;
    for listen in ["0.0.0.0:0", "[::]:8080"] {
        let params = world.file("far.toml", &format!("listen = \"{listen}\"\n"));
        let refused = world.axle(&["run", "gateway", "--params", &params]).ended().await;
        refused.is(2, &["listen is out of range", "TLS and a login", "ssh -L"]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_drives_stops_and_is_missed() {
    let world = World::new().await;
    let services = ["emulator", "drive"];
    let _processes = (world.router(), services.map(|name| world.run(name)));
    let (_gateway, site) = gateway(&world).await;
    let mesh = world.join().await;
    all_alive(&mesh, &["emulator", "drive", "gateway"]).await;
    let eyes = Eyes::of(&mesh).await;
    let mut page = Page::open(&site).await;
    let is_enabled = |word: &Value| word["new"]["gate/state"][1]["enabled"] == true;
    page.hears("the gate", is_enabled).await;

    // The stick is held, and then its browser is gone without a word.
    while !page.holds(0.4).await["refusal"].is_null() {}
    let driving = async {
        loop {
            page.holds(0.4).await;
            if eyes.truths().iter().any(|truth| crate::harness::velocity(truth) > 0.1) {
                return;
            }
        }
    };
    within(PATIENCE, "the stick moves the robot", driving).await;
    // Powers that answer a word of long ago move nothing. The first word is that as soon as it is older than `max_age`.
    while page.tick().await <= 600 {}
    let old = json!({ "power": { "robot": "r1", "set": { "left": 1, "right": 1 }, "echo": 0 } });
    let stale = page.asks(old).await;
    assert!(stale["refusal"].as_str().is_some_and(|why| why.contains("the link is slow")), "{stale}");
    drop(page);
    eyes.sees_rest().await;

    let mut page = Page::open(&site).await;
    let stopped = page.asks(json!({ "stop": { "robot": "r1" } })).await;
    let stop = stopped["ok"]["stop"].as_u64().unwrap_or_else(|| panic!("a receipt: {stopped}"));
    let disabled = page.holds(0.4).await;
    assert!(disabled["refusal"].as_str().is_some_and(|why| why.contains("disabled")), "{disabled}");
    for (quoted, is_right) in [(json!(null), false), (json!(stop + 1), false), (json!(stop), true)] {
        let answer = page.asks(json!({ "enable": { "robot": "r1", "stop": quoted } })).await;
        assert_eq!(answer["refusal"].is_null(), is_right, "{answer}");
    }
    // A wrong question is told what is wrong with it.
    let wrong = page.asks(json!({ "go": { "robot": "r1", "points": [] } })).await;
    assert!(wrong["refusal"].as_str().is_some_and(|why| why.contains("a point to visit")), "{wrong}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_is_shown_what_robots_say_and_numbers_are_counted() {
    let world = World::new().await;
    let _processes = (world.router(), ["emulator", "source", "navigator"].map(|name| world.run(name)));
    let (_gateway, site) = gateway(&world).await;
    let mesh = world.join().await;
    all_alive(&mesh, &["emulator", "source", "navigator", "gateway"]).await;
    let poses = mesh.inbox(&key::POSE.of(&r1()), 1).expect("poses");
    within(PATIENCE, "a pose", poses.next()).await;
    let mut page = Page::open(&site).await;
    for stream in ["navigator/pose", "gate/state", "robot/encoders", "emulator/truth"] {
        page.hears(stream, |word| word["new"][stream][1].is_object()).await;
    }
    let services = page
        .hears("services", |word| word["new"]["services"][1].as_array().is_some_and(|all| all.len() >= 4));
    let services = services.await;
    let rows = services["new"]["services"][1].as_array().expect("a list").clone();
    assert!(rows.iter().any(|row| row["service"] == "emulator" && row["robot"] == "r1"), "{rows:?}");
    let (_, numbers) = answer(&site, "GET /metrics", &[("Host", &site)]).await;
    for line in ["axle_up{service=\"emulator\",robot=\"r1\",host=\"lab\"} 1", "axle_gateway_browsers 1"] {
        assert!(numbers.contains(line), "{line} is missing in\n{numbers}");
    }
}
