// Driving by hand: the Generic Differential Drive contract, with a stick, the keyboard and a dead man's handle.
//
// The stick is renewed while it is held, each time with the stamp of the newest word of the gateway. Whatever happens to
// this page, the robot brakes when nothing comes: this file only makes it sooner.

import { el, isTyping, number, say } from "./dom.js";

/** The stick is renewed at this pace; a power holds for 0.3 s. */
const PACE = 80;
/** Without a word of the gateway for so long nobody sees what the robot does. */
const BLIND = 400;
const KEYS = {
  ArrowUp: "ahead", w: "ahead", ArrowDown: "back", s: "back", ArrowLeft: "left", a: "left", ArrowRight: "right", d: "right",
};

export class Hand {
  constructor(link, box, tell) {
    Object.assign(this, { link, box, tell, aim: null, held: new Set(), isAsking: false, wasDriving: false });
    this.state = null;
    this.build();
    this.listen();
    setInterval(() => this.renew(), PACE);
    link.on("drive/update", (state) => this.show(state));
    for (const stage of ["distance-stage", "rotate-stage"]) {
      link.on("event:drive/" + stage, (word) => this.stage(stage, word));
    }
    link.addEventListener("robot", () => this.letGo());
    link.addEventListener("link", (event) => event.detail || this.letGo());
    link.addEventListener("word", (event) => {
      const hand = event.detail.hand;
      say(this.whose, hand === "you" ? "You drive." : hand === "other" ? "Another page drives." : "Nobody drives by hand.");
    });
  }

  build() {
    this.knob = el("circle", { class: "knob", cx: 100, cy: 100, r: 26 });
    this.pad = el("svg", { class: "pad", viewBox: "0 0 200 200", tabindex: 0, role: "application",
      "aria-label": "Stick. Drag it, or hold the arrow keys or W, A, S, D. Letting go stops." },
    el("circle", { class: "base", cx: 100, cy: 100, r: 92 }),
    el("path", { class: "cross", d: "M100 20V180M20 100H180" }),
    el("text", { x: 100, y: 20 }, "ahead"), this.knob);
    this.most = el("input", { type: "range", min: 0.05, max: 1, step: 0.05, value: 0.4, id: "most" });
    this.mostText = el("output", { for: "most" }, "40 %");
    this.most.addEventListener("input", () => say(this.mostText, `${Math.round(this.most.value * 100)} %`));
    this.kind = el("select", { id: "kind", "aria-label": "What the stick sets" },
      el("option", { value: "power" }, "powers"), el("option", { value: "speed" }, "speeds"));
    this.whose = el("p", { class: "quiet", id: "whose" }, "Nobody drives by hand.");
    const head = el("div", { class: "row" }, el("h2", {}, "Drive by hand"), this.kind);
    const share = el("label", { class: "slide" }, el("span", {}, "At most"), this.mostText, this.most);
    this.box.append(head, this.pad, share, this.whose, this.buildContract());
  }

  buildContract() {
    const field = (text, id, value, more = {}) => {
      const input = el("input", { type: "number", id, value, step: "any", ...more });
      return [el("label", { class: "pick" }, text, input), input];
    };
    const [metresLabel, metres] = field("Distance, m", "metres", 0.5, { min: 0 });
    const [degreesLabel, degrees] = field("Angle, °", "degrees", 90);
    const [powerLabel, power] = field("Power, −1 to 1", "power", 0.4, { min: -1, max: 1 });
    const distance = el("button", { type: "button", id: "drive-distance" }, "Drive distance");
    distance.onclick = () =>
      this.ask("distance", { set: { distance: Number(metres.value), power: Number(power.value) } });
    const rotate = el("button", { type: "button", id: "rotate-degrees" }, "Rotate");
    rotate.onclick = () => this.ask("rotate", { set: { degrees: Number(degrees.value), power: Number(power.value) } });
    const button = (text, id, act) => {
      const made = el("button", { type: "button", id }, text);
      made.onclick = act;
      return made;
    };
    this.stageText = el("p", { class: "quiet", id: "stage", role: "status" }, "No operation.");
    this.rows = ["left", "right"].map((side) => ({ side, cells: [0, 1, 2].map(() => el("td", { class: "number" }, "–")) }));
    const table = el("table", { id: "wheels" },
      el("thead", {}, el("tr", {}, ...["wheel", "power", "speed, m/s", "distance, m"].map((text, index) =>
        el("th", { class: index ? "number" : null, scope: "col" }, text)))),
      el("tbody", {}, ...this.rows.map(({ side, cells }) =>
        el("tr", {}, el("th", { scope: "row", class: "key", "data-line": side }, side), ...cells))));
    this.stateText = el("p", { class: "quiet", id: "drive-state" }, "No drive.");
    return el("details", {}, el("summary", {}, "Generic Differential Drive"),
      el("form", { onsubmit: (event) => event.preventDefault() }, table, this.stateText, powerLabel,
        el("div", { class: "row" }, metresLabel, distance), el("div", { class: "row" }, degreesLabel, rotate), this.stageText,
        el("div", { class: "row" },
          button("Enable drive", "drive-enable", () => this.ask("enable-drive", { enable: true, stop: this.state?.stop ?? null })),
          button("Disable", "drive-disable", () => this.ask("enable-drive", { enable: false })),
          button("Stop drive", "drive-stop", () => this.ask("stop-drive")),
          button("Reset encoders", "drive-reset", () => this.ask("reset")),
          button("Get state", "drive-get", async () => {
            const state = await this.ask("get-drive");
            if (state) this.show(state);
          }))));
  }

  async ask(name, question) {
    try {
      return await this.link.ask(name, question);
    } catch (fault) {
      this.tell(fault.message);
      return null;
    }
  }

  show(state) {
    this.state = state;
    for (const { side, cells } of this.rows) {
      const wheel = state.wheels[side];
      [wheel.power, wheel.speed, wheel.distance].forEach((value, index) => say(cells[index], number(value, index === 2 ? 3 : 2)));
    }
    const enabled = state.enabled ? "enabled" : state.stop ? "stopped, disabled" : "disabled";
    say(this.stateText, `${enabled}; ${state.operation}; the wheels are ${state.motion}`);
  }

  stage(which, word) {
    const what = which === "distance-stage" ? number(word.distance, 3, "m") : number(word.degrees, 1, "°");
    const why = word.why ? `: ${Object.values(word.why)[0]?.why ?? Object.keys(word.why)[0]}` : "";
    say(this.stageText, `${what}: ${String(word.stage).replace("_", " ")}${why}`);
  }

  // ---- The stick -----------------------------------------------------------------------------------------------------

  listen() {
    const { pad } = this;
    const move = (event) => {
      const box = pad.getBoundingClientRect();
      const reach = (box.width / 2) * 0.66;
      const x = (event.clientX - box.left - box.width / 2) / reach;
      const y = (box.top + box.height / 2 - event.clientY) / reach;
      const length = Math.max(Math.hypot(x, y), 1);
      this.setAim({ ahead: y / length, left: -x / length });
    };
    pad.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      pad.setPointerCapture(event.pointerId);
      pad.focus({ preventScroll: true });
      move(event);
    });
    pad.addEventListener("pointermove", (event) => pad.hasPointerCapture(event.pointerId) && move(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) pad.addEventListener(end, () => this.letGo());
    // The keys drive from everywhere but from fields, the map and what arrows move already.
    const isElsewhere = (event) => isTyping(event) || event.target.matches?.("#map, [type=range], button, summary");
    addEventListener("keydown", (event) => {
      const way = KEYS[event.key] ?? KEYS[event.key.toLowerCase?.()];
      if (!way || event.ctrlKey || event.altKey || event.metaKey || isElsewhere(event)) return;
      if (document.body.dataset.view !== "map") return;
      event.preventDefault();
      this.held.add(way);
      this.byKeys();
    });
    addEventListener("keyup", (event) => {
      const way = KEYS[event.key] ?? KEYS[event.key.toLowerCase?.()];
      if (way && this.held.delete(way)) this.byKeys();
    });
    addEventListener("blur", () => this.letGo());
    addEventListener("pagehide", () => this.letGo());
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden) return;
      this.letGo();
      this.link.send({ ask: { hide: {} } });
    });
  }

  byKeys() {
    const is = (way) => Number(this.held.has(way));
    const aim = { ahead: is("ahead") - is("back"), left: (is("left") - is("right")) / 2 };
    if (this.held.size === 0) this.letGo();
    else this.setAim(aim);
  }

  setAim(aim) {
    const isNew = this.aim === null;
    this.aim = aim;
    this.pad.dataset.held = "true";
    this.knob.setAttribute("cx", 100 - 60 * aim.left);
    this.knob.setAttribute("cy", 100 - 60 * aim.ahead);
    if (isNew) this.renew();
  }

  letGo() {
    this.held.clear();
    this.aim = null;
    this.pad.dataset.held = "false";
    this.knob.setAttribute("cx", 100);
    this.knob.setAttribute("cy", 100);
    if (this.wasDriving) {
      this.wasDriving = false;
      this.link.send({ ask: { release: {} } });
    }
  }

  /** Sends the powers anew while the stick is held; one question at a time, so that nothing old waits. */
  async renew() {
    if (!this.aim || this.isAsking) return;
    if (performance.now() - this.link.heard > BLIND) {
      say(this.whose, "The link is slow: the robot brakes.");
      return;
    }
    const isSpeed = this.kind.value === "speed";
    const most = Number(this.most.value) * (isSpeed ? this.state?.full_speed ?? 0.5 : 1);
    const clamp = (value) => Math.min(Math.max(value, -most), most);
    const { ahead, left } = this.aim;
    const set = { left: clamp((ahead - left) * most), right: clamp((ahead + left) * most) };
    this.isAsking = true;
    this.wasDriving = true;
    try {
      await this.link.ask(isSpeed ? "speed" : "power", { set, echo: this.link.tick });
    } catch (fault) {
      this.tell(fault.message);
    } finally {
      this.isAsking = false;
    }
  }
}
