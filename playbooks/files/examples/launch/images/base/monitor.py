#!/usr/bin/env python3
"""Publishes the mean of every ten speeds. A real one would report to a service that asks for the token."""

import os

import rospy
from std_msgs.msg import Float64

TOKEN = os.environ["CLOUD_TOKEN"]
speeds = []


def heard(message):
    speeds.append(message.data)
    if len(speeds) == 10:
        mean.publish(sum(speeds) / 10)
        speeds.clear()


rospy.init_node("monitor")
mean = rospy.Publisher("mean_speed", Float64, queue_size=10)
rospy.Subscriber("wheel_speed", Float64, heard)
rospy.spin()
