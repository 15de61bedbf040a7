// Services with their beats and ages, how old each stream is, and the log.

import { $, duration, el, number, say } from "./dom.js";

/** Lines of the log that are kept. */
const MOST = 400;
const STREAMS = ["gate/state", "robot/encoders", "navigator/pose", "emulator/truth", "drive/update"];

export function services(link) {
  const head = ["service", "robot", "host", "up", "beats", "late", "late p99", "sent", "received", "refused", "version"];
  const body = el("tbody");
  const count = el("p", { class: "quiet", id: "service-count" }, "Nobody has been seen yet.");
  const ages = el("tbody");
  $("view-services").append(
    el("section", { class: "card" }, el("h2", {}, "Services"), count, el("div", { class: "scroll" },
      el("table", { id: "services" },
        el("thead", {}, el("tr", {}, ...head.map((text, index) => el("th", { scope: "col", class: index > 2 && index < 10 ? "number" : null }, text)))),
        body))),
    el("section", { class: "card" }, el("h2", {}, "Streams of this robot"),
      el("div", { class: "scroll" }, el("table", { id: "ages" },
        el("thead", {}, el("tr", {}, el("th", { scope: "col" }, "stream"), el("th", { scope: "col", class: "number" }, "age"))), ages))));

  link.on("services", (rows) => {
    body.replaceChildren(...rows.map((row) => {
      const { status } = row;
      const cells = [row.service, row.robot, `${row.host}/${row.pid}`];
      if (!status) {
        return el("tr", { "data-is": "bad" }, ...cells.map((text) => el("td", {}, text)),
          el("td", { colspan: head.length - 3 }, "silent: alive, but does not answer"));
      }
      const late = status.beats > 0 && status.late / status.beats > 0.05;
      const numbers = [duration(status.uptime), status.beats, status.late,
        status.beats > 0 ? number(status.late_p99 * 1000, 1, "ms") : "–", status.sent, status.received, status.refused];
      return el("tr", { "data-is": late ? "warn" : null }, ...cells.map((text) => el("td", {}, text)),
        ...numbers.map((text) => el("td", { class: "number" }, String(text))), el("td", {}, status.version));
    }));
    const silent = rows.filter((row) => !row.status).length;
    say(count, `${rows.length} processes are alive${silent ? `, ${silent} of them silent` : ""}.`);
  });

  const heard = new Map();
  const cells = new Map(STREAMS.map((stream) => {
    const cell = el("td", { class: "number" }, "–");
    ages.append(el("tr", {}, el("td", {}, stream), cell));
    link.on(stream, (_, at) => heard.set(stream, at));
    return [stream, cell];
  }));
  link.addEventListener("robot", () => heard.clear());
  setInterval(() => {
    const now = performance.now() / 1000;
    for (const [stream, cell] of cells) {
      const age = heard.has(stream) ? Math.max(now - heard.get(stream), 0) : null;
      say(cell, age === null ? "never heard" : age < 0.15 ? "now" : duration(age));
      cell.parentNode.dataset.is = age !== null && age > 2 ? "bad" : "";
    }
  }, 300);
}

/** What services log, and what this page notices. */
export function log(link) {
  const list = el("ol", { class: "log", id: "log-lines" });
  const level = el("select", { id: "log-level", "aria-label": "Which lines are shown" },
    el("option", { value: "info" }, "everything"), el("option", { value: "warn" }, "warnings and errors"));
  level.addEventListener("change", () => show());
  $("view-log").append(el("section", { class: "card" },
    el("div", { class: "row" }, el("h2", {}, "Log"), level), list));
  const show = () => {
    for (const line of list.children) line.hidden = level.value === "warn" && !["warn", "error"].includes(line.dataset.level);
  };
  const add = (kind, who, text) => {
    const time = new Date().toTimeString().slice(0, 8);
    list.prepend(el("li", { "data-level": kind }, el("time", {}, time), " ", el("b", {}, kind), " ", el("i", {}, who), " ", text));
    while (list.children.length > MOST) list.lastChild.remove();
    show();
  };
  link.on("event:log", ({ level: kind, service, text, fields, dropped }) => {
    const about = Object.entries(fields ?? {}).filter(([name]) => name !== "at").map(([name, value]) => ` ${name}=${value}`).join("");
    add(String(kind), String(service), `${text}${about}${dropped ? ` (${dropped} lines before it were left out)` : ""}`);
  });
  link.addEventListener("word", ({ detail }) => {
    if (detail.lost > 0) add("warn", "page", `${detail.lost} events were missed: this browser is slower than they come`);
  });
  return (text) => add("info", "page", text);
}
