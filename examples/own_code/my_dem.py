"""A small DEM in plain NumPy that gpudem can judge: Hertz contacts with tangential history, planes, gravity.
Contract: docs/guide/own_code.md. `--mistake`: a classical mistake; `--version`: right in another way.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np


def dot(a, b):
    """Scalar products of the rows, as a column."""
    return (a * b).sum(axis=-1, keepdims=True)


class Contacts:
    """Possible contacts of particles i with particles j, or with one plane; one row each."""

    def __init__(self, scene, i, j, plane, mistake):
        self.i, self.j, self.plane, self.mistake = i, j, plane, mistake
        particles, materials, law = scene["particles"], scene["materials"], scene["contact"]
        name, both = particles["material"], (particles["radius"], particles["mass"])
        a = [name[k] for k in i]
        b = [name[k] for k in j] if plane is None else [plane["material"]] * len(i)
        table = {frozenset(pair["materials"]): pair for pair in scene["pairs"]}
        pairs = [table[frozenset(names)] for names in zip(a, b, strict=True)]
        sides = [[materials[k] for k in side] for side in (a, b)]
        young, nu = (np.array([[m[key] for m in side] for side in sides]) for key in ("young", "poisson"))
        self.e_star = 1 / ((1 - nu**2) / young).sum(axis=0)[:, None]
        self.g_star = 1 / (2 * (2 - nu) * (1 + nu) / young).sum(axis=0)[:, None]
        flat = 2 if mistake == "wall_sphere" else 1
        self.r_star, self.m_star = (q[i] / flat if plane else q[i] * q[j] / (q[i] + q[j]) for q in both)
        if mistake == "damping_mass" and plane is None:
            self.m_star = both[1][i]
        log_e = np.log([pair["restitution"] for pair in pairs])[:, None]
        self.damping = -2 * np.sqrt(5 / 6) * log_e / np.hypot(log_e, np.pi)
        self.friction = np.array([pair["friction"] for pair in pairs])[:, None] * (
            law["tangential"] == "history"
        )
        self.radius, self.spring, self.limit_force = both[0], np.zeros((len(i), 3)), law["limit_force"]
        self.with_dashpot, self.gate = law["tangential_damping"], plane and plane["removed_at_step"]

    def add(self, x, v, w, force, torque, dt):
        """Add the forces and torques of all contacts; dt is 0 at a set-up."""
        i, j, plane = self.i, self.j, self.plane
        if plane is None:
            d = x[i] - x[j]
            distance = np.sqrt(dot(d, d))
            n, overlap = d / distance, self.radius[i] + self.radius[j] - distance
        else:
            n = np.tile(plane["normal"], (len(i), 1))
            overlap = self.radius[i] - dot(x[i] - plane["point"], n)
        on = overlap[:, 0] > 0
        self.spring[~on] = 0.0
        i, j, n, delta = i[on], None if plane else j[on], n[on], overlap[on]
        q = np.sqrt(self.r_star[on] * delta)
        kn, kt = 4 / 3 * self.e_star[on] * q, 8 * self.g_star[on] * q
        cn, ct = (self.damping[on] * np.sqrt(k * self.m_star[on]) for k in (1.5 * kn, kt))
        half = 0 if self.mistake == "lever" else delta / 2
        v_rel = v[i] if plane else v[i] - v[j]
        fn = np.maximum(kn * delta - cn * dot(v_rel, n), 0.0 if self.limit_force else -np.inf)
        turning = (self.radius[i] - half) * w[i] + (0 if plane else (self.radius[j] - half) * w[j])
        slip = (v[i] if self.mistake == "absolute_velocity" else v_rel) - np.cross(turning, n)
        vt = slip - dot(slip, n) * n
        s = self.spring[on] + vt * dt
        s = s if self.mistake == "projection" else s - dot(s, n) * n
        elastic, limit = kt * np.sqrt(dot(s, s)), self.friction[on] * np.abs(fn)
        slips = elastic > limit
        s = s * np.where(slips, limit / np.where(slips, elastic, 1.0), 1.0)
        ft = -kt * s - np.where(slips | (limit == 0), 0.0, ct * self.with_dashpot) * vt
        if dt:
            self.spring[on] = s
        for k, sign in ((i, 1), (j, -1)) if plane is None else ((i, 1),):
            np.add.at(force, k, sign * (fn * n + ft))
            np.add.at(torque, k, -(self.radius[k] - half) * np.cross(n, ft))


def run(scene, mistake, version):
    """Yield (step, x, v, w, force, torque) at the requested steps."""
    p, materials = scene["particles"], scene["materials"]
    x, v, w = (np.array(p[key]) for key in ("position", "velocity", "angular_velocity"))
    density = np.array([[materials[name]["density"]] for name in p["material"]])
    radius = p["radius"] = np.array(p["radius"])[:, None]
    mass = p["mass"] = density * 4 / 3 * np.pi * radius**3
    inertia, parts = 0.4 * mass * radius**2, 2 if version == "half_the_step" else 1
    dt, wanted = scene["steps"]["dt"] / parts, set(scene["wanted"]["steps"])
    sets = [Contacts(scene, *np.triu_indices(len(x), 1), None, mistake)]
    sets += [Contacts(scene, np.arange(len(x)), None, plane, mistake) for plane in scene["walls"]]

    def forces(x, v, w, step, dt):
        force, torque = mass * np.array(scene["gravity"]), np.zeros_like(x)
        for contacts in sets:
            if contacts.gate is None or step <= contacts.gate:
                contacts.add(x, v, w, force, torque, dt)
        return force, torque

    f, t = forces(x, v, w, 0, 0.0)
    yield 0, x, v, w, f, t
    for k in range(1, parts * scene["steps"]["count"] + 1):
        step = k / parts
        if mistake == "euler":
            x, v, w = x + dt * v, v + dt * f / mass, w + dt * t / inertia
            f, t = forces(x, v, w, step, dt)
        else:
            ahead = dt if version == "full_step" else dt / 2  # of the velocities that the law reads
            reads = v + ahead * f / mass, w + ahead * t / inertia
            v, w = v + dt / 2 * f / mass, w + dt / 2 * t / inertia
            x = x + dt * v
            f, t = forces(x, *reads, step, dt)
            v, w = v + dt / 2 * f / mass, w + dt / 2 * t / inertia
        if step in wanted:
            yield int(step), x, v, w, f, t
        if any(step == contacts.gate for contacts in sets):
            f, t = forces(x, v, w, step + 0.5, 0.0)


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--mistake", help="absolute_velocity, lever, projection, damping_mass, ...")
    parser.add_argument("--version", default="plain", help="full_step, half_the_step, reordered")
    parser.add_argument("--digits", type=int, default=17)
    args = parser.parse_args()
    scene = json.loads(args.scene.read_text())
    laws = {scene["contact"][slot] for slot in ("normal", "tangential", "rolling", "cohesion")}
    unable = laws - {"hertz", "history", "off"}
    unable |= {"vibration" for wall in scene["walls"] if wall["vibration"]}
    if unable or any(scene["domain"]["periodic"]):
        print("cannot run", *unable or ["periodic sides"], file=sys.stderr)
        sys.exit(77)
    if args.version == "reordered":
        order = np.random.default_rng(1).permutation(len(scene["particles"]["id"]))
        scene["particles"] = {key: [all[k] for k in order] for key, all in scene["particles"].items()}
    begin, rows = time.perf_counter(), ["step,id,x,y,z,vx,vy,vz,wx,wy,wz,fx,fy,fz,tx,ty,tz"]
    for step, *columns in run(scene, args.mistake, args.version):
        for number, values in zip(scene["particles"]["id"], np.hstack(columns).tolist(), strict=True):
            rows.append(",".join([str(step), str(number), *(f"{a:.{args.digits}g}" for a in values)]))
    about = {"name": "my_dem", "version": "1.0", "stepping_s": time.perf_counter() - begin}
    about["scheme"] = "half_step" if args.version in ("plain", "reordered") else args.version
    (args.out / "states.csv").write_text("\n".join(rows) + "\n")
    (args.out / "run.json").write_text(json.dumps(about))


if __name__ == "__main__":
    main()
