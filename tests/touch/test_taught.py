# SPDX-License-Identifier: Apache-2.0
"""`touchline teach` from a recording and live, and who names what was taught: live and analyze."""

import json

import numpy as np
import pytest

import touchline as tl
from touchline.cli.main import main
from touchline.live.connection import Connection
from touchline.live.session import Session
from touchline.live.sources import make_source
from touchline.live.telling import touch_line
from touchline.localizer.skin import Skin
from touchline.logs import write_table
from touchline.model.yaml_file import read_yaml
from touchline.report.analysis import analyze
from touchline.trials.finger import find_pad, middle_of, press, signals_of

TIME = np.arange(0.0, 4.2, 1e-3)
BEGINS = (1.5, 2.4, 3.3)  # s; the first second is untouched, as a live robot's has to be


def arm_of(folder, sensors):
    """A robot file, without force-torque sensors if `sensors` is false; the robot, its surfaces."""
    source = tl.load_robot("sara" if sensors else "sara-full").description.path
    given = read_yaml(source)
    given["model"] = "robot:sara"
    if not sensors:
        del given["force_torque_sensors"]
        given["noise"] = {"tau": given["noise"]["tau"]}
    file = folder / "arm.yaml"
    file.write_text(json.dumps(given))
    robot = tl.load_robot(file)
    return file, robot, Skin(robot)


def touched(robot, skin, q, place, path, begins=BEGINS):
    """A log of presses at a place."""
    point, normal = middle_of(*place)
    fingers = [
        press(point, normal, place[0].link, TIME, begin, begin + 0.35, 8.0) for begin in begins
    ]
    rng = np.random.default_rng(0)
    write_table(path, signals_of(robot, q, fingers, TIME, 0.0, rng, rng), robot.description)
    return path


def lived(robot, log):
    """Events that ended, what people did, and lines that are told, of a live session."""
    ended, touches = [], []
    with Session(robot, Connection(make_source(f"replay://{log}?speed=0", robot))) as session:
        session.start()
        for news in session.run():
            ended += news.ended
            touches += news.touches
    return ended, touches


@pytest.mark.parametrize("sensors", [True, False], ids=["places", "torques"])
@pytest.mark.parametrize("how", ["log", "live"])
def test_what_is_taught_is_named_live_and_in_events_json(tmp_path, capsys, sensors, how):
    file, robot, skin = arm_of(tmp_path, sensors)
    rng = np.random.default_rng(6)
    q, *place = find_pad(skin, ("link3", "link4", "link5"), 0.07, 0.04, rng)
    other = find_pad(skin, ("link4", "link5"), 0.02, 0.02, np.random.default_rng(1), q)[1:]
    log = touched(robot, skin, q, place, tmp_path / "touches.parquet")
    source = ["--log", str(log)] if how == "log" else ["--live", f"replay://{log}?speed=0"]
    out = tmp_path / "taught.yaml"
    assert main(["teach", str(file), "--name", "go", *source, "--out", str(out)]) == 0
    assert "go: a button from 3 touches" in capsys.readouterr().out

    taught = tl.load_robot(out)
    assert bool(taught.description.interface["go"].taught) is not sensors
    for where, name in ((place, "go"), (other, None)):
        log = touched(taught, skin, q, where, tmp_path / f"{name}.parquet", BEGINS[:1])
        ended, touches = lived(taught, log)
        assert [event.widget for event in ended] == [name]
        presses = [event for event in touches if event.kind == "press"]
        assert [event.widget for event in presses] == ([name] if name else [])
        for event in presses:
            assert touch_line(event, 0.0).endswith("go: press")
            assert json.loads(json.dumps(event.as_json()))["widget"] == "go"
        analyze(log, str(out), tmp_path / f"results-{name}", report="none")
        told = json.loads((tmp_path / f"results-{name}" / "events.json").read_text())
        assert [event["widget"] for event in told] == [name]


def test_live_teaching_without_a_touch_is_one_clear_line(tmp_path, capsys):
    file, robot, skin = arm_of(tmp_path, True)
    q, *place = find_pad(skin, ("link4",), 0.02, 0.02, np.random.default_rng(0))
    log = touched(robot, skin, q, place, tmp_path / "nothing.parquet", ())
    arguments = ["teach", str(file), "--name", "go", "--out", str(tmp_path / "out.yaml")]
    assert main([*arguments, "--live", f"replay://{log}?speed=0"]) == 2
    assert "no touch" in capsys.readouterr().err
    assert main([*arguments, "--live", "replay://nowhere.parquet"]) == 2
    assert "nowhere.parquet" in capsys.readouterr().err
    assert main(arguments) == 2
    assert "--log LOG or --live SOURCE" in capsys.readouterr().err
    assert not (tmp_path / "out.yaml").exists()
