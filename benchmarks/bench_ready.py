# SPDX-License-Identifier: GPL-3.0-or-later
# ruff: noqa: S603 - every command line is our own
"""How fast ros_ready answers, on a live graph of real rospy nodes.

    make bench-ready

The graph and the module run together in the lab's ROS image, without a network (ready_graph.py does the work there),
or with `--where local` on this machine where it has Debian's ROS packages. The last line printed is the result as
JSON; the exit status is 1 where a limit is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import ansible

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(CHECKOUT / "tests" / "lab"))

from lablib.podman import PODMAN, limits  # noqa: E402 - found through the line above

INNER = CHECKOUT / "benchmarks" / "ready_graph.py"
IMAGES = "localhost/rosops-lab/ros"  # as `tests/lab/lab artifacts` names them, by content
ANSIBLE_AT = "/opt/ansible"


def newest_image() -> str:
    listed = subprocess.run(
        [*PODMAN, "images", "--filter", f"reference={IMAGES}", "--format", "json"],
        check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip
    images = sorted(json.loads(listed or "[]"), key=lambda image: int(image["Created"]))
    return str(images[-1]["Id"]) if images else ""


def in_image(image: str, options: list[str]) -> list[str]:
    """The image has ROS and Python; the collection and Ansible's module code are mounted beside them, read-only."""
    library = Path(ansible.__file__).resolve().parent
    return [
        *PODMAN, "run", "--rm", "--network=none", "--pids-limit=-1", *limits(), "--read-only", "--tmpfs=/tmp",
        f"--volume={CHECKOUT}:{CHECKOUT}:ro", f"--volume={library}:{ANSIBLE_AT}/ansible:ro", "--env=HOME=/tmp",
        f"--env=PYTHONPATH={ANSIBLE_AT}:/usr/lib/python3/dist-packages", "--env=PYTHONDONTWRITEBYTECODE=1",
        "--entrypoint=/usr/bin/python3", image, str(INNER), *options,
    ]  # fmt: skip


def has_ros() -> bool:
    done = subprocess.run(["/usr/bin/python3", "-c", "import rospy, rosmaster"], capture_output=True, check=False)
    return done.returncode == 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--where", choices=["auto", "image", "local"], default="auto")
    parser.add_argument("--image", help="the ROS image to run in (default: the newest that the lab built)")
    parser.add_argument("--trials", type=int, default=10, help="runs per row")
    arguments = parser.parse_args()
    options = [f"--trials={arguments.trials}"]
    image = "" if arguments.where == "local" else arguments.image or newest_image()
    if image:
        print(f"in the lab's ROS image {image[:12]}, without a network", flush=True)
        return subprocess.run([*in_image(image, options), "--where=image"], check=False).returncode
    if arguments.where != "image" and has_ros():
        print("on this machine, over loopback", flush=True)
        paths = [str(Path(ansible.__file__).resolve().parents[1]), "/usr/lib/python3/dist-packages"]
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        command = ["/usr/bin/python3", str(INNER), *options, "--where=local"]
        return subprocess.run(command, check=False, env=env).returncode
    print("There is no ROS to measure on: build the lab's image with `tests/lab/lab artifacts`.", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
