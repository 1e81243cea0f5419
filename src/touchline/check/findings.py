# SPDX-License-Identifier: Apache-2.0
"""What a check says: sections of facts, and findings that ask for something to be done."""

from dataclasses import dataclass, field
from typing import Any


@dataclass
class Findings:
    """Collects what was found.

    Attributes:
        findings: what should be mended, one clear line each.
        notes: by section, what was seen.
        fixes: top-level keys of `robot.yaml` with the values that would mend findings.
    """

    findings: list[str] = field(default_factory=list)
    notes: dict[str, list[str]] = field(default_factory=dict)
    fixes: dict[str, Any] = field(default_factory=dict)

    def find(self, line: str) -> None:
        """Add a finding, once."""
        if line not in self.findings:
            self.findings.append(line)

    def note(self, section: str, *lines: str) -> None:
        """Add lines to a section."""
        self.notes.setdefault(section, []).extend(lines)

    def take(self, other: "Findings") -> None:
        """Add all that another collection holds."""
        for line in other.findings:
            self.find(line)
        for section, lines in other.notes.items():
            self.note(section, *lines)
        self.fixes.update(other.fixes)

    def text(self) -> str:
        """Everything, the findings last."""
        parts = ["\n".join([f"{title}:", *lines]) for title, lines in self.notes.items() if lines]
        if self.findings:
            lines = [f"  {i}. {line}" for i, line in enumerate(self.findings, 1)]
            parts.append("\n".join([f"findings: {len(lines)}", *lines]))
        else:
            parts.append("findings: none")
        return "\n\n".join(parts)
