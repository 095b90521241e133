"""What building an FMU raises beside ``ModelError``."""


class BuildError(ValueError):
    """An FMU cannot be built: what is missing, and how to mend it."""
