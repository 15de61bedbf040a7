"""Runs what a page of docs/ shows, exactly as it stands there, against a live mesh: live.py AXLE DIRECTORY PAGE.

A block ```` ```python NAME.py ```` becomes that file and is run; the ```` ```text ```` block behind it is what it must
print. In a block ```` ```console run ```` every line with `$ ` is run by bash, and the lines below it are what it must
print. `…` stands for the rest of a line, a line of `…` for any lines. Numbers and the widths of tables may differ,
unless the block is marked `exact`. Afterwards the mesh is ended, and no process of it may be left.
"""

import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import time

LONGEST = 60  # s, for one program
FENCE = re.compile(r"^```(\S*)[ ]?(.*)$")


def blocks(text):
    """Yields language, flags and lines of every fenced block of a page."""
    inside = None
    for line in text.splitlines():
        fence = FENCE.match(line)
        if inside is not None and line == "```":
            yield inside
            inside = None
        elif inside is not None:
            inside[2].append(line)
        elif fence:
            inside = (fence[1], fence[2].split(), [])
    if inside is not None:
        sys.exit("a block is not closed")


def loose(line):
    """A line without what differs from run to run: numbers, ids, widths of tables."""
    line = re.sub(r"\b[0-9a-f]*\d[0-9a-f]*(\.\d+)?(e-?\d+)?\b", "#", line)
    line = re.sub(r"(?<!\w)-#", "#", line)
    return re.sub(r"\s+", " ", re.sub(r"[─═]+", "─", line)).strip()


def expects(expected, printed, exact):
    """Whether `printed` is what the page shows; both are lists of lines."""
    plain = (lambda line: line.rstrip()) if exact else loose
    parts = []
    for line in map(plain, expected):
        if line == "…":
            parts.append("(?:.*\n)*")
        else:
            parts.append(".*".join(map(re.escape, line.split("…"))) + "\n")
    got = "".join(plain(line) + "\n" for line in printed)
    return re.fullmatch("".join(parts), got) is not None


def compare(what, expected, printed, exact):
    if not expects(expected, printed, exact):
        shown, got = "\n".join(expected), "\n".join(printed)
        sys.exit(f"{what}\n--- the page shows:\n{shown}\n--- it prints:\n{got}")


def run(command, where, environment, what):
    """Runs a command to its end and returns its exit code and what it printed."""
    try:
        done = subprocess.run(
            command, cwd=where, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, timeout=LONGEST, check=False,
        )
    except subprocess.TimeoutExpired as late:
        sys.exit(f"{what} did not end within {LONGEST} s; it printed:\n{(late.stdout or b'').decode()}")
    return done.returncode, done.stdout.splitlines()


def run_python(name, source, expected, exact, where, environment):
    if pathlib.PurePath(name).name != name or not name.endswith(".py"):
        sys.exit(f"{name!r} is no name for a program")
    (where / name).write_text("\n".join(source) + "\n")
    code, printed = run([sys.executable, name], where, environment, name)
    if code != 0:
        sys.exit(f"{name} failed with {code}:\n" + "\n".join(printed))
    compare(name, expected, printed, exact)
    print(f"{name}: prints what the page shows ({len(printed)} lines)")


def run_console(lines, exact, where, environment):
    calls = []
    for line in lines:
        if line.startswith("$ "):
            calls.append((line[2:], []))
        elif not calls:
            sys.exit(f"a console block begins with {line!r}, not with a command")
        else:
            calls[-1][1].append(line)
    for command, expected in calls:
        _, printed = run(["bash", "-c", command], where, environment, command)
        compare(f"$ {command}", expected, printed, exact)
        print(f"$ {command}: prints what the page shows ({len(printed)} lines)")


def play(page, where, environment):
    """Runs all marked blocks in their order; a page without any proves nothing."""
    count = 0
    listed = list(blocks(page.read_text()))
    for index, (language, flags, lines) in enumerate(listed):
        if language == "python":
            if len(flags) != 1 or listed[index + 1][0] != "text":
                sys.exit(f"the program {flags} needs a name, and a block `text` with what it prints")
            _, output_flags, output = listed[index + 1]
            run_python(flags[0], lines, output, "exact" in output_flags, where, environment)
        elif language == "console" and "run" in flags:
            run_console(lines, "exact" in flags, where, environment)
        else:
            continue
        count += 1
    if count == 0:
        sys.exit(f"{page} has no block to run")
    print(f"{count} blocks of {page} do what the page says")


def children(pid):
    """The processes below `pid`."""
    # Each thread has the children that it started.
    lists = [file.read_text() for file in pathlib.Path(f"/proc/{pid}/task").glob("*/children")]
    direct = " ".join(lists).split()
    return [int(child) for child in direct] + [below for child in direct for below in children(int(child))]


def is_alive(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def await_mesh(up, log):
    """Waits until `axle up` says that all are alive."""
    end = time.monotonic() + 30
    while time.monotonic() < end and up.poll() is None:
        if "processes are alive" in log.read_text():
            # A reader of the page needs longer than this to type the first command.
            time.sleep(1.0)
            return
        time.sleep(0.05)
    up.kill()
    sys.exit(f"axle up did not come up:\n{log.read_text()}")


def end_mesh(up, log):
    """Ends the mesh as Ctrl-C does, and proves that nothing of it is left."""
    processes = children(up.pid)
    up.send_signal(signal.SIGINT)
    try:
        code = up.wait(timeout=10)
    except subprocess.TimeoutExpired:
        code = "no end within 10 s"
        up.kill()
    left = [pid for pid in processes if is_alive(pid)]
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    if code != 0 or left or not processes:
        sys.exit(f"axle up ended with {code}, and left {left} of {len(processes)} processes behind:\n{log.read_text()}")
    print(f"the mesh of {len(processes)} processes ended, and left nothing behind")


def main():
    axle, where, page = (pathlib.Path(part).resolve() for part in sys.argv[1:])
    shutil.rmtree(where, ignore_errors=True)
    where.mkdir(parents=True)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    path = f"{axle.parent}{os.pathsep}{os.environ['PATH']}"
    environment = dict(os.environ, AXLE_CONNECT=endpoint, AXLE_STATE=str(where / "state"), PATH=path, NO_COLOR="1")
    log = where / "up.log"
    with open(log, "w") as words:
        command = [str(axle), "up", "--listen", endpoint]
        up = subprocess.Popen(command, cwd=where, env=environment, stdin=subprocess.DEVNULL, stdout=words, stderr=words)
    await_mesh(up, log)
    try:
        play(page, where, environment)
    finally:
        end_mesh(up, log)


if __name__ == "__main__":
    main()
