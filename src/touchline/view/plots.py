# SPDX-License-Identifier: Apache-2.0
"""The segments' forces or moments over the last seconds, one plot each."""

import numpy as np
import viser
from viser import uplot

from touchline.figure import X, Y, Z
from touchline.view.history import SECONDS, History

COLOURS = (X, Y, Z)
HEIGHT = 160  # pixels
QUANTITIES = {"force": (0, "f", "N", 5.0), "moment": (3, "m", "Nm", 1.0)}


class WrenchPlots:
    """Plots in the page's panel, one for each segment.

    Args:
        gui: of a viser server.
        history: that they show.
    """

    def __init__(self, gui: viser.GuiApi, history: History) -> None:
        self._history = history
        self._quantity = gui.add_dropdown("Plot", tuple(QUANTITIES), initial_value="force")
        self._plots = {name: self._add(gui, name) for name in history.segments}
        self._shown = "force"

    def _add(self, gui: viser.GuiApi, segment: str) -> viser.GuiUplotHandle:
        return gui.add_uplot(
            self._history.curves(segment, 0),
            _series("force"),
            title=_title(segment, "force"),
            scales={"x": uplot.Scale(time=False, range=(-SECONDS, 0.0))},
            legend=uplot.Legend(live=False),
            axes=(uplot.Axis(size=38), uplot.Axis(size=44)),
            height=HEIGHT,
        )

    def refresh(self) -> None:
        """Draws what the history holds now."""
        quantity = self._quantity.value
        first, _, _, least = QUANTITIES[quantity]
        for segment, plot in self._plots.items():
            data = self._history.curves(segment, first)
            if quantity != self._shown:
                plot.series, plot.title = _series(quantity), _title(segment, quantity)
            size = np.nanmax(np.abs(np.array(data[1:])), initial=least)
            limit = 1.1 * float(np.ceil(size / least) * least)  # no number of the axis at its end
            plot.scales = {
                "x": uplot.Scale(time=False, range=(-SECONDS, 0.0)),
                "y": uplot.Scale(range=(-limit, limit)),
            }
            plot.data = data
        self._shown = quantity


def _series(quantity: str) -> tuple[uplot.Series, ...]:
    letter = QUANTITIES[quantity][1]
    lines = (
        uplot.Series(label=f"{letter}{axis}", stroke=colour, width=1.5)
        for axis, colour in zip("xyz", COLOURS, strict=True)
    )
    return (uplot.Series(label="time [s]"), *lines)


def _title(segment: str, quantity: str) -> str:
    about = "" if quantity == "force" else " about the base"
    return f"{segment}: {quantity} felt{about} [{QUANTITIES[quantity][2]}], last {SECONDS:g} s"
