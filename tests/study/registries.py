"""Registries for tests that need few filters."""

from __future__ import annotations

from swarmctl.study.batch_filter import BatchFilter
from swarmctl.study.registry import FilterFactory, ProcessNoise, Registry, standard_registry


def factory(name: str) -> FilterFactory:
    """The factory of a filter of the standard registry."""

    def make(process_noise: ProcessNoise) -> BatchFilter:
        return standard_registry().filters(process_noise)[name]

    return make


def registry_of(*names: str) -> Registry:
    """The standard formations, and those of the standard filters that are named."""
    registry = Registry()
    for name in names:
        registry.register_filter(name, factory(name))
    for name, slots in standard_registry().formations().items():
        registry.register_formation(name, slots.tolist())
    return registry
