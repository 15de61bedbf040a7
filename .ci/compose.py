"""Brings docker-compose.yml up and drives through it: compose.py AXLE IMAGE.

Under a project name and on a port of its own: waits until every container is healthy, drives the square from the host,
cuts the link between the two networks in mid task and looks from the robot's side whether the wheels stop, heals it,
and drives home without any process having been started anew. Then the same with certificates, and with a board on a
serial line in the place of the emulated robot. What is waited for is a condition with a deadline. What was started is
taken down, also when something fails; then the logs are printed first.
"""

import json
import math
import os
import pathlib
import queue
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
SQUARE = "0,0 1,0 1,1 0,1 0,0"
SERVICES = {
    "workstation": {"pathfinder", "pathdriver", "pilot", "d-corrector", "drive"},
    "onboard": {"emulator", "source", "navigator"},
}
ROUTERS = {"router-workstation", "router-onboard"}
LOOK = 0.1  # s, between two looks at a condition
# From where the robot should be: what the pilot takes for arrived, and the drift of odometry on a short and a long way.
NEAR, FAR = 0.08, 0.25  # m
# From the last command that the robot heard: silence of 0.15 s, then 2 m/s² from 0.6 m/s. Both are judged with room
# for a busy machine; the exact promise is judged by `axle bench stop`.
SLOWEST_BRAKE, SLOWEST_STOP = 0.5, 1.0  # s
SLOWEST_HEALING = 15.0  # s
# A processor that ran nothing for so long kept the robot silent for longer than any link: a shared machine does that.
STANDSTILL = 0.2  # s
ATTEMPTS = 3


class Failure(Exception):
    """Something is not as it should be, in words."""


def demand(condition, words):
    if not condition:
        raise Failure(words)


def await_(what, look, patience):
    """Looks until `look` gives something true, and returns that."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        found = look()
        if found:
            return found
        time.sleep(LOOK)
    raise Failure(f"not within {patience:.0f} s: {what}")


def run(command, environment=None, patience=60):
    """Runs a command to its end."""
    return subprocess.run(
        command, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=patience,
        check=False,
    )


def must(command, environment=None, patience=60):
    """Runs a command that must succeed, and returns what it printed."""
    done = run(command, environment, patience)
    demand(done.returncode == 0, f"`{' '.join(command)}` failed with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


class Witness:
    """Sees when a processor of this machine stands still: on each one somebody wakes every few milliseconds."""

    def __init__(self):
        self.gaps = queue.Queue()
        for cpu in os.sched_getaffinity(0):
            threading.Thread(target=self.watch, args=(cpu,), daemon=True).start()

    def watch(self, cpu):
        os.sched_setaffinity(0, {cpu})
        last = time.monotonic()
        while True:
            time.sleep(0.005)
            now = time.monotonic()
            if now - last > STANDSTILL:
                self.gaps.put((cpu, now - last))
            last = now

    def saw(self):
        """Every standstill since the last time, in words."""
        time.sleep(LOOK)
        seen = []
        while not self.gaps.empty():
            cpu, gap = self.gaps.get()
            seen.append(f"processor {cpu} stood still for {gap:.2f} s")
        return ", ".join(seen)


class Tap:
    """A tap that runs beside: the JSON lines that it prints, as they come, and its words for people."""

    def __init__(self, command, environment=None):
        self.process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True,
        )
        self.lines, self.words = queue.Queue(), ""
        for listen in (self.hear, self.listen):
            threading.Thread(target=listen, daemon=True).start()

    def hear(self):
        for line in self.process.stdout:
            self.lines.put(json.loads(line))

    def listen(self):
        for line in self.process.stderr:
            self.words += line

    def heard(self):
        """Everything since the last time."""
        lines = []
        while not self.lines.empty():
            lines.append(self.lines.get())
        return lines

    def until(self, what, is_it, patience):
        """Takes lines until one is it; returns all of them, that one last."""
        end, lines = time.monotonic() + patience, []
        while time.monotonic() < end:
            try:
                lines.append(self.lines.get(timeout=LOOK))
            except queue.Empty:
                demand(self.process.poll() is None, f"the tap ended while waiting: {what}")
                continue
            if is_it(lines[-1]):
                return lines
        raise Failure(f"not within {patience:.0f} s: {what}; the last of {len(lines)} messages: {lines[-1:]}")

    def end(self):
        self.process.kill()
        self.process.wait()


def free_port():
    """A port of this machine on which nobody listens."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


class Mesh:
    """The containers of one run, and the program on the host."""

    def __init__(self, axle, image, witness, keys=None, board=None):
        self.axle, self.project = str(axle), f"axle-ci-{os.getpid()}"
        self.services = SERVICES | ({"onboard": {"robot", "source", "navigator"}} if board else {})
        if shutil.which("docker-compose"):
            self.compose_command = ["docker-compose"]
        else:
            self.compose_command = ["docker", "compose"]
        port = free_port()
        self.environment = dict(
            os.environ, COMPOSE_PROJECT_NAME=self.project, COMPOSE_PROFILES="sim", AXLE_IMAGE=image,
            AXLE_PORT=str(port), AXLE_CONNECT=f"tcp/127.0.0.1:{port}", NO_COLOR="1",
        )
        if keys:
            self.environment |= {
                "COMPOSE_FILE": "docker-compose.yml:docker-compose.secure.yml", "AXLE_KEYS": str(keys),
                "AXLE_IDENTITY": str(keys / "bob"),
            }
        if board:
            self.environment |= board.environment
        self.image = image
        self.taps = []
        self.witness = witness

    def compose(self, *args, patience=120):
        return must([*self.compose_command, *args], self.environment, patience)

    def host(self, *args, patience=60):
        """What `axle` on the host prints."""
        return must([self.axle, *args], self.environment, patience)

    def container(self, service):
        return self.compose("ps", "-q", service).strip()

    def inspect(self):
        """What Docker says of every container, by the name of its service."""
        ids = must(["docker", "ps", "-aq", "--filter", f"label=com.docker.compose.project={self.project}"]).split()
        said = json.loads(must(["docker", "inspect", *ids])) if ids else []
        return {one["Config"]["Labels"]["com.docker.compose.service"]: one for one in said}

    def tap(self, keys, onboard=False):
        """A tap on the host, or on the robot's side of the link."""
        where = ["docker", "exec", self.container("navigator"), "/axle"] if onboard else [self.axle]
        tap = Tap([*where, "tap", keys, "--json"], self.environment)
        self.taps.append(tap)
        return tap

    def one(self, keys):
        """The next message of a stream."""
        return json.loads(self.host("tap", keys, "--json", "--count", "1", patience=20))["value"]

    def truth(self):
        """Where the robot really is."""
        pose = self.one("axle/r1/emulator/truth")["pose"]
        return pose["x"], pose["y"]

    def boots(self):
        """The run of every service that answers, by its computer and name."""
        done = run([self.axle, "ps", "--json"], self.environment)
        rows = json.loads(done.stdout) if done.returncode == 0 else []
        return {(row["host"], row["service"]): row["boot"] for row in rows if row["answers"]}

    def everybody(self):
        """The same, once all are there."""
        wanted = {(host, service) for host, services in self.services.items() for service in services}
        return await_("all services answer on the host", lambda: (b := self.boots()).keys() >= wanted and b, 20)

    def logs(self):
        return run([*self.compose_command, "logs", "--no-color", "--tail", "40"], self.environment).stdout

    def down(self):
        for tap in self.taps:
            tap.end()
        done = run([*self.compose_command, "down", "--volumes", "--remove-orphans", "--timeout", "5"], self.environment, 120)
        left = []
        for kind in (["ps", "-a"], ["network", "ls"], ["volume", "ls"]):
            filtered = ["--filter", f"label=com.docker.compose.project={self.project}"]
            left += run(["docker", *kind, "-q", *filtered]).stdout.split()
        demand(done.returncode == 0 and not left, f"the compose did not come down, {left} are left:\n{done.stderr}")


class Board:
    """An emulated board on a terminal of this machine, which the profile `real` takes for a board on a serial port.

    A terminal is no device that Docker could pass on, for it is known by its place in /dev/pts only. So the port that
    docker-compose.yml passes on is one that is there on every machine, and the terminal is mounted beside it."""

    KIND = "dwm-text"
    PORT = "/dev/null"

    def __init__(self, axle, directory):
        self.axle, self.link, self.processes = str(axle), directory / "board", []
        self.listen = f"tcp/127.0.0.1:{free_port()}"
        override = directory / "board.yml"
        self.environment = {
            "COMPOSE_PROFILES": "real", "AXLE_BOARD": self.KIND, "AXLE_SERIAL": self.PORT,
            "COMPOSE_FILE": f"docker-compose.yml:{override}",
        }
        self.override = override

    def plug_in(self, mesh):
        """Starts it, with a router of its own: through that it says where its robot really is, once the mesh is up."""
        router = ["router", "--listen", self.listen, "--link", mesh.environment["AXLE_CONNECT"]]
        board = ["run", "emulator", "--board", self.KIND, "--port", str(self.link), "--robot", "r1"]
        for command in (router, [*board, "--connect", self.listen]):
            environment = {name: value for name, value in mesh.environment.items() if name != "AXLE_CONNECT"}
            environment["AXLE_LOG"] = "error"
            self.processes.append(
                subprocess.Popen(
                    [self.axle, *command], env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
                )
            )
        await_("the board has a terminal", self.link.exists, 10)
        terminal = self.link.resolve()
        # The user of the container is no user of this machine.
        terminal.chmod(0o666)
        robot = {"volumes": [f"{terminal}:/dev/board"], "environment": {"AXLE_PORT": "/dev/board"}}
        # YAML, of which JSON is a part.
        self.override.write_text(json.dumps({"services": {"robot": robot}}))

    def unplug(self):
        for process in self.processes:
            process.kill()
            process.wait()


def state_of(container):
    return container["State"].get("Health", {}).get("Status", container["State"]["Status"])


def come_up(mesh):
    """Starts everything; returns the seconds until every container is healthy."""
    mesh.compose("config", "--quiet")
    begun = time.monotonic()
    mesh.compose("up", "--detach")
    wanted = ROUTERS.union(*mesh.services.values())

    def look():
        containers = mesh.inspect()
        ended = [service for service, container in containers.items() if container["RestartCount"] > 0]
        demand(not ended, f"ended instead of becoming healthy: {ended}")
        states = {service: state_of(container) for service, container in containers.items()}
        return states.keys() == wanted and set(states.values()) == {"healthy"}

    await_("every container is healthy", look, 90)
    return time.monotonic() - begun


def check_walls(mesh):
    """What no container may do, and that the two networks meet in the routers only."""
    containers = mesh.inspect()
    for service, container in containers.items():
        host = container["HostConfig"]
        demand(host["ReadonlyRootfs"], f"{service} can write to its image")
        demand(host["CapDrop"] == ["ALL"] and not host["CapAdd"], f"{service} has capabilities")
        demand("no-new-privileges:true" in host["SecurityOpt"], f"{service} can gain privileges")
        demand(container["Config"]["User"] == "10001:10001", f"{service} runs as {container['Config']['User']!r}")
        demand(host["Memory"] > 0, f"{service} has no limit of memory")
        demand(service in ROUTERS or len(container["NetworkSettings"]["Networks"]) == 1, f"{service} has two networks")
        ports = container["NetworkSettings"]["Ports"] or {}
        bound = [binding["HostIp"] for bindings in ports.values() for binding in bindings or []]
        wanted = ["127.0.0.1"] if service == "router-workstation" else []
        demand(bound == wanted, f"{service} publishes ports on {bound}")

    def reaches(service, network):
        address = containers[service]["NetworkSettings"]["Networks"][f"{mesh.project}_{network}"]["IPAddress"]
        command = ["docker", "run", "--rm", "--network", f"{mesh.project}_workstation", mesh.image, "ps"]
        return run([*command, "--connect", f"tcp/{address}:7447"]).returncode == 0

    demand(reaches("router-workstation", "workstation"), "a container on `workstation` does not reach its own router")
    demand(not reaches("router-onboard", "onboard"), "a container on `workstation` reaches `onboard` past the routers")


def drive(mesh, way, tolerance):
    """Drives a way from the host; the robot must be at its end, by its own truth.

    A task that ended while this machine stood still proves nothing, and is given again."""
    for attempt in range(1, ATTEMPTS + 1):
        mesh.witness.saw()
        done = run([mesh.axle, "go", "--json", way], mesh.environment, 90)
        if done.returncode == 0:
            break
        words = f"`axle go {way}` failed with {done.returncode}:\n{done.stdout}{done.stderr}"
        standstill = mesh.witness.saw()
        demand(standstill and attempt < ATTEMPTS, f"{words}{standstill or 'while no processor stood still'}")
        print(f"{words}but {standstill}: once more")
    told = json.loads(done.stdout.splitlines()[-1])
    demand(told["reached"], f"not reached: {told}")
    x, y = (float(part) for part in way.split()[-1].split(","))
    missed = math.dist(mesh.truth(), (x, y))
    demand(missed <= tolerance, f"the robot stands {missed:.3f} m from {x}, {y}")
    return missed


def wheels(message):
    """The speeds that the gate asks of the wheels, m/s."""
    return message["value"]["wheels"]["left"], message["value"]["wheels"]["right"]


def stands(message):
    return message["value"]["motion"] == "standing" and wheels(message) == (0.0, 0.0)


def is_state(message):
    return message["key"].endswith("/gate/state")


def cut(mesh, link):
    """Cuts the link in mid task; returns what `axle go` said, and the seconds from the last command that the robot
    heard until it brakes and until its wheels are at rest."""
    gate, truth = (mesh.tap(keys, onboard=True) for keys in ("axle/r1/gate/*", "axle/r1/emulator/truth"))
    gate.until("the gate speaks", is_state, 10)
    router = mesh.container("router-onboard")
    task = subprocess.Popen(
        [mesh.axle, "go", "4,0"], env=mesh.environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
    )
    try:
        # Straight on, far from both ends of the way.
        heard = gate.until("the robot drives", lambda said: is_state(said) and min(wheels(said)) > 0.3, 20)
        must(["docker", "network", "disconnect", link, router])
        heard += gate.until("the wheels stand", lambda said: is_state(said) and stands(said), 10)
        words = task.communicate(timeout=30)[1].strip()
    finally:
        task.kill()
    demand(task.returncode == 1 and words, f"`axle go` ended with {task.returncode} and said {words!r}")
    commands = [said["received"] for said in heard if said["key"].endswith("/gate/command")]
    demand(commands, "the robot was at rest before the link was cut")
    braked = [said for said in heard if is_state(said) and said["received"] > commands[-1]
              and said["value"]["motion"] != "driving"]
    why = braked and braked[0]["value"].get("cause")
    demand(why in ("silence", "expired"), f"the gate did not brake for silence, but: {braked[:1]}")
    brake, stop = (said["received"] - commands[-1] for said in (braked[0], heard[-1]))
    demand(brake <= SLOWEST_BRAKE, f"the wheels turned for {brake:.3f} s after the last command before they braked")
    demand(stop <= SLOWEST_STOP, f"the wheels turned for {stop:.3f} s after the last command")
    rest = heard[-1]["received"]
    poses = truth.until("the robot tells for a second where it stands", lambda said: said["received"] > rest + 1.0, 10)
    stood = [said["value"]["pose"] for said in poses if said["received"] > rest + 0.1]
    moved = math.dist((stood[0]["x"], stood[0]["y"]), (stood[-1]["x"], stood[-1]["y"]))
    later = [said for said in gate.heard() if is_state(said) and not stands(said)]
    demand(not later and moved < 0.002, f"the robot moved by {moved:.3f} m while the link was cut: {later[:1]}")
    for tap in (gate, truth):
        tap.end()
    return words, brake, stop


def heal(mesh, link):
    """Heals the link; returns the seconds until poses are heard on the host again."""
    poses = mesh.tap("axle/r1/navigator/pose")
    await_("a tap on the host is silent while the link is cut", lambda: "nothing was said" in poses.words, 10)
    router = mesh.container("router-onboard")
    must(["docker", "network", "connect", link, router])
    begun = time.time()
    heard = poses.until("a pose is heard on the host", lambda _: True, SLOWEST_HEALING)
    poses.end()
    return heard[-1]["received"] - begun


def stay_stopped(mesh):
    """An AllStop outlives the container of the robot."""
    mesh.host("stop")
    mesh.compose("restart", "emulator")
    await_("the gate is back, and stopped", lambda: not mesh.one("axle/r1/gate/state")["enabled"], 30)
    mesh.host("enable")
    await_("the gate is enabled", lambda: mesh.one("axle/r1/gate/state")["enabled"], 10)


def play(mesh):
    measured = {"image_mb": int(must(["docker", "image", "inspect", "--format", "{{.Size}}", mesh.image])) / 1e6}
    measured["healthy_s"] = come_up(mesh)
    check_walls(mesh)
    before = mesh.everybody()
    mesh.host("plan", SQUARE)
    measured["missed_cm"] = drive(mesh, SQUARE, NEAR) * 100
    link = f"{mesh.project}_link"
    words, brake, stop = cut(mesh, link)
    measured["brake_ms"], measured["stop_ms"] = brake * 1e3, stop * 1e3
    print(f"cut in mid task, `axle go` says: {words}")
    measured["resume_s"] = heal(mesh, link)
    after = mesh.everybody()
    anew = [service for service, container in mesh.inspect().items() if container["RestartCount"] > 0]
    demand(after == before and not anew, f"processes were started anew: {before} became {after}, {anew}")
    measured["missed_again_cm"] = drive(mesh, "0,0", FAR) * 100
    stay_stopped(mesh)
    print(json.dumps({name: round(value, 3) for name, value in measured.items()}))


def make_keys(axle, keys):
    """An authority, an identity for each container that its user can read, an operator and a viewer."""
    issue = [str(axle), "keys", "issue", "--keys", str(keys), "--topology", "deploy/topologies/compose.toml"]
    must([str(axle), "keys", "init", "--keys", str(keys)])
    must(issue)
    must([*issue, "bob", "--role", "operator"])
    must([*issue, "ann", "--role", "viewer"])
    for identity in keys.glob("*@*"):
        for path in [identity, *identity.iterdir()]:
            os.chown(path, 10001, 10001)


def play_secured(mesh):
    """The same mesh with certificates: an operator drives, a viewer looks, and a stranger gets no link."""
    healthy = come_up(mesh)
    mesh.everybody()
    missed = drive(mesh, "0.5,0", NEAR)
    ann = mesh.environment | {"AXLE_IDENTITY": mesh.environment["AXLE_IDENTITY"].replace("/bob", "/ann")}
    must([mesh.axle, "tap", "axle/r1/navigator/pose", "--count", "1"], ann, 20)
    stop = run([mesh.axle, "stop"], ann)
    demand(stop.returncode == 1 and "ann (viewer)" in stop.stderr, f"a viewer stopped the robot: {stop.stderr}")
    nobody = run([mesh.axle, "ps"], {name: value for name, value in ann.items() if name != "AXLE_IDENTITY"})
    demand(nobody.returncode == 1 and "it wants TLS" in nobody.stderr, f"a stranger got in: {nobody}")
    print(json.dumps({"secured_healthy_s": round(healthy, 3), "secured_missed_cm": round(missed * 100, 3)}))


def play_real(mesh, board):
    """The profile `real`: its robot starts disabled, drives once it is enabled, and rests when its board is gone."""
    healthy = come_up(mesh)
    mesh.everybody()
    devices = [device["PathOnHost"] for device in mesh.inspect()["robot"]["HostConfig"]["Devices"]]
    demand(devices == [board.PORT], f"the robot has the devices {devices}")
    refused = run([mesh.axle, "go", "0.5,0"], mesh.environment)
    demand(refused.returncode == 1 and "axle enable" in refused.stderr, f"it drives without being enabled: {refused}")
    mesh.host("enable")
    missed = drive(mesh, "0.5,0", NEAR)
    board.unplug()
    await_("the gate disables the wheels of a board that is gone",
           lambda: not mesh.one("axle/r1/gate/state")["enabled"], 10)
    print(json.dumps({"real_healthy_s": round(healthy, 3), "real_missed_cm": round(missed * 100, 3)}))


def main():
    axle, image = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended by SIGTERM"))
    with tempfile.TemporaryDirectory(prefix="axle-keys-") as directory:
        keys = pathlib.Path(directory) / "keys"
        make_keys(axle, keys)
        witness, board = Witness(), Board(axle, pathlib.Path(directory))
        tried(Mesh(axle, image, witness), play)
        tried(Mesh(axle, image, witness, keys=keys), play_secured)
        mesh = Mesh(axle, image, witness, board=board)
        try:
            # The compose cannot come up, nor down, without the file that this writes.
            board.plug_in(mesh)
            tried(mesh, lambda mesh: play_real(mesh, board))
        finally:
            board.unplug()


def tried(mesh, plays):
    """Plays, and takes down whatever came of it."""
    try:
        plays(mesh)
    except (Failure, subprocess.TimeoutExpired, KeyError, ValueError) as failure:
        print(mesh.logs(), file=sys.stderr)
        sys.exit(f"compose: {failure!r}" if not isinstance(failure, Failure) else f"compose: {failure}")
    finally:
        mesh.down()


main()
