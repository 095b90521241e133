"""What is wrong with a study."""

from __future__ import annotations


class StudyError(ValueError):
    """A study cannot be made: what is wrong, where, and how to mend it."""
