"""The tables of products and solves, of what `comparisons.speed.by_hand` has measured."""

import math
from collections.abc import Mapping, Sequence

from comparisons.harness import report
from comparisons.harness.report import Row

PRODUCT_ROWS = {
    "ours": "this package",
    "ours, ducc0": "… with `ducc0`",
    "fftconvolve": "`scipy.signal.fftconvolve`",
    "matmul_toeplitz": "`scipy.linalg.matmul_toeplitz`",
}
SOLVE_ROWS = {
    "solve_toeplitz": "`solve_toeplitz`",
    "CG + FSAI": "`cg` + FSAI",
    "CG + FSAI, float32": "`cg` + FSAI in float32",
    "CG + FSAI, float32, ducc0": "… with `ducc0`",
    "CG + M": "`cg` + M",
    "CG + cosine": "`cg` + cosine",
    "CG + spectral": "`cg` + spectral",
    "CG + spectral, float32": "`cg` + spectral in float32",
    "V(0,1)": "V(0,1)",
    "plain CG": "CG without preconditioner, by hand",
    "Levinson": "`scipy.linalg.solve_toeplitz`",
    "dense Cholesky": "dense Cholesky",
}


def arrange_products(rows: Sequence[Row]) -> list[Row]:
    """Return the table of products: seconds by hand, ratios to these, and of the limit."""
    limit = {"n": "fraction of the physical limit"} | {
        _power(row["n"]): f"{row['limit']:.2f}" for row in rows if row["method"] == "ours"
    }
    return [*_arrange(rows, "plain", "by hand", PRODUCT_ROWS), limit]


def arrange_solves(rows: Sequence[Row]) -> list[Row]:
    """Return the table of solves: seconds of CG with T. Chan by hand, and ratios to these."""
    own = [row for row in rows if row["symbol"] == "contact"]
    vectors = {row["method"]: row["vectors"] for row in own if row["n"] == 2**20}
    against = "plain CG + T. Chan"
    table = _arrange(own, against, "CG + T. Chan by hand", SOLVE_ROWS)
    for key, cells in zip((against, *SOLVE_ROWS), table, strict=True):
        cells["vectors of n at 2²⁰"] = _two_digits(vectors.get(key))
    return table


def _arrange(rows: Sequence[Row], against: str, title: str, names: Mapping[str, str]) -> list[Row]:
    """Return a line of seconds, and lines of ratios to these; sizes across."""
    table: dict[str, Row] = {key: {"n": text} for key, text in {against: title, **names}.items()}
    for row in rows:
        if row["method"] in names:
            table[row["method"]][_power(row["n"])] = _two_digits(row["ratio"])
        elif row["method"] == against:
            table[against][_power(row["n"])] = report.format_seconds(row["cpu_s"])
    return list(table.values())


def _two_digits(value: float | None) -> str:
    """Return a number with two digits, of more where it is large; nothing where it is none."""
    if value is None or math.isnan(value):
        return ""
    return f"{value:#.2g}".rstrip(".") if value < 100.0 else f"{value:.0f}"


def _power(n: int) -> str:
    """Return 2ᵏ, with its exponent above, for a power of two."""
    digits = str(n.bit_length() - 1).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"2{digits}"
