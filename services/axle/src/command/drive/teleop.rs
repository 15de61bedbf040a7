//! `axle drive teleop`: driving by the keyboard, with a dead man's handle: releasing the key stops.
//!
//! Most terminals do not say that a key was released. There a key counts as held for a moment after it was pressed or
//! repeated. Terminals with the kitty keyboard protocol do say it, and there a key is held until then, or until its
//! repeats stop coming. Whatever happens to this program, the powers that it asks for hold for a moment only.

use super::Client;
use crate::out::{note, usage};
use axle_mesh::random_bits;
use axle_schema::command::{AllStop, Done};
use axle_schema::differential_drive::SetDrivePower;
use axle_schema::{Duty, Refusal, Seconds, Sides, StopId, key};
use crossterm::event::{
    Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, KeyboardEnhancementFlags,
    PopKeyboardEnhancementFlags, PushKeyboardEnhancementFlags, poll, read,
};
use crossterm::{execute, terminal};
use std::io::IsTerminal as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use tokio::sync::mpsc;

/// A key counts as held for so long after its last sign of life, where nobody says that it was released. Shorter than
/// the time that most terminals wait before the first repeat, so that a tap is a short step.
const HELD: Duration = Duration::from_millis(280);
/// The same where releases are said: repeats come sooner than this, unless the link to the terminal is gone.
const HELD_AT_MOST: Duration = Duration::from_millis(1200);
/// Powers are renewed at this pace while a key is held, and hold for so long.
const RENEWED: (Duration, Seconds) = (Duration::from_millis(80), Seconds(0.3));

/// There are no keys without a terminal.
pub(super) fn needs_a_terminal() -> anyhow::Result<()> {
    if std::io::stdin().is_terminal() && std::io::stdout().is_terminal() {
        Ok(())
    } else {
        Err(usage(
            "axle drive teleop needs a terminal; programs use `axle drive power` or the keys of docs/drive.md",
        ))
    }
}

/// The four directions, as places in [`Keys`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Ahead,
    Back,
    Left,
    Right,
}

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    Hold(Direction),
    Release(Direction),
    Halt,
    AllStop,
    Quit,
}

/// What a key means; most mean nothing.
fn action(event: KeyEvent) -> Option<Action> {
    let is_control = event.modifiers.contains(KeyModifiers::CONTROL);
    let direction = match event.code {
        KeyCode::Up | KeyCode::Char('w' | 'W') => Some(Direction::Ahead),
        KeyCode::Down | KeyCode::Char('s' | 'S') => Some(Direction::Back),
        KeyCode::Left | KeyCode::Char('a' | 'A') => Some(Direction::Left),
        KeyCode::Right | KeyCode::Char('d' | 'D') if !is_control => Some(Direction::Right),
        _ => None,
    };
    if let Some(direction) = direction {
        let is_released = event.kind == KeyEventKind::Release;
        return Some(if is_released { Action::Release(direction) } else { Action::Hold(direction) });
    }
    if event.kind == KeyEventKind::Release {
        return None;
    }
    match event.code {
        KeyCode::Esc | KeyCode::Char('q' | 'Q') => Some(Action::Quit),
        KeyCode::Char('c' | 'd') if is_control => Some(Action::Quit),
        KeyCode::Char(' ') => Some(Action::Halt),
        KeyCode::Char('x' | 'X') => Some(Action::AllStop),
        _ => None,
    }
}

/// Which keys are held.
struct Keys {
    /// When each direction gave its last sign of life.
    seen: [Option<Instant>; 4],
    held: Duration,
    power: f64,
}

impl Keys {
    const fn new(power: f64, says_releases: bool) -> Self {
        Self { seen: [None; 4], held: if says_releases { HELD_AT_MOST } else { HELD }, power }
    }
    const fn set(&mut self, direction: Direction, seen: Option<Instant>) {
        self.seen[direction as usize] = seen;
    }
    /// The powers of the wheels at this instant.
    fn powers(&self, now: Instant) -> Sides<f64> {
        let is_held = |direction: Direction| {
            let seen = self.seen[direction as usize];
            f64::from(u8::from(seen.is_some_and(|seen| now.saturating_duration_since(seen) < self.held)))
        };
        let ahead = (is_held(Direction::Ahead) - is_held(Direction::Back)) * self.power;
        let turn = (is_held(Direction::Left) - is_held(Direction::Right)) * self.power / 2.0;
        Sides::new(ahead - turn, ahead + turn).map(|power| power.clamp(-1.0, 1.0))
    }
}

/// The terminal in raw mode, put back however the program ends.
struct Raw {
    says_releases: bool,
}

impl Raw {
    fn enter() -> anyhow::Result<Self> {
        // A terminal that cannot be asked has no such protocol.
        let says_releases = terminal::supports_keyboard_enhancement().unwrap_or(false);
        terminal::enable_raw_mode()?;
        let raw = Self { says_releases };
        if says_releases {
            let flags = KeyboardEnhancementFlags::DISAMBIGUATE_ESCAPE_CODES
                | KeyboardEnhancementFlags::REPORT_EVENT_TYPES;
            execute!(std::io::stdout(), PushKeyboardEnhancementFlags(flags))?;
        }
        Ok(raw)
    }
}

impl Drop for Raw {
    fn drop(&mut self) {
        // A terminal that is gone needs no putting back.
        if self.says_releases {
            drop(execute!(std::io::stdout(), PopKeyboardEnhancementFlags));
        }
        drop(terminal::disable_raw_mode());
    }
}

/// Reads keys on a thread of its own until it is told to end; the end of the queue is the end of the terminal.
fn listen(keys: &mpsc::Sender<KeyEvent>, is_over: &AtomicBool) {
    while !is_over.load(Relaxed) {
        match poll(Duration::from_millis(50)) {
            Ok(false) => {}
            Ok(true) => match read() {
                // A full queue holds keys enough.
                Ok(Event::Key(key)) => drop(keys.try_send(key)),
                Ok(_) => {}
                Err(_) => return,
            },
            Err(_) => return,
        }
    }
}

pub(super) async fn teleop(client: &Client, power: f64) -> anyhow::Result<()> {
    let state = client.state().await?;
    note("arrows or WASD drive; space halts; x is AllStop; Esc ends");
    if !state.enabled {
        note("the drive is disabled; `axle drive enable` enables it");
    }
    let raw = Raw::enter()?;
    let is_over = Arc::new(AtomicBool::new(false));
    let (sender, mut events) = mpsc::channel(64);
    let over = Arc::clone(&is_over);
    let listening = tokio::task::spawn_blocking(move || listen(&sender, &over));
    let driven = steer(client, Keys::new(power, raw.says_releases), &mut events).await;
    is_over.store(true, Relaxed);
    drop(listening.await);
    let halted = client.rest().await;
    drop(raw);
    driven?;
    if let Err(refusal) = halted {
        note(&format!("the drive brakes by itself: {refusal}"));
    }
    Ok(())
}

/// Gives the powers of the keys to the drive until somebody ends it.
async fn steer(client: &Client, mut keys: Keys, events: &mut mpsc::Receiver<KeyEvent>) -> anyhow::Result<()> {
    let mut stop = crate::signal::stop()?;
    let mut pace = tokio::time::interval(RENEWED.0);
    pace.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut last = Sides::new(0.0, 0.0);
    let mut told = None;
    loop {
        let event = tokio::select! {
            biased;
            () = stop.wait() => return Ok(()),
            event = events.recv() => match event {
                Some(event) => action(event),
                None => return Ok(()),
            },
            _ = pace.tick() => None,
        };
        match event {
            Some(Action::Hold(direction)) => keys.set(direction, Some(Instant::now())),
            Some(Action::Release(direction)) => keys.set(direction, None),
            Some(Action::Halt) => keys.seen = [None; 4],
            Some(Action::AllStop) => {
                keys.seen = [None; 4];
                let order = AllStop { id: StopId::from_random(random_bits()), by: client.mesh.name() };
                client.mesh.put_once(&key::STOP.of(&client.robot), &order)?;
                line("AllStop; `axle drive enable` lets the robot move again");
                last = Sides::new(0.0, 0.0);
            }
            Some(Action::Quit) => return Ok(()),
            None => {}
        }
        let powers = keys.powers(Instant::now());
        let rests = powers == Sides::new(0.0, 0.0);
        // While nothing is held nothing is asked; a change is asked for at once.
        if rests && last == powers && event != Some(Action::Halt) {
            continue;
        }
        last = powers;
        let answer = give(client, powers).await;
        if let Err(refusal) = answer
            && told.is_none_or(|at: Instant| at.elapsed() > Duration::from_secs(1))
        {
            told = Some(Instant::now());
            line(&refusal.to_string());
        }
    }
}

async fn give(client: &Client, powers: Sides<f64>) -> Result<(), Refusal> {
    let (left, right) = (Duty::new(powers.left)?, Duty::new(powers.right)?);
    let Done {} =
        client.ask(&key::DRIVE_POWER, &SetDrivePower { left, right, hold: Some(RENEWED.1) }).await?;
    Ok(())
}

/// A line for people in a raw terminal, which does not return to the left by itself.
fn line(text: &str) {
    note(&format!("{text}\r"));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(code: KeyCode) -> KeyEvent {
        KeyEvent::new(code, KeyModifiers::NONE)
    }

    #[test]
    fn a_key_that_is_not_repeated_counts_as_released() {
        let begin = Instant::now();
        let mut keys = Keys::new(0.4, false);
        keys.set(Direction::Ahead, Some(begin));
        assert_eq!(keys.powers(begin + Duration::from_millis(200)), Sides::new(0.4, 0.4));
        assert_eq!(keys.powers(begin + Duration::from_millis(300)), Sides::new(0.0, 0.0));
        keys.set(Direction::Ahead, Some(begin + Duration::from_millis(300)));
        keys.set(Direction::Left, Some(begin + Duration::from_millis(300)));
        let both = keys.powers(begin + Duration::from_millis(310));
        assert!((both.left - 0.2).abs() < 1e-12 && (both.right - 0.6).abs() < 1e-12, "{both:?}");
    }

    #[test]
    fn a_release_that_is_said_stops_at_once_and_a_terminal_that_is_gone_soon() {
        let begin = Instant::now();
        let mut keys = Keys::new(0.4, true);
        keys.set(Direction::Right, Some(begin));
        assert_eq!(keys.powers(begin + Duration::from_secs(1)), Sides::new(0.2, -0.2));
        assert_eq!(keys.powers(begin + Duration::from_secs(2)), Sides::new(0.0, 0.0));
        keys.set(Direction::Right, None);
        assert_eq!(keys.powers(begin), Sides::new(0.0, 0.0));
    }

    #[test]
    fn keys_mean_what_the_help_says() {
        for (code, expected) in [
            (KeyCode::Up, Action::Hold(Direction::Ahead)),
            (KeyCode::Char('s'), Action::Hold(Direction::Back)),
            (KeyCode::Char('A'), Action::Hold(Direction::Left)),
            (KeyCode::Char('d'), Action::Hold(Direction::Right)),
            (KeyCode::Char(' '), Action::Halt),
            (KeyCode::Char('x'), Action::AllStop),
            (KeyCode::Esc, Action::Quit),
        ] {
            assert_eq!(action(press(code)), Some(expected), "{code:?}");
        }
        assert_eq!(action(press(KeyCode::Char('y'))), None);
        let control = |letter| action(KeyEvent::new(KeyCode::Char(letter), KeyModifiers::CONTROL));
        assert_eq!((control('c'), control('d')), (Some(Action::Quit), Some(Action::Quit)));
        let released = KeyEvent::new_with_kind(KeyCode::Up, KeyModifiers::NONE, KeyEventKind::Release);
        assert_eq!(action(released), Some(Action::Release(Direction::Ahead)));
    }
}
