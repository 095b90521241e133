"""Stored runs looked at in a browser, on this computer only: list, reports, comparison, control chart, live page.

``threadpitch.serve.server.serve`` needs the extra ``serve``; this package itself imports nothing of it.
"""

from threadpitch.serve.errors import ServeError

__all__ = ["ServeError"]
