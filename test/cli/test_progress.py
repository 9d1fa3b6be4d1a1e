"""The progress line on a terminal and in a log."""

from __future__ import annotations

import io

from snake_control.cli.progress import ProgressLine


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_terminal_line_is_rewritten_and_ended_before_other_text():
    stream = Terminal()
    progress = ProgressLine(stream)
    progress.show("1 s")
    progress.show("2 s")
    progress.say("fell")
    progress.close()
    assert stream.getvalue() == "\r\x1b[K1 s\r\x1b[K2 s\nfell\n"


def test_terminal_line_never_wraps(monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    stream = Terminal()
    ProgressLine(stream).show("x" * 50)
    assert stream.getvalue() == "\r\x1b[K" + "x" * 19


def test_log_gets_plain_lines_now_and_then():
    stream = io.StringIO()
    progress = ProgressLine(stream, log_period_s=3600.0)
    assert progress.due
    progress.show("1 s")
    assert not progress.due
    progress.close()
    assert stream.getvalue() == "1 s\n"
