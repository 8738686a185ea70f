"""Likelihoods of stationary processes: errors, times, gaps, noise that varies, fits.

Errors are against dense factorisations. Times are of CPU on one thread, in turns in one process:
beside one value by the superfast Schur algorithm, the published way of SuperGauss, and a stochastic
estimate, Lanczos's method on ten random vectors; of an exponential covariance beside Levinson's
recursion as SciPy has compiled it, and the recursions in O(n) of celerite2 and statsmodels. D of
A + D is a diagonal of noise that varies. Five series are fitted by statsmodels too, or by dense
matrices where it has no such model; without it, as `pip install --group peers` has it, they are
left out.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from time import process_time
from typing import Any

import numpy as np
import scipy.linalg
from scipy.sparse import diags_array

import toeplitz_mg as tmg
from comparisons import fits
from comparisons.harness import report
from comparisons.harness.inside import GohbergSemencul, levinson_column, schur_column
from comparisons.harness.measuring import TOLERANCE, iterate, time_call, time_in_turns
from comparisons.harness.processes import prepare
from comparisons.harness.report import Row
from comparisons.systems.symbols import column
from toeplitz_mg._typing import Array
from toeplitz_mg.covariances import FractionalGaussianNoise, Matern

SIZES: tuple[int, ...] = tuple(2**k for k in (12, 14, 16, 18, 20))
GAP_SIZES: tuple[int, ...] = tuple(2**k for k in (12, 15, 16))
QUICK_SIZES = (2**10,)
# Points, how many are missing, and how many of these in one gap.
GAPS = [(4383, 541, 200), (10_000, 1984, 200), (20_000, 4000, 0), (65_536, 1000, 1000)]
QUICK_GAPS = [(700, 100, 40)]
RIVAL_SIZES: tuple[int, ...] = tuple(10**k for k in (3, 4, 5, 6))
LENGTH = 20.0  # Of the exponential covariance.
MOST_DENSE = 5000  # Points of which the derivatives are compared with dense ones.
MOST_LEVINSON = 10_000  # Points of which Levinson's recursion is waited for.
NOISE_SIZE = 2**16
DENSE_SIZES: tuple[int, ...] = (600, 2000, 4096)
QUICK_DENSE = (300,)
TIMED = ("fGn, H = 0.9", "0.9^k", "Matérn 3/2, ℓ = 5", "exp(-k/1000)")
PROBES, STEPS = 10, 100  # Random vectors, and steps of Lanczos's method on each.


COVARIANCES: dict[str, Callable[[int], Array]] = {
    "fGn, H = 0.3": FractionalGaussianNoise(hurst=0.3),
    "fGn, H = 0.75": FractionalGaussianNoise(hurst=0.75),
    "fGn, H = 0.99": FractionalGaussianNoise(hurst=0.99),
    "Matérn 3/2, ℓ = 5": Matern(length=5.0, nu=1.5),
    "Matérn 3/2, ℓ = 20": Matern(length=20.0, nu=1.5),
}
NAMED = (
    *("fGn, H = 0.9", "(1+k)^-1.1", "cos k/(k+1)", "0.9^k", "exp(-k/1000)", "Gaussian", "contact"),
    *("|θ|", "|θ|^1.5", "θ²", "2 - 2 cos θ", "sinc", "1/(1 + k²/100)", "Matérn 3/2"),
)


def covariance(name: str, n: int) -> Array:
    """Return a covariance of variance 1."""
    c = COVARIANCES[name](n) if name in COVARIANCES else column(name, n)
    return c / c[0]


def value_by(recursion: Callable[[Array], tuple[Array, Array]], c: Array, y: Array) -> float:
    """Return the log-likelihood by Schur's algorithm, or Levinson's recursion, alone."""
    n = len(c)
    x, gamma = recursion(c)
    logdet = n * np.log(c[0]) + np.arange(n - 1, 0, -1.0) @ np.log1p(-(gamma**2))
    return float(-0.5 * (y @ GohbergSemencul(x).apply(y) + logdet + n * np.log(2 * np.pi)))


def stochastic_logdet(c: Array) -> float:
    """Estimate log det A by Lanczos's method on random signs (stochastic quadrature)."""
    A, n, rng, total = tmg.ToeplitzOperator(c), len(c), np.random.default_rng(0), 0.0
    for _ in range(PROBES):
        Q = rng.choice([-1.0, 1.0], (n, 1)) / np.sqrt(n)
        for _ in range(min(STEPS, n) - 1):
            w = A @ Q[:, -1]
            for _ in range(2):  # Orthogonal to rounding.
                w -= Q @ (Q.T @ w)
            Q = np.column_stack([Q, w / np.linalg.norm(w)])
        values, vectors = np.linalg.eigh(Q.T @ (A @ Q))
        total += n * float(vectors[0] ** 2 @ np.log(values))
    return total / PROBES


def error_of_gradient(by_c: Array, inverse: Array, alpha: Array) -> float:
    """Return the largest error of derivatives over the largest, by A⁻¹ and A⁻¹ y."""
    n = len(alpha)
    exact = np.array([alpha[: n - k] @ alpha[k:] - np.trace(inverse, k) for k in range(n)])
    exact[0] /= 2
    return float(np.abs(by_c - exact).max() / np.abs(exact).max())


def compare_with_dense(name: str, n: int) -> Row:
    """Compare with dense factorisations."""
    c = covariance(name, n)
    A = scipy.linalg.toeplitz(c)
    process = tmg.ToeplitzNormal(c)
    y = process.rvs(random_state=0)
    inverse = tmg.toeplitz_inverse(tmg.ToeplitzOperator(c), rtol=1e-6)
    _, by_c, _ = process.logpdf_and_grad(y)
    exact = 2.0 * np.log(np.linalg.cholesky(A).diagonal()).sum()
    dense = np.linalg.inv(A)
    eigenvalues = scipy.linalg.eigvalsh(A)
    error, said = abs(inverse.logdet - exact), inverse.logdet_error
    row: Row = {"covariance": name, "n": n, "condition": eigenvalues[-1] / eigenvalues[0]}
    row |= {"log det": exact, "error": error / abs(exact), "error said": said / abs(exact)}
    return row | {"error of the gradient": error_of_gradient(by_c, dense, dense @ y)}


def time_likelihood(name: str, n: int) -> Row:
    """Time a value with its gradient, and its rivals."""
    c = covariance(name, n)
    y = np.random.default_rng(0).standard_normal(n)
    contenders: dict[str, Callable[[], Any]] = {
        "value and gradient": lambda: tmg.ToeplitzNormal(c).logpdf_and_grad(y),
        "value": lambda: tmg.ToeplitzNormal(c).logpdf(y),
        "value by Schur": partial(value_by, schur_column, c, y),
    }
    seconds = time_in_turns(contenders)
    row: Row = {"covariance": name, "n": n, **seconds}
    row["ratio"] = seconds["value and gradient"] / seconds["value by Schur"]
    if n <= SIZES[1]:
        value, row["stochastic"] = time_call(partial(stochastic_logdet, c), process_time)
        row["error of stochastic"] = abs(value / tmg.toeplitz_logdet(c) - 1.0)
    return row


def time_gaps(n: int) -> Iterator[Row]:
    """Time the value for one gap, and for a tenth missing at random, and count iterations."""
    rng = np.random.default_rng(0)
    for name in TIMED:
        c, y = covariance(name, n), rng.standard_normal(n)
        one = np.ones(n, dtype=bool)
        one[n // 3 : n // 3 + 1000 * n // 2**16] = False
        random = rng.random(n) > 0.1
        process = tmg.ToeplitzNormal(c)
        row: Row = {"covariance": name, "n": n}
        for key, mask in (("one gap", one), ("at random", random)):
            row[f"missing, {key}"] = int(n - mask.sum())
            try:
                value = partial(tmg.ToeplitzNormal(c).logpdf, y, mask)
                row |= time_in_turns({f"value, {key}": value})
            except ValueError as error:  # What is refused says why.
                row[f"value, {key}"] = None
                row["refused"] = str(error)
        A = tmg.MaskedOperator(process.A, random)
        M = tmg.default_preconditioner(A)
        row["iterations, at random"] = iterate(A, y[random], M=M, rtol=TOLERANCE)[1]
        yield row


def time_gradient_with_gaps(name: str, n: int, missing: int, longest: int) -> Row:
    """Time a value and a gradient with gaps, and compare with the dense one where that is short."""
    rng = np.random.default_rng(0)
    c, y, observed = covariance(name, n), rng.standard_normal(n), np.ones(n, dtype=bool)
    observed[n // 2 : n // 2 + longest] = False
    observed[rng.choice(np.flatnonzero(observed), missing - longest, replace=False)] = False
    y[~observed] = np.nan
    contenders: dict[str, Callable[[], Any]] = {
        "value": lambda: tmg.ToeplitzNormal(c).logpdf(y),
        "value and gradient": lambda: tmg.ToeplitzNormal(c).logpdf_and_grad(y),
    }
    seconds = time_in_turns(contenders)
    row: Row = {"covariance": name, "n": n, "missing": missing, "longest gap": longest, **seconds}
    row["ratio"] = seconds["value and gradient"] / seconds["value"]
    if n <= MOST_DENSE:
        inverse, alpha = np.zeros((n, n)), np.zeros(n)
        inside = np.ix_(observed, observed)
        inverse[inside] = np.linalg.inv(scipy.linalg.toeplitz(c)[inside])
        alpha[observed] = inverse[inside] @ y[observed]
        _, by_c, _ = tmg.ToeplitzNormal(c).logpdf_and_grad(y)
        row["error"] = error_of_gradient(by_c, inverse, alpha)
    return row


def time_rivals(n: int) -> Row:
    """Time a value of an exponential covariance, that of an autoregressive process of order 1."""
    t = np.arange(float(n))
    c = np.exp(-t / LENGTH)
    y = tmg.ToeplitzNormal(c).rvs(random_state=0)
    contenders: dict[str, Callable[[], Any]] = {
        "ToeplitzNormal": lambda: tmg.ToeplitzNormal(c).logpdf(y),
    }
    if n <= MOST_LEVINSON:
        contenders["Levinson"] = partial(value_by, levinson_column, c, y)
    if find_spec("celerite2"):
        celerite2 = import_module("celerite2")

        def by_celerite() -> float:
            process = celerite2.GaussianProcess(celerite2.terms.RealTerm(a=1.0, c=1 / LENGTH))
            process.compute(t, yerr=0.0, check_sorted=False)
            return float(process.log_likelihood(y))

        contenders["celerite2"] = by_celerite
    if find_spec("statsmodels"):
        model = import_module("statsmodels.tsa.statespace.sarimax").SARIMAX(y, order=(1, 0, 0))
        contenders["statsmodels"] = partial(model.loglike, np.array([c[1], 1.0 - c[1] ** 2]))
    values = [run() for run in contenders.values()]
    row: Row = {"n": n, "covariance": f"exp(-k/{LENGTH:g})", **time_in_turns(contenders)}
    row["difference"] = float(np.ptp(values) / abs(values[0]))
    return row


def count_with_noise(name: str, n: int) -> Iterator[Row]:
    """Count the iterations for A + D, where log d is normal of some spread around log 0.1."""
    rng = np.random.default_rng(0)
    A, b = tmg.ToeplitzOperator(covariance(name, n)), rng.standard_normal(n)
    normal = rng.standard_normal(n)
    for spread in (0.1, 0.3, 1.0):
        B = A + diags_array(0.1 * np.exp(spread * normal))
        row: Row = {"covariance": name, "n": n, "spread of log d": spread}
        try:
            M = tmg.default_preconditioner(B)
            row["default"] = iterate(B, b, M=M, rtol=TOLERANCE, maxiter=1000)[1]
        except np.linalg.LinAlgError:
            row["default"] = None
        yield row


def arrange(key: str, rows: Sequence[Row], left_out: Sequence[str] = ()) -> list[Row]:
    """Return rows of a table of `TABLES` as they are printed, without some columns."""
    _, formats = TABLES[key]
    kept = {name: spec for name, spec in formats.items() if name not in left_out}
    return report.format_rows(kept, rows)


def arrange_errors(rows: Sequence[Row]) -> list[Row]:
    """Return the table of errors, in order of the condition numbers."""
    own = [row for row in rows if row["n"] == DENSE_SIZES[0]]
    own.sort(key=lambda row: float(row["condition"]))
    return arrange("errors", own, ("n", "log det"))


def arrange_times(rows: Sequence[Row]) -> list[Row]:
    """Return the table of times of a value with its gradient, and their ratios to Schur's."""

    def cell(row: Row) -> tuple[str, str]:
        seconds = report.format_seconds(row["value and gradient"])
        return f"n = {row['n']}", f"{seconds} ({row['ratio']:.2f})"

    return report.pivot(rows, lambda row: {"covariance": row["covariance"]}, cell)


def arrange_gaps(rows: Sequence[Row]) -> list[Row]:
    """Return the table of times with gaps, and of iterations."""
    return [{k: text or "refused" for k, text in row.items()} for row in arrange("gaps", rows)]


def arrange_noise(rows: Sequence[Row]) -> list[Row]:
    """Return the table of iterations with noise that varies, a column for each spread."""

    def cell(row: Row) -> tuple[str, str]:
        return f"log d ± {row['spread of log d']:g}", str(row.get("default", "refused"))

    return report.pivot(rows, lambda row: {"covariance": row["covariance"]}, cell)


arrange_gap_gradients = partial(arrange, "gap_gradients")
arrange_rivals = partial(arrange, "rivals", left_out=("covariance", "difference"))
SYSTEM = {"covariance": "", "n": "d"}
GAP = {"missing, one gap": "d", "value, one gap": "time"}
GAP |= {"missing, at random": "d", "value, at random": "time", "iterations, at random": "d"}
BOTH = {"value": "time", "value and gradient": "time"}
STOCHASTIC = {"stochastic": "time", "error of stochastic": ".0e"}
RIVALS = dict.fromkeys(("ToeplitzNormal", "Levinson", "celerite2", "statsmodels"), "time")
ERRORS = {"condition": ".0e", "log det": ".6g", "error": ".0e"}
ERRORS |= {"error said": ".0e", "error of the gradient": ".0e"}
# The titles, and how the cells are printed.
TABLES: dict[str, tuple[str, dict[str, str]]] = {
    "errors": (
        "Errors of log det A and of the gradient, against dense factorisations",
        SYSTEM | ERRORS,
    ),
    "times": (
        "Times of a value with its gradient, and of its rivals",
        SYSTEM | BOTH | {"value by Schur": "time", "ratio": ".2f"} | STOCHASTIC,
    ),
    "gaps": ("One gap, and values missing at random", SYSTEM | GAP),
    "gap_gradients": (
        "A gradient with gaps, beside its value",
        SYSTEM | {"missing": "d", "longest gap": "d"} | BOTH | {"ratio": ".1f", "error": ".0e"},
    ),
    "rivals": (
        "CPU times of a value of an exponential covariance",
        SYSTEM | RIVALS | {"difference": ".0e"},
    ),
    "noise": ("Iterations for A + D", SYSTEM | {"spread of log d": "", "default": "d"}),
    "fits": ("Fits of five series", fits.FORMATS),
}


@report.interruptible
def main(argv: Sequence[str] | None = None) -> None:
    """Run the comparison."""
    prepare()
    arguments = report.options("gaussian", "Likelihoods of stationary processes.", argv=argv)
    full = SIZES, DENSE_SIZES, GAP_SIZES, NOISE_SIZE, GAPS, RIVAL_SIZES
    few = QUICK_SIZES, QUICK_DENSE, QUICK_SIZES, QUICK_SIZES[0], QUICK_GAPS, RIVAL_SIZES[:1]
    sizes, dense, gaps, noise, with_gaps, rivals = few if arguments.quick else full
    measured: tuple[Iterator[Row], ...] = (
        (compare_with_dense(name, n) for n in dense for name in (*NAMED, *COVARIANCES)),
        (time_likelihood(name, n) for n in sizes for name in TIMED),
        (row for n in gaps for row in time_gaps(n)),
        (time_gradient_with_gaps(name, *gap) for gap in with_gaps for name in TIMED),
        map(time_rivals, rivals),
        (row for name in TIMED for row in count_with_noise(name, noise)),
        fits.compare(),
    )
    for (key, (title, formats)), rows in zip(TABLES.items(), measured, strict=True):
        path = arguments.output / f"{key}.csv"
        report.Table(title, path, formats, {"covariance": 18}).extend(rows)


if __name__ == "__main__":
    main()
