"""Proves the page beyond its computer: TLS, logins, an operator, a viewer."""

import os
import subprocess

from browser import Browser, eventually
from live import await_mesh, end_mesh
from shown import PATIENT, ROOT, await_robot, enable, free_port, is_standing, slow_way

PASSWORD = "correct horse battery"


def log_in(page, name, password):
    page.wait("document.querySelector('#login') !== null")
    for field, text in (("name", name), ("password", password)):
        page.run(f"document.querySelector('#{field}').value = ''")
        page.click(f"#{field}")
        page.type(text)
    page.click("#login button")


def logs_in_over_tls(axle, where):
    """`axle up --page` for everybody: TLS, a login, an operator who drives, a viewer who may only stop."""
    endpoint, port = f"tcp/127.0.0.1:{free_port()}", free_port()
    demo = (ROOT / "deploy/topologies/demo.toml").read_text().replace("tcp/127.0.0.1:7447", endpoint)
    for part, patient in PATIENT.items():
        demo = demo.replace(part, patient)
    (where / "secure.toml").write_text(demo)
    keys = ["--keys", "keys"]
    for arguments, typed in (
        (["keys", "init", *keys], None),
        (["keys", "issue", "--topology", "secure.toml", *keys], None),
        (["keys", "issue", "gateway@all", "page@local", "--topology", "secure.toml", *keys], None),
        (["login", "add", "ann", *keys], PASSWORD + "\n"),
        (["login", "add", "eve", "--role", "viewer", *keys], PASSWORD + "\n"),
    ):
        done = subprocess.run([str(axle), *arguments], cwd=where, input=typed, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"axle {' '.join(arguments)}: {done.stderr}"
    log = where / "secure.log"
    environment = dict(os.environ, AXLE_STATE=str(where / "secure-state"), NO_COLOR="1")
    with open(log, "w") as words:
        command = [str(axle), "up", "secure.toml", *keys, f"--page=0.0.0.0:{port}"]
        up = subprocess.Popen(command, cwd=where, env=environment, stdin=subprocess.DEVNULL, stdout=words, stderr=words)
    try:
        await_mesh(up, log)
        eventually("the page is there", lambda: f"the page is at https://0.0.0.0:{port}" in log.read_text())
        browser = Browser(where / "secure")
        try:
            site = f"https://localhost:{port}"
            page = browser.page(site, trusting=True)
            page.wait("document.querySelector('#login') !== null")
            page.resize(390, 844, phone=True)
            page.shoot(where / "11-login-phone.png")
            page.resize(1280, 860)
            log_in(page, "ann", "correct horse batter")
            page.wait("/wrong name or password/.test(document.querySelector('#wrong').textContent)")
            page.shoot(where / "11-login.png")
            log_in(page, "ann", PASSWORD)
            await_robot(page)
            page.wait("/Log out ann/.test(document.querySelector('#leave').textContent)")
            # No script can read the cookie.
            assert page.run("document.cookie") == "", page.run("document.cookie")
            viewer = browser.page(site, trusting=True)
            log_in(viewer, "eve", PASSWORD)
            await_robot(viewer)
            assert viewer.run("getComputedStyle(document.querySelector('#go')).display") == "none"
            slow_way(page, "3,0.5 3,3")
            page.shoot(where / "12-operator.png")
            viewer.shoot(where / "12-viewer.png")
            viewer.click("#stop")
            page.wait("document.querySelector('#gate').dataset.enabled === 'false'", 2)
            eventually("the robot stands", lambda: is_standing(page), 3)
            enable(page)
            page.click("#leave")
            page.wait("document.querySelector('#login') !== null")
            assert page.run("fetch('/metrics').then((answer) => answer.status)") == 401
        finally:
            browser.close()
    finally:
        end_mesh(up, log)
    print("beyond this computer: TLS, a login, an operator who drives, a viewer who may only stop, and logging out")
