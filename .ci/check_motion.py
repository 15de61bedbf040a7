"""Reads what `axle bench motion --json` printed, prints it, and refuses it when a figure is missing or a promise broken.

Times are not judged, since a machine of CI is no stopwatch. Errors, and ratios of one run, are the same everywhere.
"""

import json
import sys

result = json.load(sys.stdin)
print(json.dumps(result, indent=2))
names = ("eval_ns", "simpson_ratio", "max_error", "batch_ns", "batch_speedup", "batch", "cases", "simpson_cases")
figures = {name: result.get(name) for name in names}
wrong = [f"{name} is {value}" for name, value in figures.items() if not isinstance(value, int | float) or not value > 0]
if not wrong and not result["max_error"] <= 1e-14:
    wrong.append(f"max_error is {result['max_error']}, allowed are 1e-14 of the way")
if not wrong and not result["simpson_ratio"] >= 20:
    wrong.append(f"simpson_ratio is {result['simpson_ratio']}: Simpson's rule must take 20 times as long")
if wrong:
    sys.exit("; ".join(wrong))
