// The one connection to the gateway: questions with answers, and what is new about the robot that is shown.

/** Answers that do not come within this time will not come. */
const PATIENCE = 6000;
/** A link that says nothing for so long is closed and opened anew. */
const SILENCE = 3000;

export class Link extends EventTarget {
  constructor() {
    super();
    this.robot = "";
    this.tick = 0;
    this.heard = 0;
    this.waiting = new Map();
    this.numbers = 0;
    this.pause = 200;
    this.isUp = false;
    this.open();
    setInterval(() => this.look(), 500);
  }

  open() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket = socket;
    this.heard = performance.now();
    socket.addEventListener("open", () => {
      const session = Number(sessionStorage.getItem("session"));
      this.send({ ask: { hello: session > 0 ? { session } : {} } });
      if (this.robot) this.send({ ask: { watch: { robot: this.robot } } });
    });
    socket.addEventListener("message", (event) => {
      if (!socket.isGone) this.hear(event.data);
    });
    socket.addEventListener("close", () => this.closed(socket));
  }

  closed(socket) {
    if (socket.isGone) return;
    socket.isGone = true;
    // A browser does not say why it was turned away; where the page is answered by the login, that is why.
    fetch("/", { method: "HEAD" }).then((answer) => answer.status === 401 && location.reload(), () => {});
    for (const { fail } of this.waiting.values()) fail(new Error("the connection to the gateway is lost"));
    this.waiting.clear();
    this.setUp(false);
    setTimeout(() => this.open(), this.pause);
    this.pause = Math.min(this.pause * 1.6, 3000);
  }

  setUp(isUp) {
    if (this.isUp === isUp) return;
    this.isUp = isUp;
    this.dispatchEvent(new CustomEvent("link", { detail: isUp }));
  }

  /** A link may be dead for minutes before the browser notices. */
  look() {
    if (this.socket.readyState === WebSocket.OPEN && performance.now() - this.heard > SILENCE) {
      this.socket.close();
      this.closed(this.socket);
    }
  }

  hear(text) {
    const word = JSON.parse(text);
    this.heard = performance.now();
    if (word.welcome) {
      sessionStorage.setItem("session", String(word.welcome.session));
      this.pause = 200;
      this.setUp(true);
      this.dispatchEvent(new CustomEvent("guest", { detail: word.welcome }));
      return;
    }
    if ("reply" in word) {
      const waiting = this.waiting.get(word.reply);
      this.waiting.delete(word.reply);
      if (waiting && "ok" in word) waiting.done(word.ok);
      else if (waiting) waiting.fail(new Error(word.refusal));
      else if (word.refusal) this.dispatchEvent(new CustomEvent("refusal", { detail: word.refusal }));
      return;
    }
    // Echoed at once: the gateway sees by it how much is still on its way, and that somebody is there.
    this.tick = word.tick;
    this.send({ ask: { echo: { tick: word.tick } } });
    if (word.robot && word.robot !== this.robot) return;
    const now = performance.now() / 1000;
    for (const [stream, [age, value]] of Object.entries(word.new ?? {})) {
      this.dispatchEvent(new CustomEvent(stream, { detail: { value, at: now - age } }));
    }
    for (const [stream, value] of word.events ?? []) {
      this.dispatchEvent(new CustomEvent("event:" + stream, { detail: { value, at: now } }));
    }
    this.dispatchEvent(new CustomEvent("word", { detail: { hand: word.hand, lost: word.lost ?? 0 } }));
  }

  /** Calls `take` with every value of a stream. */
  on(stream, take) {
    this.addEventListener(stream, (event) => take(event.detail.value, event.detail.at));
  }

  send(word) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(word));
    return true;
  }

  /** Shows another robot. */
  watch(robot) {
    this.robot = robot;
    this.send({ ask: { watch: { robot } } });
    this.dispatchEvent(new CustomEvent("robot", { detail: robot }));
  }

  /** Asks, and promises the answer. The robot that is shown is named in the question. */
  ask(name, question = {}, needsRobot = true) {
    return new Promise((done, fail) => {
      const id = ++this.numbers % 4294967295;
      const asked = needsRobot ? { robot: this.robot, ...question } : question;
      if (needsRobot && !this.robot) return fail(new Error("no robot is there"));
      if (!this.send({ id, ask: { [name]: asked } })) return fail(new Error("there is no connection to the gateway"));
      this.waiting.set(id, { done, fail });
      setTimeout(() => {
        if (this.waiting.delete(id)) fail(new Error("the gateway did not answer"));
      }, PATIENCE);
    });
  }
}
