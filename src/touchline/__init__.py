# SPDX-License-Identifier: Apache-2.0
"""The sense of touch for a robot arm without a skin.

import touchline as tl

robot = tl.load_robot("sara")
pipeline = tl.Pipeline(robot)
result = pipeline.update(time, q, qd, tau, wrench)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from touchline.detector.detector import Detection, Level
from touchline.errors import InputError
from touchline.health import Health
from touchline.model.robot import Robot, load_robot
from touchline.native import core
from touchline.observer.observer import Estimate, Observer
from touchline.pipeline.pipeline import Pipeline
from touchline.pipeline.result import Result
from touchline.result.contact import Candidate, Contact
from touchline.result.event import Event, EventChange
from touchline.result.kinds import ContactLevel, Happened, Status, Zone

if TYPE_CHECKING:
    from touchline import live as live

__version__: str = core.VERSION

__all__ = [
    "Candidate",
    "Contact",
    "ContactLevel",
    "Detection",
    "Estimate",
    "Event",
    "EventChange",
    "Happened",
    "Health",
    "InputError",
    "Level",
    "Observer",
    "Pipeline",
    "Result",
    "Robot",
    "Status",
    "Zone",
    "load_robot",
]


def __getattr__(name: str) -> Any:
    """Running robots are loaded when they are asked for."""
    if name == "live":
        return import_module("touchline.live")
    raise AttributeError(f"module 'touchline' has no attribute '{name}'")
