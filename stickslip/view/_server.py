"""A page of the viewer at a port of this machine."""

from collections.abc import Callable
from typing import Any


def start_server(page: Callable[[Any], Any], port: int) -> Any:
    """A server of bokeh with a page, on this machine only, that answers once its loop runs.

    `page`: called with the document of each visitor, which it fills.
    """
    from bokeh.server.server import Server

    server: Any = Server(page, port=port, address="localhost")
    server.start()
    return server


def serve(title: str, page: Callable[[Any], Any], *, port: int, browser: bool) -> None:
    """The page at a port of this machine, until Ctrl-C. Errors: `OSError` for a port in use."""
    server = start_server(page, port)
    print(f"{title}\nhttp://localhost:{server.port}/ (Ctrl-C ends it)", flush=True)
    if browser:
        server.io_loop.add_callback(server.show, "/")
    try:
        server.io_loop.start()
    except KeyboardInterrupt:
        print("The viewer has ended; nothing was changed.")
    finally:
        server.stop()
