// The teaching view of the tutorial: two wheel speeds and two accelerations, the exact path, and what the formulas make of
// the readings of the encoders. The paths are computed by the gateway, with the very code that drives robots.

import { $, colour, el, fit, number, say, step } from "./dom.js";

const NAMES = {
  "arc": ["Arc of a circle, equation 5", "left"],
  "point-and-shoot": ["Point and shoot, equation 6", "right"],
  "half-turn": ["Brown's half turn", "truth"],
};

export function lesson(link) {
  const canvas = el("canvas", { id: "lesson-map", role: "img", "aria-label": "The exact path and three approximations of it" });
  const results = el("tbody");
  const shape = el("p", { id: "lesson-shape", role: "status" });
  const sliders = {};
  const slider = (name, text, unit, min, max, by, value) => {
    const input = el("input", { type: "range", id: `lesson-${name}`, min, max, step: by, value });
    const output = el("output", { for: input.id });
    sliders[name] = { input, output, unit };
    input.addEventListener("input", () => ask());
    return el("label", { class: "slide" }, el("span", {}, text), output, input);
  };
  $("view-lesson").append(
    el("section", { class: "card" }, el("h2", {}, "Where the robot goes, and where formulas believe it goes"), canvas, shape,
      el("table", {}, el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "formula"),
        el("th", { scope: "col", class: "number" }, "ends off by"))), results)),
    el("form", { class: "card", onsubmit: (event) => event.preventDefault() }, el("h2", {}, "The movement"),
      slider("left", "Left wheel, speed at the start", "m/s", -1, 1, 0.01, 0.2),
      slider("right", "Right wheel, speed at the start", "m/s", -1, 1, 0.01, 0.5),
      slider("left-by", "Left wheel, acceleration", "m/s²", -0.5, 0.5, 0.01, 0.1),
      slider("right-by", "Right wheel, acceleration", "m/s²", -0.5, 0.5, 0.01, 0),
      slider("time", "Duration", "s", 0.5, 12, 0.1, 4),
      slider("track", "Distance between the wheels", "m", 0.05, 1, 0.01, 0.3),
      slider("samples", "Readings of the encoders", "", 1, 60, 1, 4),
      el("p", { class: "quiet" }, "The formulas see only how far each wheel came between two readings. ",
        "With constant speeds the arc is exact; with accelerations nothing is but the exact path.")));

  let shown = null;
  let isAsking = false;
  let isStale = true;
  const value = (name) => Number(sliders[name].input.value);
  async function ask() {
    for (const { input, output, unit } of Object.values(sliders)) {
      say(output, number(Number(input.value), unit === "" ? 0 : 2, unit));
    }
    isStale = true;
    // The newest position of the sliders is asked for when the last one has been answered.
    if (isAsking || !link.isUp) return;
    isAsking = true;
    while (isStale) {
      isStale = false;
      try {
        shown = await link.ask("lesson", {
          speeds: { left: value("left"), right: value("right") },
          accelerations: { left: value("left-by"), right: value("right-by") },
          time: value("time"), track: value("track"), samples: value("samples"),
        }, false);
        show();
      } catch (fault) {
        say(shape, fault.message);
        break;
      }
    }
    isAsking = false;
  }

  function show() {
    const { end, distance } = shown;
    say(shape, `${shown.shape}, ${number(Math.abs(distance))} m long; ends at ${number(end.x)}, ${number(end.y)} m, ` +
      `heading ${number((end.heading * 180) / Math.PI, 1)}°`);
    results.replaceChildren(...shown.believed.map(({ name, off }) => {
      const [text, line] = NAMES[name] ?? [name, "quiet"];
      return el("tr", { "data-formula": name }, el("td", { class: "key", "data-line": line }, text),
        el("td", { class: "number" }, off < 5e-4 ? `${number(off * 1e6, 1)} µm` : `${number(off * 1000, 1)} mm`));
    }));
  }

  let drawn = 0;
  function draw(at) {
    requestAnimationFrame(draw);
    if (canvas.offsetParent === null || at - drawn < 60) return;
    drawn = at;
    const { context, width, height } = fit(canvas);
    if (!shown) return;
    const lines = [...shown.believed.map(({ name, path }) => [path, NAMES[name]?.[1] ?? "quiet", 1.6, true]), [shown.path, "plan", 3, false]];
    const xs = lines.flatMap(([path]) => path.map(([x]) => x));
    const ys = lines.flatMap(([path]) => path.map(([, y]) => y));
    const [low, high] = [[Math.min(...xs), Math.min(...ys)], [Math.max(...xs), Math.max(...ys)]];
    const scale = Math.min((width - 80) / Math.max(high[0] - low[0], 0.3), (height - 80) / Math.max(high[1] - low[1], 0.3));
    const px = (x) => width / 2 + (x - (low[0] + high[0]) / 2) * scale;
    const py = (y) => height / 2 - (y - (low[1] + high[1]) / 2) * scale;
    const size = step(width / scale, 8);
    context.lineWidth = 1;
    context.strokeStyle = colour.grid;
    context.fillStyle = colour.quiet;
    const from = (middle, half) => Math.ceil((middle - half / scale) / size) * size;
    for (let x = from((low[0] + high[0]) / 2, width / 2); px(x) < width; x += size) {
      context.beginPath();
      context.moveTo(px(x), 0);
      context.lineTo(px(x), height);
      context.stroke();
      context.fillText(number(x, size < 0.1 ? 2 : 1), px(x) + 3, height - 5);
    }
    for (let y = from((low[1] + high[1]) / 2, height / 2); py(y) > 0; y += size) {
      context.beginPath();
      context.moveTo(0, py(y));
      context.lineTo(width, py(y));
      context.stroke();
      context.fillText(number(y, size < 0.1 ? 2 : 1), 4, py(y) - 3);
    }
    for (const [path, name, thick, hasDots] of lines) {
      context.strokeStyle = colour[name];
      context.fillStyle = colour[name];
      context.lineWidth = thick;
      context.beginPath();
      for (const [x, y] of path) context.lineTo(px(x), py(y));
      context.stroke();
      for (const [x, y] of hasDots ? path.slice(1) : [path.at(-1)]) {
        context.beginPath();
        context.arc(px(x), py(y), hasDots ? 3 : 5, 0, 7);
        context.fill();
      }
    }
  }

  link.addEventListener("link", (event) => event.detail && ask());
  ask();
  requestAnimationFrame(draw);
}
