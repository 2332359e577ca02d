"""RCL, the ROS Contract Language: text in, checked contract out."""
