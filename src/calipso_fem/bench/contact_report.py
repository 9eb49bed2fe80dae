#!/usr/bin/python3
"""Table of the contact cases and, for the two falling cubes, error against time beside Bullet.

usage: contact_report.py OUTPUT_FOLDER RESULTS.jsonl
"""
import json
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

FLOOR_MM = 1e-3  # depths below are drawn there


def number(value):
    return "-" if value is None else f"{value:.4g}"


def rows(results):
    yield "| case | quantity | value | reference | relative error | depth / proximity | energy growth | CPU ms per frame |"
    yield "|---|---|---|---|---|---|---|---|"
    for r in results:
        keys = ("value", "reference", "rel_error", "max_penetration_ratio", "energy_growth", "ms_per_frame")
        name = os.path.basename(r["case"].rstrip("/"))
        yield f"| {name} | {r['quantity']} | " + " | ".join(number(r[k]) for k in keys) + " |"


def tells_depth(result):
    return result["quantity"].startswith("lowest vertex") and "cube" in result["quantity"]


def error_against_time(results):
    yield "| scene and step | deepest penetration, mm | CPU ms per frame |"
    yield "|---|---|---|"
    for r in results:
        if not tells_depth(r):
            continue
        depth = "blew up" if r["value"] is None else f"{max(0.0, -r['value']) * 1e3:.3g}"
        yield f"| {r['quantity'].split('lowest vertex of ')[-1].removesuffix(', m')} | {depth} | {number(r['ms_per_frame'])} |"


def plot_error_against_time(results, path):
    figure, axes = plt.subplots(figsize=(7, 5))
    for name, ours in (("Calipso", True), ("Bullet, deformable", False)):
        points = sorted(
            (r["ms_per_frame"], max(FLOOR_MM, -1e3 * r["value"]), r["quantity"])
            for r in results
            if tells_depth(r) and r["value"] is not None
            and ("Bullet" not in r["quantity"]) == ours
        )
        if points:
            axes.loglog([p[0] for p in points], [p[1] for p in points], "o", label=name)
        for ms, depth, quantity in points:
            rate = quantity.split(" steps a second")[0].split()[-1]
            axes.annotate(f"{rate}/s", (ms, depth), textcoords="offset points", xytext=(5, 5), fontsize=8)
    axes.set(xlabel="CPU ms per frame of 1/30 s", ylabel="deepest penetration of the plane, mm")
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    output, path = sys.argv[1:]
    with open(path) as file:
        results = [json.loads(line) for line in file]
    with open(os.path.join(output, "contact.md"), "w") as report:
        print("# Contact\n\nProcess CPU time, all threads together.\n\n## Cases\n", file=report)
        print("\n".join(rows(results)), file=report)
        print("\n## Error against time: two soft cubes of 512 nodes fall on a plane and on each other\n", file=report)
        print("\n".join(error_against_time(results)), file=report)
        print("\n![error against time](contact_error.png)\n", file=report)
        print(f"Depths below {FLOOR_MM} mm are drawn there; runs that blew up are not drawn.", file=report)
    plot_error_against_time(results, os.path.join(output, "contact_error.png"))


main()
