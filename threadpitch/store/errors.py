"""What a store of runs complains of."""

from __future__ import annotations


class StoreError(ValueError):
    """The store cannot do what was asked: what, where, how to mend it."""
