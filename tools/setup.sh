#!/usr/bin/env bash
# Sets up a Debian or Ubuntu machine for gpudem: Debian packages (only where missing), .venv, Python packages.
#
#   bash tools/setup.sh [run] [test] [lint] [docs]
#
# Runs as root or through sudo. A second run with the same pyproject.toml does nothing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
parts=("${@:-run}")
say() { printf 'set-up: %s\n' "$*" >&2; }
die() { say "error: $*"; exit 3; }
wants() { [[ " ${parts[*]} " == *" $1 "* ]]; }

# -- Debian packages ---------------------------------------------------------------------------------------

updated=no
apt_install() { # apt_install PACKAGE...: 0 if installed; says why not
  local root=()
  command -v apt-get >/dev/null || { say "no apt-get here: this set-up is for Debian and Ubuntu"; return 1; }
  if ((EUID != 0)); then
    root=(sudo)
    [[ -t 0 ]] || root=(sudo -n) # nobody there to type a password
    "${root[@]}" true 2>/dev/null || { say "not root, and sudo is not to be had: run 'apt-get install $*' as root"; return 1; }
  fi
  root+=(env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Acquire::Retries=1 -o Acquire::http::Timeout=30)
  local log
  log=$(mktemp)
  if [[ $updated == no ]]; then
    say "apt-get update"
    "${root[@]}" update >"$log" 2>&1 || say "apt-get update failed (no network?); trying with the old lists"
    updated=yes
  fi
  say "apt-get install $*"
  if ! "${root[@]}" -y --no-install-recommends -o Dpkg::Use-Pty=0 install "$@" >"$log" 2>&1; then
    tail -n 3 "$log" >&2
    rm -f "$log"
    return 1
  fi
  rm -f "$log"
}

has_library() { ldconfig -p 2>/dev/null | grep -qF "$1" || /sbin/ldconfig -p 2>/dev/null | grep -qF "$1"; }

liggghts_present() { command -v "${GPUDEM_LIGGGHTS:-liggghts}" >/dev/null; }

install_liggghts() {
  liggghts_present && return
  if [[ -n ${GPUDEM_LIGGGHTS:-} ]]; then say "GPUDEM_LIGGGHTS = $GPUDEM_LIGGGHTS: no such program"; return; fi
  { apt_install liggghts && liggghts_present; } || {
    say "no LIGGGHTS: comparisons use its recorded output; gpudem itself works"
    say "  Debian: apt-get install liggghts; Ubuntu: enable 'universe' first (add-apt-repository universe)"
  }
}

install_libraries() { # VTK loads these by name when it draws without a screen
  local missing=()
  has_library libEGL.so.1 || missing+=(libegl1)
  has_library libGL.so.1 || missing+=(libgl1)
  ((${#missing[@]})) || return 0
  apt_install "${missing[@]}" || say "no ${missing[*]}: the report goes without rendered pictures"
}

install_browser() { # the test that opens the report in headless Chromium
  command -v chromedriver >/dev/null && command -v chromium >/dev/null && return
  apt_install chromium chromium-driver || say "no chromium: the browser test of the report is skipped"
}

# -- Python ------------------------------------------------------------------------------------------------

find_python() { # the newest of these that is >= 3.11 and can make an environment
  local name
  for name in "${PYTHON:-python3}" python3.13 python3.12 python3.11; do
    if "$name" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      "$name" -c "import sys; print(sys.executable)"
      return
    fi
  done
  return 1
}

install_python() {
  python=$(find_python) && return
  apt_install python3 python3-venv || true
  python=$(find_python) && return
  apt_install python3.11 python3.11-venv || true
  python=$(find_python) ||
    die "no Python >= 3.11 with venv (python3 is $(python3 -V 2>&1)); install one, or name it: PYTHON=/path make test"
}

extras_of() { # extras_of PART: of pyproject.toml
  case $1 in
    run) echo compare,registers ;;
    *) echo "$1" ;; # test and lint have extras of their own, which name what else they need
  esac
}

install_packages() { # install_packages EXTRAS
  [[ -x .venv/bin/python ]] && .venv/bin/python -m pip --version >/dev/null 2>&1 || {
    install_python
    say "virtual environment .venv from $python ($("$python" -V))"
    "$python" -m venv --clear .venv || die "could not make .venv with $python"
  }
  say "pip install -e .$1 (a minute or two the first time)"
  PIP_DISABLE_PIP_VERSION_CHECK=1 .venv/bin/python -m pip install -q -e ".$1" || {
    rm -f .venv/gpudem-*
    die "pip could not install the Python packages (see above); without a network, set PIP_FIND_LINKS to a folder of wheels"
  }
}

# -- do what is missing ------------------------------------------------------------------------------------

key="$(sha256sum <pyproject.toml | cut -c1-16) $PWD"
fresh() { [[ -f .venv/gpudem-$1 && $(<".venv/gpudem-$1") == "$key" && -x .venv/bin/python ]]; }

stale=()
for part in "${parts[@]}"; do
  [[ $part =~ ^(run|test|lint|docs)$ ]] || die "unknown part '$part'; known: run, test, lint, docs"
  fresh "$part" || stale+=("$part")
done
if wants run || wants test; then install_liggghts; fi
((${#stale[@]})) || exit 0

start=$SECONDS
if [[ " ${stale[*]} " =~ \ (run|test)\  ]]; then install_libraries; fi
if wants test; then install_browser; fi
extras=$(for part in "${stale[@]}"; do extras_of "$part"; done | paste -sd,)
install_packages "[$extras]"
if wants test; then stale+=(run docs); fi # what tests need covers what a run and the documentation need
for part in "${stale[@]}"; do printf '%s' "$key" >".venv/gpudem-$part"; done
say "done in $((SECONDS - start)) s"
