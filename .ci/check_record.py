"""Judges what `axle bench record --json` printed: every file opens, at most a second is lost, one core is enough."""

import json
import sys

KEEPS = 50_000  # messages a second
# The flush is due after a second; the disk takes its time beside that.
LOST = 1.1  # s

found = json.load(sys.stdin)
print(json.dumps(found))
faults = []
if found["kills"] < 1 or found["opened"] != found["kills"]:
    faults.append(f"{found['opened']} of {found['kills']} killed recordings open")
if found["lost_max_s"] > LOST:
    faults.append(f"{found['lost_max_s']:.3f} s are lost")
if found["messages_per_second"] < KEEPS:
    faults.append(f"one core records {found['messages_per_second']:.0f} messages a second, not {KEEPS}")
if faults:
    sys.exit("; ".join(faults))
