# SPDX-License-Identifier: Apache-2.0
"""One style for all figures: sizes of a two-column paper, few colours, the same for each method."""

from collections.abc import Sequence
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

from touchline.arrays import Array

COLUMN, PAGE = 3.45, 7.1  # widths [inch]
INK, FAINT = "#22262b", "#8d949c"
# Of contacts, in pictures and on pages. Vermilion and violet are told apart with any colour vision,
# and are no colours of the axes x, y, z.
FELT, TRUE, CANDIDATE = "#d55e00", "#8a5cc4", "#e69f00"
X, Y, Z = "#c0392b", "#2c7a4b", "#2f6db3"  # axes of pages of arms, on white and on black
COLORS = {
    "classical": "#c8602c",
    "closed form": INK,
    "paper": "#7fb3a6",
    "segment": "#1f5d94",
    "truth": FAINT,
}
SHADES = ("#1f5d94", "#c8602c", "#4f9a86", "#8a6bae", "#b8962e", "#6d7780", "#a8485f")
# One behind the other, so that curves that lie on each other are all seen: the first is the widest.
LINES: tuple[dict[str, Any], ...] = (
    {"lw": 2.4, "ls": "-"},
    {"lw": 1.9, "ls": (0, (6, 2))},
    {"lw": 1.5, "ls": (0, (3, 1.5))},
    {"lw": 1.2, "ls": (0, (1, 1))},
    {"lw": 0.9, "ls": (0, (5, 1, 1, 1))},
    {"lw": 0.8, "ls": "-"},
)
POINTS = 2000  # of a curve, at most
STYLE: Any = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 7.5,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "ytick.minor.size": 1.5,
    "ytick.minor.width": 0.4,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e6e9",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.handlelength": 1.4,
    "legend.borderaxespad": 0.2,
    "legend.labelspacing": 0.3,
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.h_pad": 0.03,
    "figure.constrained_layout.w_pad": 0.03,
    "savefig.dpi": 300,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "touchline",
}
METADATA: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
    "png": {"Software": None},
}


def new_figure(width: float, height: float) -> Any:
    """An empty figure [inch] in the common style, which needs no display."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        return Figure(figsize=(width, height))


def styled() -> Any:
    """A context in which axes and texts take the common style."""
    import matplotlib

    return matplotlib.rc_context(STYLE)


def save(figure: Any, folder: Path, name: str) -> None:
    """Writes NAME.pdf, NAME.svg and NAME.png."""
    for kind in METADATA:
        (folder / f"{name}.{kind}").write_bytes(rendered(figure, kind))


@cache
def rendered(figure: Any, kind: str) -> bytes:
    """The figure as pdf, png, or svg without fonts of its own."""
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    buffer = BytesIO()
    with styled():
        if isinstance(figure.get_layout_engine(), ConstrainedLayoutEngine):
            figure.draw_without_rendering()
            figure.set_layout_engine("none")  # once found it stays, for that takes longest
        figure.savefig(buffer, format=kind, metadata=METADATA[kind])
    return buffer.getvalue()


def thin(*curves: Array) -> tuple[Array, ...]:
    """Every so-manieth sample of series (N, ...), to keep vector files small."""
    stride = max(1, len(curves[0]) // POINTS)
    return tuple(curve[::stride] for curve in curves)


def panel_label(axes: Any, text: str) -> None:
    """A bold letter or word at the upper left, outside the curves."""
    axes.set_title(text, loc="left", pad=3, fontweight="bold")


def legend_above(axes: Any, columns: int, handles: Sequence[Any] | None = None) -> None:
    """A legend in one line above the upper right corner."""
    options: dict[str, Any] = {"handles": handles} if handles else {}
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        columnspacing=1.0,
        handletextpad=0.5,
        borderpad=0.1,
        **options,
    )
