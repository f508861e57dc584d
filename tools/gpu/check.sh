#!/bin/bash
# On a bare machine with a GPU: unpacks what pack.sh made and runs the stages under one time budget.
#
#   DIR/check.sh DIR OUT [--budget SECONDS] [STAGE ...]      (stages: python3 tools/gpu/stages.py --help)
#
# Needs CPython 3.12 with NumPy, SciPy, pandas, matplotlib, psutil, click, rich, Jinja2, pytest, pytest-timeout,
# pytest-xdist and hypothesis, an NVIDIA driver, and nothing from a network. The time to unpack counts.
#
#   PYTHON=python3   the interpreter
#   CLANG=FILE       Warp's warp-clang.so, which pack.sh leaves out: with it `--rehearse` runs from the pack, without a GPU
set -eu
dir=$(readlink -f "$1"); mkdir -p "$2"; out=$(readlink -f "$2"); shift 2
python=${PYTHON:-python3}
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT
site=$work/site; source=$work/source
mkdir "$site" "$source"
tar -xJf "$dir"/warp-*.tar.xz -C "$site"
tar -xJf "$dir/source.tar.xz" -C "$source"
if [ -s "$dir/other.tar.xz" ]; then
    mkdir "$source/.other"
    tar -xJf "$dir/other.tar.xz" -C "$source/.other"
    cp -r "$source/comparisons/bench/data" "$source/.other/comparisons/bench/" # the same beds for both
    cp "$dir/other.txt" "$out"
fi
if [ -n "${CLANG:-}" ]; then cp "$CLANG" "$site/warp/bin/"; fi
cp "$dir/source.txt" "$out"
"$python" -m pip install -q --no-index --no-deps --no-compile --no-cache-dir --disable-pip-version-check \
    --root-user-action ignore --target "$site" "$dir"/*.whl
export PYTHONPATH=$site:$source PYTHONUNBUFFERED=1 WARP_CACHE_PATH=$work/cache
cd "$source"
"$python" tools/gpu/stages.py "$out" --spent "$SECONDS" "$@"
