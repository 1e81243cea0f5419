"""README and documentation: short, true, whole, and in plain English."""

import contextlib
import importlib.util
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from accessible import SCHEMES, WIDTHS, look, need_axe, serious
from prose import REPOSITORY, code, long_sentences
from prose_of_code import CPP, PYTHON, passages

from touchline.cli import main
from touchline.cli.bench import BENCHMARKS
from touchline.cli.main import COMMANDS
from touchline.health import Health
from touchline.logs.naming import LOG_KEYS
from touchline.model.meanings import MEANINGS, accepted_keys
from touchline.report.outputs import CONTACT_SCHEMA
from touchline.result.contact import Candidate
from touchline.result.native import EVENT

README = REPOSITORY / "README.md"
SCRIPT = REPOSITORY / "scripts" / "make_reference.py"
SARA = REPOSITORY / "src" / "touchline" / "robots" / "sara"
NAMES = (
    "index tutorial concepts routes glossary benchmarks contributing detection reaction experiments"
)
PLAIN = [
    README,
    REPOSITORY / "SECURITY.md",
    *(REPOSITORY / "docs" / f"{name}.md" for name in NAMES.split()),
]
PLAIN += sorted((REPOSITORY / "docs" / "howto").glob("*.md"))
SITE = [*PLAIN, *sorted((REPOSITORY / "docs" / "reference").glob("*.md"))]
MORE = "architecture calibration interface live localization reliability security changelog"
SITE += [REPOSITORY / "CHANGELOG.md"]
SITE += [REPOSITORY / "docs" / f"{name}.md" for name in MORE.split()]
NUMBER = re.compile(r"[-+]?\d+\.\d+")


def ids(page: Path) -> str:
    return str(page.relative_to(REPOSITORY))


def test_the_readme_is_short():
    assert len(README.read_text().splitlines()) <= 120


@pytest.mark.parametrize("page", SITE, ids=ids)
def test_no_sentence_is_longer_than_thirty_five_words(page):
    assert long_sentences(page.read_text()) == []


@pytest.mark.parametrize("files", [PYTHON, CPP], ids=["python", "cpp"])
def test_no_sentence_of_the_code_is_longer_than_thirty_five_words(files):
    assert files
    found = [
        f"{ids(path)}:{line}: {sentence}"
        for path in files
        for line, text in passages(path)
        for sentence in long_sentences(text)
    ]
    assert found == []


def test_prose_of_code_is_found_where_it_stands(tmp_path):
    path = tmp_path / "noun.py"
    path.write_text('# One.\n# Two.\nx = 1  # m\ny = f"three {x}" "four"  # s\n# five\n')
    assert passages(path) == [
        (4, "three Xfour"),
        (1, "One.\nTwo."),
        (3, "m"),
        (4, "s"),
        (5, "five"),
    ]
    path = tmp_path / "noun.hpp"
    path.write_text("// SPDX-License-Identifier: X\n// One.\n// Two.\nint x;  // [m]\n// three\n")
    assert passages(path) == [(2, "One.\nTwo."), (4, "[m]"), (5, "three")]


@pytest.mark.parametrize("page", PLAIN, ids=ids)
def test_links_and_pictures_are_there(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", [README, REPOSITORY / "docs" / "tutorial.md"], ids=ids)
def test_python_examples_print_what_stands_below_them(page):
    """A block of text that follows a block of Python is what it prints."""
    blocks = re.findall(r"^```(python|text)\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)
    compared = 0
    for i, (language, source) in enumerate(blocks):
        if language != "python":
            continue
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(source, str(page), "exec"), {})
        if i + 1 < len(blocks) and blocks[i + 1][0] == "text":
            told, done = blocks[i + 1][1], printed.getvalue()
            assert NUMBER.sub("#", done) == NUMBER.sub("#", told)
            numbers = [[float(x) for x in NUMBER.findall(text)] for text in (done, told)]
            assert numbers[0] == pytest.approx(numbers[1], rel=0.02, abs=0.003)
            compared += 1
    assert compared


def test_python_examples_of_other_pages_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for page in PLAIN:
        if page == README or page.name == "tutorial.md" or page.parent.name == "howto":
            continue
        for source in code(page.read_text(), "python"):
            exec(compile(source, str(page), "exec"), {})


def test_the_steps_of_the_tutorial(tmp_path, monkeypatch, capsys):
    """Every command, in the page's order, in a folder with the model and the page's YAML."""
    text = (REPOSITORY / "docs" / "tutorial.md").read_text()
    monkeypatch.chdir(tmp_path)
    shutil.copy(SARA / "sara.urdf", tmp_path)
    shutil.copytree(SARA / "meshes", tmp_path / "meshes")
    (block,) = code(text, "yaml")
    (tmp_path / "my-arm.yaml").write_text(block)
    commands = [line for block in code(text, "sh") for line in block.splitlines()]
    assert len(commands) >= 7
    for line in commands:
        program, *arguments = shlex.split(line)
        assert program == "touchline"
        assert main(arguments) in ((0, 1) if arguments[0] == "check" else (0,)), line
    assert (tmp_path / "results" / "report.html").exists()
    assert "what can be felt" in capsys.readouterr().out


SHORTER = {"--seconds 60": "--seconds 2 --rate 200", "--duration 6": "--duration 2"}


@pytest.mark.parametrize("name", ["calibrate", "live", "react", "interface"])
def test_the_steps_of_how_to_pages(name, tmp_path, monkeypatch, capsys):
    """All blocks in the page's order; only `calibrate`, which takes a minute, is left out."""
    text = (REPOSITORY / "docs" / "howto" / f"{name}.md").read_text()
    monkeypatch.chdir(tmp_path)
    printed = ""
    for language, block in re.findall(r"^```(\w+)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        if language == "yaml":
            (tmp_path / "my-arm.yaml").write_text(block)
        elif language == "sh" and block.startswith("touchline calibrate "):
            text = (SARA / "robot.yaml").read_text().replace("sara.urdf", "robot:sara")
            (tmp_path / "robot.yaml").write_text(text)
        elif language == "sh":
            for long, short in SHORTER.items():
                block = block.replace(long, short)
            for line in block.splitlines():
                program, *arguments = shlex.split(line)
                assert program == "touchline"
                assert main(arguments) in ((0, 1) if arguments[0] == "check" else (0,)), line
        elif language == "python":
            capsys.readouterr()
            exec(compile(block, name, "exec"), {})
            printed = capsys.readouterr().out
        else:
            assert printed == block


def written(page: str) -> str:
    """A page of the reference as scripts/make_reference.py writes it from the code."""
    spec = importlib.util.spec_from_file_location("reference", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.PAGES[page]()


def rows(page: str) -> dict[str, list[str]]:
    """Rows of the tables of a page by the name in their first cell."""
    found = {}
    for line in written(page).splitlines():
        if line.startswith("| `"):
            cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
            found[cells[0].strip("`")] = cells[1:]
    return found


def test_every_key_of_a_description_is_explained():
    places = {key.place for key in accepted_keys()} | {f"log.{name}" for name in LOG_KEYS}
    assert places == set(MEANINGS), "touchline/model/meanings.py explains every key, and no other"
    told = rows("robot_yaml.md")
    assert set(told) == places
    for kind, _, default, meaning in told.values():
        assert kind and default and meaning.endswith(".")


def test_every_column_of_the_results_is_explained():
    told = rows("results.md")
    names = {*CONTACT_SCHEMA, *(field.name for field in EVENT), *Candidate.__dataclass_fields__}
    assert names <= set(told)
    text = written("results.md")
    assert all(f"`{(bit.name or '').lower()}`" in text for bit in Health)
    for name in names:
        kind, _, meaning = told[name]
        assert kind and meaning.endswith(".")


def test_every_command_and_option_is_explained():
    text = written("command_line.md")
    for name in [*COMMANDS, *(f"bench {name}" for name in BENCHMARKS)]:
        assert f"## touchline {name}\n" in text
    arguments = [
        re.split(r"(?<!\\)\|", line)[1:-1] for line in text.splitlines() if line[:3] == "| `"
    ]
    assert len(arguments) > 150
    for name, kind, default, meaning in arguments:
        assert kind.strip() and default.strip() and meaning.strip().endswith((".", ")")), name


def columns_told(page: str) -> set[str]:
    """The names that the tables of a page explain, written out: `x.fx, .fy` are x.fx and x.fy."""
    found = set()
    for name in rows(page):
        first, *more = name.split(", ")
        base = first.rpartition(".")[0]
        found |= {first, *(base + part if part[0] == "." else part for part in more)}
    return found


def test_every_column_that_files_have_is_explained(tmp_path):
    """Of a simulated recording, of results, and of the tables of several recordings."""
    for name in ("one", "two"):
        options = ["--speed", "0.5", "--seconds", "0.6", "--out", str(tmp_path / f"{name}.parquet")]
        assert main(["simulate", "three_touches", *options]) == 0
    out = tmp_path / "results"
    logs = [str(tmp_path / f"{name}.parquet") for name in ("one", "two")]
    assert main(["analyze", *logs, "--robot", "sara", "--out", str(out), "--workers", "1"]) == 0
    told = {page: columns_told(page) for page in ("logs.md", "results.md")}
    joint, sensor, number = r"\.joint\d$", r"^(base|wrist|handle)\.", r"\.\d+\."
    checked = 0
    for file in tmp_path.rglob("*.parquet"):
        page = "logs.md" if file.parent == tmp_path else "results.md"
        for column in pq.read_schema(file).names:
            general = re.sub(number, ".K.", re.sub(joint, ".JOINT", column))
            general = re.sub(sensor, "SEGMENT." if ".seg." in column else "SENSOR.", general)
            assert general in told[page] or column in Health.__members__, f"{file.name}: {column}"
            checked += 1
    assert checked > 100
    for row in (out / "manifest.jsonl").read_text().splitlines():
        assert set(json.loads(row)) <= told["results.md"]
    assert set(json.loads((out / "one" / "analysis.json").read_text())) <= told["results.md"]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, and what building it said."""
    if importlib.util.find_spec("material") is None:
        assert not os.environ.get("CI"), "scripts/setup.sh installs the group docs"
        pytest.skip("pip install --group docs")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(folder)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder, done


def test_the_site_is_built_without_a_warning_and_loads_nothing_from_elsewhere(site):
    folder, done = site
    assert not re.search("not included in the .nav.", done.stderr), done.stderr
    page = (folder / "reference" / "python.html").read_text()
    assert "body_probability" in page and "load_robot" in page
    for file in folder.rglob("*.html"):
        loaded = re.findall(r'<(?:script|img|iframe)[^>]* src="(http[^"]*)"', file.read_text())
        assert loaded == []


@pytest.mark.parametrize("page", ["tutorial.html", "theory.html", "reference/python.html"])
def test_axe_finds_nothing_serious_on_the_site(browser, site, page):
    need_axe()
    for width, scheme in zip(WIDTHS, SCHEMES[::-1], strict=True):
        look(browser, width, scheme)
        browser.open((site[0] / page).as_uri())
        assert serious(browser) == []
        colours = {"light": "default", "dark": "slate"}[scheme]
        assert browser.run("document.body.dataset.mdColorScheme") == colours


def test_a_package_gets_the_address_it_is_published_from(tmp_path):
    for name in ("README.md", "pyproject.toml"):
        shutil.copy(REPOSITORY / name, tmp_path)
    (tmp_path / "examples").mkdir()
    script = [sys.executable, str(REPOSITORY / "scripts" / "put_address.py")]
    address = "https://code.example/arm/touchline"
    subprocess.run([*script, f"{address}/", "v0.1.0", str(tmp_path)], check=True)
    project = tomllib.loads((tmp_path / "pyproject.toml").read_text())["project"]
    assert project["urls"]["Homepage"] == address
    assert project["urls"]["Changelog"] == f"{address}/blob/v0.1.0/CHANGELOG.md"
    text = (tmp_path / "README.md").read_text()
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    assert targets and all(target.startswith(f"{address}/") for target in targets)
    assert f"({address}/raw/v0.1.0/docs/images/sara.png)" in text
    assert f"({address}/tree/v0.1.0/examples)" in text
    for given, told in ((address, b"has an address already"), ("here", b"no address like")):
        command = [*script, given, "v0.1.0", str(tmp_path)]
        refused = subprocess.run(command, check=False, capture_output=True)
        assert refused.returncode == 1 and told in refused.stderr
