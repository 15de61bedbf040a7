"""Judges what `axle demo --json` printed: check_demo.py SEED FILE."""

import json
import sys

ALLOWED = 0.03  # m, by the emulator's truth

seed, path = sys.argv[1:]
with open(path) as file:
    result = json.load(file)
wrong = []
if result["reached"] is not True:
    wrong.append("not reached")
if not 0 <= result["final_error_m"] <= ALLOWED:
    wrong.append(f"the robot stands {result['final_error_m']} m from its goal, allowed are {ALLOWED}")
if result["points_reached"] != result["points"] or result["points"] < 2:
    wrong.append(f"{result['points_reached']} of {result['points']} way points")
if result["phase"] != "done" or result["seed"] != int(seed):
    wrong.append(f"phase {result['phase']}, seed {result['seed']}")
print(
    f"seed {seed}: final error {result['final_error_m'] * 100:.1f} cm, cross-track RMS "
    f"{result['cross_track_rms_m'] * 100:.1f} cm, {result['duration_s']:.1f} s, {result['late_beats']} late beats"
)
if wrong:
    sys.exit(f"seed {seed}: " + "; ".join(wrong))
