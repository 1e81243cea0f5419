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
from touchline.result.fault import ChannelFault, FaultChange
from touchline.result.kinds import ContactLevel, Fault, Happened, Status, Watch, Zone
from touchline.result.reset import Reset, ResetChange
from touchline.result.standing import Standing
from touchline.tuning import Tuning

if TYPE_CHECKING:
    from touchline import live as live
    from touchline import touch as touch
    from touchline.localizer.region import Region as Region
    from touchline.localizer.skin import Skin as Skin
    from touchline.logs import read_log as read_log
    from touchline.reaction.reactor import Command as Command
    from touchline.reaction.reactor import Reactor as Reactor
    from touchline.reaction.state import State as State
    from touchline.report.results import analyze as analyze
    from touchline.touch.touch import Touch as Touch

__version__: str = core.VERSION

__all__ = [
    "Candidate",
    "ChannelFault",
    "Contact",
    "ContactLevel",
    "Detection",
    "Estimate",
    "Event",
    "EventChange",
    "Fault",
    "FaultChange",
    "Happened",
    "Health",
    "InputError",
    "Level",
    "Observer",
    "Pipeline",
    "Reset",
    "ResetChange",
    "Result",
    "Robot",
    "Standing",
    "Status",
    "Tuning",
    "Watch",
    "Zone",
    "load_robot",
]


LATER = {  # loaded when they are asked for: from which module
    "live": "touchline.live",
    "touch": "touchline.touch",
    "Touch": "touchline.touch",
    "Command": "touchline.reaction.reactor",
    "Reactor": "touchline.reaction.reactor",
    "Region": "touchline.localizer.region",
    "Skin": "touchline.localizer.skin",
    "State": "touchline.reaction.state",
    "analyze": "touchline.report.results",
    "read_log": "touchline.logs",
}


def __getattr__(name: str) -> Any:
    """What follows from contacts is loaded when it is asked for."""
    if name not in LATER:
        raise AttributeError(f"module 'touchline' has no attribute '{name}'")
    module = import_module(LATER[name])
    return module if LATER[name].endswith(f".{name}") else getattr(module, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *LATER})
