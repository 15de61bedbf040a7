//! `axle top`: the mesh in a terminal: services with their beats and rates, gates, refusals; and keys to stop a robot, to
//! enable it, and to look into a service.

mod board;
mod screen;

use super::stop::{enable_now, stop_now};
use crate::cli::Top;
use crate::out::{data, usage};
use crate::settings::Settings;
use axle_mesh::{Mesh, Tap};
use axle_schema::key::Presence;
use axle_schema::presence::Status;
use axle_schema::{RobotId, key};
use board::Board;
use crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers, poll, read};
use screen::Screen;
use std::io::IsTerminal as _;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};

/// How often services are asked how they are, and how long they have to answer.
const ASK: (Duration, Duration) = (Duration::from_secs(1), Duration::from_millis(700));
/// How often the screen is drawn anew.
const DRAW: Duration = Duration::from_millis(250);
/// Samples that may wait to be counted; older ones are forgotten and counted.
const WAITING: usize = 65_536;

/// Every process that is alive, as the mesh says it.
type Everybody = Vec<(Presence, Option<Status>)>;

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    Up,
    Down,
    Inspect,
    Stop,
    Enable,
    Quit,
}

pub(super) async fn top(settings: &Settings, args: &Top) -> anyhow::Result<()> {
    let has_terminal = std::io::stdin().is_terminal() && std::io::stdout().is_terminal();
    if !args.json && !has_terminal {
        return Err(usage(
            "axle top needs a terminal; programs use `axle top --json`, `axle ps --json` and `axle tap`",
        ));
    }
    let mesh = settings.join("top").await?;
    let tap = mesh.tap(&key::everything(settings.robot.as_ref()), WAITING)?;
    let mut board = Board::new(settings.robot.clone());
    if args.json {
        once(&mesh, &tap, &mut board).await?;
    } else {
        watch(&mesh, &tap, board).await?;
    }
    mesh.leave().await;
    Ok(())
}

/// Looks twice, so that there are rates, and prints what was seen.
async fn once(mesh: &Mesh, tap: &Tap, board: &mut Board) -> anyhow::Result<()> {
    board.hear(mesh.everybody(ASK.1).await?, Instant::now());
    let end = Instant::now() + ASK.0;
    while let Ok(raw) = tokio::time::timeout_at(end, tap.next()).await {
        board.count(&raw);
    }
    board.hear(mesh.everybody(ASK.1).await?, Instant::now());
    Ok(data(&board.json().to_string())?)
}

async fn watch(mesh: &Mesh, tap: &Tap, mut board: Board) -> anyhow::Result<()> {
    let mut stop = crate::signal::stop()?;
    let mut screen = Screen::open()?;
    let mut keys = listen();
    let (news, mut comings) = mpsc::channel(2);
    let asking = tokio::spawn(ask(mesh.clone(), news));
    let (told, mut words) = mpsc::channel(8);
    let mut due = Instant::now();
    loop {
        tokio::select! {
            Some(everybody) = comings.recv() => {
                count(tap, &mut board);
                board.hear(everybody, Instant::now());
            }
            Some(word) = words.recv() => board.say(word),
            () = sleep_until(due) => {
                due = Instant::now() + DRAW;
                count(tap, &mut board);
                screen.draw(&board.lines())?;
            }
            Some(action) = keys.recv() => match action {
                Action::Up => board.select(-1),
                Action::Down => board.select(1),
                Action::Inspect => board.inspect(),
                Action::Quit => break,
                Action::Stop | Action::Enable => match board.robot() {
                    Some(robot) => act(mesh, robot, action, told.clone()),
                    None => board.say("choose a line of a robot first".into()),
                },
            },
            () = stop.wait() => break,
        }
    }
    asking.abort();
    Ok(())
}

/// Counts what has come. Whoever wakes for every message costs the processor more than the messages do.
fn count(tap: &Tap, board: &mut Board) {
    for raw in std::iter::from_fn(|| tap.take()).take(WAITING) {
        board.count(&raw);
    }
}

/// Asks everybody again and again, beside the screen.
async fn ask(mesh: Mesh, news: mpsc::Sender<Everybody>) {
    loop {
        let next = Instant::now() + ASK.0;
        // A mesh that cannot be asked now can be asked later.
        if let Ok(everybody) = mesh.everybody(ASK.1).await
            && news.send(everybody).await.is_err()
        {
            return;
        }
        sleep_until(next).await;
    }
}

/// Stops or enables a robot, beside the screen.
fn act(mesh: &Mesh, robot: RobotId, action: Action, told: mpsc::Sender<String>) {
    let mesh = mesh.clone();
    tokio::spawn(async move {
        let word = if action == Action::Stop {
            match stop_now(&mesh, &robot).await {
                Ok(true) => format!("{robot} is stopped; e enables it again"),
                Ok(false) => format!("{robot} DID NOT ACKNOWLEDGE the stop within 2 s and may still move"),
                Err(fault) => format!("{robot} could not be stopped: {fault:#}"),
            }
        } else {
            match enable_now(&mesh, &robot).await {
                Ok(()) => format!("{robot} may move"),
                Err(fault) => format!("{robot} was not enabled: {fault:#}"),
            }
        };
        drop(told.send(word).await);
    });
}

/// Reads keys on a thread of its own, as long as somebody wants them.
fn listen() -> mpsc::Receiver<Action> {
    let (sender, keys) = mpsc::channel(16);
    std::thread::spawn(move || {
        while !sender.is_closed() {
            if matches!(poll(Duration::from_millis(100)), Ok(true))
                && let Ok(Event::Key(key)) = read()
                && key.kind != KeyEventKind::Release
                && let Some(action) = action(key.code, key.modifiers.contains(KeyModifiers::CONTROL))
                && sender.blocking_send(action).is_err()
            {
                return;
            }
        }
    });
    keys
}

const fn action(key: KeyCode, is_control: bool) -> Option<Action> {
    match key {
        KeyCode::Up | KeyCode::Char('k') => Some(Action::Up),
        KeyCode::Down | KeyCode::Char('j') => Some(Action::Down),
        KeyCode::Enter | KeyCode::Char('i') => Some(Action::Inspect),
        KeyCode::Char('s' | 'x') => Some(Action::Stop),
        KeyCode::Char('e') => Some(Action::Enable),
        KeyCode::Char('q') | KeyCode::Esc => Some(Action::Quit),
        KeyCode::Char('c' | 'd') if is_control => Some(Action::Quit),
        _ => None,
    }
}
