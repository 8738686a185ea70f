"""Likelihoods of parametrised covariances, restricted or not, and their maximisation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.special import expit

from toeplitz_mg._typing import Array, Mask, Rows
from toeplitz_mg.covariances import Covariance
from toeplitz_mg.covariances.arma import reflections, with_reflections
from toeplitz_mg.gaussian.information import covariance_information, information_of_contrasts
from toeplitz_mg.gaussian.observed import MOST, Observed, Whole, largest_dense, observe
from toeplitz_mg.operators import ToeplitzOperator

PRECISE = 1e-8  # The search ends at this squared length of a step, in standard errors.
ENOUGH = 1e-4  # The same, if rounding prevents smaller steps.
FLAT = 1e-6  # Below this information, a transformed parameter has reached its bound.
SINGULAR = 1e-9  # Smallest eigenvalue of the correlation of scores for identifiable parameters.
SCORED = 16  # Number of steps by the information; later steps use second derivatives.
DIFFERENCE = 1e-4  # Step of the differences for second derivatives, in transformed parameters.
LONGEST = 8.0  # Largest step of a search, in the logarithm of a parameter.
MOST_REFUSED = 8  # Consecutive steps without a larger likelihood, after which the search ends.


@dataclass(frozen=True)
class Data:
    """A series or field with regressors; values are zero where not observed."""

    y: Array  # Of shape (n,), after subtracting the least squares fit of the regressors.
    Q: Rows  # Orthonormal rows that span the regressors.
    mask: Mask  # Which points are observed, of the shape of the grid.
    restricted: bool  # Whether the likelihood is the restricted one.

    @property
    def size(self) -> int:
        """The number of values in the likelihood."""
        return int(np.count_nonzero(self.mask)) - self.restricted * len(self.Q)


@dataclass(frozen=True)
class Transform:
    """Transformation to parameters without bounds: logarithm for one bound, logit for two.

    Polynomials are transformed by their reflection coefficients, whose bounds are -1 and 1.

    References
    ----------
    O. Barndorff-Nielsen, G. Schou, On the parametrization of autoregressive models by partial
    autocorrelations, J. Multivariate Anal. 3 (1973).
    """

    bounds: Array
    scale: Array  # Scales of the parameters that have no bounds.
    polynomials: tuple[tuple[float, slice], ...] = ()

    @classmethod
    def of(cls, covariance: Covariance, *, is_joint: bool = False) -> "Transform":
        """Return the transformation for the free parameters, polynomials jointly or not."""
        bounds, polynomials = covariance.bounds, covariance._polynomials if is_joint else ()
        for _, where in polynomials:
            bounds[where] = -1.0, 1.0
        return cls(bounds, np.maximum(np.abs(covariance.theta), 1.0), polynomials)

    def forward(self, theta: Array) -> Array:
        """Return the transformed parameters."""
        theta = theta.copy()
        for sign, where in self.polynomials:
            theta[where] = reflections(sign * theta[where])
        low, high = self.bounds.T
        above = np.log(theta - low, out=np.zeros_like(theta), where=np.isfinite(low))
        below = np.log(high - theta, out=np.zeros_like(theta), where=np.isfinite(high))
        return np.where(self._is_free, theta / self.scale, above - below)

    def back(self, u: Array) -> Array:
        """Return the parameters."""
        theta = self._each(u)
        for sign, where in self.polynomials:
            theta[where] = sign * with_reflections(theta[where])[0]
        return theta

    def slopes(self, u: Array) -> Array:
        """Return the derivatives of the parameters, by rows, by the transformed ones."""
        low, high = self.bounds.T
        with np.errstate(over="ignore", invalid="ignore"):
            between = (high - low) * expit(u) * expit(-u)
            each = np.select(self._kinds, (self.scale, np.exp(u), np.exp(-u)), between)
        slopes = np.diag(each)
        for sign, where in self.polynomials:
            by_reflections = with_reflections(self._each(u)[where])[1]
            slopes[where, where] = sign * by_reflections * each[where]
        return slopes

    def _each(self, u: Array) -> Array:
        """Return the parameters, reflection coefficients in the place of polynomials."""
        low, high = self.bounds.T
        with np.errstate(over="ignore", invalid="ignore"):
            near, far = low + (high - low) * expit(u), high - (high - low) * expit(-u)
            values = self.scale * u, low + np.exp(u), high - np.exp(-u), near
        return np.select([*self._kinds, u < 0.0], values, far)

    @property
    def _is_free(self) -> Mask:
        return np.asarray(np.isinf(self.bounds).all(axis=1))

    @property
    def _kinds(self) -> Sequence[Mask]:
        return self._is_free, np.isinf(self.bounds[:, 1]), np.isinf(self.bounds[:, 0])


@dataclass(frozen=True)
class Point:
    """The likelihood of a covariance, maximised over the mean, and its derivatives."""

    data: Data
    c: Array
    derivatives: Array  # Of the covariances by the parameters.

    @cached_property
    def known(self) -> Observed:
        """The covariance of the observed points."""
        if not (np.isfinite(self.c).all() and np.isfinite(self.derivatives).all()):
            raise np.linalg.LinAlgError("the covariance is not finite")
        if not self.c.flat[0] > 0.0:
            raise np.linalg.LinAlgError(f"the variance is {self.c.flat[0]:g}, but must be positive")
        dense = max(MOST, int(largest_dense() / (len(self.derivatives) + 2) ** 0.5))
        return observe(Whole(ToeplitzOperator(self.c)), self.data.mask, dense=dense)

    @cached_property
    def _solved(self) -> Rows:
        """A_oo⁻¹ y, and A_oo⁻¹ of each regressor."""
        return self.known.solve(np.vstack([self.data.y, self.data.Q]))[0]

    @cached_property
    def factor(self) -> Array:
        """The lower Cholesky factor of Q A_oo⁻¹ Qᵀ, the information on the coefficients."""
        return np.linalg.cholesky(self._solved[1:] @ self.data.Q.T)

    @cached_property
    def coefficients(self) -> Array:
        """The generalised least squares coefficients of the regressors."""
        solution: Array = cho_solve((self.factor, True), self.data.Q @ self._solved[0])
        return solution

    @cached_property
    def residual(self) -> tuple[Rows, Array]:
        """α = A_oo⁻¹ r of the residual r, and rᵀ α."""
        return self.known.solve((self.data.y - self.coefficients @ self.data.Q)[np.newaxis])

    @cached_property
    def value(self) -> float:
        """The logarithm of the likelihood."""
        twice = self.residual[1][0] + self.known.logdet() + self.data.size * np.log(2.0 * np.pi)
        if self.data.restricted:
            twice += 2.0 * np.log(self.factor.diagonal()).sum()
        return -0.5 * float(twice)

    @cached_property
    def gradient(self) -> Array:
        """The derivatives of `value` by the parameters."""
        rows = self.residual[0]
        if self.data.restricted:
            rows = np.vstack([rows, self._whitened, np.zeros_like(rows)])
        by_c = self.known.by_covariances(rows)
        total: Array = by_c[0] + (by_c[1:-1] - by_c[-1]).sum(axis=0)
        return self.derivatives.reshape(len(self.derivatives), -1) @ total

    @cached_property
    def information(self) -> Array:
        """The Fisher information on the parameters."""
        information = covariance_information(self.known, self.derivatives)
        if self.data.restricted and len(self.data.Q):
            Z, inside = self._whitened, self.data.mask.ravel()
            information -= information_of_contrasts(self.known, Z, inside, self.derivatives)
        return information

    @cached_property
    def average_information(self) -> Array:
        """qᵢᵀ P qⱼ/2, qᵢ = ∂ᵢA α: about the mean of the expected and the observed information.

        P is A_oo⁻¹ projected to the complement of the regressors. A. R. Gilmour, R. Thompson, B. R.
        Cullis, Average information REML, Biometrics 51 (1995).
        """
        alpha, Z = self.residual[0], self._whitened
        q = [ToeplitzOperator(dc).apply(alpha)[0] for dc in self.derivatives]
        Y = np.array(q) * self.data.mask.ravel()
        X: Array = self.known.solve(Y)[0] - (Y @ Z.T) @ Z
        return 0.5 * (Y @ X.T)

    @property
    def _whitened(self) -> Rows:
        rows: Rows = solve_triangular(self.factor, self._solved[1:], lower=True)
        return rows


class Search:
    """Maximisation of the likelihood by scoring steps in a trust region."""

    def __init__(self, data: Data, covariance: Covariance, spacing: Any, maxiter: int) -> None:
        self.data, self.covariance, self.spacing = data, covariance, spacing
        self.u = np.empty(0)  # The transformed parameters at the maximum.
        self.flat = np.empty(0, dtype=bool)  # Which transformed ones have reached a bound.
        self.iterations, self.converged = 0, True
        self._transform = Transform.of(covariance, is_joint=True)
        self._seconds = b"", np.empty(0)  # Where second derivatives are known, and these.
        self._points: dict[bytes, Point | None] = {}  # The current point and the trial points.
        if len(covariance.theta):
            self._run(covariance.theta, maxiter)

    def point(self, theta: Array) -> Point:
        """Return the likelihood for these parameters."""
        k, shape = self.covariance.with_theta(theta), self.data.mask.shape
        return Point(self.data, *k.values_and_gradient(shape, spacing=self.spacing))

    @property
    def theta(self) -> Array:
        """The parameters at the maximum."""
        return self._transform.back(self.u)

    @property
    def slopes(self) -> Array:
        """Their derivatives by the transformed ones."""
        return self._transform.slopes(self.u)

    @property
    def at_bound(self) -> Mask:
        """Which of them are at a bound: all coefficients of a polynomial with a root at it."""
        found = self.flat.copy()
        for _, where in self._transform.polynomials:
            found[where] = found[where].any()
        return found

    @property
    def best(self) -> Point:
        """The likelihood at the maximum."""
        return self._at(self.u) or self.point(self.theta)

    def _run(self, theta: Array, maxiter: int) -> None:
        from scipy.optimize import minimize  # Slow to import.

        self.u = self._transform.forward(self._rescale(theta))
        self._identify()
        refused = 0

        def model(u: Array) -> Array:
            rests = self._rests(u)
            return np.where(rests | rests[:, np.newaxis], np.eye(len(u)), self._model(u))

        def look(intermediate_result: Any) -> None:
            nonlocal refused
            x = intermediate_result.x
            refused = refused + 1 if np.array_equal(x, self.u) else 0
            self.u, self.iterations = x.copy(), self.iterations + 1
            if self._decrement() <= PRECISE or refused >= MOST_REFUSED:
                raise StopIteration

        minimize(
            lambda u: np.inf if (point := self._at(u)) is None else -point.value,
            self.u,
            jac=lambda u: np.where(self._rests(u), 0.0, self._slope(u)),
            hess=model,
            method="trust-exact",
            callback=look,
            options={"maxiter": maxiter, "max_trust_radius": LONGEST, "gtol": 0.0},
        )
        self.converged = self._decrement() <= ENOUGH

    def _at(self, u: Array) -> Point | None:
        """Return the likelihood, or None if the parameters are invalid."""
        key, here = u.tobytes(), self.u.tobytes()
        if key not in self._points:
            try:
                point = self.point(self._transform.back(u))
                found = point if np.isfinite(point.value) else None
            except ValueError:  # Includes LinAlgError, for a matrix that is not positive definite.
                found = None
            self._points = {k: p for k, p in self._points.items() if k == here} | {key: found}
        return self._points[key]

    def _slope(self, u: Array) -> Array:
        point = self._at(u)
        return np.zeros(len(u)) if point is None else -point.gradient @ self._transform.slopes(u)

    def _curvature(self, u: Array) -> Array:
        point, slopes = self._at(u), self._transform.slopes(u)
        if point is None:
            return np.eye(len(u))
        return slopes.T @ point.average_information @ slopes

    def _rests(self, u: Array) -> Mask:
        """Return which parameters need not come closer to a bound: rounding would grow there."""
        return (self._curvature(u).diagonal() < FLAT) & (np.abs(self._slope(u)) < ENOUGH)

    def _model(self, u: Array) -> Array:
        """Return second derivatives, or information in their place: it is less work."""
        if self.iterations < SCORED:
            return self._curvature(u)
        if self._seconds[0] != u.tobytes():
            steps, slope = DIFFERENCE * np.eye(len(u)), self._slope(u)
            rows = [self._slope(u + step) - slope for step in steps if self._at(u + step)]
            found = np.array(rows) / DIFFERENCE if len(rows) == len(u) else self._curvature(u)
            self._seconds = u.tobytes(), 0.5 * (found + found.T)
        return self._seconds[1]

    def _decrement(self) -> float:
        """Return the squared length of the next step, in standard errors."""
        curvature, slope = self._curvature(self.u), self._slope(self.u)
        self.flat = curvature.diagonal() < FLAT
        rest = ~self.flat
        inside = np.ix_(rest, rest)
        model = self._model(self.u)[inside]
        is_convex = not model.size or np.linalg.eigvalsh(model)[0] > 0.0
        step = np.linalg.lstsq(model if is_convex else curvature[inside], slope[rest])[0]
        return float(slope[rest] @ step)

    def _rescale(self, theta: Array) -> Array:
        """Return the parameters after scaling the covariance to the largest likelihood.

        The variance parameters are those θ for which a 0/1 combination of θ ∂c equals c.
        """
        point = self.point(theta)
        c, slopes = point.c.ravel(), (theta * point.derivatives.T).T.reshape(len(theta), -1)
        weights = np.rint(np.linalg.lstsq(slopes @ slopes.T, slopes @ c)[0])
        chosen = weights == 1.0
        if not (np.allclose(chosen @ slopes, c) and chosen.any()):
            return theta
        scaled = np.where(chosen, point.residual[1][0] / self.data.size * theta, theta)
        return theta if self._at(self._transform.forward(scaled)) is None else scaled

    def _identify(self) -> None:
        """Raise an error if parameters are not identifiable.

        The information may happen to be singular at the start only, so a second point is tried too.
        """
        wrong = find_dependent(self.best.information)
        if wrong.any():
            second = self._at(self.u + 0.1 * np.cos(np.arange(1.0, len(self.u) + 1.0)))
            wrong = wrong if second is None else find_dependent(second.information)
        if wrong.any():
            names = ", ".join(np.asarray(self.covariance.names)[wrong])
            raise ValueError(
                f"the parameters {names} cannot be told apart by what was observed, but each must "
                "change the distribution in its own way: hold some of them, as "
                "covariance.fix(name) does"
                if np.count_nonzero(wrong) > 1
                else f"the distribution does not depend on the parameter {names}, so that it "
                f"cannot be estimated: hold it, as covariance.fix({names!r}) does"
            )


def find_dependent(information: Array) -> Mask:
    """Return which parameters have linearly dependent scores."""
    sizes = np.sqrt(np.maximum(information.diagonal(), 0.0))
    if not sizes.all():
        return sizes == 0.0
    values, vectors = np.linalg.eigh(information / np.outer(sizes, sizes))
    if values[0] > SINGULAR:
        return np.zeros(len(sizes), dtype=bool)
    return np.abs(vectors[:, 0]) > 0.1 * np.abs(vectors[:, 0]).max()
