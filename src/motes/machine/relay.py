"""Calls of several kernels, one kernel after another, on a few threads without Python between them.

A phase is the calls of one kernel, which threads take from a counter; the next phase begins when
all of them are done, and all phases come round several times. A thread waits awake: where a phase
lasts some microseconds, to wake another one would take longer than the phase.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

from motes.machine.module import ENTRY
from motes.machine.target import has, loaded, object_code

ROW = 5
"""Numbers of a phase in the table: addresses of the kernel's door and of the first pack of
arguments, bytes of a pack, how many calls, bytes from one round's packs to those of the next."""

COUNTERS = 2
"""Numbers of a phase in a round: how many calls were taken, how many are done."""

PATIENCE = 4096
"""Looks, of some ten nanoseconds, after which who waits lets others have the processor."""

PAUSE = "call void @llvm.x86.sse2.pause()"

TEXT = f"""
define i64 @{ENTRY}(ptr %table, i64 %phases, ptr %counters, i64 %number, i64 %most, ptr %stop)
nounwind {{
head:
  br label %phase
phase:
  %p = phi i64 [ 0, %head ], [ %following, %over ]
  %before = phi i64 [ 0, %head ], [ %taken, %over ]
  %stopped = load atomic i64, ptr %stop acquire, align 8
  %go = icmp eq i64 %stopped, 0
  %left = icmp slt i64 %p, %number
  %both = and i1 %go, %left
  br i1 %both, label %row, label %finished
row:
  %round = udiv i64 %p, %phases
  %place = urem i64 %p, %phases
  %at = getelementptr inbounds [{ROW} x i64], ptr %table, i64 %place
  %kernel = load ptr, ptr %at
  %a1 = getelementptr inbounds i64, ptr %at, i64 1
  %first = load ptr, ptr %a1
  %a2 = getelementptr inbounds i64, ptr %at, i64 2
  %stride = load i64, ptr %a2
  %a3 = getelementptr inbounds i64, ptr %at, i64 3
  %count = load i64, ptr %a3
  %a4 = getelementptr inbounds i64, ptr %at, i64 4
  %further = load i64, ptr %a4
  %away = mul i64 %round, %further
  %packs = getelementptr inbounds i8, ptr %first, i64 %away
  %next = getelementptr inbounds [{COUNTERS} x i64], ptr %counters, i64 %p
  %done = getelementptr inbounds i64, ptr %next, i64 1
  br label %again
again:
  %taken = phi i64 [ %before, %row ], [ %more, %work ]
  %enough = icmp sge i64 %taken, %most
  br i1 %enough, label %more_calls, label %take
take:
  %k = atomicrmw add ptr %next, i64 1 seq_cst
  %none = icmp sge i64 %k, %count
  br i1 %none, label %wait, label %work
work:
  %offset = mul i64 %k, %stride
  %pack = getelementptr inbounds i8, ptr %packs, i64 %offset
  call void %kernel(ptr %pack, ptr null)
  %was = atomicrmw add ptr %done, i64 1 seq_cst
  %more = add i64 %taken, 1
  br label %again
wait:
  %looks = phi i64 [ 0, %take ], [ %looked, %rest ]
  %ready = load atomic i64, ptr %done acquire, align 8
  %all = icmp sge i64 %ready, %count
  br i1 %all, label %over, label %look
look:
  %tired = icmp sge i64 %looks, {PATIENCE}
  br i1 %tired, label %weary, label %rest
rest:
  PAUSE
  %looked = add i64 %looks, 1
  br label %wait
over:
  %following = add i64 %p, 1
  br label %phase
more_calls:
  ret i64 1
weary:
  ret i64 2
finished:
  ret i64 0
}}
"""


@cache
def runner() -> Any:
    """A function that threads run together.

    Its arguments: a table and how many phases it has, counters and how many phases that is in all
    rounds, how many calls are to be done at most, and the address of a number: where that is not 0,
    no phase begins. It returns 0 when all is done, 1 after so many calls, 2 when it has waited long
    for others'.
    """
    pause = has("sse2")
    text = TEXT.replace("PAUSE", PAUSE if pause else "")
    if pause:
        text = f"declare void @llvm.x86.sse2.pause()\n{text}"
    prototype = ctypes.CFUNCTYPE(
        ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64,
        ctypes.c_int64, ctypes.c_void_p,
    )  # fmt: skip
    return prototype(loaded(object_code(text))[0])
