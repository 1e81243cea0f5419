# SPDX-License-Identifier: Apache-2.0
"""Prose of a source file: docstrings, messages and comments, each with its line."""

import ast
import inspect
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

from prose import REPOSITORY

PYTHON = sorted((REPOSITORY / "src").rglob("*.py"))
CPP = sorted(p for p in (REPOSITORY / "core").rglob("*") if p.suffix in (".hpp", ".cpp"))
CPP_COMMENT = re.compile(r"(?:^|\s)//+\s?(.*)$")
HEADING = re.compile(r"^-+ .* -+$")


def passages(path: Path) -> list[tuple[int, str]]:
    """Line and text of each docstring, message and comment."""
    text = path.read_text()
    if path.suffix != ".py":
        return _blocks(_cpp_comments(text))
    return [*_strings(ast.parse(text)), *_blocks(_python_comments(text))]


def _strings(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Strings; those that are joined or added count as one, a value in braces as one word."""
    for node in ast.iter_child_nodes(tree):
        if flat := _flat(node):
            yield getattr(node, "lineno", 0), inspect.cleandoc(flat)
        else:
            yield from _strings(node)


def _flat(node: ast.AST) -> str:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(_flat(value) or "X" for value in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _flat(node.left) + _flat(node.right)
    return ""


def _python_comments(text: str) -> Iterator[tuple[int, bool, str]]:
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            alone = not token.line[: token.start[1]].strip()
            yield token.start[0], alone, token.string.lstrip("# ")


def _cpp_comments(text: str) -> Iterator[tuple[int, bool, str]]:
    for number, line in enumerate(text.splitlines(), 1):
        if found := CPP_COMMENT.search(line):
            told = HEADING.sub("", found.group(1))
            yield number, line.lstrip().startswith("//"), told


def _blocks(comments: Iterator[tuple[int, bool, str]]) -> list[tuple[int, str]]:
    """Comments on lines of their own, one below the other, are one text."""
    blocks: list[tuple[int, str]] = []
    last = -1
    for number, alone, text in comments:
        if "SPDX" in text:
            continue
        if alone and number == last + 1:
            blocks[-1] = (blocks[-1][0], f"{blocks[-1][1]}\n{text}")
        else:
            blocks.append((number, text))
        last = number if alone else -1
    return blocks
