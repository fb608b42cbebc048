"""The picture of a run: real image, model image and their difference, one row per update."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from samrl_core.common.errors import InputError
from samrl_core.common.figure_file import save_figure
from samrl_ros.bags.reader import BagDecoder, open_bag
from samrl_ros.bags.recorder import header_stamp_ns
from samrl_ros.cell.report.run_record import STATE, losses_of
from samrl_ros.contract.topics import camera_topic, cell_topic
from samrl_ros.conversions.from_message import image, stamp_ns

COLOR, MODEL = camera_topic("color/image_raw"), cell_topic("model_updater/image")


def draw_contact_sheet(bag_path: Path, picture: Path, episode: int = 0, columns: int = 12) -> int:
    """Draw at most `columns` updates of one episode, evenly chosen, first and last included.

    Returns:
        The number of updates shown.

    Raises:
        InputError: the bag has no update of that episode.
    """
    bag = open_bag(bag_path)
    states = {stamp_ns(m): m for _, m in bag.decoded((STATE,)) if m.episode == episode}
    pictures: dict[str, dict[int, np.ndarray]] = {COLOR: {}, MODEL: {}}
    decode = BagDecoder(bag)
    for raw in bag.messages(pictures):
        stamp = header_stamp_ns(raw.type, raw.data) or 0
        if stamp in states:  # others are not even decoded: a long run's take hundreds of megabytes
            pictures[raw.topic][stamp] = image(decode(raw))
    model = pictures[MODEL]
    real = {stamp: pixels for stamp, pixels in pictures[COLOR].items() if stamp in model}
    stamps = sorted(real)
    if not stamps:
        raise InputError(f"{bag_path} has no model update of episode {episode} to show")
    if len(stamps) > columns:
        stamps = [stamps[i] for i in np.unique(np.linspace(0, len(stamps) - 1, columns).round().astype(int))]
    figure, axes = plt.subplots(3, len(stamps), figsize=(1.45 * len(stamps) + 0.6, 5.2), squeeze=False)
    for column, stamp in enumerate(stamps):
        difference = np.abs(real[stamp].astype(np.int16) - model[stamp].astype(np.int16)).astype(np.uint8)
        for row, pixels in enumerate((real[stamp], model[stamp], difference)):
            axis = axes[row, column]
            axis.imshow(pixels, interpolation="nearest")
            axis.set_xticks([])
            axis.set_yticks([])
        state = states[stamp]
        axes[0, column].set_title(f"action {state.step}\nt = {(stamp - stamps[0]) * 1e-9:.1f} s", fontsize=8)
        axes[2, column].set_xlabel(losses_of(state).replace(" \u2192", "\n\u2192"), fontsize=8)
    for row, name in enumerate(("real image", "model image", "difference")):
        axes[row, 0].set_ylabel(name, fontsize=9)
    figure.suptitle(f"episode {episode}: what the camera saw, and the model after each update", fontsize=10)
    figure.tight_layout()
    save_figure(figure, picture, dpi=110)
    plt.close(figure)
    return len(stamps)
