"""`gpudem bench`: what it makes of its measurements, and one real measurement."""

import dataclasses
import json

import numpy as np
import pytest
from click.testing import CliRunner

from comparisons.bench import command as bench
from comparisons.bench import insertion, roofline
from comparisons.bench import worker as bench_worker
from comparisons.bench.beds import COUNT, STEP, bench_scene
from gpudem.errors import GpudemError
from gpudem.solver.list_layout import packed
from gpudem.solver.memory import bytes_by_purpose
from gpudem.solver.solver import Solver


def row(**changes) -> bench.Row:
    plain = bench.Row(
        state="settled", code="gpudem", particles=20_000, steps=100, cores=1, device="cpu",
        precision="float64", repeat=0, rate=4e6, peak_memory_bytes=2 * 10**8,
    )  # fmt: skip
    return dataclasses.replace(plain, **changes)


def test_ratios_compare_within_a_repeat():
    """Catches medians divided by medians, and LIGGGHTS on one rank taken for gpudem on two cores."""
    rows = [row(repeat=k, rate=rate) for k, rate in enumerate((4e6, 6e6, 5e6))]
    rows += [row(repeat=k, rate=rate, code="liggghts") for k, rate in enumerate((2e6, 6e6, 2e6))]
    rows += [row(cores=2, rate=8e6)]
    one, two = bench.summary(rows)
    assert (one["ratio"], one["ratio least"], one["ratio most"]) == (2.0, 1.0, 2.5)
    assert two["ratio"] is None
    assert two["over one core"] == 2.0
    assert one["s a simulated s"] == pytest.approx(20_000 / 5e6 / STEP)


def test_share_of_the_roofline():
    bandwidths = [{"device": "cpu", "cores": 1, "bytes_per_s": 10e9}]
    (line,) = bench.summary([row(moved_bytes=500.0)], bandwidths)
    assert line["of the roofline [%]"] == pytest.approx(20.0)


def test_exponent_of_the_cost():
    """Catches small beds, which stay in the caches, counted in; a size that counts as often as it was run."""
    sizes = (1000, 10_000, 100_000, 1_000_000)
    rows = [row(particles=n, rate=1e9 if n == 1000 else 1e7 * n**-0.1) for n in sizes]
    rows += [row(particles=10_000, rate=factor * rows[1].rate) for factor in (0.5, 3.0)]
    (line,) = bench.scaling(rows)
    assert line["exponent"] == pytest.approx(1.1)
    assert line["up to"] == 1_000_000


def test_memory_a_particle():
    rows = [row(particles=n, peak_memory_bytes=2**28 + 1500 * n) for n in (5000, 20_000, 120_000)]
    (line,) = bench.memory(rows)
    assert line["bytes a particle"] == pytest.approx(1500)
    assert line["and [MiB]"] == pytest.approx(256)


@pytest.mark.long
def test_moved_bytes_of_a_known_bed():
    """Catches an array left out of the count or counted twice; a slice counted beside the whole of it."""
    simulation = Solver(bench_scene("settled", 1000, 20), threads=1)
    simulation.start()
    simulation.advance(5)
    n = simulation.state.n
    entries = packed(simulation.state)["neighbor"]
    motion, reference, partial, starts = 2 * 72, 24, 2 * 48, 4 * (n + 1) / n + 4
    listed = (4 * len(entries) + 48 * np.count_nonzero(entries < 0)) / n
    assert bench_worker.moved_bytes(simulation) == pytest.approx(
        motion + reference + partial + starts + listed
    )
    room = simulation.neighbors.capacity / n
    assert len(entries) / n < room < 1.1 * len(entries) / n + 0.1
    found = bytes_by_purpose(simulation.memory_bytes(), n)
    assert found["bodies, before and after a step"] == motion
    assert found["list, old and new"] == pytest.approx(2 * 4 * room)
    assert found["histories of contacts, old and new"] == pytest.approx(2 * 24 * room)
    assert found["sort and count"] == pytest.approx(4 * (4 * n + 1) / n)
    assert found["first entries and lengths of the lists"] == pytest.approx(2 * 4 * (n + 1) / n + 4)
    assert found["id, radius, material, ..., old and new"] >= 2 * 4
    assert sum(found.values()) == pytest.approx(sum(simulation.memory_bytes().values()) / n)
    assert found["other"] < 2
    simulation.close()


def test_memory_by_purpose():
    """Catches a bed of few particles shown for that of many; a row without figures that stops the table."""
    rows = [row(), row(memory={"a": 9.0}, array_bytes=9.0, particles=50)]
    rows += [row(memory={"a": 1.0, "b": 2.0}, array_bytes=3.0), row(code="liggghts")]
    assert bench.memory_by_purpose(rows) == [
        {"bytes a particle": "a", "settled cpu float64": 1.0},
        {"bytes a particle": "b", "settled cpu float64": 2.0},
        {"bytes a particle": "total", "settled cpu float64": 3.0},
    ]
    assert bench.memory_by_purpose([row()]) == []


def test_beds_below_and_above_one():
    assert len(bench_scene("settled", 1000, 1).state) == 1000
    assert len(bench_scene("settled", 2 * COUNT, 1).state) == 2 * COUNT
    with pytest.raises(ValueError, match="7000 particles"):
        bench_scene("settled", 7000, 1)


class TimedSolver:
    """A step takes 1 s, a step in which particles come 6 s; by the clock of the test."""

    device = "cpu"

    def __init__(self, scene, clock: list[float]):
        self.scene, self.clock, self.step_count = scene, clock, 0

    def advance(self, count: int) -> None:
        steps = range(self.step_count + 1, self.step_count + count + 1)
        self.clock[0] += sum(6.0 if step in self.scene.insertion_steps else 1.0 for step in steps)
        self.step_count += count


def test_time_of_insertion(monkeypatch):
    """Catches a plain step counted as insertion, an insertion missed, steps left out of the total."""
    clock = [0.0]
    monkeypatch.setattr(insertion.time, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(insertion.wp, "synchronize_device", lambda device: None)
    scene = insertion.insertion_scene(100)
    assert len(scene.insertion_steps) == insertion.EVENTS
    solver = TimedSolver(scene, clock)
    solver.advance(1)
    total, of_insertion = insertion.step_through(solver, insertion.STEPS - 1)  # pyright: ignore[reportArgumentType]
    assert solver.step_count == insertion.STEPS
    come = insertion.EVENTS - (scene.insertion_steps[0] == 1)
    assert of_insertion == pytest.approx(5.0 * come)
    assert total == pytest.approx(insertion.STEPS - 1 + 5.0 * come)
    plain = TimedSolver(bench_scene("settled", 100, 50), clock)
    assert insertion.step_through(plain, 50) == (50.0, 0.0)  # pyright: ignore[reportArgumentType]


def test_insertion_bed_is_measured():
    """Catches particle-steps counted for all balls from the start on, and LIGGGHTS asked for it."""
    found = bench_worker.measure("insertion", 100, insertion.STEPS, 1, "cpu", "float64", 0.0)
    assert found.particle_steps == pytest.approx(0.505 * 100 * insertion.STEPS, rel=0.01)
    assert found.insertion_s is not None
    assert 0 < found.insertion_s < found.stepping_s
    plan = bench.Plan([100], [1], ["cpu"], ["float64"], ["insertion"], 1, 1e5, True)
    assert [code for code, *_ in plan.runs("insertion")] == ["gpudem"]
    assert [code for code, *_ in plan.runs("settled")] == ["gpudem", "liggghts"]
    assert plan.steps("insertion", 100, "cpu", 1) == insertion.STEPS


@pytest.mark.parametrize("count", [150, 7000])
def test_insertion_in_whole_layers(count):
    """Catches balls that are left out in silence."""
    with pytest.raises(ValueError, match=f"{count} particles: a multiple of 100"):
        insertion.insertion_scene(count)


@pytest.mark.long
def test_measures_and_writes(tmp_path):
    out = tmp_path / "bench.json"
    arguments = "--sizes 1000 --cores 1 --repeats 1 --beds flowing --precision mixed --budget 1e5"
    arguments += " --no-liggghts"
    done = CliRunner().invoke(bench.command, [*arguments.split(), "--out", str(out)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    data = json.loads(out.read_text())
    (only,) = data["rows"]
    assert only["steps"] == 100
    assert only["contacts"] > 0.5
    assert 0 < data["summary"][0]["of the roofline [%]"] < 300
    assert 0 < only["first_step_s"] < 60
    assert data["provenance"]["commit"]

    more = [*arguments.replace("flowing", "settled").split(), "--append", "--out", str(out)]
    done = CliRunner().invoke(bench.command, more, catch_exceptions=False)
    assert [r["state"] for r in json.loads(out.read_text())["rows"]] == ["flowing", "settled"]
    with pytest.raises(GpudemError, match="has settled 1000 on cpu, cores 1 already"):
        CliRunner().invoke(bench.command, more, catch_exceptions=False)
    for what in ("commit", "hardware"):
        other = {**data, "provenance": {**data["provenance"], what: "another"}}
        out.write_text(json.dumps(other))
        with pytest.raises(GpudemError, match=f"is of {what} another"):
            CliRunner().invoke(bench.command, more, catch_exceptions=False)


def test_what_does_not_fit_is_left_out(monkeypatch):
    class Memory:
        available = 2**30

    monkeypatch.setattr(bench.psutil, "virtual_memory", lambda: Memory)
    assert bench.fits(120_000)
    assert not bench.fits(10_000_000)


@pytest.mark.parametrize("arguments", ["--sizes many", "--cores 0", "--sizes 5000,-1"])
def test_bad_numbers(arguments):
    done = CliRunner().invoke(bench.command, arguments.split())
    assert done.exit_code == 2
    assert "wanted" in done.output


def test_more_cores_than_there_are():
    with pytest.raises(GpudemError, match="this process may use"):
        bench.main(["--cores", "4096", "--no-liggghts"])


def test_a_failing_worker_says_why():
    with pytest.raises(GpudemError, match="7000 particles"):
        bench.measure_gpudem("settled", 7000, 10, 1, "cpu", "float64")


def test_bandwidth_is_that_of_memory(monkeypatch):
    """Catches a time that is not that of the copy: of the launch alone on a GPU, of the start-up."""
    monkeypatch.setattr(roofline, "LENGTH", 1 << 22)
    assert 5e8 < roofline.bandwidth("cpu", 1, repeats=2) < 1e12
