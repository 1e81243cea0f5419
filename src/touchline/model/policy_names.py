# SPDX-License-Identifier: Apache-2.0
"""Do the links and segments that `policy` names exist, and do its limits make sense?"""

from collections.abc import Iterator

from touchline.model.entries import RobotFile
from touchline.model.mechanism import Mechanism
from touchline.model.names import Names, Problem, numbered
from touchline.suggest import unknown


def check_policy(file: RobotFile, names: Names, mechanism: Mechanism | None) -> Iterator[Problem]:
    """Yield what is wrong with the names in `policy`; those of links only with a mechanism."""
    segments = ("root", *names.sensors)
    links = None if mechanism is None else tuple(mechanism.links)
    places = None if links is None else (*segments, *links)
    for where, rule in numbered(file.policy.rules, "policy.rules"):
        if rule.segment is not None and rule.segment not in segments:
            yield f"{where}.segment", unknown(rule.segment, "segment", segments)
        if links is not None and rule.link is not None and rule.link not in links:
            yield f"{where}.link", unknown(rule.link, "link", links)
    for key, named in (("zones", file.policy.zones), ("limits", file.policy.limits)):
        for name in named if places is not None else ():
            if places is not None and name not in places:
                yield f"policy.{key}.{name}", unknown(name, "link or segment", places)
    for name, limit in file.policy.limits.items():
        if limit.transient is None and limit.quasi_static is None:
            yield f"policy.limits.{name}", "has no number; allowed: transient, quasi_static"
        elif limit.transient and limit.quasi_static and limit.quasi_static > limit.transient:
            what = f"{limit.quasi_static:g} is above the transient limit of {limit.transient:g}"
            yield f"policy.limits.{name}.quasi_static", what
