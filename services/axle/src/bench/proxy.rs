//! The fault proxy: a wire between two ends of a Zenoh link, which can be cut, mended, slowed down and spoilt.
//!
//! Zenoh writes to TCP in messages, each behind its length in two bytes, little end first. The proxy parts them, so that it
//! can lose, double and reorder whole messages, which on the bytes of a stream would only break the link. While a way is cut
//! nothing passes on it, and when it is mended everything that waited passes at once, as TCP does after an outage. Both
//! ways have a weather of their own, and their chances come from a seed.

use axle_emulator::Random;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{mpsc, watch};
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::{Instant, sleep_until};

/// Links through one proxy at a time.
const LINKS: usize = 4;
/// Messages that wait in a way; beyond that the sender has to wait, as on any full link.
const WAITING: usize = 4096;
/// The first messages of a link greet the other end: they come through, or there is no link to be spoilt.
const GREETING: u32 = 8;
/// How much later than its time a message comes that others shall overtake.
const OVERTAKEN: Duration = Duration::from_millis(80);

/// What happens to messages on one way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Weather {
    /// Nothing passes; it waits.
    pub(crate) cut: bool,
    /// Every message comes so much later.
    pub(crate) delay: Duration,
    /// And by chance up to so much later still, in order.
    pub(crate) jitter: Duration,
    /// The share that is lost.
    pub(crate) loss: f64,
    /// The share that comes twice.
    pub(crate) double: f64,
    /// The share that others overtake.
    pub(crate) overtaken: f64,
}

/// The weather of both ways.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Weathers {
    /// From the end that dials to the one that listens.
    pub(crate) out: Weather,
    /// From the end that listens to the one that dials.
    pub(crate) back: Weather,
}

impl Weathers {
    /// The same on both ways.
    pub(crate) const fn both(weather: Weather) -> Self {
        Self { out: weather, back: weather }
    }
}

/// Which way.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    Out,
    Back,
}

impl Way {
    const fn of(self, weathers: &Weathers) -> Weather {
        match self {
            Self::Out => weathers.out,
            Self::Back => weathers.back,
        }
    }
}

/// How the bytes of a link are parted.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bytes {
    /// In the messages of Zenoh.
    Messages,
    /// Not at all, since they are encrypted: they can be cut and slowed down only.
    Sealed,
}

/// A wire with faults.
pub(crate) struct Proxy {
    /// Where to dial, `tcp/127.0.0.1:PORT`.
    pub(crate) endpoint: String,
    weathers: Arc<watch::Sender<Weathers>>,
    carrying: JoinHandle<()>,
}

impl Proxy {
    /// A wire to whoever listens at `endpoint` (`tcp/127.0.0.1:7447`).
    pub(crate) async fn to(endpoint: &str, bytes: Bytes, seed: u64) -> std::io::Result<Self> {
        let address = endpoint.trim_start_matches("tcp/").trim_start_matches("tls/").to_owned();
        let listener = TcpListener::bind("127.0.0.1:0").await?;
        let endpoint = format!("tcp/{}", listener.local_addr()?);
        let weathers = Arc::new(watch::channel(Weathers::default()).0);
        let watched = Arc::clone(&weathers);
        let carrying = tokio::spawn(async move {
            let mut links = JoinSet::new();
            let mut number = 0;
            while let Ok((near, _)) = listener.accept().await {
                while links.try_join_next().is_some() {}
                if links.len() < LINKS {
                    number += 2;
                    links.spawn(carry(near, address.clone(), watched.subscribe(), bytes, (seed, number)));
                }
            }
        });
        Ok(Self { endpoint, weathers, carrying })
    }
    /// Cuts both ways.
    pub(crate) fn cut(&self) {
        self.set(Weathers::both(Weather { cut: true, ..Weather::default() }));
    }
    /// Makes both ways good again.
    pub(crate) fn mend(&self) {
        self.set(Weathers::default());
    }
    /// Makes the weather.
    pub(crate) fn set(&self, weathers: Weathers) {
        self.weathers.send_replace(weathers);
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.carrying.abort();
    }
}

/// Carries one link until either end closes it.
async fn carry(
    near: TcpStream,
    address: String,
    weathers: watch::Receiver<Weathers>,
    bytes: Bytes,
    (seed, number): (u64, u64),
) {
    let Ok(far) = TcpStream::connect(address).await else { return };
    // Bytes pass as they come; whoever would rather wait for more has done so already.
    let _ = (near.set_nodelay(true), far.set_nodelay(true));
    let ((near_out, near_in), (far_out, far_in)) = (near.into_split(), far.into_split());
    let out = Random::new(seed, number);
    let back = Random::new(seed, number + 1);
    tokio::select! {
        () = pass(near_out, far_in, weathers.clone(), (Way::Out, bytes), out) => {}
        () = pass(far_out, near_in, weathers, (Way::Back, bytes), back) => {}
    }
}

/// A message, and when it is due.
type Due = (Instant, Vec<u8>);

async fn pass(
    from: OwnedReadHalf,
    to: OwnedWriteHalf,
    weathers: watch::Receiver<Weathers>,
    (way, bytes): (Way, Bytes),
    random: Random,
) {
    let (sender, due) = mpsc::channel(WAITING);
    let mut fate = Fate { random, latest: Instant::now(), passed: 0 };
    tokio::select! {
        () = take(from, sender, weathers.clone(), (way, bytes), &mut fate) => {}
        () = give(to, due, weathers, way) => {}
    }
}

async fn take(
    mut from: OwnedReadHalf,
    sender: mpsc::Sender<Due>,
    weathers: watch::Receiver<Weathers>,
    (way, bytes): (Way, Bytes),
    fate: &mut Fate,
) {
    while let Ok(message) = read(&mut from, bytes).await {
        let weather = way.of(&weathers.borrow());
        let weather = match bytes {
            Bytes::Messages => weather,
            Bytes::Sealed => Weather { loss: 0.0, double: 0.0, overtaken: 0.0, ..weather },
        };
        for due in fate.of(weather, Instant::now()).into_iter().flatten() {
            if sender.send((due, message.clone())).await.is_err() {
                return;
            }
        }
    }
}

/// The next message with its length, or some bytes.
async fn read(from: &mut OwnedReadHalf, bytes: Bytes) -> std::io::Result<Vec<u8>> {
    if bytes == Bytes::Sealed {
        let mut some = vec![0; 64 * 1024];
        let count = from.read(&mut some).await?;
        some.truncate(count);
        return if count > 0 { Ok(some) } else { Err(std::io::ErrorKind::UnexpectedEof.into()) };
    }
    let mut length = [0; 2];
    from.read_exact(&mut length).await?;
    let mut message = length.to_vec();
    message.resize(2 + usize::from(u16::from_le_bytes(length)), 0);
    from.read_exact(&mut message[2..]).await?;
    Ok(message)
}

/// What becomes of messages, by chance.
struct Fate {
    random: Random,
    latest: Instant,
    passed: u32,
}

impl Fate {
    /// When the message comes out: never, once or twice.
    fn of(&mut self, weather: Weather, now: Instant) -> [Option<Instant>; 2] {
        self.passed = self.passed.saturating_add(1);
        // The same numbers are drawn in every weather, so that one fault does not move the chances of another.
        let [late, lost, doubled, overtaken] = [(); 4].map(|()| self.random.uniform());
        let due = (now + weather.delay + weather.jitter.mul_f64(late)).max(self.latest);
        if self.passed <= GREETING {
            self.latest = due;
            return [Some(due), None];
        }
        if lost <= weather.loss {
            return [None, None];
        }
        let again = (doubled <= weather.double).then_some(due);
        if overtaken <= weather.overtaken {
            // Those that come after it keep their times.
            return [Some(due + OVERTAKEN), again];
        }
        self.latest = due;
        [Some(due), again]
    }
}

async fn give(
    mut to: OwnedWriteHalf,
    mut due: mpsc::Receiver<Due>,
    mut weathers: watch::Receiver<Weathers>,
    way: Way,
) {
    let (mut waiting, mut number) = (BTreeMap::new(), 0_u64);
    loop {
        let is_cut = way.of(&weathers.borrow_and_update()).cut;
        let next = waiting.first_key_value().map(|((at, _), _): (&(Instant, u64), &Vec<u8>)| *at);
        tokio::select! {
            came = due.recv(), if waiting.len() < WAITING => {
                let Some((at, message)) = came else { return };
                number += 1;
                waiting.insert((at, number), message);
            }
            () = sleep_until(next.unwrap_or_else(Instant::now)), if next.is_some() && !is_cut => {
                let Some((_, message)) = waiting.pop_first() else { continue };
                if to.write_all(&message).await.is_err() {
                    return;
                }
            }
            changed = weathers.changed() => {
                if changed.is_err() {
                    return;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A listener behind a proxy, and both ends of a link through it.
    async fn link(bytes: Bytes) -> (Proxy, TcpStream, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let proxy = Proxy::to(&format!("tcp/{address}"), bytes, 7).await.expect("a proxy");
        let near = TcpStream::connect(proxy.endpoint.trim_start_matches("tcp/")).await.expect("a link");
        let (far, _) = listener.accept().await.expect("a link");
        (proxy, near, far)
    }
    async fn say(to: &mut TcpStream, numbers: impl Iterator<Item = u8>) {
        for number in numbers {
            to.write_all(&[1, 0, number]).await.expect("said");
        }
    }
    /// The numbers that come until one is the last.
    async fn heard(from: &mut TcpStream, last: u8) -> Vec<u8> {
        let mut numbers = Vec::new();
        let mut message = [0; 3];
        while numbers.last() != Some(&last) {
            from.read_exact(&mut message).await.expect("a message");
            assert_eq!(message[..2], [1, 0]);
            numbers.push(message[2]);
        }
        numbers
    }
    fn spoilt(weather: Weather) -> Weathers {
        Weathers { out: weather, back: Weather::default() }
    }

    #[tokio::test]
    async fn messages_are_lost_doubled_and_overtaken_whole_and_the_same_for_the_same_seed() {
        let table = [
            Weather { loss: 0.3, ..Weather::default() },
            Weather { double: 0.3, ..Weather::default() },
            Weather { overtaken: 0.3, ..Weather::default() },
        ];
        for (number, weather) in table.into_iter().enumerate() {
            let mut rounds = Vec::new();
            for _ in 0..2 {
                let (proxy, mut near, mut far) = link(Bytes::Messages).await;
                // Whoever was there before the storm has come through.
                say(&mut near, 0..16).await;
                assert_eq!(heard(&mut far, 15).await, (0..16).collect::<Vec<_>>());
                proxy.set(spoilt(weather));
                say(&mut near, 16..200).await;
                // After the storm: what is overtaken still comes before it.
                tokio::time::sleep(OVERTAKEN * 3).await;
                proxy.mend();
                say(&mut near, 255..=255).await;
                rounds.push(heard(&mut far, 255).await);
                // The other way has good weather.
                say(&mut far, 0..30).await;
                assert_eq!(heard(&mut near, 29).await, (0..30).collect::<Vec<_>>());
            }
            assert_eq!(rounds[0].len(), rounds[1].len(), "the same seed");
            let came = &rounds[0][..rounds[0].len() - 1];
            let mut sorted = came.to_vec();
            sorted.sort_unstable();
            let twice = sorted.windows(2).filter(|two| two[0] == two[1]).count();
            sorted.dedup();
            match number {
                0 => assert!((90..175).contains(&came.len()) && sorted == came, "{came:?}"),
                1 => assert!(twice > 20 && sorted.len() == 184, "{came:?}"),
                _ => assert!(sorted != came && came.len() == 184 && twice == 0, "{came:?}"),
            }
        }
    }

    #[tokio::test]
    async fn what_waits_in_a_cut_way_comes_at_once_when_it_is_mended_and_the_other_way_goes_on() {
        for bytes in [Bytes::Messages, Bytes::Sealed] {
            let (proxy, mut near, mut far) = link(bytes).await;
            say(&mut near, 0..10).await;
            heard(&mut far, 9).await;
            proxy.set(spoilt(Weather { cut: true, ..Weather::default() }));
            say(&mut near, 10..20).await;
            say(&mut far, 0..10).await;
            heard(&mut near, 9).await;
            let mut message = [0; 3];
            let reading = far.read_exact(&mut message);
            let nothing = tokio::time::timeout(Duration::from_millis(100), reading).await;
            assert!(nothing.is_err(), "a cut way lets something through");
            proxy.mend();
            assert_eq!(heard(&mut far, 19).await, (10..20).collect::<Vec<_>>());
        }
    }

    #[tokio::test]
    async fn delay_and_jitter_keep_the_order() {
        let (proxy, mut near, mut far) = link(Bytes::Messages).await;
        let (delay, jitter) = (Duration::from_millis(60), Duration::from_millis(40));
        proxy.set(spoilt(Weather { delay, jitter, ..Weather::default() }));
        let began = Instant::now();
        say(&mut near, 0..50).await;
        assert_eq!(heard(&mut far, 49).await, (0..50).collect::<Vec<_>>());
        assert!(began.elapsed() >= delay, "{:?}", began.elapsed());
    }
}
