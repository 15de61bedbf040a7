//! Driving by the keyboard, through a terminal that the test plays.

use super::contract::Contract;
use crate::harness::eventually;
use axle_schema::differential_drive::DriveState;
use nix::pty::openpty;
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::process::{Child, Command, Stdio};

/// `axle drive teleop` in a terminal; killed when the test ends.
struct Terminal {
    child: Child,
    keyboard: File,
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // What has ended already is what is wanted.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

impl Terminal {
    fn new(endpoint: &str) -> Self {
        let pty = openpty(None, None).expect("a terminal");
        let side = || Stdio::from(pty.slave.try_clone().expect("its other side"));
        let child = Command::new(env!("CARGO_BIN_EXE_axle"))
            .args(["drive", "teleop", "--power", "0.5", "--robot", "r1", "--connect", endpoint])
            .stdin(side())
            .stdout(side())
            .stderr(side())
            .spawn()
            .expect("the program");
        let keyboard = File::from(pty.master.try_clone().expect("a terminal"));
        let mut screen = File::from(pty.master);
        // A terminal that nobody reads would hold the program up. It answers the question what it is, as all do.
        let mut answers = keyboard.try_clone().expect("a terminal");
        std::thread::spawn(move || {
            let mut bytes = [0; 1024];
            while let Ok(count) = screen.read(&mut bytes) {
                if bytes[..count].windows(3).any(|window| window == b"\x1b[c") {
                    answers.write_all(b"\x1b[?62c").expect("an answer");
                }
            }
        });
        Self { child, keyboard }
    }
    fn press(&mut self, key: &[u8]) {
        self.keyboard.write_all(key).expect("a key");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_drives_and_letting_go_of_it_stops() {
    let contract = Contract::new().await;
    let mut terminal = Terminal::new(&contract.world.endpoint);
    // Keys that come before the program listens wait in the terminal.
    terminal.press(b"\x1b[A");
    contract.eyes.sees_speed(0.1).await;
    contract.eyes.sees_rest().await;
    // On the spot to the left: the right wheel goes ahead.
    terminal.press(b"a");
    let is_turning = |state: &DriveState| {
        let powers = state.wheels.map(|wheel| wheel.power.get());
        powers.left < -0.05 && powers.right > 0.05
    };
    contract.hears("it turns to the left", is_turning).await;
    contract.eyes.sees_rest().await;
    terminal.press(b"x");
    let stopped = contract.hears("an AllStop", |state| !state.enabled).await;
    assert!(stopped.stop.is_some());
    terminal.press(b"q");
    let status = eventually("teleop ends", || terminal.child.try_wait().expect("a child")).await;
    assert!(status.success(), "{status}");
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_terminal_there_is_no_teleop() {
    let contract = Contract::new().await;
    contract.world.done(&["drive", "teleop"]).await.is(2, &["needs a terminal"]);
}
