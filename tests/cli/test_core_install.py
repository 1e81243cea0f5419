"""What works with numpy, PyYAML and cattrs alone: an arm is read, observed and located on."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.special import chdtrc, chdtri, ndtri

from touchline.detector.chi_square import beyond, chi_square_limit, normal_limit

EXTRAS = ("mujoco", "trimesh", "scipy", "pyarrow", "rosbags", "matplotlib", "viser", "PIL")
WITHOUT = f"""
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {EXTRAS!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
"""
PUSH = """
import numpy as np
import touchline as tl
from touchline.localizer.skin import Skin
from touchline.observer.dynamics import contact_loads, gravity_loads

robot = tl.load_robot("sara")
q = np.full(7, 0.4)
skin = Skin(robot)
(entry, *_) = [c for c in skin.crossings(q, [2.0, 0.1, 0.6], [-1.0, 0.0, 0.0]) if c.entry]
push = -20.0 * entry.normal
rest = gravity_loads(robot, q)
loads = contact_loads(robot, q, entry.link, np.r_[push, np.cross(entry.position, push)])
pipeline = tl.Pipeline(robot)
for i in range(600):
    on = i > 400
    tau, wrench = rest.torque - on * loads.torque, rest.wrench - on * loads.wrench
    result = pipeline.update(1e-3 * i, q, np.zeros(7), tau, wrench)
(contact,) = result.contacts
assert contact.link == entry.link, (contact.link, entry.link)
assert np.linalg.norm(contact.position - entry.position) < 1e-3
assert abs(np.linalg.norm(contact.force) - 20.0) < 0.1
print("felt")
"""


def run(code: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-c", WITHOUT + code]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_an_arm_is_felt_without_any_extra():
    done = run(PUSH)
    assert done.stdout == "felt\n", done.stderr


@pytest.mark.parametrize(
    ("arguments", "status", "told"),
    [
        (["check", "sara"], 0, ""),
        (
            ["simulate", "demo", "--out", "x.csv"],
            1,
            "mujoco is not installed: pip install 'touchline[sim]'",
        ),
        (["analyze", "x.parquet", "--robot", "sara", "--out", "x"], 1, "'touchline[logs]'"),
        (["demo"], 1, "'touchline[view]'"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_commands_name_the_extra_that_they_need(arguments, status, told, tmp_path):
    (tmp_path / "x.parquet").write_bytes(b"PAR1")
    done = run(
        f"import os; os.chdir({str(tmp_path)!r})\n"
        f"from touchline.cli import main; sys.exit(main({arguments!r}))"
    )
    assert done.returncode == status, done.stderr
    assert told in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize("degrees", [*range(1, 8), 13, 24, 39])
def test_chi_square_limits_are_those_of_scipy(degrees):
    for x in (1e-6, 0.1, 1.0, 5.0, 30.0, 400.0):
        assert beyond(x, degrees) == pytest.approx(chdtrc(degrees, x), rel=1e-10)
    for p in (0.5, 0.1, 1e-3, 1e-9, 1e-15):
        assert chi_square_limit([degrees], p) == pytest.approx(chdtri(degrees, p), rel=1e-9)


def test_normal_limits_are_those_of_scipy():
    p = np.array([0.3, 1e-3, 1e-9, 1e-12])
    assert normal_limit(p) == pytest.approx(-ndtri(p), rel=1e-9)
