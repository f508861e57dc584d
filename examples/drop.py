"""The scene of drop.toml in Python, run on the CPU (or on "cuda:0")."""

import gpudem
from gpudem.scene import Contact, Domain, Explicit, Material, Output, Pair, Plane, Scene, Time

scene = Scene(
    name="drop",
    gravity=(0, 0, -9.81),
    materials={
        "polystyrene": Material(young=3.25e7, poisson=0.34, density=1050),
        "acrylic": Material(young=3.2e7, poisson=0.37, density=1190),
    },
    pairs=[
        Pair(materials=("polystyrene", "polystyrene"), restitution=0.9, friction=0.3),
        Pair(materials=("polystyrene", "acrylic"), restitution=0.9, friction=0.3),
    ],
    contact=Contact(normal="hertz", tangential="history"),
    particles=Explicit(
        position=[[0, 0, 0.053]], velocity=[[0.5, 0, 0]], radius=0.003, material="polystyrene"
    ),
    walls=[Plane(name="floor", material="acrylic", point=(0, 0, 0), normal=(0, 0, 1))],
    domain=Domain(lo=(-0.1, -0.1, 0), hi=(0.3, 0.1, 0.1)),
    time=Time(step=1e-5, duration=0.3),
    output=Output(frames_every=0.01, trace_every=0.001, history_every=0.001),
)

if __name__ == "__main__":
    run = gpudem.simulate(scene, "runs/drop_py", device="cpu")
    height = run.trace["position"][:, 0, 2]
    print(f"highest after the first bounce: {height[run.trace['time'] > 0.12].max():.4f} m")
    print(f"open in ParaView: {run.directory / 'run.pvd'}")
