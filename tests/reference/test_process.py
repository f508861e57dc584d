"""A code behind a command: what it is given, how it is run and ended, how its output is checked."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from gpudem.errors import GpudemError
from gpudem.output.run import Run
from gpudem.scene import Box, Contact, Domain, Explicit, Material, Output, Pair, Plane, Scene, Time
from reference.code import Options
from reference.errors import CannotState, CodeTimeout
from reference.process import contacts, contract, statement, states
from reference.process.runner import CommandFailed, Process, code_of

pytestmark = pytest.mark.long

MATERIALS = {
    "ball": Material(young=1e7, poisson=0.3, density=2500),
    "wall": Material(young=2e7, poisson=0.2, density=1200),
}
PAIRS = [Pair(materials=("ball", "ball"), restitution=0.9), Pair(materials=("ball", "wall"), friction=0.3)]
STEPS, STRIDE = 20, 5

#: A code without contacts: it writes what the scene would do in flight, in 17 digits.
FREE_FLIGHT = """
    import json, sys
    from pathlib import Path
    scene, out = json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2])
    p, g = scene["particles"], scene["gravity"]
    names = "step,id,x,y,z,vx,vy,vz,wx,wy,wz".split(",")
    rows, about = [], {"name": "flight", "version": "2", "scheme": "exact", "stepping_s": 0.5}
    for step, t in zip(scene["wanted"]["steps"], scene["wanted"]["times"]):
        for i, x, v, w in zip(p["id"], p["position"], p["velocity"], p["angular_velocity"]):
            now = [a + b * t + c * t * t / 2 for a, b, c in zip(x, v, g)]
            rows.append([step, i, *now, *(b + c * t for b, c in zip(v, g)), *w])
    {change}
    lines = [",".join(names)] + [",".join(format(a, ".17g") for a in row) for row in rows]
    (out / "states.csv").write_text("\\n".join(lines) + "\\n")
    (out / "run.json").write_text(json.dumps(about))
"""


def flying(**changes) -> Scene:
    """Three particles in flight, two of them through a periodic side."""
    facts: dict[str, Any] = {
        "name": "flight", "materials": MATERIALS, "pairs": PAIRS, "gravity": (0, 0, -9.81),
        "particles": Explicit(
            position=[[0.1, 0.5, 0.5], [0.5, 0.5, 0.6], [0.95, 0.5, 0.7]], radius=[0.01, 0.02, 0.01],
            material=["ball", "ball", "ball"], velocity=[[-7.3, 0.1, 0.0], [0.31, 0.0, 0.2], [3.7, 0.0, 0.0]],
            angular_velocity=[[0, 0, 0], [1, 2, 3], [0, 0, 0]],
        ),
        "walls": [Plane(name="tilted", material="wall", point=(0, 0, 0), normal=(0, 3, 4), removed_at=1e-2),
               Box(kind="box", name="box", material="wall", sides=("zlo",))],
        "domain": Domain(lo=(0, 0, 0), hi=(1, 1, 1), periodic=(True, False, False)),
        "time": Time(step=1e-3, duration=STEPS * 1e-3), "allow": ["time_step", "speed"],
        "output": Output(trace_every=STRIDE * 1e-3, history_every=STRIDE * 1e-3, frames_every=1e-2),
    }  # fmt: skip
    return Scene(**(facts | changes))


def script(folder: Path, text: str, change: str = "") -> str:
    """A command that runs a Python program."""
    path = folder / "my code.py"  # a blank: the command is split as by a shell
    path.write_text(textwrap.dedent(text).replace("{change}", change))
    return f"{sys.executable} '{path}' {{scene}} {{out}}"


def run(
    folder: Path, text: str = FREE_FLIGHT, change: str = "", scene: Scene | None = None, **options
) -> Run:
    """A scene through a program, `change` put into it before it writes."""
    process = Process(script(folder, text, change), "mine", **options)
    return process(scene or flying(), folder / "run", Options(), lambda step: None, {})


# -- what a code is given ------------------------------------------------------------------------------------


def test_scene_file_is_self_contained_and_valid(tmp_path):
    """Detects a normal of another length, a box that is not planes, a gate without step, a missing t = 0."""
    scene = flying()
    facts = json.loads(statement.write(scene, tmp_path).read_text())
    jsonschema.validate(facts, json.loads(contract.schema_path("scene").read_text()))
    tilted, floor = facts["walls"]
    assert tilted["normal"] == [0, 0.6, 0.8]
    assert (tilted["removed_at_step"], floor["removed_at_step"]) == (10, None)
    assert (floor["name"], floor["normal"]) == ("box_zlo", [0, 0, 1])
    assert facts["wanted"]["steps"] == [0, 5, 10, 15, 20]
    assert facts["wanted"]["times"] == (np.arange(0, 21, 5) * 1e-3).tolist()
    assert facts["particles"]["position"] == scene.state.position.tolist()
    assert "path" not in json.dumps(facts)
    table = (tmp_path / "particles.csv").read_text().splitlines()
    assert table[0] == "id,material,radius,x,y,z,vx,vy,vz,wx,wy,wz"
    assert table[2].split(",") == [
        "2",
        "ball",
        "0.02",
        "0.5",
        "0.5",
        "0.6",
        "0.31",
        "0.0",
        "0.2",
        "1.0",
        "2.0",
        "3.0",
    ]
    assert (tmp_path / "particles.vtu").is_file()


@pytest.mark.parametrize("name", contract.SCHEMAS)
def test_published_schema_is_that_of_the_models(name):
    """Detects a change of the files that was not published: `python -m reference.process.contract`."""
    assert contract.schema_path(name).read_text() == contract.schema_text(name)


# -- what it writes ------------------------------------------------------------------------------------------


def test_run_of_a_command(tmp_path):
    """Detects swapped columns, times off by a step, unwrapped positions, energies of another state."""
    scene = flying()
    result = run(tmp_path)
    time = result.trace["time"]
    exact = scene.state.position + scene.state.velocity * time[:, None, None]
    exact[..., 2] -= 9.81 / 2 * time[:, None] ** 2
    exact[..., 0] -= np.floor(exact[..., 0])
    assert result.trace["step"].tolist() == [0, 5, 10, 15, 20]
    np.testing.assert_allclose(result.trace["position"], exact, rtol=1e-14)
    assert exact[-1, 0, 0] > 0.9  # it went through the side
    assert result.trace["position"][-1, 2, 0] < 0.1
    assert "force" not in result.trace
    assert len(result.frames) == 3
    history = result.history
    np.testing.assert_allclose(np.diff(history["centre_x"]) / 5e-3, _mean_velocity(scene), rtol=1e-9)
    energy = history["kinetic_energy"] + history["potential_energy"]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
    assert "contacts" not in history
    assert (result.version, result.timing.stepping_s) == ("flight 2", 0.5)
    assert result.notes["not_written"] == ["force", "torque", "contacts", "work"]
    assert Run.load(tmp_path / "run").trace["velocity"].tolist() == result.trace["velocity"].tolist()


def _mean_velocity(scene: Scene) -> float:
    return float(scene.masses @ scene.state.velocity[:, 0] / scene.masses.sum())


#: Change of the rows before they are written -> what is said of it.
RIGHT = {
    "rows in another order": "rows = rows[::-1]",
    "wrapped positions": "for row in rows: row[2] %= 1",
    "times instead of steps": "names[0] = 'time'\nfor row in rows: row[0] *= 1.0000000001e-3",
    "columns in another order": "names = names[::-1]; rows = [row[::-1] for row in rows]",
    "times that were not requested": "rows += [[3, *row[1:]] for row in rows[:3]]",
}


@pytest.mark.parametrize("change", RIGHT.values(), ids=RIGHT)
def test_another_form_of_the_same_states(tmp_path, change):
    """Detects rows matched by their order instead of by step and id."""
    plain, other = run(tmp_path / make(tmp_path, "a")), run(tmp_path / make(tmp_path, "b"), change=change)
    np.testing.assert_allclose(other.trace["position"], plain.trace["position"], atol=1e-15)
    np.testing.assert_array_equal(other.trace["velocity"], plain.trace["velocity"])
    ignored = [text for text in other.warnings if "not requested" in text]
    assert len(ignored) == ("[3," in change)


def make(folder: Path, name: str) -> str:
    (folder / name).mkdir()
    return name


WRONG = {
    "no column": ("names[2] = 'a'", "line 1: no column x; found: step, id, a"),
    "no time": ("names[0] = 'x0'", r"no column step \(or time\)"),
    "unknown column": (
        "names[0] = 'step'; names.append('q'); rows = [[*r, 1] for r in rows]",
        "unknown column q",
    ),
    "column twice": ("names.append('x'); rows = [[*r, 1] for r in rows]", "column x is given twice"),
    "half of a vector": ("names.append('fx'); rows = [[*r, 1] for r in rows]", "no column fy, fz"),
    "missing row": ("del rows[4]", r"no row for particle 2 at step 5 \(t = 0.005 s\); 1 of 15 rows"),
    "missing time": ("rows = rows[:-3]", r"particle 1 at step 20.*3 of 15.*nearest time is 0.015 s"),
    "time between": (
        "for r in rows: r[0] += 0.2 * (r[0] == 5)",
        "step 5.*nearest time is 0.0052 s, step 5.2",
    ),
    "row twice": ("rows.append(rows[5])", "line 17: particle 3 at step 5 is given twice"),
    "unknown id": ("rows[3][1] = 4", "line 5: id = 4; ids are 1 to 3"),
    "not a number": ("rows[7][3] = float('nan')", "line 9, column y: nan, not a finite"),
    "first step done": ("for r in rows[:3]: r[2] += 1e-4", "step 0: particle 1 is 0.0001 m from"),
    "ids swapped": ("for r in rows: r[1] = 4 - r[1]", "step 0: particle 1 is .*wrong id"),
}


@pytest.mark.parametrize(("change", "words"), WRONG.values(), ids=WRONG)
def test_output_that_is_not_what_was_asked_for(tmp_path, change, words):
    """Detects a defect of the output that passes for a result, or is not named by file, row and column."""
    with pytest.raises(states.OutputError, match=words):
        run(tmp_path, change=change)
    assert not (tmp_path / "run" / "run.json").exists()


def test_text_in_a_cell_and_no_table(tmp_path):
    """Detects an error of pandas passed on without line and column."""
    with pytest.raises(states.OutputError, match=r"line 3, column vx: '1\.0\.0' is not a number"):
        run(tmp_path, FREE_FLIGHT + '    t = (out / "states.csv").read_text().split("\\n")\n'
            '    c = t[2].split(","); c[5] = "1.0.0"; t[2] = ",".join(c)\n'
            '    (out / "states.csv").write_text("\\n".join(t))\n')  # fmt: skip
    with pytest.raises(states.OutputError, match=r"neither states.csv nor run.pvd; found: my.csv"):
        run(tmp_path, 'import sys; open(sys.argv[2] + "/my.csv", "w")')


@pytest.mark.parametrize("digits", [6, 9, 15])
def test_few_digits_are_reported(tmp_path, digits):
    """Detects rounded output that is compared as if it had all digits."""
    change = f"rows = [[float(format(a, '.{digits}g')) for a in row] for row in rows]"
    result = run(tmp_path, change=change, scene=flying(output=Output(trace_every=1e-3)))
    assert result.notes["digits"] == digits
    assert any("significant digits" in text for text in result.warnings) == (digits < 14)


def test_float32_has_seven_digits():
    values = np.random.default_rng(1).normal(size=(90, 3))
    assert states.significant_digits(values.astype(np.float32).astype(float)) == 7
    assert states.significant_digits(values) >= 16
    assert states.significant_digits(np.full((90, 3), 0.5)) == 17  # few different numbers show nothing


def test_frames_instead_of_a_table(tmp_path):
    """Detects frames that are read without their times or ids."""
    text = (
        FREE_FLIGHT
        + """
    import numpy as np, random
    from gpudem.output.vtu import write_vtu, write_pvd
    (out / "states.csv").unlink()
    entries = []
    for step in scene["wanted"]["steps"]:
        some = np.array([row for row in rows if row[0] == step])[::-1]
        name = f"f{step}.vtu"
        write_vtu(out / name, {"id": some[:, 1].astype(int), "position": some[:, 2:5],
                               "velocity": some[:, 5:8], "angular_velocity": some[:, 8:11]})
        entries.append((step * scene["steps"]["dt"], 0, name))
    write_pvd(out / "run.pvd", entries)
    """
    )
    plain, frames = run(tmp_path / make(tmp_path, "a")), run(tmp_path / make(tmp_path, "b"), text)
    np.testing.assert_array_equal(frames.trace["position"], plain.trace["position"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"schem": "a"}', "schem = 'a'"),
        ('{"threads": 0}', "threads = 0"),
        ("[1]", "JSON object"),
        ("{", "JSON"),
    ],
)
def test_run_json_is_checked(tmp_path, text, words):
    """Detects a misspelled key that is passed over."""
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(states.OutputError, match=words):
        states.about(tmp_path)


CONTACT_ROWS = {
    "no column": ("step,id,other,fx,fy", "0,1,2,1,1", "line 1: no column fz"),
    "unknown particle": (None, "0,1,4,1,1,1", "line 2: contact of '1' and '4': ids are 1 to 3, or a plane"),
    "unknown plane": (None, "0,1,floor,1,1,1", "contact of '1' and 'floor'"),
    "text": (None, "0,1,2,1,a,1", "line 2: could not convert string to float: 'a'"),
    "not finite": (None, "0,1,2,1,nan,1", "line 2: force 1, nan, 1, not finite"),
    "from both sides": (None, "0,1,2,1,1,1\n0,2,1,-1,-1,-1", "line 3: the contact of 2 and 1 is given twice"),
}


@pytest.mark.parametrize(("head", "rows", "words"), CONTACT_ROWS.values(), ids=CONTACT_ROWS)
def test_table_of_contacts_is_checked(tmp_path, head, rows, words):
    """Detects a contact that is passed over since its row cannot be read."""
    path = tmp_path / "contacts.csv"
    path.write_text(f"{head or 'step,id,other,fx,fy,fz'}\n{rows}\n")
    with pytest.raises(states.OutputError, match=words):
        contacts.read(flying(), path)


def test_force_of_a_contact_from_either_side(tmp_path):
    """Detects a force with the wrong sign, or of another step."""
    path = tmp_path / "contacts.csv"
    path.write_text("step,id,other,fx,fy,fz\n5,3,1,1,2,3\n5,2,tilted,0,0,7\n")
    table, steps = contacts.read(flying(), path), np.array([0, 5])
    assert table.force(2, 0, steps).tolist() == [[0, 0, 0], [1, 2, 3]]
    assert table.force(0, 2, steps).tolist() == [[0, 0, 0], [-1, -2, -3]]
    assert table.force(1, "tilted", steps)[1].tolist() == [0, 0, 7]


# -- how it is run -------------------------------------------------------------------------------------------


def test_status_77_is_cannot_state_with_its_reason(tmp_path):
    with pytest.raises(CannotState, match=r"^no cylinders$"):
        run(tmp_path, 'import sys; print("no cylinders", file=sys.stderr); sys.exit(77)')


def test_failure_shows_the_last_lines_and_the_log(tmp_path):
    """Detects a failed program taken for one that has run, and control characters sent to the terminal."""
    with pytest.raises(CommandFailed) as caught:
        run(tmp_path, 'import sys; print("\\033[2Jab", *range(20), sep="\\n", file=sys.stderr); sys.exit(3)')
    text = str(caught.value)
    assert "mine ended with status 3" in text
    assert "| 19" in text
    assert "| 5" not in text
    assert "\033" not in text
    assert str(tmp_path / "run" / "stderr.txt") in text
    with pytest.raises(CommandFailed, match="was killed by SIGKILL"):
        run(tmp_path, "import os; os.kill(os.getpid(), 9)")


def test_a_program_that_does_not_exist(tmp_path):
    process = Process("/nonexistent/dem {scene} {out}", "mine")
    with pytest.raises(CommandFailed, match=r"/nonexistent/dem: cannot be started: No such file"):
        process(flying(), tmp_path, Options(), lambda step: None, {})


def test_time_limit_ends_the_process_group(tmp_path):
    """Detects children of a command that go on after it was ended."""
    text = """
    import subprocess, sys, time
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    open(sys.argv[2] + "/pid", "w").write(str(child.pid))
    time.sleep(60)
    """
    with pytest.raises(CodeTimeout, match=r"did not end within 1 s \(--with-timeout\)"):
        run(tmp_path, text, timeout=1.0)
    assert ended(int((tmp_path / "run" / "written" / "pid").read_text()))


def test_interrupt_ends_the_process_group(tmp_path):
    """Detects a command that goes on after Ctrl-C, which a terminal sends to gpudem's group only."""
    text = "import os, sys, time; open(sys.argv[2] + '/pid', 'w').write(str(os.getpid())); time.sleep(60)"
    command = script(tmp_path, text)
    program = f"""
    from pathlib import Path
    from tests.reference.test_process import flying
    from reference.code import Options
    from reference.process import Process
    Process({command!r}, "mine")(flying(), Path({str(tmp_path / "run")!r}), Options(), print, {{}})
    """
    parent = subprocess.Popen([sys.executable, "-c", textwrap.dedent(program)], stderr=subprocess.PIPE)
    pid = tmp_path / "run" / "written" / "pid"
    assert eventually(lambda: pid.is_file() and pid.read_text())
    parent.send_signal(signal.SIGINT)
    assert b"KeyboardInterrupt" in parent.communicate(timeout=30)[1]
    assert ended(int(pid.read_text()))


def ended(pid: int) -> bool:
    """Whether a process ends soon; a zombie has ended."""

    def gone() -> bool:
        try:
            return ") Z " in Path(f"/proc/{pid}/stat").read_text()
        except FileNotFoundError:
            return True

    return eventually(gone)


def eventually(condition) -> bool:
    end = time.monotonic() + 20
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False


def test_no_shell_reads_the_command(tmp_path):
    """Detects a command that is handed to a shell."""
    words = Process("a '{scene} b' $(touch x);ls {out}", "mine").words(Path("/s p/scene.json"), Path("/o"))
    assert words == ["a", "/s p/scene.json b", "$(touch", "x);ls", "/o"]


@pytest.mark.parametrize(
    ("command", "name", "timeout", "words"),
    [
        ("", "a", 1, "no command"),
        ("run {scene}", "a", 1, r"must hold \{out\}"),
        ("run '{scene} {out}", "a", 1, "No closing quotation"),
        ("run {scene} {out}", "a/b", 1, "--with-name = 'a/b'"),
        ("run {scene} {out}", "a", 0, "--with-timeout = 0"),
    ],
)
def test_unusable_commands(command, name, timeout, words):
    with pytest.raises(GpudemError, match=words):
        code_of(command, name, timeout)


def test_code_travels_between_processes():
    """Detects a code that a pool of processes cannot be handed."""
    code = code_of("run {scene} {out}", "mine", 5.0)
    assert pickle.loads(pickle.dumps(code)) == code
    assert (code.role, os.path.basename(code.run.command.split()[0])) == ("under_test", "run")


def test_walls_without_words_are_refused(tmp_path):
    """Detects a wall that is left out of scene.json silently."""

    class Cylinder(Plane):
        kind: str = "cylinder"  # type: ignore[assignment]

    scene = flying(contact=Contact())
    wall = Cylinder(name="tube", material="wall", point=(0, 0, 0), normal=(0, 0, 1))
    object.__setattr__(scene, "walls", (wall,))
    scene.__dict__.pop("wall_elements", None)
    scene.__dict__["wall_elements"] = [type("W", (), {"name": "tube", "kind": "cylinder"})()]
    with pytest.raises(CannotState, match=r"walls.tube: kind 'cylinder'"):
        statement.facts(scene)
