# SPDX-License-Identifier: Apache-2.0
"""Makes the short recording that `touchline demo` analyzes: the sara arm, touched while it moves.

Run `python scripts/make_demo_recording.py` from the repository; the file it writes is committed.
"""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import touchline as tl
from touchline.logs.parquet import METADATA_KEY
from touchline.logs.tables import table_columns
from touchline.model.surface import link_surface
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.scenario import Run, SensorNoise, scripted

TARGET = Path(__file__).resolve().parents[1] / "src" / "touchline" / "recordings"
SECONDS, RATE, SPEED = 12.0, 250.0, 0.7
TOUCHES = (  # link, force [N], begin [s], held for [s]
    ("link2", 30.0, 1.5, 0.6),
    ("link4", 18.0, 3.5, 0.5),
    ("link6", 25.0, 5.5, 0.4),
    ("tool", 12.0, 7.5, 0.7),
    ("link3", 60.0, 9.5, 0.08),
)


def push(robot: tl.Robot, link: str, force: float, begin: float, hold: float) -> ScriptedContact:
    """A push along the inward normal, at the surface point that is farthest to one side."""
    surface = link_surface(robot.mechanism.links[link])
    if surface is None:
        raise ValueError(f"{link} has no surface")
    corners = surface.vertices[surface.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middles = corners.mean(axis=1)
    face = int(np.argmax(middles @ np.array([0.6, 0.8, 0.0])))
    inward = -normals[face] / np.linalg.norm(normals[face])
    profile = Profile(begin, hold, 0.04, 0.06)
    return ScriptedContact(link, middles[face], force * inward, profile, force_frame="link")


def main() -> None:
    """Write the recording, in single precision but for the time stamps."""
    robot = tl.load_robot("sara")
    contacts = [push(robot, *touch) for touch in TOUCHES]
    settings = Run(seed=3, rate=RATE, noise=SensorNoise())
    made = scripted(robot, contacts, SECONDS, SPEED, settings)
    columns = table_columns(made.samples, robot.description) | made.truth.columns()
    table = pa.table(
        {
            name: pa.array(values, pa.float64() if name == "time" else pa.float32(), None, True)
            for name, values in columns.items()
        }
    )
    names = ("link", "force", "begin", "held")
    touches = [dict(zip(names, touch, strict=True)) for touch in TOUCHES]
    metadata = json.dumps(made.metadata | {"touches": touches})
    TARGET.mkdir(exist_ok=True)
    path = TARGET / "sara_touched.parquet"
    table = table.replace_schema_metadata({METADATA_KEY: metadata})
    pq.write_table(
        table,
        path,
        compression="zstd",
        compression_level=19,
        use_byte_stream_split=True,
        use_dictionary=False,
    )
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
