# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from logs_support import assert_same, describe, make_samples

from touchline.logs import open_log, read_log, write_table


@pytest.mark.parametrize("ending", ["parquet", "csv", "csv.gz"])
def test_round_trip(tmp_path, ending):
    samples, robot = make_samples(), describe()
    samples.tau[3, 1] = np.nan
    write_table(tmp_path / f"log.{ending}", samples, robot)
    assert_same(read_log(tmp_path / f"log.{ending}", robot), samples)


def test_metadata_and_truth(tmp_path):
    samples, robot = make_samples(), describe()
    links = {"links": ["a", "b"]}
    truth = {"truth.contact.0.x": np.ones(500)}
    write_table(tmp_path / "log.parquet", samples, robot, links, truth)
    with open_log(tmp_path / "log.parquet", robot) as log:
        assert log.metadata == links
        assert log.rows == 500
        assert log.duration == pytest.approx(0.499)
        assert "truth.contact.0.x" in log.columns
