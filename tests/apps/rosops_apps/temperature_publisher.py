# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulated temperature sensor: RATE_HZ (500) readings a second on the topic `temperature`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import rospy  # type: ignore[import-not-found]

from . import node, settings
from .jsonl import JsonLinesLog
from .pacing import SampleClock, celsius, pending
from .sequence import SequenceTracker

LONGEST_SLEEP = 0.5  # a slow sensor, too, notices within this time that it is asked to stop
STEP_SECONDS = 0.1  # a wall clock this far away was set; it did not drift


class Sensor:
    """Publishes readings and keeps account of them."""

    def __init__(self, topic: Any, message: Any, stride: int) -> None:
        self._topic = topic
        self._message = message
        self._stride = stride
        self.sent = 0
        self.skipped = 0
        self.account = SequenceTracker()

    def publish(self, readings: range) -> None:
        """Publish these readings: of every `stride`-th sample one."""
        message = self._message
        for reading in readings:
            number = reading * self._stride
            message.sequence = number
            message.celsius = celsius(number, settings.SENSOR_RATE)
            message.header.stamp = rospy.Time.from_sec(number / settings.SENSOR_RATE)
            self._topic.publish(message)
            self.account.add(number)
        self.sent += len(readings)

    def report(self) -> dict[str, Any]:
        """What was published, since the start and (as ranges) since the last report."""
        return {"sent": self.sent, "skipped": self.skipped, "ranges": self.account.take_ranges()}


def read_settings() -> tuple[float, int, int, Path | None]:
    """Rate and stride, the length of the queue, and where what was published is written down (LOG_DIR, optional)."""
    return (*settings.rates(), settings.queue_size(), settings.log_dir())


def publish(rate: float, stride: int, queue: int, directory: Path | None) -> None:
    """Publish until asked to stop."""
    from .msg import Temperature  # type: ignore[import-not-found] # noqa: PLC0415 - made when the image is built

    log = JsonLinesLog(directory / "temperature-published.jsonl") if directory else None
    topic = rospy.Publisher("temperature", Temperature, queue_size=queue, tcp_nodelay=True)
    message = Temperature()
    message.header.frame_id = "temperature_sensor"
    sensor = Sensor(topic, message, stride)
    pace(sensor, rate, queue, log)
    if log:
        record(sensor, log)
        log.close()
    node.say("published", sent=sensor.sent, skipped=sensor.skipped)


def pace(sensor: Sensor, rate: float, queue: int, log: JsonLinesLog | None) -> None:
    """Have every reading published when it is due."""
    # After a stall as many readings as half a queue holds are caught up; more would push out what waits there.
    most = max(1, min(queue // 2, int(rate)))
    now = followed = time.monotonic()
    clock = SampleClock(rate, time.time(), now)
    last = clock.number(now)
    while not node.stopping():
        pause = clock.due(last + 1) - time.monotonic()
        if pause > 0:
            # not rospy.sleep: that sleeps in slices, and simulated time is of no use to a sensor
            time.sleep(min(pause, LONGEST_SLEEP))
            if node.stopping():
                break
        now = time.monotonic()
        numbers, given_up = pending(last, clock.number(now), most)
        sensor.publish(numbers)
        sensor.skipped += given_up
        if numbers:
            if sensor.sent == len(numbers):
                node.ready()
            last = numbers[-1]
        if now - followed >= 1.0:
            away = clock.follow(time.time(), now)
            if abs(away) > STEP_SECONDS:
                rospy.logwarn_throttle(60, f"the clock is {away:.3f} s away from the samples' numbers")
            if log:
                record(sensor, log)
            followed = now


def record(sensor: Sensor, log: JsonLinesLog) -> None:
    """One line of the log."""
    log.write({"time": round(time.time(), 3), "node": rospy.get_name(), **sensor.report()})


def main() -> None:
    node.run("temperature_publisher", read_settings, publish)
