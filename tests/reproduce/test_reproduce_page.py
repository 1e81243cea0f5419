# SPDX-License-Identifier: Apache-2.0
"""The page of the experiments can be read by all, in light and dark."""

import pytest
from accessible import SCHEMES, WIDTHS, look, need_axe, serious

from touchline.figure import new_figure, styled
from touchline.reproduce.experiment import Check, Drawing, Experiment, Table
from touchline.reproduce.page import page_text


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    figure = new_figure(3.0, 2.0)
    with styled():
        figure.add_subplot().plot([0, 1, 0])
    rows = [{"method": "segment", "largest_force_error_of_all": 1.0 / (i + 1)} for i in range(80)]
    experiment = Experiment(
        "fig0",
        "A figure",
        "An arm is touched.",
        "It is felt.",
        "So it is.",
        drawings={"curve": Drawing(figure, "A curve.")},
        tables={"errors": Table("All errors [N].", rows)},
        checks=[Check("error [N]", 0.1, 1.0), Check("delay [ms]", 2.0, 1.0)],
    )
    path = tmp_path_factory.mktemp("page") / "index.html"
    path.write_text(page_text([experiment]), encoding="utf-8")
    return path


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
def test_axe_finds_nothing_serious(browser, page, width, scheme):
    need_axe()
    look(browser, width, scheme)
    browser.open(page.as_uri())
    assert serious(browser) == []
    ground = browser.run("getComputedStyle(document.body).backgroundColor")
    assert ground == ("rgb(255, 255, 255)" if scheme == "light" else "rgb(22, 24, 27)")
