"""Recordings for a browser of this machine: a page at one short address that shows one of them at a time.

The viewer gets each recording as a file of its own, whole: what is streamed to it arrives in pieces, and before the
layout it makes up one.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlencode

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
html, body {{ margin: 0; height: 100%; background: #0d0e10; color: #ddd; font: 14px system-ui, sans-serif }}
body {{ display: flex; flex-direction: column }}
header {{ padding: 4px 10px }}
select {{ font: inherit; color: inherit; background: #26282c; border: 1px solid #555; padding: 2px }}
iframe {{ border: 0; flex: 1 }}
</style></head><body>
{header}<iframe title="Rerun viewer" id="viewer" src="{first}"></iframe>
</body></html>
"""
_HEADER = """<header><label>Recording <select onchange="document.getElementById('viewer').src = this.value">
{options}</select></label></header>
"""


@contextmanager
def page_of(files: Sequence[Path], viewer_port: int) -> Iterator[str]:
    """The address of a page of this machine that shows recordings, as long as the block lasts.

    Args:
        files: The recordings; the first is seen first.
        viewer_port: Where this machine serves the viewer.
    """
    viewer = f"http://127.0.0.1:{viewer_port}"

    class Serving(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            number = self.path.removeprefix("/").removesuffix(".rrd")
            if self.path == "/":
                page = _page(files, viewer, f"http://{self.headers['Host'] or ''}")
                self._answer(page.encode("utf-8", "replace"), "text/html; charset=utf-8")
            elif number.isascii() and number.isdigit() and len(number) < 9 and int(number) < len(files):
                self._answer(files[int(number)].read_bytes(), "application/octet-stream")
            else:
                self.send_error(404)

        def _answer(self, content: bytes, kind: str) -> None:
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Access-Control-Allow-Origin", viewer)  # nobody else's pages read them
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_: object) -> None:
            """Nothing on standard error."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Serving) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()


def _page(files: Sequence[Path], viewer: str, here: str) -> str:
    shown = [escape(f"{viewer}/?" + urlencode({
        # Dark, as recordings are made for, and with nothing kept from an earlier visit.
        "url": f"{here}/{number}.rrd", "theme": "dark", "persist": "0", "hide_welcome_screen": "1"}))
        for number in range(len(files))]
    options = "\n".join(f'<option value="{address}">{escape(file.stem)}</option>'
                        for address, file in zip(shown, files, strict=True))
    return _PAGE.format(title=escape(f"{files[0].stem} - sva-bench"), first=shown[0],
                        header=_HEADER.format(options=options) if len(files) > 1 else "")
