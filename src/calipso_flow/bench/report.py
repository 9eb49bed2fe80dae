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
REPEATS = 300


def evaluate(program, scenes, models, trace=None):
    """The evaluator's entries; scenes that it refuses are left out."""
    command = [program, "--models", models] + (["--trace", trace] if trace else []) + scenes
    return json.loads(subprocess.run(command, capture_output=True, text=True).stdout)


def run(program, *arguments):
    return json.loads(subprocess.run([program, *arguments], capture_output=True, text=True).stdout)


def flow_pair(folder):
    """A textured picture and the same moved by a known smooth flow, as Middlebury's evaluation has them."""
    random = np.random.default_rng(3)
    height, width = 360, 640
    noise = random.normal(0, 1, (height, width, 3)).astype(np.float32)
    texture = sum(cv2.GaussianBlur(noise, (0, 0), s) * s for s in (1.0, 3.0, 9.0))
    first = np.clip(127 + 45 * texture / texture.std(), 0, 255).astype(np.uint8)
    flow = np.stack([cv2.GaussianBlur(random.normal(0, 1, (height, width)).astype(np.float32), (0, 0), 60)
                     for _ in range(2)], axis=-1)
    flow = (6.0 * flow / np.abs(flow).max()).astype(np.float32)
    # The second picture shows at x what the first shows at x - f(x'), x' + f(x') = x: three fixed-point steps.
    v, u = np.mgrid[0:height, 0:width].astype(np.float32)
    back_u, back_v = u.copy(), v.copy()
    for _ in range(8):
        f = cv2.remap(flow, back_u, back_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        back_u, back_v = u - f[..., 0], v - f[..., 1]
    second = cv2.remap(first, back_u, back_v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    cv2.imwrite(os.path.join(folder, "frame10.png"), first)
    cv2.imwrite(os.path.join(folder, "frame11.png"), second)
    with open(os.path.join(folder, "flow10.flo"), "wb") as file:
        file.write(np.float32(202021.25).tobytes() + np.int32([width, height]).tobytes() + flow.tobytes())


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
           ("impacts_present", "impacts"), ("impacts_found", "found"), ("impacts_false", "false"),
           ("sign_change_error_frames", "sign change, frames"),
           ("restitution_error_percent", "restitution, %"), ("thrown_before_px", "thrown on, px"),
           ("thrown_after_px", "after impact, px"), ("below_uncertainty", "below its uncertainty"),
           ("covered_95", "v in its 95 %"), ("ms_frame", "ms/frame"),
           ("cpu_ms_frame", "CPU ms/frame")]


FILMED = [("case", "case"), ("wind_true_m_s", "wind, m/s"), ("wind_m_s", "found"),
          ("wind_deviation_m_s", "its deviation"), ("wind_direction_error_deg", "direction, deg"), ("wind_strength_error_percent", "strength, %"),
          ("frequency_true_hz", "frequency, Hz"), ("frequency_error_percent", "frequency, %"),
          ("stiffness_ratio_error_percent", "E/rho, %"), ("shape_error_percent", "shape, % of the motion")]
CLOTH = [("case", "case"), ("object", "object"), ("frequency_error_percent", "frequency, %"),
         ("travel_direction_error_deg", "travel, deg"), ("lean_error_percent", "lean, %"),
         ("wind_m_s", "wind, m/s"), ("wind_explained", "explained"),
         ("lower_edge_correlation", "lower edge, correlation"), ("carried_speed", "carried on: speed kept"),
         ("carried_edge_percent", "its lower edge off, %"), ("track_ms_frame", "tracking, ms/frame"),
         ("track_cpu_ms_frame", "CPU ms/frame"), ("wind_cpu_ms_frame", "search for the wind, CPU ms/frame")]
REPEATED = [("repeats", "repeats"), ("velocity_covered_95", "velocity in its 95 %"),
            ("spin_covered_95", "spin in its 95 %"), ("gravity_found", "g told"), ("gravity_covered_95", "g in its 95 %"),
            ("velocity_normalised", "squared v error over its variance"),
            ("spin_normalised", "of spin"), ("velocity_rms_m_s", "velocity error, m/s")]
FLOW = [("method", "method"), ("endpoint_error_px", "end-point error, px"), ("ms_frame", "CPU ms")]


def columns(entries, chosen):
    lines = ["| " + " | ".join(title for _, title in chosen) + " |", "|" + "---|" * len(chosen)]
    for entry in entries:
        lines.append("| " + " | ".join(show(entry.get(key)) for key, _ in chosen) + " |")
    return "\n".join(lines)


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


def plot_errors(csvs, picture):
    """Error of the velocity against time, one line per moving object."""
    figure, axis = plt.subplots(figsize=(8, 3))
    for csv in csvs:
        data = np.genfromtxt(csv, delimiter=",", names=True, comments="#")
        error = np.sqrt(sum((data["v" + n] - data["tv" + n])**2 for n in "xyz"))
        axis.semilogy(data["t"], np.maximum(error, 1e-4), label=os.path.basename(csv)[:-4])
    axis.set_xlabel("t, s")
    axis.set_ylabel("velocity error, m/s")
    axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(picture, dpi=90)
    plt.close(figure)


def plot_filmed(entries, picture):
    """Wind as found and true, level with the ground."""
    figure, axis = plt.subplots(figsize=(4.5, 4))
    for i, entry in enumerate(e for e in entries if "wind_true_m_s" in e):
        x, y, _ = entry["wind_true_m_s"]
        axis.annotate("", (x, y), (0, 0), arrowprops={"arrowstyle": "->", "color": "k"})
        if entry.get("wind_m_s"):
            x, y, _ = entry["wind_m_s"]
            axis.annotate("", (x, y), (0, 0), arrowprops={"arrowstyle": "->", "color": f"C{i + 1}"})
        axis.plot([], [], f"C{i + 1}", label=entry["case"])
    axis.plot([], [], "k", label="true")
    axis.set_xlim(-3, 3)
    axis.set_ylim(-5, 5)
    axis.set_xlabel("along the sheet, m/s")
    axis.set_ylabel("across the sheet, m/s")
    axis.legend(loc="lower right", fontsize=6)
    figure.tight_layout()
    figure.savefig(picture, dpi=90)
    plt.close(figure)


def degradation(program, scenes, changes):
    entries = []
    for title, change in changes:
        with tempfile.TemporaryDirectory() as folder:
            for scene in scenes:
                copy = degraded_copy(scene, folder, change)
                for entry in evaluate(program, [copy], "aligned"):
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
        aligned = evaluate(arguments.evaluate, arguments.scenes, "aligned", trace)
        pictures = []
        for entry in (e for e in aligned if e.get("moving") and not e.get("deforms")):
            name = f"{entry['case']}_{entry['object']}"
            picture = f"dynamics_{name}.png"
            plot(os.path.join(trace, name + ".csv"), os.path.join(folder, picture))
            pictures.append(picture)
        rigid = [os.path.join(trace, f"{e['case']}_{e['object']}.csv") for e in aligned
                 if e.get("moving") and not e.get("deforms")]
        if rigid:
            plot_errors(rigid, os.path.join(folder, "dynamics_errors.png"))
            pictures.append("dynamics_errors.png")
    exact = evaluate(arguments.evaluate, arguments.scenes, "true")
    large = run(arguments.evaluate, "--scale", "2", *arguments.scenes)
    filmed = run(arguments.evaluate, "--filmed")
    plot_filmed(filmed, os.path.join(folder, "dynamics_wind.png"))
    repeats = run(arguments.evaluate, "--repeats", str(REPEATS))
    with tempfile.TemporaryDirectory() as pair:
        flow_pair(pair)
        flow = run(arguments.evaluate, pair)
    moving_names = {e["case"] for e in aligned if e["moving"] and not e["deforms"]}
    moving = [s for s in arguments.scenes if os.path.basename(s.rstrip("/")) in moving_names]
    noisy = degradation(arguments.evaluate, moving,
                        [(f"noise {s} grey", add_noise(s)) for s in NOISE_GREY] +
                        [(f"blur {n} px", blur_down(n)) for n in BLUR_PX])
    cloth = [e for e in aligned + exact if e.get("deforms")]
    with open(arguments.out, "w") as out:
        out.write("# Dynamics\nWritten by `calipso_flow/bench/run.sh`. Errors are root mean squares up to the "
                  "first true collision. Impacts less than a frame apart are one, found when told within a frame. "
                  "ms/frame is wall time over all objects of a scene, tracking and fit.\n\n"
                  "## Models and masks as calipso_align finds them\n" + table(aligned) +
                  "\n\n## True model and pose\n" + table(exact) +
                  "\n\n## Enlarged to twice the width and height\n" + table(large) +
                  "\n\n## Simulated and filmed: sheets in a steady wind, beams struck\n"
                  "What blows along a flat sheet does not move it, and cannot be seen. The sheets are simulated with 500 nodes at 1/120 s; "
                  "`coarse` with 120 at 1/30 s, `simulator` as an edited object is, `soft` at 0.3 of the stiffness, `pegged` by two "
                  "corners; estimated with 90 nodes at 1/30 s.\n\n" +
                  columns(filmed, FILMED) + "\n\n![dynamics_wind.png](dynamics_wind.png)\n\n"
                  "## A thrown box, filmed with fresh noise\n" + columns(repeats, REPEATED) +
                  "\n\n## Dense flow and its peers on one pair of 640x360\n" + columns(flow, FLOW))
        if cloth:
            out.write("\n\n## Cloth: as aligned, then true model\n" + columns(cloth, CLOTH))
        if noisy:
            out.write("\n\n## Noise and blur added to the frames\n" + table(noisy, "frames"))
        if pictures:
            out.write("\n\n## Estimated and true velocity, with two deviations\n")
        for picture in pictures:
            out.write(f"![{picture}]({picture})\n\n")


if __name__ == "__main__":
    main()
