"""Threads: every task is done once, faults come back, and interrupts leave nobody waiting."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import motes
from motes import matter
from motes.errors import SimulationError
from motes.jit import share
from motes.pool import _Helper, _Job


def test_every_task_is_done_once_also_by_tasks_that_share() -> None:
    done = np.zeros((50, 20), int)

    def outer(i: int) -> None:
        def inner(j: int) -> None:
            done[i, j] += 1

        share(inner, 20)

    before = motes.threads()
    try:
        for count in (1, 2, 5):
            motes.threads(count)
            share(outer, 50)
    finally:
        motes.threads(before)
    assert (done == 3).all()


def test_the_first_fault_comes_back_and_ends_the_rest() -> None:
    done: list[int] = []

    def task(k: int) -> None:
        time.sleep(1e-4)
        done.append(k)
        if k == 3:
            raise ZeroDivisionError("3")

    with pytest.raises(ZeroDivisionError, match="3"):
        share(task, 10_000)
    assert len(done) < 1000


def test_a_job_is_done_or_taken_back_and_may_be_ended_twice() -> None:
    done: list[int] = []
    taken = _Job(lambda: done.append(1))
    assert taken.end() is taken.end() is None
    taken.run()
    assert not done

    finished = _Job(lambda: done.append(2))
    finished.run()
    finished.run()
    assert finished.end() is finished.end() is None
    assert done == [2]

    failed = _Job(lambda: done[5])  # type: ignore[arg-type, return-value]
    failed.run()
    assert isinstance(failed.end(), IndexError)
    assert isinstance(failed.end(), IndexError)


def test_a_helper_that_is_asked_twice_does_the_last_job() -> None:
    begun, gate, done = threading.Event(), threading.Event(), threading.Event()
    helper = _Helper()

    def wait() -> None:
        begun.set()
        gate.wait(10)

    jobs = [_Job(wait), _Job(lambda: None), _Job(done.set)]
    helper.begin(jobs[0])
    assert begun.wait(10)
    assert not helper.free
    for job in jobs[1:]:
        helper.begin(job)
    gate.set()
    assert done.wait(10)
    assert [job.end() for job in jobs] == [None] * 3
    assert helper.free


INTERRUPTED = """
import _thread, gc, random, signal, threading, time
import motes
from motes.jit import share

def handle(*_):
    if armed:
        armed.clear()
        raise KeyboardInterrupt

def poke():
    source = random.Random(1)
    while True:
        time.sleep(source.random() * 2e-3)
        _thread.interrupt_main()

motes.threads(3)
gc.disable()
armed, count = [], 0
signal.signal(signal.SIGINT, handle)
threading.Thread(target=poke, daemon=True).start()
while count < 300:
    try:
        while True:
            if not armed:
                armed.append(True)
            share(lambda k: None, 4)
    except KeyboardInterrupt:
        count += 1
done = []
share(done.append, 100)
assert sorted(done) == list(range(100))
"""
"""Short tasks with an interrupt every millisecond, at any line of what shares them out."""


def test_interrupts_at_any_moment_leave_nobody_waiting() -> None:
    subprocess.run([sys.executable, "-c", INTERRUPTED], check=True, timeout=60)


def test_a_step_that_was_broken_off_has_no_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = matter.lj_melt(cells=4)
    simulation.run(steps=3)

    def broken(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(simulation, "_advance", broken)
        patched.setattr(simulation, "_glides", lambda steps: False)
        with pytest.raises(KeyboardInterrupt):
            simulation.step()
    for further in (simulation.step, simulation.frame):
        with pytest.raises(SimulationError, match=r"a step after t = 0\.015 s was broken off"):
            further()
