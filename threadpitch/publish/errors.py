"""What publishing complains of."""

from __future__ import annotations


class PublishError(ValueError):
    """Values cannot be published: what, where, how to mend it."""
