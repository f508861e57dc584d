"""The stages of a check on a GPU, in turn, under one time budget; each writes its result to OUT at once.

    python tools/gpu/stages.py OUT [--budget 480] [STAGE ...]
    python tools/gpu/stages.py OUT --rehearse          # on the CPU, small: what can be checked without a GPU

device   Warp, driver, card; whether Warp's own compiled device code runs there
tests    pytest -m gpu
bench    gpudem bench --device cuda:0: rates of beds by size and precision, bandwidth of memory
kernels  time of each kernel of a step and of a rebuild
step     time of a step of the box of Park et al. (2014) with its real modulus, as its balls fall and settle
lanes    time of a step with several threads a particle, beds of 5000 to 120 000 balls
turns    the sources against those of another commit (pack.sh DIR COMMIT), both in turn
ncu      Nsight Compute on the step kernel: registers, occupancy, throughput, stalls
paper    the box of Park et al. (2014) with its real modulus: three gates of 1 500 000 steps

summary.json says of each stage: ended, failed, stopped at its limit, or left out since the budget was spent.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: Where pack.sh's other commit was unpacked.
OTHER = Path(".other")
#: Stage -> seconds at most; without names, all but `paper` in this order.
LIMITS = {
    "device": 30,
    "tests": 110,
    "bench": 100,
    "kernels": 40,
    "step": 45,
    "lanes": 45,
    "turns": 60,
    "ncu": 50,
    "paper": 330,
}
DEFAULT = tuple(stage for stage in LIMITS if stage != "paper")


def commands(stage: str, out: Path, rehearse: bool) -> list[list[str]]:
    """What a stage runs, one after the other; nothing where it cannot be rehearsed."""
    python, device = sys.executable, "cpu" if rehearse else "cuda:0"
    if stage in ("device", "kernels", "step", "lanes", "paper"):
        return [[python, __file__, str(out), "--inside", stage, *(["--rehearse"] if rehearse else [])]]
    if stage == "tests":
        chosen = ["--collect-only"] if rehearse else ["-n", "5", "-p", "no:benchmark"]
        return [
            [python, "-m", "pytest", "-m", "gpu", "tests/gpudem", "-q", "-p", "no:cacheprovider", *chosen]
        ]
    beds = ["--device", device, "--sizes", "500" if rehearse else "1000000,120000,5000"]
    if stage == "bench":
        precisions = "mixed" if rehearse else "mixed,float64,float32"
        size = ["--cores", "1", "--budget", "2e5" if rehearse else "1e7", "--repeats", "1"]
        to = ["--no-liggghts", "--precision", precisions, "--out", str(out / "bench.json")]
        return [[python, "-m", "comparisons", "bench", *beds, *to, *size]]
    if stage == "turns":
        size = ["--turn-steps", "1e4", "--threads", "1"] if rehearse else ["--turn-steps", "5e7"]
        compare = [
            python,
            "tools/compare_speed.py",
            str(OTHER),
            ".",
            *beds,
            "--turns",
            "2" if rehearse else "9",
        ]
        return [[*compare, *size]] if OTHER.is_dir() else []
    profile = ["ncu", "--set", "full", "-k", "regex:step", "-s", "40", "-c", "1", "--clock-control", "none"]
    inside = [python, __file__, str(out), "--inside"]
    return [] if rehearse else [[*profile, *inside, f"steps_{p}"] for p in ("mixed", "float64")]


def run(command: list[str], log: Path, seconds: float) -> str:
    """ended, failed or stopped; what it prints goes to a log and to the terminal."""
    with log.open("a") as file:
        file.write(f"$ {' '.join(command)}\n")
        file.flush()
        started = log.stat().st_size
        try:
            process = subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT, start_new_session=True)
        except FileNotFoundError:
            file.write(f"{command[0]}: not here\n")
            return "failed"
        try:
            status = "failed" if process.wait(seconds) else "ended"
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            status = "stopped"
    print(log.read_text(errors="replace")[started:][-3000:], flush=True)
    return status


def check(
    stages: list[str], out: Path, budget: float, rehearse: bool, spent: float = 0.0
) -> list[dict[str, Any]]:
    """Run the stages while the budget [s] lasts, of which `spent` is gone; a stage gets what is left, at most
    its limit.
    """
    began, rows = time.monotonic() - spent, []
    for stage in stages:
        start, status = time.monotonic(), "left out: nothing to run"
        for command in commands(stage, out, rehearse):
            left = min(LIMITS[stage] - (time.monotonic() - start), budget - (time.monotonic() - began))
            if left < 1:
                status = "left out: the budget is spent" if status.startswith("left out") else "stopped"
                break
            ended = run(command, out / f"{stage}.log", left)
            status = ended if status in ("left out: nothing to run", "ended") else status
        rows.append({"stage": stage, "status": status, "seconds": round(time.monotonic() - start, 1)})
        (out / "summary.json").write_text(json.dumps(rows, indent=1))
        print(f"== {stage}: {status}, {rows[-1]['seconds']} s", flush=True)
    return rows


# -- what runs inside a process of its own -------------------------------------------------------------------


def device_stage(out: Path, device: str) -> None:
    """The machine. Raises SystemExit: Warp's device code sorts wrongly (pack.sh keeps one architecture's)."""
    import numpy as np
    import warp as wp

    wp.init()
    found = wp.get_device(device)
    facts: dict[str, Any] = {
        "date": time.strftime("%Y-%m-%d", time.gmtime()), "command": "tools/gpu/check.sh DIR OUT",
        "warp": wp.config.version, "device": device, "name": found.name, "host_cores": os.cpu_count(),
    }  # fmt: skip
    if found.is_cuda:
        facts |= {"arch": found.arch, "memory_bytes": found.total_memory,
                  "memory_pool": wp.is_mempool_supported(device)}  # fmt: skip
        smi = [
            "nvidia-smi",
            "--query-gpu=name,driver_version,clocks.sm,clocks.mem,power.limit",
            "--format=csv",
        ]
        facts["nvidia_smi"] = subprocess.run(smi, capture_output=True, text=True, check=False).stdout
    keys = np.random.default_rng(1).permutation(10_000).astype(np.int32)
    sorted_keys, values = (wp.array(np.resize(keys, 20_000), dtype=wp.int32, device=device) for _ in range(2))
    wp.utils.radix_sort_pairs(sorted_keys, values, len(keys))
    facts["sorts"] = bool((sorted_keys.numpy()[: len(keys)] == np.sort(keys)).all())
    (out / "device.json").write_text(json.dumps(facts, indent=1))
    print(json.dumps(facts))
    if not facts["sorts"]:
        raise SystemExit(
            "Warp's radix sort gives another order: is this card of the architecture that was packed?"
        )


def kernels_stage(out: Path, device: str) -> None:
    """Microseconds of each kernel, launched one by one, over steps and one rebuild."""
    import warp as wp

    rows = []
    for precision in ("mixed", "float64"):
        solver = bed(1_000_000 if device != "cpu" else 500, precision, device, one_by_one=True)
        wp.timing_begin(cuda_filter=wp.TIMING_ALL)
        solver.advance(100)
        total: dict[str, list[float]] = {}
        for found in wp.timing_end():
            total.setdefault(found.name, []).append(found.elapsed)
        rows += [
            {"precision": precision, "kernel": name, "launches": len(ms), "us": 1e3 * sum(ms) / len(ms)}
            for name, ms in sorted(total.items(), key=lambda item: -sum(item[1]))
        ]
        solver.close()
        (out / "kernels.json").write_text(json.dumps(rows, indent=1))
    for r in rows[:24]:
        print(f"{r['precision']} {r['us']:9.1f} us {r['launches']:4d} {r['kernel'][:60]}")


def steps_stage(precision: str, device: str) -> None:
    """A few launches for the profiler."""
    bed(1_000_000, precision, device, one_by_one=True).advance(60)


def bed(count: int, precision: str, device: str, one_by_one: bool) -> Any:
    """The flowing bed of the bench, some steps on."""
    from comparisons.bench.beds import SKIN, bench_scene
    from gpudem.solver.solver import Solver

    scene = bench_scene("flowing", count, 100_000, solver={"skin": SKIN, "precision": precision})
    solver = Solver(scene, device, 1, chunk=1, rebuild_in_graph=False)
    solver.graphs = solver.graphs and not one_by_one
    solver.start()
    solver.advance(60)
    return solver


def step_stage(out: Path, device: str) -> None:
    """Microseconds a step of the paper's box, gate at 200 mm, over 50 000 steps at a time of its 0.35 s."""
    import warp as wp

    from comparisons.cases.dam_break import scenes as dam
    from gpudem.solver.solver import Solver

    small: dict[str, Any] = {"young": None}
    chunk, chunks = 50_000, 7
    if device == "cpu":
        small, chunk, chunks = {"radius": 0.02}, 200, 2
    scene = dam.Dam(gate=0.2, slice=False, **small).scene().replace(solver={"precision": "mixed"})
    solver = Solver(scene, device, 1)
    first, _, planes = scene.segments[0]
    solver.start(planes, write=first == 0)
    solver.advance(20)
    rows, done = [], 20
    for _ in range(chunks):
        wp.synchronize_device(solver.device)
        begin, rebuilds = time.perf_counter(), solver.neighbors.rebuilds
        solver.advance(chunk)
        wp.synchronize_device(solver.device)
        took = time.perf_counter() - begin
        done += chunk
        rows.append({
            "balls": len(scene.state), "up to step": done, "us_a_step": 1e6 * took / chunk,
            "particle_steps_per_s": len(scene.state) * chunk / took,
            "rebuilds": solver.neighbors.rebuilds - rebuilds,
            "contacts": solver.contact_count() / len(scene.state),
            "array_bytes": sum(solver.memory_bytes().values()) / len(scene.state),
        })  # fmt: skip
        (out / "step.json").write_text(json.dumps(rows, indent=1))
        print(json.dumps(rows[-1]), flush=True)
    solver.close()


def lanes_stage(out: Path, device: str) -> None:
    """Microseconds a step of flowing beds with several threads a particle: do they pay, and for how many."""
    import warp as wp

    from comparisons.bench.beds import SKIN, bench_scene
    from gpudem.solver.solver import Solver

    sizes, numbers, steps = ((5000, 20_000, 120_000), (1, 2, 4, 8), 4000)
    full: dict[str, Any] = {}
    if device == "cpu":
        sizes, numbers, steps, full = (500,), (1, 4), 100, {"half_list": False, "rebuild_in_graph": True}
    rows = []
    for size in sizes:
        for lanes in numbers:
            scene = bench_scene("flowing", size, steps, solver={"skin": SKIN, "precision": "mixed"})
            solver = Solver(scene, device, 1, lanes=lanes, **full)
            solver.start()
            solver.advance(steps // 10)
            wp.synchronize_device(solver.device)
            begin = time.perf_counter()
            solver.advance(steps - steps // 10 - 1)
            wp.synchronize_device(solver.device)
            us = 1e6 * (time.perf_counter() - begin) / (steps - steps // 10 - 1)
            rows.append({"balls": size, "lanes": lanes, "us_a_step": us})
            (out / "lanes.json").write_text(json.dumps(rows, indent=1))
            print(json.dumps(rows[-1]), flush=True)
            solver.close()


def paper_stage(out: Path, device: str) -> None:
    """Gate by gate: wall clock, first ball at the far wall, heights at rest every 100 mm, positions."""
    import numpy as np

    import gpudem
    from comparisons.cases.dam_break import scenes as dam
    from comparisons.metrics import pile

    rows = []
    small: dict[str, Any] = {"young": None}
    if device == "cpu":
        small = {"radius": 0.02, "opens": 0.05, "flows": 0.1}
    for gate in (0.3, 0.2, 0.4):
        scene = dam.Dam(gate=gate, slice=False, **small).scene().replace(solver={"precision": "mixed"})
        start = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            done = gpudem.simulate(scene, folder, device=device)
            took = time.perf_counter() - start
            last = done.frames[-1]
        heights = pile.height(last["position"], last["radius"], dam.READ_AT, (0.0, dam.DEPTH), None)
        rows.append({
            "gate_m": gate, "balls": len(scene.state), "steps": scene.n_steps, "wall_s": took,
            "particle_steps_per_s": len(scene.state) * scene.n_steps / took,
            "far_wall_s": None if np.isnan(dam.arrival(done)) else dam.arrival(done),
            "heights_mm": [round(1e3 * float(h), 2) for h in heights],
        })  # fmt: skip
        (out / "paper.json").write_text(json.dumps(rows, indent=1))
        np.savez_compressed(out / f"rest_gate_{gate}.npz", position=last["position"].astype(np.float32))
        print(json.dumps(rows[-1]), flush=True)


def main() -> int:
    """The command line; exit code 1 where a stage failed or was stopped."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("stages", nargs="*", metavar="STAGE")
    parser.add_argument("--budget", type=float, default=480.0, help="seconds of all stages (480)")
    parser.add_argument("--spent", type=float, default=0.0, help="seconds of them that are gone (0)")
    parser.add_argument("--rehearse", action="store_true", help="on the CPU, small")
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    given = parser.parse_intermixed_args()
    given.out.mkdir(parents=True, exist_ok=True)
    if given.inside:
        device = "cpu" if given.rehearse else "cuda:0"
        name, _, precision = given.inside.partition("_")
        if name == "steps":
            steps_stage(precision, device)
        else:
            stage: dict[str, Callable[[Path, str], None]] = {
                "device": device_stage, "kernels": kernels_stage, "step": step_stage, "lanes": lanes_stage,
                "paper": paper_stage,
            }  # fmt: skip
            stage[name](given.out, device)
        return 0
    unknown = set(given.stages) - set(LIMITS)
    if unknown:
        parser.error(f"no stage {', '.join(sorted(unknown))}; known: {', '.join(LIMITS)}")
    rows = check(given.stages or list(DEFAULT), given.out, given.budget, given.rehearse, given.spent)
    return int(any(row["status"] in ("failed", "stopped") for row in rows))


if __name__ == "__main__":
    sys.exit(main())
