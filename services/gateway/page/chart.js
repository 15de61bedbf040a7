// Strip charts: what is due against what is, over the last half minute.

import { $, colour, el, fit, number, step } from "./dom.js";

/** How far back a chart looks, in s, and the most samples of a line. */
const SPAN = 30;
const MOST = 3000;

class Strip {
  constructor(title, unit, lines) {
    this.unit = unit;
    this.lines = lines.map((line) => ({ ...line, samples: [] }));
    this.canvas = el("canvas", { class: "chart", role: "img", "aria-label": `${title}, ${unit}` });
    this.values = new Map();
    const keys = this.lines.map((line) => {
      const value = el("output", {}, "–");
      this.values.set(line.name, value);
      return el("span", { class: "key", "data-line": line.colour }, line.name, " ", value);
    });
    this.box = el("section", { class: "card" }, el("h2", {}, title), this.canvas, el("p", { class: "keys" }, ...keys));
  }

  add(name, at, value) {
    const line = this.lines.find((one) => one.name === name);
    if (!line || !Number.isFinite(value)) return;
    line.samples.push([at, value]);
    if (line.samples.length > MOST) line.samples.splice(0, MOST / 10);
    this.values.get(name).textContent = number(value, 3, this.unit);
  }

  forget() {
    for (const line of this.lines) line.samples = [];
  }

  draw(now) {
    const { context, width, height } = fit(this.canvas);
    const [left, right, top, bottom] = [46, width - 6, 8, height - 20];
    for (const line of this.lines) {
      const from = line.samples.findIndex(([at]) => at >= now - SPAN - 1);
      if (from > 200) line.samples.splice(0, from);
    }
    const values = this.lines.flatMap((line) => line.samples.filter(([at]) => at >= now - SPAN).map(([, value]) => value));
    let [low, high] = [Math.min(0, ...values), Math.max(0, ...values)];
    const least = this.unit === "m/s" ? 0.1 : 0.01;
    if (high - low < least) [low, high] = [low - least / 2, high + least / 2];
    const margin = (high - low) * 0.08;
    [low, high] = [low - margin, high + margin];
    const x = (at) => left + ((at - now + SPAN) / SPAN) * (right - left);
    const y = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
    const size = step(high - low, 4);
    context.fillStyle = colour.quiet;
    context.lineWidth = 1;
    context.textAlign = "right";
    for (let value = Math.ceil(low / size) * size; value <= high; value += size) {
      const py = Math.round(y(value)) + 0.5;
      context.strokeStyle = Math.abs(value) < size / 2 ? colour.axis : colour.grid;
      context.beginPath();
      context.moveTo(left, py);
      context.lineTo(right, py);
      context.stroke();
      context.fillText(number(value, Math.max(0, Math.ceil(-Math.log10(size) - 1e-9))), left - 6, py + 4);
    }
    context.textAlign = "center";
    for (const back of [0, 10, 20, 30]) context.fillText(back ? `−${back} s` : "now", Math.min(Math.max(x(now - back), left + 10), right - 14), height - 5);
    context.textAlign = "left";
    for (const line of this.lines) {
      context.strokeStyle = colour[line.colour];
      context.lineWidth = line.dashed ? 1.3 : 2;
      context.setLineDash(line.dashed ? [4, 3] : []);
      context.beginPath();
      let before = -Infinity;
      for (const [at, value] of line.samples) {
        if (at < now - SPAN) continue;
        // A gap in what was heard is a gap in the line.
        if (at - before > 1.5) context.moveTo(x(at), y(value));
        else context.lineTo(x(at), y(value));
        before = at;
      }
      context.stroke();
      context.setLineDash([]);
    }
  }
}

/** All charts of the robot that is shown. */
export function charts(link) {
  const wheel = (side) => new Strip(`Speed of the ${side} wheel`, "m/s", [
    { name: "due", colour: "quiet", dashed: true }, { name: "real", colour: side }]);
  const strips = {
    left: wheel("left"),
    right: wheel("right"),
    lag: new Strip("Distance of the wheels behind what is due", "m", [
      { name: "left", colour: "left" }, { name: "right", colour: "right" }]),
    off: new Strip("Estimated position, distance from the true one", "m", [{ name: "off", colour: "truth" }]),
    signals: new Strip("Duty of the motors", "", [{ name: "left", colour: "left" }, { name: "right", colour: "right" }]),
  };
  const all = Object.values(strips);
  $("view-charts").append(...all.map((strip) => strip.box));
  strips.signals.box.hidden = true;
  strips.off.box.hidden = true;

  // What is due by hand: the share of full speed that the drive asks for.
  link.on("drive/update", ({ operation, wheels, full_speed: full }, at) => {
    if (operation === "idle") return;
    for (const side of ["left", "right"]) strips[side].add("due", at, wheels[side].power * full);
  });
  // Real speeds come from the encoders alone, whoever drives.
  let before = null;
  link.on("robot/encoders", (now, at) => {
    if (before && now.stamp < before.stamp) before = null;
    const time = before ? now.stamp - before.stamp : 0;
    if (before && time < 0.04) return;
    for (const side of ["left", "right"]) {
      if (before && time < 1) strips[side].add("real", at, (now[side] - before[side]) / time);
    }
    before = now;
  });
  const names = new Set();
  link.on("correctors", (list) => {
    for (const name of list) {
      if (names.has(name)) continue;
      names.add(name);
      let last = null;
      link.on(`${name}/progress`, (now, at) => {
        const { due, real, elapsed, task } = now;
        if (!due || !real) return;
        const time = last && last.task === task ? elapsed - last.elapsed : 0;
        for (const side of ["left", "right"]) {
          strips.lag.add(side, at, due[side] - real[side]);
          // What is due in a task: how fast the distances grow that are due.
          if (time > 0.03 && time < 1) strips[side].add("due", at, (due[side] - last.due[side]) / time);
        }
        if (time <= 0 || time > 0.03) last = now;
      });
    }
  });
  link.on("robot/signals", (signals, at) => {
    strips.signals.box.hidden = false;
    for (const side of ["left", "right"]) strips.signals.add(side, at, signals[side]);
  });
  // The truth at the stamp of an estimate, between the two that were heard before and after it.
  let truth = null;
  let waiting = [];
  link.on("navigator/pose", (data, at) => {
    waiting.push({ ...data, at });
    if (waiting.length > 20) waiting.shift();
  });
  link.on("emulator/truth", (next) => {
    const [from, to] = [truth, next];
    truth = next;
    if (!from || !(to.stamp > from.stamp) || to.stamp - from.stamp > 0.3) return;
    strips.off.box.hidden = false;
    for (const { pose, stamp, at } of waiting.filter((one) => one.stamp >= from.stamp && one.stamp <= to.stamp)) {
      const share = (stamp - from.stamp) / (to.stamp - from.stamp);
      const between = (name) => from.pose[name] + (to.pose[name] - from.pose[name]) * share;
      strips.off.add("off", at, Math.hypot(pose.x - between("x"), pose.y - between("y")));
    }
    waiting = waiting.filter((one) => one.stamp > to.stamp);
  });
  link.addEventListener("robot", () => {
    [before, truth, waiting] = [null, null, []];
    for (const strip of all) strip.forget();
  });
  let drawn = 0;
  const draw = (at) => {
    requestAnimationFrame(draw);
    if (at - drawn < 90) return;
    drawn = at;
    for (const strip of all) if (strip.canvas.offsetParent !== null) strip.draw(performance.now() / 1000);
  };
  requestAnimationFrame(draw);
}
