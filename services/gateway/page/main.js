// The page: the head with the AllStop, the views, and the way that a person gives.

import { charts } from "./chart.js";
import { $, duration, el, isTyping, number, say } from "./dom.js";
import { Hand } from "./drive.js";
import { lesson } from "./lesson.js";
import { Link } from "./link.js";
import { Plane } from "./map.js";
import { reports } from "./reports.js";
import { log, services } from "./services.js";

const link = new Link();
const map = new Plane($("map"));
const write = log(link);
let noticed = 0;

/** Something that a person should know; the same again is said once. */
function tell(text) {
  const notice = $("notice");
  if (notice.hidden || notice.textContent !== text) write(text);
  say(notice, text);
  notice.hidden = false;
  clearTimeout(noticed);
  noticed = setTimeout(() => { notice.hidden = true; }, 6000);
}
addEventListener("error", (event) => tell(`fault of this page: ${event.message}`));
link.addEventListener("guest", ({ detail: { name, role } }) => {
  document.body.dataset.role = role;
  const leave = $("leave");
  leave.hidden = !name;
  say(leave, `Log out ${name ?? ""}`);
  leave.title = role === "viewer" ? `${name} may look and stop` : `${name} may drive`;
});
$("leave").addEventListener("click", async () => {
  hand.letGo();
  await fetch("/logout", { method: "POST" });
  location.reload();
});
link.addEventListener("refusal", (event) => tell(event.detail));

services(link);
charts(link);
lesson(link);
reports(link);
const hand = new Hand(link, $("drive"), tell);

// ---- Views ------------------------------------------------------------------------------------------------------------

for (const button of document.querySelectorAll("nav button")) {
  button.addEventListener("click", () => {
    document.body.dataset.view = button.dataset.show;
    for (const other of document.querySelectorAll("nav button")) other.removeAttribute("aria-current");
    button.setAttribute("aria-current", "page");
    hand.letGo();
  });
}

// ---- The head: link, robots, gate, stop --------------------------------------------------------------------------------

let gate = null;
let gateAt = 0;

link.addEventListener("link", (event) => {
  document.body.dataset.link = event.detail ? "on" : "off";
  if (!event.detail) tell("The connection to the gateway is lost. What was driven by hand brakes; the page connects anew.");
});

link.on("robots", (robots) => {
  const select = $("robots");
  const wanted = link.robot || sessionStorage.getItem("robot") || "";
  const names = [...select.options].map((option) => option.value);
  if (names.join() !== robots.join()) {
    select.replaceChildren(...robots.map((robot) => el("option", { value: robot }, robot)));
  }
  const robot = robots.includes(wanted) ? wanted : robots[0];
  if (robot && robot !== link.robot) show(robot);
  else if (robot) select.value = robot;
});
$("robots").addEventListener("change", (event) => show(event.target.value));

function show(robot) {
  sessionStorage.setItem("robot", robot);
  $("robots").value = robot;
  [gate, task] = [null, null];
  [$("waiting").hidden, $("confirm").hidden] = [true, true];
  map.forget();
  map.touch();
  link.watch(robot);
  document.title = `${robot} – Axle`;
}

link.on("gate/state", (state, at) => {
  [gate, gateAt] = [state, at];
  const { dataset } = $("gate");
  [dataset.enabled, dataset.motion, dataset.stop] = [state.enabled, state.motion, state.stop ?? ""];
});

async function stop() {
  const button = $("stop");
  button.dataset.is = "stopping";
  hand.letGo();
  try {
    const { ms } = await link.ask("stop");
    write(`AllStop: acknowledged after ${number(ms, 0)} ms`);
  } catch (fault) {
    tell(`AllStop: ${fault.message}`);
  } finally {
    delete button.dataset.is;
  }
}
// At the press, not at the release: nobody waits with a finger on a stop.
$("stop").addEventListener("pointerdown", (event) => event.button === 0 && stop());
$("stop").addEventListener("click", (event) => event.detail === 0 && stop());
addEventListener("keydown", (event) => {
  if (event.key.toLowerCase() === "x" && !isTyping(event) && !event.ctrlKey && !event.metaKey && !event.altKey) stop();
});

$("enable").addEventListener("click", async () => {
  try {
    await link.ask("enable", { stop: gate?.stop ?? null });
    write("the wheels may move again");
  } catch (fault) {
    tell(`Enable: ${fault.message}`);
  }
});

setInterval(() => {
  const chip = (node, is, text) => {
    node.dataset.is = is;
    say(node, text);
  };
  const age = performance.now() - link.heard;
  if (!link.isUp) chip($("link"), "bad", "not connected");
  else if (age > 500) chip($("link"), "warn", `slow: ${duration(age / 1000)}`);
  else chip($("link"), "good", "connected");
  const quiet = performance.now() / 1000 - gateAt;
  if (!gate || !link.isUp) chip($("gate"), "", "no gate");
  else if (quiet > 2.5) chip($("gate"), "bad", `gate silent for ${duration(quiet)}`);
  else if (!gate.enabled) chip($("gate"), "bad", gate.stop ? "stopped" : "not enabled");
  else chip($("gate"), "good", gate.motion === "standing" ? "enabled" : gate.motion);
  $("enable").hidden = !gate || gate.enabled;
}, 100);

// ---- Where the robot is ---------------------------------------------------------------------------------------------------

link.on("navigator/pose", (data) => {
  map.setPose(data);
  const { x, y, heading } = data.pose;
  const turn = Math.atan2(Math.sin(heading), Math.cos(heading));
  say($("pose"), `x ${number(x)} m   y ${number(y)} m   ${number((turn * 180) / Math.PI, 0)}°`);
});
link.on("emulator/truth", (data) => { map.truth = data; });
link.on("drive/update", ({ track }) => { map.track = track; });
link.on("pilot/plan", (plan) => {
  map.plan = plan.path.map(([x, y]) => ({ x, y }));
  map.touch();
});
link.on("map", (floor) => {
  map.setFloor(floor);
  $("whole").hidden = false;
});
link.on("pilot/field", (field) => {
  map.arrows = field.arrows;
  map.touch();
});

// ---- The way ----------------------------------------------------------------------------------------------------------------

let task = null;
let asked = 0;

/** "1,0 1,1,1.57 2,1!" as points, or a sentence that says what is wrong; at the last one the robot waits for a person. */
function parse(text) {
  const points = [];
  for (const word of text.trim().split(/[\s;]+/).filter(Boolean)) {
    const waits = word.endsWith("!");
    const [x, y, heading, more] = word.slice(0, waits ? -1 : undefined).split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));
    if (![x, y].every(Number.isFinite) || Number.isNaN(heading) || more !== undefined) {
      return `“${word.slice(0, 30)}” is no point; write x,y in metres`;
    }
    points.push({ x, y, ...(heading === undefined ? {} : { heading }), ...(waits ? { waits } : {}) });
  }
  return points;
}

map.addEventListener("points", ({ detail: points }) => {
  const word = ({ x, y, heading, waits }) => [x, y, heading].filter((v) => v !== undefined).join(",") + (waits ? "!" : "");
  const text = points.map(word).join(" ");
  if (document.activeElement !== $("points")) $("points").value = text;
  $("go").disabled = points.length === 0;
  preview(points);
});
map.addEventListener("cross", ({ detail }) => say($("preview"), `Cross at ${number(detail.x)}, ${number(detail.y)}; Enter adds it.`));
map.addEventListener("follow", ({ detail }) => $("follow").setAttribute("aria-pressed", String(detail)));
$("points").addEventListener("input", () => {
  const points = parse($("points").value);
  if (typeof points === "string") {
    say($("preview"), points);
    $("go").disabled = true;
  } else map.setPoints(points);
});

/** Points as they are sent, and the numbers of those at which the robot waits for a person. */
const plain = (points) => points.map(({ waits, ...point }) => point);
const waiting = (points) => points.flatMap(({ waits }, index) => (waits ? [index + 1] : []));

/** What the planner makes of the points, drawn before anything moves. */
async function preview(points) {
  const mine = ++asked;
  if (points.length === 0) return say($("preview"), "Click the map to add way points.");
  try {
    const plan = await link.ask("plan", { points: plain(points) });
    if (mine !== asked) return;
    map.preview = plan.path.map(([x, y]) => ({ x, y }));
    map.touch();
    say($("preview"), `${points.length} way point${points.length > 1 ? "s" : ""}, ${number(plan.length)} m. ${plan.notes.join(" ")}`);
  } catch (fault) {
    if (mine === asked) say($("preview"), fault.message);
  }
}

$("task").addEventListener("submit", async (event) => {
  event.preventDefault();
  const points = map.points;
  if (points.length === 0) return;
  try {
    map.trail = [];
    map.preview = [];
    const corrector = $("corrector").value || null;
    ({ task } = await link.ask("go", { points: plain(points), corrector, confirm: waiting(points) }));
    $("cancel").disabled = false;
  } catch (fault) {
    tell(`Go: ${fault.message}`);
  }
});
$("clear").addEventListener("click", () => {
  map.setPoints([]);
  $("points").value = "";
});
$("cancel").addEventListener("click", async () => {
  if (task === null) return;
  try {
    await link.ask("cancel", { task });
  } catch (fault) {
    tell(`Cancel: ${fault.message}`);
  }
});
$("confirm").addEventListener("click", async () => {
  try {
    await link.ask("confirm");
    $("confirm").hidden = true;
  } catch (fault) {
    tell(`Confirm: ${fault.message}`);
  }
});
$("whole").addEventListener("click", () => map.showFloor());
$("zoom-in").addEventListener("click", () => map.zoom(1.4));
$("zoom-out").addEventListener("click", () => map.zoom(1 / 1.4));
$("follow").addEventListener("click", () => map.follow(!map.isFollowing));
link.on("correctors", (names) => {
  const select = $("corrector");
  if (select.options.length === names.length + 1) return;
  select.replaceChildren(select.options[0], ...names.map((name) => el("option", { value: name }, name)));
});

link.on("pilot/progress", (progress) => {
  const { phase } = progress;
  const failed = typeof phase === "object" ? Object.values(phase.failed ?? {})[0] : null;
  const word = typeof phase === "string" ? phase : "failed";
  const isOver = !["planning", "running"].includes(word);
  task = isOver ? null : progress.task;
  $("cancel").disabled = isOver;
  $("done").value = word === "done" ? 1 : progress.fraction;
  $("progress").dataset.phase = word;
  const stands = isOver ? "" : progress.waiting ?? "";
  $("waiting").hidden = stands === "";
  $("confirm").hidden = !stands.startsWith("for a person");
  say($("waiting"), stands.startsWith("for a person") ? "It waits for a person at a loading point." : `It waits ${stands}.`);
  const why = failed ? `: ${failed.why ?? failed.hint ?? JSON.stringify(failed)}` : "";
  say($("progress"), `${word}${why}; ${progress.reached} of ${progress.points} points, ` +
    `${number(progress.distance_left)} m from the last, ${duration(progress.elapsed)}, ${progress.corrector}`);
});
