# SPDX-License-Identifier: Apache-2.0
"""`index.html`: one file that explains each experiment and shows its figures and numbers."""

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

from touchline import __version__
from touchline.figure import rendered
from touchline.reproduce.experiment import Check, Experiment, Row, Table

PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
  content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<main>
<h1>The paper's experiments, again</h1>
<p class="soft">M. Iskandar, O. Eiberger, A. Albu-Sch&auml;ffer, A. De Luca, A. Dietrich:
Collision detection, identification, and localization on the DLR SARA robot with sensing
redundancy, ICRA 2021. Simulated here on an arm of the same class and layout, whose geometry and
numbers are not DLR's; forces and lengths are therefore not to be compared with the paper's number
by number. Written by <code>touchline reproduce</code>, version {version}.</p>
{body}
</main>
</body>
</html>
"""
STYLE = Path(__file__).parent / "assets" / "page.css"
DOTS = 96  # per inch, at which a figure is shown at most 1.35 times its size in print


def page_text(experiments: Sequence[Experiment]) -> str:
    """The whole page."""
    body = "\n".join(_section(experiment) for experiment in experiments)
    title = ", ".join(experiment.name for experiment in experiments)
    return PAGE.format(
        title=escape(f"{title} - Touchline"),
        style=STYLE.read_text(encoding="utf-8"),
        body=body,
        version=__version__,
    )


def _section(experiment: Experiment) -> str:
    words = (
        ("What is shown", experiment.shown),
        ("What the paper says", experiment.paper),
        ("What we see", experiment.seen),
    )
    text = "".join(f"<dt>{head}</dt><dd>{escape(body)}</dd>" for head, body in words)
    figures = "".join(
        _figure(drawing.figure, f"{name}. {drawing.caption}")
        for name, drawing in experiment.drawings.items()
    )
    tables = "".join(_table(name, table) for name, table in experiment.tables.items())
    return (
        f'<section id="{experiment.name}"><h2>{escape(experiment.title)}</h2>'
        f"<dl>{text}</dl>{figures}{_checks(experiment.checks)}{tables}</section>"
    )


def _figure(figure: object, caption: str) -> str:
    data = base64.b64encode(rendered(figure, "svg")).decode("ascii")
    width = round(1.35 * DOTS * figure.get_figwidth())  # pyright: ignore
    return (
        f'<figure><img style="--width:{width}px" alt="{escape(caption)}" '
        f'src="data:image/svg+xml;base64,{data}"><figcaption>{escape(caption)}</figcaption></figure>'
    )


def _checks(checks: Sequence[Check]) -> str:
    if not checks:
        return ""
    rows = "".join(
        f"<tr><td>{escape(c.name)}</td><td>{c.value:.3g}</td><td>{c.limit:g}</td>"
        f'<td class="{_word(c)}">{_word(c)}</td></tr>'
        for c in checks
    )
    head = "<tr><th>must stay below its limit</th><th>value</th><th>limit</th><th>kept</th></tr>"
    return f"{_scrolling('Checks')}<table>{head}{rows}</table></div>"


def _word(check: Check) -> str:
    return "holds" if check.holds else "fails"


def _table(name: str, table: Table) -> str:
    if not table.rows:
        return ""
    keys = table.shown or list(table.rows[0])
    first = table.rows[0]
    head = "".join(f"<th{_kind(first[k])}>{escape(k.replace('_', ' '))}</th>" for k in keys)
    rows = "".join(f"<tr>{_cells(row, keys)}</tr>" for row in table.rows)
    return (
        f'<h3>{escape(name)}.csv</h3><div class="soft">{escape(table.caption)}</div>'
        f"{_scrolling(f'{name}.csv')}<table><thead><tr>{head}</tr></thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )


def _scrolling(name: str) -> str:
    """Opens a part of the page that scrolls by itself, with the keyboard, too."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(name)}">'


def _cells(row: Row, keys: Sequence[str]) -> str:
    return "".join(f"<td{_kind(row[key])}>{escape(_text(row[key]))}</td>" for key in keys)


def _kind(value: str | float | int | None) -> str:
    return ' class="text"' if isinstance(value, str) else ""


def _text(value: str | float | int | None) -> str:
    if value is None or value != value:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
