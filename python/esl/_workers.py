"""Threads for operations that are not async: as many as operations are under way, used again and again."""

from __future__ import annotations

import os
import queue
import threading
from typing import Callable

Job = Callable[[], None]


class _Workers:
    """Threads that wait for jobs. They are daemons, so a job that never ends does not keep the process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
        self._idle = 0

    def run(self, job: Job) -> None:
        """Has a job done at once, by a thread that waits or by a new one."""
        with self._lock:
            needs_thread = self._idle == 0
            if not needs_thread:
                self._idle -= 1
        self._jobs.put(job)
        if needs_thread:
            threading.Thread(target=self._work, name="esl-operation", daemon=True).start()

    def _work(self) -> None:
        while True:
            job = self._jobs.get()
            job()
            # A job holds what it was called with.
            del job
            with self._lock:
                self._idle += 1


_workers = _Workers()


def run_in_thread(job: Job) -> None:
    """Has a job done on a thread of its own, while it takes."""
    _workers.run(job)


def _begin_anew() -> None:
    global _workers
    _workers = _Workers()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_anew)
