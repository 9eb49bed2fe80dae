#!/usr/bin/env python3
"""Writes docs/report/fem.md and its plots from the evaluator's and the benchmark's JSON lines.

usage: report.py OUTPUT_FOLDER EVALUATE_JSONL BENCHMARK_JSONL
"""
import json
import math
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def read_lines(path):
    with open(path) as f:
        return [json.loads(line) for line in f if line.strip()]


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(str(c) for c in row) + " |" for row in rows])


def short(value):
    return "-" if value is None else f"{value:.3g}"


def same_discretisation(results):
    worst = {}
    for r in results:
        if r["kind"] != "same_discretisation":
            continue
        key = (r["case"], r["element"])
        error = float("inf") if r["rel_error"] is None else r["rel_error"]
        if error >= worst.get(key, (-1.0, ""))[0]:
            worst[key] = (error, r["quantity"])
    rows = [(c, e, short(v[0]), v[1]) for (c, e), v in sorted(worst.items())]
    return table(["case", "element", "largest relative error", "of"], rows)


def accuracy(results):
    rows = [
        (r["case"], r["nodes"], r["quantity"], short(r["rel_error"]), short(r["ms_per_step"]))
        for r in results
        if r["kind"] == "default" and not r["quantity"].startswith("energy")
    ]
    return table(["case", "nodes", "quantity", "relative error", "ms per step"], rows)


def plot_error_against_time(results, path):
    """One line per static case, over its grids; dashed where the cells are graded."""
    figure, axes = plt.subplots(figsize=(8, 5))
    lines = {}
    for r in results:
        if r["kind"] == "default" and r["quantity"].partition("@")[0] in ("tip", "u_top_right"):
            lines.setdefault((r["case"], r["quantity"].endswith("@graded")), []).append(
                (r["ms_per_step"], r["rel_error"]))
    cases = sorted({case for case, _ in lines})
    for (case, graded), points in sorted(lines.items()):
        axes.loglog(*zip(*points), "o--" if graded else "o-", color=plt.cm.tab20(cases.index(case) % 20),
                    markersize=4, label=None if graded else case)
    axes.set(xlabel="static solution, ms", ylabel="relative error of the tip (Cook's panel: of its corner)")
    axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def exponent(points):
    """Slope of log cost over log size, least squares."""
    xs = [math.log(n) for n, _ in points]
    ys = [math.log(t) for _, t in points]
    mx, my = sum(xs) / len(xs), sum(ys) / len(ys)
    return sum((x - mx) * (y - my) for x, y in zip(xs, ys)) / sum((x - mx) ** 2 for x in xs)


def plot_cost(bench, path):
    figure, axes = plt.subplots(figsize=(7, 5))
    groups = sorted({(b["kind"], b["element"], b["solver"]) for b in bench
                     if b["kind"] in ("linearised", "newton")})
    for kind, element, solver in groups:
        points = sorted((b["nodes"], b["cpu_ms_per_step"]) for b in bench
                        if (b["kind"], b.get("element"), b.get("solver")) == (kind, element, solver))
        axes.loglog(*zip(*points), "s--" if kind == "newton" else "o-",
                    label=" ".join((kind, element, solver)))
    axes.set(xlabel="nodes", ylabel="CPU ms per step")
    axes.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def plot_rest(bench, path):
    figure, axes = plt.subplots(figsize=(7, 5))
    rest = [b for b in bench if b["kind"] == "rest"]
    for engine in sorted({b["engine"] for b in rest}):
        points = [(b["cpu_ms_per_step"], b["rel_error"]) for b in rest if b["engine"] == engine]
        axes.loglog(*zip(*points), "o-", label=engine)
    axes.set(xlabel="CPU ms per step", ylabel="relative error of the resting tip")
    axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=120)


SETTINGS = {
    "resolution": lambda b: "default, finer and finer",
    "time step": lambda b: b["scheme"],
    "element": lambda b: b["element"],
    "solver": lambda b: b["solver"],
    "tolerance": lambda b: "one linearised step" if b["linearised"] else "Newton",
    "material": lambda b: b["material"],
}


def plot_settings(bench, path):
    figure, axes = plt.subplots(2, 3, figsize=(13, 8))
    for panel, (varied, label) in zip(axes.flat, SETTINGS.items()):
        chosen = [b for b in bench if b["kind"] == "trajectory" and b["varied"] == varied]
        for name in sorted({label(b) for b in chosen}):
            points = [(b["cpu_ms_per_second"], b["rel_error"]) for b in chosen if label(b) == name]
            panel.loglog(*zip(*points), "o-", label=name, markersize=4)
        panel.set(title=varied, xlabel="CPU ms per simulated second", ylabel="relative error, tip at 0.5 s")
        panel.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def settings(bench):
    rows = [(b["varied"], b["nodes"], b["element"], b["material"], b["solver"], b["scheme"],
             "linearised" if b["linearised"] else "Newton", short(b["linear_tolerance"]), short(b["h"]),
             short(b["cpu_ms_per_second"]), short(b["rel_error"]))
            for b in bench if b["kind"] == "trajectory"]
    return table(["varied", "nodes", "element", "material", "solver", "scheme", "step", "CG tolerance",
                  "h, s", "CPU ms per second", "relative error"], rows)


def against_bullet(bench):
    """Each run of Bullet beside the cheapest run of ours that is at least as accurate."""
    rest = [b for b in bench if b["kind"] == "rest"]
    rows = []
    for bullet in (b for b in rest if b["engine"] == "bullet"):
        better = [b for b in rest
                  if b["engine"] != "bullet" and b["rel_error"] <= bullet["rel_error"]]
        if not better:
            rows.append((bullet["nodes"], short(bullet["rel_error"]), short(bullet["cpu_ms_per_step"]),
                         "-", "-", "-", "-"))
            continue
        ours = min(better, key=lambda b: b["cpu_ms_per_step"])
        rows.append((bullet["nodes"], short(bullet["rel_error"]), short(bullet["cpu_ms_per_step"]),
                     f"{ours['engine']}, {ours['nodes']} nodes", short(ours["rel_error"]),
                     short(ours["cpu_ms_per_step"]),
                     f"{bullet['cpu_ms_per_step'] / ours['cpu_ms_per_step']:.0f}"))
    return table(["Bullet, nodes", "its error", "CPU ms", "ours", "error", "CPU ms", "times faster"], rows)


def scaling(bench):
    newton = sorted((b for b in bench if b["kind"] == "newton" and b["nodes"] > 1000), key=lambda b: b["nodes"])
    cpu, wall = (exponent([(b["nodes"], b[key]) for b in newton])
                 for key in ("cpu_ms_per_step", "wall_ms_per_step"))
    memory = max((b["kb_per_node"] for b in newton if b["nodes"] > 5000), default=None)
    return (f"Newton's cost grows with the exponent {wall:.2f} (wall; CPU {cpu:.2f}) from {newton[0]['nodes']:,} to "
            f"{newton[-1]['nodes']:,} nodes; at most {short(memory)} kB per node are in use (above 5,000 nodes).")


def steps(bench):
    rows = [
        (b["kind"], b["nodes"], b["element"], b.get("solver", "-"),
         short(b["cpu_ms_per_step"]), short(b.get("wall_ms_per_step")),
         short(b.get("cg_iterations")), short(b.get("newton_iterations")), short(b["build_cpu_ms"]),
         short(b["kb_per_node"]))
        for b in bench if b["kind"] in ("linearised", "newton")
    ]
    return table(["step", "nodes", "element", "solver", "CPU ms", "wall ms", "CG", "Newton",
                  "building, CPU ms", "kB per node"], rows)


def hard(bench):
    rows = [
        (b["case"], b["nodes"], b["material"], short(b["h"]), b["steps"],
         short(b["energy_growth"]), short(b["displacement"]),
         b["recovering_steps"], b["unconverged_steps"], "yes" if b["recovered"] else "no")
        for b in bench if b["kind"] == "hard"
    ]
    return table(["case", "nodes", "material", "h, s", "steps", "largest energy growth",
                  "distance from rest / size", "steps with stiffened material", "steps not converged",
                  "recovered"], rows)


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    folder, results, bench = sys.argv[1], read_lines(sys.argv[2]), read_lines(sys.argv[3])
    os.makedirs(folder, exist_ok=True)
    plot_error_against_time(results, os.path.join(folder, "fem_error.png"))
    plot_cost(bench, os.path.join(folder, "fem_cost.png"))
    plot_rest(bench, os.path.join(folder, "fem_bullet.png"))
    plot_settings(bench, os.path.join(folder, "fem_settings.png"))
    sections = [
        "# Finite elements: speed against error",
        "Written by `src/calipso_fem/bench/report.py`. CPU milliseconds count both threads; wall "
        "times depend on what else the machine does.",
        "## Same discretisation, same numbers", same_discretisation(results),
        "## Default element against converged references",
        "`@graded`: as many cells, drawn towards the clamped end of a beam or the corners of a panel.",
        accuracy(results),
        "![error against time](fem_error.png)",
        "*Every line a case, from its coarsest grid to its finest; dashed: `@graded`.*",
        "## Time steps of the reference beam",
        "One step of 1/30 s of the beam [0, 1] x [0, 0.25]^2 m, E = 1e6 Pa, nu = 0.3, under gravity: linearised, to a "
        "relative residual of 1e-5, or Newton to 1e-4.",
        steps(bench), scaling(bench),
        "![cost against size](fem_cost.png)",
        "## Beside Bullet's deformable body",
        "The beam after 16 s of steps of 1/30 s, against its equilibrium on a grid of 18,785 nodes. Bullet: "
        "`btDeformableMultiBodyDynamicsWorld`, implicit, linear elasticity, single precision.",
        against_bullet(bench), "![beside Bullet](fem_bullet.png)",
        "## Error against time, setting by setting",
        "The beam let go, at 0.5 s, against a run on a finer grid with small steps (BDF2). 60 steps per second, 208 or "
        "425 nodes, unless varied.",
        settings(bench), "![setting by setting](fem_settings.png)",
        "## Hard cases",
        "`stvk` until the body is at rest or 600 steps are over; the others, which take up to a hundred times as long, for "
        "two seconds of CPU time each: what is not back by then is not recovered.",
        hard(bench),
    ]
    with open(os.path.join(folder, "fem.md"), "w") as f:
        f.write("\n\n".join(sections) + "\n")


if __name__ == "__main__":
    main()
