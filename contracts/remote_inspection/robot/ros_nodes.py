"""The nodes as rospy runs them: classes that subscribe and publish by themselves (Debian: python3-rospy)."""

import threading
import time

import rospy
import wired

try:
    from gazebo_radiation_plugins.msg import Snapshot
except ImportError:  # the package is not built: its one message is made of its definition
    import genpy.dynamic

    Snapshot = genpy.dynamic.generate_dynamic(wired.TYPE, wired.DEFINITION)[wired.TYPE]


class Bus:
    """The calls of `bus.Bus`, by rospy; every topic is latched, as the plan supposes. `change`: a fault of `faults`."""

    def __init__(self, name, change=None):
        self.change = change
        self.started = time.monotonic() if change is not None else 0.0
        self.lock = threading.Lock()
        self.spoken = {}
        rospy.init_node(name)

    def announce(self, topic):
        self.spoken[topic] = rospy.Publisher(f"/{topic}", Snapshot, queue_size=100, latch=True)

    def hear(self, topic, act):
        def heard(message):
            with self.lock:
                act({field: getattr(message, field) for field in wired.FIELDS[topic]})

        rospy.Subscriber(f"/{topic}", Snapshot, heard, queue_size=100)

    def say(self, topic, message):
        if self.change is not None:
            message = self.change(topic, message, time.monotonic() - self.started)
        if message is not None:
            self.spoken[topic].publish(Snapshot(**message))


class Localisation:
    def __init__(self, params):
        wired.localisation(Bus("localisation"), params)


class Navigation:
    def __init__(self, params):
        wired.navigation(Bus("navigation"), params)


class RadiationSensor:
    def __init__(self, params):
        wired.radiation_sensor(Bus("radiationSensor"), params)
