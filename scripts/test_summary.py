"""Counts the tests in a folder of JUnit XML files: one line per package, then 'N passed, N failed'.

Exit status 1 if a test failed, a result file cannot be read or holds no test, or nothing was run.
"""

import collections
import pathlib
import sys
import xml.etree.ElementTree as ElementTree


def outcomes(path):
    """(name, failed) of each test case in one file."""
    root = ElementTree.parse(path).getroot()
    for case in root.iter("testcase"):
        skipped = case.find("skipped") is not None or case.get("status") == "notrun"
        if not skipped:
            failed = case.find("failure") is not None or case.find("error") is not None
            yield "%s.%s" % (case.get("classname"), case.get("name")), failed


def count(folder):
    """Passed and failed tests per package; every failure is printed."""
    passed, failed = collections.Counter(), collections.Counter()
    for path in sorted(folder.rglob("*.xml")):
        package = path.relative_to(folder).parts[0]
        try:
            results = list(outcomes(path))
        except ElementTree.ParseError as error:
            results = [("unreadable (%s)" % error, True)]
        if not results:
            results = [("ran no test", True)]
        for name, is_failure in results:
            (failed if is_failure else passed)[package] += 1
            if is_failure:
                print("FAILED %s: %s" % (path.relative_to(folder), name))
    return passed, failed


def main():
    passed, failed = count(pathlib.Path(sys.argv[1]))
    for package in sorted(set(passed) | set(failed)):
        print("%-20s %4d passed, %d failed" % (package, passed[package], failed[package]))
    print("%d passed, %d failed" % (sum(passed.values()), sum(failed.values())))
    return 0 if passed and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
