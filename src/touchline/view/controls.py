# SPDX-License-Identifier: Apache-2.0
"""The live page's panel: what to do, what is felt, and what can be switched."""

from collections.abc import Callable, Sequence

import viser

from touchline.figure import FELT, TRUE
from touchline.reaction.reaction import REACTIONS
from touchline.view.arm import Conditions
from touchline.view.faults import FAULTS
from touchline.view.methods import METHODS

ADVICE = (
    "**Drag on the arm** to pull it, **click** on it to push it; "
    "drag beside it to look from elsewhere."
)
FELT_MARK = (
    f'<span style="color:{FELT}">&#9679;</span> felt, with line of action and uncertainty (2 sigma)'
)
LEGEND = f"""\
<div style="font-size:12px;padding:0 0.75em 0.5em">{FELT_MARK};
<b style="color:{TRUE}">&#9675;</b> true</div>"""
MOTIONS = {"stands": False, "moves": True}


class Controls:
    """The panel.

    Args:
        gui: of a viser server.
        push: makes a random push.
        release: takes all pushes away.
        methods: to choose from, of `METHODS`.
        faults: to choose from, of `FAULTS`.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        push: Callable[[], None],
        release: Callable[[], None],
        methods: Sequence[str] = tuple(METHODS),
        faults: Sequence[str] = tuple(FAULTS),
    ) -> None:
        gui.add_markdown(ADVICE)
        self.notice = gui.add_html("")
        self.readout = gui.add_html("")
        gui.add_html(LEGEND)
        self._force = gui.add_slider("Force [N]", 5.0, 60.0, 1.0, 25.0, hint="Of the next push.")
        self._keep = gui.add_checkbox(
            "Keep pulls", False, hint="A pull goes on when the mouse is released."
        )
        gui.add_button("Random push").on_click(lambda _: push())
        gui.add_button("Remove all pushes", color="gray").on_click(lambda _: release())
        self._motion = gui.add_dropdown("Arm", tuple(MOTIONS))
        self._reaction = gui.add_dropdown("When touched", tuple(REACTIONS))
        self._stiffness = gui.add_slider("Stiffness [%]", 5, 100, 5, 20)
        self._method = gui.add_dropdown("Method", tuple(methods))
        self._noise = gui.add_checkbox("Sensor noise", True)
        self._fault = gui.add_dropdown("Sensor fault", tuple(faults))
        self._payload = gui.add_slider(
            "Unknown load [kg]", 0.0, 1.0, 0.05, 0.0, hint="At the tool; the model lacks it."
        )

    def set(
        self,
        force: float | None = None,
        stiffness: float | None = None,
        moving: bool | None = None,
    ) -> None:
        """Sets the force of pushes [N], the stiffness [%], and whether the arm moves."""
        if force is not None:
            self._force.value = force
        if stiffness is not None:
            self._stiffness.value = int(stiffness)
        if moving is not None:
            self._motion.value = next(name for name, moves in MOTIONS.items() if moves == moving)

    @property
    def force(self) -> float:
        """Of the next push [N]."""
        return float(self._force.value)

    @property
    def keep(self) -> bool:
        """Whether pulls stay when the mouse is released."""
        return bool(self._keep.value)

    @property
    def method(self) -> str:
        """One of `METHODS`."""
        return self._method.value

    def conditions(self) -> Conditions:
        """As they are set now."""
        return Conditions(
            MOTIONS[self._motion.value],
            self._stiffness.value / 100.0,
            bool(self._noise.value),
            self._fault.value,
            float(self._payload.value),
            self._reaction.value,
        )
