# SPDX-License-Identifier: Apache-2.0
"""`touchline simulate`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from touchline.errors import InputError
from touchline.numbers import check_least, check_positive


def simulate(
    scenario: Annotated[Positional[str], arg(metavar="SCENARIO")],
    /,
    out: Annotated[Path, arg(metavar="LOG")],
    robot: Annotated[str, arg(metavar="ROBOT")] = "sara",
    seconds: Annotated[float | None, arg(metavar="S")] = None,
    speed: Annotated[float | None, arg(metavar="RAD/S")] = None,
    force: Annotated[float | None, arg(metavar="N")] = None,
    seed: int = 0,
    rate: Annotated[float, arg(metavar="HZ")] = 1000.0,
    physics: Annotated[float, arg(metavar="HZ")] = 4000.0,
    noise: bool = True,
    model_error: Annotated[float, arg(metavar="SHARE")] = 0.0,
) -> int:
    """Simulates a touched arm with MuJoCo; writes what its sensors report, and the truth.

    Example: touchline simulate three_touches --out touches.parquet --speed 0.5

    Scenarios, each with the options it has and their defaults:

    free_motion (--seconds 10 --speed 1): the arm moves and nothing touches it.

    three_touches (--speed 0 --force 20 --seconds 1): every segment is touched at the same time.

    base_touch (--speed 0 --force 20 --seconds 1): the innermost link, which no joint torque shows.

    singular_push (--force 20 --seconds 1): along a direction in which no joint can move the arm.

    colliding_pushers (--speed 0 --force 20): balls pressed against each segment in turn.

    random_pushes (--force 20): one push after the other, the arm moved in between.

    demo (--seconds 20): slow motion with several touches, as in `touchline demo`.

    The log can be analyzed like that of a real robot: the columns truth.* are never read by the
    estimator.

    Args:
        scenario: What happens; see above.
        out: The log: .parquet, .csv or .csv.gz.
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot.
        seconds: Duration [s]. Default: the scenario's.
        speed: Speed of the fastest joint [rad/s]; 0: the arm is held. Default: the scenario's.
        force: Force of each touch [N]. Default: the scenario's.
        seed: Seed of motions, places and noise.
        rate: Samples per second [Hz]; divides --physics.
        physics: Steps of the physics per second [Hz].
        noise: Whether sensors have the noise and quantization of ordinary ones.
        model_error: How far the simulated arm's inertias are off, as a share of them (1 sigma).
    """
    from touchline.logs import write_table
    from touchline.model.robot import load_robot
    from touchline.simulation.noise import SensorNoise
    from touchline.simulation.record import simulate_to_log
    from touchline.simulation.scene import Run

    given = {"seconds": seconds, "speed": speed, "force": force}
    options = {name: value for name, value in given.items() if value is not None}
    positive = {name: value for name, value in options.items() if name != "speed"}
    check_positive(rate=rate, physics=physics, **positive)
    check_least(0, seed=seed, speed=options.get("speed", 0.0))
    if not 0.0 <= model_error < 1.0:
        raise InputError(f"--model-error {model_error:g}: must be from 0 to below 1")
    if physics % rate:
        raise InputError(f"--rate {rate:g}: does not divide --physics {physics:g}")
    model = load_robot(robot)
    sensors = SensorNoise() if noise else None
    settings = Run(seed, rate, physics, noise=sensors, model_error=model_error)
    simulated = simulate_to_log(scenario, model, out, write_table, settings, options)
    truth = simulated.truth
    links = sorted({truth.links[i] for i in truth.link.flat if i >= 0})
    touched = f"touched: {', '.join(links)}" if links else "nothing touches the arm"
    print(f"{out}: {len(simulated.samples)} samples at {rate:g} Hz of {model.name}; {touched}")
    return 0
