"""STOP pressed in a process of its own, while the program that moves the arm hangs, is killed, and is gone on with."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from app.execution.pauses import WENT_ON
from app.records import read_events
from app.settings.files import keep_settings, kept_settings
from controller.protocol import Flag
from controller.protocol.causes import Cause
from controller.protocol.messages import Telemetry
from controller.protocol.states import State
from controller.wire.address import find_controller
from controller.wire.listener import TelemetryWatch
from tests.waiting import until

LINE = "e4 d5 exd5 Qxd5 Nc3 Qa5 d4 Nf6 Nf3 c6 Bc4 Bf5 Bd2 e6"
PRESSES = """
import sys
from pathlib import Path
from controller.wire.address import find_controller
from controller.wire.listener import TelemetryWatch
with TelemetryWatch(*find_controller(Path(sys.argv[1]))) as watch:
    print("listens", flush=True)
    sys.stdin.readline()
    if watch.stop(60.0).latched:
        print("latched", flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("pace", ["fast", pytest.param("real", marks=pytest.mark.real_time)])
def test_a_program_that_hangs_cannot_keep_the_arm_from_stopping(demo, pace):
    run, told = demo("--pace", pace, "--no-cameras", "--moves", LINE, "--linger", "60"), list[Telemetry]()
    run.until((run.folder / "run" / "controller.json").exists, "the controller")
    listener = subprocess.Popen(
        [sys.executable, "-P", "-c", PRESSES, str(run.folder / "run")], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    try:
        assert listener.stdout.readline() == "listens\n"
        with TelemetryWatch(*find_controller(run.folder / "run"), told.append):
            while True:
                run.until(lambda: run.plies() >= 1 and in_full_motion(told[-1]), "the second ply")
                run.signal(signal.SIGSTOP)
                if pace == "real":
                    break
                # its samples are used up, and plant time stands in mid motion; a busy machine may stop it too late
                until(lambda: told[-1].flags & Flag.WAITING or at_rest(told[-1]))
                if told[-1].flags & Flag.WAITING:
                    break
                run.signal(signal.SIGCONT)
            hung = told[-1]
            while pace == "fast" and (time.sleep(0.2) or told[-1].tick > hung.tick):  # what was still under way to it
                hung = told[-1]
            listener.stdin.write("\n")
            listener.stdin.flush()
            assert listener.stdout.readline() == "latched\n"
            until(lambda: told[-1].latched and at_rest(told[-1]))
    finally:
        listener.kill()
        listener.communicate()
    pressed = next(telemetry for telemetry in told if telemetry.latched)
    rested = next(telemetry for telemetry in told if telemetry.latched and at_rest(telemetry))
    speed, took = np.linalg.norm(hung.velocity), (rested.tick - pressed.tick) * 0.00088
    print(
        f"pace {pace}: at {speed:.2f} m/s when it hung, at rest {took:.3f} s of plant time after STOP was carried out"
    )
    assert took < 0.3
    if pace == "fast":
        in_time = pressed.tick <= hung.tick + 1
        assert in_time or pressed.reason is Cause.CLIENT_LOST, "it was carried out while plant time stood"
    run.signal(signal.SIGKILL)
    run.process.wait()
    assert "world" in run.helpers(), "it holds the arm, or its controller does"
    done = subprocess.run(
        [sys.executable, "-P", "-m", "app.cli", "resume", str(run.folder), "--headless", "--json"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert (report["plies"], report["physical_ok"], report["failures"]) == (len(LINE.split()), True, [])
    assert [(one["kind"], one["sentence"]) for one in report["troubles"]] == [("stopped", WENT_ON)]
    plies = [event.san for event in read_events(run.folder / "events.jsonl") if event.event == "ply"]
    assert plies == LINE.split()
    assert not run.helpers()


def in_full_motion(telemetry):
    """On a way long enough for the program to hang before its end."""
    return telemetry.state is State.TRACK and telemetry.executed < 150 and np.linalg.norm(telemetry.velocity) > 0.2


def at_rest(telemetry):
    return telemetry.state is State.HOLD and float(np.linalg.norm(telemetry.velocity)) < 0.005


@pytest.mark.slow
@pytest.mark.real_time
def test_a_stop_at_the_command_line_ends_a_demo_that_nobody_watches_and_resume_goes_on(demo):
    run = demo("--no-cameras", "--moves", LINE)  # in pace fast it would be over before the command has loaded
    run.until(lambda: run.plies() >= 1, "the first ply")
    controller = [sys.executable, "-P", "-m", "app.cli", "controller"]
    where = ["--rig", str(run.folder / "run" / "rig.toml"), "--json"]
    pressed = subprocess.run([*controller, "press-stop", *where], capture_output=True, text=True, check=False)
    assert pressed.returncode == 0, pressed.stderr
    assert "LATCHED" in json.loads(pressed.stdout)["flags"]
    status, out, err = run.wait()
    assert status == 1
    report = json.loads(out)
    assert "somebody pressed STOP" in report["failures"][0]["reason"]
    assert f"'touchmove resume {run.folder}' continues it" in err
    assert run.world_end()["at_rest"]
    assert not run.helpers()
    # what is left of the line need not take as long as the wall clock has it
    keep_settings(run.folder, kept_settings(run.folder).with_changes({"rig.pace": "fast"}))
    done = subprocess.run(
        [sys.executable, "-P", "-m", "app.cli", "resume", str(run.folder), "--headless", "--json"],
        capture_output=True, text=True, check=False, env=os.environ,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["plies"] == len(LINE.split())
