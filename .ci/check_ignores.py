"""Refuses ignored advisories that are too many, say no reason, or are past their day: check_ignores.py deny.toml."""

import datetime
import re
import sys
import tomllib

MOST = 6

with open(sys.argv[1], "rb") as file:
    ignored = tomllib.load(file)["advisories"]["ignore"]
wrong = [f"{len(ignored)} advisories are ignored, at most {MOST}"] if len(ignored) > MOST else []
for entry in ignored:
    until = re.search(r"Until (\d{4}-\d\d-\d\d)$", entry.get("reason", "") if isinstance(entry, dict) else "")
    if not until:
        wrong.append(f"{entry}: give a reason that ends with `Until YYYY-MM-DD`")
    elif datetime.date.fromisoformat(until[1]) < datetime.date.today():
        wrong.append(f"{entry['id']}: ignored until {until[1]}; look at it again")
if wrong:
    sys.exit("\n".join(wrong))
