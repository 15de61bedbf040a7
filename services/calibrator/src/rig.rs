//! A robot in virtual time for the proofs: the real gate, an owner of wheels that may apply a calibration, the emulator,
//! and a procedure that speaks with them as its host does over the mesh. Or a board on a serial line in place of the
//! emulator, with the real protocol at both of its ends; or no gyroscope, and a person with a ruler.

use crate::{Action, Map, Procedure, Question, Report, Room, Subject};
use axle_emulator::{EmulatedBoard, Emulator, EmulatorParams};
use axle_gate::Gate;
use axle_robot::{BoardKind, Bridge, RobotParams};
use axle_schema::command::{Class, Command, Lease, LeaseAsk};
use axle_schema::{
    Boot, Calibration, Duty, Dwm, EncodersData, Metres, MetresPerSecond, Pose, Refusal, Seconds, Sides,
    SignalsData, Tick,
};

/// A board on a serial line, and the bridge to it.
struct Line {
    params: RobotParams,
    kind: BoardKind,
    bridge: Bridge,
    board: EmulatedBoard,
    /// What is on its way to the board.
    out: Vec<u8>,
    counted: EncodersData,
    given: Option<axle_schema::Signals>,
}

impl Line {
    fn beat(&mut self, now: Seconds, setpoints: Sides<MetresPerSecond>) {
        let room = self.board.room(now).min(self.out.len());
        let heard: Vec<u8> = self.out.drain(..room).collect();
        let mut said = Vec::new();
        self.board.advance(now, &heard, &mut said);
        self.bridge.hear(now, &said);
        self.bridge.beat(now, setpoints, &mut self.out);
    }
}

pub(crate) struct Rig {
    pub(crate) params: EmulatorParams,
    pub(crate) robot: Emulator,
    gate: Gate,
    lease: Lease,
    seq: u32,
    beats: u32,
    map: Option<Map>,
    speeds: Sides<MetresPerSecond>,
    pub(crate) signals: SignalsData,
    line: Option<Line>,
    /// Whether a person measures, and where that person has marked the floor.
    by_hand: bool,
    mark: Pose,
}

impl Rig {
    pub(crate) fn new(params: EmulatorParams, calibration: Option<Calibration>) -> Self {
        let mut gate = Gate::new(params.gate, &params.robot, Boot(1), None).expect("a gate");
        let ask = LeaseAsk { holder: "rig".into(), class: Class::Corrector, period: Seconds(0.05) };
        let lease = gate.lease(Seconds::ZERO, &ask).expect("a lease");
        let map = calibration.map(|calibration| Map::new(calibration, params.robot.track).expect("a map"));
        let robot = Emulator::new(params).expect("a robot");
        let (speeds, signals) = (Sides::default(), SignalsData::default());
        let (line, by_hand, mark) = (None, false, Pose::default());
        Self { params, robot, gate, lease, seq: 0, beats: 0, map, speeds, signals, line, by_hand, mark }
    }
    /// The same robot with a board of this kind, which is greeted.
    pub(crate) fn with_board(
        params: EmulatorParams,
        calibration: Option<Calibration>,
        (kind, robot): (BoardKind, RobotParams),
    ) -> Self {
        let mut bridge = Bridge::new(&robot, kind, "line").expect("a bridge");
        let board = EmulatedBoard::new(&params, kind, 1).expect("a board");
        let mut out = Vec::new();
        bridge.opened(Seconds::ZERO, &mut out);
        let counted = EncodersData::default();
        let line = Line { params: robot, kind, bridge, board, out, counted, given: None };
        let mut rig = Self { line: Some(line), ..Self::new(params, calibration) };
        let rest = Dwm::new(Sides::default(), Sides::default(), Seconds(0.05)).expect("finite");
        for _ in 0..60 {
            rig.command(rest);
            (0..10).for_each(|_| rig.beat());
        }
        let now = rig.now();
        let line = rig.line.as_mut().expect("a line");
        line.bridge.health(now).expect("a board that is greeted");
        rig
    }
    /// The same robot without a gyroscope, and with a person who measures to whole millimetres.
    pub(crate) fn by_hand(self) -> Self {
        Self { by_hand: true, ..self }
    }
    fn full_speed(&self) -> MetresPerSecond {
        self.line.as_ref().map_or(self.robot.full_speed(), |line| line.params.full_speed(line.kind))
    }
    pub(crate) fn now(&self) -> Seconds {
        self.params.rates.beat * f64::from(self.beats)
    }
    /// What the owner of the wheels says of the encoders.
    pub(crate) fn encoders(&mut self) -> EncodersData {
        let data = self.line.as_ref().map_or_else(|| self.robot.encoders(), |line| line.counted);
        let Some(map) = &self.map else { return data };
        let Sides { left, right } = map.distances(Sides::new(data.left, data.right));
        EncodersData { left, right, ..data }
    }
    pub(crate) fn command(&mut self, dwm: Dwm) {
        self.seq += 1;
        let (boot, epoch, echo) = (self.lease.boot, self.lease.epoch, Tick::of(self.now()));
        let command = Command { boot, epoch, seq: self.seq, echo, ttl_ms: 150, dwm };
        self.gate.obey(self.now(), &command).expect("obeyed");
    }
    /// One beat of the gate and of the owner of the wheels.
    pub(crate) fn beat(&mut self) {
        self.beats += 1;
        let (now, period) = (self.now(), self.params.rates.beat);
        let speeds = self.gate.beat(now);
        let full = self.full_speed();
        let signals = match &self.map {
            Some(map) => map.signals(speeds, speeds.zip(self.speeds, |to, from| (to - from) / period)),
            None => axle_schema::Signals {
                left: Duty::new(speeds.left / full).expect("a share"),
                right: Duty::new(speeds.right / full).expect("a share"),
            },
        };
        self.speeds = speeds;
        self.signals = SignalsData { stamp: now, left: signals.left, right: signals.right, counted: None };
        let setpoints = Sides::new(full * signals.left.get(), full * signals.right.get());
        match &mut self.line {
            Some(line) => line.beat(now, setpoints),
            None => self.robot.advance(now, setpoints),
        }
    }
    /// The procedure hears what is measured, and a person answers what it asks.
    fn tell(&mut self, procedure: &mut Procedure) {
        let SignalsData { left, right, .. } = self.signals;
        match &mut self.line {
            Some(line) => {
                let news = line.bridge.news();
                if let Some(given) = news.signals {
                    line.given = Some(given);
                }
                let (left, right) = line.given.map_or((left, right), |given| (given.left, given.right));
                if let Some(inertial) = news.inertial {
                    procedure.hear_inertial(&inertial);
                }
                if let Some(counted) = news.encoders {
                    line.counted = counted;
                    let sides = Some(Sides::new(counted.left, counted.right));
                    procedure.hear_signals(&SignalsData {
                        stamp: counted.stamp,
                        left,
                        right,
                        counted: sides,
                    });
                }
            }
            None if self.beats.is_multiple_of(4) => {
                procedure.hear_signals(&self.signals);
                if !self.by_hand {
                    procedure.hear_inertial(&self.robot.inertial());
                }
                procedure.hear_encoders(&self.robot.encoders());
            }
            None => {}
        }
        match procedure.question() {
            Some(Question::Mark { .. }) => {
                self.mark = self.place();
                procedure.answer(Metres::ZERO, Metres::ZERO).expect("marked");
            }
            Some(Question::End { .. }) => {
                let (from, to) = (self.mark, self.place());
                let (cos, sin) = (from.heading.0.cos(), from.heading.0.sin());
                let (x, y) = ((to.x - from.x).0, (to.y - from.y).0);
                let ruler = |metres: f64| Metres((metres * 1000.0).round() / 1000.0);
                procedure.answer(ruler(x * cos + y * sin), ruler(y * cos - x * sin)).expect("in the room");
            }
            None => {}
        }
    }
    /// A calibration from its beginning to its end.
    pub(crate) fn calibrate(&mut self, room: Room, passes: u32) -> Result<(Calibration, Report), Refusal> {
        let mut procedure = Procedure::new(self.subject(room, passes))?;
        loop {
            self.tell(&mut procedure);
            if self.beats.is_multiple_of(10) {
                match procedure.beat(self.now()) {
                    Action::Drive(dwm) => self.command(dwm),
                    Action::Done(outcome) => return Ok(*outcome),
                    Action::Fail(refusal) => return Err(refusal),
                }
            }
            self.beat();
        }
    }
    pub(crate) fn subject(&self, room: Room, passes: u32) -> Subject {
        Subject {
            track: self.params.robot.track,
            wheel_speed: self.params.robot.wheel_speed,
            wheel_acceleration: self.params.robot.wheel_acceleration,
            full_speed: self.full_speed(),
            room,
            passes,
            period: Seconds(0.05),
            version: 0,
            by_hand: self.by_hand,
            keeps_speeds: self.line.as_ref().is_some_and(|line| !line.params.powers(line.kind)),
        }
    }
    /// Drives the wheels by these distances beyond `from`, kept by the encoders as a corrector does, and waits until they
    /// stand.
    fn goes(&mut self, from: Sides<f64>, distances: Sides<f64>) {
        use crate::motion::{Motion, Wish};
        let motion = Motion::Go { distances, speed: 0.3, acceleration: 0.8 };
        let begun = self.now();
        let mut last = Sides::new(0.0, 0.0);
        loop {
            let data = self.encoders();
            let since = Sides::new(data.left.0, data.right.0).zip(from, |now, from| now - from);
            let Wish::Speeds(next) = motion.at((self.now() - begun).0 + 0.05, since) else { break };
            let next = last.zip(next, |from: f64, to: f64| from + (to - from).clamp(-0.1, 0.1));
            self.command(
                Dwm::new(last.map(MetresPerSecond), next.map(MetresPerSecond), Seconds(0.05))
                    .expect("finite"),
            );
            last = next;
            (0..10).for_each(|_| self.beat());
            self.listen();
        }
        let rest = Sides::default();
        for _ in 0..8 {
            self.command(Dwm::new(rest, rest, Seconds(0.05)).expect("finite"));
            (0..10).for_each(|_| self.beat());
            self.listen();
        }
    }
    /// Takes what the board has counted.
    fn listen(&mut self) {
        if let Some(line) = &mut self.line
            && let Some(counted) = line.bridge.news().encoders
        {
            line.counted = counted;
        }
    }
    /// How far from its start a square of this side ends, m, and by how much its heading is off, rad.
    pub(crate) fn square(&mut self, side: f64, left: bool) -> (f64, f64) {
        let start = self.place();
        let quarter =
            std::f64::consts::FRAC_PI_4 * self.params.robot.track.get() * if left { 1.0 } else { -1.0 };
        // As a plan is driven: what one leg misses is made up for by the next one.
        self.listen();
        let data = self.encoders();
        let mut due = Sides::new(data.left.0, data.right.0);
        for leg in [Sides::new(side, side), Sides::new(-quarter, quarter)].into_iter().cycle().take(8) {
            self.goes(due, leg);
            due = due.zip(leg, |due, leg| due + leg);
        }
        let end = self.place();
        let turned = std::f64::consts::TAU * if left { 1.0 } else { -1.0 };
        (start.distance(end).0, (end.heading - start.heading).0 - turned)
    }
    pub(crate) fn place(&self) -> Pose {
        self.line.as_ref().map_or_else(|| self.robot.truth().pose, |line| line.board.truth().pose)
    }
}

pub(crate) fn room(side: f64) -> Room {
    Room { length: Metres(side), width: Metres(side) }
}
