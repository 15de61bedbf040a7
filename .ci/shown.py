"""What a page of the gateway shows, and what people do with it again and again: for the proofs of the step `page`."""

import pathlib
import re
import socket

ROOT = pathlib.Path(__file__).resolve().parent.parent
# On a busy machine a corrector may be late for its beats; what is proved here is the page.
PATIENT = {f'kind = "{name}"\nrobot = "r1"\n': f'kind = "{name}"\nrobot = "r1"\nparams = {{ period = {period} }}\n'
           for name, period in (("d-corrector", 0.15), ("drive", 0.15))}


def free_port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def pose(page):
    data = page.run("(({x, y, heading}) => [x, y, heading])(document.querySelector('#map').dataset)")
    return tuple(float(value) for value in data)


def gate(page):
    return page.run("({...document.querySelector('#gate').dataset})")


def is_standing(page):
    return gate(page)["motion"] == "standing"


def await_robot(page):
    page.wait("document.body.dataset.link === 'on' && document.querySelector('#map').dataset.x !== undefined")
    page.wait("document.querySelector('#gate').dataset.enabled === 'true'")


def click_map(page, x, y):
    """Clicks the map at a place in metres."""
    middle = page.box("#map")
    scale, cx, cy = (float(value) for value in page.run(
        "(({scale, centreX, centreY}) => [scale, centreX, centreY])(document.querySelector('#map').dataset)"))
    page.click_at(middle[0] + (x - cx) * scale, middle[1] - (y - cy) * scale)


def give_way(page, *points):
    page.click("#clear")
    for x, y in points:
        click_map(page, x, y)
    page.wait(f"document.querySelector('#points').value.split(' ').length === {len(points)}")


def phase(page):
    return page.run("document.querySelector('#progress').dataset.phase")


def slow_way(page, text):
    """Types a long way, and waits until the robot drives it."""
    page.click("#clear")
    page.click("#points")
    page.type(text)
    page.wait("!document.querySelector('#go').disabled")
    page.click("#go")
    page.wait("document.querySelector('#progress').dataset.phase === 'running'")
    page.wait("document.querySelector('#gate').dataset.motion === 'driving'")


def enable(page):
    page.wait("!document.querySelector('#enable').hidden")
    page.click("#enable")
    page.wait("document.querySelector('#gate').dataset.enabled === 'true'")


# What a corrector says whose machine was too busy for its beats: what a gate is for, and no fault of the page.
LATE = re.compile("commands came too late|does not follow|no measurement for|said nothing for")


def driven(act, page, *more):
    """Does something with a task, again when the machine was too busy to drive it."""
    for _ in range(5):
        try:
            return act(page, *more)
        except AssertionError as fault:
            if not LATE.search(page.run("document.querySelector('#progress').textContent + document.querySelector('#stage').textContent")):
                raise
            print(f"the machine was too busy to drive; once more ({fault})")
            if gate(page)["enabled"] == "false":
                enable(page)
    return act(page, *more)
