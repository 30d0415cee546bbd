"""The policies by name: a new one is a file, and a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from sva_bench.choices import PolicyName
from sva_bench.execution.policies.none import none
from sva_bench.execution.policies.policy import Policy
from sva_bench.execution.policies.resolve import PlansRest, Resolve
from sva_bench.mission.instance import Instance


@dataclass(frozen=True, eq=False, kw_only=True)
class Means:
    """What a policy has to work with.

    Attributes:
        instance: The whole mission, under the failure process executed.
        plans_rest: What plans the rest of a mission.
    """

    instance: Instance
    plans_rest: PlansRest


POLICIES: Mapping[PolicyName, Callable[[Means], Policy]] = {
    "none": lambda means: none,  # noqa: ARG005
    "resolve": lambda means: Resolve(means.instance, means.plans_rest),
}
"""Makes the policy of each name."""
