#!/usr/bin/python3
"""What the player cannot play: one message that names what, the value and the remedy; exit status 1."""

import os
import shutil
import subprocess
import tempfile
import unittest

import cv2
import numpy
import rosparam
import rostest
import yaml

import clips
import launching

IMAGE, INFO = clips.IMAGE_TOPIC, "/camera/camera_info"


class BadInput(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.scene = clips.make_scene(cls.folder.name, 4)
        cls.bag = clips.make_bag(cls.scene, os.path.join(cls.folder.name, "in.bag"))

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def expect_complaint(self, *parts, **parameters):
        parameters = dict({"bag": self.bag, "scene": self.scene, "edits": "none"}, **parameters)
        words = ["_%s:=%s" % (name, value) for name, value in parameters.items()]
        result = subprocess.run(["rosrun", "calipso_bag", "player_node", *words], text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60)
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertEqual(result.stdout.count("FATAL"), 1, result.stdout)
        for part in parts:
            self.assertIn(part, result.stdout)

    def spoilt(self, change):
        return clips.rewrite(self.bag, self.path("spoilt.bag"), change)

    def edits(self, *edits):
        return clips.write_edits(self.folder.name, list(edits))

    def test_bag_without_images(self):
        bag = self.spoilt(lambda topic, message, _: None if topic == IMAGE else message)
        self.expect_complaint("spoilt.bag: no images", "sensor_msgs/Image", bag=bag)

    def test_bag_without_camera_info(self):
        bag = self.spoilt(lambda topic, message, _: None if topic == INFO else message)
        self.expect_complaint("no camera_info for " + IMAGE, "video_to_bag", bag=bag)

    def test_images_of_two_sizes(self):
        def change(topic, message, index):
            if topic == IMAGE and index == 2:
                message.height -= 10
            return message
        self.expect_complaint("image 2", "640x350", "640x360", bag=self.spoilt(change))

    def test_unknown_encoding(self):
        def change(topic, message, index):
            if topic == IMAGE:
                message.encoding = "yuv_planar"
            return message
        self.expect_complaint("image 0", "'yuv_planar'", "bgr8", bag=self.spoilt(change))

    def test_truncated_bag(self):
        bag = self.path("truncated.bag")
        with open(self.bag, "rb") as file, open(bag, "wb") as target:
            target.write(file.read()[:1000000])
        self.expect_complaint("truncated.bag", "rosbag reindex", bag=bag)

    def test_parameter_of_another_type(self):
        try:
            self.expect_complaint("/player/in_flight", "another type", in_flight="many")
        finally:
            rosparam.delete_param("/player/in_flight")  # the test's master keeps it

    def edit_with(self, parameters, timeout_sec):
        """(exit status, everything printed) of a run with these parameters, as YAML."""
        params = self.path("params.yaml")
        with open(params, "w") as file:
            file.write(parameters)
        return launching.Launch("calipso_launch", "edit.launch", os.environ["ROS_MASTER_URI"], bag=self.bag,
                                scene=self.scene, out=self.path("out.bag"), params=params).wait(timeout_sec)

    def test_renderer_that_cannot_start_ends_the_run_at_once(self):
        status, printed = self.edit_with("render: {add_noise: loud}", 45)
        self.assertNotEqual(status, 0, printed)
        self.assertIn("nobody draws the frames, render has failed: parameter /calipso/render/add_noise", printed)

    def test_frames_pass_a_simulator_that_cannot_start(self):
        status, printed = self.edit_with("simulator: {max_nodes: few}", 120)
        self.assertEqual(status, 0, printed)
        self.assertIn("frames: 4 in, 4 out", printed)
        self.assertIn("simulator failed: parameter /calipso/simulator/max_nodes is few", printed)

    def test_a_master_that_runs_on_keeps_nothing_of_another_run(self):
        rosparam.set_param("/calipso/simulator/max_nodes", "few")
        status, printed = self.edit_with("{}", 120)
        self.assertEqual(status, 0, printed)
        self.assertNotIn("simulator failed", printed)

    def test_missing_bag(self):
        self.expect_complaint("absent.bag", bag=self.path("absent.bag"))

    def spoilt_scene(self, picture, size, deep):
        """The scene with one of its pictures made anew."""
        scene = os.path.join(tempfile.mkdtemp(dir=self.folder.name), "scene")
        shutil.copytree(self.scene, scene)
        cv2.imwrite(os.path.join(scene, picture), numpy.ones(size[::-1], numpy.uint16 if deep else numpy.uint8))
        return scene

    def expect_of_tool(self, tool, *words, says):
        result = subprocess.run(["rosrun", "calipso_bag", tool, *words], text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60)
        self.assertEqual(result.returncode, 1, result.stdout)
        for part in says:
            self.assertIn(part, result.stdout)
        self.assertEqual(result.stdout.count("\n"), 1, result.stdout)

    def test_what_the_tools_cannot_read_or_write(self):
        video, picture = self.path("out.mp4"), self.path("out.png")
        self.expect_of_tool("bag_to_video", self.path("absent.bag"), IMAGE, video, says=["absent.bag", "check the path"])
        self.expect_of_tool("bag_to_video", self.bag, INFO, video, says=["in.bag", INFO, "topic of pictures"])
        self.expect_of_tool("bag_to_video", self.bag, IMAGE, video, "--fps", "0", says=["--fps 0", "above 0"])
        compared = ("compare_bags", self.bag, IMAGE)
        self.expect_of_tool(*compared, self.bag, IMAGE, self.path("out.pong"), says=["out.pong", ".png"])

        def upper_half(topic, message, _):
            if topic == IMAGE:
                message.height //= 2
                message.data = message.data[:message.height * message.step]
            return message
        self.expect_of_tool(*compared, self.spoilt(upper_half), IMAGE, picture, says=["640x360", "640x180"])

    def test_strokes_of_another_size(self):
        self.expect_complaint("strokes.png", "1280x720", "640x360", scene=self.spoilt_scene("strokes.png", (1280, 720), False))

    def test_strokes_of_an_object_that_is_not_listed(self):
        scene = clips.make_scene(tempfile.mkdtemp(dir=self.folder.name), 4, objects=1)
        self.expect_complaint("strokes.png", "value 2", "(1)", scene=scene)

    def test_depth_of_another_size_or_kind(self):
        self.expect_complaint("depth/000000.png", "320x180", "640x360",
                              scene=self.spoilt_scene("depth/000000.png", (320, 180), True))
        self.expect_complaint("depth/000000.png", "of 8 bits", "of 16",
                              scene=self.spoilt_scene("depth/000000.png", (640, 360), False))

    def test_edit_of_an_unknown_object(self):
        edits = self.edits({"t": 0, "object": "pear", "kind": "remove"})
        self.expect_complaint("edits.yaml", "pear", "banana1", edits=edits)

    def test_edit_that_is_not_a_number(self):
        edits = self.edits({"t": 0, "object": "banana1", "kind": "pull",
                            "vector": [0, 0, float("nan")]})
        self.expect_complaint("edits.yaml", "vector", "nan", edits=edits)

    def test_edit_out_of_range(self):
        edits = self.edits({"t": 0, "object": "banana1", "kind": "material", "poissons_ratio": 0.7})
        self.expect_complaint("edits.yaml", "poissons_ratio", "0.7", edits=edits)

    def test_model_to_insert_that_is_not_there(self):
        edits = self.edits({"t": 0, "kind": "insert", "value": "ball", "model": "cad/ball.obj",
                            "translation": [0, 0, 0.3]})
        self.expect_complaint("cad/ball.obj", "cannot be opened", edits=edits)

    def test_edit_before_the_first_frame(self):
        edits = self.edits({"t": -0.5, "object": "banana1", "kind": "remove"})
        self.expect_complaint("edits.yaml", "-0.5", ">= 0 s", edits=edits)

    def test_missing_and_broken_mesh(self):
        with tempfile.TemporaryDirectory() as folder:
            scene = clips.make_scene(folder, 4)
            mesh = os.path.join(scene, "cad", "banana1.obj")
            with open(mesh, "w") as file:
                file.write("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
            self.expect_complaint("banana1.obj", "9", scene=scene)
            os.remove(mesh)
            self.expect_complaint("banana1.obj", scene=scene)

    def test_scene_of_another_video(self):
        with tempfile.TemporaryDirectory() as folder:
            scene = clips.make_scene(folder, 4)
            path = os.path.join(scene, "scene.yaml")
            with open(path) as file:
                content = yaml.safe_load(file)
            content["width"] = 600
            with open(path, "w") as file:
                yaml.safe_dump(content, file)
            self.expect_complaint("640x360", "600x360", scene=scene)

    def test_tf_that_does_not_lead_to_the_camera(self):
        def change(topic, message, _):
            if topic == "/tf":
                message.transforms[0].header.frame_id = "odom"
            return message
        self.expect_complaint("'map'", "poses:=scene", bag=self.spoilt(change))


if __name__ == "__main__":
    rostest.rosrun("calipso_test", "bad_input", BadInput)
