// Elements and numbers. Whatever comes from the network becomes text, never markup.

/** An element: `el("p", { class: "quiet" }, "text", child)`. Properties that begin with `on` are listeners. */
export function el(tag, attributes = {}, ...children) {
  const svg = ["svg", "circle", "path", "text", "g", "line"].includes(tag);
  const node = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

export const $ = (id) => document.getElementById(id);

/** Sets a text only where it changes, so that screen readers are not told the same again. */
export function say(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** A number with so many digits behind the point, and its unit; a dash for what is no number. */
export function number(value, digits = 2, unit = "") {
  if (typeof value !== "number" || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  // A minus before nothing but zeros says nothing.
  return (/^-0\.?0*$/.test(text) ? text.slice(1) : text) + (unit ? " " + unit : "");
}

export function duration(seconds) {
  if (typeof seconds !== "number") return "–";
  if (seconds < 90) return number(seconds, seconds < 10 ? 1 : 0, "s");
  if (seconds < 5400) return number(seconds / 60, 0, "min");
  return number(seconds / 3600, 1, "h");
}

/** The colours of the style, for canvases; read again when light turns to dark. */
export const colour = {};
const names = ["ground", "card", "ink", "quiet", "line", "grid", "axis", "wall", "robot", "truth", "trail", "plan", "field",
  "goal", "left", "right", "stop", "warn"];
function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of names) colour[name] = style.getPropertyValue("--" + name).trim();
}
readColours();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);

/** A canvas as large as its box, in the pixels of the screen; gives its context in CSS pixels. */
export function fit(canvas) {
  const scale = Math.min(devicePixelRatio || 1, 3);
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "12px system-ui, sans-serif";
  return { context, width, height };
}

/** A round step so that about `count` of them make `span`. */
export function step(span, count) {
  const raw = span / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  for (const factor of [1, 2, 5, 10]) if (factor * power >= raw) return factor * power;
  return 10 * power;
}

/** Whether keys typed now belong to a field. */
export function isTyping(event) {
  const { target } = event;
  return target instanceof HTMLElement &&
    (target.matches("input:not([type=range]), select, textarea") || target.isContentEditable);
}
