"""Expectations as a JUnit report, which CI systems read."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

from sva_bench.analysis.expectations import Judged
from sva_bench.files.printable import printable


def junit_report(world: str, judged: Sequence[Judged]) -> bytes:
    """A test suite of the world's name, with a test case for each expectation."""
    failed = [one for one in judged if not one.met]
    counts = {"tests": str(len(judged)), "failures": str(len(failed)), "errors": "0", "skipped": "0"}
    suites = ET.Element("testsuites", counts)
    suite = ET.SubElement(suites, "testsuite", {"name": printable(world), **counts})
    for one in judged:
        case = ET.SubElement(suite, "testcase", {"classname": printable(world), "name": printable(one.expression)})
        if not one.met:
            ET.SubElement(case, "failure", {"message": printable(one.said()), "type": "expectation"})
    ET.indent(suites)
    text: bytes = ET.tostring(suites, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
