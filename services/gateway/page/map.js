// The map: the floor of the map service, the robot, its trail, its plan with the field that leads along it, and the way points that a person clicks.

import { colour, fit, number, step } from "./dom.js";

/** The most points of a trail, and how far apart they are, in m. */
const TRAIL = 4000;
const APART = 0.005;

export class Plane extends EventTarget {
  constructor(canvas) {
    super();
    this.canvas = canvas;
    this.scale = 160; // pixels for a metre
    this.centre = { x: 0.5, y: 0.5 };
    this.isFollowing = true;
    this.points = [];
    this.cross = null;
    this.track = 0.3;
    this.floor = null;
    this.forget();
    this.listen();
    this.isStale = true;
    // Drawn when something has changed, and not as often as a screen could show it: the robot may share the computer.
    let drawn = 0;
    const draw = (now) => {
      requestAnimationFrame(draw);
      if (canvas.offsetParent === null || now - drawn < (this.isStale ? 45 : 1000)) return;
      [drawn, this.isStale] = [now, false];
      this.draw();
    };
    requestAnimationFrame(draw);
    new ResizeObserver(() => this.touch()).observe(canvas);
  }

  /** Something has changed that is seen. */
  touch() {
    this.isStale = true;
  }

  /** Forgets the robot; the points stay. */
  forget() {
    this.pose = null;
    this.truth = null;
    this.trail = [];
    this.plan = [];
    this.preview = [];
    this.arrows = [];
  }

  /** The floor of the map service, as one path in metres for walls and one for what nobody knows. */
  setFloor({ name, content, corners, walls, unknown }) {
    const path = (areas) => {
      const path = new Path2D();
      for (const area of areas) {
        area.forEach(([x, y], index) => (index === 0 ? path.moveTo(x, y) : path.lineTo(x, y)));
        path.closePath();
      }
      return path;
    };
    this.floor = { corners, walls: path(walls), unknown: path(unknown) };
    [this.canvas.dataset.floor, this.canvas.dataset.content] = [name, content];
    this.touch();
  }

  /** Shows the whole floor. */
  showFloor() {
    if (!this.floor) return;
    const [xs, ys] = [0, 1].map((axis) => this.floor.corners.map((corner) => corner[axis]));
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.follow(false);
    this.centre = { x: (left + right) / 2, y: (low + high) / 2 };
    const scale = Math.min((width - 40) / (right - left), (height - 70) / (high - low));
    this.scale = Math.min(Math.max(scale, 4), 3000);
    this.touch();
  }

  setPose(data) {
    const { x, y, heading } = data.pose;
    const old = this.pose?.pose;
    if (!old || Math.abs(x - old.x) + Math.abs(y - old.y) + Math.abs(heading - old.heading) > 5e-4) this.touch();
    this.pose = data;
    const last = this.trail.at(-1);
    if (!last || Math.hypot(x - last.x, y - last.y) > APART) {
      this.trail.push({ x, y });
      if (this.trail.length > TRAIL) this.trail.splice(0, TRAIL / 10);
    }
    const { dataset } = this.canvas;
    dataset.x = x;
    dataset.y = y;
    dataset.heading = heading;
  }

  // ---- Where things are ----------------------------------------------------------------------------------------------

  /** From metres to pixels of the canvas; x to the right, y up. */
  place({ x, y }) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [width / 2 + (x - this.centre.x) * this.scale, height / 2 - (y - this.centre.y) * this.scale];
  }

  /** From pixels to metres, to the centimetre. */
  at(px, py) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const round = (value) => Math.round(value * 100) / 100 || 0;
    return {
      x: round(this.centre.x + (px - width / 2) / this.scale),
      y: round(this.centre.y - (py - height / 2) / this.scale),
    };
  }

  zoom(factor, px = this.canvas.clientWidth / 2, py = this.canvas.clientHeight / 2) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const scale = Math.min(Math.max(this.scale * factor, 4), 3000);
    const shift = 1 / this.scale - 1 / scale;
    this.centre.x += (px - width / 2) * shift;
    this.centre.y -= (py - height / 2) * shift;
    this.scale = scale;
    this.touch();
  }

  follow(isFollowing) {
    this.isFollowing = isFollowing;
    this.touch();
    this.dispatchEvent(new CustomEvent("follow", { detail: isFollowing }));
  }

  setPoints(points) {
    this.points = points;
    this.preview = [];
    this.touch();
    this.dispatchEvent(new CustomEvent("points", { detail: points }));
  }

  // ---- Hands ---------------------------------------------------------------------------------------------------------

  listen() {
    const { canvas } = this;
    const held = new Map();
    let moved = 0;
    let apart = 0;
    const where = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      if (held.size === 0) moved = 0;
      held.set(event.pointerId, where(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) return;
      const now = where(event);
      const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
      moved += Math.hypot(dx, dy);
      held.set(event.pointerId, now);
      if (moved < 6) return;
      if (held.size === 2) {
        const [a, b] = [...held.values()];
        const distance = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (apart > 0) this.zoom(distance / apart, (a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
        apart = distance;
      } else {
        if (this.isFollowing) this.follow(false);
        this.touch();
        this.centre.x -= dx / this.scale;
        this.centre.y += dy / this.scale;
      }
    });
    const up = (event) => {
      const wasOnly = held.size === 1;
      if (!held.delete(event.pointerId)) return;
      apart = 0;
      if (event.type === "pointerup" && wasOnly && moved < 6) {
        this.setPoints([...this.points, this.at(...where(event))]);
      }
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 500), ...where(event));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("blur", () => {
      this.cross = null;
      this.touch();
    });
  }

  key(event) {
    const by = (event.shiftKey ? 0.5 : 0.1);
    const ways = { ArrowUp: [0, by], ArrowDown: [0, -by], ArrowLeft: [-by, 0], ArrowRight: [by, 0] };
    const start = () => this.points.at(-1) ?? this.pose?.pose ?? this.centre;
    if (ways[event.key]) {
      const { x, y } = this.cross ?? start();
      const [dx, dy] = ways[event.key];
      this.cross = { x: Math.round((x + dx) * 100) / 100, y: Math.round((y + dy) * 100) / 100 };
      this.touch();
      this.dispatchEvent(new CustomEvent("cross", { detail: this.cross }));
    } else if (event.key === "Enter" && this.cross) this.setPoints([...this.points, this.cross]);
    else if (event.key === "Backspace") this.setPoints(this.points.slice(0, -1));
    else if (event.key === "+") this.zoom(1.25);
    else if (event.key === "-") this.zoom(0.8);
    else return;
    event.preventDefault();
  }

  // ---- Drawing -------------------------------------------------------------------------------------------------------

  draw() {
    const { context, width, height } = fit(this.canvas);
    if (this.isFollowing && this.pose) this.keepInView(width, height);
    this.drawGrid(context, width, height);
    if (this.floor) this.drawFloor(context, width, height);
    this.drawField(context);
    this.drawLine(context, this.plan, colour.plan, 2.5);
    this.drawLine(context, this.preview, colour.plan, 1.5, [6, 5]);
    this.drawLine(context, this.trail, colour.trail, 2);
    this.drawPoints(context);
    if (this.truth) this.drawBody(context, this.truth.pose, colour.truth, true);
    if (this.pose) {
      this.drawUncertainty(context);
      this.drawBody(context, this.pose.pose, colour.robot, false);
    }
    if (this.cross) this.drawCross(context);
    const { dataset } = this.canvas;
    [dataset.scale, dataset.centreX, dataset.centreY] = [this.scale, this.centre.x, this.centre.y];
  }

  /** The picture moves only when the robot is about to leave it. */
  keepInView(width, height) {
    const [x, y] = this.place(this.pose.pose);
    const edge = 0.15 * Math.min(width, height);
    const out = (value, most) => Math.min(value - edge, 0) + Math.max(value - (most - edge), 0);
    this.centre.x += out(x, width) / this.scale;
    this.centre.y -= out(y, height) / this.scale;
  }

  drawGrid(context, width, height) {
    const size = step(width / this.scale, width / 90);
    const low = this.at(0, height);
    const high = this.at(width, 0);
    context.lineWidth = 1;
    context.fillStyle = colour.quiet;
    for (let x = Math.ceil(low.x / size) * size; x <= high.x; x += size) {
      const [px] = this.place({ x, y: 0 });
      context.strokeStyle = Math.abs(x) < size / 2 ? colour.axis : colour.grid;
      line(context, Math.round(px) + 0.5, 0, Math.round(px) + 0.5, height);
      // The last one would stand on the units.
      if (px < width - 100) context.fillText(number(x, size < 0.1 ? 2 : size < 1 ? 1 : 0), px + 4, height - 6);
    }
    for (let y = Math.ceil(low.y / size) * size; y <= high.y; y += size) {
      const [, py] = this.place({ x: 0, y });
      context.strokeStyle = Math.abs(y) < size / 2 ? colour.axis : colour.grid;
      line(context, 0, Math.round(py) + 0.5, width, Math.round(py) + 0.5);
      context.fillText(number(y, size < 0.1 ? 2 : size < 1 ? 1 : 0), 4, py - 4);
    }
    context.textAlign = "right";
    context.fillText("x, y in m", width - 8, height - 6);
    context.textAlign = "left";
  }

  drawFloor(context, width, height) {
    context.save();
    context.translate(width / 2 - this.centre.x * this.scale, height / 2 + this.centre.y * this.scale);
    context.scale(this.scale, -this.scale);
    context.fillStyle = colour.wall;
    context.fill(this.floor.walls);
    context.globalAlpha = 0.25;
    context.fill(this.floor.unknown);
    context.restore();
  }

  drawLine(context, points, stroke, thick, dash = []) {
    if (points.length < 2) return;
    context.strokeStyle = stroke;
    context.lineWidth = thick;
    context.lineJoin = "round";
    context.setLineDash(dash);
    context.beginPath();
    for (const point of points) context.lineTo(...this.place(point));
    context.stroke();
    context.setLineDash([]);
  }

  drawField(context) {
    context.strokeStyle = colour.field;
    context.lineWidth = 1.2;
    for (const [x, y, heading, share] of this.arrows) {
      const [px, py] = this.place({ x, y });
      const length = 4 + 9 * Math.min(share, 1);
      const [dx, dy] = [Math.cos(heading) * length, -Math.sin(heading) * length];
      line(context, px - dx / 2, py - dy / 2, px + dx / 2, py + dy / 2);
      const tip = [px + dx / 2, py + dy / 2];
      for (const side of [2.6, -2.6]) {
        line(context, ...tip, tip[0] + 4 * Math.cos(-heading + side), tip[1] + 4 * Math.sin(-heading + side));
      }
    }
  }

  drawPoints(context) {
    this.points.forEach((point, index) => {
      const [x, y] = this.place(point);
      context.fillStyle = colour.goal;
      context.beginPath();
      context.arc(x, y, 9, 0, 7);
      context.fill();
      context.fillStyle = colour.card;
      context.textAlign = "center";
      context.fillText(String(index + 1), x, y + 4);
      context.textAlign = "left";
      if (point.waits) {
        context.strokeStyle = colour.goal;
        context.lineWidth = 2;
        context.beginPath();
        context.arc(x, y, 13, 0, 7);
        context.stroke();
      }
      if (typeof point.heading === "number") {
        context.strokeStyle = colour.goal;
        context.lineWidth = 2;
        line(context, x, y, x + 18 * Math.cos(point.heading), y - 18 * Math.sin(point.heading));
      }
    });
  }

  drawBody(context, pose, stroke, isGhost) {
    const [x, y] = this.place(pose);
    // Far away it stays large enough to be seen.
    const half = Math.max((this.track / 2) * this.scale, 7);
    context.save();
    context.translate(x, y);
    context.rotate(-pose.heading);
    context.strokeStyle = stroke;
    context.fillStyle = stroke;
    context.lineWidth = 2;
    context.setLineDash(isGhost ? [3, 3] : []);
    context.beginPath();
    context.roundRect(-half * 0.9, -half * 0.85, half * 1.9, half * 1.7, half * 0.45);
    context.stroke();
    if (!isGhost) {
      context.globalAlpha = 0.18;
      context.fill();
      context.globalAlpha = 1;
      for (const side of [-1, 1]) context.fillRect(-half * 0.38, side * half - half * 0.14, half * 0.76, half * 0.28);
      context.beginPath();
      context.moveTo(half * 0.85, 0);
      context.lineTo(half * 0.35, half * 0.35);
      context.lineTo(half * 0.35, -half * 0.35);
      context.fill();
    }
    context.restore();
  }

  /** Where the robot believes to be with 95 %: the ellipse of its covariance. */
  drawUncertainty(context) {
    const c = this.pose.covariance;
    if (!Array.isArray(c)) return;
    const [a, b, d] = [c[0], (c[1] + c[3]) / 2, c[4]];
    const root = Math.hypot((a - d) / 2, b);
    const [long, short] = [(a + d) / 2 + root, Math.max((a + d) / 2 - root, 0)];
    const [x, y] = this.place(this.pose.pose);
    const radius = (variance) => 2.448 * Math.sqrt(Math.max(variance, 0)) * this.scale;
    if (!(radius(long) > 1)) return;
    context.strokeStyle = colour.robot;
    context.lineWidth = 1;
    context.beginPath();
    context.ellipse(x, y, radius(long), radius(short), -0.5 * Math.atan2(2 * b, a - d), 0, 7);
    context.stroke();
  }

  drawCross(context) {
    const [x, y] = this.place(this.cross);
    context.strokeStyle = colour.goal;
    context.lineWidth = 2;
    line(context, x - 10, y, x + 10, y);
    line(context, x, y - 10, x, y + 10);
    context.fillStyle = colour.ink;
    context.fillText(`${number(this.cross.x)}, ${number(this.cross.y)}`, x + 12, y - 8);
  }
}

function line(context, x1, y1, x2, y2) {
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.stroke();
}
