# SPDX-License-Identifier: Apache-2.0
"""The summary names the channels that were not believed."""

import numpy as np

from touchline.report.faulty import MOST, FaultyChannels
from touchline.result.fault import FaultChange
from touchline.result.kinds import Fault


def test_faults_are_counted_over_parts():
    faulty = FaultyChannels()
    time = np.arange(1000) / 1000.0
    spike = FaultChange(900, "q.a", Fault.SPIKE, 2.0)
    wild = FaultChange(905, "q.a", Fault.WILD, 2.0)
    faulty.add(time, [FaultChange(10, "tau.b", Fault.SPIKE, 2.0), spike, wild])
    faulty.add(time + 1.0, [FaultChange(0, "tau.b", Fault.NONE, 0.0)])
    assert (
        faulty.lines()
        == faulty.lines()
        == [
            "q.a: not believed in 55 % of the samples, first at 0.900 s, most often wild",
            "tau.b: not believed in 49.5 % of the samples, first at 0.010 s, most often spike",
        ]
    )


def test_single_spikes_and_long_lists_are_not_told():
    faulty = FaultyChannels()
    few = [FaultChange(5, "tau.few", Fault.SPIKE, 2.0), FaultChange(6, "tau.few", Fault.NONE, 0.0)]
    many = [FaultChange(10, f"tau.{i}", Fault.STUCK, 2.0) for i in range(MOST + 2)]
    faulty.add(np.arange(2000) / 1000.0, [*few, *many])
    lines = faulty.lines()
    assert len(lines) == MOST + 1 and lines[-1] == "2 more channels were not believed"
    assert "few" not in "".join(lines)
