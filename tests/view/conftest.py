# SPDX-License-Identifier: Apache-2.0
"""A simulated recording of a moving arm that is touched three times, analyzed."""

from types import SimpleNamespace

import pytest

import touchline as tl
from touchline.logs import write_table
from touchline.report.analysis import analyze
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.scenario import scripted, three_touches


def touches(robot):
    """Three places that can be told, one after the other."""
    found = three_touches(robot, speed=0.5, seconds=0.5)
    truth, row = found.truth, 300
    poses = robot.T_world_links(found.samples.q[row])
    contacts = []
    for slot in range(3):
        link = truth.links[truth.link[row, slot]]
        R, p = poses[link][:3, :3], poses[link][:3, 3]
        point, force = R.T @ (truth.point[row, slot] - p), R.T @ truth.force[row, slot]
        profile = Profile(0.3 + 0.6 * slot, hold=0.3)
        contacts.append(ScriptedContact(link, point, force, profile, force_frame="link"))
    return contacts


@pytest.fixture(scope="session")
def touched(tmp_path_factory):
    """Samples, log, folder of the results, and the analysis."""
    robot = tl.load_robot("sara")
    simulated = scripted(robot, touches(robot), 2.5, speed=0.5)
    folder = tmp_path_factory.mktemp("touched")
    truth = simulated.truth
    links = {"truth.links": list(truth.links)}
    log = folder / "log.parquet"
    write_table(log, simulated.samples, robot.description, links, truth.columns())
    analysis = analyze(folder / "log.parquet", "sara", folder / "results", report="none")
    return SimpleNamespace(
        samples=simulated.samples,
        truth=simulated.truth,
        log=folder / "log.parquet",
        out=folder / "results",
        analysis=analysis,
    )
