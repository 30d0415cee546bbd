"""Files and folders appear whole or not at all, and what killed processes left is cleared away."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from sva_bench.__main__ import run_command_line
from sva_bench.batch.folder import writing
from sva_bench.errors import BadInput
from sva_bench.files import atomic
from sva_bench.files.atomic import draft_file, draft_folder, remove_left_behind, write_file
from sva_bench.storage.run_folder import run_folder, tidy

NAME = "small-seed0-0123abcd"


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def broken_off(drafted: AbstractContextManager[Path], name: str) -> None:
    """Write half of a file, and come to grief."""
    with drafted as draft:
        (draft / name).write_text("ne")
        raise RuntimeError


def dead_pid() -> int:
    """The id of a process that was there and has gone."""
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        process.wait()
    return process.pid


def filled(folder: Path, word: str) -> Path:
    folder.mkdir(parents=True)
    (folder / "summary.json").write_text(word)
    return folder


def test_a_file_is_replaced_only_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text("old")
    with pytest.raises(RuntimeError):
        broken_off(draft_file(path), "")
    assert (path.read_text(), names_in(tmp_path)) == ("old", ["plan.json"])
    with draft_file(path) as draft:
        draft.write_text("new")
        assert path.read_text() == "old"
    assert (path.read_text(), names_in(tmp_path)) == ("new", ["plan.json"])


def test_a_file_of_the_longest_name_is_written_too(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 255)
    write_file(path, b"content")
    assert path.read_bytes() == b"content"


@pytest.mark.parametrize("exchange", [True, False])
def test_a_folder_is_replaced_atomically(
    exchange: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not exchange:
        monkeypatch.setattr(atomic, "_exchange", _unknown)
    for word in ("old", "new"):
        with run_folder(tmp_path / "runs", NAME) as draft:
            (draft / "summary.json").write_text(word)
        assert (tmp_path / "runs" / NAME / "summary.json").read_text() == word
        assert names_in(tmp_path / "runs") == [NAME]


def _unknown(*_: Path) -> None:
    """What some network file systems say."""
    raise OSError(38, "Function not implemented")


def test_names_are_exchanged_in_one_step_of_the_kernel(tmp_path: Path) -> None:
    # Nobody who looks at any time finds nothing there: what a kill between two renames leaves.
    new, old = filled(tmp_path / "new", "new"), filled(tmp_path / "old", "old")
    atomic._exchange(new, old)
    assert ((new / "summary.json").read_text(), (old / "summary.json").read_text()) == ("old", "new")


def test_a_folder_that_cannot_take_its_place_leaves_the_older_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    filled(tmp_path / NAME, "old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic, "_exchange", full)
    with pytest.raises(BadInput, match=r"\(No space left on device\); choose another with --out"), \
            run_folder(tmp_path, NAME) as draft:
        (draft / "summary.json").write_text("new")
    assert names_in(tmp_path) == [NAME]
    assert (tmp_path / NAME / "summary.json").read_text() == "old"


@pytest.mark.parametrize(("left", "is_there", "found"), [
    (".{name}.{dead}.tmp", True, "new"),  # killed while it wrote
    (".{name}.{dead}.tmp", False, None),
    (".{name}.{dead}.old", True, "new"),  # killed behind the two renames of a file system that can't exchange
    (".{name}.{dead}.old", False, "left"),  # killed between them
    (".{name}.{own}.tmp", True, "new"),  # ids are used again, and in containers they are always the same
])
def test_drafts_of_killed_runs_are_removed_and_moved_folders_restored(
    left: str, is_there: bool, found: str | None, tmp_path: Path
) -> None:
    filled(tmp_path / left.format(name=NAME, dead=dead_pid(), own=os.getpid()), "left")
    if is_there:
        filled(tmp_path / NAME, "new")
    tidy(tmp_path)
    assert names_in(tmp_path) == ([] if found is None else [NAME])
    assert found is None or (tmp_path / NAME / "summary.json").read_text() == found


def test_drafts_of_the_living_and_files_of_others_are_left_alone(tmp_path: Path) -> None:
    kept = [f".{NAME}.{os.getppid()}.tmp", f".notes.{dead_pid()}.tmp", ".vimrc.tmp", f"{NAME}.tmp"]
    for name in kept:
        filled(tmp_path / name, "somebody's")
    with draft_folder(tmp_path / NAME) as draft:  # of this very process
        tidy(tmp_path)
        assert draft.is_dir()
    assert names_in(tmp_path) == sorted([*kept, NAME])


def test_two_processes_of_one_id_write_drafts_of_their_own(tmp_path: Path) -> None:
    # As in two containers that share a folder: both are process 1.
    path = tmp_path / "plan.json"
    with draft_file(path) as one, draft_file(path) as other:
        assert one != other
        one.write_text("one")
        other.write_text("other")
    assert names_in(tmp_path) == ["plan.json"]


def test_a_writer_that_is_killed_leaves_what_the_next_one_removes(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text("old")
    script = ("import os, signal, sys; from pathlib import Path; from sva_bench.files.atomic import draft_file\n"
              "with draft_file(Path(sys.argv[1])) as draft:\n"
              "    draft.write_text('ne'); os.kill(os.getpid(), signal.SIGKILL)")
    done = subprocess.run([sys.executable, "-c", script, str(path)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert path.read_text() == "old"
    assert len(names_in(tmp_path)) == 2
    write_file(path, b"new")
    assert (path.read_text(), names_in(tmp_path)) == ("new", ["plan.json"])


def test_ctrl_c_during_the_removal_of_a_draft_waits_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    remove = atomic._remove

    def interrupted(path: Path) -> None:
        signal.raise_signal(signal.SIGINT)
        remove(path)

    monkeypatch.setattr(atomic, "_remove", interrupted)
    with pytest.raises(KeyboardInterrupt):
        broken_off(draft_folder(tmp_path / "out" / NAME), "summary.json")
    assert names_in(tmp_path / "out") == []


def test_in_an_unreadable_folder_no_drafts_are_removed(tmp_path: Path) -> None:
    remove_left_behind(tmp_path / "nowhere", lambda _: True)


def test_a_batch_folder_without_room_names_the_file_and_keeps_the_older_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = tmp_path / "report.html"
    report.write_text("old")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(BadInput, match=r"report\.html: cannot be written to \(No space left on device\)"), \
            writing(report) as draft:
        draft.write_text("ne")
    assert (report.read_text(), names_in(tmp_path)) == ("old", ["report.html"])


@pytest.mark.parametrize(("file", "said"), [(None, "a temporary file in /"), ("/tmp/x.urdf", "/tmp/x.urdf")])
def test_a_full_disk_is_bad_input_that_names_the_path(
    file: str | None, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", file)

    monkeypatch.setattr("sva_bench.cli.app.app", full)
    assert run_command_line(["run"]) == 2
    assert said in capsys.readouterr().err
