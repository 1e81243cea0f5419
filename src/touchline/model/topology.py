# SPDX-License-Identifier: Apache-2.0
"""The tree of a mechanism: its root, who follows whom, what moves what."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from touchline.model.mechanism import Joint, Mechanism, Mimic
from touchline.suggest import did_you_mean

Fault = Callable[[str, str], None]


def find_root(links: Iterable[str], joints: Mapping[str, Joint], fault: Fault) -> str:
    """Return the link that is no joint's child; note whatever keeps the links from being a tree.

    Args:
        links: names.
        joints: joints whose ends are all in `links`.
        fault: called with (where, what) for each problem.
    """
    links = list(links)
    inboard: dict[str, Joint] = {}
    for joint in joints.values():
        if joint.child in inboard:
            other = inboard[joint.child].name
            fault(
                f"link '{joint.child}'", f"is the child of two joints, '{other}' and '{joint.name}'"
            )
        inboard.setdefault(joint.child, joint)
    roots = [link for link in links if link not in inboard]
    if len(roots) > 1:
        names = ", ".join(f"'{link}'" for link in roots)
        fault("links", f"{names} are no joint's child: a robot has one root link; join them")
    for loop in _loops(inboard):
        fault("joints", f"{' -> '.join(loop)} form a loop; a robot must be a tree")
    return roots[0] if roots else ""


def _loops(inboard: dict[str, Joint]) -> list[list[str]]:
    """Return the links of each cycle of parents."""
    state: dict[str, int] = {}
    loops = []
    for number, start in enumerate(inboard):
        trail, link = [], start
        while link in inboard and link not in state:
            state[link] = number
            trail.append(link)
            link = inboard[link].parent
        if link in trail and state[link] == number:
            loops.append([*reversed(trail[trail.index(link) :]), trail[-1]])
    return loops


def resolve_mimics(joints: dict[str, Joint], fault: Fault) -> dict[str, Joint]:
    """Return the joints with every mimic pointing at an independent joint.

    A mimic of a mimic is expanded: `m1 * (m2 q + o2) + o1`. A mimic of a fixed joint stands still
    and becomes fixed by its reader, so it is an error here, as are loops and unknown joints.
    """
    return {
        name: replace(joint, mimic=_independent(joint, joints, fault)) if joint.mimic else joint
        for name, joint in joints.items()
    }


def _independent(joint: Joint, joints: Mapping[str, Joint], fault: Fault) -> Mimic | None:
    where, seen = f"joint '{joint.name}'", [joint.name]
    mimic = joint.mimic
    while mimic is not None:
        master = joints.get(mimic.joint)
        seen.append(mimic.joint)
        if master is None:
            fault(
                where,
                f"mimics the unknown joint '{mimic.joint}'" + did_you_mean(mimic.joint, joints),
            )
        elif master.name in seen[:-1]:
            fault(where, f"mimics itself: {' -> '.join(seen)}")
        elif master.kind == "fixed":
            fault(where, f"mimics '{master.name}', which is fixed")
        elif master.mimic is None:
            return mimic
        else:
            inner = master.mimic
            offset = mimic.multiplier * inner.offset + mimic.offset
            mimic = Mimic(inner.joint, mimic.multiplier * inner.multiplier, offset)
            continue
        return None
    return None


def independent_joints(mechanism: Mechanism) -> list[str]:
    """Return the names of the joints that move and follow no other, in file order."""
    joints = mechanism.joints.values()
    return [joint.name for joint in joints if joint.kind != "fixed" and joint.mimic is None]


def outboard_links(mechanism: Mechanism, link: str, through: Callable[[Joint], bool]) -> list[str]:
    """Return `link` and the links outboard of it that are reached by joints `through` accepts."""
    children: dict[str, list[Joint]] = {}
    for joint in mechanism.joints.values():
        children.setdefault(joint.parent, []).append(joint)
    found = [link]
    for reached in found:  # grows while it is walked
        found += [joint.child for joint in children.get(reached, ()) if through(joint)]
    return found
