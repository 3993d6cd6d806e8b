"""A line at the terminal that says how long a job takes, as the commands show it."""

from __future__ import annotations

import os
import sys
import threading
import time
from types import TracebackType
from typing import Optional, TextIO

# Seconds before a line is shown, and between two.
PATIENCE = 1.0
PAUSE = 0.2


class StatusLine:
    """Shows a text and the seconds since the job began, if the job takes more than a second and standard error is a
    terminal. Erases it when the job is over."""

    def __init__(self, text: str, screen: Optional[TextIO] = None, patience: float = PATIENCE) -> None:
        self._text = text
        self._screen = screen if screen is not None else sys.stderr
        self._patience = patience
        self._is_over = threading.Event()
        self._thread: Optional[threading.Thread] = None

    def __enter__(self) -> "StatusLine":
        if self._screen is not None and self._screen.isatty() and os.environ.get("TERM") != "dumb":
            self._thread = threading.Thread(target=self._show, name="esl-progress", daemon=True)
            self._thread.start()
        return self

    def _show(self) -> None:
        started = time.monotonic()
        pause, is_shown = self._patience, False
        while not self._is_over.wait(pause):
            self._write(f"\r\x1b[K{self._text}, {int(time.monotonic() - started)} s")
            pause, is_shown = PAUSE, True
        if is_shown:
            self._write("\r\x1b[K")

    def _write(self, text: str) -> None:
        try:
            self._screen.write(text)
            self._screen.flush()
        except (OSError, ValueError):
            # A terminal that does not take the line is no reason to stop.
            self._is_over.set()

    def __exit__(
        self,
        kind: Optional[type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self._is_over.set()
        if self._thread is not None:
            self._thread.join()
