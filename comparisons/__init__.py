"""Measurements behind the figures in README and `docs/`; the only place that imports a peer.

`harness` is how all of them measure and report, `systems` what they measure on; each other folder
is a subject, and each of its commands runs by ``python -m comparisons.<subject>.<name>``.
"""
