#!/usr/bin/env python3
"""Judges what a user gets: the whole graph on scenes with ground truth, of which the nodes see none.

Usage: graph_report.py OUT.md SCENE...

Each scene is made a bag, and a run takes all of its objects out. Its pictures are compared with those of the place
without them (`plates/`). Then shapes, poses and the key frame's masks that the run found take the place of the true
ones in a copy of the scene, and the evaluator of calipso_render judges background, light and look by these.
"""
import json
import os
import subprocess
import sys
import tempfile

import cv2
import numpy
import rosbag
import yaml

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "test"))
import clips  # noqa: E402
import launching  # noqa: E402

SEAM_PX = 3  # what lies this near to the mask belongs to the hole
CHANGE = 8.0  # code values: where the video differs from the place by more, an object darkens or lightens it

HEADER = """# Whole graph

Written by `src/test/bench/run.sh`. Segmentation, alignment and flow find the objects, nothing of the truth is known to
the nodes, and every object is taken out of the video. "hole": PSNR of the edited frames against the true place in the
objects' masks, grown by {seam} px; "shadow": the same elsewhere, where video and true place differ by more than
{change:.0f} code values (means of 5 x 5 px; where there are 100 such pixels); the worst frame counts. "rest": pixels of
all frames elsewhere that the edit changed by more than that, in thousandths. Below: the evaluator's figures
([appearance.md](appearance.md) says what they are) with shapes, poses and masks of the key frame as the graph found
them in place of the true ones. Light, albedo and place are compared with the truth.

"""

RUN = [("hole_db", "hole, dB"), ("shadow_db", "shadow, dB"), ("rest_changed", "rest, thousandths"),
       ("contour_px", "contour error, px, worst object"), ("distrusted", "objects not trusted")]
FOUND = [("plate_psnr_seen_db", "plate, seen, dB"), ("plate_psnr_invented_db", "plate, invented, dB"),
         ("gradient_ratio", "gradient ratio"),
         ("light_error_deg", "light, deg"), ("light_confirmed", "light confirmed"),
         ("albedo_error_percent", "albedo, %"), ("roughness_error_percent", "roughness, %"),
         ("roughness_observed", "a highlight tells the roughness"),
         ("roughness_in_range", "the true one is in the range stated"),
         ("moved_psnr_db", "moved, dB"), ("moved_from_clip_psnr_db", "moved, texture from the clip, dB"),
         ("undeformed_drawn_psnr_db", "unmoved, all drawn, dB"), ("seam_drawn_psnr_db", "seam, all drawn, dB")]


def psnr(difference):
    """dB; none if there is nothing to compare, 99 at most."""
    if difference.size == 0:
        return None
    square = float(numpy.mean(numpy.square(difference, dtype=numpy.float64)))
    return min(99.0, 10.0 * numpy.log10(255.0 ** 2 / max(square, 1e-9)))


def picture(folder, kind, k):
    """Frame k of a kind, or the one picture of what rests; none if there is none."""
    paths = [os.path.join(folder, kind + "%06d" % number + end) for number in (k, 0) for end in (".png", ".jpg")]
    return next((cv2.imread(path) for path in paths if os.path.exists(path)), None)


def matrix(pose):
    """4 x 4, of a geometry_msgs/Pose."""
    x, y, z, w = (getattr(pose.orientation, axis) for axis in "xyzw")
    m = numpy.eye(4)
    m[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                 [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                 [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    m[:3, 3] = [pose.position.x, pose.position.y, pose.position.z]
    return m


def pixels(message):
    channels = {"bgr8": 3, "rgb8": 3, "mono8": 1}[message.encoding]
    rows = numpy.frombuffer(message.data, numpy.uint8).reshape(message.height, message.step)
    image = rows[:, :channels * message.width].reshape(message.height, message.width, channels)
    return image[:, :, ::-1] if message.encoding == "rgb8" else image


def run_graph(scene, names, work):
    """The recorded bag of a run that takes all objects out at once."""
    source = clips.make_bag(scene, os.path.join(work, "in.bag"))
    edits = clips.write_edits(work, [{"t": 0.0, "object": name, "kind": "remove"} for name in names])
    out = os.path.join(work, "out.bag")
    status, printed = launching.run("calipso_launch", "edit.launch", timeout_sec=600, bag=source, scene=scene,
                                    edits=edits, out=out, record_flow="false")
    if status != 0:
        raise RuntimeError("%s: the run ended with %d:\n%s" % (scene, status, printed[-3000:]))
    return out


def judge_pictures(folder, names, bag):
    """The edited frames against the place without the objects."""
    holes, shadows, changed, rest = [], [], 0, 0
    for k, (_, message, _) in enumerate(bag.read_messages(topics=["/calipso/image_edited"])):
        plate = picture(folder, "plates/", k)
        if plate is None:
            return {}
        edited = pixels(message).astype(numpy.float32)
        video = picture(folder, "frames/", k).astype(numpy.float32)
        mask = numpy.zeros(plate.shape[:2], numpy.uint8)
        for name in names:
            mask |= picture(folder, "masks/%s_" % name, k)[:, :, 0]
        hole = cv2.dilate(mask, numpy.ones((2 * SEAM_PX + 1, 2 * SEAM_PX + 1), numpy.uint8)) > 127
        # Means of 5 x 5 pixels: noise alone makes no shadow.
        shaded = (numpy.abs(cv2.blur(video - plate, (5, 5))).max(axis=2) > CHANGE) & ~hole
        kept = ~hole & ~shaded
        changed += numpy.count_nonzero(numpy.abs(edited - video).max(axis=2)[kept] > CHANGE)
        rest += numpy.count_nonzero(kept)
        holes.append(psnr((edited - plate)[hole]))
        if numpy.count_nonzero(shaded) >= 100:
            shadows.append(psnr((edited - plate)[shaded]))
    return {"hole_db": min(holes), "shadow_db": min(shadows, default=None), "rest_changed": 1000.0 * changed / rest}


def write_mesh(path, mesh):
    vertices = numpy.array(mesh.vertices).reshape(-1, 3)
    triangles = numpy.array(mesh.triangles).reshape(-1, 3) + 1
    with open(path, "w", encoding="utf-8") as file:
        file.writelines("v %.9g %.9g %.9g\n" % tuple(vertex) for vertex in vertices)
        file.writelines("f %d %d %d\n" % tuple(triangle) for triangle in triangles)


def write_found(folder, description, bag, found):
    """A copy of the scene in which what the run found is called true. Of what deforms the true motion stays."""
    topics = {"/calipso/models": None, "/calipso/clip/dynamics": None, "/calipso/segmentation": None}
    for topic, message, _ in bag.read_messages(topics=list(topics)):
        topics[topic] = topics[topic] or message  # of the segmentations the key frame's
    models, dynamics, segmentation = topics.values()
    for entry in os.listdir(folder):
        if entry not in ("scene.yaml", "masks"):
            os.symlink(os.path.join(folder, entry), os.path.join(found, entry))
    for inner in ("masks", "found"):
        os.mkdir(os.path.join(found, inner))
    for entry in os.listdir(os.path.join(folder, "masks")):
        os.symlink(os.path.join(folder, "masks", entry), os.path.join(found, "masks", entry))
    aligned = {model.object: model for model in models.models}
    for thing in description["objects"]:
        model = aligned[thing["name"]]
        mask = os.path.join(found, "masks", thing["name"] + "_000000.png")
        os.remove(mask)
        cv2.imwrite(mask, numpy.where(pixels(segmentation.labels) == thing["index"], 255, 0).astype(numpy.uint8))
        if "true_vertices_per_frame" in thing:
            continue
        thing["true_mesh"] = "found/%s.obj" % thing["name"]
        write_mesh(os.path.join(found, thing["true_mesh"]), model.mesh)
        poses = [model.world_from_object.pose]
        if len(thing["world_T_object"]) > 1 and dynamics is not None:
            poses = [motion.world_from_object for frame in dynamics.frames for motion in frame.objects
                     if motion.object == thing["name"]]
        thing["world_T_object"] = [matrix(pose).tolist() for pose in poses]
    with open(os.path.join(found, "scene.yaml"), "w", encoding="utf-8") as file:
        yaml.safe_dump(description, file)
    return {"contour_px": max(model.contour_mean_px for model in models.models),
            "distrusted": sum(not model.trusted for model in models.models)}


def judge(folder):
    with open(os.path.join(folder, "scene.yaml"), encoding="utf-8") as file:
        description = yaml.safe_load(file)
    names = [thing["name"] for thing in description["objects"]]
    with tempfile.TemporaryDirectory() as work:
        found = os.path.join(work, os.path.basename(folder))
        os.mkdir(found)
        with rosbag.Bag(run_graph(folder, names, work)) as bag:
            figures = judge_pictures(folder, names, bag)
            figures.update(write_found(folder, description, bag, found))
        evaluate = ["rosrun", "calipso_render", "evaluate", found]
        figures.update(json.loads(subprocess.run(evaluate, stdout=subprocess.PIPE, check=True).stdout))
    return figures


def cell(value):
    return "-" if value is None else "%.4g" % value


def table(cases, columns):
    lines = ["| | " + " | ".join(case["case"] for case in cases) + " |", "|---|" + "---|" * len(cases)]
    lines += ["| %s | " % title + " | ".join(cell(case.get(key)) for case in cases) + " |" for key, title in columns]
    return "\n".join(lines) + "\n\n"


def has_truth(folder):
    return os.path.isdir(os.path.join(folder, "masks"))


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    folders = [os.path.abspath(folder) for folder in sys.argv[2:]]
    for folder in folders:
        if not has_truth(folder):
            print("%s has no ground truth: left out" % folder)
    cases = [judge(folder) for folder in folders if has_truth(folder)]
    with open(sys.argv[1], "w", encoding="utf-8") as page:
        page.write(HEADER.format(seam=SEAM_PX, change=CHANGE))
        page.write("## Objects taken out\n" + table(cases, RUN) + "## Look, by what was found\n" + table(cases, FOUND)
                   if cases else "No scene with ground truth was given (`make bench SCENES=...`).\n")


if __name__ == "__main__":
    main()
