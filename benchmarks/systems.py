"""Products, preconditioners and solvers of linear systems."""

import numpy as np
import scipy.fft

import toeplitz_mg as tmg

LINE = 2**16  # Unknowns on a line: a transform in four steps.
SIDE = 256  # Points along each side of a grid.


def line(n=LINE):
    """Return the matrix of a kernel that decays slowly, as that of contact does."""
    return tmg.ToeplitzOperator(1.0 / (1.0 + np.arange(n)))


def plane(n=SIDE):
    """Return the matrix of normal contact on n × n square elements."""
    x, y = tmg.halfspace.offsets((n, n), (1.0, 1.0))
    return tmg.ToeplitzOperator(tmg.halfspace.influence_zz(x, y, (1.0, 1.0), G=1.0, nu=0.3))


def islands(n=SIDE):
    """Return a mask of half of the points, at random."""
    return np.random.default_rng(0).random((n, n)) < 0.5


class Products:
    """One product, on a line and on a plane."""

    params = ("line", "plane")

    def setup(self, where):
        """Make the matrix and a vector, and multiply once."""
        self.A = line() if where == "line" else plane()
        self.x = np.ones(self.A.shape[0])
        self.A @ self.x

    def time_product(self, where):
        """A @ x."""
        self.A @ self.x

    def peakmem_product(self, where):
        """Memory of A @ x."""
        self.A @ self.x

    def time_product_of_two_threads(self, where):
        """A @ x, shared by two threads."""
        with scipy.fft.set_workers(2):
            self.A @ self.x


class Solvers:
    """A solution to 10⁻⁸ of a random right-hand side, with the set-up."""

    def setup(self):
        """Make the systems."""
        self.line, self.plane = line(), plane()
        self.part = tmg.MaskedOperator(self.plane, islands())
        draw = np.random.default_rng(1).standard_normal
        self.of_line, self.of_plane, self.of_part = (
            draw(A.shape[0]) for A in (self.line, self.plane, self.part)
        )

    def time_solve_toeplitz(self):
        """The drop-in."""
        tmg.solve_toeplitz(self.line.lags[LINE - 1 :], self.of_line)

    def time_fsai_on_a_line(self):
        """CG with FSAI on a line."""
        M = tmg.fsai_preconditioner(self.line)
        tmg.cg(self.line, self.of_line, M=M, rtol=1e-8)

    def time_cosine_on_a_plane(self):
        """CG with the cosine transform on a plane."""
        M = tmg.cosine_preconditioner(self.plane)
        tmg.cg(self.plane, self.of_plane, M=M, rtol=1e-8)

    def time_default_on_islands(self):
        """CG with the default on half of the points."""
        M = tmg.default_preconditioner(self.part)
        tmg.cg(self.part, self.of_part, M=M, rtol=1e-8)

    def track_iterations_on_islands(self):
        """Iterations of CG with the default on half of the points."""
        residuals = []
        M = tmg.default_preconditioner(self.part)
        tmg.cg(self.part, self.of_part, M=M, rtol=1e-8, residuals=residuals)
        return len(residuals)

    def time_multigrid_on_a_line(self):
        """The paper's solver, on its test 1."""
        problem = tmg.contact.problems.test1(LINE)
        M = tmg.multigrid(problem.A, pre=0)
        tmg.richardson(problem.A, problem.b, M=M, rtol=1e-8)

    def time_inverse(self):
        """The Gohberg–Semencul formula, set up and applied once."""
        tmg.toeplitz_inverse(self.line) @ self.of_line

    def time_likelihood(self):
        """The likelihood of a process, with its gradient."""
        tmg.ToeplitzNormal(0.9 ** np.arange(2**14)).logpdf_and_grad(self.of_line[: 2**14])
