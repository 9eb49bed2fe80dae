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


PROXIMITY_MM = 5.0


def falling(results, count, bullet):
    """(CPU ms per frame, deepest penetration in mm, what) of the runs with `count` cubes, cheapest first."""
    words = f"lowest vertex of {count} soft cube"
    runs = [r for r in results if words in r["quantity"] and r["quantity"].startswith("Bullet") == bullet
            and (bullet or r["case"] == "falling_cubes")]
    return sorted(
        (r["ms_per_frame"], None if r["value"] is None else PROXIMITY_MM * r["max_penetration_ratio"],
         r["quantity"].split(", ", 1)[1].replace(", m", "")) for r in runs)


def ratio(run, ours):
    """What Bullet takes over what the cheapest of ours takes that is no deeper, within a hundredth of the distance."""
    if run[1] is None:
        return "-"
    fitting = [o[0] for o in ours if o[1] is not None and o[1] <= max(run[1], 0.01 * PROXIMITY_MM)]
    return f"{run[0] / min(fitting):.1f}" if fitting else "none of Calipso's is as little deep"


def error_against_time(results):
    yield "| cubes | engine | steps, tolerance | deepest penetration, mm | CPU ms per frame | Bullet over Calipso at no larger penetration |"
    yield "|---|---|---|---|---|---|"
    for count in ("one", "two"):
        ours = falling(results, count, False)
        for name, runs in (("Calipso", ours), ("Bullet", falling(results, count, True))):
            for run in runs:
                depth = "blew up" if run[1] is None else f"{run[1]:.3g}"
                over = ratio(run, ours) if name == "Bullet" else ""
                yield f"| {count} | {name} | {run[2]} | {depth} | {number(run[0])} | {over} |"


def plot_error_against_time(results, path):
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.5), sharey=True)
    for ax, count in zip(axes, ("one", "two")):
        for name, bullet in (("Calipso", False), ("Bullet, deformable", True)):
            runs = [r for r in falling(results, count, bullet) if r[1] is not None]
            if runs:
                ax.loglog([r[0] for r in runs], [max(FLOOR_MM, r[1]) for r in runs], "s" if bullet else "o", label=name)
            for ms, depth, what in runs:
                label = what.split(" steps")[0] + "/s" + (what.split(", to")[1].join((",", "")) if ", to" in what else "")
                ax.annotate(label, (ms, max(FLOOR_MM, depth)), textcoords="offset points", xytext=(5, 5), fontsize=7)
        ax.set(xlabel="CPU ms per frame of 1/30 s", title=f"{count} soft cube{'s' if count == 'two' else ''}")
    axes[0].set(ylabel="deepest penetration, mm")
    axes[0].legend(loc="center")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    output, path = sys.argv[1:]
    with open(path) as file:
        results = [json.loads(line) for line in file]
    with open(os.path.join(output, "contact.md"), "w") as report:
        print("# Contact\n\nProcess CPU time, all threads together; rows of wall time are so named.\n\n## Cases\n", file=report)
        print("\n".join(rows(results)), file=report)
        print("\n## Error against time: soft cubes of 512 nodes fall on a plane and on each other, the first second\n", file=report)
        print("\n".join(error_against_time(results)), file=report)
        print("\n![error against time](contact_error.png)\n", file=report)
        print(f"Deepest of all vertices below the plane or in the other cube. Depths below {FLOOR_MM} mm are drawn there, "
              "runs that blew up are not. Bullet keeps its nodes a margin of 5 mm above what they lie on.", file=report)
    plot_error_against_time(results, os.path.join(output, "contact_error.png"))


main()
