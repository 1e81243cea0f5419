"""Prose of a Markdown page: its sentences, and its blocks of code."""

import re
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md"))]
LONGEST = 35  # words


def sentences(text: str) -> list[str]:
    """Sentences outside of code, tables, headings and comments; each list item begins one."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"^```.*?^```", "\n", text, flags=re.DOTALL | re.MULTILINE)
    lines = []
    for line in text.splitlines():
        if line.startswith(("    ", "|", "#", "![", ":::")):
            lines.append("")
        else:
            lines.append(re.sub(r"^\s*([*+-]|\d+\.)\s+", "\n\n", line))
    found = []
    for paragraph in re.split(r"\n\s*\n", "\n".join(lines)):
        flat = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(paragraph.split()))
        flat = re.sub(r"`[^`]*`", "Code", flat)
        found += [s for s in re.split(r"(?<=[.!?:;])\s+(?=[A-Z0-9*(`\"])", flat) if s.strip()]
    return found


def long_sentences(text: str) -> list[str]:
    """Those with more than LONGEST words."""
    return [s for s in sentences(text) if len(s.split()) > LONGEST]


def code(text: str, language: str) -> list[str]:
    """Blocks of code of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
