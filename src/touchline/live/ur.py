# SPDX-License-Identifier: Apache-2.0
"""`ur://HOST`: a Universal Robots arm, read over RTDE at up to 500 Hz."""

import time

import numpy as np

from touchline.errors import InputError
from touchline.live.rtde import PORT, Recipe, Rtde
from touchline.live.runner import Felt
from touchline.live.sample import Sample, make_sample, on_nanoseconds
from touchline.live.source import Address, LinkLost
from touchline.live.streams import Stream
from touchline.model.robot import Robot
from touchline.native import core
from touchline.pipeline.pipeline import Pipeline

FREQUENCY = 500.0  # Hz; that of an e-Series controller
JOINTS = 6
SILENCE = 2.0  # s after which a connection that still stands is given up
TIME, POSITION, VELOCITY = "timestamp", "actual_q", "actual_qd"
TORQUES, CURRENTS = "actual_current_as_torque", "actual_current"
RAW_WRENCH, TCP_FORCE = "ft_raw_wrench", "actual_TCP_force"


class UrArm:
    """A UR arm as a source.

    Torques are `actual_current_as_torque` [Nm]; where the description gives gains (Nm per ampere),
    or the controller has no such field, they are `actual_current` [A]. The wrench of the one sensor
    is `ft_raw_wrench`, and `actual_TCP_force` where the description says that the weight is taken
    out, or where there is no raw one.

    Args:
        address: `ur://HOST[:PORT]?frequency=500`.
        robot: with six joints, and one sensor at most.

    Raises:
        InputError: the robot cannot be a UR arm, or the address is none.
    """

    def __init__(self, address: Address, robot: Robot) -> None:
        address.only("frequency")
        self.name, self._robot = address.text, robot
        self._host, self._port = address.host(PORT)
        self._frequency = address.number("frequency", FREQUENCY, 1.0)
        if len(robot.joint_names) != JOINTS or len(robot.sensor_names) > 1:
            raise InputError(
                f"{address.text}: a UR arm has {JOINTS} joints and one sensor at most, but robot "
                f"{robot.name} has {len(robot.joint_names)} and {len(robot.sensor_names)}"
            )
        self.period: float | None = 1.0 / self._frequency
        self.streams = (Stream("rtde", self.period),)
        self._link: Rtde | None = None
        self._felt: Felt | None = None
        self._reader: core.RtdeReader | None = None
        self._first: float | None = None  # the first time stamp, from which samples are counted
        self._sequence = 0

    def _wanted(self) -> list[str]:
        fields = [TIME, POSITION, VELOCITY]
        if any(joint.measured for joint in self._robot.description.joints):
            fields += [TORQUES, CURRENTS]
        if self._robot.sensor_names:
            fields += [RAW_WRENCH, TCP_FORCE]
        return fields

    def open(self) -> list[str]:
        """Connects and lets the data come."""
        link = Rtde(self._host, self._port)
        try:
            recipe, missing = link.outputs(self._wanted(), self._frequency)
            notes = self._choose(recipe, missing)
            link.start()
        except BaseException:
            link.close()
            raise
        self._link, self._recipe, self._heard = link, recipe, time.monotonic()
        self._hand_over()
        return notes

    def _choose(self, recipe: Recipe, missing: list[str]) -> list[str]:
        """Which fields are used; what the user should know of that."""
        needed = [name for name in (TIME, POSITION, VELOCITY) if name in missing]
        if needed:
            raise InputError(f"{self.name}: the controller has no {', '.join(needed)}")
        description = self._robot.description
        notes: list[str] = []
        self._torque = self._wrench = None
        if any(joint.measured for joint in description.joints):
            gains = any(joint.gain != 1.0 for joint in description.joints)
            order = (CURRENTS, TORQUES) if gains else (TORQUES, CURRENTS)
            self._torque = _first_of(order, recipe.names, self.name)
            unit = "Nm" if self._torque == TORQUES else "A, times the gains of the description"
            notes.append(f"torques: {self._torque} [{unit}]")
            if self._torque == CURRENTS and not gains:
                raise InputError(
                    f"{self.name}: the controller has no {TORQUES}, only currents: give each "
                    "joint its `gain` in Nm per ampere"
                )
        if description.sensors:
            taken_out = description.sensors[0].compensated == "gravity"
            order = (TCP_FORCE, RAW_WRENCH) if taken_out else (RAW_WRENCH, TCP_FORCE)
            self._wrench = _first_of(order, recipe.names, self.name)
            notes.append(f"wrench of {description.sensors[0].name}: {self._wrench}")
            if self._wrench != order[0]:
                notes.append(
                    f"{order[0]} is not there: {self._wrench} has other axes and another zero; "
                    "see `frame` and `compensated`"
                )
        return notes

    def attach(self, pipeline: Pipeline) -> None:
        """From now on the link is read and the pipeline runs in native threads."""
        if self._felt is not None:  # another pipeline: the link begins anew with it
            self.close()
        self._felt = Felt(self._robot, pipeline)
        self._hand_over()

    def _hand_over(self) -> None:
        if self._link is None or self._felt is None:
            return
        layout = core.RtdeLayout()
        recipe = self._recipe
        layout.recipe, layout.size = recipe.number, recipe.size
        layout.time, layout.q = recipe.offset(TIME), recipe.offset(POSITION)
        layout.qd, layout.tau = recipe.offset(VELOCITY), recipe.offset(self._torque)
        layout.wrench = recipe.offset(self._wrench)
        layout.measured = [joint.measured for joint in self._robot.description.joints]
        layout.frequency, layout.first = self._frequency, self._first or 0.0
        self._reader = core.RtdeReader(self._felt.runner, *self._handed(layout))

    def _handed(self, layout: core.RtdeLayout) -> tuple[int, core.RtdeLayout, bytes]:
        assert self._link is not None
        number, begun = self._link.hand_over()
        return number, layout, begun

    def read(self, timeout: float) -> list[Sample]:
        """The samples that have come; with results where a pipeline is attached."""
        if self._link is None:
            raise LinkLost("the link begins anew")
        if self._felt is not None:
            return self._read_felt(self._felt, timeout)
        payloads = self._link.receive(timeout)
        now = time.monotonic()
        if payloads:
            self._heard = now
        elif now - self._heard > SILENCE:
            raise LinkLost(f"nothing came from {self._link.peer} for {SILENCE:g} s")
        found = (self._recipe.read(payload) for payload in payloads)
        return [self._sample(values, now) for values in found if values is not None]

    def _read_felt(self, felt: Felt, timeout: float) -> list[Sample]:
        """What the native threads have left."""
        assert self._link is not None and self._reader is not None
        found = felt.read(timeout)
        for sample in found:
            self._count(
                sample.time, sample.arrival, sample.sequence, bool(np.isfinite(sample.q).all())
            )
        self.streams[0].refused = felt.runner.refused
        if found:
            self._heard = found[-1].arrival
        elif self._reader.fault:
            raise LinkLost(f"{self._link.peer}: {self._reader.fault}")
        elif time.monotonic() - self._heard > SILENCE:
            raise LinkLost(f"nothing came from {self._link.peer} for {SILENCE:g} s")
        return found

    def _count(self, at: float, arrival: float, number: int, valid: bool) -> None:
        lost = max(number - self._sequence - 1, 0) if self.streams[0].received else 0
        self._sequence = number
        self.streams[0].receive(at, arrival, valid, lost)

    def _sample(self, values: dict[str, tuple[float, ...]], now: float) -> Sample:
        at = on_nanoseconds(values[TIME][0])
        if self._first is None:
            self._first = at
        number = round((at - self._first) * self._frequency)
        q = np.array(values[POSITION])
        self._count(at, now, number, bool(np.isfinite(q).all()))
        return make_sample(
            self._robot,
            at,
            q,
            values[VELOCITY],
            values[self._torque] if self._torque else None,
            values[self._wrench] if self._wrench else None,
            arrival=now,
            sequence=number,
        )

    def close(self) -> None:
        """Disconnects."""
        if self._reader is not None:
            self._reader.stop()
            self._reader = None
        if self._link is not None:
            self._link.close()
            self._link = None


def _first_of(names: tuple[str, ...], present: tuple[str, ...], source: str) -> str:
    for name in names:
        if name in present:
            return name
    raise InputError(f"{source}: the controller has none of {', '.join(names)}")
