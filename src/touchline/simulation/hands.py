# SPDX-License-Identifier: Apache-2.0
"""Pushes that begin, change and end while the simulation runs, as a visitor's hands do."""

from dataclasses import dataclass, field

import numpy as np

from touchline.arrays import Array
from touchline.simulation.contacts import Forces, Touch, no_touch
from touchline.simulation.plant import Plant

RISE = 0.03  # s; no hand's force jumps
GONE = 0.05  # N; a released hand that weak has left
EASY, FASTEST = 0.7, 1.2  # m/s: a hand follows so fast with its full force, and with none
FELT = 1.0  # N; a contact begins with that much


@dataclass(eq=False)  # each hand is one of its own, whatever it does
class Hand:
    """One push or pull.

    A pull is felt like a push from the other side along the same line, and a finger can only push;
    so the place of contact may lie behind the point that is drawn.

    Attributes:
        link: that is touched.
        grip: (3,) point of the link through which the force passes, link frame [m].
        force: (3,) in link axes [N]; a hand with a target takes no heed of it.
        target: (3,) in world to which the grip is drawn [m]; None: a constant force.
        stiffness: of the spring to the target [N/m].
        limit: of its force [N].
        behind: how far behind the grip, against the force, the contact lies [m].
        pressed: the link on which it lies there; at first `link`.
        began: when the force first exceeded FELT [s].
        released: whether it is on its way off.
        acting: (3,) force in world [N].
    """

    link: str
    grip: Array
    force: Array = field(default_factory=lambda: np.zeros(3))
    target: Array | None = None
    stiffness: float = 200.0
    limit: float = 30.0
    behind: float = 0.0
    pressed: str = field(default="", init=False)
    began: float | None = field(default=None, init=False)
    released: bool = field(default=False, init=False)
    acting: Array = field(default_factory=lambda: np.zeros(3), init=False)
    _last: Array | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.pressed = self.link

    def wanted(self, T_world_link: Array) -> Array:
        """Force (3,) in world [N] at which it aims."""
        if self.released:
            return np.zeros(3)
        if self.target is None:
            return T_world_link[:3, :3] @ self.force
        force = self.stiffness * (self.target - place(T_world_link, self.grip))
        return force * min(1.0, self.limit / max(float(np.linalg.norm(force)), 1e-9))

    def follows(self, grip: Array, rate: float) -> float:
        """Share of its force that is left when the grip (3,) in world is there one step later."""
        way = np.zeros(3) if self._last is None else grip - self._last
        self._last = grip
        speed = float(way @ self.acting) * rate / max(float(np.linalg.norm(self.acting)), 1e-9)
        return min(max((FASTEST - speed) / (FASTEST - EASY), 0.0), 1.0)


class Hands(Forces):
    """All hands on the robot.

    Args:
        slots: how many there can be at once.
    """

    def __init__(self, slots: int = 6) -> None:
        super().__init__([no_touch("")] * slots)
        self.slots: list[Hand | None] = [None] * slots

    def active(self) -> list[Hand]:
        """Those that have not been released, the oldest first."""
        hands = [hand for hand in self.slots if hand is not None and not hand.released]
        return sorted(hands, key=lambda hand: hand.began if hand.began is not None else np.inf)

    def add(self, hand: Hand) -> None:
        """Puts a hand on the robot; where there is no room the oldest has to go."""
        self.slots[self._slot_for_another()] = hand

    def _slot_for_another(self) -> int:
        """An empty slot, else that of a hand on its way off, else that of the oldest."""
        if None in self.slots:
            return self.slots.index(None)
        leaving = [hand for hand in self.slots if hand is not None and hand.released]
        return self.slots.index((leaving or self.active())[0])

    def release_all(self) -> None:
        """Takes all hands away."""
        for hand in self.active():
            hand.released = True

    def acting(self, slot: int, plant: Plant) -> Touch | None:
        """What a hand does at the plant's present time."""
        hand = self.slots[slot]
        if hand is None:
            return None
        T = plant.link_pose(hand.link)
        wanted = hand.wanted(T) * hand.follows(place(T, hand.grip), plant.rate)
        hand.acting += (wanted - hand.acting) * (1.0 - np.exp(-1.0 / (plant.rate * RISE)))
        size = float(np.linalg.norm(hand.acting))
        if hand.began is None and size > FELT:
            hand.began = plant.time
        if hand.released and size < GONE:
            self.slots[slot] = None
            return None
        point = place(T, hand.grip) - hand.behind / max(size, 1e-9) * hand.acting
        return Touch(True, hand.pressed, point, hand.acting.copy(), np.zeros(3))


def place(T: Array, point: Array) -> Array:
    """A point (3,) in another frame, by the pose (4, 4) of its own frame in that."""
    return T[:3, :3] @ point + T[:3, 3]
