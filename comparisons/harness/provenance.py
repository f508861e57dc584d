"""Where and with what a comparison was made: commit, packages, hardware, command line."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import platform
import subprocess
import sys
import tomllib
from datetime import UTC, datetime
from pathlib import Path

from comparisons.harness.results import Hardware, Provenance
from gpudem.kernel_cache import kernel_cache
from gpudem.scene import Scene


def collect(command: list[str] | None = None) -> Provenance:
    """Provenance of a comparison made now. What cannot be told is said to be unknown."""
    packages = {d.metadata["Name"]: d.version for d in importlib.metadata.distributions()}
    frozen = "\n".join(f"{name}=={packages[name]}" for name in sorted(packages, key=str.lower))
    hash_, dirty = commit()
    return {
        "commit": hash_,
        "dirty": dirty,
        "command": " ".join(command if command is not None else ["gpudem", *sys.argv[1:]]),
        "date": utc_now(),
        "python": platform.python_version(),
        "os": _os(),
        "hardware": hardware(),
        "packages": dict(sorted(packages.items(), key=lambda item: item[0].lower())),
        "packages_sha256": hashlib.sha256(frozen.encode()).hexdigest(),
    }


def utc_now() -> str:
    """Now, UTC, ISO 8601 to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")


def commit() -> tuple[str, bool]:
    """(short commit of this tree, whether it has uncommitted changes).

    ("unknown", False) outside git, and for a package that is installed or copied into another repository,
    whose commit is not that of the package.
    """
    file = Path(__file__).resolve()
    root = file.parents[2]
    # set within a hook or by `git rebase --exec`, for a repository that need not be this one
    environment = {k: v for k, v in os.environ.items() if not k.startswith("GIT_")}

    def git(*arguments: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(root), *arguments],
            capture_output=True, text=True, check=True, timeout=20, env=environment,
        )  # fmt: skip
        return done.stdout.strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")).resolve() != root or not _is_project(root):
            return "unknown", False
        git("ls-files", "--error-unmatch", str(file))  # else `pip install --target` into a repository
        return git("rev-parse", "--short", "HEAD"), bool(git("status", "--porcelain", "--untracked-files=no"))
    except (OSError, subprocess.SubprocessError):
        return "unknown", False


def _is_project(root: Path) -> bool:
    """Whether a folder is a source tree of this project, by its pyproject.toml."""
    try:
        with (root / "pyproject.toml").open("rb") as stated:
            return tomllib.load(stated)["project"]["name"] == "gpudem"
    except (OSError, ValueError, LookupError, TypeError):
        return False


def hardware() -> Hardware:
    """CPU model, cores this process may use, memory [GiB], GPUs."""
    import psutil

    from gpudem.solver.device import cores

    return {
        "cpu": _cpu_model(),
        "cores": cores(),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "gpus": gpus(),
    }


def gpus() -> list[str]:
    """Names of the CUDA devices that Warp sees; empty without one."""
    import warp

    from gpudem.solver.device import quiet

    with kernel_cache(), quiet():
        warp.init()
    return [f"{d.name} ({d.total_memory / 2**30:.0f} GiB, sm_{d.arch})" for d in warp.get_cuda_devices()]


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.lower().startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine() or "unknown"


def _os() -> str:
    try:
        return f"{platform.freedesktop_os_release()['PRETTY_NAME']}, kernel {platform.release()}"
    except (OSError, KeyError):
        return platform.platform()


def state_hash(scene: Scene) -> str:
    """SHA-256 of the start: positions, velocities, spins, radii and materials as both codes read them."""
    digest, state = hashlib.sha256(), scene.state
    for array in (state.position, state.velocity, state.angular_velocity, state.radius, state.material):
        digest.update(array.tobytes())
    return digest.hexdigest()


def seed(scene: Scene) -> int | None:
    """The seed of the packing, where it has one."""
    return getattr(scene.particles, "seed", None)
