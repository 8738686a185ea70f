"""The site: from the pages of this folder, the docstrings and the scripts of examples/gallery."""

import importlib
import inspect
import itertools
import sys
import types
import zlib
from pathlib import Path

import matplotlib.pyplot as plt
import sphinx.ext.autosummary
from sphinx.ext.autodoc.mock import mock as autosummary_mock
from sphinx.pycode import ModuleAnalyzer

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent))

import toeplitz_mg  # noqa: E402

project = "toeplitz_mg"
author = copyright = "The toeplitz-mg developers"
release = version = toeplitz_mg.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["_build", "sg_execution_times.rst"]
nitpicky = True

# Pages of the docstrings ---------------------------------------------------------------------
autosummary_generate = True
autodoc_mock_imports = ["mpi4py"]  # It is an extra, and needs an MPI.
autodoc_typehints = "none"  # The docstrings say the types, with shapes and units.
templates_path = ["_templates"]
default_role = "literal"  # Docstrings write names and code as in `A @ x`.
numpydoc_show_class_members = False  # The template of a class lists them.
numpydoc_xref_param_type = False

# Every public name has a page; they stand by what they are for, that is by the package they are of.
PACKAGES = {
    "toeplitz_mg": "Linear systems",
    "toeplitz_mg.contact": "Contact",
    "toeplitz_mg.contact.surfaces": "Surfaces",
    "toeplitz_mg.paper.problems": "Problems of the paper, contact.problems",
    "toeplitz_mg.paper.algorithm": "The paper in one file",
    "toeplitz_mg.halfspace": "Half-spaces",
    "toeplitz_mg.covariances": "Covariances",
    "toeplitz_mg.fractional": "Fractional derivatives",
    "toeplitz_mg.slabs": "Several machines",
}
LAYERS = {
    "operators": "Operators",
    "solvers": "Solvers",
    "preconditioners": "Preconditioners",
    "multigrid_cycle": "Multigrid",
    "gaussian": "Gaussian processes",
    "engine": "Work",
}


def list_names(package):
    """Return the public names of a package that are no modules, each with its layer."""
    found = {}
    for name in getattr(package, "__all__", vars(package)):
        value, is_public = getattr(package, name), not name.startswith("_")
        module = getattr(value, "__module__", "") or ""
        is_listed = hasattr(package, "__all__") or module == package.__name__
        if is_public and is_listed and not inspect.ismodule(value) and module:
            found[name] = module.split(".")[1] if "." in module else ""
    return found


def write_api():
    """Write docs/api/index.rst, a table of the names of each package with links to their pages."""
    lines = ["API", "===", "", "Every public name, from its docstring.", ""]
    listed = []  # What has a page: a body's Material is public twice, but one object.
    with autosummary_mock(autodoc_mock_imports):
        for path, title in PACKAGES.items():
            package = importlib.import_module(path)
            names = list_names(package)
            names = {n: names[n] for n in names if getattr(package, n) not in listed}
            listed += [getattr(package, n) for n in names]
            lines += [title, "-" * len(title), "", f".. currentmodule:: {path}", ""]
            groups = {layer: [n for n in names if names[n] == layer] for layer in LAYERS}
            rest = sorted(set(names) - {n for group in groups.values() for n in group})
            if path != "toeplitz_mg":
                groups, rest = {}, sorted(names)
            for layer, group in [*groups.items(), ("", rest)]:
                if not group:
                    continue
                if layer:
                    lines += [LAYERS[layer], "^" * len(LAYERS[layer]), ""]
                lines += [".. autosummary::", "   :toctree: .", "   :nosignatures:", ""]
                lines += [*(f"   {name}" for name in group), ""]
    folder = DOCS / "api"
    folder.mkdir(exist_ok=True)
    text = "\n".join(lines)
    if not (folder / "index.rst").exists() or (folder / "index.rst").read_text() != text:
        (folder / "index.rst").write_text(text)


def find_summary(doc, _):
    """Return the first paragraph of a docstring: a sentence, in which "Eq. 5" ends nothing."""
    lines = iter(line.strip() for line in doc)
    first = next((line for line in lines if line), "")
    return " ".join([first, *itertools.takewhile(bool, lines)])


def describe_data(app, what, name, value, options, lines):
    """Replace the docstring of a value's class by the one below the value in its module."""
    if isinstance(value, types.UnionType):
        lines[:] = [
            " or ".join(f":obj:`toeplitz_mg.contact.{kind.__name__}`" for kind in value.__args__)
        ]
    elif what == "data":
        found = ModuleAnalyzer.for_module(type(value).__module__).find_attr_docs()
        lines[:] = found.get(("", name.rpartition(".")[2]), lines)


def setup(app):
    """Connect what changes docstrings."""
    app.connect("autodoc-process-docstring", describe_data)


write_api()
sphinx.ext.autosummary.extract_summary = find_summary

# Markdown ------------------------------------------------------------------------------------
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

# Names of other packages ---------------------------------------------------------------------
ADDRESSES = {
    "python": "https://docs.python.org/3/",
    "numpy": "https://numpy.org/doc/stable/",
    "scipy": "https://docs.scipy.org/doc/scipy/",
}


def write_inventory(name):
    """Compress docs/inventories/NAME.txt, so that the names are found without a network."""
    path = DOCS / "_build" / "inventories" / f"{name}.inv"
    path.parent.mkdir(parents=True, exist_ok=True)
    head = f"# Sphinx inventory version 2\n# Project: {name}\n# Version: \n"
    head += "# The remainder of this file is compressed using zlib.\n"
    lines = (DOCS / "inventories" / f"{name}.txt").read_bytes()
    path.write_bytes(head.encode() + zlib.compress(lines))
    return str(path)


intersphinx_mapping = {name: (url, write_inventory(name)) for name, url in ADDRESSES.items()}


# Gallery -------------------------------------------------------------------------------------
def set_sizes(_, __):
    """Draw small pictures with large letters, which are read in thumbnails and on phones too."""
    plt.rcParams.update({"figure.figsize": (4.8, 3.6), "font.size": 13, "figure.dpi": 100})
    plt.rcParams.update({"axes.titlesize": 13, "legend.fontsize": 11})


suppress_warnings = ["config.cache"]  # The function above is not pickled.
sphinx_gallery_conf = {
    "examples_dirs": "../examples/gallery",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/\w+\.py",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "write_computation_times": False,  # Its table needs a network.
    "show_memory": False,
    "show_signature": False,
    "capture_repr": (),
    "reset_modules": ("matplotlib", set_sizes),
    "image_srcset": ["2x"],
    "thumbnail_size": (480, 360),
    "image_scrapers": ("matplotlib",),
}

# Looks ---------------------------------------------------------------------------------------
html_theme = "pydata_sphinx_theme"
html_title = "toeplitz_mg"
html_show_sourcelink = False
html_static_path = ["_static"]
html_css_files = ["narrow.css"]
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "navbar_persistent": ["search-button"],
    "secondary_sidebar_items": {"**": ["page-toc"], "gallery/index": []},
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": True,
    "header_links_before_dropdown": 7,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
