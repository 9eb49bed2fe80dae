#!/usr/bin/python3
"""Table of the contact cases and, for the two falling cubes, error against time.

usage: contact_report.py OUTPUT_FOLDER RESULTS.jsonl
"""
import json
import os
import sys


def number(value):
    return "failed" if value is None else f"{value:.4g}"


def rows(results):
    yield "| case | quantity | value | reference | relative error | depth / proximity | energy growth | CPU ms per frame |"
    yield "|---|---|---|---|---|---|---|---|"
    for r in results:
        keys = ("value", "reference", "rel_error", "max_penetration_ratio", "energy_growth", "ms_per_frame")
        name = os.path.basename(r["case"].rstrip("/"))
        yield f"| {name} | {r['quantity']} | " + " | ".join(number(r[k]) for k in keys) + " |"


def error_against_time(results):
    yield "| scene and step | deepest penetration, mm | CPU ms per frame |"
    yield "|---|---|---|"
    for r in results:
        if "lowest" not in r["quantity"] or "cube" not in r["quantity"]:
            continue
        depth = "blew up" if r["value"] is None else f"{max(0.0, -r['value']) * 1e3:.3g}"
        yield f"| {r['quantity'].split('lowest ')[-1]} | {depth} | {number(r['ms_per_frame'])} |"


def main():
    output, path = sys.argv[1:]
    with open(path) as file:
        results = [json.loads(line) for line in file]
    with open(os.path.join(output, "contact.md"), "w") as report:
        print("# Contact\n\nProcess CPU time, all threads together.\n\n## Cases\n", file=report)
        print("\n".join(rows(results)), file=report)
        print("\n## Error against time: two soft cubes of 512 nodes fall on a plane and on each other\n", file=report)
        print("\n".join(error_against_time(results)), file=report)


main()
