"""The picture of `mass_from_pushes`: error by iteration, and each case's interval."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from samrl_core.common.figure_file import save_figure

matplotlib.use("Agg")

import matplotlib.pyplot as plt

GROUPS = {"heavy": "0.5 to 1 kg", "light": "0.08 kg"}
FITS = {"one_push": ("one push", "tab:orange"), "two_pushes": ("two pushes", "tab:blue")}


def write_picture(results: list[dict[str, Any]], path: Path) -> None:
    """Left: relative error of the mass over the iterations of the fits, without sign. Right: mass and
    friction of each case, less the truth, with 95 % intervals.
    """
    figure, axes = plt.subplots(1, 3, figsize=(14, 4.5), width_ratios=(1, 1.3, 1.3), layout="constrained")
    for result in results:
        mass = result["case"]["mass"]
        masses = np.concatenate([result["fits"][name]["mass_path_kg"] for name in FITS])
        error = 100 * np.abs(masses / mass - 1)
        color = "tab:blue" if result["case"]["group"] == "heavy" else "tab:green"
        axes[0].semilogy(np.maximum(error, 0.05), color=color, alpha=0.6, lw=1)
    for limit, style, text in ((20.0, ":", "paper's 20 %"), (5.0, "--", "5 %")):
        axes[0].axhline(limit, color="k", ls=style, lw=0.8)
        axes[0].text(
            0.98, limit * 1.05, text, ha="right", fontsize=8, transform=axes[0].get_yaxis_transform()
        )
    axes[0].plot([], [], color="tab:blue", label=GROUPS["heavy"])
    axes[0].plot([], [], color="tab:green", label=GROUPS["light"])
    axes[0].set(xlabel="iteration", ylabel="error of the mass, one push, then two [%]")
    axes[0].legend(fontsize=8)
    truth_keys = (("mass", "mass"), ("table_friction", "friction"))
    for axis, (name, truth_key) in zip(axes[1:], truth_keys, strict=True):
        for shift, (fit_name, (label, color)) in zip((-0.15, 0.15), FITS.items(), strict=True):
            found = [next(a for a in r["fits"][fit_name]["attributes"] if a["name"] == name) for r in results]
            truth = np.array([r["case"][truth_key] for r in results])
            value, lower, upper = (
                100 * (np.array([a[k] for a in found]) / truth - 1) for k in ("value", "lower", "upper")
            )
            axis.errorbar(
                np.arange(len(results)) + shift,
                value,
                [value - lower, upper - value],
                fmt="o",
                ms=3,
                lw=1,
                color=color,
                label=label,
            )
        axis.axhline(0.0, color="k", lw=0.8)
        axis.set_xticks(range(len(results)))
        axis.set_xticklabels([r["case"]["name"] for r in results], rotation=90, fontsize=6)
        axis.set(ylabel=f"{name.replace('_', ' ')} less truth [%], 95 % interval")
        axis.legend(fontsize=8)
    save_figure(figure, path, dpi=120)
    plt.close(figure)
