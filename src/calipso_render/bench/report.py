#!/usr/bin/env python3
"""Runs the evaluator over scene folders and writes the report page with its figures.

Usage: report.py EVALUATE OUT.md SCENE_DIR...   (EVALUATE: path of the evaluate program)
"""
import json
import subprocess
import sys

COLUMNS = [
    ("plate_psnr_seen_db", "plate, seen, dB"), ("plate_psnr_invented_db", "plate, invented, dB"),
    ("gradient_ratio", "gradient ratio"), ("flicker_ratio", "flicker ratio"),
    ("light_error_deg", "light, deg"), ("albedo_error_percent", "albedo, %"),
    ("roughness_error_percent", "roughness, %"), ("undeformed_psnr_db", "unmoved, dB"),
    ("seam_psnr_db", "unmoved seam, dB"), ("undeformed_drawn_psnr_db", "unmoved, all drawn, dB"),
    ("seam_drawn_psnr_db", "seam, all drawn, dB"), ("moved_psnr_db", "moved, dB"),
    ("moved_from_clip_psnr_db", "moved, texture from the clip, dB"),
    ("shadow_psnr_db", "around moved, dB"), ("moved_copied_psnr_db", "moved, not relit, dB"),
    ("ms_prepare", "prepare, ms"), ("ms_frame_live", "live, ms"), ("ms_frame_final", "final, ms"),
]

HEADER = """# Appearance

Written by `src/calipso_render/bench/report.py`. The true shape, pose and masks stand in for alignment and
segmentation. "moved": later frames drawn again from the key frame's appearance with the true motion; the worst
frame counts; "texture from the clip": further frames add what the key frame does not show, and frames between those are
judged. "all drawn": no pixel of the frame is kept, what drawing misses goes along as a residual. "live" and "final": every object lifted, so that all of
it is drawn, shaded and replaced. Times are wall times of the machine while it ran, best of five.

"""


def cell(value):
    return "-" if value is None else f"{value:.4g}"


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    evaluate, out, scenes = sys.argv[1], sys.argv[2], sys.argv[3:]
    run = subprocess.run([evaluate] + scenes, stdout=subprocess.PIPE, text=True, check=False)
    cases = [json.loads(line) for line in run.stdout.splitlines()]
    with open(out, "w", encoding="utf-8") as page:
        page.write(HEADER)
        page.write("| | " + " | ".join(case["case"] for case in cases) + " |\n")
        page.write("|---|" + "---|" * len(cases) + "\n")
        for key, title in COLUMNS:
            page.write(f"| {title} | " + " | ".join(cell(case[key]) for case in cases) + " |\n")
    sys.exit(run.returncode)


if __name__ == "__main__":
    main()
