"""Fill the gaps of a random field, and draw fields that agree with what was observed.

A field of 256 × 256 points with Matérn's covariance, of which 30 % are missing, with noise in what
is observed. Run it with another size as ``python examples/field_with_gaps.py 64``.
"""

import sys

import numpy as np

import toeplitz_mg as tmg


def covariance(n, length=3.0, noise=0.01):
    """Matérn's covariance of smoothness 3/2, and the variance of the noise."""
    k = np.arange(n)
    r = np.sqrt(3.0) * np.hypot(k[:, None], k) / length
    return (1.0 + r) * np.exp(-r) + noise * (r == 0.0)


if __name__ == "__main__":
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 256
    process = tmg.ToeplitzNormal(covariance(n))
    field = process.rvs(random_state=0)
    observed = np.random.default_rng(1).random((n, n)) > 0.3
    given = process.conditional(np.where(observed, field, np.nan))
    draw = given.rvs(random_state=2)
    errors = [np.mean((x - field)[~observed] ** 2) for x in (given.mean, draw)]
    print(f"{n} x {n}, {np.count_nonzero(~observed)} missing; their variance is 1.01")
    print(f"mean squared errors: of the estimate {errors[0]:.4f}, of a draw {errors[1]:.4f}")
