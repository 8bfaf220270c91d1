#!/usr/bin/env python3
"""Writes mean speeds into its log. A real one would send them to a service that asks for the token."""

import os

import rospy
from std_msgs.msg import Float64

TOKEN = os.environ["CLOUD_TOKEN"]

rospy.init_node("monitor")
rospy.Subscriber("mean_speed", Float64, lambda message: rospy.loginfo("mean speed %.2f m/s", message.data))
rospy.spin()
