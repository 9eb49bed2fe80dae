#!/usr/bin/env python3
"""Writes the report page of calipso_render from what its evaluator and its benchmark printed.

Usage: report.py OUT.md EVALUATE.jsonl ENLARGED.jsonl BENCHMARK.jsonl
"""
import json
import os
import sys

COLUMNS = [
    ("plate_psnr_seen_db", "plate, seen, dB"), ("plate_psnr_invented_db", "plate, invented, dB"),
    ("gradient_ratio", "gradient ratio"), ("flicker_ratio", "flicker ratio"),
    ("light_error_deg", "light, deg"), ("albedo_error_percent", "albedo, %"),
    ("roughness_error_percent", "roughness, %"), ("roughness_observed", "a highlight tells the roughness"),
    ("roughness_range", "roughnesses it leaves, highest / lowest"), ("roughness_in_range", "the true one is among them"), ("second_order_ambient", "ambient light of second order"),
    ("undeformed_psnr_db", "unmoved, dB"),
    ("seam_psnr_db", "unmoved seam, dB"), ("undeformed_drawn_psnr_db", "unmoved, all drawn, dB"),
    ("seam_drawn_psnr_db", "seam, all drawn, dB"), ("undeformed_plain_psnr_db", "unmoved, drawn plainly, dB"),
    ("moved_psnr_db", "moved, dB"), ("moved_seam_psnr_db", "moved seam, dB"),
    ("moved_from_clip_psnr_db", "moved, texture from the clip, dB"),
    ("moved_seam_from_clip_psnr_db", "moved seam, texture from the clip, dB"),
    ("shadow_psnr_db", "around moved, dB"), ("moved_copied_psnr_db", "moved, not relit, dB"),
    ("relighting_gain_db", "gain over copying, dB"), ("relighting_gain_turned_db", "the same where turned by 10 degrees or more, dB"),
    ("ms_prepare", "prepare, ms"),
    ("ms_prepare_background", "of it the background, ms"), ("ms_prepare_appearance", "light and texture, ms"),
    ("ms_inpaint", "filling the hole, ms"), ("ms_frame_live", "live, ms"), ("ms_frame_final", "final, ms"),
]

HEADER = """# Appearance

Written by `src/calipso_render/bench/run.sh`. The true shape, pose and masks stand in for alignment and
segmentation. "moved": later frames drawn again from the key frame's appearance with the true motion; the worst
frame counts; "texture from the clip": further frames add what the key frame does not show, and frames between those are
judged. 1: yes, 0: no. "all drawn": no pixel of the frame is kept, what drawing misses goes along as a residual; "drawn
plainly": without that, by texture and light alone. "live" and "final": every object lifted, so that all of it is drawn,
shaded and replaced. Times are wall times of the machine while it ran, of frames the best of five, of preparation one.

"""

# What is left out of a scene's enlarged figures: pictures that are enlarged say no more of these.
OF_FULL_SIZE = {"roughness_observed", "roughness_range", "roughness_in_range", "second_order_ambient", "undeformed_psnr_db",
                "seam_psnr_db", "seam_drawn_psnr_db", "moved_copied_psnr_db", "relighting_gain_db",
                "relighting_gain_turned_db"}

ENLARGED = """
## Twice as large
The same scenes enlarged, 640 x 360 to 1280 x 720, with all that is known of them: what larger pictures take, and whether
lengths in pixels are right for these, too. Enlarged pictures are softer than a camera's.

"""

DRAWING = """
## Drawing
One object of {triangles} triangles that covers {percent:.0f} % of 1280 x 720, every vertex new in every frame, over a table that
takes its shadow (the light is given): what was there is taken out, the object drawn, shaded, put in with noise. llvmpipe: Mesa's
rasteriser draws and shades the same mesh alone, without shadow, edges not smoothed. mesh_alone: the same by the stages that
draw a frame's surfaces, with reflectance from the picture. CPU: of all threads.

| | wall, best, ms | CPU, best, ms | CPU, median, ms |
|---|---|---|---|
"""

FILLING = """
## Filling
The objects' masks, grown by 3 px, filled in the key frame. Inside the masks, against the true place: PSNR, dB /
gradient energy ratio / CPU, ms.

"""


def cell(value):
    return "-" if value is None else f"{value:.4g}"


def read(path):
    with open(path, encoding="utf-8") as lines:
        return [json.loads(line) for line in lines if line.strip()]


def evaluation(cases, columns=None):
    if not cases:
        return "No scene with ground truth was given (`make bench SCENES=...`).\n"
    text = "| | " + " | ".join(case["case"] for case in cases) + " |\n"
    text += "|---|" + "---|" * len(cases) + "\n"
    for key, title in columns or COLUMNS:
        text += f"| {title} | " + " | ".join(cell(case.get(key)) for case in cases) + " |\n"
    return text


def pictures(cases, page):
    """What the evaluator drew of each case beside the page."""
    folder = os.path.dirname(os.path.abspath(page))

    def shown(suffix, alt):
        paths = [(case["case"], os.path.join("appearance", case["case"] + suffix + ".jpg")) for case in cases]
        return "".join(f"![{name}: {alt}]({path})\n\n" for name, path in paths
                       if os.path.exists(os.path.join(folder, path)))

    lifted = shown("", "video, without its objects, objects lifted")
    around = shown("_around", "turned in its place")
    return (lifted and "\n## Pictures\nThe video; without its objects; its objects lifted (final quality).\n\n" + lifted) + (
        around and "\n## All around\nThe largest object of each scene turned in its place by eighths about the vertical, but "
        "for those too large: most of it no camera has seen.\n\n" + around)


def drawing(cases):
    if not cases:
        return ""
    text = DRAWING.format(triangles=cases[0]["triangles"], percent=100 * cases[0]["coverage"])
    for case in cases:
        name = case["case"].replace("drawing_", "")
        text += f"| {name} | {case['wall_ms']:.1f} | {case['cpu_ms']:.1f} | {case['cpu_median_ms']:.1f} |\n"
    own, peer = ([case for case in cases if case["case"] == name]
                 for name in ("drawing_mesh_alone", "drawing_llvmpipe"))
    if own and peer:
        text += (f"\nThe mesh alone takes {own[0]['wall_ms'] / peer[0]['wall_ms']:.2f} of llvmpipe's wall time, "
                 f"{own[0]['cpu_median_ms'] / peer[0]['cpu_median_ms']:.2f} of its CPU (medians).\n")
    return text


def filling(cases):
    if not cases:
        return ""
    methods = list(dict.fromkeys(case["method"] for case in cases))
    text = FILLING + "| scene (hole) | " + " | ".join(methods) + " |\n|---|" + "---|" * len(methods) + "\n"
    for scene in dict.fromkeys(case["scene"] for case in cases):
        own = {case["method"]: case for case in cases if case["scene"] == scene}
        hole = next(iter(own.values()))["hole"]
        row = [" / ".join((cell(own[m]["psnr_db"]), cell(own[m]["gradient_ratio"]), f"{own[m]['cpu_ms']:.0f}")) for m in methods]
        text += f"| {os.path.basename(scene.rstrip('/'))} ({100 * hole:.0f} %) | " + " | ".join(row) + " |\n"
    return text


def main():
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    enlarged, benchmark = read(sys.argv[3]), read(sys.argv[4])
    with open(sys.argv[1], "w", encoding="utf-8") as page:
        cases = read(sys.argv[2])
        page.write(HEADER + evaluation(cases) + pictures(cases, sys.argv[1]))
        if enlarged:
            page.write(ENLARGED + evaluation(enlarged, [c for c in COLUMNS if c[0] not in OF_FULL_SIZE]))
        page.write(drawing([case for case in benchmark if case["case"].startswith("drawing_")]))
        page.write(filling([case for case in benchmark if case["case"] == "filling"]))


if __name__ == "__main__":
    main()
