# SPDX-License-Identifier: Apache-2.0
"""What a check says: sections of facts, and findings that ask for something to be done."""

from dataclasses import dataclass, field
from typing import Any

from touchline.model.robot_file import NAMED


@dataclass
class Findings:
    """Collects what was found.

    Attributes:
        findings: what should be mended, one clear line each.
        notes: by section, what was seen.
        fixes: top-level keys of `robot.yaml` with the values that would mend findings; of `joints`
            and `force_torque_sensors` name -> key -> value.
    """

    findings: list[str] = field(default_factory=list)
    notes: dict[str, list[str]] = field(default_factory=dict)
    fixes: dict[str, Any] = field(default_factory=dict)

    def find(self, line: str) -> None:
        """Add a finding, once."""
        if line not in self.findings:
            self.findings.append(line)

    def mend(self, key: str, name: str, **values: Any) -> None:
        """Add what would mend an entry of `joints` or `force_torque_sensors`."""
        self.fixes.setdefault(key, {}).setdefault(name, {}).update(values)

    def note(self, section: str, *lines: str) -> None:
        """Add lines to a section."""
        self.notes.setdefault(section, []).extend(lines)

    def take(self, other: "Findings") -> None:
        """Add all that another collection holds."""
        for line in other.findings:
            self.find(line)
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
        if self.findings:
            lines = [f"  {i}. {line}" for i, line in enumerate(self.findings, 1)]
            parts.append("\n".join([f"findings: {len(lines)}", *lines]))
        else:
            parts.append("findings: none")
        return "\n\n".join(parts)
