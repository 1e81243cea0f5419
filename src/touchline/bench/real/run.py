# SPDX-License-Identifier: Apache-2.0
"""`touchline bench real`: real arms with the shortest of descriptions.

Nothing is chosen on a recording that is judged: descriptions name the model, locked joints and the
log's columns, all else is what a new robot starts with.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from touchline.bench.matching import MARGIN
from touchline.bench.real.calibrated import calibrated
from touchline.bench.real.judged import (
    Touched,
    events_of,
    judge_free,
    judge_touched,
)
from touchline.bench.real.left_out import CHOICES, chosen, named, try_all
from touchline.bench.tables import Row, aligned
from touchline.errors import InputError
from touchline.trials.real_recordings import (
    Recording,
    at_rate,
    read_free,
    read_touched,
    touched_files,
)

TOUCHED_HEAD = (
    "file",
    "link",
    "touches",
    "found",
    "false",
    "right",
    "beyond",
    "in 90 % set",
    "links in it",
    "in first two",
    "above 0.9",
    "wrong",
)
LATER = (0.25, 0.5, 0.75)  # of a period: other instants at which slow samples are taken
FREE_HEAD = ("recording", "s", "in contact", "longest", "events", "to the end")


def main(
    data: Path,
    rate: float | None = None,
    leave_one_out: bool = False,
    calibrate: bool = False,
) -> None:
    """Prints what holds on the recordings below `data`.

    Args:
        data: folder of the recordings.
        rate: at which all are looked at once more [Hz], or None.
        leave_one_out: numbers are chosen anew on all touched files but the one that is judged, and
            nothing else is printed.
        calibrate: on what is untouched of all touched files but the one that is judged; nothing
            else is printed.

    Raises:
        InputError: there are none.
    """
    files = touched_files(data)
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        free = read_free(data.resolve(), folder)
        if not files and not free:
            raise InputError(f"{data}: holds neither panda_touches nor recordings of free motion")
        if leave_one_out:
            if files:
                print(_left_out(files, folder))
            return
        if calibrate:
            if len(files) == 1:
                raise InputError(f"{files[0]}: the only touched file; --calibrate needs others")
            if files:
                recordings = [read_touched(path, folder) for path in files]
                found = calibrated(recordings, folder)
                judged = [(r.name, r.link, judge_touched(r, events_of(r))) for r in found]
                print(_touched_text("Calibrated on what is untouched of all other files", judged))
            return
        if files:
            whole = [_judged(path, folder) for path in files]
            print(_touched_text("A real Panda touched by hand", whole))
        if files and rate is not None:
            slow = [_judged(path, folder, rate) for path in files]
            print(_touched_text(f"The same at {rate:g} Hz", slow))
            others = [[_judged(path, folder, rate, later) for path in files] for later in LATER]
            found = [sum(c.found for _, _, c in judged) for judged in (slow, *others)]
            before = sum(c.found for _, _, c in whole)
            print(
                f"touches found at {rate:g} Hz, sampled at {len(found)} instants of a period: "
                f"{', '.join(map(str, found))}, of {before} found before\n"
            )
        if free:
            print(_free_text("Motion in which nothing touches", free))
        if free and rate is not None:
            slowed = [at_rate(recording, rate) for recording in free]
            print(f"\n{_free_text(f'The same at {rate:g} Hz', slowed)}")


def _left_out(files: list[Path], folder: Path) -> str:
    from tqdm import tqdm

    bar = tqdm(files, desc="leave one out", file=sys.stderr, disable=None, leave=False)
    recordings = [read_touched(path, folder) for path in files]
    tried = [try_all(recording) for recording, _ in zip(recordings, bar, strict=True)]
    rows: list[Row] = [("file", "chosen on all others")]
    judged = []
    for k, recording in enumerate(recordings):
        choice = chosen(tried, k)
        rows.append((recording.name, named(CHOICES[choice])))
        judged.append((recording.name, recording.link, tried[k][choice].counts))
    text = _touched_text("Numbers chosen on all other files", judged)
    return f"{text}\n{aligned(rows, text_columns=(0, 1))}"


def _judged(
    path: Path, folder: Path, rate: float | None = None, later: float = 0.0
) -> tuple[str, int, Touched]:
    recording = read_touched(path, folder)
    if rate is not None:
        recording = at_rate(recording, rate, later)
    return recording.name, recording.link, judge_touched(recording, events_of(recording))


def _touched_text(what: str, judged: list[tuple[str, int, Touched]]) -> str:
    total = Touched.sum(counts for _, _, counts in judged)
    rows: list[Row] = [TOUCHED_HEAD]
    rows += [_touched_row(name, str(link), counts) for name, link, counts in judged]
    rows.append(_touched_row("all", "", total))
    found = max(total.found, 1)
    return "\n".join(
        [
            f"{what}, one event to one touch (margin {MARGIN} s):",
            aligned(rows),
            f"found {_percent(total.found, total.touches)}; of these: right link "
            f"{_percent(total.right, found)}, beyond the touched one "
            f"{_percent(total.beyond, found)}, in the 90 % set {_percent(total.in_set, found)}; "
            f"above 0.9 wrong {_percent(total.sure_wrong, max(total.sure, 1))}",
            "",
        ]
    )


def _touched_row(name: str, link: str, t: Touched) -> Row:
    counts = (t.touches, t.found, t.false, t.right, t.beyond, t.in_set)
    size = f"{t.links / t.found:.1f}" if t.found else "-"
    return (
        name,
        link,
        *(str(n) for n in counts),
        size,
        *(str(n) for n in (t.in_two, t.sure, t.sure_wrong)),
    )


def _free_text(what: str, recordings: list[Recording]) -> str:
    rows: list[Row] = [FREE_HEAD]
    for recording in recordings:
        f = judge_free(recording, events_of(recording))
        rows.append(
            (
                recording.name,
                f"{f.seconds:.1f}",
                f"{100 * f.share:.1f} %",
                f"{f.longest:.2f} s",
                str(f.events),
                "yes" if f.open else "no",
            )
        )
    return f"{what}:\n{aligned(rows)}"


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} % ({part} of {whole})"
