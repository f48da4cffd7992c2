"""A plugin for pytest: a test in real time takes the turn that whole-system tests take (tests/src/turn.rs); all others go on beside it."""

import fcntl
import os

import pytest


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item):
    if item.get_closest_marker("airbench_realtime") is None:
        return (yield)
    with open(os.environ["AIRBENCH_TURN_LOCK"], "a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return (yield)
