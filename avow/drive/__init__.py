"""Runs a node's own source, step by step, without a robot: `steps` a class with a `step` method, `callbacks` a class
whose callbacks are rospy's or rclpy's, in virtual time.

Its modules run in the process of the program under test, beside code that is not ours: of Avow they import only each
other.
"""
