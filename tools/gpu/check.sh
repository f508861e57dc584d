#!/bin/bash
# On a bare machine with a GPU: unpacks what pack.sh made and runs the stages under one time budget.
#
#   tools/gpu/check.sh DIR OUT [--budget SECONDS] [STAGE ...]      (stages: python3 tools/gpu/stages.py --help)
#
# Needs CPython 3.12 with NumPy, SciPy, pandas, matplotlib, psutil and pytest, an NVIDIA driver, and nothing from a network.
set -eu
dir=$(readlink -f "$1"); mkdir -p "$2"; out=$(readlink -f "$2"); shift 2
site=$(mktemp -d); source=$(mktemp -d)
tar -xJf "$dir"/warp-*.tar.xz -C "$site"
tar -xJf "$dir/source.tar.xz" -C "$source"
if [ -s "$dir/other.tar.xz" ]; then
    mkdir "$source/.other"
    tar -xJf "$dir/other.tar.xz" -C "$source/.other"
    cp -r "$source/comparisons/bench/data" "$source/.other/comparisons/bench/" # the same beds for both
    cp "$dir/other.txt" "$out"
fi
cp "$dir/source.txt" "$out"
python3 -m pip install -q --no-index --no-deps --no-compile --no-cache-dir --target "$site" "$dir"/*.whl
export PYTHONPATH=$site:$source PYTHONUNBUFFERED=1 WARP_CACHE_PATH=$source/.cache
cd "$source"
exec python3 tools/gpu/stages.py "$out" "$@"
