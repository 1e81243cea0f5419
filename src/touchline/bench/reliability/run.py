# SPDX-License-Identifier: Apache-2.0
"""`touchline bench reliability`: faults of each type on each channel, and what comes of them."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil
from pathlib import Path

import numpy as np

from touchline.bench.reliability.campaign import Part, run_all, spread
from touchline.bench.reliability.judge import Outcome, listen
from touchline.bench.tables import Row, aligned
from touchline.check.parity import parity_of
from touchline.folder import check_file, replaced_file
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.faults import FAULTS, SIGN_TO_DELAY, WANDERS
from touchline.trials.free_motion import FASTEST, SLOWEST
from touchline.trials.recordings import (
    EVERY,
    ROBOTS,
    prescribed_pushes,
    record_pushes,
    robot_named,
    robots,
)

TOLD, WRONG = 0.98, 0.005  # shares that are required
RECOVERED = 0.05 + 1e-6  # s: 5 / K of these arms, and what stamps are rounded by


@dataclass(frozen=True)
class Plan:
    """What to run.

    Attributes:
        seeds: motions and pushes of each arm.
        first: the first of their numbers.
        share: of the cases of each, drawn at random; 1: all.
        healthy: minutes of simulated motion without a fault, of each arm.
        hours: of motion along prescribed paths without a fault, and as many of a fast one, of all
            arms together.
        folder: keeps what is done, for another start to go on with; None: nothing is kept.
        processes: that work at a time.
    """

    seeds: int = 1
    share: float = 1.0
    healthy: float = 0.5
    hours: float = 0.0
    folder: Path | None = None
    processes: int = 1
    first: int = 0


def outcomes(plan: Plan) -> Iterator[Outcome]:
    """Of all cases of a plan."""
    seeds = range(plan.first, plan.first + plan.seeds)
    parts = [Part(name, seed, plan.share) for seed in seeds for name, _ in robots()]
    return run_all(parts, plan.folder, plan.processes)


@dataclass(frozen=True)
class Health:
    """What was said of healthy motion.

    Attributes:
        what: the kind of motion: "simulated", "prescribed", or "fast", for which there is no goal.
        hours: of it.
        pushes: in it.
        reports: what was said to be faulty; a line each.
    """

    what: str
    hours: float
    pushes: int
    reports: tuple[str, ...]


# Samples of an arm without a fault, and how many pushes there are, by seed and duration [s].
Recorder = Callable[[Robot, int, float], tuple[Samples, int]]


def healthy_motion(plan: Plan) -> tuple[Health, ...]:
    """The arms move without a fault, and are pushed every few seconds."""
    minutes = 60.0 * plan.hours / max(len(robots()), 1)
    return (
        _healthy(plan, "simulated", record_pushes, plan.healthy),
        _healthy(plan, "prescribed", prescribed_pushes, minutes),
        _healthy(plan, "fast", partial(prescribed_pushes, fastest=FASTEST), minutes),
    )


def _healthy(plan: Plan, what: str, recorder: Recorder, minutes: float) -> Health:
    """So many minutes of each arm, one with each seed."""
    seeds = range(1000 + plan.first, 1000 + plan.first + ceil(minutes))
    parts = [(name, seed) for name, _ in robots() for seed in seeds]
    seconds = 60.0 * min(minutes, 1.0)
    work = partial(_healthy_part, recorder=recorder, seconds=seconds)
    found = list(spread(work, parts, plan.processes)) if parts else []
    reports = tuple(line for _, lines in found for line in lines)
    hours = len(parts) * seconds / 3600.0
    return Health(what, hours, sum(pushes for pushes, _ in found), reports)


def _healthy_part(
    part: tuple[str, int], recorder: Recorder, seconds: float
) -> tuple[int, list[str]]:
    """Pushes, and what was said, of an arm and a seed."""
    name, seed = part
    pipeline = Pipeline(robot_named(name))
    samples, pushes = recorder(pipeline.robot, seed, seconds)
    listen(pipeline, samples)
    return pushes, [
        f"{name} seed {seed} at {samples.time[c.sample]:.3f} s: {c.channel} {c.fault}"
        for c in pipeline.faults
        if c.fault != "none"
    ]


def main(plan: Plan, out: Path | None = None) -> int:
    """Prints the tables; 1 where a goal is missed."""
    if out is not None:
        check_file(out, "--page")
    found = list(outcomes(plan))
    text, missed = tables(found, healthy_motion(plan))
    print(text)
    if out is not None:
        with replaced_file(out) as draft:
            draft.write_text(page(found, text), encoding="utf-8")
    return int(missed)


def tables(found: list[Outcome], healthy: Sequence[Health]) -> tuple[str, bool]:
    """Figures beside the goals, then by type of fault; whether a goal is missed."""
    untold = {name: untold_channels(robot_named(name)) for name in {o.robot for o in found}}
    goals = _goals(found, healthy, untold)
    rows: list[Row] = [("figure", "goal", "here", "")]
    rows += [(what, goal, here, "" if met else "missed") for what, goal, here, met in goals]
    lines = [aligned(rows, (0, 3))]
    if found:
        lines += ["", aligned(_by_fault(found)), "", *_layouts(untold)]
        lines += ["", aligned(_missed(found, untold), (0, 1, 2, 4))]
    reports = [line for motion in healthy for line in motion.reports]
    lines += ["", *reports[:20]] if reports else []
    return "\n".join(lines), not all(met for *_, met in goals)


def untold_channels(robot: Robot) -> tuple[str, ...]:
    """Channels whose errors the layout cannot tell from contacts, as `touchline check` lists them.

    Of a sensor with its axes swapped, that is so where it is so of all of its axes.
    """
    parity = parity_of(robot)
    names = [
        f"tau.{joint}" for joint in robot.joint_names if not parity.tells(f"torque of {joint}")
    ]
    for sensor in robot.description.sensors:
        axes = [f"{sensor.name}.{axis}" for axis in sensor.axes]
        lost = [axis for axis in axes if not parity.tells(axis)]
        names += [*lost, sensor.name] if lost == axes else lost
    return tuple(names)


def _is_untold(outcome: Outcome, untold: dict[str, tuple[str, ...]]) -> bool:
    """Is it a fault that only other channels can show, where none does?"""
    shown_by_others = outcome.fault.group in (SIGN_TO_DELAY, WANDERS)
    return shown_by_others and outcome.channel.name in untold[outcome.robot]


def _goals(
    found: list[Outcome],
    healthy: Sequence[Health],
    untold: dict[str, tuple[str, ...]],
) -> list[tuple[str, str, str, bool]]:
    """Figures, their goals, what is here, and whether that meets them; of what was run."""
    of_faults = _fault_goals(found, untold) if found else []
    return [*of_faults, *_healthy_goals(healthy), *_recovery_goals(found)]


def _fault_goals(
    found: list[Outcome], untold: dict[str, tuple[str, ...]]
) -> list[tuple[str, str, str, bool]]:
    count = len(found)
    crashes = sum(bool(o.crash) or not o.finite for o in found)
    goals = [(f"{count} runs: crash, exception, not finite", "0", str(crashes), crashes == 0)]
    groups: dict[str, list[Outcome]] = defaultdict(list)
    beyond: dict[str, list[Outcome]] = defaultdict(list)
    for o in found:
        (beyond if _is_untold(o, untold) else groups)[o.fault.group].append(o)
    for group in dict.fromkeys(fault.group for fault in FAULTS):
        if part := groups[group]:
            told = sum(o.told_in_time for o in part) / len(part)
            goal = 1.0 if group.startswith("absent") else TOLD
            what = f"told in time or harmless: {group}"
            goals.append((what, f"{100 * goal:.0f} %", f"{100 * told:.1f} %", told >= goal))
        if part := beyond[group]:
            told = sum(o.told_in_time for o in part) / len(part)
            what = f"  and in {len(part)} runs that the layout cannot tell"
            goals.append((what, "none", f"{100 * told:.1f} %", True))
    collisions = sum(o.collisions > 0 for o in found)
    goals.append(("runs with a phantom collision", "0", str(collisions), collisions == 0))
    wrong = sum(o.wrong > 0 for o in found) / count
    goals.append(("runs with a sure, wrong link", "0.5 %", f"{100 * wrong:.2f} %", wrong <= WRONG))
    return goals


def _healthy_goals(healthy: Sequence[Health]) -> list[tuple[str, str, str, bool]]:
    goals = []
    for motion in healthy:
        if not motion.hours:
            continue
        false, met = len(motion.reports), len(motion.reports) <= motion.hours / 10.0
        span = f"{motion.hours:.2f} h of {motion.what} motion"
        what = f"false reports in {span}, {motion.pushes} pushes"
        fast = motion.what == "fast"
        goals.append((what, "none" if fast else "1 in 10 h", str(false), fast or met))
    return goals


def _recovery_goals(found: list[Outcome]) -> list[tuple[str, str, str, bool]]:
    quick = [o.recovery for o in found if o.fault.group.startswith(("spike", "stuck", "absent"))]
    goals = []
    for what, part in (("median", 0.5), ("90 %", 0.9)) if quick else ():
        late = float(np.quantile(quick, part))
        name = f"recovery after the fault, {what}"
        goals.append((name, "50 ms", f"{1e3 * late:.0f} ms", late <= RECOVERED))
    return goals


def _by_fault(found: list[Outcome]) -> list[Row]:
    rows: list[Row] = [
        (
            *("fault", "runs", "told in time", "harmless", "median"),
            *("phantoms", "again", "weaker", "collisions", "wrong"),
        )
    ]
    groups: dict[str, list[Outcome]] = defaultdict(list)
    for o in found:
        groups[f"{o.fault.name}, {_signal(o)}"].append(o)
    for name, part in groups.items():
        told = [o.told for o in part if np.isfinite(o.told)]
        rows.append(
            (
                name,
                str(len(part)),
                f"{100 * sum(o.told <= o.fault.within for o in part) / len(part):.0f} %",
                f"{100 * sum(o.harmless for o in part) / len(part):.0f} %",
                f"{1e3 * np.median(told):.0f} ms" if told else "never",
                str(sum(o.phantoms > 0 for o in part)),
                str(sum(o.again > 0 for o in part)),
                str(sum(o.weaker > 0 for o in part)),
                str(sum(o.collisions > 0 for o in part)),
                str(sum(o.wrong > 0 for o in part)),
            )
        )
    return rows


def _layouts(untold: dict[str, tuple[str, ...]]) -> list[str]:
    """What each layout cannot tell."""
    lines = [
        "errors that a layout cannot tell from contacts or friction, as touchline check lists them:"
    ]
    return lines + [f"  {name}: {', '.join(untold[name]) or 'none'}" for name in sorted(untold)]


def _missed(found: list[Outcome], untold: dict[str, tuple[str, ...]]) -> list[Row]:
    """What was neither told in time nor harmless, by arm, type of fault and channel."""
    runs: Counter[tuple[str, str, str]] = Counter()
    missed: Counter[tuple[str, str, str]] = Counter()
    beyond = set()
    for o in found:
        key = (o.robot, o.fault.name, o.channel.name)
        runs[key] += 1
        missed[key] += not o.told_in_time
        if _is_untold(o, untold):
            beyond.add(key)
    rows: list[Row] = [("not told in time", "fault", "channel", "runs", "")]
    for key in sorted(key for key in missed if missed[key] > 0):
        note = "the layout cannot" if key in beyond else ""
        rows.append((*key, f"{missed[key]} of {runs[key]}", note))
    return rows


def _signal(outcome: Outcome) -> str:
    return outcome.channel.signal if outcome.channel.signal != "wrench" else "F/T"


def page(found: list[Outcome], text: str) -> str:
    """`docs/reliability.md`."""
    arms = ", ".join(f"`{name}`" for name in ROBOTS)
    return PAGE.format(
        arms=arms, count=len(found), every=EVERY, slowest=SLOWEST, fastest=FASTEST, text=text
    )


PAGE = """\
# Faults: what is told, and what comes of them

`touchline bench reliability --page FILE` writes this page. It puts faults into simulated recordings
and compares what is said with what is said without them. The arms are {arms}.
They swing at 0.5 rad/s, their inertias are 2 % off their models, and one of their outer links is
pushed with 25 N. The UR5 has a base and a wrist sensor and six joint torques, the Panda joint
torques alone. A fault begins in free motion, with the push, during it, or with its release. Of all
types, channels and phases {count} were drawn at random.

*In time* is the same sample for spikes and what is absent, 50 ms for what is stuck or wild, 1 s for
signs, scales and delays, 2 s for biases. *Harmless*: events are those without the fault. A
*phantom* is an event that is not among those. *Again*: phantoms that began during the push, which
was told twice or late. *Weaker*: a collision is told in time, but as a contact. A phantom
*collision* became one while nothing touched the arm, or where the healthy recording has no
collision. A *wrong* link is one that is at least 90 % sure, is not the touched one, and is not what
the healthy recording says either.

Healthy arms are pushed every {every:g} s with 8 to 40 N, for 0.2 to 1.2 s; each channel that is
told counts. In *simulated* motion they give way to a push (`--healthy`). In *prescribed* motion
they follow waves along a path whatever pushes them. That needs no engine, so hours are cheap
(`--hours`). *Fast* ones are prescribed, too, with {slowest:g} to {fastest:g} rad/s. There errors of
a model that nobody has calibrated exceed thresholds, and beside a push look like a faulty channel.

```
{text}
```

*Recovery* lasts from the fault's last sample until health is as without the fault. After 5/K, 50
ms, the estimates have forgotten what was left out. A wild channel is told for 10 usual samples
more, but the estimates begin with the first of these.

What a layout cannot tell, `touchline check ROBOT` lists as its parity space, and so does the table.
Of signs, scales, delays and biases these runs are counted apart. There an error looks like contacts
at the ends of segments, or like many pushes on one body: one that loads fewer than five signals.
Where no six-axis sensor checks joint torques, it looks like friction of that joint.

Scale, delay, bias and drift of one channel are told where they make it jump or stand still. They
are also told where that channel alone explains what a segment feels (`suspect`), or what it feels
beside contacts that are known. So are two swapped axes of a sensor, by what they differ by. Such a
channel is named, and nothing that it explains is a sure contact or a collision. It is left out of
what is estimated where a sensor inboard contradicts it.

A push does so where it passes near a sensor's axis. But a wrong sign, scale or delay is wrong by no
more than a few times what the channel carries. An axis that is wrong by more, where a contact
explains all as well, is told after 1.8 s; two axes that do not differ as swapped ones do, too.
So a push that is told as a fault is one along an axis that carries about as much. An error of less
than 0.3 of what a channel carries may be the model's. It has to last for 0.2 s. Where a push lets
go errors of the model alone are left. There a channel is told only if it is wrong by more than the
threshold of a contact. For two seconds a channel that is told does not count.

A joint and a sensor with no body between them must agree, but for friction that the joint has
shown. What they differ by begins no event, and one of the two is named. With joint torques alone
nothing of this is told: a push on the first link loads one joint, too. But where one steps alone
within a sample, nothing becomes a collision for a second. What a push does to the others for many
samples, as it comes or goes, does not count then. And where one joint alone makes a push a blow,
one force must explain all joints: else it is none.
What is left: an error that makes a push look stronger, and that a push elsewhere explains as well.
"""
