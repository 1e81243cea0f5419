# SPDX-License-Identifier: Apache-2.0
"""Plain Parquet tables, with the column names of the robot's description."""

from pathlib import Path

import numpy as np

from touchline.errors import InputError
from touchline.folder import replaced_file
from touchline.label.channel import LEVELS, Feeler, parts
from touchline.label.labelled import Labelled
from touchline.label.naming import Given
from touchline.logs.log import read_log
from touchline.logs.parquet import damages, first_line
from touchline.logs.period import typical_period
from touchline.model.robot import Robot

PREFIX = "touch."


def label_table(path: Path, robot: Robot, given: Given) -> Labelled:
    """Adds columns `touch.*` to a table, in place; links and levels are words there.

    Raises:
        InputError: it is damaged, or lacks what is needed.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    _refuse_part(path)
    samples = read_log(path, robot.description)
    period = 1.0 / given.rate if given.rate else typical_period(samples.time)
    feeler = Feeler(robot, period, given.bandwidth)
    channel = feeler.feel(samples)
    done = Labelled(1.0 / period)
    done.add(channel, len(samples) * period)
    try:
        table = pq.read_table(path)
    except damages() as error:  # in a column that is no signal of the robot
        raise InputError(f"{path}: damaged: {first_line(error)}") from error
    if table.num_rows != len(samples):
        raise InputError(f"{path}: {table.num_rows} rows, but {len(samples)} samples were read")
    table = table.drop_columns([n for n in table.column_names if n.startswith(PREFIX)])
    words = {"link": np.array([*feeler.links, None], object), "level": np.array(LEVELS, object)}
    for name, names in parts(robot).items():
        values = getattr(channel, name)
        if name in words:
            values = words[name][values]
        for i, part in enumerate(names):
            column = PREFIX + name + (f".{part}" if values.ndim == 2 else "")
            table = table.append_column(
                column, pa.array(values[:, i] if values.ndim == 2 else values)
            )
    with replaced_file(path) as draft:
        pq.write_table(table, draft)
    return done


def _refuse_part(path: Path) -> None:
    """A file of a LeRobot data set has arrays in its cells, and its rate stands beside it."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        schema = pq.read_schema(path)
    except damages():
        return  # told by the reader
    kinds = pa.types.is_list, pa.types.is_fixed_size_list
    arrays = [x.name for x in schema if any(is_kind(x.type) for is_kind in kinds)]
    if any(name.startswith("observation.") for name in arrays):
        raise InputError(
            f"{path}: seems one file of a LeRobot data set ({', '.join(arrays[:3])} are arrays); "
            "name the folder that holds meta/info.json"
        )
