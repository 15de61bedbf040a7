"""A real browser without a window, driven over its DevTools protocol: just what the step `page` needs of it."""

import base64
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

import websocket

PATIENCE = 20  # s, for whatever shall happen at all


def eventually(what, look, patience=PATIENCE):
    """Looks until `look` gives something true, and returns it."""
    end = time.monotonic() + patience
    while True:
        found = look()
        if found:
            return found
        if time.monotonic() > end:
            raise AssertionError(f"not within {patience} s: {what}")
        time.sleep(0.03)


class Browser:
    """A Chromium of its own, with a profile that goes with it."""

    def __init__(self, where):
        program = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)
        if program is None:
            sys.exit("chromium is missing: install the package chromium")
        self.profile = pathlib.Path(where) / "profile"
        shutil.rmtree(self.profile, ignore_errors=True)
        self.profile.mkdir(parents=True)
        flags = [
            "--headless=new", "--remote-debugging-port=0", f"--user-data-dir={self.profile}", "--no-first-run",
            "--disable-gpu", "--disable-dev-shm-usage", "--disable-extensions", "--disable-background-networking",
            "--disable-component-update", "--disable-sync", "--disable-default-apps", "--hide-scrollbars",
            "--force-color-profile=srgb", "--window-size=1280,860", "--remote-allow-origins=*",
        ]
        # Whoever is root, as in a container, gets no sandbox from Chromium.
        if os.geteuid() == 0:
            flags.append("--no-sandbox")
        self.log = open(self.profile.parent / "chromium.log", "w")
        self.process = subprocess.Popen([program, *flags, "about:blank"], stdin=subprocess.DEVNULL,
                                        stdout=self.log, stderr=self.log, start_new_session=True)
        port = self.profile / "DevToolsActivePort"
        eventually("chromium listens", lambda: port.exists() and port.read_text().count("\n") >= 1)
        lines = port.read_text().split()
        self.address = f"127.0.0.1:{lines[0]}"
        self.socket = Channel(f"ws://{self.address}{lines[1]}")

    def page(self, url, width=1280, height=860, trusting=False):
        """A page in a profile of its own: nothing is shared with the others. A trusting one takes any certificate."""
        context = self.socket.do("Target.createBrowserContext")["browserContextId"]
        target = self.socket.do("Target.createTarget", url="about:blank", browserContextId=context,
                                width=width, height=height)["targetId"]
        return Page(self, target, url, width, height, trusting)

    def close(self):
        try:
            self.socket.do("Browser.close")
        except (OSError, websocket.WebSocketException):
            pass
        try:
            self.process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, 9)
            self.process.wait()
        self.log.close()


class Channel:
    """One connection of the protocol: questions with answers, and events beside them."""

    def __init__(self, url):
        self.socket = websocket.create_connection(url, timeout=PATIENCE, suppress_origin=True)
        self.number = 0
        self.events = []

    def do(self, method, **params):
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": params}))
        while True:
            said = json.loads(self.socket.recv())
            if said.get("id") == self.number:
                if "error" in said:
                    raise AssertionError(f"{method}: {said['error']}")
                return said["result"]
            self.events.append(said)


class Page:
    """One tab, and what it complains of."""

    def __init__(self, browser, target, url, width, height, trusting=False):
        self.browser, self.target = browser, target
        self.channel = Channel(f"ws://{browser.address}/devtools/page/{target}")
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.channel.do(f"{domain}.enable")
        self.resize(width, height)
        if trusting:
            self.channel.do("Security.setIgnoreCertificateErrors", ignore=True)
        self.channel.do("Page.navigate", url=url)

    def resize(self, width, height, phone=False):
        self.channel.do("Emulation.setDeviceMetricsOverride", width=width, height=height,
                        deviceScaleFactor=2 if phone else 1, mobile=phone)

    def run(self, expression):
        """The value of an expression in the page."""
        done = self.channel.do("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in done:
            raise AssertionError(f"{expression}: {done['exceptionDetails']}")
        return done["result"].get("value")

    def wait(self, expression, patience=PATIENCE):
        def look():
            try:
                return self.run(expression)
            except AssertionError as fault:
                # A page that is just being loaded has no elements yet.
                if re.search("TypeError|context|navigated", str(fault)):
                    return None
                raise
        return eventually(expression, look, patience)

    def box(self, selector):
        """The middle of an element, in pixels."""
        self.run(f"document.querySelector({json.dumps(selector)}).scrollIntoView({{block: 'nearest'}})")
        box = self.run(f"(({{x, y, width, height}}) => [x, y, width, height])"
                       f"(document.querySelector({json.dumps(selector)}).getBoundingClientRect())")
        return box[0] + box[2] / 2, box[1] + box[3] / 2

    def mouse(self, kind, x, y, buttons=0):
        self.channel.do("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=buttons, clickCount=1)

    def click_at(self, x, y):
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, 1)
        self.mouse("mouseReleased", x, y)

    def click(self, selector):
        self.click_at(*self.box(selector))

    def key(self, kind, key, code=None):
        text = key if len(key) == 1 and kind == "keyDown" else ("\r" if key == "Enter" and kind == "keyDown" else "")
        self.channel.do("Input.dispatchKeyEvent", type=kind, key=key, code=code or key, text=text,
                        windowsVirtualKeyCode={"Enter": 13, "Tab": 9}.get(key, 0))

    def press(self, key):
        self.key("keyDown", key)
        self.key("keyUp", key)

    def type(self, text):
        self.channel.do("Input.insertText", text=text)

    def reload(self):
        self.channel.do("Page.reload")

    def scheme(self, name):
        self.channel.do("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": name}])

    def shoot(self, path):
        """A picture of what is seen."""
        picture = base64.b64decode(self.channel.do("Page.captureScreenshot", format="png")["data"])
        pathlib.Path(path).write_bytes(picture)

    def events(self, method):
        # An answer brings along the events before it.
        self.run("0")
        return [event["params"] for event in self.channel.events if event.get("method") == method]

    def complaints(self):
        """Exceptions, errors of the console, and what the policy of the page forbade."""
        thrown = [event["exceptionDetails"] for event in self.events("Runtime.exceptionThrown")]
        said = [event for event in self.events("Runtime.consoleAPICalled") if event["type"] in ("error", "warning")]
        logged = [event["entry"] for event in self.events("Log.entryAdded") if event["entry"]["level"] == "error"]
        return thrown + said + logged

    def close(self):
        self.browser.socket.do("Target.closeTarget", targetId=self.target)
