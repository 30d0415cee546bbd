"""Ctrl-C and kills at random moments: the right exit code, and nothing half-written, no process and no lock left."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.worlds_for_tests import SMALL

MOMENTS = 40
SOON_S = 0.25  # Python and our libraries are loaded meanwhile; a quarter of all moments are so early
ANSWER_S = 2.0  # of processor time, which other work on the machine doesn't lengthen
HANGING_S = 60.0  # by the clock: nothing that takes so little processor time takes so long


@dataclass(frozen=True)
class Command:
    """A command to be disturbed.

    Attributes:
        arguments: What is typed.
        whole: Whether a folder holds a whole result, older or new; told the folder of the undisturbed one too.
        result: The file or folder that it writes.
    """

    arguments: Sequence[str]
    whole: Callable[[Path, Path], bool]
    result: str


def same_run(folder: Path, undisturbed: Path) -> bool:
    """One run folder, with all that belongs in it."""
    runs, others = list((folder / "out").iterdir()), list((undisturbed / "out").iterdir())
    return [run.name for run in runs] == [run.name for run in others] and files_of(runs[0]) == files_of(others[0]) \
        and (runs[0] / "summary.json").read_bytes() == (others[0] / "summary.json").read_bytes()


def whole_plan(folder: Path, _: Path) -> bool:
    return set(json.loads((folder / "plan.json").read_text())["routes"]) == {"uv1", "uv2"}


def whole_map(folder: Path, undisturbed: Path) -> bool:
    return files_of(folder / "w-map") == files_of(undisturbed / "w-map") \
        and (folder / "w.yaml").read_bytes() == (undisturbed / "w.yaml").read_bytes()


def whole_shards(folder: Path, undisturbed: Path) -> bool:
    """No shard but whole ones; a batch goes on where it was ended."""
    names = {path.name for path in (folder / "out").iterdir()}
    return names <= {path.name for path in (undisturbed / "out").iterdir()} and all(
        path.read_bytes()[-4:] == b"PAR1" for path in (folder / "out").glob("*.parquet"))


RUN = ("small.yaml", "--trials", "60", "--out", "out", "--workers", "2")
TINY = SMALL.replace("scenarios:\n  half: {uv2: 0.5}\n  safe: {uv2: 1.0}\n", "scenarios:\n  half: {uv2: 0.5}\n")
COMMANDS = {
    "run, kinematic": Command(("run", *RUN, "--fidelity", "kinematic"), same_run, "out"),
    "run, rollout": Command(("run", *RUN, "--rollouts", "2"), same_run, "out"),
    "execute": Command(("execute", RUN[0], "a.json", "b.json", *RUN[1:], "--rollouts", "2"), same_run, "out"),
    "plan": Command(("plan", "small.yaml", "--scenario", "half", "-o", "plan.json"), whole_plan, "plan.json"),
    "batch": Command(("batch", *RUN, "--unit-trials", "10", "--fidelity", "kinematic", "--cache", "cache", "--resume"),
                     whole_shards, "out"),
    "world from-map": Command(("world", "from-map", "rooms.map", "-o", "w.yaml", "--pois", "4", "--stations", "1"),
                              whole_map, "w.yaml"),
}

MAP = "\n".join(["type octile", "height 10", "width 10", "map", *["." * 10] * 4, "@@@@..@@@@", *["." * 10] * 5, ""])


@pytest.fixture(autouse=True)
def _started_as_in_the_foreground() -> Iterator[None]:
    """What is started hears Ctrl-C, though these tests may run in the background of a shell, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def prepared(folder: Path) -> Path:
    """A folder with all that the commands read."""
    folder.mkdir()
    (folder / "small.yaml").write_text(TINY, encoding="utf-8")
    (folder / "rooms.map").write_text(MAP, encoding="utf-8")
    for name, poi in (("a", "p1"), ("b", "p2")):
        (folder / f"{name}.json").write_text(json.dumps(
            {"format": "sva-bench/plan@1", "routes": {"uv1": ["base", poi, "base"]}}))
    return folder


def again(folder: Path) -> None:
    """Let there be everything to do again: a batch that is resumed would do nothing more."""
    if (folder / "cache").exists():
        shutil.rmtree(folder / "cache")
        shutil.rmtree(folder / "out")


def start(command: Command, folder: Path) -> subprocess.Popen[str]:
    """The command in a session of its own, as in a terminal's window."""
    return subprocess.Popen([sys.executable, "-m", "sva_bench", *command.arguments], cwd=folder, text=True,
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)


def await_moment(process: subprocess.Popen[str], moment_s: float) -> None:
    """Let time pass, but not beyond the end of the process, which is not waited for here."""
    until = time.monotonic() + moment_s
    while (left := until - time.monotonic()) > 0:
        if os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
            return
        time.sleep(min(left, 0.02))


def end_of(process: subprocess.Popen[str]) -> tuple[str, float]:
    """What it says until its end, and the processor time [s] that it took."""
    assert process.stderr is not None
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stderr.close()
    return said, usage.ru_utime + usage.ru_stime


def session_of(session: int) -> dict[str, float]:
    """The processes of a session that live, and the processor time [s] of each and of its children that have ended."""
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdecimal():
            continue
        try:
            name, _, rest = (entry / "stat").read_text().rpartition(")")
        except OSError:
            continue
        words = rest.split()
        if int(words[3]) == session and words[0] != "Z":
            found[name] = sum(map(int, words[11:15])) / os.sysconf("SC_CLK_TCK")
    return found


def gone(session: int) -> list[str]:
    """What lives of a session, after a moment in which the kernel ends what is to end."""
    until = time.monotonic() + 10
    while (left := list(session_of(session))) and time.monotonic() < until:
        time.sleep(0.01)
    return left


def files_of(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def drafts_in(folder: Path) -> list[str]:
    return sorted(name for name in files_of(folder) if name.endswith((".tmp", ".old")))


def is_there(result: Path) -> bool:
    """Whether there is a result: a file, or a folder that holds more than drafts."""
    return result.is_file() or (result.is_dir() and any(path.suffix not in (".tmp", ".old")
                                                        for path in result.iterdir()))


@dataclass(frozen=True)
class Undisturbed:
    folder: Path
    seconds: float


def undisturbed(command: Command, folder: Path) -> Undisturbed:
    """What the command writes when it is left alone, and how long it takes the second time, when all is compiled."""
    prepared(folder)
    for _ in range(2):
        again(folder)
        before = time.monotonic()
        process = start(command, folder)
        said, _ = end_of(process)
        assert process.returncode == 0, said
    return Undisturbed(folder=folder, seconds=time.monotonic() - before)


def moments(draw: random.Random, whole_s: float) -> list[float]:
    soon = MOMENTS // 4
    return [draw.uniform(0, SOON_S) for _ in range(soon)] + [draw.uniform(0, whole_s) for _ in range(MOMENTS - soon)]


@pytest.mark.long
@pytest.mark.parametrize("name", COMMANDS)
def test_ctrl_c_at_any_moment_ends_with_130_and_leaves_nothing_half_written(
    name: str, tmp_path: Path
) -> None:
    command, draw = COMMANDS[name], random.Random(f"ctrl-c {name}")
    alone = undisturbed(command, tmp_path / "alone")
    folder = prepared(tmp_path / "disturbed")
    there = False  # whether there is a result that must not be lost
    for number, moment in enumerate(moments(draw, alone.seconds)):
        process = start(command, folder)
        await_moment(process, moment)
        began = listening(process.pid)
        taken, at = sum(session_of(process.pid).values()), time.monotonic()
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers too
        said, in_all = end_of(process)
        what = f"moment {number} ({moment:.3f} s): {said}"
        if began:
            assert process.returncode in (0, 130), what
            assert "Traceback" not in said, what
            assert process.returncode == 0 or "interrupted" in said, what
            if process.returncode == 130:
                assert in_all - taken < ANSWER_S, what
                assert time.monotonic() - at < HANGING_S, what
        assert gone(process.pid) == [], what
        assert drafts_in(folder) == [], what
        there = there or is_there(folder / command.result)
        if there and (process.returncode == 0 or name != "batch"):
            assert command.whole(folder, alone.folder), what
        if process.returncode == 0:
            again(folder)
    finish(command, folder, alone)


@pytest.mark.long
@pytest.mark.parametrize("name", COMMANDS)
def test_a_kill_at_any_moment_leaves_a_complete_result_or_none_and_no_lock(
    name: str, tmp_path: Path
) -> None:
    command, draw = COMMANDS[name], random.Random(f"kill {name}")
    alone = undisturbed(command, tmp_path / "alone")
    folder = prepared(tmp_path / "disturbed")
    for number, moment in enumerate(moments(draw, alone.seconds)):
        process = start(command, folder)
        await_moment(process, moment)
        os.kill(process.pid, signal.SIGKILL)  # not by Popen, which would look whether it has ended, and wait for it
        said, _ = end_of(process)
        what = f"moment {number} ({moment:.3f} s): {said}"
        assert gone(process.pid) == [], what
        if is_there(folder / command.result):
            whole = folder.with_name("whole")
            subprocess.run(["cp", "-r", str(folder), str(whole)], check=True)
            for draft in drafts_in(whole):
                subprocess.run(["rm", "-rf", str(whole / draft)], check=True)
            assert command.whole(whole, alone.folder), what
            subprocess.run(["rm", "-rf", str(whole)], check=True)
        if process.returncode == 0:
            again(folder)
    finish(command, folder, alone)


def finish(command: Command, folder: Path, alone: Undisturbed) -> None:
    """The next start is blocked by nothing, and clears away what is left."""
    process = start(command, folder)
    said, _ = end_of(process)
    assert process.returncode == 0, said
    assert command.whole(folder, alone.folder)
    assert drafts_in(folder) == []


def listening(pid: int) -> bool:
    """Whether a process hears Ctrl-C by itself: in the first milliseconds it is the interpreter that does.

    Of what Python does before it comes to our first line, an interrupt is Python's to answer; our handlers of SIGTERM
    are set behind that of SIGINT, and tell when we are there.
    """
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return False
    caught = next((line for line in status.splitlines() if line.startswith("SigCgt")), "SigCgt: 0")
    return bool(int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1)
