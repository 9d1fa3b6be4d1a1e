"""One look for all figures: colours that colour-blind people can tell apart, light grid, units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes

# Okabe and Ito's palette, yellow left out: too pale for lines on white.
BLUE, VERMILION, GREEN, PURPLE, ORANGE = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"
BLACK, SKY_BLUE = "#000000", "#56B4E9"
PALETTE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, BLACK, SKY_BLUE)
REFERENCE, FALL = "#444444", "#8B0000"

RC: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#555555",
    "axes.grid": True,
    "axes.labelsize": 10,
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10.5,
    "figure.constrained_layout.use": True,
    "figure.dpi": 130,
    "figure.titlesize": 12,
    "font.size": 9.5,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "mathtext.fontset": "dejavusans",
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
}

MANY = 7
"""More lines than this are coloured by a sequence instead of the palette."""


def line_colors(count: int) -> list[Any]:
    """Return ``count`` colours: the palette, or a sequence from dark to light for many lines."""
    if count <= MANY:
        return list(PALETTE[:count])
    colormap = matplotlib.colormaps["viridis"]
    return [colormap(0.92 * i / (count - 1)) for i in range(count)]


def mark_fall(axes: Axes, fell_at_s: float | None) -> None:
    """Draw the broken vertical line at the time the robot fell, as the paper does."""
    if fell_at_s is not None:
        axes.axvline(fell_at_s, color=FALL, linestyle=(0, (4, 3)), linewidth=1.1)


def legend_right(axes: Axes, labels: Sequence[str]) -> None:
    """Put a legend beside the axes; of many lines it names only some."""
    lines = axes.get_lines()[: len(labels)]
    step = -(-len(labels) // 12)
    chosen = [*range(0, len(labels) - 1, step), len(labels) - 1] if labels else []
    axes.legend(
        [lines[i] for i in chosen],
        [labels[i] for i in chosen],
        loc="center left",
        bbox_to_anchor=(1.0, 0.5),
        borderaxespad=0.4,
        handlelength=1.4,
        labelspacing=0.3,
    )
