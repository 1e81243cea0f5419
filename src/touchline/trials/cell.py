# SPDX-License-Identifier: Apache-2.0
"""What the localization benchmark varies from one line of its tables to the next."""

from dataclasses import dataclass, replace
from typing import Literal

Begin = Literal["apart", "together", "segments"]
Hands = Literal["steady", "trembling", "sliding"]


@dataclass(frozen=True)
class Cell:
    """What is varied.

    Attributes:
        arm: name of the arm.
        contacts: how many.
        tier: of noise.
        begin: of several: "apart" by 0.1 s, "together" at the same instant; "segments": one on
            each segment that begins at a six-axis sensor, all at the same instant.
        speed: of every joint [rad/s]; 0: at rest.
        alone: with "segments", the name of the only segment that is touched, at the same place of
            the same pose; "" for all of them.
        model_error: 1 sigma of the relative errors of the masses and inertias that the pipeline is
            told; the arm then swings, with `speed` at most.
        calibrated: is it calibrated on motion of the same arm without contact?
        hands: "steady" ones keep place and force; "trembling" ones change their force all the time;
            "sliding": the last contact slides, the others are held.
        lasts: how long steady hands touch an arm at rest after the last onset [s].
        force: how strong each touch is [N].
        period: between samples [s].
    """

    arm: str
    contacts: int = 1
    tier: int = 0
    begin: Begin = "apart"
    speed: float = 0.0
    alone: str = ""
    model_error: float = 0.0
    calibrated: bool = True
    hands: Hands = "steady"
    lasts: float = 0.1
    force: float = 20.0
    period: float = 1e-3

    @property
    def turning(self) -> bool:
        """Do forces turn with their links, on an arm in motion?

        Where the arm turns fast, a force that is constant in world soon leaves its friction cone;
        but contacts on one segment are told apart by forces that do not all change.
        """
        return self.contacts == 1 or self.begin == "segments"

    @property
    def timing(self) -> str:
        """How several contacts begin, in words."""
        if self.begin == "segments":
            return f"{self.alone} alone" if self.alone else "each segment"
        if self.contacts == 1:
            return "" if self.hands == "steady" else self.hands
        begin = "together" if self.begin == "together" else "0.1 s apart"
        return begin if self.hands == "steady" else f"{begin}, {self.hands}"

    @property
    def motion(self) -> str:
        """What the arm does, in words."""
        most = "up to " if self.model_error else ""
        motion = f"{most}{self.speed:g} rad/s" if self.speed else "at rest"
        if not self.model_error:
            return motion
        how = "" if self.calibrated else ", uncalibrated"
        return f"{motion}, {100 * self.model_error:g} % off{how}"

    def each_alone(self, segments: tuple[str, ...]) -> list["Cell"]:
        """The touches of this cell one at a time; nothing where there is but one."""
        return [replace(self, alone=name) for name in segments] if len(segments) > 1 else []
