"""A viser server behind a guard: one port, one page, one origin, nothing from the network.

Viser [https://viser.studio] sends the scene to its client in the browser. Its server listens to any page that some
other site may open, takes the next port where its own is in use, and offers to share the scene over a service in the
network. Here a guard stands before it: it binds the port itself, answers only to its own names, opens sockets only for
its own page, and has the browser refuse whatever does not come from it.
"""

from __future__ import annotations

import errno
import functools
import http
import io
import ipaddress
import logging
import socket
import threading
from collections.abc import Awaitable, Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from typing import Any, TypeAlias
from urllib.parse import urlsplit

from rover_gym.extras import require
from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse, whole

#: A connection of a page to the drive; one of the library `websockets`.
Handler: TypeAlias = Callable[[Any], Awaitable[None]]

#: Path of the pages' connection to the drive, beside viser's own at the root.
LIVE_PATH = "/live"
#: What the browser may load and send: nothing but this page's own. Viser's client starts workers and WebAssembly from
#: its own text; its sorter of splats, which nothing here uses, would also need `eval`.
POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' data: blob:",
        "worker-src blob: data:",
        "style-src 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "font-src data:",
        "connect-src 'self' data: blob:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)

_BUILDING = threading.Lock()


@dataclass(frozen=True)
class GuardedServer:
    """A viser server that is running.

    Attributes:
        viser: The server.
        address: Where the page is, as a browser takes it.
    """

    viser: Any
    address: str

    def stop(self) -> None:
        """Closes all connections and frees the port."""
        with redirect_stdout(io.StringIO()):
            self.viser.stop()


def start_guarded(host: str, port: int, page: str, handler: Handler) -> GuardedServer:
    """Starts a viser server that serves a page of ours, with a connection of ours beside its own.

    Args:
        host: Name or address to listen at; "127.0.0.1" refuses other machines.
        port: Port to listen at; 0 for any free one.
        page: The page, HTML.
        handler: Called with each connection to `LIVE_PATH`, in the server's thread.

    Raises:
        OptionError: There is no such host, or the port is in use.
        MissingExtraError: viser is not installed.
    """
    viser = require("viser", "replay")
    messages = require("viser._messages", "replay")
    serving = require("websockets.asyncio.server", "replay")
    listening = _listen(host, port)
    bound = listening.getsockname()[1]
    guard = _Guard(host, page, handler, viser.__version__)
    original, guarded = serving.serve, []

    def serve(theirs: Handler, _host: str, _port: int, *, process_request: Any, **options: Any) -> Any:
        del process_request  # viser's own, which serves its client to anybody
        guarded.append(True)
        return original(
            guard.routes(theirs), sock=listening, process_request=guard.admit, logger=_silent_logger(), **options
        )

    with _BUILDING:  # viser takes the library's function from its module; nobody else may meanwhile
        serving.serve = functools.wraps(original)(serve)
        try:
            with redirect_stdout(io.StringIO()):  # the announcement of its address
                server = viser.ViserServer(host=host, port=bound, verbose=False)
        finally:
            serving.serve = original
    if not guarded:
        server.stop()
        listening.close()
        raise RuntimeError("viser's server has changed: the guard does not stand before it")
    for kind in ("ShareUrlRequest", "ShareUrlDisconnect"):  # the scene is shared with nobody
        server._websock_server.unregister_handler(getattr(messages, kind))
    shown = f"[{host}]" if ":" in host else host
    return GuardedServer(server, f"http://{shown}:{bound}")


def _silent_logger() -> logging.Logger:
    """A logger that says nothing: a browser that vanishes is no error of ours."""
    logger = logging.getLogger(f"{__name__}.websockets")
    logger.setLevel(logging.CRITICAL + 1)
    return logger


def _listen(host: str, port: int) -> socket.socket:
    """A socket that listens at a host's port."""
    number = whole("port", port, at_most=65535)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, number, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError):
        refuse(OptionError, "host", host, "must be a name or an address of this computer")
    listening = socket.socket(family, kind, protocol)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen()
    except OSError as error:
        listening.close()
        if error.errno == errno.EADDRINUSE:
            refuse(OptionError, "port", port, "is in use by another program; choose another one, or 0 for any")
        if error.errno == errno.EADDRNOTAVAIL:
            refuse(OptionError, "host", host, "must be a name or an address of this computer")
        reason = error.strerror or str(error)
        refuse(OptionError, "port", port, f"cannot be opened ({reason})")
    return listening


class _Guard:
    """Decides about each request to the server."""

    def __init__(self, host: str, page: str, handler: Handler, version: str) -> None:
        self._names = {"localhost", host.lower(), socket.gethostname().lower()}
        self._page = page.encode()
        self._handler = handler
        self._protocol = f"viser-v{version}"

    def routes(self, theirs: Handler) -> Handler:
        """Takes connections to the drive to our handler, and others to viser's."""

        async def route(connection: Any) -> None:
            await (self._handler if _path(connection.request) == LIVE_PATH else theirs)(connection)

        return route

    def admit(self, connection: Any, request: Any) -> Any:
        """The answer to a request; None opens a socket."""
        host = _only(request, "Host")
        if host is None or not self._is_ours(host):
            return connection.respond(http.HTTPStatus.MISDIRECTED_REQUEST, "This page has another name.\n")
        if (_only(request, "Upgrade") or "").lower() != "websocket":
            return self._page_at(connection, _path(request))
        origins = request.headers.get_all("Origin")
        if origins and origins != [f"http://{host}"]:
            return connection.respond(http.HTTPStatus.FORBIDDEN, "Other pages may not drive this rover.\n")
        asked = ",".join(request.headers.get_all("Sec-WebSocket-Protocol"))
        if _path(request) != LIVE_PATH and self._protocol not in [one.strip() for one in asked.split(",")]:
            return connection.respond(http.HTTPStatus.BAD_REQUEST, "Only the page's own client is served.\n")
        return None

    def _is_ours(self, host: str) -> bool:
        """Whether a browser asks for this machine by its name: that of a site could be turned to our address."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name in self._names
        return True

    def _page_at(self, connection: Any, path: str) -> Any:
        if path not in ("/", "/index.html"):
            return connection.respond(http.HTTPStatus.NOT_FOUND, "There is nothing here.\n")
        response = connection.respond(http.HTTPStatus.OK, "")
        response.body = self._page
        del response.headers["Content-Type"]
        del response.headers["Content-Length"]
        response.headers["Content-Type"] = "text/html; charset=utf-8"
        response.headers["Content-Length"] = str(len(self._page))
        response.headers["Content-Security-Policy"] = POLICY
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["Cache-Control"] = "no-store"
        return response


def _path(request: Any) -> str:
    return str(request.path).partition("?")[0]


def _only(request: Any, name: str) -> str | None:
    """A header that is given once."""
    values = request.headers.get_all(name)
    return values[0] if len(values) == 1 else None
