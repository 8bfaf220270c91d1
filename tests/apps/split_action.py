# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An action definition as the seven message definitions that actionlib wants: its genaction, which Debian leaves out.

Usage: split_action.py DEFINITION.action DIRECTORY
"""

from __future__ import annotations

import re
import sys
from pathlib import Path


def definitions(name: str, text: str) -> dict[str, str]:
    """File name -> content."""
    parts = re.split(r"^---\s*$", text, flags=re.MULTILINE)
    if len(parts) != 3:
        raise SystemExit(f"{name}.action: goal, result and feedback stand between two lines of ---")
    goal, result, feedback = parts
    whole = [f"{name}Action{part} action_{part.lower()}\n" for part in ("Goal", "Result", "Feedback")]
    bodies = {
        "Goal": goal,
        "Result": result,
        "Feedback": feedback,
        "ActionGoal": f"Header header\nactionlib_msgs/GoalID goal_id\n{name}Goal goal\n",
        "ActionResult": f"Header header\nactionlib_msgs/GoalStatus status\n{name}Result result\n",
        "ActionFeedback": f"Header header\nactionlib_msgs/GoalStatus status\n{name}Feedback feedback\n",
        "Action": "".join(whole),
    }
    return {f"{name}{part}.msg": body for part, body in bodies.items()}


def main() -> None:
    """Write them."""
    source, directory = Path(sys.argv[1]), Path(sys.argv[2])
    directory.mkdir(parents=True, exist_ok=True)
    for file, content in definitions(source.stem, source.read_text(encoding="utf-8")).items():
        (directory / file).write_text(content, encoding="utf-8")


if __name__ == "__main__":
    main()
