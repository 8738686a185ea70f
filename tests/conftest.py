"""How hypothesis draws its examples: always the same ones, unless others are asked for.

``pytest -m hypothesis --hypothesis-profile=random --hypothesis-seed=1`` draws others. A failure
that such a run finds is kept in the test, as an ``@example``.
"""

from hypothesis import settings

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.register_profile("random", database=None, deadline=None, print_blob=True)
settings.load_profile("fixed")
