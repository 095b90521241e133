"""Receiver, broker and sender killed at random 50 times: ``python -m tests.benchmarks.bench_receivers``."""

from __future__ import annotations

import sys

from tests.publish.interrupted_receivers import interrupted

KILLS, SEED = 50, 7


def main() -> int:
    """Print the figures."""
    found = interrupted(KILLS, SEED)
    print(f"{KILLS} interruptions {found['kills']} in {found['seconds']} s: {found['written']} values written, "
          f"{found['arrived']} arrived, {'each once, in order' if found['once_in_order'] else 'NOT once in order'}")
    return 0 if found["once_in_order"] else 1


if __name__ == "__main__":
    sys.exit(main())
