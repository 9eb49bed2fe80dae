#!/usr/bin/env python3
"""Writes docs/report/alignment.md: the paper's figure 7 and a table of all cases.

usage: alignment_report.py EVALUATE OUT PATH...
  EVALUATE  the evaluator's executable
  OUT       folder for alignment.md and its pictures
  PATH      alignment and scene folders
"""
import json
import os
import subprocess
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

KEYS = ["contour_mean_px", "contour_p95_px", "error3d_mean_percent", "error3d_rms_percent",
        "error3d_mean_percent_depth_removed", "error3d_rms_percent_depth_removed", "mask_iou",
        "ms_align", "cpu_ms_align"]
ERRORS = ["contour_mean_px", "error3d_mean_percent", "error3d_mean_percent_depth_removed"]
LEVELS = ["300", "600", "600,1200", "600,2000", "600,4000"]


def evaluate(executable, arguments):
    """One dictionary per case; a case that failed is missing and has said why on stderr."""
    out = subprocess.run([executable] + arguments, stdout=subprocess.PIPE, check=False, text=True)
    return [json.loads(line) for line in out.stdout.splitlines()]


def number(value):
    return "-" if value is None else f"{value:.3g}"


def plot(rows, x_key, x_label, path):
    """Contour and 3D error against x, one line per object."""
    figure, axes = plt.subplots(1, len(ERRORS), figsize=(13, 3.5))
    for axis, key in zip(axes, ERRORS):
        for name in sorted({row["object"] for row in rows}):
            points = sorted((row[x_key], row[key]) for row in rows if row["object"] == name)
            axis.plot([p[0] for p in points], [p[1] for p in points], "o-", label=name)
        axis.set_xlabel(x_label)
        axis.set_ylabel(key.replace("_", " "))
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def mean(rows, key):
    return sum(row[key] for row in rows) / len(rows)


def settings(executable, folders, path):
    """Mean errors against processor time: one point per choice of grids, and eq. 9 as it stands."""
    runs = [(levels, evaluate(executable, ["--nodes", levels] + folders)) for levels in LEVELS]
    runs.append(("eq. 9 as it stands", evaluate(executable, ["--literal"] + folders)))
    lines = ["| grids, nodes | " + " | ".join(ERRORS) + " | cpu_ms_align |",
             "|" + "---|" * (len(ERRORS) + 2)]
    figure, axes = plt.subplots(1, len(ERRORS), figsize=(13, 3.5))
    for name, rows in runs:
        strong = [row for row in rows if row["deformation_percent"] >= 30]
        if not strong:
            continue
        values = [mean(strong, key) for key in ERRORS + ["cpu_ms_align"]]
        lines.append(f"| {name} | " + " | ".join(number(value) for value in values) + " |")
        for axis, key, value in zip(axes, ERRORS, values):
            axis.plot(values[-1], value, "o")
            axis.annotate(name, (values[-1], value), fontsize=7)
            axis.set_xlabel("processor time, ms")
            axis.set_ylabel(key.replace("_", " "))
            axis.set_yscale("log")
            axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    return lines


def table(rows):
    lines = ["| case | object | d % | noise px | " + " | ".join(KEYS) + " | trusted |",
             "|" + "---|" * (len(KEYS) + 5)]
    for row in rows:
        cells = [row["case"], row["object"], number(row["deformation_percent"]),
                 number(row["noise_px"])] + [number(row[key]) for key in KEYS]
        lines.append("| " + " | ".join(cells) + f" | {row['trusted']} |")
    return lines


def main():
    executable, out, paths = sys.argv[1], sys.argv[2], sys.argv[3:]
    os.makedirs(out, exist_ok=True)
    rows = evaluate(executable, paths)
    deformed = [row for row in rows if row["deformation_percent"] is not None]
    text = ["# Alignment", "", "Errors of the fit; 3D in % of the diagonal, with nothing taken out and (`depth_removed`)",
            "with the scale about the camera's centre taken out, which one picture cannot show."]
    if deformed:
        folders = [path for path in paths if os.path.exists(os.path.join(path, "alignment.yaml"))]
        noisy = evaluate(executable, ["--noise", "0,1,2,3,4,5"] + folders)
        largest = max(row["deformation_percent"] for row in deformed)
        plot(deformed, "deformation_percent", "deformation, %", os.path.join(out, "deformation.png"))
        plot([row for row in noisy if row["deformation_percent"] == largest], "noise_px",
             "noise, px", os.path.join(out, "noise.png"))
        text += ["", "![error against deformation](deformation.png)", "",
                 "![error against noise](noise.png)", "",
                 "Error against time, means over all shapes deformed by 30 % and more:", "",
                 "![error against time](settings.png)", ""]
        text += settings(executable, folders, os.path.join(out, "settings.png"))
    with open(os.path.join(out, "alignment.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(text + [""] + table(rows)) + "\n")


if __name__ == "__main__":
    main()
