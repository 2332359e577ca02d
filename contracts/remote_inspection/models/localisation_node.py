#!/usr/bin/env python
"""The localisation node: passes AMCL's estimate on as the one position of the robot.

Subscribes to amcl_pose (geometry_msgs/PoseWithCovarianceStamped) and odometry/filtered (nav_msgs/Odometry); publishes
position (geometry_msgs/PointStamped, latched), one message a cycle.

AMCL resamples its particles whenever a scan comes in, so its estimate trembles while the robot stands. The contract
wants one position, so an estimate is held until the wheels have turned or AMCL has moved by more than noise can.
"""

import math
import threading

RATE = 10.0  # Hz
STILL = 0.005  # m/s: slower than this counts as standing
JUMP = 0.10  # m: an estimate this far off is a correction, not noise


class Estimate:
    """The one position. Pure: no ROS here, so that it can be read and tested alone."""

    def __init__(self):
        self._lock = threading.Lock()
        self._position = None
        self._speed = 0.0

    def odometry(self, speed):
        with self._lock:
            self._speed = abs(speed) if math.isfinite(speed) else self._speed

    def pose(self, x, y):
        """Take an estimate over, unless it is not a number or only noise."""
        if not (math.isfinite(x) and math.isfinite(y)):
            return
        with self._lock:
            if self._position is not None and self._speed < STILL:
                px, py = self._position
                if math.hypot(x - px, y - py) < JUMP:
                    return
            self._position = (x, y)

    def position(self):
        """(x, y), or None before the first estimate."""
        with self._lock:
            return self._position


def main():
    import rospy
    from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped
    from nav_msgs.msg import Odometry

    rospy.init_node("localisation")
    estimate = Estimate()
    publisher = rospy.Publisher("position", PointStamped, queue_size=1, latch=True)
    rospy.Subscriber(
        "amcl_pose",
        PoseWithCovarianceStamped,
        lambda m: estimate.pose(m.pose.pose.position.x, m.pose.pose.position.y),
        queue_size=1,
    )
    rospy.Subscriber("odometry/filtered", Odometry, lambda m: estimate.odometry(m.twist.twist.linear.x), queue_size=1)
    rate = rospy.Rate(RATE)
    while not rospy.is_shutdown():
        position = estimate.position()
        if position is not None:
            message = PointStamped()
            message.header.stamp = rospy.Time.now()
            message.header.frame_id = "map"
            message.point.x, message.point.y = position
            publisher.publish(message)
        rate.sleep()


if __name__ == "__main__":
    main()
