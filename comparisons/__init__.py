"""Measurements behind the figures in README and `docs/`; the only place that imports a peer.

``python -m comparisons`` lists the ten commands. `harness` is how all of them measure and report,
`systems` what they measure on, `pages` writes their tables into the pages.
"""
