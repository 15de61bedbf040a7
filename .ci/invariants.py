"""Who may depend on whom: proves the direction of the workspace, and shows that each proof can fail.

The rules are below. They are checked on what `cargo metadata` says of this workspace, then on scratch copies of its
manifests, each of which breaks one rule on purpose and must be refused for that very reason.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent

WORDS = "axle-schema"
MESH = "axle-mesh"
ROUTER = "axle-router"
SHELL = "axle"
# Every other crate of the workspace is an algorithm: it may use the words, and these crates beside them.
ALGORITHMS_MAY_USE = {
    # Maps stand in the way of whoever plans and of whoever drives.
    "axle-emulator": {"axle-gate", "axle-maps", "axle-robot"},
    "axle-pathfinder": {"axle-maps"},
    "axle-robot": {"axle-gate"},
    # The simulator joins the others in virtual time; none of them knows it.
    "axle-sim": {
        "axle-correctors",
        "axle-emulator",
        "axle-gate",
        "axle-navigator",
        "axle-pathdriver",
        "axle-pathfinder",
        "axle-source",
    },
}
# Nothing of an algorithm, directly or below, may reach a network, a runtime, a clock or a source of randomness.
FORBIDDEN_BELOW = {"zenoh", "tokio", "mio", "async-std", "smol", "socket2", "rand", "getrandom", "chrono", "clap"}
MAY_NAME_ZENOH = {MESH, ROUTER}
# The whole-system tests play strangers, who send what no part of Axle would send.
TESTS_MAY_NAME_ZENOH = MAY_NAME_ZENOH | {SHELL}
ZENOH_FEATURES = {"transport_tcp", "transport_tls"}


def metadata(root, *flags):
    """What cargo says of the workspace at `root`."""
    command = ["cargo", "metadata", "--format-version", "1", "--manifest-path", str(root / "Cargo.toml"), *flags]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr}")
    return json.loads(done.stdout)


def findings(said):
    """Everything that is against the rules, in sentences."""
    packages = {package["id"]: package for package in said["packages"]}
    nodes = {node["id"]: node for node in said["resolve"]["nodes"]}
    name = {key: package["name"] for key, package in packages.items()}
    members = {name[key]: key for key in said["workspace_members"]}
    wrong = [f"{crate} is not in the workspace" for crate in (WORDS, MESH, ROUTER, SHELL) if crate not in members]

    def used(key, *kinds):
        """The packages that `key` uses directly: kind None is a normal dependency."""
        return {d["pkg"] for d in nodes[key]["deps"] if any(kind["kind"] in kinds for kind in d["dep_kinds"])}

    def below(key):
        """Everything that is compiled into `key`, tests not counted."""
        seen, waiting = set(), [key]
        while waiting:
            for pkg in used(waiting.pop(), None, "build") - seen:
                seen.add(pkg)
                waiting.append(pkg)
        return {name[pkg] for pkg in seen}

    for crate, key in sorted(members.items()):
        direct = {name[pkg] for pkg in used(key, None, "build")}
        of_axle = direct & members.keys()
        if crate == WORDS:
            allowed = set()
        elif crate == MESH:
            allowed = {WORDS}
        elif crate == ROUTER:
            allowed = {WORDS, MESH}
        elif crate == SHELL:
            allowed = members.keys()
        else:
            allowed = {WORDS} | ALGORITHMS_MAY_USE.get(crate, set())
        wrong += [f"{crate} depends on {other}: against the direction" for other in sorted(of_axle - allowed)]
        if crate not in {MESH, ROUTER, SHELL}:
            wrong += [f"{crate} has {other} below it" for other in sorted(below(key) & FORBIDDEN_BELOW)]
        for may, kinds in ((MAY_NAME_ZENOH, (None, "build")), (TESTS_MAY_NAME_ZENOH, ("dev",))):
            if crate not in may and "zenoh" in {name[pkg] for pkg in used(key, *kinds)}:
                tests = " in its tests" if "dev" in kinds else ""
                wrong.append(f"{crate} names zenoh{tests}: only {' and '.join(sorted(may))} may")
    zenohs = [key for key in nodes if name[key] == "zenoh"]
    if len(zenohs) != 1:
        wrong.append(f"{len(zenohs)} versions of zenoh are in the graph")
    for key in zenohs:
        features = set(nodes[key]["features"])
        if features != ZENOH_FEATURES:
            wrong.append(f"zenoh's features are {sorted(features)}, chosen are {sorted(ZENOH_FEATURES)}")
    return wrong


# What is broken on purpose: the manifest, what is replaced in it, and what the check must then say.
DEPENDENCIES = "\n[dependencies]\n"
BROKEN = [
    ("services/correctors", DEPENDENCIES, "zenoh.workspace = true", "axle-correctors names zenoh"),
    ("services/correctors", DEPENDENCIES, "zenoh.workspace = true", "axle-correctors has zenoh below it"),
    ("services/axle", DEPENDENCIES, "zenoh.workspace = true", "axle names zenoh:"),
    ("services/gate", "\n[dev-dependencies]\n", "zenoh.workspace = true", "axle-gate names zenoh in its tests"),
    ("services/pathfinder", DEPENDENCIES, "tokio.workspace = true", "axle-pathfinder has tokio below it"),
    ("schema", DEPENDENCIES, "tokio.workspace = true", "axle-gate has tokio below it"),
    ("services/pilot", DEPENDENCIES, "axle-mesh.workspace = true", "axle-pilot depends on axle-mesh"),
    ("services/navigator", DEPENDENCIES, "axle-pathfinder.workspace = true", "axle-navigator depends on axle-pathfinder"),
    ("services/mesh", DEPENDENCIES, "axle-gate.workspace = true", "axle-mesh depends on axle-gate"),
    ("", '"transport_tcp", "transport_tls"', '"transport_compression"', "zenoh's features are ['transport_compression', 'tr"),
    ("services/mesh", "zenoh.workspace = true", 'zenoh = { workspace = true, features = ["internal"] }', "['internal', 'tr"),
]


def copy_manifests(said, to):
    """The workspace without its code: manifests, lock file, and an empty file for every target."""
    shutil.copy(ROOT / "Cargo.toml", to)
    shutil.copy(ROOT / "Cargo.lock", to)
    for package in said["packages"]:
        if package["id"] not in said["workspace_members"]:
            continue
        manifest = pathlib.Path(package["manifest_path"]).relative_to(ROOT)
        (to / manifest).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / manifest, to / manifest)
        for target in package["targets"]:
            source = to / pathlib.Path(target["src_path"]).relative_to(ROOT)
            source.parent.mkdir(parents=True, exist_ok=True)
            source.touch()


def prove_that_it_fails(said):
    """Breaks each rule in a scratch copy, and ends the program when that is not noticed."""
    # Everything below is in cargo's cache since the real workspace was read: no network, and no chance of another lock.
    with tempfile.TemporaryDirectory(prefix="axle-invariants-") as directory:
        scratch = pathlib.Path(directory)
        copy_manifests(said, scratch)
        untouched = findings(metadata(scratch, "--offline"))
        if untouched:
            sys.exit(f"the scratch copy should be right, but: {untouched}")
        for crate, place, added, words in BROKEN:
            manifest = scratch / crate / "Cargo.toml"
            right = manifest.read_text()
            # Below a heading a line is added; anything else is a feature list or a flag, which is changed in place.
            if place.startswith("\n["):
                broken = right.replace(place, f"{place}{added}\n", 1)
            elif place.startswith('"'):
                broken = right.replace(f"[{place}]", f"[{place}, {added}]", 1)
            else:
                broken = right.replace(place, added, 1)
            if broken == right:
                sys.exit(f"cannot break {crate or 'the workspace'}: its Cargo.toml has no {place!r}")
            manifest.write_text(broken)
            found = findings(metadata(scratch, "--offline"))
            manifest.write_text(right)
            shutil.copy(ROOT / "Cargo.lock", scratch)
            if not any(words in finding for finding in found):
                sys.exit(f"{added} in {crate or 'the workspace'} was not noticed: expected {words!r}, found {found}")
            print(f"noticed when broken on purpose: {words}")


def main():
    said = metadata(ROOT, "--locked")
    wrong = findings(said)
    if wrong:
        sys.exit("\n".join(wrong))
    print(f"{len(said['workspace_members'])} crates depend on each other as ARCHITECTURE.md says")
    prove_that_it_fails(said)


main()
