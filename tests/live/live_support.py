# SPDX-License-Identifier: Apache-2.0
"""Runs live sessions for tests and keeps all that they made."""

from dataclasses import dataclass, field

import numpy as np

from touchline.live.connection import Connection
from touchline.live.session import Session
from touchline.live.sources import make_source

SECONDS = 5.0


@dataclass
class Seen:
    """What a session made of its samples."""

    times: list = field(default_factory=list)
    rows: list = field(default_factory=list)
    contacts: list = field(default_factory=list)
    events: list = field(default_factory=list)
    notices: list = field(default_factory=list)
    began: list = field(default_factory=list)
    ended: list = field(default_factory=list)


class Watched(Session):
    """A session that keeps everything."""

    seen: Seen

    def _take(self, sample):
        super()._take(sample)
        self.seen.times.append(sample.time)
        self.seen.rows.append(self.result.estimate.rows.copy())
        self.seen.contacts.append(
            [
                (c.event, c.segment, c.status, c.link, c.position, c.force)
                for c in self.result.contacts
            ]
        )


def watch(robot, source, record=None, duration=SECONDS, force=False, each=lambda session: None):
    """What a live session of a source, or of an address, makes of it."""
    made = make_source(source, robot) if isinstance(source, str) else source
    with Watched(robot, Connection(made), record, force) as session:
        session.seen = Seen()
        session.start()
        for news in session.run(duration):
            session.seen.notices += session.notices()
            session.seen.began += news.began
            session.seen.ended += news.ended
            each(session)
        session.seen.events = [event.as_json() for event in session.pipeline.events]
        return session.seen


gather = watch


def assert_same(first, second):
    """To the last bit."""
    assert first.times == second.times
    for a, b in zip(first.rows, second.rows, strict=True):
        assert np.array_equal(a, b, equal_nan=True)
    assert repr(first.contacts) == repr(second.contacts)
    assert first.events == second.events
