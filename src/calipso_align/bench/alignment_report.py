#!/usr/bin/env python3
"""Writes alignment.md: the paper's figure 7, error against time, and tables of scenes and masks.

usage: alignment_report.py OUT FOLDER...
  OUT      folder for alignment.md and its pictures
  FOLDER   alignment and scene folders
"""
import json
import os
import shutil
import subprocess
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

ERRORS = ["contour_mean_px", "error3d_mean_percent", "error3d_mean_percent_depth_removed"]
LABELS = ["contour, px", "3D, % of the diagonal", "3D without distance, %"]
SCENE_KEYS = ["contour_mean_px", "contour_floor_px", "contour_p95_px", "hull_mean_px", "hull_floor_px",
              "error3d_mean_percent", "error3d_rms_percent", "expected3d_mean_percent", "mask_iou",
              "model_mask_iou", "cpu_ms_align"]
PLACEMENTS = "20"   # per shape
TWICE = {"contour_mean_px": 1.0, "error3d_mean_percent": 4.0, "error3d_rms_percent": 6.0}
MASK_KEYS = ["mask_iou", "grabcut_iou", "contour_mean_px", "ms_segment", "ms_stroke", "ms_grabcut",
             "tracked_iou", "ms_track"]
LEVELS = ["300", "600", "600,2000", "600,4000"]
STRONG = "30,60"   # percent


def run(program, arguments):
    """One dictionary per case; a case that failed is missing and has said why on stderr."""
    out = subprocess.run(["rosrun", "calipso_align", program] + arguments, stdout=subprocess.PIPE,
                         check=False, text=True)
    return [json.loads(line) for line in out.stdout.splitlines() if line.startswith("{")]


def number(value):
    return "-" if value is None else f"{value:.3g}"


def mean(rows, key):
    return sum(row[key] for row in rows) / len(rows)


def table(rows, keys):
    lines = ["| case | object | " + " | ".join(key.replace("_", " ") for key in keys) + " |",
             "|" + "---|" * (len(keys) + 2)]
    for row in rows:
        cells = [number(row.get(key)) if key != "trusted" else str(row[key]) for key in keys]
        lines.append(f"| {row['case']} | {row['object']} | " + " | ".join(cells) + " |")
    return lines


def figure7(rows, x_key, x_label, path):
    """Errors against x, one line per object."""
    figure, axes = plt.subplots(1, len(ERRORS), figsize=(13, 3.5))
    for axis, key, label in zip(axes, ERRORS, LABELS):
        for name in sorted({row["object"] for row in rows}):
            points = sorted((row[x_key], row[key]) for row in rows if row["object"] == name)
            axis.plot([p[0] for p in points], [p[1] for p in points], "o-", label=name)
        axis.set_xlabel(x_label)
        axis.set_ylabel(label)
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=100)


def settings(folders, path):
    """Mean errors against processor time: one point per choice of grids, and eq. 9 as published."""
    common = ["--deformation", STRONG]
    runs = [(levels, run("evaluate", common + ["--nodes", levels] + folders)) for levels in LEVELS]
    runs.append(("eq. 9 literally", run("evaluate", common + ["--literal"] + folders)))
    lines = ["| grids, nodes | " + " | ".join(LABELS) + " | processor time, ms |", "|" + "---|" * 5]
    figure, axes = plt.subplots(1, len(ERRORS), figsize=(13, 3.5))
    for name, rows in runs:
        if not rows:
            continue
        values = [mean(rows, key) for key in ERRORS + ["cpu_ms_align"]]
        lines.append(f"| {name} | " + " | ".join(number(value) for value in values) + " |")
        for axis, label, value in zip(axes, LABELS, values):
            axis.plot(values[-1], value, "o")
            axis.annotate(name, (values[-1], value), fontsize=7)
            axis.set_xlabel("processor time, ms")
            axis.set_ylabel(label)
            axis.grid(alpha=0.3)
    axes[0].set_yscale("log")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    return lines


def placements(folders):
    """Random rough placements: how many end well, and whether the others are told."""
    rows = run("evaluate", ["--deformation", "30", "--seeds", PLACEMENTS] + folders)
    lines = ["| shape | placements | within twice the aims | others that are trusted | within, but not trusted |",
             "|" + "---|" * 5]
    for name in sorted({row["object"] for row in rows}):
        own = [row for row in rows if row["object"] == name]
        good = [row for row in own if all(row[key] <= limit for key, limit in TWICE.items())]
        missed = [row for row in own if row not in good and row["trusted"]]
        lines.append(f"| {name} | {len(own)} | {len(good)} | {len(missed)} | "
                     f"{sum(not row['trusted'] for row in good)} |")
    return ["Random rough placements up to 10 degrees and 5 % of the distance off, shapes deformed by 30 %, within 1 px, "
            "4 % mean and 6 % r.m.s.:", ""] + lines + [""]


def shapes(folders, out):
    """The paper's figure 7 and what settings cost."""
    rows = run("evaluate", folders)
    noisy = run("evaluate", ["--deformation", STRONG.split(",", maxsplit=1)[0], "--noise", "0,1,3,5"] + folders)
    figure7(rows, "deformation_percent", "deformation, %", os.path.join(out, "alignment_deformation.png"))
    figure7(noisy, "noise_px", "noise, px", os.path.join(out, "alignment_noise.png"))
    trusted = [row for row in rows if row["trusted"]]
    text = ["## Deformed shapes, contour only", "",
            f"{len(rows)} fits; {len(trusted)} trusted. Not trusted are those that may be off by more than 4 % of the "
            "diagonal with a probability above a tenth: one contour does not show the distance of a shape of unknown "
            "size.", "",
            "![error against deformation](alignment_deformation.png)", "",
            "Noise on the contour's points, shapes deformed by 30 %:", "",
            "![error against noise](alignment_noise.png)", "",
            "Error against time, means over shapes deformed by 30 and 60 %:", "",
            "![error against time](alignment_settings.png)", ""]
    return text + settings(folders, os.path.join(out, "alignment_settings.png")) + [""] + placements(folders)


def scenes(folders, out):
    """Table of all scenes, overlays of those with a truth, masks beside cv::grabCut."""
    with tempfile.TemporaryDirectory() as work:
        rows = run("evaluate", ["--pictures", work] + folders)
        text = ["## Scenes, from rough placement and strokes", "",
                "A floor is what the true shape itself has against the picture's true contour, without the details "
                "that its stock model lacks.", ""] + table(rows, SCENE_KEYS + ["trusted"]) + [""]
        for row in rows:
            name = f"{row['case']}_{row['object']}.png"
            # A photograph without truth may not be ours to show.
            if row["mask_iou"] is not None and os.path.exists(os.path.join(work, name)):
                shutil.copy(os.path.join(work, name), os.path.join(out, "alignment_" + name))
                text += [f"![{row['case']}, {row['object']}: outline of the fitted model](alignment_{name})"]
    masks = run("evaluate_segmentation", ["--grabcut", "--track"] + folders)
    colours = run("evaluate_segmentation", ["--no-depth"] + folders)
    for row, other in zip(masks, colours):
        row["colours_only_iou"] = other.get("mask_iou")
    return text + ["", "## Masks", "", "Processor time, ms.", ""] + \
        table(masks, MASK_KEYS[:1] + ["colours_only_iou"] + MASK_KEYS[1:]) + [""]


def main():
    out, paths = sys.argv[1], sys.argv[2:]
    has = lambda path, name: os.path.exists(os.path.join(path, name))
    alignment = [path for path in paths if has(path, "alignment.yaml")]
    scene = [path for path in paths if has(path, "scene.yaml")]
    text = ["# Alignment", "", "`src/calipso_align/bench/run.sh` wrote this page."
            " 3D errors are parts of the diagonal, with nothing taken out.", ""]
    if alignment:
        text += shapes(alignment, out)
    if scene:
        text += scenes(scene, out)
    with open(os.path.join(out, "alignment.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(text))


if __name__ == "__main__":
    main()
