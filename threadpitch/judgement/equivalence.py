"""How large a cause that is not named may still be: the bound that belongs to "not there".

    bound = max over n of |d(n)| + 1.64 u(n)                                          metres

d(n) is what the named causes leave of the deviation of turn n, u(n) its standard uncertainty. Where the largest true
deviation lies in turn m, d(m) is normal about it, so it is at most |d(m)| + 1.64 u(m), and that at most the bound, in
95 of 100 threads, whatever the shape of the fluctuation and however the errors of neighbours are correlated.

That something is not there is a test of equivalence: it may be said where the bound is below what matters, and where it
is not, nothing is known (two one-sided tests; Schuirmann 1987).
"""

from __future__ import annotations

import numpy as np

from threadpitch.trace import FloatArray

NINETY_FIVE = 1.645  # standard deviations that a normal value stays below its mean by less than, in 95 of 100 cases
EXPANDED = 2.0  # uncertainties: a movement of this size is told from nothing in a single turn
WORTH_NAMING = 0.2  # of the thread's largest deviation


def bound(deviation: FloatArray, uncertainty: FloatArray) -> float:
    """max |d(n)| + 1.64 u(n); both (turns,) m."""
    return float(np.max(np.abs(deviation) + NINETY_FIVE * uncertainty, initial=0.0))
