"""The policies by name: a new one is a file, and a line here."""

from __future__ import annotations

from collections.abc import Mapping

from sva_bench.choices import PolicyName
from sva_bench.execution.policies.none import none
from sva_bench.execution.policies.policy import Policy

POLICIES: Mapping[PolicyName, Policy] = {"none": none}
