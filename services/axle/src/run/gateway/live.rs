//! The live connection of one page: it reads questions, and tells what is new at the pace at which the page reads.
//!
//! Reading and telling go on beside each other, so that a page which reads nothing can still stop its robot. When either
//! ends the connection ends, and the desk is told.

use super::entrance::Entered;
use super::stick::Order;
use super::{Hall, deeds, lock};
use axle_gateway::board::Reader;
use axle_gateway::desk::SessionId;
use axle_gateway::flight::Flight;
use axle_gateway::words::{self, Ask, Question};
use axle_mesh::random_bits;
use axle_schema::{Refusal, RobotId};
use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt as _, StreamExt as _};
use serde_json::json;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::{Semaphore, mpsc};
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};

/// A page says its first word within this time.
const FIRST: Duration = Duration::from_secs(5);
/// A page that takes nothing for so long is gone.
const STUCK: Duration = Duration::from_secs(5);
/// Where nothing is new something is said all the same, so that the page can echo it.
const KEEPALIVE: Duration = Duration::from_millis(150);
/// The most questions of one page that may wait for an answer, and answers that may wait for the page.
const QUESTIONS: usize = 8;
const ANSWERS: usize = 64;
/// Stops that may wait for their gates, beside all other questions.
const STOPS: usize = 4;
/// The most questions a second.
const PACE: u32 = 200;

/// What the two halves of a connection share.
pub(super) struct Page {
    pub(super) session: SessionId,
    /// Who sits before it.
    entered: Entered,
    robot: Mutex<Option<RobotId>>,
    flight: Mutex<Flight>,
    /// Grows when the page turns to another robot: it is then told everything anew.
    turns: AtomicU32,
}

/// Talks to a page until one of both goes.
pub(super) async fn live(hall: Arc<Hall>, entered: Entered, socket: WebSocket) {
    let (mut sink, mut stream) = socket.split();
    let session = match timeout(FIRST, first(&hall, &entered, &mut stream)).await {
        Ok(Ok(session)) => session,
        Ok(Err(refusal)) => {
            let text = words::answer(None, &Err(refusal)).unwrap_or_default();
            // It is turned away; whether it hears why is its own affair.
            drop(timeout(STUCK, sink.send(Message::text(text))).await);
            return;
        }
        Err(_) => return,
    };
    let page = Arc::new(Page {
        session,
        entered,
        robot: Mutex::new(hall.only.clone()),
        flight: Mutex::default(),
        turns: AtomicU32::new(0),
    });
    let (answers, answered) = mpsc::channel(ANSWERS);
    let guest = &page.entered.guest;
    let welcome = json!({ "welcome": {
        "session": session.0, "version": env!("CARGO_PKG_VERSION"), "name": guest.name, "role": guest.role,
    } });
    // The queue is empty.
    drop(answers.try_send(welcome.to_string()));
    tokio::select! {
        () = read(&hall, &page, stream, answers) => {}
        () = tell(&hall, &page, sink, answered) => {}
    }
    let outs = hall.desk().leave(hall.now(), session);
    hall.act(outs);
}

/// The first word of a page: who it was before.
async fn first(
    hall: &Hall,
    entered: &Entered,
    stream: &mut SplitStream<WebSocket>,
) -> Result<SessionId, Refusal> {
    let missing = || Refusal::missing("hello", "it is the first word of a page");
    let Some(Ok(Message::Text(text))) = stream.next().await else { return Err(missing()) };
    let Question { ask: Ask::Hello { session }, .. } = Question::read(&text)? else { return Err(missing()) };
    let name = Some(&*entered.guest.name).filter(|name| !name.is_empty()).unwrap_or("another page");
    hall.desk().arrive(hall.now(), session.map(SessionId), random_bits(), name)
}

/// Reads questions until the page goes.
async fn read(
    hall: &Arc<Hall>,
    page: &Arc<Page>,
    mut stream: SplitStream<WebSocket>,
    answers: mpsc::Sender<String>,
) {
    let (open, stops) = (Arc::new(Semaphore::new(QUESTIONS)), Arc::new(Semaphore::new(STOPS)));
    let mut pace = Pace::new();
    while let Some(Ok(message)) = stream.next().await {
        let text = match message {
            Message::Text(text) => text,
            Message::Close(_) => return,
            // What is no text is no question; pings are answered below.
            Message::Binary(_) | Message::Ping(_) | Message::Pong(_) => continue,
        };
        hall.counts.asked.fetch_add(1, Relaxed);
        let refuse = |id, refusal: Refusal| {
            hall.counts.refused.fetch_add(1, Relaxed);
            if let Some(answer) = words::answer(id, &Err(refusal)) {
                // A page that does not read its answers has no need of more.
                drop(answers.try_send(answer));
            }
        };
        let Question { id, ask } = match Question::read(&text) {
            Ok(question) => question,
            Err(refusal) => {
                refuse(Question::number(&text), refusal);
                continue;
            }
        };
        hall.desk().hear(hall.now(), page.session);
        let is_stop = matches!(ask, Ask::Stop { .. } | Ask::StopDrive { .. });
        if !is_stop && !pace.allows() {
            refuse(id, Refusal::Busy { holder: format!("more than {PACE} questions a second: this page") });
            continue;
        }
        if note(hall, page, &ask) {
            continue;
        }
        if let Some(Err(refusal)) = ask.moves().map(|robot| page.entered.guest.may_move(robot)) {
            refuse(id, refusal);
            continue;
        }
        let places = if is_stop { &stops } else { &open };
        let Ok(place) = Arc::clone(places).try_acquire_owned() else {
            refuse(id, Refusal::Busy { holder: "what this page asked before".into() });
            continue;
        };
        // The stick moves in the order of the words; only the answer is waited for elsewhere.
        let steered = match &ask {
            Ask::Power { robot, set, echo } => {
                Some(deeds::steer(hall, page.session, robot, *echo, Order::Power(*set)))
            }
            Ask::Speed { robot, set, echo } => {
                Some(deeds::steer(hall, page.session, robot, *echo, Order::Speed(*set)))
            }
            _ => None,
        };
        let (hall, page, answers) = (Arc::clone(hall), Arc::clone(page), answers.clone());
        tokio::spawn(async move {
            let outcome = match steered {
                Some(Ok(answer)) => answer.await.unwrap_or(Ok(())).map(|()| json!(null)),
                Some(Err(refusal)) => Err(refusal),
                None => deeds::perform(&hall, &page, ask).await,
            };
            if outcome.is_err() {
                hall.counts.refused.fetch_add(1, Relaxed);
            }
            if let Some(answer) = words::answer(id, &outcome) {
                drop(answers.try_send(answer));
            }
            drop(place);
        });
    }
}

/// Takes words that need no answer; says whether this was one.
fn note(hall: &Arc<Hall>, page: &Page, ask: &Ask) -> bool {
    match ask {
        Ask::Echo { tick } => lock(&page.flight).land(*tick),
        Ask::Watch { robot } => {
            *lock(&page.robot) = Some(robot.clone());
            page.turns.fetch_add(1, Relaxed);
        }
        Ask::Release {} => {
            let outs = hall.desk().release(page.session);
            hall.act(outs);
        }
        Ask::Hide {} => {
            let outs = hall.desk().hide(page.session);
            hall.act(outs);
        }
        _ => return false,
    }
    true
}

/// So many questions a second.
struct Pace {
    since: Instant,
    count: u32,
}

impl Pace {
    fn new() -> Self {
        Self { since: Instant::now(), count: 0 }
    }
    fn allows(&mut self) -> bool {
        if self.since.elapsed() >= Duration::from_secs(1) {
            *self = Self::new();
        }
        self.count += 1;
        self.count <= PACE
    }
}

/// Tells the page answers, and what is new, until it goes or is given up as lost.
async fn tell(
    hall: &Hall,
    page: &Page,
    mut sink: SplitSink<WebSocket, Message>,
    mut answered: mpsc::Receiver<String>,
) {
    let mut pace = interval(Duration::from_secs_f64(hall.params.period.0));
    pace.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut told = Telling { reader: hall.board().reader(), turn: 0, last: Instant::now() };
    loop {
        let text = tokio::select! {
            biased;
            Some(answer) = answered.recv() => Some(answer),
            _ = pace.tick() => {
                // Lost, logged out, or no longer let in: what it drove rests.
                if !hall.desk().knows(page.session) || !hall.entrance.is_in(hall, &page.entered) {
                    return;
                }
                told.next(hall, page)
            }
        };
        let Some(text) = text else { continue };
        if !matches!(timeout(STUCK, sink.send(Message::text(text))).await, Ok(Ok(()))) {
            return;
        }
        hall.counts.told.fetch_add(1, Relaxed);
    }
}

/// What a page has been told.
struct Telling {
    reader: Reader,
    turn: u32,
    last: Instant,
}

impl Telling {
    /// The next word, if there is one and the page has read what it was told.
    fn next(&mut self, hall: &Hall, page: &Page) -> Option<String> {
        if !lock(&page.flight).has_room() {
            return None;
        }
        let turn = page.turns.load(Relaxed);
        if turn != self.turn {
            self.turn = turn;
            self.reader = hall.board().reader();
        }
        let robot = lock(&page.robot).clone();
        let now = hall.now();
        let name = robot.as_ref().map_or("", RobotId::as_str);
        let news = hall.board().news(now, &mut self.reader, name);
        if news.is_empty() && self.last.elapsed() < KEEPALIVE {
            return None;
        }
        hall.counts.missed.fetch_add(news.lost, Relaxed);
        let holder = robot.as_ref().and_then(|robot| hall.desk().hand(robot));
        let hand = holder.map(|holder| if holder == page.session { "you" } else { "other" });
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "milliseconds since the start"
        )]
        let tick = (now.0 * 1e3) as u64;
        self.last = Instant::now();
        lock(&page.flight).send(tick);
        Some(words::tell(tick, name, hand, &news))
    }
}
