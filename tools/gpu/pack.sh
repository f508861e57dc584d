#!/bin/sh
# Packs what a GPU machine without a network needs into DIR: Warp's CUDA side, the small wheels that gpudem needs
# beside NumPy, SciPy, pandas, matplotlib and psutil, the sources, and those of COMMIT to compare with.
#
#   tools/gpu/pack.sh DIR [COMMIT]        64 MiB; 5 minutes of one core the first time, seconds after that
#
# Without warp-clang.so Warp has its CUDA devices there and cannot compile for its device "cpu". The wheels are those
# for CPython 3.12 on x86-64 Linux; WHEELS="pydantic ... rich click jinja2 pytest-timeout" adds what the machine lacks
# besides. Warp 1.19 needs an NVIDIA driver of the 580 series or newer.
set -eu
dir=${1:?usage: tools/gpu/pack.sh DIR [COMMIT]}; commit=${2:-}
root=$(cd "$(dirname "$0")/../.." && pwd)
python=$root/.venv/bin/python
mkdir -p "$dir"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

version=$("$python" -c 'import importlib.metadata as m; print(m.version("warp-lang"))')
if [ ! -s "$dir/warp-$version.tar.xz" ]; then
    source=$("$python" -c 'import importlib.util as u, os; print(os.path.dirname(u.find_spec("warp").origin))')
    cp -r "$source" "$work/warp"
    rm -rf "$work/warp/tests" "$work/warp/examples" "$work/warp/bin/warp-clang.so" "$work/warp/__init__.pyi"
    rm -rf "$work/warp/fem" "$work/warp/_src/fem" "$work/warp/render" "$work/warp/_src/render"
    rm -f "$work"/warp/native/*.cpp "$work"/warp/native/*.cu # built into warp.so; the headers stay for NVRTC
    find "$work" -name __pycache__ -prune -exec rm -rf {} +
    rm -f "$dir"/warp-*.tar.xz
    tar -C "$work" -cf - warp | xz -T1 --x86 --lzma2=preset=9e,dict=128MiB -c > "$work/warp.tar.xz"
    mv "$work/warp.tar.xz" "$dir/warp-$version.tar.xz"
fi

for name in ${WHEELS:-pydantic pydantic-core annotated-types typing-inspection meshio}; do
    wanted=$name==$("$python" -c "import importlib.metadata as m; print(m.version('$name'))")
    "$python" -m pip download -q --disable-pip-version-check --no-deps --only-binary=:all: --python-version 3.12 \
        --implementation cp --platform manylinux_2_28_x86_64 --platform manylinux_2_17_x86_64 \
        --platform manylinux2014_x86_64 -d "$work/wheels" "$wanted"
done
rm -f "$dir"/*.whl
mv "$work"/wheels/*.whl "$dir"

# The sources as they stand, whether committed or not: a check of what is being written is a check too.
(cd "$root" && git ls-files -z gpudem comparisons reference tests tools examples pyproject.toml README.md \
    | grep -zv '^reference/liggghts/recorded/\|^comparisons/recorded/' \
    | tar --null -T - -cJf "$dir/source.tar.xz")
(cd "$root" && git rev-parse HEAD && git status --porcelain --untracked-files=no | sed 's/^/changed: /') > "$dir/source.txt"
rm -f "$dir/other.tar.xz"
if [ -n "$commit" ]; then
    git -C "$root" archive "$commit" -- gpudem comparisons reference pyproject.toml \
        ':!comparisons/recorded' ':!reference/liggghts/recorded' ':!comparisons/bench/data' | xz > "$dir/other.tar.xz"
    git -C "$root" rev-parse "$commit" > "$dir/other.txt"
fi
du -sh "$dir"
