"""`touchline simulate --help` names every scenario with the options that it has."""

import re

import pytest

from touchline.cli import main
from touchline.cli.simulate import simulate
from touchline.simulation.record import SCENARIOS, scenario_options


def test_help_tells_the_scenarios_and_their_options():
    told = dict(re.findall(r"^    (\w+) \((--[^)]*)\):", simulate.__doc__ or "", re.MULTILINE))
    assert told == {
        name: " ".join(f"--{key} {value:g}" for key, value in scenario_options(name).items())
        for name in SCENARIOS
    }


@pytest.mark.parametrize(("scenario", "option"), [("demo", "--force"), ("free_motion", "--force")])
def test_an_option_that_a_scenario_lacks_is_answered_with_those_it_has(
    tmp_path, capsys, scenario, option
):
    out = str(tmp_path / "log.csv")
    assert main(["simulate", scenario, "--out", out, option, "3"]) == 2
    message = capsys.readouterr().err
    assert f"has no option {option}" in message
    for name in re.findall(r"--\w+", message):
        assert name.lstrip("-") in ("force", "seconds", "speed")
