#!/usr/bin/python3
"""Player and recorder with an echo between them: what goes in comes out, or the run fails."""

import os
import subprocess
import tempfile
import time
import unittest

import rosbag
import rostest

import clips
import launching

FRAMES = 6
EDITED = "/calipso/image_edited"


class PlayerAndRecorder(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.said = open(self.path("said"), "w")
        self.scene = clips.make_scene(self.folder.name, FRAMES)
        self.bag = clips.make_bag(self.scene, self.path("in.bag"))

    def tearDown(self):
        self.said.close()
        self.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def echo(self, **arguments):
        arguments.setdefault("bag", self.bag)
        return launching.run("calipso_test", "echo.launch", scene=self.scene,
                             out=self.path("out.bag"), **arguments)

    def test_every_frame_comes_out_as_it_went_in(self):
        status, output = self.echo()
        self.assertEqual(status, 0, output)
        self.assertIn("frames: %d in, %d out" % (FRAMES, FRAMES), output)
        out = self.path("out.bag")
        self.assertEqual(clips.stamps(out, EDITED), clips.stamps(self.bag, clips.IMAGE_TOPIC))
        self.assertEqual(clips.pixels(out, EDITED), clips.pixels(self.bag, clips.IMAGE_TOPIC))
        self.assertFalse(os.path.exists(out + ".active"))

    def test_the_bag_holds_what_explains_the_images(self):
        edits = clips.write_edits(self.folder.name, [{"t": 0.1, "object": "banana1", "kind": "remove"}])
        status, output = self.echo(edits=edits)
        self.assertEqual(status, 0, output)
        with rosbag.Bag(self.path("out.bag")) as bag:
            counts = {topic: info.message_count
                      for topic, info in bag.get_type_and_topic_info().topics.items()}
            for topic in ("image_edited", "image_edited/camera_info", "provenance", "state", "dynamics"):
                self.assertEqual(counts.get("/calipso/" + topic), FRAMES, topic)
            self.assertEqual(counts.get("/tf"), FRAMES)
            self.assertEqual(counts.get("/calipso/edits/applied"), 1)
            for topic, message, time in bag.read_messages(topics=[EDITED, "/calipso/state"]):
                self.assertEqual(time, message.header.stamp, topic)

    def test_compressed_images_go_in_too(self):
        bag = clips.make_bag(self.scene, self.path("compressed.bag"), "--compressed")
        status, output = self.echo(bag=bag)
        self.assertEqual(status, 0, output)
        images = clips.messages(self.path("out.bag"), EDITED)
        self.assertEqual([image.encoding for image in images], ["bgr8"] * FRAMES)
        self.assertEqual([image.header.stamp for image in images],
                         clips.stamps(bag, clips.IMAGE_TOPIC + "/compressed"))

    def test_a_lost_frame_fails_the_run_and_leaves_no_bag(self):
        status, output = self.echo(swallow=2)
        self.assertNotEqual(status, 0)
        self.assertIn("a frame was lost", output)
        self.assertFalse(os.path.exists(self.path("out.bag")))

    def test_a_node_that_comes_back_in_mid_run_is_refused(self):
        player = subprocess.Popen(
            ["rosrun", "calipso_bag", "player_node", "_bag:=" + self.bag, "_scene:=" + self.scene],
            env=dict(os.environ, ROSCONSOLE_STDOUT_LINE_BUFFERED="1"), stdout=self.said, stderr=subprocess.STDOUT)
        nodes = [self.stand_in()]
        try:
            self.wait_for("flow: here")
            nodes[0].kill()
            self.wait_for("flow: its process ended")
            nodes.append(self.stand_in())
            self.wait_for("flow: started again in mid-run")
        finally:
            for process in nodes + [player]:
                process.kill()
                process.wait()

    def stand_in(self):
        """A node that reports as the flow does, and hears what the player sends."""
        return subprocess.Popen(["python3", "-c", """
import rospy
from calipso_msgs.msg import ClipInfo, NodeStatus
from std_msgs.msg import Header
rospy.init_node("stand_in")
clip = rospy.Subscriber("clip/info", ClipInfo, print)
while not clip.get_num_connections() and not rospy.is_shutdown():
    rospy.sleep(0.05)  # the player notices its end by this connection
status = rospy.Publisher("status", NodeStatus, latch=True, queue_size=1)
while not rospy.is_shutdown():
    status.publish(header=Header(stamp=rospy.Time.now()), node="flow", message="here")
    rospy.sleep(0.1)
"""])

    def wait_for(self, words, printed=None, timeout_sec=60):
        """Until they have been said, by default by the player that runs alone."""
        printed = printed or self.printed
        end = time.monotonic() + timeout_sec
        while words not in printed():
            self.assertLess(time.monotonic(), end, "not said: %s\n%s" % (words, printed()))
            time.sleep(0.05)

    def printed(self):
        with open(self.path("said")) as file:
            return file.read()

    def test_an_image_that_gets_lost_on_the_way_to_the_recorder_is_not_waited_for_for_ever(self):
        status, output = self.echo(lose_image=1)
        self.assertNotEqual(status, 0)
        self.assertIn("1 of %d edited images" % FRAMES, output)
        self.assertFalse(os.path.exists(self.path("out.bag")))

    def test_frames_wait_for_a_recorder_that_does_not_take_them_in(self):
        status, output = self.echo(lose_image=0, in_flight=1, frame_timeout_sec=3)
        self.assertNotEqual(status, 0)
        self.assertIn("the recorder has taken in 0 of 1 edited frames", output)
        self.assertFalse(os.path.exists(self.path("out.bag")))

    def test_a_last_frame_that_never_comes_is_not_waited_for_for_ever(self):
        out = self.path("out.bag")
        launch = launching.Launch("calipso_test", "echo.launch", bag=self.bag, scene=self.scene, out=out,
                                  swallow=FRAMES - 1, frame_timeout_sec=3)
        status, output = launch.wait()
        self.assertNotEqual(status, 0)
        self.assertIn("no edited frame for 3", output)
        self.assertFalse(os.path.exists(out))
        # The recorder is interrupted, as by the user, and closes what it has.
        self.wait_for("with %d edited frames, as %s.active" % (FRAMES - 1, out), launch.printed)
        self.assertEqual(len(clips.messages(out + ".active", EDITED)), FRAMES - 1)

    def test_a_node_that_does_not_hear_is_ended_with_the_run(self):
        launch = launching.Launch("calipso_test", "echo.launch", bag=self.bag, scene=self.scene,
                                  out=self.path("out.bag"), swallow=FRAMES - 1, frame_timeout_sec=3, deaf=True)
        self.wait_for("edited frame for 3", launch.printed)
        self.wait_for_end_of(launch.nodes("echo"))

    def wait_for_end_of(self, processes, timeout_sec=60):
        self.assertTrue(processes)
        end = time.monotonic() + timeout_sec
        while any(launching.runs(process) for process in processes):
            self.assertLess(time.monotonic(), end, "still there: %s" % processes)
            time.sleep(0.05)

    def test_a_dead_node_fails_the_run(self):
        status, output = self.echo(die_at=3)
        self.assertNotEqual(status, 0)
        self.assertRegex(output, "process ended|no edited frame for")
        self.assertFalse(os.path.exists(self.path("out.bag")))

    def test_the_scene_gives_the_poses_that_the_bag_lacks(self):
        bag = clips.rewrite(self.bag, self.path("no_tf.bag"),
                            lambda topic, message, _: None if topic == "/tf" else message)
        status, output = self.echo(bag=bag)
        self.assertEqual(status, 0, output)
        self.assertIn("the bag has no tf", output)
        self.assertEqual(len(clips.messages(self.path("out.bag"), "/tf")), FRAMES)


if __name__ == "__main__":
    rostest.rosrun("calipso_test", "player_and_recorder", PlayerAndRecorder)
