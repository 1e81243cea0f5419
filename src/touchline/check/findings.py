# SPDX-License-Identifier: Apache-2.0
"""What a check says: sections of facts, and findings that ask for something to be done."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from touchline.model.robot_file import NAMED


class Kind(Enum):
    """What a finding is about, where others depend on it."""

    SIGNAL = "signal"  # a column does not hold what it should, in the unit that it should
    TORQUE = "torque"  # a torque of opposite sign, or without the weight
    AXES = "axes"  # a sensor's polarity, axes or frame, or without the weight
    GAIN = "gain"  # a torque that is a multiple of what the model expects, by no known unit
    FINE = "fine"  # what hides nothing else


COARSE = frozenset({Kind.SIGNAL, Kind.TORQUE, Kind.AXES})  # weights mean nothing before


@dataclass(frozen=True)
class Finding:
    """What should be mended.

    Attributes:
        line: in words.
        kind: what it is about.
        about: the joint that it is about; "" where that is of no use to others.
    """

    line: str
    kind: Kind = Kind.FINE
    about: str = ""


@dataclass
class Findings:
    """Collects what was found.

    Attributes:
        all: what should be mended, one clear line each.
        notes: by section, what was seen.
        fixes: top-level keys of `robot.yaml` with the values that would mend findings; of `joints`
            and `force_torque_sensors` name -> key -> value.
    """

    all: list[Finding] = field(default_factory=list)
    notes: dict[str, list[str]] = field(default_factory=dict)
    fixes: dict[str, Any] = field(default_factory=dict)

    @property
    def findings(self) -> list[str]:
        """The lines of all findings."""
        return [finding.line for finding in self.all]

    def find(self, line: str, kind: Kind = Kind.FINE, about: str = "") -> None:
        """Add a finding, once."""
        if line not in self.findings:
            self.all.append(Finding(line, kind, about))

    def of(self, *kinds: Kind) -> list[Finding]:
        """The findings of some kinds."""
        return [finding for finding in self.all if finding.kind in kinds]

    def mend(self, key: str, name: str, **values: Any) -> None:
        """Add what would mend an entry of `joints` or `force_torque_sensors`."""
        self.fixes.setdefault(key, {}).setdefault(name, {}).update(values)

    def note(self, section: str, *lines: str) -> None:
        """Add lines to a section."""
        self.notes.setdefault(section, []).extend(lines)

    def take(self, other: "Findings") -> None:
        """Add all that another collection holds."""
        for finding in other.all:
            self.find(finding.line, finding.kind, finding.about)
        for section, lines in other.notes.items():
            self.note(section, *lines)
        for key, value in other.fixes.items():
            if key in NAMED:
                for name, values in value.items():
                    self.mend(key, name, **values)
            else:
                self.fixes[key] = value

    def text(self) -> str:
        """Everything, the findings last."""
        parts = ["\n".join([f"{title}:", *lines]) for title, lines in self.notes.items() if lines]
        if self.all:
            lines = [f"  {i}. {finding.line}" for i, finding in enumerate(self.all, 1)]
            parts.append("\n".join([f"findings: {len(lines)}", *lines]))
        else:
            parts.append("findings: none")
        return "\n\n".join(parts)
