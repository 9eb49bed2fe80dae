#!/usr/bin/python3
"""The whole graph on live video, launched as a user would."""

import os
import signal
import tempfile
import time
import unittest

import rospy
import rostest
from calipso_msgs.msg import NodeStatus, Segmentation, SimulationState
from sensor_msgs.msg import CameraInfo, Image

import clips
import launching

FIRST = rospy.Time(10)
PERIOD = rospy.Duration(0.2)  # a lap of a few frames goes back by more than jitter


class Live(unittest.TestCase):
    def setUp(self):
        rospy.init_node("live_test")
        self.folder = tempfile.TemporaryDirectory()
        scene = clips.make_scene(self.folder.name, 1)
        bag = clips.make_bag(scene, os.path.join(self.folder.name, "in.bag"))
        self.image = clips.messages(bag, clips.IMAGE_TOPIC)[0]
        self.info = clips.messages(bag, "/camera/camera_info")[0]
        self.senders = [rospy.Publisher("/camera/camera_info", CameraInfo, queue_size=100),
                        rospy.Publisher("/camera/image_raw", Image, queue_size=100)]
        edits = clips.write_edits(self.folder.name, [{"t": 0, "object": "banana3", "kind": "remove"}])
        self.launch = launching.Launch("calipso_launch", "live.launch", os.environ["ROS_MASTER_URI"],
                                       scene=scene, edits=edits, out=os.path.join(self.folder.name, "out.bag"))

    def tearDown(self):
        self.launch.process.send_signal(signal.SIGINT)
        self.launch.process.wait(60)
        self.folder.cleanup()

    def lap(self, done, timeout_sec=120):
        """Shows the same picture, stamped from FIRST on, until done()."""
        end = time.monotonic() + timeout_sec
        stamp = FIRST
        while not done():
            self.assertLess(time.monotonic(), end, "it did not happen in time:\n" + self.launch.printed())
            for sender, message in zip(self.senders, (self.info, self.image)):
                message.header.stamp = stamp
                sender.publish(message)
            stamp += PERIOD
            time.sleep(PERIOD.to_sec())
        return stamp

    def test_video_whose_stamps_go_back_is_edited_anew(self):
        heard = {"segmentation": [], "status": [], "state": [], "image_edited": []}
        types = {"segmentation": Segmentation, "status": NodeStatus, "state": SimulationState, "image_edited": Image}
        subscribers = [rospy.Subscriber("/calipso/" + name, types[name], heard[name].append) for name in heard]

        def removed():
            """Frames that show the video without the banana."""
            without = {s.header.stamp for s in heard["state"] if any(o.removed for o in s.objects)}
            return [i for i in heard["image_edited"] if i.header.stamp in without and i.data != self.image.data]

        first_lap_end = self.lap(removed)
        self.assertGreater(first_lap_end, FIRST + rospy.Duration(1))
        while sum(len(heard[name]) for name in heard) > 0:  # until the last of the first lap has come
            for messages in heard.values():
                messages.clear()
            time.sleep(1.0)
        self.lap(removed)
        for subscriber in subscribers:
            subscriber.unregister()
        started_over = {s.node for s in heard["status"] if s.state == NodeStatus.STARTING}
        self.assertEqual(started_over, {"flow", "simulator", "render"})
        self.assertEqual([s.header.stamp for s in heard["segmentation"] if s.contours], [FIRST])
        self.assertTrue(os.path.exists(os.path.join(self.folder.name, "out.bag")), "complete: the first lap")

    def test_another_cameras_video_passes_and_is_told(self):
        self.info.K = [2 * k for k in self.info.K[:8]] + [1.0]
        statuses, edited = [], []
        subscribers = [rospy.Subscriber("/calipso/status", NodeStatus, statuses.append),
                       rospy.Subscriber("/calipso/image_edited", Image, edited.append)]

        def told():
            return [s.message for s in statuses if s.node == "render" and s.state == NodeStatus.FAILED]

        self.lap(told)
        count = len(edited)
        self.lap(lambda: len(edited) > count)
        for subscriber in subscribers:
            subscriber.unregister()
        self.assertIn("scene.yaml has", told()[0])
        self.assertTrue(all(i.data == self.image.data for i in edited))


if __name__ == "__main__":
    rostest.rosrun("calipso_test", "live", Live)
