"""``python -m threadpitch`` and the command ``threadpitch``: light, so that Ctrl-C is answered at once."""

from __future__ import annotations

import sys
from typing import NoReturn


def main() -> NoReturn:
    """Run the command line and leave the process."""
    try:
        from threadpitch.cli import main as run
    except KeyboardInterrupt:
        print("threadpitch: interrupted", file=sys.stderr)
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
