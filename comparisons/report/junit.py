"""The results as JUnit XML, which continuous-integration systems show: one suite a case, one test a check."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from comparisons.harness.results import CheckResult, Comparison
from gpudem.output.atomic import write_bytes

JUNIT = "junit.xml"

_TAGS = {"fail": "failure", "error": "error", "left_out": "skipped"}
#: Characters that XML 1.0 cannot hold, escaped or not.
_ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write(comparison: Comparison, directory: Path) -> None:
    """Write DIRECTORY/junit.xml."""
    write_bytes(directory / JUNIT, xml(comparison))


def xml(comparison: Comparison) -> bytes:
    """JUnit XML of a comparison; each test carries value, tolerance, unit and against as properties."""
    root = ElementTree.Element("testsuites", name="gpudem", time=f"{comparison.wall_s:.3f}")
    for case in comparison.cases:
        checks = [c for c in comparison.checks if c.case == case.name]
        tally = {
            tag + "s" if tag != "skipped" else tag: sum(c.status == s for c in checks)
            for s, tag in _TAGS.items()
        }
        counts = {"name": _legal(case.name), "tests": len(checks), "time": f"{case.wall_s:.3f}", **tally}
        suite = ElementTree.SubElement(root, "testsuite", {k: str(v) for k, v in counts.items()})
        facts = comparison.provenance
        _properties(
            suite, {"commit": facts.get("commit"), "command": facts.get("command"), "tier": comparison.tier}
        )
        for check in checks:
            _testcase(suite, check)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def _testcase(suite: ElementTree.Element, check: CheckResult) -> None:
    test = ElementTree.SubElement(
        suite, "testcase", classname=_legal(f"gpudem.{check.case}"), name=_legal(check.name)
    )
    fields = (
        "value",
        "tolerance",
        "lo",
        "unit",
        "measured",
        "expected",
        "against",
        "mark",
        "reason",
        "catches",
    )
    _properties(test, {k: getattr(check, k) for k in fields})
    if check.status in _TAGS:
        ElementTree.SubElement(test, _TAGS[check.status], message=_legal(check.verdict)).text = _legal(
            check.reason
        )


def _properties(parent: ElementTree.Element, values: dict[str, object]) -> None:
    properties = ElementTree.SubElement(parent, "properties")
    for name, value in values.items():
        if value is not None and value != "":
            ElementTree.SubElement(properties, "property", name=name, value=_legal(str(value)))


def _legal(text: str) -> str:
    return _ILLEGAL.sub("\ufffd", text)
