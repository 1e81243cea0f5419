# SPDX-License-Identifier: Apache-2.0
"""What a model without a description is taken to be: each guess with its reason.

A URDF or MJCF does not say which joints have torque sensors, nor which of them are fingers or
wheels. Names tell it most often. A guess is made where it is needed, and always told.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from touchline.model.mechanism import Mechanism
from touchline.model.topology import independent_joints, outboard_links
from touchline.suggest import FEW, listing

FINGER = frozenset("finger fingers gripper knuckle jaw claw robotiq driver coupler".split())
DIGIT = frozenset("thumb index middle ring pinky".split())  # of something that is called a hand
WHEEL = frozenset("wheel wheels caster castor".split())
LEG = frozenset("hip knee ankle thigh calf shank hfe haa kfe foot".split())
FORCE_TORQUE = re.compile(r"(^|[_\W])(ft|f_t|fts)([_\W]|$)|force_?torque|ft_?sensor", re.IGNORECASE)


@dataclass(frozen=True)
class Family:
    """Robots whose joint torques are known to be measured in one way.

    Attributes:
        name: of the robots.
        pattern: that the name of model or file holds, of words between separators.
        torque: "sensor", "motor" or "none".
        why: in words.
    """

    name: str
    pattern: str
    torque: str
    why: str


LINK_SIDE = "has link-side joint torque sensors"
CURRENT = "has no joint torque sensors; its efforts come from motor currents"
SERVO = "has hobby servos, whose load figure is no torque"
FAMILIES = (
    Family("a hobby-servo arm", r"so_?arm\d*|so_?10[01]\w*|koch|lekiwi|low_cost", "none", SERVO),
    Family("a hobby-servo arm", r"[wvpr]x(100|150|200|250)s?|interbotix|aloha", "none", SERVO),
    Family("a hobby-servo arm", r"open_?manipulator|poppy|braccio|mycobot", "none", SERVO),
    Family("Universal Robots' UR", r"ur(3|5|7|8|10|12|15|16|18|20|30)e?", "motor", CURRENT),
    Family("UFACTORY's xArm", r"xarm\d?|lite_?6|uf_?850", "motor", CURRENT),
    Family("Kinova's Gen3 lite", r"gen3_?lite", "motor", CURRENT),
    Family("an industrial arm", r"irb\d*|abb|fanuc|motoman|staubli|tx2?_?\d+", "motor", CURRENT),
    Family("Unitree's arm or robot", r"z1|g1|h1|go[12]|a1|b[12]|aliengo", "motor", CURRENT),
    Family("PAL's TIAGo", r"tiago\w*", "motor", CURRENT),
    Family("Willow Garage's PR2", r"pr2", "motor", CURRENT),
    Family("Franka's Panda or FR3", r"panda|franka|fr3\w*|fer", "sensor", LINK_SIDE),
    Family("KUKA's LBR", r"iiwa\d*|lbr|lwr\d*|med\d+", "sensor", LINK_SIDE),
    Family("Kinova's Gen3 or Jaco", r"gen3|jaco\d?|j2[sn]\w*|kinova", "sensor", LINK_SIDE),
    Family("Flexiv's Rizon", r"rizon\w*|flexiv", "sensor", LINK_SIDE),
    Family("PAL's TALOS", r"talos\w*", "sensor", LINK_SIDE),
    Family("Rethink's Baxter or Sawyer", r"baxter|sawyer", "sensor", LINK_SIDE),
)
UNKNOWN = Family("a robot of no known family", "", "sensor", "may or may not have torque sensors")
UR_JOINTS = {"shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_3_joint"}


@dataclass(frozen=True)
class Guess:
    """A description in the making.

    Attributes:
        name: of the robot.
        model: file.
        family: that its torques are taken from.
        observed: the joints that are observed, in the model's order.
        locked: position [rad or m] and reason of each joint that is not observed.
        cautions: what the model has that the method does not cover.
    """

    name: str
    model: Path
    family: Family
    observed: tuple[str, ...]
    locked: dict[str, tuple[float, str]]
    cautions: tuple[str, ...]

    def data(self) -> dict[str, Any]:
        """Return the guess as a `robot.yaml` would hold it."""
        return {
            "name": self.name,
            "model": self.model.name,
            "joints": [{"name": name, "torque": self.family.torque} for name in self.observed],
            "locked": {name: position for name, (position, _) in self.locked.items()},
        }

    def statements(self) -> tuple[str, ...]:
        """Return each guess in a sentence."""
        names = ", ".join(self.observed)
        lines = [f"joint torques are `torque: {self.family.torque}`: {torque_reason(self.family)}"]
        for reason in dict.fromkeys(reason for _, reason in self.locked.values()):
            locked = [f"{n} at {p:g}" for n, (p, why) in self.locked.items() if why == reason]
            lines.append(f"locked: {', '.join(locked)}: {reason}")
        lines.append(f"observed joints, in this order: {names}")
        lines.append("there is no force-torque sensor")
        lines.append("sensor noise is that of ordinary joint torque sensors (`noise` is missing)")
        return tuple(lines)


def torque_reason(family: Family) -> str:
    """Say why joint torques are taken to be measured so."""
    if family is UNKNOWN:
        return (
            "the name tells no robot whose sensors are known; write `motor` where efforts come "
            "from motor currents, `none` where there are none"
        )
    return f"{family.name} {family.why}"


def guess_description(mechanism: Mechanism, model: Path) -> Guess:
    """Guess how a robot is measured from the names in its model."""
    free = independent_joints(mechanism)
    locked: dict[str, tuple[float, str]] = {}
    fingers = _finger_joints(mechanism, free)
    for joint in free:
        if joint in fingers:
            locked[joint] = (rest_position(mechanism, joint), "fingers carry no torque signal")
        elif words(joint, mechanism.joints[joint].child) & WHEEL:
            locked[joint] = (rest_position(mechanism, joint), "a wheel carries no torque signal")
    observed = tuple(name for name in free if name not in locked)
    family = family_of([mechanism.name, model.stem, *model.parent.parts[-2:]], free)
    return Guess(
        robot_name(mechanism, model), model, family, observed, locked, tuple(cautions(mechanism))
    )


def robot_name(mechanism: Mechanism, model: Path) -> str:
    """Return the name that a robot has where its description gives none: the model's."""
    return re.sub(r"[^\w-]+", "-", mechanism.name or model.stem)


def family_of(names: Iterable[str], joints: Iterable[str]) -> Family:
    """Return the family that one of the names belongs to, or `UNKNOWN`."""
    if set(joints) >= UR_JOINTS:
        return next(family for family in FAMILIES if family.name.endswith("UR"))
    for name in names:
        for family in FAMILIES:
            pattern = rf"(^|[_\W])({family.pattern})([_\W]|$)"
            if re.search(pattern, name, re.IGNORECASE):
                return family
    return UNKNOWN


def cautions(mechanism: Mechanism) -> Iterator[str]:
    """Yield what the method does not cover: wheels, coupled joints, legs."""
    moving = {name: joint for name, joint in mechanism.joints.items() if joint.kind != "fixed"}
    wheels = [n for n, joint in moving.items() if words(n, joint.child) & WHEEL]
    if wheels:
        yield (
            f"joints {listing(wheels, FEW)} are wheels: the root link is taken to stand still, so "
            "a robot that drives feels its own accelerations as touch"
        )
    legs = [n for n, joint in moving.items() if words(n, joint.child) & LEG]
    if len(legs) > 1 and not wheels:
        yield (
            f"joints {listing(legs, FEW)} are those of legs: the root link is taken to stand "
            "still, and the ground under the feet is felt as a touch"
        )
    coupled = [f"{n} (follows {joint.mimic.joint})" for n, joint in moving.items() if joint.mimic]
    if coupled:
        yield (
            f"coupled joints {listing(coupled, FEW)}: they move as the model says, and a touch of "
            "them loads the joint that they follow"
        )


def force_torque_links(mechanism: Mechanism) -> list[str]:
    """Return the links outboard of fixed joints that are named like a force-torque sensor."""
    return [
        joint.child
        for joint in mechanism.joints.values()
        if joint.kind == "fixed" and FORCE_TORQUE.search(f"{joint.name} {joint.child}")
    ]


def words(*names: str) -> set[str]:
    """Return the words in names, without digits, in lower case."""
    return {word.lower() for name in names for word in re.findall(r"[A-Za-z]+", _split(name))}


def _split(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name)


def _finger_joints(mechanism: Mechanism, free: list[str]) -> set[str]:
    """Return the joints of hands, and all that they carry; none if nothing else were left."""
    found: set[str] = set()
    for name in free:
        joint = mechanism.joints[name]
        named = words(name)
        if named & FINGER or (named & DIGIT and "hand" in named) or "finger" in words(joint.child):
            outboard = outboard_links(mechanism, joint.child, lambda _: True)
            found |= {n for n in free if mechanism.joints[n].child in outboard}
    return found if len(found) < len(free) else set()


def rest_position(mechanism: Mechanism, name: str) -> float:
    """Return where a joint that is not observed is taken to stand: at 0, or its nearest limit."""
    joint = mechanism.joints[name]
    return float(np.clip(0.0, joint.lower, joint.upper))
