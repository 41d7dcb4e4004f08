"""What a browser may send, and nothing else."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.page.live.frames import FrameRefused, HelloFrame, LineFrame, StopFrame, WatchFrame, read_frame
from app.page.news import LONGEST_LINE

JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
TYPES = st.sampled_from(["hello", "line", "stop", "controls", "watch", "state", ""])


@given(st.dictionaries(st.sampled_from(["text", "token", "action", "telemetry", "held", "x"]), JSON), TYPES)
def test_a_frame_is_of_the_schema_or_refused_in_a_sentence(content: dict[str, Any], kind: str) -> None:
    refusal = None
    try:
        frame = read_frame(json.dumps({**content, "type": kind}))
    except FrameRefused as refused:
        refusal = str(refused)
    else:
        assert frame.type == kind
        assert set(content) <= set(type(frame).model_fields)
    assert refusal is None or (refusal and "\n" not in refusal)


@given(st.text(max_size=300))
def test_any_text_at_all_is_refused_or_read(text: str) -> None:
    try:
        read_frame(text)
    except FrameRefused:
        return
    raise AssertionError("no text that is drawn by lot is a frame")


@given(st.text(min_size=1, max_size=LONGEST_LINE + 10))
def test_a_line_is_one_line(text: str) -> None:
    frame = json.dumps({"type": "line", "text": text})
    if text.isprintable() and text.strip() and len(text) <= LONGEST_LINE:
        assert read_frame(frame) == LineFrame(type="line", text=text)
    else:
        with pytest.raises(FrameRefused):
            read_frame(frame)


def test_what_the_page_sends_is_read() -> None:
    token = "0123456789abcdef" * 2
    assert read_frame(json.dumps({"type": "hello", "token": token})) == HelloFrame(type="hello", token=token)
    assert read_frame('{"type":"stop"}') == StopFrame(type="stop")
    assert read_frame('{"type":"watch","camera":true}') == WatchFrame(type="watch", camera=True)


@pytest.mark.parametrize(
    "frame",
    [
        '{"type":"stop","now":true}', '{"type":"watch","camera":1}', '{"type":"hello","token":"short"}',
        '{"type":"hello","token":"' + 17 * "ü" + '"}', '{"type":"controls","action":"steal"}', "[]", "null", "{", "",
        "[" * 4000,
    ],
)  # fmt: skip
def test_what_is_nearly_right_is_refused(frame: str) -> None:
    with pytest.raises(FrameRefused):
        read_frame(frame)
