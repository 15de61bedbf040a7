// Reports: the calibration that the robot applies, and what calibrations and tournaments have left in files.

import { $, el, number, say } from "./dom.js";

/** Rows of a table that are shown. */
const MOST = 500;

export function reports(link) {
  const now = el("div", { id: "calibration" }, el("p", { class: "quiet" }, "Not asked yet."));
  const list = el("ul", { class: "files", id: "report-files" });
  const shown = el("div", { class: "scroll", id: "report" }, el("p", { class: "quiet" }, "Choose a report."));
  const again = el("button", { type: "button", onclick: () => look() }, "Look again");
  $("view-reports").append(
    el("section", { class: "card" }, el("h2", {}, "Calibration of this robot"), now),
    el("section", { class: "card" }, el("div", { class: "row" }, el("h2", {}, "Files"), again), list),
    el("section", { class: "card wide", "aria-live": "polite" }, shown));

  async function look() {
    calibration();
    try {
      const files = await (await fetch("/reports")).json();
      list.replaceChildren(...files.map((file) => {
        const open = () => show(file, button);
        const button = el("button", { type: "button", class: "file", onclick: open },
          `${file.directory}/${file.name}`, el("span", { class: "quiet" }, new Date(file.changed * 1000).toLocaleString()));
        return el("li", {}, button);
      }));
      if (files.length === 0) list.append(el("li", { class: "quiet" }, "None yet: `axle calibrate --room 2x2` and `axle tournament --markdown > reports/tournament.md --svg reports` write some."));
    } catch {
      list.replaceChildren(el("li", { class: "quiet" }, "The gateway does not answer."));
    }
  }

  async function calibration() {
    try {
      now.replaceChildren(...applied(await link.ask("calibration")));
    } catch (fault) {
      now.replaceChildren(el("p", { class: "quiet" }, fault.message));
    }
  }

  async function show(file, button) {
    for (const other of list.querySelectorAll("[aria-current]")) other.removeAttribute("aria-current");
    button.setAttribute("aria-current", "true");
    const address = `/reports/${encodeURIComponent(file.directory)}/${encodeURIComponent(file.name)}`;
    const title = el("h2", {}, file.name);
    if (/\.(svg|png)$/.test(file.name)) {
      return shown.replaceChildren(title, el("img", { src: `${address}?${file.changed}`, alt: file.name, class: "picture" }));
    }
    const answer = await fetch(address);
    const text = await answer.text();
    if (!answer.ok) return shown.replaceChildren(title, el("p", { class: "quiet" }, text));
    if (file.name.endsWith(".json")) return shown.replaceChildren(title, ...ofJson(text));
    if (file.name.endsWith(".csv")) {
      const [head, ...rows] = text.trim().split("\n").map((line) => line.split(","));
      return shown.replaceChildren(title, table(head, rows));
    }
    if (file.name.endsWith(".md")) return shown.replaceChildren(title, ...ofMarkdown(text));
    return shown.replaceChildren(title, el("pre", {}, text));
  }

  document.querySelector("[data-show=reports]").addEventListener("click", look);
  link.addEventListener("robot", () => document.body.dataset.view === "reports" && calibration());
}

/** A calibration, as a table for people. */
function applied({ calibration, track, full_speed: full }) {
  const { version, made, wheels, scale } = calibration;
  const word = version === 0 ? "Never measured: the robot drives as it is described." : `Version ${version}, ${made}`;
  const rows = [];
  for (const side of ["left", "right"]) {
    for (const [way, branch] of Object.entries(wheels[side])) {
      rows.push([`${side} ${way}`, branch.dead_band ?? branch.start, branch.ks, branch.kv, branch.ka].map((value) =>
        typeof value === "string" ? value : number(value, 4)));
    }
  }
  return [
    el("p", {}, word),
    el("p", { class: "quiet" }, `Track ${number(calibration.track ?? track, 4, "m")}${calibration.track ? ` (described: ${number(track, 4, "m")})` : ", as described"}; ` +
      `wheels cover ${number(scale.left, 4)} and ${number(scale.right, 4)} of what they count; a full signal is ${number(full, 2, "m/s")}.`),
    el("div", { class: "scroll" }, table(["wheel", "dead band", "ks", "kv, s/m", "ka, s²/m"], rows)),
  ];
}

function ofJson(text) {
  let value;
  try {
    value = JSON.parse(text);
  } catch {
    return [el("pre", {}, text)];
  }
  if (!Array.isArray(value.quantities)) return [el("pre", {}, JSON.stringify(value, null, 2))];
  const rows = value.quantities.map(({ name, unit, value: mean, low, high, repeatability }) =>
    [name, number(mean, 5), `± ${number((high - low) / 2, 5)}`, unit, number(repeatability, 5)]);
  const mm = (metres) => number(metres * 1000, 1, "mm");
  const square = typeof value.square_before_m === "number"
    ? `Odometry misses the end of a square by ${mm(value.square_before_m)} before, ${mm(value.square_after_m)} after.` : "";
  return [
    table(["quantity", "value", "95 %", "unit", "from pass to pass"], rows),
    el("p", {}, square),
    ...(value.findings ?? []).map((finding) => el("p", { class: "quiet" }, typeof finding === "string" ? finding : JSON.stringify(finding))),
  ];
}

/** Headings, tables and paragraphs; everything else stays text. */
function ofMarkdown(text) {
  const parts = [];
  const lines = text.split("\n");
  const cells = (line) => line.trim().replace(/^\||\|$/g, "").split("|").map((cell) => cell.trim().replace(/\*\*|`/g, ""));
  for (let at = 0; at < lines.length; at += 1) {
    const line = lines[at];
    if (line.startsWith("#")) parts.push(el("h3", {}, line.replace(/^#+ */, "")));
    else if (line.trim().startsWith("|")) {
      const block = [];
      while (lines[at]?.trim().startsWith("|")) block.push(lines[at++]);
      at -= 1;
      const [head, , ...rows] = block;
      parts.push(table(cells(head), rows.map(cells)));
    } else if (line.trim()) parts.push(el("p", {}, line.replace(/\*\*|`/g, "")));
  }
  return parts;
}

function table(head, rows) {
  const isNumber = (text) => /^[±+\-−]?\s*[\d.]/.test(String(text));
  const cell = (text, index) => el("td", { class: index > 0 && isNumber(text) ? "number" : null }, String(text ?? ""));
  const node = el("table", {},
    el("thead", {}, el("tr", {}, ...head.map((text, index) => el("th", { scope: "col", class: index > 0 ? "number" : null }, text)))),
    el("tbody", {}, ...rows.slice(0, MOST).map((row) => el("tr", {}, ...row.map(cell)))));
  if (rows.length > MOST) node.append(el("caption", {}, `the first ${MOST} of ${rows.length} rows`));
  return node;
}
