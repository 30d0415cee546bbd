"""Recordings shown: in the viewer's window, in a browser, or as a picture without a screen."""

from __future__ import annotations

import logging
import os
import shutil
import socket
import subprocess
import tempfile
import time
import webbrowser
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from sva_bench.errors import BadFile, BadInput, ExitCode, SvaBenchError
from sva_bench.files.atomic import write_file
from sva_bench.files.printable import counted
from sva_bench.interrupts import holding_back_ctrl_c
from sva_bench.recording.browser import page_of

if TYPE_CHECKING:
    from sva_bench.recording.live import Live
    from sva_bench.world.model import World

_log = logging.getLogger(__name__)

LAVAPIPE = Path("/usr/share/vulkan/icd.d/lvp_icd.x86_64.json")  # Mesa's Vulkan driver that needs no graphics card
_DRIVER_FOLDERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
_DRIVER_VARIABLES = ("VK_ICD_FILENAMES", "VK_DRIVER_FILES")
_NOTHING_TO_DRAW_WITH = ("graphics adapter", "render context")  # in what the viewer says when it ends
_START_S = 30.0  # longest wait until the viewer listens; it takes about a second
_STOP_S = 5.0  # longest wait until it has ended, before it is killed
_PICTURE_SIZE = 1600, 900

_DISCREET = {"CI": "true"}  # with it the viewer sends no usage statistics


class NoVulkanDriver(SvaBenchError):
    """No working Vulkan driver for a picture."""

    exit_code = ExitCode.FAULT  # of the installation: no other recording or option would do

    def __init__(self) -> None:
        super().__init__()

    def __str__(self) -> str:
        return ("no Vulkan driver to draw with: install the Debian package mesa-vulkan-drivers, or set "
                "VK_ICD_FILENAMES to the .json file of an installed driver")


class ViewerFailed(SvaBenchError):
    """The viewer ended or did not answer."""

    exit_code = ExitCode.FAULT

    def __init__(self, said: str) -> None:
        super().__init__(said)
        self.said = said

    def __str__(self) -> str:
        return f"the Rerun viewer failed: {self.said}"


def view(files: Sequence[Path], *, web: bool, screenshot: Path | None, at_s: float | None,
         say: Callable[[str], None] = _log.info) -> None:
    """Show recordings until the viewer is closed or interrupted.

    Nothing but this machine can reach the viewer, and it is gone when this returns.

    Args:
        files: ``.rrd`` files, as ``recordings_of`` gives them; the first is what is seen first.
        web: In a browser rather than in a window.
        screenshot: Draw a picture of the first into this file instead.
        at_s: Moment of the picture [s]; ``None`` = the end of the mission.
        say: Told where a browser finds the viewer.

    Raises:
        BadInput: If the options contradict each other.
        BadFile: If a recording is damaged.
        NoVulkanDriver: If a picture is wanted and there is nothing to draw it with.
        ViewerFailed: If the viewer ended by itself with an error.
    """
    if web and screenshot is not None:
        raise BadInput("--web and --screenshot exclude each other: leave one out")
    if at_s is not None and screenshot is None:
        raise BadInput("a moment is for a picture: add --screenshot OUT.png, or leave it out")
    if screenshot is not None:
        _picture(files[0], screenshot, at_s)
        return
    if not web and not _has_screen():
        raise BadInput("there is no screen here: use --web, or --screenshot OUT.png")
    for file in files:
        verify(file)
    if web:
        _serve(files, say)
    else:
        _show(files)


def watching(world: World) -> Live:
    """Open the viewer's window for drives of a world, as they are made; it stays until somebody closes it.

    Nothing but this machine can reach it.

    Raises:
        BadInput: If there is no screen.
        ViewerFailed: If the viewer doesn't start.
    """
    refuse_without_screen()
    with holding_back_ctrl_c():
        from sva_bench.recording.live import connected  # as above

    port = _free_port()
    process = subprocess.Popen([*program(), *_at(port), "--expect-data-soon"], env={**os.environ, **_DISCREET},
                               stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                               start_new_session=True)
    try:
        _await(process, port)
    except RuntimeError as error:
        process.kill()
        raise ViewerFailed(f"{error}; leave out --live") from error
    return connected(world, port)


def refuse_without_screen() -> None:
    """Refuse to open a window where there is none.

    Raises:
        BadInput: If there is no screen.
    """
    if not _has_screen():
        raise BadInput("--live opens a window, and there is no screen here: leave it out, and see the recordings "
                       "afterwards with 'sva-bench view' and --web, --screenshot or --video")


def recordings_of(path: Path) -> tuple[Path, ...]:
    """The recordings that a path stands for, those of stochastic plans first.

    Args:
        path: An ``.rrd`` file, or a run folder with ``recordings/``.

    Raises:
        BadInput: If it is neither.
    """
    if path.is_dir():
        files = sorted((path / "recordings").glob("*.rrd"))
        if not files:
            raise BadInput(f"{path} holds no recordings/*.rrd: name a run folder or an .rrd file")
        # Plans from elsewhere may be called anything: theirs have a '+' in the name.
        return tuple(sorted(files, key=lambda file: "+" in file.stem or not file.stem.endswith("-stochastic")))
    if not path.exists():
        raise BadInput(f"there is no {path}: name a run folder or an .rrd file")
    if path.suffix != ".rrd":
        raise BadInput(f"{path} is no recording: name a run folder or an .rrd file")
    return (path,)


def verify(path: Path) -> None:
    """Check that a recording is whole.

    Raises:
        BadFile: If it is cut off or damaged.
    """
    done = subprocess.run([*program(), "rrd", "verify", str(path)], env={**os.environ, **_DISCREET},
                          capture_output=True, check=False)
    if done.returncode or not path.stat().st_size:
        raise BadFile(path, None, "", "the recording is cut off or damaged, or none at all: run `sva-bench run` again")


def drawing_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """An environment in which the viewer finds a Vulkan driver.

    Raises:
        NoVulkanDriver: If there is none, or the one that is asked for doesn't exist.
    """
    for variable in _DRIVER_VARIABLES:
        if asked := environment.get(variable):
            if not any(Path(file).exists() for file in asked.split(":")):
                raise NoVulkanDriver
            return dict(environment)
    if LAVAPIPE.exists():
        return {**environment, "VK_ICD_FILENAMES": str(LAVAPIPE)}
    if not any(list(folder.glob("*.json")) for folder in _DRIVER_FOLDERS):
        raise NoVulkanDriver
    return dict(environment)


def _picture(path: Path, picture: Path, at_s: float | None) -> None:
    if not picture.resolve().parent.is_dir():
        raise BadInput(f"there is no folder {picture.resolve().parent} for the picture")
    if picture.suffix.lower() != ".png":
        raise BadInput(f"{picture} is no name for a picture: let it end in .png")
    verify(path)
    environment = {**drawing_environment(os.environ), "RUST_LOG": "error"}  # notices would cover the picture
    with holding_back_ctrl_c():
        from sva_bench.recording import rerun  # takes half a second to import: only once it is needed
        from sva_bench.recording.pictures import STRIP_PX, without_strip

    port, (width, height) = _free_port(), _PICTURE_SIZE
    command = [*program(), "--headless", "--hide-welcome-screen", "--window-size", f"{width}x{height + STRIP_PX}",
               *_at(port)]
    with (tempfile.TemporaryFile() as said, tempfile.TemporaryDirectory() as folder,
          _running(command, environment, said.fileno()) as process):
        unfinished = Path(folder) / "picture.png"
        try:
            _await(process, port)
            rerun.photograph(port, path, unfinished, rerun.end_s(path) if at_s is None else at_s)
        except (OSError, RuntimeError) as error:
            said.seek(0)
            words = said.read().decode(errors="replace")
            if any(complaint in words for complaint in _NOTHING_TO_DRAW_WITH):
                raise NoVulkanDriver from error
            raise ViewerFailed(words.split("stack backtrace")[0].strip()[:500] or str(error)) from error
        write_file(picture, without_strip(unfinished.read_bytes()), "choose another place with --screenshot")


def _show(files: Sequence[Path]) -> None:
    command = [*program(), *map(str, _last_is_seen(files)), *_at(_free_port())]
    with _running(command, os.environ, None) as process:
        try:
            status = process.wait()
        except KeyboardInterrupt:  # the way to close it
            return
    if status:
        raise ViewerFailed(f"it ended with status {status}; --web needs no window")


def _serve(files: Sequence[Path], say: Callable[[str], None]) -> None:
    """Serve recordings to a browser, and open it where there is a screen."""
    data, page = _free_port(), _free_port()
    command = [*program(), *_at(data), "--serve-web", "--web-viewer-port", str(page)]
    quiet = {**os.environ, "RUST_LOG": "error"}  # it would name several addresses, none of them whole
    with tempfile.TemporaryFile() as said, _running(command, quiet, said.fileno()) as process:
        try:
            _await(process, data)
            _await(process, page)
            with page_of(files, page) as address:
                say(f"{address} shows {_named(files)} in a browser of this machine; Ctrl-C ends it")
                if _has_screen():
                    webbrowser.open(address)
                status = process.wait()
        except KeyboardInterrupt:  # the way to close it
            return
        except RuntimeError as error:
            said.seek(0)
            raise ViewerFailed(said.read().decode(errors="replace").strip()[-500:] or str(error)) from error
    raise ViewerFailed(f"it ended with status {status}")


def _last_is_seen(files: Sequence[Path]) -> list[Path]:
    """Recordings in the order in which the viewer has to be given them: it shows the last."""
    return [*files[1:], files[0]]


def _named(files: Sequence[Path]) -> str:
    return files[0].name if len(files) == 1 else f"{files[0].name} and {counted(len(files) - 1, 'more recording')}"


def _has_screen() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def program() -> list[str]:
    """The viewer's own program: the ``rerun`` command is a wrapper that leaves it running when it is ended itself."""
    package = find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise ViewerFailed("the package rerun-sdk is not installed whole: install it again")
    return [str(Path(package.origin).with_name("rerun"))]


def _at(port: int) -> list[str]:
    return ["--bind", "127.0.0.1", "--port", str(port)]  # it would listen on all interfaces


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def _running(
    command: Sequence[str], environment: Mapping[str, str], output: int | None
) -> Iterator[subprocess.Popen[bytes]]:
    """A process that is ended with the block, and with this program even if that is killed."""
    bound = ["setpriv", "--pdeathsig", "KILL"] if shutil.which("setpriv") else []
    process = subprocess.Popen([*bound, *command], env={**environment, **_DISCREET}, stdin=subprocess.DEVNULL,
                               stdout=output, stderr=output)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _await(process: subprocess.Popen[bytes], port: int) -> None:
    """Wait until the viewer listens.

    Raises:
        RuntimeError: If it ends, or takes too long.
    """
    deadline = time.monotonic() + _START_S
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise RuntimeError(f"it ended with status {process.returncode}")
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise RuntimeError(f"it did not listen within {_START_S:g} s")
