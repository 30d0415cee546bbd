"""Blocks in which Ctrl-C waits, and in which it is heard.

In a block that raises, what is still done after the key is the point.
"""

from __future__ import annotations

import contextlib
import os
import runpy
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread

import pytest

from sva_bench.interrupts import (
    as_ctrl_c,
    deferring_ctrl_c,
    flag,
    hear_ctrl_c,
    heard_ctrl_c,
    hearing_ctrl_c,
    holding_back_ctrl_c,
    pressed,
)


def press() -> None:
    """Press Ctrl-C, in this thread: sent to the process, another thread may take it, and this one hear it later."""
    signal.raise_signal(signal.SIGINT)


@pytest.fixture(autouse=True)
def _nothing_is_left() -> Iterator[None]:
    before = signal.getsignal(signal.SIGINT)
    yield
    assert signal.getsignal(signal.SIGINT) is before
    assert not pressed()
    with deferring_ctrl_c():
        assert not pressed()


@pytest.mark.parametrize("block", [deferring_ctrl_c, holding_back_ctrl_c])
def test_ctrl_c_waits_until_the_end_of_a_block(block: type[deferring_ctrl_c]) -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), block():  # noqa: PT012
        press()
        with block():
            done.append("inside")
        done.append("after")
    assert done == ["inside", "after"]


def test_ctrl_c_that_another_thread_takes_waits_too_where_this_one_masks_it() -> None:
    done, ended = [], Event()
    thread = Thread(target=ended.wait)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt), holding_back_ctrl_c():  # noqa: PT012
            os.kill(os.getpid(), signal.SIGINT)
            until = time.monotonic() + 30
            while not pressed() and time.monotonic() < until:
                time.sleep(0.001)
            done.append(pressed())
    finally:
        ended.set()
        thread.join()
    assert done == [True]


def test_where_it_is_heard_it_comes_at_once_and_not_again_at_the_end() -> None:
    done = []
    with deferring_ctrl_c():
        try:
            with hearing_ctrl_c():
                press()
                done.append("never")
        except KeyboardInterrupt:
            done.append("kept")
        done.append("written")
    assert done == ["kept", "written"]


def test_an_earlier_ctrl_c_is_raised_as_soon_as_a_block_hears_it() -> None:
    done = []
    with deferring_ctrl_c():
        press()
        for _ in range(2):  # the second piece of work ends at once too
            try:
                with hearing_ctrl_c():
                    done.append("never")
            except KeyboardInterrupt:
                done.append("kept")
    assert done == ["kept", "kept"]


def test_compiled_code_within_work_that_hears_raises_when_it_has_returned() -> None:
    done = []
    with deferring_ctrl_c():
        try:
            with hearing_ctrl_c():
                with deferring_ctrl_c():
                    press()
                    assert flag()[0] != 0
                    done.append("returned")
                done.append("never")
        except KeyboardInterrupt:
            done.append("kept")
    assert done == ["returned", "kept"]


def test_pressed_after_the_work_it_is_raised_at_the_end() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), deferring_ctrl_c():  # noqa: PT012
        with hearing_ctrl_c():
            done.append("work")
        press()
        done.append("written")
    assert done == ["work", "written"]


def test_what_a_callback_has_swallowed_is_raised_by_the_next_look() -> None:
    heard = False
    with deferring_ctrl_c():
        try:
            with hearing_ctrl_c():
                with contextlib.suppress(KeyboardInterrupt):
                    press()
                hear_ctrl_c()
        except KeyboardInterrupt:
            heard = True
    assert heard


def test_who_acts_upon_it_need_not_raise_it() -> None:
    with deferring_ctrl_c():
        press()
        heard_ctrl_c()


def test_an_error_in_the_block_is_not_hidden() -> None:
    with pytest.raises(ValueError, match="mine"), deferring_ctrl_c():  # noqa: PT012
        press()
        raise ValueError("mine")


def test_other_threads_and_ignored_signals_are_left_alone() -> None:
    seen: list[bool] = []

    def work() -> None:
        with deferring_ctrl_c(), hearing_ctrl_c():
            seen.append(pressed())

    with pytest.raises(KeyboardInterrupt), deferring_ctrl_c():  # noqa: PT012
        press()
        thread = Thread(target=work)
        thread.start()
        thread.join()
    assert seen == [False]
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with deferring_ctrl_c(), hearing_ctrl_c():
            press()
    finally:
        signal.signal(signal.SIGINT, before)


def wait_for_ctrl_c() -> None:
    time.sleep(60)
    pytest.fail("it was not raised again")


def test_what_a_library_has_swallowed_is_raised_again_soon() -> None:
    with pytest.raises(KeyboardInterrupt), as_ctrl_c():  # noqa: PT012
        with contextlib.suppress(KeyboardInterrupt):
            press()
        wait_for_ctrl_c()


def test_it_is_not_raised_within_a_callback_of_llvmlite_which_would_print_it(tmp_path: Path) -> None:
    # Also where a SIGTERM is sent on as Ctrl-C, so that its handler's frame lies between.
    module = tmp_path / "llvmlite_callback.py"
    module.write_text("def callback(press):\n    press()\n    return 'went on'\n", encoding="utf-8")
    callback, said = runpy.run_path(str(module))["callback"], []
    with pytest.raises(KeyboardInterrupt), as_ctrl_c():  # noqa: PT012
        said.append(callback(press))
        wait_for_ctrl_c()
    assert said == ["went on"]


def test_an_error_that_a_library_made_of_it_is_ctrl_c_all_the_same() -> None:
    with pytest.raises(KeyboardInterrupt), as_ctrl_c(ValueError):  # noqa: PT012
        try:
            press()
        except KeyboardInterrupt:
            raise SystemError("returned a result with an exception set") from None


def test_errors_that_are_ours_and_errors_without_ctrl_c_stay_what_they_are() -> None:
    with pytest.raises(ValueError, match="ours"), as_ctrl_c(ValueError):  # noqa: PT012
        try:
            press()
        except KeyboardInterrupt:
            raise ValueError("ours") from None
    with pytest.raises(SystemError, match="theirs"), as_ctrl_c(ValueError):
        raise SystemError("theirs")


def test_what_is_cleared_away_is_not_cut_short_however_long_it_takes() -> None:
    cleared = []
    with pytest.raises(KeyboardInterrupt), as_ctrl_c():  # noqa: PT012
        try:
            press()
        finally:
            for _ in range(4):  # it is pressed again meanwhile, by itself and by somebody in a hurry
                time.sleep(0.05)
                press()
                with holding_back_ctrl_c():
                    cleared.append("some")
    assert cleared == ["some"] * 4


def test_once_it_was_heard_it_is_not_pressed_again() -> None:
    with as_ctrl_c():
        try:
            with hearing_ctrl_c():
                press()
        except KeyboardInterrupt:
            pass
        time.sleep(0.15)
    time.sleep(0.15)


def test_pressed_and_swallowed_at_the_very_end_it_is_raised_there() -> None:
    with pytest.raises(KeyboardInterrupt), as_ctrl_c(), contextlib.suppress(KeyboardInterrupt):
        press()


AT_THE_END = """
import os, signal, sys
from sva_bench.__main__ import main

class TakenApart:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)

sys.taken_apart = TakenApart()
sys.argv = ["sva-bench", "--version"]
main()
"""


def test_a_signal_at_the_very_end_does_not_change_the_exit_code() -> None:
    done = subprocess.run([sys.executable, "-c", AT_THE_END], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("sva-bench ")


class Deleted:
    """What presses Ctrl-C while it is deleted, where Python prints what is raised and goes on."""

    def __del__(self) -> None:
        self.close()

    def close(self) -> None:
        press()
        time.sleep(0.2)  # it is pressed again meanwhile


def test_ctrl_c_while_an_object_is_deleted_is_heard_afterwards_and_nothing_is_printed(
    monkeypatch: pytest.MonkeyPatch
) -> None:
    swallowed: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", swallowed.append)

    def delete_and_wait() -> None:
        Deleted()
        time.sleep(5)

    with pytest.raises(KeyboardInterrupt), as_ctrl_c():
        delete_and_wait()
    assert swallowed == []
