"""Reads what `axle bench mesh --json` printed, prints it, and refuses it when a figure is missing."""

import json
import sys

result = json.load(sys.stdin)
print(json.dumps(result, indent=2))
kinds = ("axle_p50_us", "axle_p99_us", "bare_p50_us", "bare_p99_us", "p50_ratio", "p99_ratio")
wanted = [("query", kind) for kind in kinds] + [("hop", kind) for kind in kinds]
wanted += [("rest", "cpu_cores"), ("rest", "rss_mb")]
figures = {f"{part}.{name}": result.get(part, {}).get(name) for part, name in wanted}
figures |= {name: result.get(name) for name in ("processes", "rounds", "up_s")}
wrong = [f"{name} is {value}" for name, value in figures.items() if not isinstance(value, int | float) or not value > 0]
if wrong:
    sys.exit("; ".join(wrong))
