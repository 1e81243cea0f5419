# SPDX-License-Identifier: Apache-2.0
"""A process that keeps all that a live session makes of topics: ROBOT RECORDING RESULT."""

import pickle
import sys
from pathlib import Path

from live_support import watch

from touchline.model.robot import load_robot

seen = watch(load_robot(sys.argv[1]), "ros2://", Path(sys.argv[2]), duration=6.0, force=True)
seen.notices.clear()
Path(sys.argv[3]).write_bytes(pickle.dumps(seen))
