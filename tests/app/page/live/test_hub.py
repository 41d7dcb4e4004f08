"""The state in sections: everybody gets the newest of each, however slowly they read."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.page.live.hub import SECTIONS, Hub, Watcher

CHANGES = st.lists(st.tuples(st.sampled_from(SECTIONS), st.integers()), max_size=30)


async def read(watcher: Watcher, known: dict[str, Any]) -> None:
    for text in await watcher.frames():
        frame = json.loads(text)
        if frame["type"] == "state":
            known.update(frame["changes"])


@given(st.lists(CHANGES, max_size=5), st.lists(st.booleans(), max_size=5))
def test_a_slow_browser_knows_in_the_end_what_a_quick_one_does(
    batches: list[list[tuple[str, int]]], reads: list[bool]
) -> None:
    async def scenario() -> None:
        hub = Hub()
        quick, slow = hub.join(1), hub.join(2)
        known: tuple[dict[str, Any], dict[str, Any]] = {}, {}
        for number, batch in enumerate(batches):
            for name, value in batch:
                hub.put(name, value)
            hub.put("phase", number)
            await read(quick, known[0])
            if number < len(reads) and reads[number]:
                await read(slow, known[1])
        hub.put("phase", "last")
        await read(quick, known[0])
        await read(slow, known[1])
        assert known[0] == known[1]
        assert set(known[0]) == set(SECTIONS)

    asyncio.run(scenario())


def test_nothing_queues_up_for_who_does_not_read() -> None:
    async def scenario() -> None:
        hub = Hub()
        watcher = hub.join(1)
        watcher.watches = frozenset({"telemetry"})
        for number in range(10_000):
            hub.put("log", list(range(200)))
            hub.telemetry({"t": number})
            watcher.refuse(f"no {number}")
        frames = [json.loads(frame) for frame in await watcher.frames()]
        assert [frame["type"] for frame in frames] == ["state", *["refused"] * 8, "telemetry"]
        assert frames[-1]["t"] == 9999
        assert frames[-2]["text"] == "no 9999"

    asyncio.run(scenario())


def test_telemetry_goes_to_those_who_watch_it() -> None:
    async def scenario() -> None:
        hub = Hub()
        one, other = hub.join(1), hub.join(2)
        await one.frames(), await other.frames()
        assert not hub.watched("telemetry")
        one.watches = frozenset({"telemetry"})
        assert hub.watched("telemetry")
        hub.telemetry({"t": 1.0})
        hub.put("phase", "x")
        assert [json.loads(frame)["type"] for frame in await one.frames()] == ["state", "telemetry"]
        assert [json.loads(frame)["type"] for frame in await other.frames()] == ["state"]
        hub.leave(one)
        assert not hub.watched("telemetry")

    asyncio.run(scenario())


def test_a_section_is_encoded_once_and_only_for_somebody() -> None:
    async def scenario() -> None:
        hub, made = Hub(), list[int]()
        hub.put_made("game", lambda: made.append(1) or len(made))
        assert not made
        watchers = [hub.join(number) for number in range(5)]
        for watcher in watchers:
            await watcher.frames()
        assert made == [1]

    asyncio.run(scenario())


def test_numbers_that_are_not_finite_are_not_sent() -> None:
    async def scenario() -> None:
        hub = Hub()
        hub.put("clock", {"white": float("nan")})
        with pytest.raises(ValueError, match="not JSON compliant"):
            await hub.join(1).frames()

    asyncio.run(scenario())
    with pytest.raises(ValueError, match="there is no section 'x'"):
        Hub().put("x", 1)
    hub = Hub()
    hub.join(1)
    with pytest.raises(ValueError, match="watcher 1 is there already"):
        hub.join(1)
