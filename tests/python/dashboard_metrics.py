"""Holds each expression of a Grafana dashboard against the text of /metrics, which comes on standard input, as JSON:

    dashboard_metrics.py DASHBOARD < METRICS

`expressions`: how many there are. `unknown`: what an expression asks for and /metrics does not serve, a metric or a label's value.
`units`: panels whose unit is not that of their metrics' names.
"""

import json
import re
import sys

import promql_parser
from prometheus_client.parser import text_string_to_metric_families

# Labels that Prometheus adds to what it fetches.
ADDED = {"instance", "job"}
# Ends of metric names, and what Grafana calls their unit.
UNITS = {"_seconds": "s", "_m_per_s": "velocityms", "_m": "lengthm", "_pa": "pressurepa", "_n": "forceN", "_kg": "masskg", "_percent": "percent"}


def main():
    samples = [sample for family in text_string_to_metric_families(sys.stdin.read()) for sample in family.samples]
    with open(sys.argv[1], encoding="utf-8") as file:
        dashboard = json.load(file)
    unknown, units, asked = [], [], []
    for panel in dashboard["panels"]:
        targets = [target["expr"] for target in panel.get("targets", [])]
        assert bool(targets) != (panel["type"] == "row"), panel["title"]
        asked += targets
        for expression in targets:
            for selector in selectors(expression):
                wanted = next((unit for end, unit in UNITS.items() if selector.name.endswith(end)), None)
                found = panel["fieldConfig"]["defaults"]["unit"]
                if wanted is not None and found != wanted:
                    units.append(f"{panel['title']}: {selector.name} in {found}")
    asked += [annotation["expr"] for annotation in dashboard["annotations"]["list"]]
    asked += re.findall(r"label_values\((\w+), \w+\)", json.dumps(dashboard["templating"]))
    for expression in asked:
        unknown += [text for selector in selectors(expression) for text in unserved(selector, samples)]
    json.dump({"expressions": len(asked), "unknown": unknown, "units": units}, sys.stdout)


def selectors(expression):
    """The selectors of a PromQL expression, with Grafana's variables filled in."""
    found = []

    def visit(node):
        if isinstance(node, promql_parser.VectorSelector):
            found.append(node)

    tree = promql_parser.parse(expression.replace("$__rate_interval", "1m").replace("$instance", "any"))
    assert promql_parser.walk(tree, visit) and found, expression
    return found


def unserved(selector, samples):
    of_name = [sample for sample in samples if sample.name == selector.name]
    if not of_name:
        return [selector.name]
    matchers = [matcher for matcher in selector.matchers.matchers if matcher.name not in ADDED]
    assert all(matcher.op == promql_parser.MatchOp.Equal for matcher in matchers), selector.name
    return [
        f"{selector.name}{{{matcher.name}={matcher.value}}}"
        for matcher in matchers
        if all(sample.labels.get(matcher.name) != matcher.value for sample in of_name)
    ]


if __name__ == "__main__":
    main()
