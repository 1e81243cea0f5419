# SPDX-License-Identifier: Apache-2.0
"""What is suspicious about a mechanism but no reason to refuse it."""

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from touchline.model.mechanism import Inertia, Joint, Link, Mechanism
from touchline.model.topology import outboard_links


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


def inertia_problem(body: Inertia) -> str | None:
    """Say why no rigid body has this inertia about its centre of mass; None if one can.

    The principal moments are not negative, and none exceeds the sum of the two others.
    """
    moments = np.linalg.eigvalsh(body.inertia)
    # Published figures are rounded: 1 % of the largest moment is no finding.
    slack = 0.01 * max(abs(moments))
    listed = ", ".join(f"{value:.3g}" for value in moments)
    if moments[0] < -slack:
        return f"the inertia has a negative principal moment: {listed} kg m2"
    if moments[2] > moments[0] + moments[1] + slack:
        return f"no body has these principal moments (the largest exceeds the sum): {listed} kg m2"
    return None


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
