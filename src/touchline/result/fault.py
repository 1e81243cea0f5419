# SPDX-License-Identifier: Apache-2.0
"""Faults of channels: what one reports cannot be."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.model.description import AXES
from touchline.native import core
from touchline.result.kinds import Fault

FAULTS = tuple(Fault(name) for name in core.FAULTS)  # in the order of the core


@dataclass(frozen=True)
class ChannelFault:
    """A channel that is not believed.

    Attributes:
        channel: as in logs: "q.JOINT", "qd.JOINT", "tau.JOINT", "SENSOR.fx".
        fault: what is wrong with it.
        ratio: of its last step over what would be believed at once.
    """

    channel: str
    fault: Fault
    ratio: float


@dataclass(frozen=True)
class FaultChange:
    """A fault of a channel began, changed or, with `Fault.NONE`, ended.

    Attributes:
        sample: number of the sample in its recording, or in the part given to `Pipeline.run`.
        channel: as in logs.
        fault: from this sample on.
        ratio: of the channel's step over what would be believed at once.
    """

    sample: int
    channel: str
    fault: Fault
    ratio: float


def channel_names(joints: Sequence[str], sensors: Sequence[str]) -> tuple[str, ...]:
    """Names of all channels, in the order of the core."""
    signals = tuple(f"{kind}.{joint}" for kind in ("q", "qd", "tau") for joint in joints)
    return signals + tuple(f"{sensor}.{axis}" for sensor in sensors for axis in AXES)


def faults_of(numbers: Array, ratios: Array, names: Sequence[str]) -> tuple[ChannelFault, ...]:
    """The channels of a sample that are not believed; `numbers`, `ratios`: (channels,)."""
    return tuple(
        ChannelFault(names[c], FAULTS[int(numbers.item(c))], ratios.item(c))
        for c in np.flatnonzero(numbers).tolist()
    )


def changes_of(rows: Array, names: Sequence[str]) -> tuple[FaultChange, ...]:
    """From rows (N, 4) of the core: sample, channel, fault, ratio."""
    return tuple(
        FaultChange(int(sample), names[int(channel)], FAULTS[int(fault)], ratio)
        for sample, channel, fault, ratio in rows.tolist()
    )
