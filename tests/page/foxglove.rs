//! Foxglove's protocol, as a viewer hears it.

use crate::harness::{PATIENCE, Process, Robot, eventually, within};
use futures_util::{SinkExt as _, StreamExt as _};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use tokio::net::TcpStream;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;

struct Viewer(WebSocketStream<TcpStream>);

impl Viewer {
    async fn open(site: &str, protocol: Option<&str>, origin: Option<&str>) -> Result<Self, String> {
        let mut request = format!("ws://{site}/").into_client_request().expect("a request");
        for (name, value) in [("sec-websocket-protocol", protocol), ("origin", origin)] {
            if let Some(value) = value {
                request.headers_mut().insert(name, value.parse().expect("a header"));
            }
        }
        let link = TcpStream::connect(site).await.expect("the gateway listens");
        match tokio_tungstenite::client_async(request, link).await {
            Ok((socket, _)) => Ok(Self(socket)),
            Err(fault) => Err(fault.to_string()),
        }
    }
    async fn next(&mut self) -> Message {
        within(PATIENCE, "a frame", self.0.next()).await.expect("the link is up").expect("a frame")
    }
    async fn text(&mut self) -> Value {
        loop {
            if let Message::Text(text) = self.next().await {
                return serde_json::from_str(&text).expect("JSON");
            }
        }
    }
    /// Subscription, time in nanoseconds, and message.
    async fn message(&mut self) -> (u32, u64, Value) {
        loop {
            if let Message::Binary(bytes) = self.next().await {
                assert_eq!(bytes[0], 1);
                let id = u32::from_le_bytes(bytes[1..5].try_into().expect("four"));
                let at = u64::from_le_bytes(bytes[5..13].try_into().expect("eight"));
                return (id, at, serde_json::from_slice(&bytes[13..]).expect("JSON"));
            }
        }
    }
    async fn say(&mut self, word: Value) {
        self.0.send(Message::text(word.to_string())).await.expect("the link is up");
    }
}

async fn site(process: &Process) -> String {
    eventually("the gateway says where Foxglove watches", || {
        let said = process.err();
        let (_, address) = said.split_once("Foxglove watches at ws://")?;
        Some(address.split_whitespace().next()?.to_owned())
    })
    .await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_viewer_sees_the_channels_of_a_recording_live() {
    let robot = Robot::new().await;
    let params = robot.world.file("gateway.toml", "listen = \"127.0.0.1:0\"\nfoxglove_port = 0\n");
    let gateway = robot.world.tool(&["run", "gateway", "--host", "lab", "--params", &params]);
    let site = site(&gateway).await;
    let mut viewer = Viewer::open(&site, Some("foxglove.websocket.v1"), Some("https://app.foxglove.dev"))
        .await
        .expect("Foxglove is let in");
    assert_eq!(viewer.text().await["op"], "serverInfo");
    let mut channels: BTreeMap<String, Value> = BTreeMap::new();
    while !["/r1/pose", "/tf", "/r1/pose-body", "axle/r1/robot/encoders"]
        .iter()
        .all(|name| channels.contains_key(*name))
    {
        let word = viewer.text().await;
        for channel in word["channels"].as_array().into_iter().flatten() {
            channels.insert(channel["topic"].as_str().expect("a topic").to_owned(), channel.clone());
        }
    }
    let pose = &channels["/r1/pose"];
    assert_eq!(pose["schemaName"], "foxglove.PoseInFrame");
    assert_eq!((&pose["encoding"], &pose["schemaEncoding"]), (&json!("json"), &json!("jsonschema")));
    let schema: Value = serde_json::from_str(pose["schema"].as_str().expect("a schema")).expect("JSON");
    let id = |topic: &str| channels[topic]["id"].clone();
    // The body of the robot was shown once, before anybody subscribed: it comes all the same.
    viewer
        .say(json!({ "op": "subscribe", "subscriptions": [
            { "id": 1, "channelId": id("/r1/pose") },
            { "id": 2, "channelId": id("/r1/pose-body") },
            { "id": 3, "channelId": id("axle/r1/robot/encoders") },
        ] }))
        .await;
    let mut heard: BTreeMap<u32, Vec<(u64, Value)>> = BTreeMap::new();
    while heard.get(&1).map_or(0, Vec::len) < 5
        || heard.get(&3).map_or(0, Vec::len) < 5
        || !heard.contains_key(&2)
    {
        let (id, at, value) = viewer.message().await;
        heard.entry(id).or_default().push((at, value));
    }
    let wanted: Vec<_> = schema["properties"].as_object().expect("fields").keys().collect();
    for (at, value) in &heard[&1] {
        assert_eq!(value.as_object().expect("an object").keys().collect::<Vec<_>>(), wanted);
        let (sec, nsec) = (&value["timestamp"]["sec"], &value["timestamp"]["nsec"]);
        assert_eq!(sec.as_u64().zip(nsec.as_u64()).map(|(s, n)| s * 1_000_000_000 + n), Some(*at));
    }
    assert!(heard[&1].windows(2).all(|two| two[0].0 < two[1].0), "in the order of time");
    assert_eq!(heard[&2][0].1["entities"][0]["frame_id"], "r1");
    assert!(heard[&3][0].1["left"].is_number(), "{}", heard[&3][0].1);
    // Nothing can be said here.
    viewer.say(json!({ "op": "advertise", "channels": [] })).await;
    while viewer.text().await["message"].as_str().is_none_or(|text| !text.contains("only shows")) {}

    for (protocol, origin, words) in [
        (Some("foxglove.sdk.v1"), Some("https://evil.example"), "403"),
        (Some("foxglove.sdk.v1"), Some("null"), "403"),
        (None, None, "400"),
    ] {
        let refused = Viewer::open(&site, protocol, origin).await.err().expect("it is not let in");
        assert!(refused.contains(words), "{protocol:?} {origin:?}: {refused}");
    }
    // Programs are no browsers.
    assert!(Viewer::open(&site, Some("foxglove.sdk.v1"), None).await.is_ok());
}
