"""Short clips for the tests: scenes cut out of the shipped example, and bags made of them."""

import os
import shutil
import subprocess

import rosbag
import rospkg
import yaml

IMAGE_TOPIC = "/camera/image_raw"


def example_folder():
    return os.path.join(rospkg.RosPack().get_path("calipso_launch"), "examples", "bananas")


def make_scene(folder, frames, objects=3):
    """The shipped scene with fewer frames and objects, in `folder`/scene."""
    source, scene = example_folder(), os.path.join(folder, "scene")
    shutil.copytree(source, scene)
    path = os.path.join(scene, "scene.yaml")
    with open(path) as file:
        content = yaml.safe_load(file)
    content["n_frames"] = frames
    content["objects"] = content["objects"][:objects]
    with open(path, "w") as file:
        yaml.safe_dump(content, file)
    return scene


def make_bag(scene, path, *options):
    subprocess.run(["rosrun", "calipso_bag", "scene_to_bag", scene, path, *options], check=True)
    return path


def write_edits(folder, edits):
    path = os.path.join(folder, "edits.yaml")
    with open(path, "w") as file:
        yaml.safe_dump(edits, file)
    return path


def messages(path, topic):
    with rosbag.Bag(path) as bag:
        return [message for _, message, _ in bag.read_messages(topics=[topic])]


def stamps(path, topic):
    return [message.header.stamp for message in messages(path, topic)]


def pixels(path, topic):
    return [bytes(message.data) for message in messages(path, topic)]


def rewrite(source, target, change):
    """Copies a bag; change(topic, message, index of it on its topic) gives the message to write, or None."""
    count = {}
    with rosbag.Bag(source) as old, rosbag.Bag(target, "w") as new:
        for topic, message, time in old.read_messages():
            index = count.get(topic, 0)
            count[topic] = index + 1
            changed = change(topic, message, index)
            if changed is not None:
                new.write(topic, changed, time)
    return target
