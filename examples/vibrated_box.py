"""Hard disks over a fast vibrating floor, collision by collision; then: gpudem animate runs/vibrated_box."""

import numpy as np

import gpudem.event_driven
from gpudem.scene import Box, Contact, Domain, Explicit, Material, Output, Pair, Plane, Scene, Time, Vibration

COUNT, RADIUS, WIDTH = 300, 0.02, 2.0

rng = np.random.default_rng(1)
k = np.arange(COUNT)
position = np.stack([-0.95 + 0.1 * (k % 20), 0 * k, 0.03 + 0.05 * (k // 20)], axis=1)
velocity = rng.normal(size=(COUNT, 3)) * (1, 0, 1)

scene = Scene(
    name="vibrated_box",
    materials={
        "disk": Material(young=1e7, poisson=0.3, density=2500.0),  # stiffness is not used by hard disks
        "wall": Material(young=1e7, poisson=0.3, density=2500.0),
    },
    pairs=[
        Pair(materials=("disk", "disk"), restitution=0.95),
        Pair(materials=("disk", "wall"), restitution=1.0),
    ],
    contact=Contact(tangential="off"),
    particles=Explicit(position=position, velocity=velocity, radius=RADIUS, material="disk"),
    gravity=(0, 0, -1.0),
    walls=[
        Box(kind="box", name="box", material="wall", sides=("xlo", "xhi")),
        Plane(name="floor", material="wall", point=(0, 0, 0), normal=(0, 0, 1),
              vibration=Vibration(speed=0.149)),  # amplitude 0: the limit of a fast floor
    ],
    domain=Domain(lo=(-WIDTH / 2, -0.1, 0), hi=(WIDTH / 2, 0.1, 20)),
    time=Time(step=1e-3, duration=40.0),
    output=Output(frames_every=0.2, history_every=0.1),
    allow=("time_step", "unusual_units"),
)  # fmt: skip

if __name__ == "__main__":
    run = gpudem.event_driven.run(scene, "runs/vibrated_box")
    late = run.history[run.history.time > 20]
    print(f"mean height: {late.centre_z.mean():.4f} m, {run.notes['pair_collisions']} collisions of disks")
    print("next: gpudem animate runs/vibrated_box --color speed")
