"""Masked arrays are refused by all that is public: nothing is to be made of the numbers below."""

import functools
import warnings
from operator import matmul, mul

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg

import toeplitz_mg as tmg
from tests.test_base import OPERATORS
from toeplitz_mg import contact, fractional, halfspace
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
SOLVER = {"A": A.toarray(), "b": ONES, "x0": ONES, "M": np.eye(4), "rtol": 1e-5, "atol": 0.0}

# What is public, and arguments that it takes: each of them is masked in its turn.
USES = {
    "ToeplitzOperator": [
        (tmg.ToeplitzOperator, {"c": ONES, "r": ONES}),
        (tmg.ToeplitzOperator, {"c": SQUARE.c}),
        (tmg.ToeplitzOperator.from_lags, {"lags": np.ones((3, 5))}),
        (A.entries, {"rows": np.arange(4), "columns": np.arange(2)}),
        (A.block, {"index": np.arange(4)}),
    ],
    "CoupledOperator": [
        (tmg.CoupledOperator, {"blocks": GRID}),
        (tmg.CoupledOperator([[A]]).block, {"index": np.arange(4)}),
    ],
    "MaskedOperator": [
        (lambda mask: tmg.MaskedOperator(A, mask), {"mask": MASK}),
        (lambda mask: tmg.MaskedOperator(SQUARE, mask), {"mask": np.ones((2, 3), bool)}),
        (lambda mask: tmg.MaskedOperator(tmg.CoupledOperator([[A]]), mask), {"mask": MASK}),
    ],
    "ToeplitzSum": [
        (lambda diagonal: tmg.ToeplitzSum([(None, A, None)], diagonal), {"diagonal": ONES}),
    ],
    "Interpolation": [
        (tmg.Interpolation, {"weights": (1.0, 1.0)}),
        (lambda mask: tmg.piecewise_constant.coarse_mask(mask, 0), {"mask": MASK}),
        (lambda lags: tmg.piecewise_constant.coarse_lags(lags, 0), {"lags": np.ones(7)}),
    ],
    "cg": [
        (tmg.cg, {**SOLVER, "maxiter": 9}),
        (lambda inner: tmg.cg(A, ONES, inner=inner), {"inner": np.eye(4)}),
    ],
    "gmres": [(tmg.gmres, {**SOLVER, "maxiter": 9, "restart": 3})],
    "richardson": [(tmg.richardson, {**SOLVER, "maxiter": 9})],
    "solve_toeplitz": [
        (tmg.solve_toeplitz, {"c_or_cr": ONES, "b": ONES, "rtol": 1e-12}),
        (lambda c, r: tmg.solve_toeplitz((c, r), ONES), {"c": ONES, "r": ONES}),
        (tmg.solve_toeplitz, {"c_or_cr": np.ones((2, 4)), "b": np.ones((2, 4, 1))}),
    ],
    "toeplitz_inverse": [
        (tmg.toeplitz_inverse, {"A": A.toarray()}),
        (lambda rtol: tmg.toeplitz_inverse(A, rtol=rtol), {"rtol": 1e-8}),
    ],
    "multigrid": [
        (tmg.multigrid, {"A": A.toarray()}),
        (
            lambda **numbers: tmg.multigrid(A, **numbers),
            {"pre": 1, "post": 1, "gamma": 1, "coarsest": 2},
        ),
    ],
    "default_preconditioner": [
        (tmg.default_preconditioner, {"A": A.toarray()}),
        (lambda solves: tmg.default_preconditioner(A, solves=solves), {"solves": 1}),
    ],
    "select_preconditioner": [
        (tmg.select_preconditioner, {"A": A.toarray()}),
        (lambda solves: tmg.select_preconditioner(A, solves=solves), {"solves": 1}),
    ],
    "fft_rsm_preconditioner": [
        (tmg.fft_rsm_preconditioner, {"A": A.toarray()}),
        (lambda gamma: tmg.fft_rsm_preconditioner(A, gamma), {"gamma": 1.0}),
    ],
    "fft_sd_preconditioner": [
        (tmg.fft_sd_preconditioner, {"A": A.toarray()}),
        (lambda k: tmg.fft_sd_preconditioner(A, k), {"k": 2}),
    ],
    "fsai_preconditioner": [
        (tmg.fsai_preconditioner, {"A": A.toarray()}),
        (lambda neighbours: tmg.fsai_preconditioner(A, neighbours=neighbours), {"neighbours": 2}),
    ],
    "jacobi_preconditioner": [
        (tmg.jacobi_preconditioner, {"A": A.toarray()}),
        (lambda omega: tmg.jacobi_preconditioner(A, omega), {"omega": 0.5}),
    ],
    "tau_preconditioner": [
        (tmg.tau_preconditioner, {"A": A.toarray()}),
        (lambda shift: tmg.tau_preconditioner(A, shift=shift), {"shift": 0.5}),
    ],
    **{
        name: [(getattr(tmg, name), {"A": A.toarray()})]
        for name in (
            "chan_preconditioner",
            "cosine_preconditioner",
            "fft_preconditioner",
            "galerkin",
            "sine_preconditioner",
            "spectral_preconditioner",
            "strang_preconditioner",
        )
    },
    "rediscretised": [
        (
            lambda A: tmg.rediscretised(lambda shape: tmg.ToeplitzOperator(np.ones(shape)))(A),
            {"A": A.toarray()},
        )
    ],
    "influence_xx": [(halfspace.influence_xx, {**POINTS, "nu": 0.3})],
    "influence_xy": [(halfspace.influence_xy, {**POINTS, "nu": 0.3})],
    "influence_yy": [(halfspace.influence_yy, {**POINTS, "nu": 0.3})],
    "influence_zz": [(halfspace.influence_zz, {**POINTS, "nu": 0.3})],
    "influence_xz": [(halfspace.influence_xz, {**POINTS, "K": 0.3})],
    "influence_yz": [(halfspace.influence_yz, {**POINTS, "K": 0.3})],
    **{
        name: [(getattr(halfspace, name), {**DEPTHS, "y": 0.0, "element": ELEMENT})]
        for name in ("stresses_x", "stresses_y", "stresses_z")
    },
    **{
        name: [(getattr(halfspace, name), {**DEPTHS, "h": 1.0})]
        for name in ("line_stresses_x", "line_stresses_y", "line_stresses_z")
    },
    "offsets": [(halfspace.offsets, {"grid_shape": SHAPE, "element": ELEMENT})],
    "all_offsets": [(halfspace.all_offsets, {"grid_shape": SHAPE, "element": ELEMENT})],
    "line_contact_coefficients": [
        (
            halfspace.line_contact_coefficients,
            {"n": 4, "h": 1.0, "G": 1.0, "nu": 0.3, "reference": 1.0},
        )
    ],
    "Material": [
        (contact.Material, {"E": 210000.0, "nu": 0.28}),
        (contact.Material.from_shear, {"G": 82000.0, "nu": 0.28}),
    ],
    "CombinedMaterial": [
        (halfspace.CombinedMaterial, {"G": 82000.0, "nu": 0.28, "difference": 0.1})
    ],
    "combined_material": [(halfspace.combined_material, {"first": STEEL, "second": STEEL})],
    "difference_parameter": [(halfspace.difference_parameter, {"first": STEEL, "second": STEEL})],
    "load_curve": [
        (contact.load_curve, {"gap": GRID, **CONTACT, "forces": [1.0, 2.0]}),
        (contact.load_curve, {"gap": GRID, **CONTACT, "approaches": [1.0, 2.0]}),
    ],
    "normal_contact": [
        (contact.normal_contact, {"gap": GRID, **CONTACT, "force": 1.0}),
        (contact.normal_contact, {"gap": GRID, **CONTACT, "approach": 1.0}),
        (
            contact.normal_contact,
            {"gap": ONES, **CONTACT, "element": 1.0, "force": 1.0, "reference": 9.0},
        ),
    ],
    "hertz": [
        (contact.hertz, {"radii": (9.0, 4.0), "material": STEEL, "force": 1.0}),
        (contact.hertz, {"radii": 9.0, "material": STEEL, "approach": 1.0}),
        (
            contact.hertz,
            {"radii": (9.0, np.inf), "material": STEEL, "force": 1.0, "reference": 99.0},
        ),
    ],
    "friction": [
        (contact.friction, {"bound": GRID, **CONTACT, "shift": (1.0, 0.0)}),
        (contact.friction, {"bound": GRID, **CONTACT, "force": (0.1, 0.0)}),
        (
            lambda mu: contact.friction(PRESSED, mu=mu, shift=1.0),
            {"mu": [0.1, 0.2, 0.3, 0.4]},
        ),
    ],
    "frictional_contact": [
        (
            contact.frictional_contact,
            {"gap": GRID, **CONTACT, "mu": 0.3, "force": 1.0, "shift": (1.0, 0.0)},
        ),
        (
            contact.frictional_contact,
            {
                **{"gap": GRID, **CONTACT, "mu": 0.3, "approach": 1.0},
                "tangential_force": (0.1, 0.0),
            },
        ),
    ],
    "frictional_rolling": [
        (
            contact.frictional_rolling,
            {
                **{"gap": GRID, **CONTACT, "mu": 0.3, "force": 1.0, "longitudinal": 1e-3},
                **{"lateral": 1e-3, "spin": 1e-3},
            },
        ),
        (
            contact.frictional_rolling,
            {"gap": GRID, **CONTACT, "mu": 0.3, "force": 1.0, "tangential_force": (0.1, 0.0)},
        ),
    ],
    "subsurface_stresses": [
        (
            lambda depths: contact.subsurface_stresses(PRESSED, depths=depths),
            {"depths": np.ones(2)},
        )
    ],
    "rolling": [
        (
            contact.rolling,
            {"bound": GRID, **CONTACT, "longitudinal": 1e-3, "lateral": 1e-3, "spin": 1e-3},
        )
    ],
    "creep_curve": [
        (contact.creep_curve, {"bound": GRID, **CONTACT, "longitudinal": [0.0, 1e-3]}),
        (contact.creep_curve, {"bound": GRID, **CONTACT, "lateral": 1e-3, "spin": [0.0, 1e-3]}),
    ],
    "kalker_coefficients": [(contact.kalker_coefficients, {"ratio": 1.0, "nu": 0.3, "n": 8})],
    "rolling_steps": [
        (
            lambda **given: next(iter(contact.rolling_steps(**given))),
            {
                **{"bound": GRID, **CONTACT, "longitudinal": 1e-3},
                **{"lateral": 1e-3, "spin": 1e-3, "steps": 1},
            },
        )
    ],
    "influence_matrix": [
        (
            functools.partial(halfspace.influence_matrix, "z"),
            {"grid_shape": SHAPE, "element": ELEMENT, "material": STEEL},
        ),
        (
            functools.partial(halfspace.influence_matrix, "x", (4,), (1.0,), STEEL),
            {"reference": 9.0, "ahead": 1},
        ),
    ],
    "reflection_coefficients": [(tmg.reflection_coefficients, {"c": [4.0, 1.0, 0.5]})],
    "select_method": [(tmg.select_method, {"c_or_cr": [4.0, 1.0, 0.5], "b": [1.0, 2.0, 3.0]})],
    "toeplitz_logdet": [(tmg.toeplitz_logdet, {"c": [4.0, 1.0, 0.5]})],
    "ToeplitzNormal": [
        (tmg.ToeplitzNormal, {"c": [4.0, 1.0, 0.5], "mean": [0.0, 1.0, 0.0]}),
        (PROCESS.logpdf, {"y": [0.0, 1.0, 0.0], "observed": [True, True, False]}),
        (PROCESS.logpdf_and_grad, {"y": [0.0, 1.0, 0.0], "observed": [True, True, False]}),
        (PROCESS.conditional, {"y": [0.0, 1.0, 0.0], "observed": [True, True, False]}),
        (PROCESS.rvs, {"size": 2}),
    ],
    "riesz_coefficients": [(fractional.riesz_coefficients, {"order": 1.5, "n": 4})],
    "grunwald_coefficients": [(fractional.grunwald_coefficients, {"order": 1.5, "n": 4})],
    "centres": [(surfaces.centres, {"shape": SHAPE, "element": ELEMENT})],
    "sphere": [(surfaces.sphere, {"shape": SHAPE, "element": ELEMENT, "radius": 9.0})],
    "ellipsoid": [(surfaces.ellipsoid, {"shape": SHAPE, "element": ELEMENT, "radii": (9.0, 9.0)})],
    "cylinder": [(surfaces.cylinder, {"shape": SHAPE, "element": ELEMENT, "radius": 9.0})],
    "wavy": [
        (
            surfaces.wavy,
            {"shape": SHAPE, "element": ELEMENT, "amplitude": 1.0, "wavelength": 2.0},
        )
    ],
    "rough": [
        (
            surfaces.rough,
            {
                **{"shape": (16, 16), "element": ELEMENT, "rms": 1.0, "hurst": 0.8},
                **{"longest": 8.0, "roll_off": 6.0, "shortest": 4.0},
            },
        )
    ],
    **{name: [(getattr(problems, name), {"n": 16})] for name in ("test1", "test2", "test3")},
}
# What takes no numbers: results and records, warnings, modules, wrappers, and a counter.
WITHOUT_NUMBERS = {
    *("ContactError", "ContactResult", "ContactWarning", "CreepCurve", "HertzContact"),
    "KalkerCoefficients",
    *("FrictionalResult", "NormalResult", "TangentialResult", "load"),
    *("Multigrid", "ProductCount", "SolveInfo", "SteadyOptions", "Stresses", "ToeplitzInverse"),
    *("componentwise", "count_products", "contact", "fractional", "halfspace", "problems"),
    "surfaces",
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
    public = {*tmg.__all__, *contact.__all__, *halfspace.__all__}
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


@pytest.mark.parametrize("operator", OPERATORS.values(), ids=OPERATORS)
def test_products_with_what_is_masked_are_refused(operator):
    """SciPy would take the numbers below the mask."""
    ones = np.ones(operator.shape[0])
    for x in (ones, ones[:, np.newaxis], ones[np.newaxis]):
        for masked in maskings(x):
            for product in PRODUCTS.values():
                with pytest.raises(TypeError, match="masked"):
                    product(operator, masked)


@pytest.mark.parametrize("operator", OPERATORS.values(), ids=OPERATORS)
def test_sums_and_quotients_with_what_is_masked_are_refused(operator):
    for masked in (
        np.ma.masked,
        np.ma.masked_array(2.0),
        np.ma.masked_array(np.eye(operator.shape[0])),
    ):
        for combine in (
            lambda A, x: A / x,
            lambda A, x: A + x,
            lambda A, x: x + A,
            lambda A, x: A - x,
            lambda A, x: x - A,
        ):
            with pytest.raises(TypeError, match="masked"):
                combine(operator, masked)


def test_positions_that_are_masked_are_refused():
    masked = np.ma.masked_array([0, 1], [False, True])
    for operator in (A, tmg.MaskedOperator(A, np.ones(A.grid_shape, bool))):
        for take in (lambda A: A[masked[1], 0], lambda A: A[0, masked[1]], lambda A: A[masked, 0]):
            with pytest.raises((TypeError, IndexError), match="masked"):
                take(operator)
        with pytest.raises(TypeError, match="masked"):
            operator.entries(masked, masked)


def test_products_with_sums_and_multiples_refuse_what_is_masked():
    masked = np.ma.masked_array(ONES, ~MASK)
    diagonal = scipy.sparse.diags_array([1.0, 2.0, 3.0, 4.0])
    for operator in (2.0 * A, -A, A / 2.0, A + A, A - 2.0 * A, A + diagonal, diagonal @ A):
        for product in PRODUCTS.values():
            with pytest.raises(TypeError, match="masked"):
                product(operator, masked)
