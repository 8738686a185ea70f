#!/usr/bin/env bash
# Build the site into docs/_build/html, without a network: bash docs/build.sh
# It needs '.[plot]' and the group docs: pip install '.[plot]' --group docs
set -euo pipefail
cd "$(dirname "$0")"
rm -rf _build api gallery
# It is to take less than three minutes; seconds of CPU are the same on a machine that is busy.
ulimit -t 180
OPENBLAS_NUM_THREADS=1 "${PYTHON:-python}" -m sphinx -b html -W --keep-going -n -q . _build/html
