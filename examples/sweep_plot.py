"""The share of lost starts of examples/sweep.toml, over the varied variables: python examples/sweep_plot.py target/sweep lost.svg"""
import sys

import matplotlib

matplotlib.use("svg")
matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "lost"})
import matplotlib.pyplot as plt
import numpy as np

folder, picture = sys.argv[1:]
rows = np.genfromtxt(f"{folder}/results.csv", delimiter=",", skip_header=1, usecols=range(1, 7))
start, resistance, flux, inertia, load, error = rows.T
lost = (np.abs(error) > np.pi / 2).astype(float)
print(f"{lost.mean():.2%} of {len(lost)} starts lose the rotor")

figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
for axis, x, name in [(axes[0], np.degrees(start), "start angle (deg)"), (axes[1], 1e3 * inertia, "inertia (g.m²)")]:
    edges = np.quantile(x, np.linspace(0, 1, 37))
    count, _ = np.histogram(x, edges)
    share, _ = np.histogram(x, edges, weights=lost)
    axis.stairs(100 * share / count, edges)
    axis.set(xlabel=name, ylabel="lost (%)")
grid = [np.linspace(1.4, 2.6, 25), np.linspace(0, 3, 25)]
count, share = np.histogram2d(resistance, load, grid)[0], np.histogram2d(resistance, load, grid, weights=lost)[0]
image = axes[2].pcolormesh(*grid, 100 * (share / np.maximum(count, 1)).T, cmap="magma_r", rasterized=True)
axes[2].set(xlabel="stator resistance (Ω)", ylabel="load (N.m)")
figure.colorbar(image, label="lost (%)")
figure.savefig(picture, metadata={"Date": None})
