# SPDX-License-Identifier: Apache-2.0
"""Tables: formats, foreign names, and everything that can be wrong with a file."""

import gzip

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from logs_support import assert_same, describe, make_samples

from touchline.errors import InputError
from touchline.logs import open_log, read_log, write_table
from touchline.model.description import JointDescription, SensorDescription

ENDINGS = ["parquet", "csv", "csv.gz"]
COLUMNS = "time,q.j1,q.j2,qd.j1,qd.j2,tau.j1,tau.j2"
ROBOT = describe(2, ())


def write_csv(path, *lines, header=COLUMNS):
    text = "\n".join([header, *lines]) + "\n"
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def write_table_as_text(table, path):
    import pyarrow.csv

    pyarrow.csv.write_csv(table, path)


def rows(count, first=0):
    return [",".join(f"{(first + i) * 0.001 + j}" for j in range(7)) for i in range(count)]


def problems(path, robot=ROBOT):
    with pytest.raises(InputError) as caught:
        read_log(path, robot)
    assert str(path) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("ending", ENDINGS)
def test_round_trip(tmp_path, ending):
    samples, robot = make_samples(5000), describe()
    samples.tau[3, 1] = np.nan
    samples.wrench[7, 0] = np.nan
    samples.tau[9, 0] = np.inf
    write_table(tmp_path / f"log.{ending}", samples, robot)
    assert_same(read_log(tmp_path / f"log.{ending}", robot), samples)
    with open_log(tmp_path / f"log.{ending}", robot) as log:
        assert log.progress == 0.0 and log.warnings == []
        assert [len(chunk) for chunk in log.chunks(2000)] == [2000, 2000, 1000]
        assert log.progress == 1.0
        assert [chunk.row for chunk in log.chunks(2000)] == [0, 2000, 4000]  # again


@pytest.mark.parametrize("ending", ENDINGS)
def test_missing_velocities_in_every_format(tmp_path, ending):
    robot = describe()
    write_table(tmp_path / "log.parquet", make_samples(5000), robot)
    table = pq.read_table(tmp_path / "log.parquet").drop_columns(["qd.j2"])
    path = tmp_path / f"log.{ending}"
    if ending == "parquet":
        pq.write_table(table, path)
    else:
        import pyarrow.csv as arrow_csv

        with pa.output_stream(str(path), compression="detect") as stream:
            arrow_csv.write_csv(table, stream)
    with open_log(path, robot) as log:
        assert log.progress == 0.0
        (chunk,) = log.chunks()
        assert log.progress == 1.0
        assert log.warnings[0].startswith(f"{path}: no velocities of j2: estimated")
    np.testing.assert_array_equal(chunk.qd[:, 0], make_samples(5000).qd[:, 0])
    np.testing.assert_allclose(chunk.qd[:, 1], make_samples(5000).qd[:, 1], atol=1e-4)


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
    with pytest.raises(InputError, match="only Parquet keeps metadata"):
        write_table(tmp_path / "log.csv", samples, robot, links)
    with pytest.raises(InputError, match="ends in .parquet"):
        write_table(tmp_path / "log.txt", samples, robot)


def test_torques_that_are_not_measured_are_not_read(tmp_path):
    joints = [JointDescription("j1"), JointDescription("j2", torque="from", sources=("base",))]
    path = write_csv(tmp_path / "log.csv", *rows(4))
    samples = read_log(path, describe(joints, ()))
    assert np.isfinite(samples.tau[:, 0]).all() and np.isnan(samples.tau[:, 1]).all()


def test_axes_of_a_sensor(tmp_path):
    sensor = SensorDescription("hand", "link", axes=("fz", "mx"))
    path = write_csv(
        tmp_path / "log.csv", "0,0,0,0,7,8", header="time,q.j,qd.j,tau.j,hand.fz,hand.mx"
    )
    samples = read_log(path, describe(["j"], [sensor]))
    np.testing.assert_array_equal(samples.wrench[0, 0], [np.nan, np.nan, 7.0, 8.0, np.nan, np.nan])


def test_foreign_dialects(tmp_path):
    path = tmp_path / "log.csv"
    header = COLUMNS.replace(",", " ; ").replace("time", '"time"')
    body = "\r\n".join([header, "0; 1;2;3;NaN;;6 ", "", "1;1;2;3;4;nan;null"])
    path.write_bytes(b"\xef\xbb\xbf" + body.encode() + b"\r\n")
    samples = read_log(path, ROBOT)
    np.testing.assert_array_equal(samples.time, [0.0, 1.0])
    np.testing.assert_array_equal(samples.qd, [[3.0, np.nan], [3.0, 4.0]])
    np.testing.assert_array_equal(samples.tau, [[np.nan, 6.0], [np.nan, np.nan]])


def test_integers_and_nulls_in_parquet(tmp_path):
    columns = {name: pa.array([1, None, 3]) for name in COLUMNS.split(",")}
    pq.write_table(pa.table(columns), tmp_path / "log.parquet")
    np.testing.assert_array_equal(read_log(tmp_path / "log.parquet", ROBOT).time, [1, np.nan, 3])


FORMS = ["nanoseconds.parquet", "nanoseconds.csv", "dates.parquet", "milliseconds.parquet"]


@pytest.mark.parametrize("form", FORMS)
def test_stamps_that_are_no_seconds(tmp_path, form):
    samples, path = make_samples(5000), tmp_path / form
    write_table(tmp_path / "log.parquet", samples, describe())
    table, unit = pq.read_table(tmp_path / "log.parquet"), 10**6 if "milli" in form else 1
    stamps = np.round(samples.time * 1e9).astype(np.int64) + 1_700_000_000_000_000_000
    column = pa.array(stamps // unit)
    column = column.cast(pa.timestamp("ns", "UTC")) if "dates" in form else column
    table = table.set_column(table.column_names.index("time"), "time", column)
    pq.write_table(table, path) if path.suffix == ".parquet" else write_table_as_text(table, path)
    with open_log(path, describe()) as log:
        (part,) = log.chunks(5000)
        told = any("'time' is taken as nanoseconds: the median step" in w for w in log.warnings)
        assert told == form.startswith("nano") and part.qd.shape == samples.qd.shape
        if log.duration is not None and unit == 1:
            assert log.duration == pytest.approx(np.ptp(samples.time), abs=1e-5)
    true = (samples.time - samples.time[0]) * (1.0 if unit == 1 else 1e3)  # told by `check`
    near = 1e-6 if unit == 1 else 2.0
    np.testing.assert_allclose(part.time - part.time[0], true, atol=near)


def test_a_factor_that_is_given_counts_for_nanoseconds_too(tmp_path):
    robot = describe(2, (), log={"time": {"column": "time", "factor": 2e-9}})
    write_csv(tmp_path / "log.csv", *(f"{i * 1000000},0,0,0,0,0,0" for i in range(9)))
    with open_log(tmp_path / "log.csv", robot) as log:
        (part,) = log.chunks()
        assert log.warnings == [] and part.time[-1] == pytest.approx(0.016)


@pytest.mark.parametrize("ending", ["csv", "csv.gz"])
@pytest.mark.parametrize("row", [3, 41234])
def test_cell_that_is_no_number(tmp_path, ending, row):
    lines = rows(50000)
    lines[row] = lines[row].rsplit(",", 1)[0] + ",1.2.3"
    text = problems(write_csv(tmp_path / f"log.{ending}", *lines))
    assert f"row {row} (line {row + 2}), column 'tau.j2': '1.2.3' is not a number" in text


@pytest.mark.parametrize("cell", ["+", "+x", "++1", '"+x"', " +"])
def test_a_sign_alone_is_no_number(tmp_path, cell):
    lines = rows(10)
    lines[3] = lines[3].rsplit(",", 1)[0] + "," + cell
    text = problems(write_csv(tmp_path / "log.csv", *lines))
    assert "row 3 (line 5), column 'tau.j2'" in text and "is not a number" in text


def test_ragged_row(tmp_path):
    lines = rows(10)
    lines[4] = lines[4] + ",7"
    text = problems(write_csv(tmp_path / "log.csv", *lines))
    assert "row 4 (line 6) has 8 cells; the header has 7" in text
    lines[4] = "1,2"
    text = problems(write_csv(tmp_path / "log.csv", *lines))
    assert "row 4 (line 6) has 2 cells; the header has 7" in text


def test_last_line_cut_off(tmp_path):
    path = write_csv(tmp_path / "log.csv", *rows(10))
    path.write_bytes(path.read_bytes()[:-30])
    with open_log(path, ROBOT) as log:
        (chunk,) = log.chunks()
        assert "last line (after row 9) is incomplete" in log.warnings[0]
    assert len(chunk) == 9


def test_missing_final_newline_is_no_cut(tmp_path):
    path = write_csv(tmp_path / "log.csv", *rows(10))
    path.write_bytes(path.read_bytes()[:-1])
    with open_log(path, ROBOT) as log:
        assert [len(chunk) for chunk in log.chunks()] == [10]
        assert log.warnings == []


@pytest.mark.parametrize("keep", [0.3, 0.9, 0.9999])
def test_cut_off_gzip(tmp_path, keep):
    path = write_csv(tmp_path / "log.csv.gz", *rows(20000))
    whole = read_log(path, ROBOT)
    path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])
    with open_log(path, ROBOT) as log:
        (part,) = log.chunks()
        assert f"after row {len(part)} " in log.warnings[0]
    assert 0.2 * len(whole) < len(part) <= len(whole)
    np.testing.assert_array_equal(part.tau, whole.tau[: len(part)])


def test_damaged_gzip(tmp_path):
    path = write_csv(tmp_path / "log.csv.gz", *rows(20000))
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 50] = bytes(50)
    path.write_bytes(bytes(data))
    try:
        with open_log(path, ROBOT) as log:
            assert sum(len(chunk) for chunk in log.chunks()) < 20000
            assert "damaged after row" in log.warnings[0]
    except InputError as error:  # what came out of the damaged part was no table
        assert "row" in str(error)


def test_cut_off_or_damaged_parquet(tmp_path):
    path = tmp_path / "log.parquet"
    write_table(path, make_samples(5000), describe())
    data = path.read_bytes()
    path.write_bytes(data[:-100])
    assert "cut off before its footer" in problems(path, describe())
    middle = len(data) // 2
    path.write_bytes(data[:middle] + bytes(2000) + data[middle + 2000 :])
    assert "damaged after row 0" in problems(path, describe())


@pytest.mark.parametrize("ending", ENDINGS)
def test_empty_and_missing_files(tmp_path, ending):
    path = tmp_path / f"log.{ending}"
    assert "no such file" in problems(path)
    path.write_bytes(b"")
    assert "the file is empty" in problems(path)


def test_tables_without_rows(tmp_path):
    assert "no rows below the header" in problems(write_csv(tmp_path / "log.csv"))
    path = write_csv(tmp_path / "cut.csv.gz", *rows(10))
    path.write_bytes(path.read_bytes()[:20])
    assert "empty" in problems(path)
    table = pa.table({name: pa.array([], pa.float64()) for name in COLUMNS.split(",")})
    pq.write_table(table, tmp_path / "log.parquet")
    assert "no rows" in problems(tmp_path / "log.parquet")


def test_unknown_kind_of_file(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("hello")
    text = problems(path)
    assert ".parquet, .csv, .csv.gz" in text and ".db3, .mcap" in text


def test_text_that_is_no_table(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"\xff\xfe\x00\x01 binary \n")
    assert "not a text file" in problems(path)
    path.write_text("1.0,2.0\n3.0,4.0\n")
    assert "numbers, not column names" in problems(path)


def test_missing_columns_with_a_hint(tmp_path):
    path = write_csv(tmp_path / "log.csv", "0,1", header="Time,q.J1")
    text = problems(path)
    assert "missing column 'time' (did you mean 'Time'?)" in text
    assert "missing column 'q.j1' (did you mean 'q.J1'?)" in text
    assert "no joint torques: none of tau.j1, tau.j2 is there" in text
    assert "columns present: Time, q.J1" in text
    assert "qd" not in text


def test_a_hint_is_no_column_of_another_joint(tmp_path):
    header = COLUMNS.replace("q.j2", "q.jnt2", 1)
    text = problems(write_csv(tmp_path / "log.csv", *rows(3), header=header))
    assert "missing column 'q.j2' (did you mean 'q.jnt2'?)" in text


def test_one_missing_torque(tmp_path):
    header = COLUMNS.replace("tau.j2", "torque2")
    text = problems(write_csv(tmp_path / "log.csv", *rows(3), header=header))
    assert "missing column 'tau.j2'" in text and "no joint torques" not in text
    assert text.endswith("; joints without a torque signal have `torque: none`")


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_column_that_occurs_twice(tmp_path, ending):
    header = COLUMNS + ",q.j1"
    path = tmp_path / f"log.{ending}"
    if ending == "csv":
        write_csv(path, *(f"{line},1" for line in rows(3)), header=header)
    else:
        arrays = [pa.array([1.0]) for _ in header.split(",")]
        pq.write_table(pa.Table.from_arrays(arrays, names=header.split(",")), path)
    assert "column 'q.j1' occurs 2 times" in problems(path)


def test_unused_columns_may_hold_anything(tmp_path):
    header = "x," + COLUMNS + ",x"
    path = write_csv(tmp_path / "log.csv", *(f"a b,{line},c" for line in rows(3)), header=header)
    assert len(read_log(path, ROBOT)) == 3


def test_column_of_words_in_parquet(tmp_path):
    columns = {name: pa.array([1.0]) for name in COLUMNS.split(",")}
    columns["q.j1"] = pa.array(["one"])
    pq.write_table(pa.table(columns), tmp_path / "log.parquet")
    assert "column 'q.j1' holds string, not numbers" in problems(tmp_path / "log.parquet")


def test_real_panda(data):
    log = {"q": "q{i}", "qd": "dq{i}", "tau": "tau_J{i}"}
    robot = describe([f"panda_joint{i + 1}" for i in range(7)], (), log)
    files = sorted((data / "panda_touches").glob("*.csv.gz"))
    assert len(files) == 8
    for file in files:
        samples = read_log(file, robot)
        assert len(samples) > 2900
        assert np.isfinite(samples.q).all() and np.isfinite(samples.tau).all()
        assert np.median(np.diff(samples.time)) == pytest.approx(0.005, rel=0.02)
        # It holds a pose in which joints 2 and 4 carry the arm.
        assert np.abs(samples.tau).mean(axis=0).argmax() == 1


def test_real_kinova(data):
    log = {
        "time": {"column": "Time", "factor": 0.001},
        "q": "Position{i1}",
        "qd": "Velocity{i1}",
        "tau": "TorqueSm{i1}",
    }
    joints = [f"joint_{i + 1}" for i in range(7)]
    for file in sorted((data / "kinova_gen3").glob("*.csv")):
        samples = read_log(file, describe(joints, (), log))
        assert np.median(np.diff(samples.time)) == pytest.approx(0.001)
        # The estimates agree with the robot's own, except where a position was logged twice.
        with open_log(file, describe(joints, (), log | {"qd": "none{i1}"})) as opened:
            estimated = np.concatenate([chunk.qd for chunk in opened.chunks(500)])
            assert "estimated" in opened.warnings[0]
        difference = np.median(np.abs(estimated - samples.qd), axis=0)
        assert np.all(difference < 0.04 * np.std(samples.qd, axis=0))
