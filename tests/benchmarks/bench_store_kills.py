"""kill -9 of four writers of one store, 1,000 times: ``python -m tests.benchmarks.bench_store_kills``.

In SQLite, and in PostgreSQL where it is installed; there the server is killed too, after every hundredth writer.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.store.postgres import WHY_NOT, installed, server
from threadpitch.store import open_store

AT_ONCE = 100  # kills between two looks at everything


def batches(address: str, kills: int) -> Iterator[dict[str, object]]:
    """What each batch of kills left; the store goes on."""
    for number in range(kills // AT_ONCE):
        done = subprocess.run([sys.executable, "-m", "tests.store.killed_writers", address, "--kills", str(AT_ONCE),
                               "--seed", str(1000 * number)], capture_output=True, text=True, check=False)
        if not done.stdout:
            raise RuntimeError(done.stderr)
        yield json.loads(done.stdout)


def show(name: str, found: list[dict[str, object]]) -> None:
    """The sums of the batches."""
    sums = {key: sum(int(str(one[key])) for one in found)
            for key in ("kills", "acknowledged_runs", "acknowledged_events", "deletions", "leftovers_removed")}
    faults = [fault for one in found for fault in one["faults"]]  # type: ignore[attr-defined] # a list
    print(f"{name}: {sums['kills']} kill -9 of 4 writers; {sums['acknowledged_runs']} runs and "
          f"{sums['acknowledged_events']} events acknowledged, {sums['deletions']} runs deleted, "
          f"{sums['leftovers_removed']} leftovers removed; {len(faults)} faults {faults or ''}", flush=True)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=1000)
    kills = parser.parse_args().kills
    with tempfile.TemporaryDirectory() as folder:
        show("SQLite", list(batches(str(Path(folder) / "runs.db"), kills)))
    if installed() is None:
        print(f"PostgreSQL: {WHY_NOT}")
        return
    with server(durable=True) as one:
        found = []
        for batch in batches(one.url, kills):
            found.append(batch)
            with open_store(one.url) as store:
                last, runs = store.last_sequence(), store.count()
            one.kill()
            one.start()
            with open_store(one.url) as store:
                assert (store.last_sequence(), store.count()) == (last, runs), "the killed server lost something"
        show("PostgreSQL, whose server was killed after every hundredth", found)


if __name__ == "__main__":
    main()
