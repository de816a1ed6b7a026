"""The first second of a track: echoes out, then every place it may be.

Echoes are told by pair while there is no track
(:func:`~swarmctl.estimation.integrity.gate.consensus`); what remains of them by what fits the most
probable trajectory least.
"""

from __future__ import annotations

import math

import numpy as np

from swarmctl.estimation.integrity.gate import GATE, consensus
from swarmctl.estimation.model.prior import Prior, starts
from swarmctl.estimation.model.rows import Rows
from swarmctl.estimation.track.window import Fit, Window
from swarmctl.units import Array, Mask

_COLLECT_S = 0.5
_COLLECT_EPOCHS = 10
_COLLECT_AT_MOST_S = 1.9
"""Epochs are collected for so long, if they are so many, and for so long at most."""
_PARTS = 8
"""Blocks that the collected epochs make."""
_SEARCH = 25
"""Steps of a search."""
_SCOUTED, _SOUGHT = 64, 16
"""Starts that are followed for a few steps, and to the end."""
_FOLLOWED = 4
"""Modes that are followed while echoes are taken out."""


def is_ready(collected: list[Rows]) -> bool:
    """Whether what was collected is enough to search in."""
    lasted = collected[-1].epoch_s - collected[0].epoch_s + 1e-6
    count = len(collected)
    enough = lasted >= _COLLECT_S and count >= _COLLECT_EPOCHS
    return enough or (lasted >= _COLLECT_AT_MOST_S and count >= 2)


def distinct(fit: Fit, score: Array) -> list[int]:
    """Which fits are different modes: a sigma or more apart, the highest scores first."""
    chosen: list[int] = []
    for k in np.argsort(-score).tolist():
        apart = fit.theta[chosen] - fit.theta[k]
        if (np.vecdot(apart, np.matvec(fit.information[k], apart)) >= 1.0).all():
            chosen.append(k)
    return chosen


def search(window: Window, prior: Prior, collected: list[Rows], colour_m: float) -> Fit:
    """Find the modes of what was collected.

    Args:
        window: Empty; takes the rows that are no echoes.
        prior: The emitter's prior.
        collected: Rows of the first epochs.
        colour_m: 1-sigma of an arrival's coloured error, m.

    Returns:
        Fits from several starts, many of them the same mode's.
    """
    cleaned = _cleaned(collected, colour_m)
    part_s = (cleaned[-1].epoch_s - cleaned[0].epoch_s) / _PARTS
    last_s = -math.inf
    for rows in cleaned:
        alone = rows.epoch_s >= last_s + part_s - 1e-6
        last_s = rows.epoch_s if alone else last_s
        window.points.add(rows, alone=alone)
    receivers = np.concatenate([cleaned[0].first_at, cleaned[0].second_at])
    found = starts(prior, receivers)
    for kept, steps in ((_SCOUTED, 0), (_SOUGHT, 4)):
        fit = window.fit(found, steps)
        order = np.argsort(fit.objective).tolist()
        # One start of each mode comes first: many lead to the best and would crowd out others.
        modes = distinct(fit, -fit.objective) if steps else []
        found = fit.theta[[*modes, *(k for k in order if k not in set(modes))][:kept]]
    fit = window.fit(found, _SEARCH)
    for _ in range(fit.residual.shape[-1] // 3):
        row, sigmas = window.worst(fit, int(np.argmin(fit.objective)))
        if sigmas <= GATE:
            break
        window.points.without(np.arange(fit.residual.shape[-1]) != row)
        fit = window.fit(fit.theta[distinct(fit, -fit.objective)[:_FOLLOWED]], _SEARCH)
    return fit


def _cleaned(collected: list[Rows], colour_m: float) -> list[Rows]:
    """Without what does not fit a straight line of its pair in time."""
    samples: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for number, rows in enumerate(collected):
        for k, pair in enumerate(zip(rows.first, rows.second, strict=True)):
            samples.setdefault(pair, []).append((number, k))
    kept: list[Mask] = [np.ones(len(rows.rd), dtype=np.bool_) for rows in collected]
    for places in samples.values():
        times = np.array([collected[number].epoch_s for number, _ in places])
        values = np.array([collected[number].rd[k] for number, k in places])
        white = max(collected[number].covariance[k, k] for number, k in places)
        sigma = math.sqrt(white + 2.0 * colour_m**2)
        good = consensus(times - times[0], values, sigma)
        for (number, k), fine in zip(places, good, strict=True):
            kept[number][k] = fine
    return [
        rows if mask.all() else rows.where(mask)
        for rows, mask in zip(collected, kept, strict=True)
        if mask.any()
    ]
