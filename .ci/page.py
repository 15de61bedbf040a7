"""Proves the page in a real browser without a window: page.py AXLE DIRECTORY.

Starts a mesh with the gateway, loads the page in Chromium and does what people do: click way points and go, watch the pose
arrive, stop, drive by hand, load the page anew, look from two browsers at once. Then what must not happen: a browser that is
lost or frozen while it drives, one that reads nothing, a page of another site, names that are markup. The pictures of the
page stay in DIRECTORY for people to look at.
"""

import base64
import http.server
import json
import math
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

import zenoh
from browser import Browser, eventually
from live import await_mesh, end_mesh
from page_login import logs_in_over_tls
from shown import (PATIENT, ROOT, await_robot, driven, enable, free_port, gate, give_way, is_standing, phase, pose,
                   slow_way)

GATEWAY = """
[[services]]
kind = "gateway"
params = { listen = "127.0.0.1:0", foxglove_port = 0, reports = ["reports"] }
"""
MAP = f'\n[[services]]\nkind = "map"\nparams = {{ file = "{ROOT}/deploy/maps/warehouse.yaml" }}\n'


def write_reports(axle, where):
    """Reports to look at."""
    reports = where / "reports"
    reports.mkdir()
    tournament = [axle, "tournament", "--only", "d-corrector", "w-corrector", "--courses", "square", "--scenarios", "clean",
                  "--runs", "3"]
    known = subprocess.run([*map(str, tournament), "--markdown"], capture_output=True, text=True, check=True, cwd=where)
    (reports / "tournament.md").write_text(known.stdout)
    subprocess.run([*map(str, tournament), "--svg", str(reports)], capture_output=True, check=True, cwd=where)
    (reports / "r1.report.json").write_text(json.dumps({
        "quantities": [{"name": "left forward ks", "unit": "", "value": 0.01354, "low": 0.01215, "high": 0.01493,
                        "repeatability": 0.0007}],
        "square_before_m": 0.0312, "square_after_m": 0.0041, "findings": ["<b>a finding that is markup</b>"]}))


class Mesh:
    """`axle up` with a gateway."""

    def __init__(self, axle, where):
        write_reports(axle, where)
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        topology = where / "page.toml"
        demo = (ROOT / "deploy/topologies/demo.toml").read_text()
        for part, patient in PATIENT.items():
            assert part in demo, part
            demo = demo.replace(part, patient)
        topology.write_text(demo + GATEWAY + MAP)
        self.log = where / "up.log"
        environment = dict(os.environ, AXLE_STATE=str(where / "state"), NO_COLOR="1")
        with open(self.log, "w") as words:
            command = [str(axle), "up", str(topology), "--listen", self.endpoint]
            self.up = subprocess.Popen(command, cwd=where, env=environment, stdin=subprocess.DEVNULL, stdout=words,
                                       stderr=words)
        await_mesh(self.up, self.log)
        self.site = eventually("the gateway says where the page is", self.find_site)
        self.port = int(self.site.rsplit(":", 1)[1])

    def find_site(self):
        found = re.search(r"the page is at (http://\S+)", self.log.read_text())
        return found and found[1].replace("127.0.0.1", "localhost")

    def end(self):
        end_mesh(self.up, self.log)


# ---- What people do ----------------------------------------------------------------------------------------------------

def clicks_and_goes(page, pictures):
    await_robot(page)
    page.shoot(pictures / "1-loaded.png")
    give_way(page, (0.6, 0.0), (0.6, 0.5))
    page.wait("/2 way points, [0-9.]+ m/.test(document.querySelector('#preview').textContent)")
    page.shoot(pictures / "2-way.png")
    last = page.run("document.querySelector('#points').value").split(" ")[-1]
    goal = tuple(float(part) for part in last.split(","))
    page.click("#go")
    page.wait("document.querySelector('#progress').dataset.phase === 'running'")
    page.wait("Number(document.querySelector('#map').dataset.x) > 0.2")
    page.shoot(pictures / "3-driving.png")
    page.wait("document.querySelector('#progress').dataset.phase === 'done'", 40)
    x, y, _ = pose(page)
    off = math.hypot(x - goal[0], y - goal[1])
    assert off < 0.05, f"the robot stands {off:.3f} m from {goal}"
    print(f"clicked a way and went: the pose arrived {off * 100:.1f} cm from the last point")


def stops(page, other, pictures):
    slow_way(page, "3,0.5 3,3")
    before = time.monotonic()
    page.click("#stop")
    page.wait("document.querySelector('#gate').dataset.enabled === 'false'", 2)
    seen = time.monotonic() - before
    eventually("the robot stands", lambda: is_standing(page), 3)
    page.wait("/stopped/.test(document.querySelector('#gate').textContent)")
    eventually("the other browser shows the stop", lambda: gate(other)["enabled"] == "false", 2)
    page.wait("['failed', 'canceled'].includes(document.querySelector('#progress').dataset.phase)")
    page.shoot(pictures / "4-stopped.png")
    # Whoever enables quotes the stop that the page shows.
    enable(other)
    print(f"AllStop by one click: shown after {seen * 1e3:.0f} ms, in both browsers; enabled from the other one")


def loads_anew(page):
    slow_way(page, "3,0.5 3,3")
    page.reload()
    page.wait("document.querySelector('#progress').dataset.phase === 'running'")
    await_robot(page)
    time.sleep(4)  # longer than a lost page has
    assert phase(page) == "running", "the task of a page that came back goes on"
    page.click("#cancel")
    page.wait("document.querySelector('#progress').dataset.phase === 'canceled'")
    eventually("the robot stands", lambda: is_standing(page), 4)
    print("a page that is loaded anew takes its task up again, and cancels it")


def drives_by_hand(page, other):
    x, y = page.box(".pad")
    before = pose(page)
    page.mouse("mouseMoved", x, y)
    page.mouse("mousePressed", x, y, 1)
    page.mouse("mouseMoved", x, y - 60, 1)
    page.wait("document.querySelector('#gate').dataset.motion === 'driving'")
    page.wait("document.querySelector('#whose').textContent === 'You drive.'")
    # The other browser sees who drives, and is refused.
    other.wait("document.querySelector('#whose').textContent === 'Another page drives.'")
    x2, y2 = other.box(".pad")
    other.mouse("mouseMoved", x2, y2)
    other.mouse("mousePressed", x2, y2, 1)
    other.mouse("mouseMoved", x2, y2 + 60, 1)
    other.wait("/busy: .*drives r1 by hand/.test(document.querySelector('#notice').textContent)")
    other.mouse("mouseReleased", x2, y2 + 60)
    page.mouse("mouseReleased", x, y - 60)
    eventually("letting go stops", lambda: is_standing(page), 3)
    after = pose(page)
    assert math.hypot(after[0] - before[0], after[1] - before[1]) > 0.03, "the stick moved the robot"
    # The same with keys.
    page.run("document.activeElement.blur()")
    page.key("keyDown", "ArrowLeft")
    page.wait("document.querySelector('#gate').dataset.motion === 'driving'")
    page.key("keyUp", "ArrowLeft")
    eventually("releasing the key stops", lambda: is_standing(page), 3)
    assert abs(pose(page)[2] - after[2]) > 0.02, "the key turned the robot"
    print("the stick and the keys drive, letting go stops, and the other browser is refused meanwhile")


def keeps_the_contract(page):
    page.run("document.querySelector('#drive details').open = true")
    before = pose(page)
    page.run("Object.assign(document.querySelector('#metres'), {value: 0.2})")
    page.click("#drive-distance")
    page.wait("/0.200 m: completed/.test(document.querySelector('#stage').textContent)", 8)
    moved = math.hypot(*(a - b for a, b in zip(pose(page)[:2], before[:2])))
    assert abs(moved - 0.2) < 0.03, moved
    page.click("#rotate-degrees")
    page.wait("/90.0 °: completed/.test(document.querySelector('#stage').textContent)", 12)
    page.click("#drive-reset")
    page.wait("[...document.querySelectorAll('#wheels tbody tr td:last-child')].every(cell => Math.abs(cell.textContent) < 0.01)")
    page.click("#drive-get")
    page.click("#drive-disable")
    page.wait("/disabled/.test(document.querySelector('#drive-state').textContent)")

    def enabled():
        # The page quotes the stop that the drive has said last; until it has said the new one, that is refused, rightly.
        page.click("#drive-enable")
        return page.run("/^enabled/.test(document.querySelector('#drive-state').textContent)")
    eventually("the drive is enabled", enabled)
    page.click("#drive-stop")
    page.wait("/stopped, disabled/.test(document.querySelector('#drive-state').textContent)")
    enable(page)
    print("every operation of the Generic Differential Drive contract works from the page")


def goes_by_keyboard(page):
    page.click("#clear")
    page.run("document.querySelector('#map').focus()")
    for key in ("ArrowRight", "ArrowRight", "ArrowUp", "Enter", "Backspace", "Enter"):
        page.press(key)
    page.wait("document.querySelector('#points').value.split(' ').length === 1 && document.querySelector('#points').value !== ''")
    page.run("document.querySelector('#go').focus()")
    page.press("Enter")
    page.wait("['planning', 'running'].includes(document.querySelector('#progress').dataset.phase)")
    page.wait("document.querySelector('#progress').dataset.phase === 'done'", 40)
    # x is the stop, everywhere but in fields.
    page.run("document.querySelector('#points').focus()")
    page.press("x")
    assert gate(page)["enabled"] == "true", "a letter in a field is a letter"
    page.run("document.activeElement.blur()")
    page.press("x")
    page.wait("document.querySelector('#gate').dataset.enabled === 'false'")
    enable(page)
    page.click("#clear")
    print("a way is given, driven and stopped by the keyboard alone")


def waits_for_a_person(page, pictures):
    page.wait("document.querySelector('#map').dataset.floor === 'warehouse'")
    page.click("#whole")
    time.sleep(0.3)
    page.shoot(pictures / "11-floor.png")
    page.click("#follow")
    x, y, _ = pose(page)
    slow_way(page, f"{x + 0.3:.2f},{y:.2f}! {x:.2f},{y:.2f}")
    page.wait("!document.querySelector('#confirm').hidden", 40)
    assert "waits for a person" in page.run("document.querySelector('#waiting').textContent")
    page.shoot(pictures / "12-waiting.png")
    page.click("#confirm")
    page.wait("document.querySelector('#progress').dataset.phase === 'done'", 40)
    assert page.run("document.querySelector('#confirm').hidden && document.querySelector('#waiting').hidden")
    page.click("#clear")
    print("the floor is drawn, and a robot at a loading point drives on when a person says so")


def looks_around(page, pictures):
    page.click("[data-show=charts]")
    time.sleep(0.5)
    page.shoot(pictures / "5-charts.png")
    page.click("[data-show=services]")
    page.wait("document.querySelectorAll('#services tbody tr').length >= 11")
    page.wait("/11 processes are alive[.]/.test(document.querySelector('#service-count').textContent)")
    page.shoot(pictures / "6-services.png")
    page.click("[data-show=reports]")
    page.wait("document.querySelectorAll('#report-files .file').length >= 3")
    page.wait("document.querySelectorAll('#calibration tbody tr').length === 4")
    names = page.run("[...document.querySelectorAll('#report-files .file')].map(file => file.firstChild.textContent)")
    for part, expected in (("tournament.md", "#report table td"), ("r1.report.json", "#report table td"), (".svg", "#report img")):
        index = next(index for index, name in enumerate(names) if name.endswith(part))
        page.run(f"document.querySelectorAll('#report-files .file')[{index}].click()")
        page.wait(f"document.querySelector({json.dumps(expected)}) !== null")
        if part == "r1.report.json":
            page.wait("document.querySelector('#report').textContent.includes('<b>a finding')")
        page.wait("[...document.querySelectorAll('#report img')].every(image => image.complete && image.naturalWidth > 0)")
        page.shoot(pictures / f"6-report-{part.strip('.').replace('.', '-')}.png")
    page.click("[data-show=lesson]")
    page.wait("document.querySelectorAll('[data-formula]').length === 3")
    lesson = "document.querySelector('#lesson-shape').textContent"
    before = page.run(lesson)
    page.run("(input => { input.value = -0.4; input.dispatchEvent(new Event('input')); })(document.querySelector('#lesson-left'))")
    page.wait(f"{lesson} !== {json.dumps(before)}")
    page.shoot(pictures / "7-lesson.png")
    page.click("[data-show=log]")
    page.wait("document.querySelectorAll('#log-lines li').length > 0")
    page.shoot(pictures / "8-log.png")
    page.click("[data-show=map]")
    page.scheme("dark")
    time.sleep(0.3)
    page.shoot(pictures / "9-dark.png")
    page.resize(390, 844, phone=True)
    time.sleep(0.3)
    wide = page.run("document.documentElement.scrollWidth")
    assert wide <= 390, f"on a phone the page is {wide} pixels wide"
    stop = page.run("(({top, bottom, width}) => [top, bottom, width])(document.querySelector('#stop').getBoundingClientRect())")
    assert stop[1] <= 844 and stop[2] > 200, f"the stop is in reach of a thumb: {stop}"
    page.shoot(pictures / "10-phone.png")
    for view in ("charts", "services", "reports", "lesson"):
        page.click(f"[data-show={view}]")
        time.sleep(0.3)
        wide = page.run("document.documentElement.scrollWidth")
        assert wide <= 390, f"on a phone the view {view} is {wide} pixels wide"
        page.shoot(pictures / f"10-phone-{view}.png")
    page.click("[data-show=map]")
    page.scheme("light")
    page.resize(1280, 860)
    print("map, charts, services, reports, lesson, log, dark and phone: shown")


# ---- What must not happen ----------------------------------------------------------------------------------------------

def loses_the_driver(browser, mesh, watcher):
    """A browser that vanishes, and one that freezes, while they hold the stick."""
    for name, lose in (
        ("closed", lambda page: page.close()),
        ("frozen", lambda page: page.channel.do("Page.setWebLifecycleState", state="frozen")),
        ("hidden", lambda page: page.run(
            "Object.defineProperty(document, 'hidden', {get: () => true}); document.dispatchEvent(new Event('visibilitychange'))")),
    ):
        page = browser.page(mesh.site)
        await_robot(page)
        x, y = page.box(".pad")
        page.mouse("mouseMoved", x, y)
        page.mouse("mousePressed", x, y, 1)
        page.mouse("mouseMoved", x + 50, y - 20, 1)
        page.wait("document.querySelector('#gate').dataset.motion === 'driving'")
        eventually("the watcher sees it drive", lambda: gate(watcher)["motion"] == "driving")
        begin = time.monotonic()
        lose(page)
        eventually(f"the robot of a {name} browser stands", lambda: is_standing(watcher), 3)
        print(f"a browser that is {name} while it drives: the robot stands after {time.monotonic() - begin:.2f} s")
        if name != "closed":
            page.close()


def loses_the_giver(browser, mesh, watcher):
    page = browser.page(mesh.site)
    await_robot(page)
    slow_way(page, "3,0 3,3")
    page.close()
    begin = time.monotonic()
    watcher.wait("['canceled', 'failed'].includes(document.querySelector('#progress').dataset.phase)", 8)
    assert phase(watcher) == "canceled", phase(watcher)
    eventually("the robot stands", lambda: is_standing(watcher), 3)
    print(f"a browser that is closed with its task: cancelled after {time.monotonic() - begin:.1f} s")


def handshake(mesh, origin, host=None, path="/live"):
    """Asks for a WebSocket as a program would; returns the socket and the first line of the answer."""
    plain = socket.create_connection(("127.0.0.1", mesh.port), timeout=10)
    key = base64.b64encode(os.urandom(16)).decode()
    lines = [f"GET {path} HTTP/1.1", f"Host: {host or f'localhost:{mesh.port}'}", "Upgrade: websocket", "Connection: Upgrade",
             f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13"]
    lines += [f"Origin: {origin}"] if origin else []
    plain.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
    head = b""
    while b"\r\n\r\n" not in head:
        part = plain.recv(1)
        if not part:
            break
        head += part
    return plain, head.decode().split("\r\n")[0]


def frame(text):
    """A masked text frame, as browsers send it."""
    data, mask = text.encode(), os.urandom(4)
    assert len(data) < 65536
    size = bytes([0x80 | len(data)]) if len(data) < 126 else bytes([0xFE]) + len(data).to_bytes(2, "big")
    return b"\x81" + size + mask + bytes(byte ^ mask[index % 4] for index, byte in enumerate(data))


class Quiet(http.server.BaseHTTPRequestHandler):
    """Another site, whose page tries to reach the gateway."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.end_headers()
        self.wfile.write(b"<title>another site</title>")

    def log_message(self, *_):
        pass


def refuses_others(browser, mesh):
    own = f"http://localhost:{mesh.port}"
    for origin, host, answer in (
        (own, None, "101"), ("http://evil.example", None, "403"), (None, None, "403"), ("null", None, "403"),
        ("http://evil.example", "evil.example", "421"), (own, "192.168.1.7:80", "421"),
    ):
        plain, line = handshake(mesh, origin, host)
        plain.close()
        assert f" {answer} " in line, f"{origin} at {host}: {line}"
    request = urllib.request.Request(f"{mesh.site}/metrics", headers={"Origin": "http://evil.example"})
    try:
        urllib.request.urlopen(request, timeout=10)
        raise AssertionError("the numbers are given to another site")
    except urllib.error.HTTPError as refused:
        assert refused.code == 403, refused.code
    site = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet)
    threading.Thread(target=site.serve_forever, daemon=True).start()
    page = browser.page(f"http://localhost:{site.server_address[1]}/")
    page.wait("document.title === 'another site'")
    outcome = page.run(
        "new Promise((done) => { const socket = new WebSocket('ws://localhost:%d/live');"
        " socket.onopen = () => done('open'); socket.onerror = () => done('refused'); })" % mesh.port)
    read = page.run("fetch('http://localhost:%d/metrics').then(() => 'read', () => 'refused')" % mesh.port)
    framed = page.run(
        "new Promise((done) => { const frame = document.createElement('iframe'); frame.src = 'http://localhost:%d/';"
        " frame.onload = () => { try { done(frame.contentDocument ? 'empty' : 'blocked'); } catch { done('blocked'); } };"
        " document.body.append(frame); })" % mesh.port)
    page.close()
    site.shutdown()
    assert (outcome, read) == ("refused", "refused"), (outcome, read)
    assert framed in ("empty", "blocked"), framed
    print("another site is refused: its WebSocket, its reading, another name of this computer")


def memory(pid):
    return int(re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{pid}/status").read_text())[1])


def gateway_pid(mesh, watcher):
    row = watcher.run("[...document.querySelectorAll('#services tbody tr')].find(row => row.cells[0].textContent === 'gateway')"
                      ".cells[2].textContent")
    return int(row.split("/")[1])


def survives_slow_and_rude_browsers(mesh, watcher):
    pid = gateway_pid(mesh, watcher)
    before = memory(pid)
    slow = []
    for _ in range(10):
        plain, line = handshake(mesh, f"http://localhost:{mesh.port}")
        assert " 101 " in line, line
        plain.sendall(frame('{"ask":{"hello":{}}}') + frame('{"ask":{"watch":{"robot":"r1"}}}'))
        slow.append(plain)
    rude, _ = handshake(mesh, f"http://localhost:{mesh.port}")
    rude.sendall(frame('{"ask":{"hello":{}}}'))
    for text in ("", "{}", "[" * 5000, '{"ask":{"dance":{}}}', '{"ask":{"go":{"robot":"<b>","points":[]}}}') * 50:
        rude.sendall(frame(text))
    # For four seconds the watcher is never told that its link is slow.
    said = watcher.run(
        "new Promise((done) => { const said = new Set();"
        " const look = setInterval(() => said.add(document.querySelector('#link').textContent), 50);"
        " setTimeout(() => { clearInterval(look); done([...said]); }, 4000); })")
    assert said == ["connected"], said
    grown = memory(pid) - before
    assert grown < 8192, f"the gateway grew by {grown} kB"
    for plain in slow:
        # It is given up as lost after `silence` and `grace`, and its connection is closed.
        plain.settimeout(15)
        got = 0
        while True:
            try:
                part = plain.recv(65536)
            except ConnectionError:
                break
            if not part:
                break
            got += len(part)
        assert got < 200_000, f"{got} bytes were sent to a browser that does not read"
        plain.close()
    rude.close()
    assert watcher.run("document.querySelector('#link').textContent") == "connected"
    print(f"ten browsers that read nothing and a rude one: the gateway grew by {grown} kB, the watcher noticed nothing")


def shows_names_as_text(mesh, watcher):
    config = zenoh.Config.from_json5(
        '{ mode: "client", connect: { endpoints: ["%s"] }, scouting: { multicast: { enabled: false } } }' % mesh.endpoint)
    with zenoh.open(config) as session:
        token = session.liveliness().declare_token(
            "axle/<img src=x onerror=window.hurt=1>/@alive/<b id=hurt>bold/<script>window.hurt=1/1/ab")
        watcher.click("[data-show=services]")
        watcher.wait("document.querySelector('#services').textContent.includes('<img src=x onerror=window.hurt=1>')")
        assert watcher.run("document.querySelector('#services img, #hurt, #services script') === null && window.hurt === undefined")
        token.undeclare()
    watcher.click("[data-show=map]")
    print("names that are markup are shown as text")


def tells_its_numbers(mesh):
    with urllib.request.urlopen(f"{mesh.site}/healthz", timeout=10) as answer:
        assert answer.status == 200 and answer.read() == b"ok\n"
        assert "default-src 'none'" in answer.headers["content-security-policy"]
    with urllib.request.urlopen(f"{mesh.site}/metrics", timeout=10) as answer:
        assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
        text = answer.read().decode()
    line = re.compile(r'^[a-z0-9_]+(\{[a-z]+="[^"]*"(,[a-z]+="[^"]*")*\})? [0-9.e+-]+$')
    wrong = [found for found in text.splitlines() if not found.startswith("# ") and not line.match(found)]
    assert not wrong, wrong
    for name in ('axle_up{service="pilot",robot="r1"', 'axle_gate_enabled{robot="r1"} 1', "axle_gateway_browsers "):
        assert name in text, f"{name} is missing in\n{text}"
    turned = int(re.search(r"^axle_gateway_turned_away_total (\d+)$", text, re.M)[1])
    assert turned > 0, "those who were turned away are counted"
    print(f"/healthz and /metrics: {len(text.splitlines())} lines")


def main():
    axle, where = (pathlib.Path(part).resolve() for part in sys.argv[1:])
    shutil.rmtree(where, ignore_errors=True)
    where.mkdir(parents=True)
    mesh = Mesh(axle, where)
    try:
        browser = Browser(where)
        try:
            page, watcher = browser.page(mesh.site), browser.page(mesh.site)
            try:
                driven(clicks_and_goes, page, where)
                await_robot(watcher)
                driven(stops, page, watcher, where)
                driven(loads_anew, page)
                drives_by_hand(page, watcher)
                driven(keeps_the_contract, page)
                driven(goes_by_keyboard, page)
                driven(waits_for_a_person, page, where)
                looks_around(page, where)
                loses_the_driver(browser, mesh, watcher)
                driven(lambda one: loses_the_giver(browser, mesh, one), watcher)
                refuses_others(browser, mesh)
                survives_slow_and_rude_browsers(mesh, watcher)
                shows_names_as_text(mesh, watcher)
                tells_its_numbers(mesh)
            except BaseException:
                for name, one in (("page", page), ("watcher", watcher)):
                    one.shoot(where / f"failed-{name}.png")
                    print(f"{name} says: {one.run('document.body.innerText')}", file=sys.stderr)
                raise
            for one in (page, watcher):
                # That the page is watched while it is loaded anew is no complaint.
                assert not one.complaints(), one.complaints()
                asked = {event["request"]["url"] for event in one.events("Network.requestWillBeSent")}
                foreign = [url for url in asked if not url.startswith(mesh.site)]
                assert not foreign, f"the page asks elsewhere: {foreign}"
        finally:
            browser.close()
    finally:
        mesh.end()
    logs_in_over_tls(axle, where)
    print(f"the pictures are in {where}")


if __name__ == "__main__":
    main()
