# SPDX-License-Identifier: Apache-2.0
"""The numbers of the live page as a table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from touchline.check.felt import Felt
from touchline.health import Health
from touchline.view.judge import Verdict

LEVEL_COLOURS = ("#e6e8eb", "#f5a623", "#d0021b")
LEVEL_WORDS = ("nothing", "contact", "collision")
STATUS_WORDS = {
    "not_separable": "several touches, or a twist",
    "wrench_only": "force only",
    "ambiguous": "one of several places",
}


@dataclass(frozen=True)
class Speed:
    """How fast it goes.

    Attributes:
        step: time the estimator takes for one sample [s].
        real_time: simulated seconds per second.
    """

    step: float = 0.0
    real_time: float = 0.0


def readout(
    verdicts: Sequence[Verdict], health: int, speed: Speed, felt: Mapping[str, Felt]
) -> str:
    """HTML: one row for each segment, then delays, faint touches, speed and health.

    Args:
        verdicts: one for each segment.
        health: bits.
        speed: of the estimator and of the simulation.
        felt: what can be felt on each link, of `touchline.check.felt`.
    """
    rows = "".join(_row(verdict) for verdict in verdicts)
    delays = [v.delay for v in verdicts if v.delay is not None]
    delay = f"{1e3 * max(delays):.0f} ms" if delays else "-"
    return f"""\
<div style="font-size:12px;line-height:1.5;padding:0 0.75em">
<table style="width:100%;border-collapse:collapse;text-align:left">
<tr style="color:var(--soft)"><th>segment</th><th>feels</th><th>on</th><th>force</th>
<th>point off</th><th>force off</th></tr>
{rows}</table>
<div style="margin-top:0.4em">detected after {delay} &middot; estimator
{1e6 * speed.step:.0f} &micro;s per sample &middot; real-time factor {speed.real_time:.2f}</div>
{_faint(verdicts, felt)}
<div style="color:var(--alarm);min-height:1.5em">{escape(health_words(health))}</div></div>"""


def _row(verdict: Verdict) -> str:
    contact = verdict.contact
    size = "-"
    if contact is not None and contact.force is not None:
        size = f"{float((contact.force @ contact.force) ** 0.5):.1f} N"
    cells = [
        escape(verdict.segment),
        _chip(verdict.level),
        escape(_where(verdict)),
        size,
        "-" if verdict.position_error is None else f"{1e3 * verdict.position_error:.1f} mm",
        "-" if verdict.force_error is None else f"{verdict.force_error:.2f} N",
    ]
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _faint(verdicts: Sequence[Verdict], felt: Mapping[str, Felt]) -> str:
    """True and felt touches that are weaker than what is surely felt where they are."""
    lines = []
    for verdict in verdicts:
        for true in verdict.true:
            if true.link in felt:
                lines.append(felt[true.link].faint("true touch", float(np.linalg.norm(true.force))))
        contact = verdict.contact
        able = None if contact is None or contact.link is None else felt.get(contact.link)
        if not verdict.true and contact is not None and able is not None:
            lines.append(able.faint("felt", contact.size))
    return "".join(f"<div>{escape(line)}</div>" for line in lines if line is not None)


def _chip(level: int) -> str:
    ink = "#333" if level < 2 else "#fff"
    return (
        f'<span style="background:{LEVEL_COLOURS[level]};color:{ink};border-radius:0.6em;'
        f'padding:0 0.6em">{LEVEL_WORDS[level]}</span>'
    )


def _where(verdict: Verdict) -> str:
    contact = verdict.contact
    if contact is None:
        return "-"
    if contact.link is None:
        return STATUS_WORDS.get(contact.status, contact.status)
    sure = contact.body_probability
    likely = f" {100 * sure:.0f}%" if sure is not None and sure < 0.995 else ""
    return f"{contact.link}{likely}"


def health_words(health: int) -> str:
    """The health bits that are set, in words; settling passes by itself and is left out."""
    bits = [bit for bit in Health if bit & health and bit != Health.SETTLING]
    return ", ".join((bit.name or "").lower().replace("_", " ") for bit in bits)
