"""What keeps the server from beginning."""


class ServeError(ValueError):
    """The server cannot begin: why, and how to mend it."""
