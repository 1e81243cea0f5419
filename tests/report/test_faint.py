# SPDX-License-Identifier: Apache-2.0
"""Touches below what can be felt are told, true and felt ones; others are not."""

import numpy as np
import pytest

import touchline as tl
from touchline.check.felt import Felt, felt
from touchline.cli import main
from touchline.logs.truth import TrueContact
from touchline.report.comparison import Comparison
from touchline.report.faint import MOST, faint_lines

ABLE = {
    "arm": Felt("arm", "base", 5.0, 2.0, 6),
    "foot": Felt("foot", None, np.inf, np.inf, 0),
}


def event(number, link, force):
    return tl.Event(
        id=number, segment="base", level="contact", detected=1.0, link=link, force_peak=force
    )


def true(link, force, found=None):
    time = np.array([2.0, 2.1])
    truth = TrueContact(link, time, np.zeros((2, 3)), np.tile([force, 0.0, 0.0], (2, 1)))
    return Comparison(truth, found, np.nan, np.nan)


def test_those_below_are_told_and_those_above_are_not():
    events = [event(0, "arm", 4.0), event(1, "arm", 6.0), event(2, None, 1.0)]
    lines = faint_lines(events, [true("arm", 3.0), true("arm", 9.0), true("foot", 50.0)], ABLE)
    assert lines == [
        "true touch at 2.00 s (not felt): 3.0 N on arm lies below what can be felt there: "
        "95 % are found from 5.0 N on",
        "true touch at 2.00 s (not felt): 50.0 N on foot lies below what can be felt there: "
        "many pushes on it load no sensor",
        "event 0: 4.0 N on arm lies below what can be felt there: 95 % are found from 5.0 N on",
    ]
    many = faint_lines([event(i, "arm", 1.0) for i in range(MOST + 4)], [], ABLE)
    assert len(many) == MOST + 1 and many[-1] == "4 more touches are as faint"


@pytest.mark.parametrize(("force", "told"), [(1.0, True), (20.0, False)])
def test_analyze_and_the_report_tell_them(tmp_path, capsys, force, told):
    log, out = str(tmp_path / "log.parquet"), tmp_path / "out"
    simulated = ["simulate", "base_touch", "--out", log, "--force", str(force)]
    assert main([*simulated, "--seconds", "0.6"]) == 0
    assert main(["analyze", log, "--robot", "sara", "--out", str(out)]) == 0
    (least,) = (one.force for one in felt(tl.load_robot("sara")) if one.link == "link0")
    assert (force < least) == told
    printed, page = capsys.readouterr().out, (out / "report.html").read_text()
    assert ("faint: true touch" in printed) == told == ("Below what can be felt" in page)
    assert "results: " in printed and "report.html" in printed
    assert main(["analyze", log, "--robot", "sara", "--out", str(out), "--report", "none"]) == 0
    assert "report.html" not in capsys.readouterr().out and not (out / "report.html").exists()
