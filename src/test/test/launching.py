"""Runs roslaunch as a user would."""

import os
import pathlib
import random
import signal
import socket
import subprocess
import tempfile


def free_port():
    """For a master: below those that the system gives to whoever asks for any, roslaunch before its master among them."""
    while True:
        port = random.randint(12000, 30000)
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) != 0:
                return port


class Launch:
    """A launch file under way, by default with a ROS master of its own.

    Bounded in time: a launch that hangs is ended and fails the test.
    """

    def __init__(self, package, file, master=None, **arguments):
        self.master = master = master or "http://127.0.0.1:%d" % free_port()
        words = ["%s:=%s" % (name, value) for name, value in arguments.items()]
        environment = dict(os.environ, ROS_MASTER_URI=master, ROS_IP="127.0.0.1")
        # A file, not a pipe: nodes that outlive roslaunch would keep a pipe open.
        self.output = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen(
            ["roslaunch", package, file, *words], env=environment, text=True,
            stdout=self.output, stderr=subprocess.STDOUT)

    def wait(self, timeout_sec=240):
        """(exit status, everything it printed)."""
        try:
            self.process.wait(timeout_sec)
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGINT)  # roslaunch then ends its nodes
            self.process.wait(60)
            raise AssertionError("no end within %d s:\n%s" % (timeout_sec, self.printed()))
        return self.process.returncode, self.printed()

    def nodes(self, name):
        """Processes of the launch's nodes of this name, also after roslaunch itself has ended."""
        found = []
        for process in pathlib.Path("/proc").iterdir():
            try:
                words = (process / "cmdline").read_bytes().split(b"\0")
                environment = (process / "environ").read_bytes().split(b"\0")
            except OSError:  # no process, or one that has just ended
                continue
            if b"__name:=" + name.encode() in words and b"ROS_MASTER_URI=" + self.master.encode() in environment:
                found.append(int(process.name))
        return found

    def printed(self):
        self.output.seek(0)
        return self.output.read()


def runs(process):
    """False as well of one that has ended and whose status nobody has asked for."""
    try:
        stat = pathlib.Path("/proc/%d/stat" % process).read_text()
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def run(package, file, timeout_sec=240, **arguments):
    return Launch(package, file, **arguments).wait(timeout_sec)
