"""Bags of ROS 1 and ROS 2, through the library `rosbags`, which the extra `ros` installs."""
