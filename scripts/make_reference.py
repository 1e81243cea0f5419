# SPDX-License-Identifier: Apache-2.0
"""Writes docs/reference from the code: robot.yaml, logs, results, commands and tuning.

    python scripts/make_reference.py [--check]

With --check nothing is written; the exit status is 1 if a page is old.
"""

import inspect
import json
import re
import sys
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path

from touchline.cli.bench import BENCHMARKS
from touchline.cli.explained import default_text, explanation, types_of
from touchline.cli.main import COMMANDS
from touchline.health import HEALTH_MEANING, Health
from touchline.model.learned_rest import LARGEST
from touchline.model.meanings import MEANINGS, accepted_keys
from touchline.report.outputs import CONTACT_SCHEMA
from touchline.result.contact import Candidate, Contact
from touchline.result.event import Event
from touchline.result.native import CONTACT
from touchline.result.standing import Standing
from touchline.tuning import DEFAULTS

REPOSITORY = Path(__file__).parents[1]
FOLDER = REPOSITORY / "docs" / "reference"
DETAIL = REPOSITORY / "core" / "include" / "touchline" / "detail"
SENSITIVITY = REPOSITORY / "benchmarks" / "tuning.json"
NOTE = "<!-- Written by scripts/make_reference.py; changes by hand are lost. -->\n\n"
TYPES = {
    "f8": "number",
    "i8": "whole number",
    "u4": "whole number",
    "str": "text",
}
OWN = {  # columns that are no field of a contact
    "time": ("number", "s", "Time stamp of the sample."),
    "health": ("whole number", "", "Sum of the health bits below; 0 when all is well."),
}
LOG_COLUMNS = [
    (
        "time",
        "number",
        "s",
        "required",
        "Time stamp; it need not begin at 0. Dates are read, too, and nanoseconds, which is told.",
    ),
    ("q.JOINT", "number", "rad or m", "required", "Position of an observed joint."),
    ("qd.JOINT", "number", "rad/s or m/s", "estimated from q", "Velocity."),
    ("tau.JOINT", "number", "Nm or N", "required", "Torque, as `joints[].torque` says."),
    ("SENSOR.fx, .fy, .fz", "number", "N", "required", "Force, in the sensor's frame."),
    ("SENSOR.mx, .my, .mz", "number", "Nm", "required", "Moment about its origin."),
    ("truth.contact.K.link", "whole number", "", "none", "Link in `truth.links`; of a simulation."),
    ("truth.contact.K.x, .y, .z", "number", "m", "none", "Place in world; of a simulation."),
    ("truth.contact.K.fx, .fy, .fz", "number", "N", "none", "Force in world; of a simulation."),
    ("truth.contact.K.mx, .my, .mz", "number", "Nm", "none", "Twist of a grasp; of a simulation."),
    ("arrival", "number", "s", "none", "When the sample came, by the recorder's clock."),
    ("sequence", "whole number", "", "none", "Number of the sample at its source."),
    ("SENSOR.age", "number", "s", "none", "How much older its wrench was than the sample."),
]
REST = [  # of `learned_rest`; one row is one node of a joint's table
    ("joint", "text", "", "Name of an observed joint."),
    ("q", "number", "rad or m", "Its position at the node."),
    ("qd", "number", "rad/s or m/s", "Its velocity there."),
    ("torque", "number", "Nm or N", "What the torque has beside the model."),
    ("doubt", "number", "Nm or N", "1 sigma of that."),
]
POSTURES = [
    ("time", "number", "s", "Time stamp of the sample."),
    ("q.JOINT", "number", "rad or m", "Position of an observed joint."),
]
ANALYSIS = [
    ("touchline", "text", "", "Version that made the results."),
    ("log", "text", "", "Where the recording was."),
    ("robot", "text", "", "Robot, as it was named."),
    ("method", "text", "", "Method of the observer: `segment` or `paper`."),
    ("bandwidth", "number", "rad/s", "What `--bandwidth` gave; null: as described."),
    ("period", "number", "s", "Sample period that thresholds were made for."),
    ("friction", "number", "", "Coefficient of friction that pushes were looked for with."),
    ("reach", "number", "m", "Free space that pushes were given."),
    ("start", "number", "s", "Time of the first sample."),
    ("end", "number", "s", "Time of the last sample."),
    ("samples", "whole number", "", "Number of samples."),
    ("watch", "by segment", "", "How many samples were `watched`, `degraded` and `blind`."),
    ("findings", "list of text", "", "What the first samples show to be wrong."),
    ("standing", "list", "", "Signals that are not as told: offsets and noise, see below."),
    ("tuning", "by name", "", "The numbers of [tuning](tuning.md) that were used."),
]
TABLES = {
    "contacts": [
        ("robot", "text", "", "Name of the robot."),
        ("date", "text", "", "Day in UTC, or `undated`."),
        ("recording", "text", "", "Name of the recording's folder."),
        ("hour", "whole number", "h", "Hour of the day, or since the first sample."),
        ("id", "whole number", "", "Number of the event in its recording."),
        ("segment", "text", "", "Name of the segment."),
        ("link", "text", "", "Link that was touched; null where not known."),
        ("level", "text", "", "`contact` or `collision`."),
        ("status", "text", "", "What is known of the place, as in `events.json`."),
        ("detected", "number", "s", "Time at which the test fired."),
        ("cleared", "number", "s", "Time at which it ended; null: it lasts to the end."),
        ("lasted", "number", "s", "Time between these two."),
        ("force_peak", "number", "N", "Largest force."),
        ("torque_peak", "number", "Nm", "Largest external torque on `joint`."),
        ("joint", "text", "", "The most distal loaded joint."),
        ("clamped", "true or false", "", "Whether forces on two sides opposed each other."),
        ("x, y, z", "number", "m", "Place in world; null where not known."),
    ],
    "health": [
        ("robot, date, recording, hour", "", "", "As above."),
        ("samples", "whole number", "", "Samples in that hour."),
        ("healthy", "whole number", "", "Samples with health 0."),
        ("BIT", "whole number", "", "Samples with that health bit: `SETTLING`, `GAP` and so on."),
    ],
    "joints": [
        ("robot, date, recording, hour", "", "", "As above."),
        ("joint", "text", "", "Name of the joint."),
        (
            "quiet",
            "whole number",
            "",
            "Samples without a remark or contact; what follows is of these.",
        ),
        ("nan", "whole number", "", "Samples in which the external torque is not known."),
        ("torque_mean", "number", "Nm or N", "Mean external torque."),
        ("torque_rms", "number", "Nm or N", "Its root mean square."),
        ("torque_largest", "number", "Nm or N", "Its largest size."),
    ],
    "segments": [
        ("robot, date, recording, hour", "", "", "As above."),
        ("segment", "text", "", "Name of the segment."),
        (
            "quiet",
            "whole number",
            "",
            "Samples without a remark or contact; what follows is of these.",
        ),
        ("nan", "whole number", "", "Samples in which the force is not known."),
        ("force_p50, force_p95, force_p99", "number", "N", "Percentiles of the external force."),
    ],
}
MANIFEST = [
    ("name", "text", "", "Folder of its results, below the folder given with `--out`."),
    ("log", "text", "", "Path or address of the recording."),
    ("robot", "text", "", "Robot, as it was named."),
    ("status", "text", "", "`ok`, `partial`, `failed` or `skipped`."),
    ("reason", "text", "", "Why it is not `ok`."),
    ("content", "text", "", "Hash of the recording."),
    ("configuration", "text", "", "Hash of robot, options and version."),
    ("touchline", "text", "", "Version that made the results."),
    ("bytes", "whole number", "", "Size of the recording."),
    ("samples", "whole number", "", "Samples read."),
    ("flagged", "whole number", "", "Samples with any health bit."),
    ("duration", "number", "s", "From the first sample to the last."),
    ("events", "whole number", "", "Number of events."),
    ("collisions", "whole number", "", "How many of them are collisions."),
    ("faint", "list of text", "", "Touches below what is surely felt on their link."),
    ("outputs", "by file", "", "Hash of each file of the results."),
    ("seconds", "number", "s", "Time that the analysis took."),
    ("cpu_seconds", "number", "s", "CPU time that it took."),
    ("memory_mb", "number", "MB", "Largest memory of its process."),
]
ESTIMATES = [
    ("time", "number", "s", "Time stamp of the sample."),
    ("health", "whole number", "", "Sum of the health bits below."),
    ("tau_ext.JOINT", "number", "Nm or N", "External torque of a joint; null where not known."),
    ("SENSOR.ext.fx, .fy, .fz", "number", "N", "External force on all outboard, sensor's frame."),
    ("SENSOR.ext.mx, .my, .mz", "number", "Nm", "External moment about the sensor's origin."),
    ("SEGMENT.seg.fx, .fy, .fz", "number", "N", "External force on the segment alone, in world."),
    ("SEGMENT.seg.mx, .my, .mz", "number", "Nm", "External moment about the world's origin."),
]


FURTHER = {  # that a docstring tells in passing
    "body": "the rigid body that the link belongs to",
    "position_std": "square root of the covariance's trace [m]",
    "unknowns": "how many unknowns stand against `rank`: two for each place, three for each force",
    "degrees": "degrees of freedom of `chi2`",
}


def attributes(cls: type) -> dict[str, str]:
    """What the docstring of a class says of each attribute."""
    text = inspect.cleandoc(cls.__doc__ or "").partition("Attributes:\n")[2]
    found: dict[str, str] = {}
    name = ""
    for line in text.splitlines():
        match = re.match(r"^    (\w+): (.*)$", line)
        if match:
            name = match[1]
            found[name] = match[2]
        elif line.strip() and name:
            found[name] += " " + line.strip()
    return found


def unit_of(meaning: str) -> str:
    """The unit in brackets."""
    match = re.search(r"\[([^\]]+)\]", meaning)
    return match[1] if match else ""


def plain(meaning: str) -> str:
    """The meaning without its unit and shape, as a sentence."""
    text = re.sub(r"\s*\[[^\]]+\]", "", meaning)
    text = re.sub(r"^\((\d+(, \d+)?),?\)\s*", "", text).strip()
    text = text.rstrip(".")
    return text[:1].upper() + text[1:] + "."


def table(head: str, rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown; a bar within a cell is escaped."""
    names = head.split("|")
    lines = [f"| {' | '.join(names)} |", f"|{'---|' * len(names)}"]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def robot_yaml() -> str:
    """Every key of robot.yaml."""
    defaults = {key.place: key.default for key in accepted_keys()}
    defaults |= {place: "-" for place in MEANINGS if place not in defaults}  # those of `log`
    rows = []
    for place, default in defaults.items():
        kind, unit, meaning = MEANINGS[place]
        rows.append([f"`{place}`", kind, unit, "required" if default is None else default, meaning])
    return (
        "# robot.yaml\n\n"
        + NOTE
        + "A robot description is a YAML file. Only `model` is required. Unknown keys are refused; "
        "all errors of a file are told at once. `[]` stands for an item of a list, NAME for a "
        "name. The default `-` means: not given.\n\n"
        "`touchline init MODEL LOG --out robot.yaml` writes a first one with comments.\n\n"
        + table("key|type|unit|default|meaning", rows)
        + "\nA *column* is a name, or `{column: NAME, factor: F}` where values times F are in SI "
        "units. A *column pattern* is the same with placeholders; a list has one column for each "
        "joint or axis.\n"
    )


def learned_rest() -> str:
    """Columns of the tables that `calibrate --learn` writes."""
    return (
        "# NAME_rest.csv\n\n"
        + NOTE
        + "`touchline calibrate --learn` writes what it learned of joint torques into a CSV file "
        "beside [robot.yaml](robot_yaml.md), which names it under `learned_rest`. The columns "
        "stand in this order.\n\n"
        + table("column|type|unit|meaning", [[f"`{name}`", *more] for name, *more in REST])
        + f"\nThe nodes of a joint are a grid of positions and velocities, {LARGEST} at most, and "
        "at least two by two. Between nodes the torque is bilinear. On the edges of the grid it "
        "must be 0, and beyond them it is 0. A joint without rows has no table.\n"
    )


def logs() -> str:
    """Columns and topics of logs."""
    return (
        "# Logs\n\n"
        + NOTE
        + "A table is Parquet, CSV or CSV.gz, with one row per sample. Other column names are "
        "given under `log` in [robot.yaml](robot_yaml.md). Columns that are not listed here are "
        "left alone. Those from `arrival` on are written by `touchline live --record`. Joints "
        "with `torque: none` and axes that a sensor lacks need no column. An empty cell "
        "is not measured. A signal slower than the rows must be interpolated to them; in a "
        "rosbag2 this is done.\n\n"
        + table(
            "column|type|unit|if missing|meaning", ([f"`{c}`", *rest] for c, *rest in LOG_COLUMNS)
        )
        + "\nA rosbag2 recording (MCAP or sqlite3) has these topics:\n\n"
        + table(
            "type|holds",
            [
                ["`sensor_msgs/msg/JointState`", "position, velocity and effort, by joint name"],
                ["`geometry_msgs/msg/WrenchStamped`", "one topic for each sensor"],
            ],
        )
        + "\nTime is `header.stamp`; where that is 0 the receive time is used, with a warning. "
        "Rates may differ, and clocks may jitter.\n"
    )


def meaning_of_fields() -> dict[str, tuple[str, str]]:
    """Unit and meaning of each column of contacts.parquet, from the fields of `Contact`."""
    known = FURTHER | attributes(Contact)
    found = {}
    for field in CONTACT:
        meaning = known[field.name]
        for column in field.columns:
            if column in CONTACT_SCHEMA:
                unit = unit_of(meaning)
                if field.name == "wrench":
                    unit = "Nm"
                part = f"`{field.name}`: " if len(field.columns) > 1 else ""
                found[column] = (unit, part + plain(meaning))
    return found


def results() -> str:
    """Files that analyze writes."""
    meanings = meaning_of_fields()
    rows = []
    for column, kind in CONTACT_SCHEMA.items():
        if column in OWN:
            rows.append([f"`{column}`", *OWN[column]])
        else:
            unit, meaning = meanings[column]
            rows.append([f"`{column}`", TYPES[kind], unit, meaning])
    event = FURTHER | attributes(Event)
    events = [
        [f"`{f.name}`", kind_of(f.type), unit_of(event[f.name]), plain(event[f.name])]
        for f in fields(Event)
    ]
    candidate = [
        ["`link`", "text", "", "Link of the place."],
        ["`body`", "text", "", "Rigid body that the link belongs to."],
        ["`probability`", "number", "", "How likely this place is, 0 to 1."],
        ["`position`", "list of 3 numbers", "m", "The place in world."],
        [
            "`radius`",
            "number",
            "m",
            "Radius of the part of the link that it stands for; missing for a single place.",
        ],
    ]
    assert {row[0].strip("`") for row in candidate} == {f.name for f in fields(Candidate)}
    health = [
        [str(int(bit)), f"`{(bit.name or '').lower()}`", plain(HEALTH_MEANING[bit])]
        for bit in Health
    ]
    return (
        "# Results\n\n"
        + NOTE
        + "`touchline analyze LOG --robot ROBOT --out DIR` writes these files. What cannot be "
        "computed is null in Parquet and JSON.\n\n"
        "## estimates.parquet\n\nOne row per sample.\n\n"
        + described("column", ESTIMATES)
        + "\n## contacts.parquet\n\nOne row per contact and sample.\n\n"
        + table("column|type|unit|meaning", rows)
        + "\n## events.json\n\nA list, in the order of detection. Missing values are null.\n\n"
        + table("key|type|unit|meaning", events)
        + "\nEach of `candidates`:\n\n"
        + table("key|type|unit|meaning", candidate)
        + "\n## Health bits\n\n"
        + table("bit|name|meaning", health)
        + "\n## report.html\n\nThe page with pictures and curves. It needs no network.\n"
        + "\n## postures.parquet\n\nHow the arm stood, 100 times a second at most.\n\n"
        + described("column", POSTURES)
        + "\n## analysis.json\n\nWhat the results were made from, for `touchline view`.\n\n"
        + described("key", ANALYSIS)
        + "\nEach of `standing`:\n\n"
        + described("key", standing())
        + "\n## Several recordings\n\nEach has a folder with the files above. Beside these folders "
        "stand the page `fleet.html`, the file `manifest.jsonl` and the folder `tables`. In "
        "`log.jsonl` each run adds a line when it is done with a recording.\n\n"
        "### manifest.jsonl\n\nOne line of JSON per recording.\n\n"
        + described("key", MANIFEST)
        + "".join(
            f"\n### tables/{name}\n\nParquet, in folders by robot and date.\n\n"
            + described("column", rows)
            for name, rows in TABLES.items()
        )
    )


def described(head: str, rows: Iterable[Iterable[str]]) -> str:
    """A table of names with type, unit and meaning."""
    return table(f"{head}|type|unit|meaning", ([f"`{name}`", *rest] for name, *rest in rows))


def standing() -> list[list[str]]:
    """The keys of an entry of `standing`."""
    told = attributes(Standing)
    return [
        [f.name, kind_of(f.type), unit_of(told[f.name]), plain(told[f.name])]
        for f in fields(Standing)
    ]


def kind_of(annotation: object) -> str:
    """A Python type in words."""
    text = str(annotation)
    for part, word in (
        ("ndarray", "list of 3 numbers"),
        ("tuple", "list"),
        ("bool", "true or false"),
        ("float", "number"),
        ("int", "whole number"),
        ("str", "text"),
    ):
        if part in text:
            return word
    return "text"


def command_line() -> str:
    """Every command with its arguments, from its docstring and signature."""
    parts = [
        "# Command line\n\n"
        + NOTE
        + "Every command takes a ROBOT as a robot.yaml, a URDF, an MJCF, a xacro, or a "
        "name. Exit status: 0 done, 1 failure (`check`: findings), 2 bad input. "
        "`touchline COMMAND --help` prints the same.\n"
    ]
    for name, command in COMMANDS.items():
        parts.append(_command(name, command))
        if name == "bench":
            parts += [_command(f"bench {n}", benchmark) for n, benchmark in BENCHMARKS.items()]
    return "\n".join(parts)


def _command(name: str, command) -> str:
    told, types = explanation(command), types_of(command)
    rows = []
    for key, parameter in inspect.signature(command).parameters.items():
        positional = parameter.kind is inspect.Parameter.POSITIONAL_ONLY
        shown = key.upper() if positional else f"--{key.replace('_', '-')}"
        empty = parameter.default is inspect.Parameter.empty
        default = "required" if empty else default_text(parameter.default)
        rows.append([f"`{shown}`", types[key], default, told.meanings.get(key, "")])
    about = [re.sub(r"^Example: ", "    ", paragraph) for paragraph in told.about]
    listing = "\n\n" + table("argument|type|default|meaning", rows) if rows else "\n"
    return f"## touchline {name}\n\n" + "\n\n".join(about) + listing


MODULES = {  # in the order of a sample's way
    "gates": "Is what a channel reports possible?",
    "observer": "Wrenches of segments, torques of joints.",
    "detector": "Is a segment touched?",
    "place": "Where one force explains what is measured, and how sure that is.",
    "localizer": "One or several contacts on a segment, over time.",
    "classifier": "Contact or collision, clamped or free.",
    "events": "From contacts to events.",
}
MEMBER = re.compile(r"^  (?:double|int) (\w+) = ([^;]+);$")


def tuning_numbers(module: str) -> Iterable[tuple[str, str, str]]:
    """Heading, name and comment of each member of a module's tuning."""
    path = DETAIL / module / "tuning.hpp"
    heading, comment, ended = "", "", True
    for line in path.read_text().splitlines():
        if match := re.match(r"^  // -+ (.+?) -+$", line):
            heading, comment = match[1], ""
        elif match := re.match(r"^  // (.+)$", line):
            comment = match[1] if ended else f"{comment} {match[1]}"
            ended = False
        elif match := MEMBER.match(line):
            yield heading, match[1], comment
            ended = True


def tuning() -> str:
    """Every number that the estimation is tuned with."""
    measured = json.loads(SENSITIVITY.read_text())["numbers"] if SENSITIVITY.exists() else {}
    parts = [
        "# Tuning\n\n"
        + NOTE
        + "Every number that is neither physics nor a robot's own is a member of "
        "`touchline::Tuning`. `print(tl.Tuning())` lists all of them, `analysis.json` records "
        "those in use, and `tl.Pipeline(robot, tuning={NAME: VALUE})` changes some. The defaults "
        "serve all robots: a robot's own thresholds come from `touchline calibrate`.\n\n"
        "The text says what is to be expected of half and of double. The last two columns say "
        "what they did: see [below](#what-was-measured).\n"
    ]
    for module, about in MODULES.items():
        parts.append(f"\n## {module}\n\n{about}\n")
        rows: dict[str, list[list[str]]] = {}
        before = ""
        for heading, name, comment in tuning_numbers(module):
            full = f"{module}.{name}"
            unit = "" if DEFAULTS.unit(full) == "1" else DEFAULTS.unit(full)
            effects = measured.get(full, {})
            text = "as above" if comment == before else comment
            before = comment
            cells = [effects.get("half", "-"), effects.get("double", "-")]
            rows.setdefault(heading, []).append(
                [f"`{name}`", f"{DEFAULTS[full]:g}", unit, text, *cells]
            )
        for heading, lines in rows.items():
            title = f"\n### {heading}\n\n" if heading else "\n"
            parts.append(title + table("number|default|unit|meaning|half|double", lines))
    return "".join(parts) + _measured()


def _measured() -> str:
    if not SENSITIVITY.exists():
        return "\n## What was measured\n\nNothing yet: `touchline bench tuning`.\n"
    found = json.loads(SENSITIVITY.read_text())
    return (
        "\n## What was measured\n\n"
        "`touchline bench tuning --out benchmarks/tuning.json` has run these recordings with each "
        "number halved and doubled, one at a time:\n\n"
        + "".join(f"* {line}\n" for line in found["recordings"])
        + "\nWith the defaults: "
        + found["default"]
        + ".\n\nThe columns tell what has become different of that. `=` means that not one event "
        "has changed in any way. `~` means that events have changed, but none of these figures "
        "by a step that counts. `-`: not tried. A small benchmark shows what is "
        "touchy, not what is best: a number without an effect here may matter on a real robot, "
        "for other layouts, or for faults that do not occur here.\n\n" + found["summary"] + "\n"
    )


PAGES = {
    "tuning.md": tuning,
    "robot_yaml.md": robot_yaml,
    "learned_rest.md": learned_rest,
    "logs.md": logs,
    "results.md": results,
    "command_line.md": command_line,
}


def main() -> int:
    """Write the pages, or check them."""
    old = 0
    for name, page in PAGES.items():
        path, text = FOLDER / name, page()
        if path.exists() and path.read_text() == text:
            continue
        old += 1
        if "--check" in sys.argv:
            print(f"{path} is old: python scripts/make_reference.py")
        else:
            FOLDER.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
            print(f"{path}: written")
    return 1 if old and "--check" in sys.argv else 0


if __name__ == "__main__":
    raise SystemExit(main())
