# SPDX-License-Identifier: Apache-2.0
"""What is suspicious about a mechanism but no reason to refuse it."""

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from touchline.model.description import Load
from touchline.model.mechanism import Inertia, Joint, Link, Mechanism
from touchline.model.topology import outboard_links

# Of the largest principal moment: published figures are rounded, and three digits are right by
# 0.5 % each. Half: thin plates of such figures are told. Double: moments that are 2 % off are not.
PUBLISHED = 1e-2
COMPUTED = 1e-3  # the same of a body that a program tells, with four digits or more
# Times the mass of what moves of the arm itself. Light arms carry as much as they weigh at best
# (DLR/KUKA LWR: 14 kg), all others less: twice that is a slip of the unit or of the keyboard.
MOST_CARRIED = 2.0
SHORTEST_REACH = 1.0  # m; a single joint has no length, and still may carry a tool of that length


def mechanism_warnings(mechanism: Mechanism, path: Path) -> Mechanism:
    """Return the mechanism with its warnings appended: free joint, meshes, inertias, no mass."""
    found = (*floating_warning(mechanism), *mesh_warnings(mechanism), *inertia_warnings(mechanism))
    return replace(
        mechanism, warnings=(*mechanism.warnings, *(f"{path}: {line}" for line in found))
    )


def floating_warning(mechanism: Mechanism) -> Iterator[str]:
    """Yield a line where the robot floats in the file."""
    if mechanism.floating:
        what = "floats on a free joint; it is taken to stand still on the world"
        yield f"{mechanism.floating} {what}"


def inertia_warnings(mechanism: Mechanism, locked: Collection[str] = ()) -> Iterator[str]:
    """Yield a line for each link with an impossible inertia, each moving body without mass.

    Joints in `locked`, and those that follow one of them, do not move.
    """

    def still(joint: Joint) -> bool:
        master = joint.mimic.joint if joint.mimic else joint.name
        return joint.kind == "fixed" or master in locked

    for link in mechanism.links.values():
        problem = inertia_problem(link.inertia)
        if problem:
            yield f"link '{link.name}': {problem}"
    for joint in mechanism.joints.values():
        if still(joint) or mechanism.links[joint.child].virtual:
            continue
        body = outboard_links(mechanism, joint.child, still)
        if not any(mechanism.links[name].inertia.mass > 0 for name in body):
            what = "has no mass (with all that is fixed to it)"
            yield f"link '{joint.child}': moves with joint '{joint.name}' but {what}"


def inertia_problem(body: Inertia, rounded: float = PUBLISHED) -> str | None:
    """Say why no rigid body has this inertia about its centre of mass; None if one can.

    The principal moments are not negative, and none exceeds the sum of the two others, but for
    what they are `rounded` by, as a part of the largest one.
    """
    moments = np.linalg.eigvalsh(body.inertia)
    slack = rounded * max(abs(moments))
    listed = ", ".join(f"{value:.3g}" for value in moments)
    if moments[0] < -slack:
        return f"the inertia has a negative principal moment: {listed} kg m2"
    if moments[2] > moments[0] + moments[1] + slack:
        return f"no body has these principal moments (the largest exceeds the sum): {listed} kg m2"
    return None


def load_problem(load: Load, mechanism: Mechanism, loads: Collection[Load] = ()) -> str | None:
    """Say why no arm carries this body, with the value and what is allowed; None if one can.

    Args:
        load: of finite numbers.
        mechanism: that shall carry it.
        loads: that are in the mechanism's masses already, and are no part of the arm itself.
    """
    moving = _moving_links(mechanism)
    own = sum(mechanism.links[name].inertia.mass for name in moving)
    most = MOST_CARRIED * (own - sum(x.mass for x in loads if x.link in moving))
    if load.mass > most > 0.0:
        return (
            f"mass is {load.mass:.6g} kg, but at most {most:.3g} kg are allowed: "
            f"{MOST_CARRIED:g} times what moves of the arm itself, and no arm carries as much"
        )
    distance, reach = float(np.linalg.norm(load.com)), max(_reach(mechanism), SHORTEST_REACH)
    if distance > reach:
        return (
            f"com is {distance:.6g} m from the origin of {load.link}, but at most {reach:.3g} m "
            "are allowed: the length of the stretched arm"
        )
    return None


def _moving_links(mechanism: Mechanism) -> set[str]:
    """Links that some joint moves."""
    joints = mechanism.joints.values()
    return {
        name
        for joint in joints
        if joint.kind != "fixed"
        for name in outboard_links(mechanism, joint.child, lambda _: True)
    }


def _reach(mechanism: Mechanism) -> float:
    """From the root to the farthest link's frame if all were stretched [m]."""
    lengths = {mechanism.root: 0.0}
    for name in outboard_links(mechanism, mechanism.root, lambda _: True):
        for joint in mechanism.joints.values():
            if joint.parent == name:
                travel = max(abs(joint.lower), abs(joint.upper))
                far = travel if joint.kind == "prismatic" and np.isfinite(travel) else 0.0
                own = float(np.linalg.norm(joint.T_parent_joint[:3, 3]))
                lengths[joint.child] = lengths[name] + own + far
    return max(lengths.values())


def mesh_warnings(mechanism: Mechanism) -> Iterator[str]:
    """Yield a line for each reason why surfaces are missing, naming the links that lack theirs."""
    lacking = [
        (link.name, shape)
        for link in mechanism.links.values()
        for shape in surface_shapes(link)
        if shape.problem
    ]
    files = {shape.problem: shape.missing_in for _, shape in lacking}
    counts = Counter(files.values())  # of files that are not there, by folder
    reasons: dict[str, dict[str, None]] = {}
    for name, shape in lacking:
        folder = shape.missing_in
        many = folder is not None and counts[folder] > 1
        reason = f"meshes in '{folder}': no such files" if many else shape.problem or ""
        reasons.setdefault(reason, {})[name] = None
    for reason, links in reasons.items():
        names = ", ".join(f"'{name}'" for name in links)
        yield f"{reason}; no contact is located on link {names}"


def surface_shapes(link: Link) -> tuple:
    """Return the shapes that make the link's surface: the collision ones, else the visual ones."""
    return link.collision or link.visual
