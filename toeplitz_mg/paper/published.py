"""The numbers that the paper prints, as far as its tables are legible."""

from typing import NamedTuple


class Published(NamedTuple):
    """Iterations and convergence factor to ‖r‖/‖u‖ ≤ 1e-8 from a random guess."""

    iterations: int
    factor: float


Column = dict[int, Published]  # The key is the binary logarithm of n.

# Table I: spectral radii of the multigrid operators with the plain FFT smoother; coarsest 2 x 1.
SPECTRAL_RADII: dict[str, dict[int, float]] = {
    "V(1,1)": {8: 1.80e0, 16: 1.74e1, 32: 2.49e2, 64: 5.06e3, 128: 1.41e5, 256: 5.20e6},
    "V(1,0)": {8: 2.20e-1, 16: 7.1e-1, 32: 2.60e0, 64: 1.18e1, 128: 6.19e1, 256: 3.75e2},
    "V(0,1)": {8: 2.20e-1, 16: 7.1e-1, 32: 2.60e0, 64: 1.18e1, 128: 6.19e1, 256: 3.75e2},
}

# Tables II and III: multigrid with the FFT+SD smoother, by test and cycle.
DEFLATION: dict[tuple[int, str], Column] = {
    (1, "V(1,0)"): {17: Published(5, 0.0181)},
    (1, "V(0,1)"): {17: Published(5, 0.0230)},
    (2, "V(1,0)"): {17: Published(12, 0.1619)},
    (2, "V(0,1)"): {17: Published(10, 0.1094)},
}

# Tables IV, V and VIII: multigrid with the FFT+RSM smoother, by test and cycle.
ROW_SUM: dict[tuple[int, str], Column] = {
    (1, "V(1,1)"): {16: Published(3, 0.0019)},
    (1, "V(1,0)"): {
        15: Published(6, 0.0430),
        16: Published(6, 0.0388),
        17: Published(5, 0.0244),
        18: Published(5, 0.0215),
        19: Published(5, 0.0190),
        20: Published(4, 0.0089),
    },
    (1, "V(0,1)"): {16: Published(5, 0.0231)},
    (2, "V(1,1)"): {15: Published(4, 0.0051), 18: Published(4, 0.0031)},
    (2, "V(1,0)"): {
        15: Published(8, 0.0630),
        17: Published(7, 0.0444),
        18: Published(6, 0.0308),
        19: Published(6, 0.0278),
        20: Published(6, 0.0251),
    },
    (2, "V(0,1)"): {15: Published(7, 0.0468), 18: Published(6, 0.0264)},
    (3, "V(1,1)"): {15: Published(4, 0.0057), 16: Published(4, 0.0049), 18: Published(3, 0.0014)},
    (3, "V(1,0)"): {
        15: Published(6, 0.0454),
        16: Published(6, 0.0409),
        17: Published(6, 0.0369),
        18: Published(5, 0.0230),
        19: Published(5, 0.0202),
        20: Published(4, 0.0096),
    },
    (3, "V(0,1)"): {15: Published(6, 0.0392), 16: Published(6, 0.0352), 18: Published(5, 0.0190)},
}

# Tables VII and IX: the FFT+RSM solver, by test.
SOLVER: dict[int, Column] = {
    1: {17: Published(28, 0.5126)},
    2: {17: Published(34, 0.5379)},
    3: {
        15: Published(36, 0.5971),
        16: Published(36, 0.5975),
        17: Published(36, 0.5977),
        18: Published(36, 0.5980),
        19: Published(37, 0.6004),
        20: Published(37, 0.6021),
    },
}

# Table VI and §5.3, §5.4: work units at n = 2^20, by test and cycle or "solver".
WORK_UNITS: dict[tuple[int, str], int] = {
    (1, "V(1,1)"): 37,
    (1, "V(1,0)"): 29,
    (1, "V(0,1)"): 29,
    (1, "solver"): 58,
    (2, "V(1,1)"): 37,
    (2, "V(1,0)"): 43,
    (2, "V(0,1)"): 36,
    (2, "solver"): 66,
    (3, "V(1,1)"): 37,
    (3, "V(1,0)"): 29,
    (3, "V(0,1)"): 29,
    (3, "solver"): 78,
}

# §5.2 and §5.4: seconds of CPU at n = 2^20, in Matlab on a Core 2 Duo at 3.17 GHz.
CPU_SECONDS: dict[tuple[int, str], int] = {
    (1, "V(0,1)"): 20,
    (2, "V(0,1)"): 20,
    (3, "V(0,1)"): 21,
    (3, "solver"): 58,
}

# Table VI counts one product for the first residual and these for a cycle.
UNITS_PER_CYCLE: dict[str, int] = {"V(1,1)": 12, "V(1,0)": 7, "V(0,1)": 7}
