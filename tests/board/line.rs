//! A robot on a serial line: the emulated board, the bridge that drives it, and what both say.

use crate::harness::{PATIENCE, Process, World, all_alive, declared, driven, r1, within};
use axle_mesh::{Inbox, Mesh};
use axle_schema::board::{BoardState, LinkState};
use axle_schema::command::GateState;
use axle_schema::{EncodersData, NavigatorData, key};
use std::path::PathBuf;

/// A robot whose gate and drive are ready, with its emulated board at the other end of the line.
pub(super) struct Line {
    pub(super) kind: &'static str,
    pub(super) port: PathBuf,
    pub(super) board: Process,
    pub(super) robot: Process,
    pub(super) boards: Inbox<BoardState>,
    pub(super) states: Inbox<GateState>,
    pub(super) encoders: Inbox<EncodersData>,
    pub(super) truth: Inbox<NavigatorData>,
    pub(super) mesh: Mesh,
    _router: Process,
    _drive: Process,
    pub(super) world: World,
}

/// Starts the emulated board.
pub(super) fn board(world: &World, kind: &str, port: &str, params: &[&str]) -> Process {
    world.tool(&[&["run", "emulator", "--host", "lab", "--board", kind, "--port", port], params].concat())
}

/// Starts the bridge to it.
pub(super) fn robot(world: &World, kind: &str, port: &str, params: &[&str]) -> Process {
    world.tool(&[&["run", "robot", "--host", "lab", "--board", kind, "--port", port], params].concat())
}

impl Line {
    pub(super) async fn new(kind: &'static str) -> Self {
        Self::with(kind, "", "").await
    }
    /// The same with parameters of the emulator and of the robot.
    pub(super) async fn with(kind: &'static str, emulator: &str, params: &str) -> Self {
        let world = World::new().await;
        let router = world.router();
        let port = world.path().join("board");
        let shown = port.display().to_string();
        let emulator = world.file("emulator.toml", emulator);
        let params = world.file("robot.toml", params);
        let mesh = world.join().await;
        let of = r1();
        let boards = mesh.inbox(&key::BOARD.of(&of), 256).expect("states of the board");
        let states = mesh.inbox(&key::GATE_STATE.of(&of), 256).expect("states of the gate");
        let encoders = mesh.inbox(&key::ENCODERS.of(&of), 4096).expect("distances");
        let truth = mesh.inbox(&key::TRUTH.of(&of), 4096).expect("truth");
        declared(&mesh).await;
        let board = board(&world, kind, &shown, &["--params", &emulator]);
        let robot = robot(&world, kind, &shown, &["--params", &params]);
        let drive = world.run("drive");
        all_alive(&mesh, &["emulator", "robot", "drive"]).await;
        Self {
            kind,
            port,
            board,
            robot,
            boards,
            states,
            encoders,
            truth,
            mesh,
            _router: router,
            _drive: drive,
            world,
        }
    }
    /// Waits until the board says so.
    pub(super) async fn board_says(&self, what: &str, is_so: impl Fn(&BoardState) -> bool) -> BoardState {
        let heard = async {
            loop {
                let state = self.boards.next().await.message;
                if is_so(&state) {
                    return state;
                }
            }
        };
        within(PATIENCE, &format!("{}: {what}", self.kind), heard).await
    }
    pub(super) async fn gate_says(&self, what: &str, is_so: impl Fn(&GateState) -> bool) {
        let heard = async { while !is_so(&self.states.next().await.message) {} };
        within(PATIENCE, &format!("{}: {what}", self.kind), heard).await;
    }
    /// Waits until the board is there and says something new.
    pub(super) async fn is_up(&self) -> BoardState {
        while self.boards.take().is_some() {}
        self.board_says("the board is up", |state| state.link == LinkState::Up).await
    }
    /// Lets the wheels move.
    pub(super) async fn enable(&self) {
        self.world.done(&["enable"]).await.is(0, &[]);
    }
    /// Drives ahead by the encoders of the board.
    pub(super) async fn drives(&self, distance: &str) {
        let done = driven(|| self.world.tool(&["drive", "distance", distance, "--power", "0.3"])).await;
        done.is(0, &["completed"]);
    }
    /// The newest truth.
    pub(super) async fn stands_at(&self) -> f64 {
        while self.truth.take().is_some() {}
        within(PATIENCE, "a truth", self.truth.next()).await.message.pose.x.0
    }
}
