"""The server of a live drive: one port, one page, one connection to the drive, nothing from the network.

It answers only to its own names and opens sockets only for its own page; the browser refuses whatever does not come
from it.
"""

from __future__ import annotations

import asyncio
import errno
import http
import ipaddress
import logging
import socket
import threading
from collections.abc import Awaitable, Callable
from typing import Any, TypeAlias
from urllib.parse import urlsplit

from rover_gym.core import OptionError
from rover_gym.core.extras import require
from rover_gym.core.validation import refuse, whole

#: A connection of a page to the drive; one of the library `websockets`.
Handler: TypeAlias = Callable[[Any], Awaitable[None]]

#: Path of the pages' connection to the drive.
LIVE_PATH = "/live"
STARTING = 30.0  # s, the longest that the server's thread takes to start or stop


class GuardedServer:
    """Serves a page and its connection to the drive, from a thread of its own.

    Args:
        host: Name or address to listen at; "127.0.0.1" refuses other machines.
        port: Port to listen at; 0 for any free one.
        page: The page, HTML.
        policy: Its content security policy.
        handler: Called with each connection to `LIVE_PATH`, in the server's thread.

    Attributes:
        address: Where the page is, as a browser takes it.

    Raises:
        OptionError: There is no such host, or the port is in use.
        MissingExtraError: websockets is not installed.
    """

    def __init__(self, host: str, port: int, page: str, policy: str, handler: Handler) -> None:
        self._serve = require("websockets.asyncio.server", "replay").serve
        self._listening = _listen(host, port)
        shown = f"[{host}]" if ":" in host else host
        self.address = f"http://{shown}:{self._listening.getsockname()[1]}"
        self._guard, self._handler = _Guard(host, page, policy), handler
        self._loop = asyncio.new_event_loop()
        self._started, self._ending = threading.Event(), asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="live server", daemon=True)
        self._thread.start()
        self._started.wait(STARTING)

    def stop(self) -> None:
        """Closes all connections and frees the port."""
        self._loop.call_soon_threadsafe(self._ending.set)
        self._thread.join(STARTING)

    def _run(self) -> None:
        self._loop.run_until_complete(self._until_the_end())
        self._loop.close()

    async def _until_the_end(self) -> None:
        options = {"sock": self._listening, "process_request": self._guard.admit, "logger": _silent_logger()}
        async with self._serve(self._handler, **options):
            self._started.set()
            await self._ending.wait()


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

    def __init__(self, host: str, page: str, policy: str) -> None:
        self._names = {"localhost", host.lower(), socket.gethostname().lower()}
        self._page, self._policy = page.encode(), policy

    def admit(self, connection: Any, request: Any) -> Any:
        """The answer to a request; None opens a socket."""
        host = _only(request, "Host")
        path = str(request.path).partition("?")[0]
        if host is None or not self._is_ours(host):
            return connection.respond(http.HTTPStatus.MISDIRECTED_REQUEST, "This page has another name.\n")
        if (_only(request, "Upgrade") or "").lower() != "websocket":
            return self._page_at(connection, path)
        origins = request.headers.get_all("Origin")
        if origins and origins != [f"http://{host}"]:
            return connection.respond(http.HTTPStatus.FORBIDDEN, "Other pages may not drive this rover.\n")
        if path != LIVE_PATH:
            return connection.respond(http.HTTPStatus.NOT_FOUND, "There is nothing here.\n")
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
        response.headers["Content-Security-Policy"] = f"{self._policy}; frame-ancestors 'none'"
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["Cache-Control"] = "no-store"
        return response


def _only(request: Any, name: str) -> str | None:
    """A header that is given once."""
    values = request.headers.get_all(name)
    return values[0] if len(values) == 1 else None
