//! `axle top`, in a terminal that the test plays.

use crate::harness::{Robot, eventually};
use nix::pty::{Winsize, openpty};
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};

struct Terminal {
    child: Child,
    keyboard: File,
    screen: Arc<Mutex<String>>,
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
        let size = Winsize { ws_row: 50, ws_col: 160, ws_xpixel: 0, ws_ypixel: 0 };
        let pty = openpty(&size, None).expect("a terminal");
        let side = || Stdio::from(pty.slave.try_clone().expect("its other side"));
        let child = Command::new(env!("CARGO_BIN_EXE_axle"))
            .args(["top", "--connect", endpoint])
            .stdin(side())
            .stdout(side())
            .stderr(side())
            .spawn()
            .expect("the program");
        let keyboard = File::from(pty.master.try_clone().expect("a terminal"));
        let mut master = File::from(pty.master);
        let screen = Arc::new(Mutex::new(String::new()));
        let shown = Arc::clone(&screen);
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count) = master.read(&mut bytes) {
                shown.lock().expect("a screen").push_str(&String::from_utf8_lossy(&bytes[..count]));
            }
        });
        Self { child, keyboard, screen }
    }
    fn press(&mut self, key: &[u8]) {
        self.screen.lock().expect("a screen").clear();
        self.keyboard.write_all(key).expect("a key");
    }
    async fn shows(&self, words: &str) {
        let shown = || self.screen.lock().expect("a screen").contains(words).then_some(());
        eventually(&format!("the screen shows {words:?}"), shown).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn top_shows_services_and_gates_and_its_keys_stop_and_enable_and_look_inside() {
    let robot = Robot::new().await;
    let mut terminal = Terminal::new(&robot.world.endpoint);
    for words in ["d-corrector", "navigator", "pathfinder", "gate of r1: enabled", "/s", "q: quit"] {
        terminal.shows(words).await;
    }
    terminal.press(b"i");
    terminal.shows("says   axle/").await;
    terminal.press(b"s");
    terminal.shows("r1 is stopped; e enables it again").await;
    terminal.shows("gate of r1: STOPPED by").await;
    terminal.press(b"e");
    terminal.shows("r1 may move").await;
    terminal.shows("gate of r1: enabled").await;
    terminal.press(b"\x1b[B");
    terminal.shows("navigator").await;
    terminal.press(b"q");
    let status = eventually("top ends", || terminal.child.try_wait().expect("a child")).await;
    assert!(status.success(), "{status}");
    robot.reaches("0.1,0").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn top_says_once_to_programs_what_it_would_show() {
    let robot = Robot::new().await;
    robot.world.done(&["top"]).await.is(2, &["needs a terminal"]);
    let top = robot.world.done(&["top", "--json"]).await.is(0, &[]).json();
    let corrector =
        top["services"].as_array().expect("a list").iter().find(|row| row["service"] == "d-corrector");
    let beats = corrector.expect("a row")["beats_per_second"].as_f64().expect("a rate");
    assert!((5.0..40.0).contains(&beats), "20 beats a second, on a loaded machine: {beats}");
    assert_eq!(top["gates"]["r1"]["enabled"], true);
    let poses =
        top["streams"].as_array().expect("a list").iter().find(|row| row["key"] == "axle/r1/navigator/pose");
    assert!(poses.expect("a stream")["hz"].as_f64() > Some(1.0), "{top}");
}
