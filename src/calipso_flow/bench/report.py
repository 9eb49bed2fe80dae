#!/usr/bin/env python3
"""Writes the dynamics report: runs `evaluate` on scene folders, and on noisier and blurrier copies.

usage: report.py --evaluate PROGRAM --out dynamics.md SCENE...
"""
import argparse
import json
import os
import shutil
import subprocess
import tempfile

import cv2
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend has to be chosen first)

NOISE_GREY = [0, 4, 8, 16]
BLUR_PX = [3, 7, 15]


def evaluate(program, scenes, models, trace=None):
    """The evaluator's entries; scenes that it refuses are left out."""
    command = [program, "--models", models] + (["--trace", trace] if trace else []) + scenes
    return json.loads(subprocess.run(command, capture_output=True, text=True).stdout)


def degraded_copy(scene, folder, change):
    """A copy of a scene folder whose frames went through `change`; all else is linked."""
    copy = os.path.join(folder, os.path.basename(scene.rstrip("/")))
    os.makedirs(os.path.join(copy, "frames"))
    for name in os.listdir(scene):
        if name != "frames":
            os.symlink(os.path.join(os.path.abspath(scene), name), os.path.join(copy, name))
    for name in sorted(os.listdir(os.path.join(scene, "frames"))):
        picture = cv2.imread(os.path.join(scene, "frames", name))
        cv2.imwrite(os.path.join(copy, "frames", name), change(picture),
                    [cv2.IMWRITE_JPEG_QUALITY, 95])
    return copy


def add_noise(sigma):
    random = np.random.default_rng(1)
    return lambda p: np.clip(p + random.normal(0, sigma, p.shape), 0, 255).astype(np.uint8)


def blur_down(length):
    return lambda p: cv2.blur(p, (1, length))


def show(value, digits=2):
    if value is None:
        return "-"
    if isinstance(value, list):
        return ", ".join(show(v) for v in value) or "-"
    return f"{value:.{digits}f}" if isinstance(value, float) else str(value)


COLUMNS = [("case", "case"), ("object", "object"), ("moving", "moves"),
           ("velocity_error_percent", "v, %"), ("velocity_error_px", "v, px/frame"),
           ("angular_velocity_error_percent", "spin, %"), ("g_error_percent", "g, %"),
           ("collision_errors_frames", "collisions, frames"),
           ("sign_change_error_frames", "sign change, frames"),
           ("restitution_error_percent", "restitution, %"), ("ms_frame", "CPU ms/frame")]


def table(entries, extra=None):
    head = ([extra] if extra else []) + [title for _, title in COLUMNS]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for entry in entries:
        cells = ([entry["degraded"]] if extra else [])
        cells += [show(entry.get(key)) for key, _ in COLUMNS]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def plot(csv, picture):
    """Speed along each axis, estimated with its two-sigma band, and true."""
    data = np.genfromtxt(csv, delimiter=",", names=True, comments="#")
    figure, axes = plt.subplots(1, 3, figsize=(11, 3), sharex=True)
    for axis, name in zip(axes, "xyz"):
        estimate, sigma = data["v" + name], data["s" + name]
        axis.plot(data["t"], data["tv" + name], "k", linewidth=1, label="true")
        axis.plot(data["t"], estimate, "C1.-", linewidth=1, markersize=3, label="estimated")
        axis.fill_between(data["t"], estimate - 2 * sigma, estimate + 2 * sigma, alpha=0.25,
                          color="C1")
        axis.set_title(f"v{name}, m/s")
        axis.set_xlabel("t, s")
    axes[0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(picture, dpi=90)
    plt.close(figure)


def degradation(program, scenes, changes):
    entries = []
    for title, change in changes:
        with tempfile.TemporaryDirectory() as folder:
            for scene in scenes:
                copy = degraded_copy(scene, folder, change)
                for entry in evaluate(program, [copy], "held"):
                    entries.append(dict(entry, degraded=title))
                shutil.rmtree(copy)
    return entries


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--evaluate", required=True, help="the evaluate program")
    parser.add_argument("--out", required=True, help="the report to write")
    parser.add_argument("scenes", nargs="+")
    arguments = parser.parse_args()
    folder = os.path.dirname(os.path.abspath(arguments.out))
    os.makedirs(folder, exist_ok=True)

    with tempfile.TemporaryDirectory() as trace:
        held = evaluate(arguments.evaluate, arguments.scenes, "held", trace)
        pictures = []
        for entry in (e for e in held if e.get("moving")):
            name = f"{entry['case']}_{entry['object']}"
            picture = f"dynamics_{name}.png"
            plot(os.path.join(trace, name + ".csv"), os.path.join(folder, picture))
            pictures.append(picture)
    exact = evaluate(arguments.evaluate, arguments.scenes, "true")
    moving_names = {e["case"] for e in held if e["moving"]}
    moving = [s for s in arguments.scenes if os.path.basename(s.rstrip("/")) in moving_names]
    noisy = degradation(arguments.evaluate, moving,
                        [(f"noise {s} grey", add_noise(s)) for s in NOISE_GREY] +
                        [(f"blur {n} px", blur_down(n)) for n in BLUR_PX])
    with open(arguments.out, "w") as out:
        out.write("# Dynamics\nWritten by `calipso_flow/bench/report.py`. Errors are root mean "
                  "squares up to the first true collision; times are CPU.\n\n"
                  "## Aligned model, depth held at the rough placement\n" + table(held) +
                  "\n\n## True model and pose\n" + table(exact) +
                  "\n\n## Noise and blur added to the frames\n" + table(noisy, "frames") +
                  "\n\n## Estimated and true velocity, with two deviations\n")
        for picture in pictures:
            out.write(f"![{picture}]({picture})\n\n")


if __name__ == "__main__":
    main()
