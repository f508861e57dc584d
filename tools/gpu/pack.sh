#!/bin/sh
# Packs what a GPU machine without a network needs into DIR: Warp's CUDA side, the small wheels that gpudem needs
# beside NumPy, SciPy, pandas, matplotlib and psutil, the sources, and those of COMMIT to compare with.
#
#   tools/gpu/pack.sh DIR [COMMIT]        3 minutes of one core the first time, seconds after that
#
#   ARCH=90       architecture of the card: 90 for H100, H200 and GH200; code for others is left out
#   MOST=60       the pack may have so many MiB; more is an error
#   WHEELS="..."  the packages that the machine lacks (pydantic and what it needs, meshio, trimesh)
#
# Without warp-clang.so Warp has its CUDA devices there and cannot compile for its device "cpu". The wheels are those
# for CPython 3.12 on x86-64 Linux. Warp 1.19 needs an NVIDIA driver of the 580 series or newer.
set -eu
dir=${1:?usage: tools/gpu/pack.sh DIR [COMMIT]}; commit=${2:-}; arch=${ARCH:-90}; most=${MOST:-60}
root=$(cd "$(dirname "$0")/../.." && pwd)
python=${PYTHON:-$root/.venv/bin/python}
mkdir -p "$dir"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/wheels"

version=$("$python" -c 'import importlib.metadata as m; print(m.version("warp-lang"))')
warp=$dir/warp-$version-sm_$arch.tar.xz
if [ ! -s "$warp" ]; then
    source=$("$python" -c 'import importlib.util as u, os; print(os.path.dirname(u.find_spec("warp").origin))')
    (cd "$source/.." && tar -cf - --exclude=__pycache__ --exclude=warp-clang.so --exclude='*.pyi' \
        --exclude=warp/tests --exclude=warp/examples --exclude=warp/fem --exclude=warp/_src/fem \
        --exclude=warp/render --exclude=warp/_src/render \
        --exclude='warp/native/*.cpp' --exclude='warp/native/*.cu' warp) | tar -C "$work" -xf - # headers: for NVRTC
    "$python" "$root/tools/gpu/trim.py" "$work/warp/bin/warp.so" "$arch"
    rm -f "$dir"/warp-*.tar.xz
    tar -C "$work" -cf - warp | xz -T1 --x86 --lzma2=preset=6,dict=128MiB -c > "$work/warp.tar.xz"
    mv "$work/warp.tar.xz" "$warp"
fi

for name in ${WHEELS:-pydantic pydantic-core annotated-types typing-inspection meshio trimesh}; do
    wanted=$name==$("$python" -c "import importlib.metadata as m; print(m.version('$name'))")
    "$python" -m pip download -q --disable-pip-version-check --no-deps --only-binary=:all: --python-version 3.12 \
        --implementation cp --platform manylinux_2_28_x86_64 --platform manylinux_2_17_x86_64 \
        --platform manylinux2014_x86_64 -d "$work/wheels" "$wanted"
done
rm -f "$dir"/*.whl
find "$work/wheels" -name '*.whl' -exec mv {} "$dir" \;

# The sources as they stand, whether committed or not: a check of what is being written is a check too.
(cd "$root" && git ls-files -z gpudem comparisons reference tests tools examples pyproject.toml README.md \
    | grep -zv '^reference/liggghts/recorded/.*xz$\|^comparisons/recorded/' \
    | tar --null -T - -cJf "$dir/source.tar.xz")
(cd "$root" && git rev-parse HEAD && git status --porcelain --untracked-files=no | sed 's/^/changed: /') > "$dir/source.txt"
rm -f "$dir/other.tar.xz" "$dir/other.txt"
if [ -n "$commit" ]; then
    git -C "$root" archive "$commit" -- gpudem comparisons reference pyproject.toml \
        ':!comparisons/recorded' ':!reference/liggghts/recorded/*.xz' ':!comparisons/bench/data' | xz > "$dir/other.tar.xz"
    git -C "$root" rev-parse "$commit" > "$dir/other.txt"
fi
cp "$root/tools/gpu/check.sh" "$dir"

bytes=$(cd "$dir" && cat ./* | wc -c)
echo "$dir: $bytes bytes, $(((bytes + 1048575) / 1048576)) MiB"
if [ "$bytes" -gt $((most * 1048576)) ]; then
    echo "$dir: $bytes bytes are more than MOST=$most MiB ($((most * 1048576)) bytes)" >&2
    exit 1
fi
