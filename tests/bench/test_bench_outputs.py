# SPDX-License-Identifier: Apache-2.0
"""A benchmark that cannot write its results says so before it works, not after."""

import pytest

from touchline.cli import main


@pytest.mark.parametrize(
    ("name", "option", "file"),
    [
        ("reliability", "--page", "page.md"),
        ("tuning", "--out", "tuning.json"),
        ("observer", "--output", "observer.json"),
        ("interface", "--picture", "digits.svg"),
        ("fuzz", "--keep", "found"),
        ("wrench", "--out", "tables"),
    ],
)
def test_a_place_that_cannot_be_written_is_told_at_once(name, option, file, tmp_path, capsys):
    (tmp_path / "file").write_text("mine")
    path = tmp_path / "file" / file
    assert main(["bench", name, option, str(path)]) == 2
    told = capsys.readouterr()
    assert str(path) in told.err and told.out == ""
