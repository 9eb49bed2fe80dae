#!/usr/bin/env python3
"""Writes docs/report/fem.md and its plots from the evaluator's and the benchmark's JSON lines.

usage: report.py OUTPUT_FOLDER EVALUATE_JSONL BENCHMARK_JSONL
"""
import json
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
    figure, axes = plt.subplots(figsize=(7, 5))
    for element in sorted({r["element"] for r in results}):
        points = [
            (r["ms_per_step"], r["rel_error"])
            for r in results
            if r["element"] == element and r["kind"] == "default" and r["quantity"] == "tip"
        ]
        if points:
            axes.loglog(*zip(*points), "o", label=element)
    axes.set(xlabel="static solution, ms", ylabel="relative error of the tip")
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def plot_cost(bench, path):
    figure, axes = plt.subplots(figsize=(7, 5))
    groups = sorted({(b["kind"], b.get("element", ""), b.get("solver", "")) for b in bench
                     if b["kind"] in ("linearised", "newton")})
    for kind, element, solver in groups:
        points = sorted((b["nodes"], b["cpu_ms_per_step"]) for b in bench
                        if (b["kind"], b.get("element", ""), b.get("solver", ""))
                        == (kind, element, solver))
        axes.loglog(*zip(*points), "o-", label=" ".join(filter(None, (kind, element, solver))))
    axes.set(xlabel="nodes", ylabel="CPU ms per step")
    axes.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def steps(bench):
    rows = [
        (b["kind"], b["nodes"], b["element"], b.get("solver", "-"),
         short(b["cpu_ms_per_step"]), short(b.get("wall_ms_per_step")),
         short(b.get("cg_iterations")), short(b.get("newton_iterations")), short(b["tip"]))
        for b in bench if b["kind"] in ("linearised", "newton")
    ]
    return table(["step", "nodes", "element", "solver", "CPU ms", "wall ms", "CG", "Newton",
                  "tip, m"], rows)


def hard(bench):
    rows = [
        (b["case"], b["nodes"], b["material"], short(b["h"]), b["steps"],
         short(b["energy_growth"]), short(b["displacement"]),
         ("yes" if b["recovered"] else "no") if b["should_recover"] else "under load")
        for b in bench if b["kind"] == "hard"
    ]
    return table(["case", "nodes", "material", "h, s", "steps", "largest energy growth",
                  "distance from rest / size", "recovered"], rows)


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    folder, results, bench = sys.argv[1], read_lines(sys.argv[2]), read_lines(sys.argv[3])
    os.makedirs(folder, exist_ok=True)
    plot_error_against_time(results, os.path.join(folder, "fem_error.png"))
    plot_cost(bench, os.path.join(folder, "fem_cost.png"))
    sections = [
        "# Finite elements: speed against error",
        "Written by `src/calipso_fem/bench/report.py`. CPU milliseconds count both threads; wall "
        "times depend on what else the machine does.",
        "## Same discretisation, same numbers", same_discretisation(results),
        "## Default element against converged references", accuracy(results),
        "![error against time](fem_error.png)",
        "## Time steps of the reference beam", steps(bench),
        "![cost against size](fem_cost.png)",
        "## Hard cases", hard(bench),
    ]
    with open(os.path.join(folder, "fem.md"), "w") as f:
        f.write("\n\n".join(sections) + "\n")


if __name__ == "__main__":
    main()
