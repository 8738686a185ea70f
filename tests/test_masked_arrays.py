"""Masked arrays are refused by all that is public: nothing is to be made of the numbers below."""

import functools
import warnings
from collections import defaultdict
from operator import add, matmul, mul, sub, truediv

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg

import toeplitz_mg as tmg
from tests.systems import PRECONDITIONERS, refuses
from tests.test_base import OPERATORS
from toeplitz_mg import contact, covariances, fractional, halfspace
from toeplitz_mg.contact import problems, surfaces

A = tmg.ToeplitzOperator(0.5 ** np.arange(4.0))
SQUARE = tmg.ToeplitzOperator(0.5 ** np.indices((2, 3)).sum(axis=0))
ONES, GRID, MASK = np.ones(4), np.ones((2, 2)), np.array([True, True, False, True])
PROCESS = tmg.ToeplitzNormal([4.0, 1.0, 0.5])
SHAPE, ELEMENT, STEEL = (2, 2), (1.0, 1.0), contact.Material(E=210000.0, nu=0.28)
POINTS = {"x": ONES, "y": ONES, "element": ELEMENT, "G": 1.0}
DEPTHS = {"x": np.ones(2), "z": np.ones(2), "nu": 0.3}
CONTACT = {"element": ELEMENT, "material": STEEL, "tolerance": 1e-8, "max_products": 99}
with warnings.catch_warnings(action="ignore"):  # Four elements are few.
    PRESSED = contact.normal_contact(ONES, 1.0, material=STEEL, force=1.0)
    CURVE = contact.creep_curve(PRESSED, mu=0.3, longitudinal=[0.0, 1e-3])
    AREA = contact.normal_contact(GRID, ELEMENT, material=STEEL, force=1.0)
SOLVER = {"A": A.toarray(), "b": ONES, "x0": ONES, "M": np.eye(4), "rtol": 1e-5, "atol": 0.0}

USES = defaultdict(list)  # What is public, and arguments that it takes.


def use(function, /, **given):
    """Add a use of a function: each of the arguments is masked in its turn."""
    USES[function.__name__].append((function, given))


def use_as(name, function, /, **given):
    """Add a use of what is public by this name."""
    USES[name].append((function, given))


DENSE = A.toarray()
use(tmg.ToeplitzOperator, c=ONES, r=ONES)
use(tmg.ToeplitzOperator, c=SQUARE.c)
use(tmg.ToeplitzOperator.from_lags, lags=np.ones((3, 5)))
use(tmg.ToeplitzOperator.convolution, h=np.ones(2), shape=3)
use(tmg.HankelOperator, c=ONES, r=ONES)
use_as("HankelOperator", lambda h: tmg.HankelOperator.from_values(h, (3, 3)), h=np.ones(5))
use(tmg.solve_block_toeplitz, c=np.eye(2).reshape(1, 2, 2), b=np.ones((1, 2)), rtol=1e-9)
use(tmg.block_toeplitz_logdet, c=np.eye(2).reshape(1, 2, 2))
use(tmg.matmul_toeplitz, c_or_cr=ONES, x=ONES)
use(tmg.toeplitz_lstsq, A=(ONES, ONES), b=ONES, damp=1.0)
STACKED = tmg.RightPreconditioned(A, tmg.cosine_preconditioner(A))
use_as("RightPreconditioned", STACKED.extend, b=ONES)
use_as("RightPreconditioned", STACKED.solution, y=ONES)
tall = tmg.ToeplitzOperator([1.0, 2.0], [1.0])
use_as("RectangularToeplitz", tall.entries, rows=[0], columns=[0])
use(A.entries, rows=np.arange(4), columns=np.arange(2))
use(A.block, index=np.arange(4))
use(tmg.CoupledOperator, blocks=GRID)
use(tmg.CoupledOperator([[A]]).block, index=np.arange(4))
for full, mask in ((A, MASK), (SQUARE, np.ones((2, 3), bool)), (tmg.CoupledOperator([[A]]), MASK)):
    use_as("MaskedOperator", functools.partial(tmg.MaskedOperator, full), mask=mask)
use_as("ToeplitzSum", functools.partial(tmg.ToeplitzSum, [(None, A, None)]), diagonal=ONES)
use(tmg.Interpolation, weights=(1.0, 1.0))
use_as("coarse_mask", functools.partial(tmg.piecewise_constant.coarse_mask, axis=0), mask=MASK)
coarse_lags = functools.partial(tmg.piecewise_constant.coarse_lags, axis=0)
use_as("coarse_lags", coarse_lags, lags=np.ones(7))
use(tmg.cg, **SOLVER, maxiter=9)
use_as("cg", functools.partial(tmg.cg, A, ONES), inner=np.eye(4))
use(tmg.gmres, **SOLVER, maxiter=9, restart=3)
use(tmg.richardson, **SOLVER, maxiter=9)
use(tmg.solve_toeplitz, c_or_cr=ONES, b=ONES, rtol=1e-12)
use(tmg.solve_toeplitz, c_or_cr=np.ones((2, 4)), b=np.ones((2, 4, 1)))
use_as("solve_toeplitz", lambda c, r: tmg.solve_toeplitz((c, r), ONES), c=ONES, r=ONES)
use(tmg.select_method, c_or_cr=[4.0, 1.0, 0.5], b=[1.0, 2.0, 3.0])
for function in (*PRECONDITIONERS, tmg.select_preconditioner, tmg.toeplitz_inverse, tmg.galerkin):
    use(function, A=DENSE)
use_as("toeplitz_inverse", functools.partial(tmg.toeplitz_inverse, A), rtol=1e-8)
use_as("multigrid", functools.partial(tmg.multigrid, A), pre=1, post=1, gamma=1, coarsest=2)
for function in (tmg.default_preconditioner, tmg.select_preconditioner):
    use_as(function.__name__, functools.partial(function, A), solves=1)
for function, number in (
    (tmg.fft_rsm_preconditioner, {"gamma": 1.0}),
    (tmg.fft_sd_preconditioner, {"n_subdomains": 2}),
    (tmg.fsai_preconditioner, {"neighbours": 2}),
    (tmg.jacobi_preconditioner, {"omega": 0.5}),
    (tmg.tau_preconditioner, {"shift": 0.5}),
):
    use_as(function.__name__, functools.partial(function, A), **number)
use_as("rediscretised", tmg.rediscretised(lambda n: tmg.ToeplitzOperator(np.ones(n))), A=DENSE)
for directions in ("xx", "xy", "yy", "zz"):
    use(getattr(halfspace, f"influence_{directions}"), **POINTS, nu=0.3)
for direction in "xyz":
    use(getattr(halfspace, f"stresses_{direction}"), **DEPTHS, y=0.0, element=ELEMENT)
    use(getattr(halfspace, f"line_stresses_{direction}"), **DEPTHS, h=1.0)
use(halfspace.influence_xz, **POINTS, K=0.3)
use(halfspace.influence_yz, **POINTS, K=0.3)
use(halfspace.offsets, grid_shape=SHAPE, element=ELEMENT)
use(halfspace.all_offsets, grid_shape=SHAPE, element=ELEMENT)
use(halfspace.line_contact_coefficients, n=4, h=1.0, G=1.0, nu=0.3, reference=1.0)
of_strips = functools.partial(halfspace.influence_matrix, "x", (4,), (1.0,), STEEL)
use_as("influence_matrix", of_strips, reference=9.0, ahead=1)
of_grid = functools.partial(halfspace.influence_matrix, "z")
use_as("influence_matrix", of_grid, grid_shape=SHAPE, element=ELEMENT, material=STEEL)
use(contact.Material, E=210000.0, nu=0.28)
use(contact.Material.from_shear, G=82000.0, nu=0.28)
use(halfspace.CombinedMaterial, G=82000.0, nu=0.28, difference=0.1)
use(halfspace.combined_material, first=STEEL, second=STEEL)
use(halfspace.difference_parameter, first=STEEL, second=STEEL)
use(contact.load_curve, gap=GRID, **CONTACT, forces=[1.0, 2.0])
use(contact.load_curve, gap=GRID, **CONTACT, approaches=[1.0, 2.0])
use(contact.normal_contact, gap=GRID, **CONTACT, force=1.0)
use(contact.normal_contact, gap=GRID, **CONTACT, approach=1.0)
use(contact.normal_contact, gap=GRID, **CONTACT, pressure=1.0)
use(contact.normal_contact, gap=ONES, **CONTACT | {"element": 1.0}, force=1.0, reference=9.0)
use(contact.hertz, radii=(9.0, 4.0), material=STEEL, force=1.0)
use(contact.hertz, radii=9.0, material=STEEL, approach=1.0)
use(contact.hertz, radii=(9.0, np.inf), material=STEEL, force=1.0, reference=99.0)
use(contact.friction, bound=GRID, **CONTACT, shift=(1.0, 0.0))
use(contact.friction, bound=GRID, **CONTACT, force=(0.1, 0.0))
use_as("friction", lambda mu: contact.friction(PRESSED, mu=mu, shift=1.0), mu=[0.1, 0.2, 0.3, 0.4])
PRESS = {"gap": GRID, **CONTACT, "mu": 0.3}
use(contact.frictional_contact, **PRESS, force=1.0, shift=(1.0, 0.0))
use(contact.frictional_contact, **PRESS, approach=1.0, tangential_force=(0.1, 0.0))
ROLL = {"longitudinal": 1e-3, "lateral": 1e-3, "spin": 1e-3}
use(contact.frictional_rolling, **PRESS, force=1.0, **ROLL)
use(contact.frictional_rolling, **PRESS, force=1.0, tangential_force=(0.1, 0.0))
stresses_below = functools.partial(contact.subsurface_stresses, PRESSED)
use_as("subsurface_stresses", stresses_below, depths=np.ones(2))
use_as("CreepCurve", CURVE.plot, friction=1.0)
use_as("CreepCurve", CURVE.to_dataframe, friction=1.0)
use_as("NormalResult", AREA.conductance, k1=1.0, k2=1.0)
use(contact.rolling, bound=GRID, **CONTACT, **ROLL)
use(contact.rolling, bound=GRID, **CONTACT, longitudinal=1e-3, falling=(0.3, 0.2, 0.1))
use(contact.creep_curve, bound=GRID, **CONTACT, longitudinal=[0.0, 1e-3])
use(contact.creep_curve, bound=GRID, **CONTACT, lateral=1e-3, spin=[0.0, 1e-3])
use(contact.kalker_coefficients, ratio=1.0, nu=0.3, n=8)
roll_once = {"bound": GRID, **CONTACT, **ROLL, "steps": 1}
use_as("rolling_steps", lambda **given: next(iter(contact.rolling_steps(**given))), **roll_once)
use(tmg.reflection_coefficients, c=[4.0, 1.0, 0.5])
use(tmg.toeplitz_logdet, c=[4.0, 1.0, 0.5])
use(tmg.ToeplitzNormal, c=[4.0, 1.0, 0.5], mean=[0.0, 1.0, 0.0], noise=[0.0, 1.0, 0.0])
for name in ("logpdf", "logpdf_and_grad", "conditional", "leave_one_out", "whiten"):
    ask = functools.partial(getattr(PROCESS, name), [0.0, 1.0, 0.0])  # Masks of y are gaps.
    use_as(name, ask, observed=[True, True, False])
NOISY = tmg.ToeplitzNormal([4.0, 1.0, 0.5], noise=[0.0, 1.0, 0.0])
ask = functools.partial(NOISY.logpdf_estimate, [0.0, 1.0, 0.0])
use_as("logpdf_estimate", ask, observed=[True, True, False], probes=3)
use_as("forecast", functools.partial(PROCESS.forecast, [0.0, 1.0]), steps=1)
use(PROCESS.colorize, z=[0.0, 1.0, 0.0])
use(PROCESS.conditional([0.0, np.nan, 0.0]).interval, confidence=0.9)
use(PROCESS.rvs, size=2)
to_fit = functools.partial(PROCESS.fit, [0.0, 1.0, 0.5, 2.0], covariances.WhiteNoise())
use_as("NormalFit", to_fit, mean=[0.0, 0.0, 0.0, 1.0], X=[1.0, 2.0, 0.0, 1.0], maxiter=9)
use_as("NormalFit", to_fit().intervals, confidence=0.9)
use_as("NormalFit", to_fit(X=[1.0, 2.0, 0.0, 1.0]).predict, steps=2, X=[1.0, 0.0], noise=0.1)
use(fractional.riesz_coefficients, order=1.5, n=4)
use(fractional.grunwald_coefficients, order=1.5, n=4)
use(covariances.WhiteNoise, variance=1.0)
use(covariances.SquaredExponential, variance=1.0, length=1.0)
use(covariances.Periodic, variance=1.0, length=1.0, period=1.0)
use(covariances.DampedCosine, variance=1.0, length=1.0, period=1.0)
use(covariances.FractionalGaussianNoise, variance=1.0, hurst=0.7)
use(covariances.ARMA, sigma2=1.0, ar=[0.3, 0.1], ma=[0.2])
use(covariances.ARFIMA, sigma2=1.0, d=0.2, ar=[0.3, 0.1], ma=[0.2])
use(covariances.Exponential, variance=1.0, length=(1.0, 2.0))
use(covariances.Matern, variance=1.0, length=1.0, nu=1.5)
custom = functools.partial(covariances.Custom, np.multiply, ["x", "y"])
use_as("Custom", custom, theta=[1.0, 2.0], bounds=[(0.0, 2.0), (1.0, 3.0)])
use_as("Covariance", covariances.Exponential().with_theta, theta=[1.0, 2.0])
use(surfaces.centres, shape=SHAPE, element=ELEMENT)
use(surfaces.sphere, shape=SHAPE, element=ELEMENT, radius=9.0)
use(surfaces.ellipsoid, shape=SHAPE, element=ELEMENT, radii=(9.0, 9.0))
use(surfaces.cylinder, shape=SHAPE, element=ELEMENT, radius=9.0)
use(surfaces.wavy, shape=SHAPE, element=ELEMENT, amplitude=1.0, wavelength=2.0)
waves = {"hurst": 0.8, "longest": 8.0, "roll_off": 6.0, "shortest": 4.0}
use(surfaces.rough, shape=(16, 16), element=ELEMENT, rms=1.0, **waves)
profile = np.c_[np.arange(-4.0, 5.0), np.arange(-4.0, 5.0) ** 2]
profiles = {"wheel": profile, "rail": -profile, "radius": 99.0, "lateral": 0.0, "roll": 0.0}
use(surfaces.wheel_rail, shape=SHAPE, element=ELEMENT, **profiles, smoothing=0.0)
for problem in (problems.test1, problems.test2, problems.test3):
    use(problem, n=16)
# What takes no numbers: results and records, warnings, modules, wrappers, and a counter.
WITHOUT_NUMBERS = {
    *("ContactError", "ContactResult", "ContactWarning", "HertzContact"),
    "KalkerCoefficients",
    *("FrictionalResult", "TangentialResult", "load"),
    "LeastSquaresInfo",
    *("Multigrid", "ProductCount", "SolveInfo", "SteadyOptions", "Stresses", "ToeplitzInverse"),
    *("componentwise", "count_products", "contact", "covariances", "fractional", "halfspace"),
    *("problems", "surfaces", "use_transforms", "LoadCurve", "RollingSteps"),
    *("ContactError", "ContactResult", "ContactWarning", "HertzContact", "load"),
    "interfacial_stiffness",
    *("FrictionalResult", "KalkerCoefficients", "LeastSquaresInfo", "Multigrid", "NormalResult"),
    *("ProductCount", "SolveInfo", "SteadyOptions", "Stresses", "TangentialResult"),
    *("ToeplitzInverse", "componentwise", "count_products", "use_transforms", "contact"),
    *("covariances", "fractional", "halfspace", "problems", "surfaces"),
    *("linear_interpolation", "modulated_interpolation", "piecewise_constant"),
}


def maskings(value):
    """Yield a value with something masked in it, in all ways that NumPy has."""
    array = np.asarray(value)
    hidden = np.arange(array.size).reshape(array.shape) == array.size - 1
    yield np.ma.masked_array(array, hidden)
    yield np.ma.masked_array(array)
    if array.ndim == 0:
        yield np.ma.masked
    else:
        sequence = tuple if isinstance(value, tuple) else list
        yield sequence(np.ma.masked_array(a, h) for a, h in zip(array, hidden, strict=True))
        yield sequence([*array[:-1].tolist(), np.ma.masked])


def test_all_that_is_public_is_tried():
    public = {*tmg.__all__, *contact.__all__, *halfspace.__all__, *covariances.__all__}
    public |= {
        name
        for module in (surfaces, problems, fractional)
        for name, value in vars(module).items()
        if getattr(value, "__module__", "") == module.__name__
        and not isinstance(value, type)
        and not name.startswith("_")
    }
    assert set(USES) | WITHOUT_NUMBERS >= public


@pytest.mark.parametrize("uses", USES.values(), ids=USES)
def test_masked_arguments_are_refused(uses):
    for function, given in uses:
        for name, value in given.items():
            for masked in maskings(value):
                # A matrix that is to be an operator must not be an array at all.
                with pytest.raises(TypeError, match=r"is a masked array|, but must "):
                    function(**{**given, name: masked})


PRODUCTS = {
    "A @ x": matmul,
    "A * x": mul,
    "x @ A": lambda A, x: x @ A,
    "x * A": lambda A, x: x * A,
    **{
        name: lambda A, x, name=name: getattr(A, name)(x)
        for name in ("dot", "matvec", "matmat", "rmatvec", "rmatmat", "rdot")
        if hasattr(scipy.sparse.linalg.LinearOperator, name)  # SciPy 1.17 has no rdot.
    },
}


D = scipy.sparse.diags_array([1.0, 2.0, 3.0, 4.0])
SUMS = (2.0 * A, -A, A / 2.0, A + A, A - 2.0 * A, A + D, D @ A)


@pytest.mark.parametrize("operator", [*OPERATORS.values(), *SUMS], ids=repr)
def test_products_with_what_is_masked_are_refused(operator):
    """SciPy would take the numbers below the mask."""
    ones = np.ones(operator.shape[0])
    for x in (ones, ones[:, np.newaxis], ones[np.newaxis]):
        for masked in maskings(x):
            for product in PRODUCTS.values():
                refuses(TypeError, "masked", product, operator, masked)


@pytest.mark.parametrize("operator", OPERATORS.values(), ids=OPERATORS)
def test_sums_and_quotients_with_what_is_masked_are_refused(operator):
    for masked in (
        np.ma.masked,
        np.ma.masked_array(2.0),
        np.ma.masked_array(np.eye(operator.shape[0])),
    ):
        for combine in (truediv, add, sub):
            refuses(TypeError, "masked", combine, operator, masked)
        for combine in (add, sub):
            refuses(TypeError, "masked", combine, masked, operator)


def test_positions_that_are_masked_are_refused():
    masked = np.ma.masked_array([0, 1], [False, True])
    for operator in (A, tmg.MaskedOperator(A, np.ones(A.grid_shape, bool))):
        for take in (lambda A: A[masked[1], 0], lambda A: A[0, masked[1]], lambda A: A[masked, 0]):
            refuses((TypeError, IndexError), "masked", take, operator)
        refuses(TypeError, "masked", operator.entries, masked, masked)
