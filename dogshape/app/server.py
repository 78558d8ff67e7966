"""Server of the pages, on this machine alone."""

from __future__ import annotations

import logging
import socket
import webbrowser
from os import strerror
from pathlib import Path

from werkzeug.serving import BaseWSGIServer, make_server

from dogshape.app.live_callbacks import build_app
from dogshape.app.live_page import LivePage, open_live_page
from dogshape.app.page import HOST
from dogshape.app.questions_page import NewStudy
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.simulate.ahead import compile_ahead
from dogshape.running import receiver
from dogshape.sim.errors import InputError
from dogshape.sim.interface import argument
from dogshape.study import Study


def start_server(page: LivePage | NewStudy, port: int) -> BaseWSGIServer:
    """Open a page's server on this machine alone; ``port`` 0 takes any free one."""
    try:
        listener = socket.create_server((HOST, port))
    except OSError as error:
        fault = f"port {port} cannot be taken ({strerror(error.errno or 0)})"
        raise InputError(f"{fault}; give another with {argument('port')}") from error
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    number = listener.getsockname()[1]
    descriptor = listener.detach()
    application = build_app(page).server if isinstance(page, LivePage) else page
    return make_server(HOST, number, application, threaded=True, fd=descriptor)


def serve_app(
    study: Study | None = None,
    *,
    surrogate: str | Path | None = None,
    folder: str | Path | None = None,
    port: int = 0,
    browser: bool = True,
    progress: Progress | bool | None = None,
    command: str = "",
) -> None:
    """Serve the live page of a study on this machine until it is interrupted.

    Without a study the page asks for a new one first, and writes its folder.
    ``study``, ``surrogate``, ``folder``, ``command`` as in ``open_live_page``. ``port`` 0 is any
    free one, ``browser`` whether to open the page; ``progress`` receives the address.
    Example: ``ds.serve_app(ds.Study("mq200"), port=8050, progress=True)``
    """
    page: LivePage | NewStudy
    if study is None:
        compile_ahead()
        page = NewStudy(surrogate)
    else:
        page = open_live_page(study, surrogate, folder, command)
    server = start_server(page, port)
    address = f"http://{HOST}:{server.port}/"
    receiver(progress).say(f"{address} (Ctrl-C ends it)")
    if browser:
        webbrowser.open(address)
    server.serve_forever()
